# Copyright 2026 ride_estimation contributors
"""The multipliers to be estimated: which element, which role, what was known of it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from ride_estimation.elements.base import ForceElement
from ride_estimation.estimation.common.arrangement import Arrangement
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.forces.mount_law import ROLES
from ride_estimation.frames import AXES
from ride_estimation.vehicles.vehicle import Mount, Prior


@dataclasses.dataclass(frozen=True)
class Slot:
    """One multiplier of all parameters of a role of one element.

    Attributes
    ----------
    role
        0 stiffness, 1 damping.
    mount, axis
        Indices.
    std, lower, upper
        Standard deviation and bounds of the logarithm.
    """

    role: int
    mount: int
    axis: int
    std: float
    lower: float
    upper: float


def find_slots(arrangement: Arrangement, settings: PipelineSettings) -> tuple[Slot, ...]:
    """Return the multipliers the elements of an arrangement have, stiffness first."""
    return find_slots_of(arrangement.mounts, settings)


def find_slots_of(mounts: Sequence[Mount], settings: PipelineSettings) -> tuple[Slot, ...]:
    """Return the multipliers the elements of some mounts have, stiffness first; ``Slot.mount`` counts these mounts."""
    found = []
    for role in range(len(ROLES)):
        for i, mount in enumerate(mounts):
            for a, axis in enumerate(AXES):
                if axis in mount.elements:
                    slot = _slot(role, i, a, mount, mount.elements[axis], settings)
                    if slot is not None:
                        found.append(slot)
    return tuple(found)


def _slot(role: int, i: int, a: int, mount: Mount, element: ForceElement, settings: PipelineSettings) -> Slot | None:
    declared = [p for p in element.parameters() if p.role == ROLES[role] and getattr(element, p.name) != 0.0]
    if not declared:
        return None
    name = declared[0].name
    value = abs(float(getattr(element, name)))
    prior = mount.priors.get((AXES[a], name), Prior(value))
    default = settings.prior_stiffness_std if role == 0 else settings.prior_damping_std
    relative = prior.std / value if prior.std else default
    ratio = settings.largest_ratio
    lower = max(prior.lower / value, 1.0 / ratio) if prior.lower > 0.0 else 1.0 / ratio
    upper = min(max(prior.upper / value, 1.0), ratio)
    return Slot(role, i, a, math.sqrt(math.log1p(relative**2)), math.log(min(lower, 1.0)), math.log(upper))
