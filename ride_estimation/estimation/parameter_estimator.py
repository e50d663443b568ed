# Copyright 2026 ride_estimation contributors
"""Stiffness and damping of every mount and axis while driving."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.arrangement import Arrangement
from ride_estimation.estimation.estimate import Estimate, Status
from ride_estimation.estimation.mount_law import ROLES
from ride_estimation.estimation.settings import PipelineSettings
from ride_estimation.frames import AXES
from ride_estimation.vehicles.vehicle import Prior

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Slot:
    """One multiplier: role (0 stiffness, 1 damping), mount and axis index, prior and bounds of its logarithm."""

    role: int
    mount: int
    axis: int
    std: float
    lower: float
    upper: float


def slots(arrangement: Arrangement, settings: PipelineSettings) -> tuple[Slot, ...]:
    """Return the multipliers the elements of an arrangement have."""
    found = []
    for role, name in enumerate(ROLES):
        for i, mount in enumerate(arrangement.mounts):
            for a, axis in enumerate(AXES):
                if axis not in mount.elements:
                    continue
                element = mount.elements[axis]
                declared = [p for p in element.parameters() if p.role == name and getattr(element, p.name) != 0.0]
                if not declared:
                    continue
                first = declared[0]
                value = float(getattr(element, first.name))
                prior = mount.priors.get((axis, first.name), Prior(value))
                default = settings.prior_stiffness_std if role == 0 else settings.prior_damping_std
                relative = prior.std / abs(value) if prior.std else default
                lower = np.log(max(prior.lower / value, 1.0 / settings.largest_ratio)) if prior.lower > 0 else -np.log(settings.largest_ratio)
                upper = np.log(min(prior.upper / value, settings.largest_ratio))
                found.append(Slot(role, i, a, float(np.sqrt(np.log1p(relative**2))), float(min(lower, 0.0)), float(max(upper, 0.0))))
    return tuple(found)


class ParameterEstimator:
    """Multipliers of the mount elements; holds the vehicle file's values until the data can tell more.

    Parameters
    ----------
    arrangement
        Body, mounts, sensors.
    settings
        Of the pipeline.
    """

    def __init__(self, arrangement: Arrangement, settings: PipelineSettings) -> None:
        self.arrangement = arrangement
        self.settings = settings
        self.slots = slots(arrangement, settings)
        self.log = np.zeros(len(self.slots))
        self.log_std = np.array([s.std for s in self.slots])
        self.stamp_ns = 0

    def multipliers(self) -> Array:
        """Return the multipliers, shape (2, M, 3)."""
        return self._spread(np.exp(self.log), 1.0)

    def stds(self) -> Array:
        """Return the standard deviations of the logarithms, shape (2, M, 3)."""
        return self._spread(self.log_std, 0.0)

    def _spread(self, values: Array, empty: float) -> Array:
        result = np.full((2, len(self.arrangement.mounts), 3), empty)
        for slot, value in zip(self.slots, values):
            result[slot.role, slot.mount, slot.axis] = value
        return result

    def estimates(self) -> tuple[Estimate, ...]:
        """Return one estimate per parameter of the elements that is scaled."""
        found = []
        for n, slot in enumerate(self.slots):
            mount, axis = self.arrangement.mounts[slot.mount], AXES[slot.axis]
            element = mount.elements[axis]
            for p in element.parameters():
                if p.role != ROLES[slot.role]:
                    continue
                prior = float(getattr(element, p.name))
                value = prior * float(np.exp(self.log[n]))
                status, reason = Status.STARTING, "no excitation yet"
                found.append(
                    Estimate(f"{mount.name}.{axis}.{p.name}", value, abs(value) * float(self.log_std[n]), p.unit, prior, status, reason, self.stamp_ns)
                )
        return tuple(found)

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        return {"log": self.log.tolist(), "log_std": self.log_std.tolist()}

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        self.log = np.array(saved["log"], dtype=float)
        self.log_std = np.array(saved["log_std"], dtype=float)
