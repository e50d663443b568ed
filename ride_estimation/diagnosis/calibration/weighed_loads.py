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

from ride_estimation.diagnosis.common.settings import Tolerances
from ride_estimation.diagnosis.model.plant import Plant
from ride_estimation.estimation.forces.mount_forces import STATIC_LOAD_STD
from ride_estimation.frames import AXES, COORDINATES
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: coordinates along which vertical loads balance a weight
_BALANCED = ("z", "roll", "pitch")
_LEFT = {2: "N upwards", 3: "N m of roll", 4: "N m of pitch"}
#: standard deviations from which on weighed loads contradict mass and CG
_CONTRADICTED = 3.0
#: relative standard deviation of a mass that states none
MASS_STD = 0.01
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
        Weighed loads less the weight that the model has [N, N m].
    std
        Standard deviation of that beside the CG [N, N m].
    """

    body: str
    coordinate: int
    left: float
    std: float


def balances(plant: Plant, tolerances: Tolerances) -> tuple[Balance, ...]:
    """Return the equilibria that weighed loads contradict, at the CGs of a plant but for those that causes name.

    Bodies count whose mounts are all weighed; all three equations of a body are returned where one of them is contradicted.
    """
    return tuple(
        b for name, stated in _stated(plant) if not _absurd(plant, stated) and _contradicted(plant, stated, tolerances)
        for b in _balanced(plant, name, {})
    )


def contradictions(plant: Plant, tolerances: Tolerances) -> tuple[str, ...]:
    """Return words on weighed loads that do not fit mass and CG of the vehicle file."""
    out = []
    for name, stated in _stated(plant):
        if _absurd(plant, stated):
            left = f"differ from its weight by {stated[0].left:.4g} N, which no load explains: not used"
        elif _contradicted(plant, stated, tolerances):
            left = "contradict its mass or CG, with " + ", ".join(
                f"{b.left:.4g} +- {b.std:.2g} {_LEFT[b.coordinate]}" for b in stated
            ) + " left"
        else:
            continue
        out.append(f"the weighed static loads of the mounts of {name} {left}")
    return tuple(out)


def _stated(plant: Plant) -> list[tuple[str, list[Balance]]]:
    """Return the bodies whose mounts are all weighed with their equilibria at the CG of the vehicle file."""
    out = []
    for name in dict.fromkeys(b for b, c in plant.coordinates if c == _BALANCED[0]):
        mounts = [m for m in plant.vehicle.mounts.values() if m.body == name]
        if mounts and all(m.static_load is not None for m in mounts):
            out.append((name, _balanced(plant, name, plant.body_errors)))
    return out


def _absurd(plant: Plant, stated: Sequence[Balance]) -> bool:
    body = plant.vehicle.bodies[stated[0].body]
    return abs(stated[0].left) > LARGEST_LOAD * body.mass.value * plant.vehicle.gravity


def _contradicted(plant: Plant, stated: Sequence[Balance], tolerances: Tolerances) -> bool:
    """Return whether weighed loads do not fit mass and CG of the vehicle file, each as well as it is known."""
    body = plant.vehicle.bodies[stated[0].body]
    shift = body.mass.value * plant.vehicle.gravity * np.array(tolerances.of_cg(body))
    # roll tells the CG along y, pitch that along x
    spread = {2: 0.0, 3: float(shift[1]), 4: float(shift[0])}
    return any(abs(b.left) > _CONTRADICTED * math.hypot(b.std, spread[b.coordinate]) for b in stated)


def _balanced(plant: Plant, name: str, errors: Mapping[tuple[str, str, str], float]) -> list[Balance]:
    """Return the equilibria of one body, without some errors of CGs that the plant holds and those that causes name."""
    vehicle, weight = plant.vehicle, np.zeros(6)

    def cg_of(body: str) -> Array:
        held = [errors.get(("cg", body, a), 0.0) + plant.named_cg.get((body, a), 0.0) for a in AXES]
        return np.asarray(vehicle.bodies[body].cg - np.array(held))

    about, variance = cg_of(name), np.zeros(6)
    for body in carried(vehicle, name):
        mass = vehicle.bodies[body].mass
        one = _wrench(cg_of(body) - about, vehicle.gravity)
        weight += mass.value * one
        variance += ((MASS_STD * mass.value if mass.std is None else mass.std) * one) ** 2
    for mount in vehicle.mounts.values():
        load = mount.static_load
        if mount.body == name and load is not None:
            one = _wrench(mount.position - about, 1.0)
            weight -= load.value * one
            variance += ((STATIC_LOAD_STD * abs(load.value) if load.std is None else load.std) * one) ** 2
    own = [COORDINATES.index(c) for c in _BALANCED if c in vehicle.bodies[name].coordinates]
    return [Balance(name, i, -float(weight[i]), math.sqrt(max(float(variance[i]), 1e-12))) for i in own]


def _wrench(arm: Array, force: float) -> Array:
    """Return the wrench of an upward force at an arm, shape (6,)."""
    up = np.array([0.0, 0.0, force])
    return np.concatenate([up, np.cross(arm, up)])


def carried(vehicle: Vehicle, body: str) -> tuple[str, ...]:
    """Return a body and all that it carries."""
    found = [body]
    for name in found:
        found += [b for b in dict.fromkeys(m.body for m in vehicle.mounts.values() if m.base == name) if b not in found]
    return tuple(found)


def balance_of(known: Sequence[tuple[str, int]], vehicle: Vehicle, body: str, weight: Array) -> dict[int, float]:
    """Return what a further weight adds to weighed loads, place of the balance -> [N, N m].

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
