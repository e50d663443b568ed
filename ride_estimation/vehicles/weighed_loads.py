# Copyright 2026 ride_estimation contributors
"""What mounts that were weighed say about mass and CG: equilibrium of a body under its weighed loads.

``sum(F_i) = m g`` and ``sum((r_i - r_CG) x F_i e_z) = 0``. Loads that fit mass and CG of the file were weighed without what the
body may carry now and say nothing of it; loads that do not fit were weighed with something that mass and CG leave out.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.frames import COORDINATES
from ride_estimation.vehicles.prior import MASS_STD, STATIC_LOAD_STD, cg_std_of, std_of
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: coordinates along which vertical loads balance a weight, and what of them does not
_LEFT = {"z": "N upwards", "roll": "N m of roll", "pitch": "N m of pitch"}
#: standard deviations from which on weighed loads contradict mass and CG
_CONTRADICTED = 3.0
#: largest share of the mass of a body that comes or goes as a load
LARGEST_LOAD = 0.6


@dataclasses.dataclass(frozen=True)
class Balance:
    """One equation of the equilibrium of a body.

    Attributes
    ----------
    body, coordinate
        Which one; the coordinate is a row of a wrench, 2 to 4.
    left
        Weighed loads less the weight [N], [N m].
    std
        Standard deviation of that beside the CG [N], [N m].
    """

    body: str
    coordinate: int
    left: float
    std: float


def balances(vehicle: Vehicle, name: str, cgs: Mapping[str, Array] | None = None) -> tuple[Balance, ...]:
    """Return the equilibrium of a body under its weighed loads, empty where not all of its mounts are weighed.

    Parameters
    ----------
    name
        Body; its weight is that of all it carries.
    cgs
        CGs of bodies other than in the vehicle, shape (3,) each [m].
    """
    mounts = [m for m in vehicle.mounts.values() if m.body == name]
    if "z" not in vehicle.bodies[name].coordinates or not mounts or any(m.static_load is None for m in mounts):
        return ()
    places = {body: known.cg for body, known in vehicle.bodies.items()} | dict(cgs or {})
    left, variance = np.zeros(6), np.zeros(6)
    for body in carried(vehicle, name):
        one = _wrench(places[body] - places[name], vehicle.gravity)
        left -= vehicle.bodies[body].mass.value * one
        variance += (std_of(vehicle.bodies[body].mass, MASS_STD) * one) ** 2
    for mount in mounts:
        if mount.static_load is not None:
            one = _wrench(mount.position - places[name], 1.0)
            left += mount.static_load.value * one
            variance += (std_of(mount.static_load, STATIC_LOAD_STD) * one) ** 2
    own = [COORDINATES.index(c) for c in _LEFT if c in vehicle.bodies[name].coordinates]
    return tuple(Balance(name, i, float(left[i]), math.sqrt(max(float(variance[i]), 1e-12))) for i in own)


def absurd(vehicle: Vehicle, stated: Sequence[Balance]) -> bool:
    """Return whether loads are farther off a weight than a load can be, as those of another unit."""
    return any(
        b.coordinate == 2 and abs(b.left) > LARGEST_LOAD * vehicle.bodies[b.body].mass.value * vehicle.gravity for b in stated
    )


def contradicted(vehicle: Vehicle, stated: Sequence[Balance]) -> bool:
    """Return whether loads do not fit mass and CG, each as well as the vehicle file knows it."""
    spread = {2: 0.0}
    for body in {b.body for b in stated}:
        known = vehicle.bodies[body]
        cg = cg_std_of(known)
        # roll tells the CG along y, pitch that along x
        spread |= {3: known.mass.value * vehicle.gravity * cg[1], 4: known.mass.value * vehicle.gravity * cg[0]}
    return any(abs(b.left) > _CONTRADICTED * math.hypot(b.std, spread[b.coordinate]) for b in stated)


def contradiction(vehicle: Vehicle, name: str) -> str:
    """Return words on weighed loads of a body that do not fit mass and CG of the vehicle file, empty where they do."""
    stated = balances(vehicle, name)
    words = f"the weighed static loads of the mounts of {name}"
    if absurd(vehicle, stated):
        return f"{words} differ from its weight by {stated[0].left:.4g} N, which no load explains"
    if contradicted(vehicle, stated):
        left = ", ".join(f"{b.left:.4g} +- {b.std:.2g} {_LEFT[COORDINATES[b.coordinate]]}" for b in stated)
        return f"{words} contradict its mass or CG, with {left} left"
    return ""


def carried(vehicle: Vehicle, body: str) -> tuple[str, ...]:
    """Return a body and all that it carries."""
    found = [body]
    for name in found:
        found += [b for b in dict.fromkeys(m.body for m in vehicle.mounts.values() if m.base == name) if b not in found]
    return tuple(found)


def balance_of(known: Sequence[tuple[str, int]], vehicle: Vehicle, body: str, weight: Array) -> dict[int, float]:
    """Return what a further weight adds to weighed loads, place of the balance -> [N], [N m].

    Parameters
    ----------
    known
        Body and coordinate of every balance.
    body, weight
        Where the weight attacks, its wrench about the CG of that body, shape (6,).
    """
    out = {}
    for i, (name, coordinate) in enumerate(known):
        if body in carried(vehicle, name):
            arm = vehicle.bodies[body].cg - vehicle.bodies[name].cg
            moment = weight[3:] + np.cross(arm, weight[:3])
            out[i] = -float(np.concatenate([weight[:3], moment])[coordinate])
    return {i: value for i, value in out.items() if value != 0.0}


def _wrench(arm: Array, force: float) -> Array:
    """Return the wrench of an upward force at an arm, shape (6,)."""
    up = np.array([0.0, 0.0, force])
    return np.concatenate([up, np.cross(arm, up)])
