# Copyright 2026 ride_estimation contributors
"""Course of the parameters of a finished run: what was learned later counts for earlier times too, until something changed.

Backwards in time every estimate is mixed with the later ones, ``x = (1 - C) x + C x_later``. C is one where the later estimate
is surer (a run begins with the vehicle file's values), falls with the memory of the online estimator where both are alike and is
nearly zero where the standard deviation jumped up, which it does where the estimator found that the vehicle had changed.
The same mixture of the variances is never too small, however the errors go together: the square is convex.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.forces.force_basis import ForceModel

Array = NDArray[np.float64]


def smoothed_course(models: Sequence[ForceModel], durations: Array, memory: float) -> list[ForceModel]:
    """Return the parameters of every piece of a run, smoothed over the run.

    Parameters
    ----------
    models
        As they were known at the time.
    durations
        Of the pieces [s].
    memory
        Time over which parameters stay similar [s].
    """
    found = [models[-1]]
    for n in range(len(models) - 2, -1, -1):
        now, later, raw = models[n], found[-1], models[n + 1]
        fresh = -float(np.expm1(-durations[n] / memory))
        share = _share(now.std, raw.std, later.std, fresh)
        mass = float(_share(np.array(now.mass_std), np.array(raw.mass_std), np.array(later.mass_std), fresh))
        turn = float(_share(np.array(now.inertia_std), np.array(raw.inertia_std), np.array(later.inertia_std), fresh))
        found.append(
            dataclasses.replace(
                now,
                multipliers=np.exp(_mixed(np.log(now.multipliers), np.log(later.multipliers), share)),
                std=np.sqrt(_mixed(now.std**2, later.std**2, share)),
                misread=np.maximum(now.misread, (1.0 - fresh) * later.misread),
                mass=now.mass + mass * (later.mass - now.mass),
                mass_std=float(np.sqrt(now.mass_std**2 + mass * (later.mass_std**2 - now.mass_std**2))),
                inertia=_mixed(now.inertia, later.inertia, np.array(turn)),
                inertia_std=float(np.sqrt(now.inertia_std**2 + turn * (later.inertia_std**2 - now.inertia_std**2))),
                cg_offset=now.cg_offset + (1.0 - fresh) * (later.cg_offset - now.cg_offset),
                loaded=now.loaded or (mass > 0.5 and later.loaded),
                follow=now.follow + (1.0 - fresh) * (later.follow - now.follow),
            )
        )
    return found[::-1]


def _mixed(now: Array, later: Array, share: Array) -> Array:
    return np.asarray(now + share * (later - now))


def _share(now: Array, raw: Array, later: Array, fresh: float) -> Array:
    """Return C from the standard deviations now, at the next instant, and of what is known later."""
    own, following, best = now**2, raw**2, later**2
    surer = np.minimum(1.0, best / np.maximum(own, 1e-300))
    jumped = np.where(following > own, own / np.maximum(following, 1e-300), 1.0)
    return np.asarray((1.0 - fresh * surer) * jumped)
