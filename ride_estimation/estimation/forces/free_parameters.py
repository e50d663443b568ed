# Copyright 2026 ride_estimation contributors
"""The multipliers to be estimated: which element, which role, what was known of it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from ride_estimation.elements.base import ForceElement
from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.forces.mount_law import ROLES
from ride_estimation.frames import AXES
from ride_estimation.vehicles.prior import log_std
from ride_estimation.vehicles.vehicle import Mount, Prior


@dataclasses.dataclass(frozen=True)
class FreeParameter:
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


def find_free_parameters(geometry: Geometry, settings: PipelineSettings) -> tuple[FreeParameter, ...]:
    """Return the multipliers the elements of a geometry have, stiffness first."""
    return find_free_parameters_of(geometry.mounts, settings)


def find_free_parameters_of(mounts: Sequence[Mount], settings: PipelineSettings) -> tuple[FreeParameter, ...]:
    """Return the multipliers the elements of some mounts have, stiffness first; ``FreeParameter.mount`` counts these mounts."""
    found = []
    for role in range(len(ROLES)):
        for i, mount in enumerate(mounts):
            for a, axis in enumerate(AXES):
                if axis in mount.elements:
                    parameter = _free_parameter(role, i, a, mount, mount.elements[axis], settings)
                    if parameter is not None:
                        found.append(parameter)
    return tuple(found)


def _free_parameter(
    role: int, i: int, a: int, mount: Mount, element: ForceElement, settings: PipelineSettings
) -> FreeParameter | None:
    declared = [p for p in element.parameters() if p.role == ROLES[role] and getattr(element, p.name) != 0.0]
    if not declared:
        return None
    name = declared[0].name
    value = abs(float(getattr(element, name)))
    prior = mount.priors.get((AXES[a], name), Prior(value))
    usual = settings.prior_stiffness_std if role == 0 else settings.prior_damping_std
    ratio = settings.largest_ratio
    lower = max(prior.lower / value, 1.0 / ratio) if prior.lower > 0.0 else 1.0 / ratio
    upper = min(max(prior.upper / value, 1.0), ratio)
    return FreeParameter(role, i, a, log_std(prior, value, usual), math.log(min(lower, 1.0)), math.log(upper))
