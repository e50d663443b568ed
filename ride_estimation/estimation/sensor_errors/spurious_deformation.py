# Copyright 2026 ride_estimation contributors
"""Which share of what looks like deformation of the base is made by noise and errors of its sensors.

How the sum of the stiffnesses is split among the mounts follows from the deformation of the base only, often a few hundredths
of a millimetre. Of that, noise and what installed sensors err by is a share lambda (mean squares): a split that is regressed
on it is attenuated to ``1 - lambda`` of what it is (Fuller, Measurement Error Models, 1987, 1.1), so ``lambda`` times the
standard deviation of the vehicle file stays open, however long the run.

Of the vertical stiffnesses rigid motion determines six sums, those over ``k {1, x, y, x^2, x y, y^2}``: all there is with three
or four mounts. Of five and more a split is left (two rows of three: by ``x^2 y``) that only the deformation shows.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.geometry import Geometry, plate_fit
from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.estimation.sensor_errors.installed_errors import InstalledErrors, Motion

Array = NDArray[np.float64]

#: pattern of vertical stiffnesses of which rigid motion determines this little, share of what it determines of equal ones
_UNOBSERVABLE = 0.25
#: variance of deflection and rate over s^2 dt / w^3 and s^2 dt / w, from white relative acceleration of variance s^2 through
#: six sections s / (s + w): B(9/2, 3/2) / 2 pi and B(11/2, 1/2) / 2 pi
_NOISE = (0.013672, 0.123046)
#: attributes that are part of a saved state
_SAVED = ("_seen", "_noisy", "_wrong")


class SpuriousDeformation:
    """Follows how much the mounts deflect beyond rigid motion and how much of it the sensors may make up.

    Parameters
    ----------
    geometry
        Body and mounts.
    errors
        Of the sensors.
    corner
        w of the sections that deflections and rates were passed through [rad/s].
    """

    def __init__(self, geometry: Geometry, errors: InstalledErrors, corner: float) -> None:
        wrench = geometry.wrench[geometry.free]
        self._rigid = np.linalg.pinv(wrench) @ wrench
        self._errors, self._count = errors, len(geometry.mounts)
        variance = np.array([s.noise_std**2 if s is not None else 0.0 for s in geometry.base_sensors])
        #: share of the square of an error of one mount that looks like deformation, shape (M, 3)
        self._split = 1.0 - np.diag(self._rigid).reshape(self._count, 3)
        #: variance per tick that noise makes of the deforming part of deflection and rate, (2, M, 3)
        self._noise = np.array([share / corner**power for share, power in zip(_NOISE, (3, 1))])[:, None, None] * (
            variance[:, None] * self._split
        )
        #: share of every vertical stiffness in the splits that only the deformation shows, shape (M,)
        self._open = _unobservable_share(plate_fit(geometry.mounts)[0])
        #: sums of squares of what deforms and of what noise makes of it, of deflection and rate, shape (2, M, 3)
        self._seen, self._noisy = np.zeros((2, 2, self._count, 3))
        #: the same of a unit of every error of a base, shape (2, B, 3)
        self._wrong = np.zeros((2, len(errors.mount), 3))

    def observe(self, moved: tuple[Array, Array], base: Motion, dt: float) -> None:
        """Add deflections and rates of the mounts and the motion of their bases, shape (K, 3 M) each, at ticks of ``dt`` [s]."""
        for role, signal in enumerate(moved):
            self._seen[role] += np.sum((signal - signal @ self._rigid.T) ** 2, axis=0).reshape(self._count, 3)
            self._wrong[role] += np.sum(self._errors.hidden(base, role) ** 2, axis=2) * self._split[self._errors.mount]
        self._noisy += len(moved[0]) * dt * self._noise

    def std(self, prior: Array) -> Array:
        """Return the standard deviation of the logarithm of every stiffness and damping that stays open, shape (2, M, 3).

        Parameters
        ----------
        prior
            Standard deviations of the vehicle file, shape (2, M, 3).
        """
        wrong = np.sum(self._errors.std_of_bases[:, None] ** 2 * self._wrong, axis=1) / max(self._count, 1)
        seen, made_up = self._seen.mean(axis=1), self._noisy.mean(axis=1) + wrong
        # where nothing moved yet all is as uncertain as in the file
        share = np.divide(made_up, seen, out=np.ones_like(seen), where=made_up < seen)[:, None, :] * np.ones((2, self._count, 3))
        share[:, :, 2] *= self._open
        return np.asarray(share * prior)

    def save(self) -> dict[str, Any]:
        """Return the sums as plain lists."""
        return fields_of(self, _SAVED)

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        take_fields(self, _SAVED, saved)


def _unobservable_share(place: Array) -> Array:
    """Return the share of each mount in the patterns of vertical stiffness that are not observable by rigid motion, shape (M,).

    Parameters
    ----------
    place
        Horizontal places of the mounts from their middle, shape (M, 2).
    """
    if not len(place):
        return np.zeros(0)
    x, y = (p / max(float(np.sqrt(np.mean(p**2))), 1e-12) for p in place.T)
    surface = np.column_stack([np.ones(len(place)), x, y, x * x, x * y, y * y])
    vectors, values, _ = np.linalg.svd(surface, full_matrices=False)
    kept = vectors[:, values > _UNOBSERVABLE * np.sqrt(len(place))]
    rest = 1.0 - np.sum(kept**2, axis=1)
    return np.asarray(np.sqrt(np.where(rest > 1e-9, rest, 0.0)))
