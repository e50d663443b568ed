# Copyright 2026 ride_estimation contributors
"""The last line behind filters that are stable by themselves: arithmetic that fails, forces and travel that no vehicle can have.

Either is a numerical fault. It is counted in words, the ticks of the block are handed out as not valid, and the pipeline begins
anew from what was learned before.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.errors import RideEstimationError
from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.kinematics.deflection import LARGEST_TRAVEL
from ride_estimation.estimation.output import OutputBlock
from ride_estimation.frames import AXES
from ride_estimation.signals.streams import Block

Array = NDArray[np.float64]
T = TypeVar("T")

#: what arithmetic on unforeseen numbers may raise (LinAlgError is a ValueError)
NUMERICAL_ERRORS = (ArithmeticError, ValueError, RideEstimationError)
#: reason of the restart that follows
NUMERICAL_FAULT = "numerical fault, estimates start again"
#: time of good estimates after which a fault is over [s]: what began anew is then as good as it was
_OVER = 10.0
#: different faults that are kept in words, so that a run of weeks cannot fill the memory with them
MOST_FAULTS, OTHER_FAULTS = 20, "others"
#: acceleration of a body whose sensors state no full scale that its mounts may be loaded with [m/s^2]: thirty times gravity
_LARGEST_ACCELERATION = 300.0
#: load on one mount over what all together carry: a body that turns loads one side and relieves the other
_ON_ONE_MOUNT = 2.0
#: bisections of the travel in which a law takes a force: to a micrometre
_BISECTIONS = 20
#: variance of what is not estimated [unit^2]
_UNKNOWN_VARIANCE = 1e6


def fault_messages(faults: Mapping[str, int]) -> list[str]:
    """Return one sentence per numerical fault."""
    return [f"numerical fault ({count} times): {text}; motion and forces began anew" for text, count in faults.items()]


class NumericalGuard:
    """Judge of what the pipeline computes.

    Parameters
    ----------
    geometry
        Body and mounts; its masses and the full scale of its sensors limit the load, the laws of its mounts (springs, gaps
        and stiffness of stops) how far that load deflects them.
    """

    def __init__(self, geometry: Geometry) -> None:
        #: words -> times
        self.faults: Counter[str] = Counter()
        self._good = math.inf
        self._mounts = len(geometry.mounts)
        reach = max((s.reach for s in geometry.body_sensors if math.isfinite(s.reach)), default=_LARGEST_ACCELERATION)
        #: largest force a mount can carry, and the largest load on the body [N]: all its weight at the largest acceleration
        self.largest = _ON_ONE_MOUNT * geometry.file_mass * (reach + geometry.vehicle.gravity)
        ends = [[[self._travel(m.elements.get(axis), sign) for sign in (-1.0, 1.0)] for axis in AXES] for m in geometry.mounts]
        #: deflections at which the laws of the file take that force, compression and extension, shape (M, 3, 2) [m]
        self.travel = np.array(ends).reshape(self._mounts, 3, 2)

    def _travel(self, element: ForceElement | None, sign: float) -> float:
        """Return the deflection in a direction at which a law takes the largest force at rest, or the most there is [m]."""
        low, high = 0.0, LARGEST_TRAVEL
        if element is None or not abs(element.force(element.initial(), sign * high, 0.0)) >= self.largest:
            return sign * high
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            beyond = abs(element.force(element.initial(), sign * middle, 0.0)) >= self.largest
            low, high = (low, middle) if beyond else (middle, high)
        return sign * high

    def count(self, text: str) -> None:
        """Count a fault by its words, at most :data:`MOST_FAULTS` different ones."""
        self.faults[text if text in self.faults or len(self.faults) < MOST_FAULTS else OTHER_FAULTS] += 1
        self._good = 0.0

    @property
    def faulty(self) -> bool:
        """Return whether the estimates are not yet those of before the last fault."""
        return self._good < _OVER

    def attempt(self, step: Callable[[], T]) -> T | None:
        """Return what a step returns, None where its arithmetic fails: overflow and invalid operations of numpy do."""
        try:
            with np.errstate(over="raise", invalid="raise", divide="raise"):
                return step()
        except NUMERICAL_ERRORS as error:
            self.count(f"{type(error).__name__}: {error}")
            return None

    def accept(self, block: OutputBlock, step_s: float) -> bool:
        """Return whether the numbers of a block, a tick of ``step_s`` apart, are finite and, where valid, what it can carry."""
        numbers = (
            block.cg_accel, block.cg_accel_covariance, block.angular_rate, block.tilt, block.inertial_load, block.support_load,
            block.mount_force, block.mount_force_std, block.mount_deflection, block.mount_rate, block.mount_deflection_std,
        )  # fmt: skip
        if not np.isfinite(np.concatenate([part.ravel() for part in numbers])).all():
            self.count("estimates are not finite")
            return False
        valid = slice(None) if block.valid.all() else block.valid
        loads = (block.inertial_load[valid, :3], block.mount_force[valid])
        if max(np.abs(load).max(initial=0.0) for load in loads) > self.largest:
            self.count(f"a load beyond {self.largest:.3g} N, which the vehicle cannot carry")
            return False
        moved = block.mount_deflection[valid]
        if ((moved < self.travel[..., 0]) | (moved > self.travel[..., 1])).any():
            self.count("a mount beyond the travel at which its law takes the largest load")
            return False
        self._good += float(np.count_nonzero(block.valid)) * step_s
        return True

    def nothing(self, block: Block, like: Mapping[str, slice]) -> OutputBlock:
        """Return the ticks of a block without an estimate: not valid, zero, with a standard deviation that says so.

        Parameters
        ----------
        block
            Samples.
        like
            Name of every accelerometer of the body -> its columns.
        """
        ticks, mounts = len(block.values), self._mounts
        six, three, forces = np.zeros((ticks, 6)), np.zeros((ticks, 3)), np.zeros((ticks, mounts, 3))
        unknown, wide = _UNKNOWN_VARIANCE * np.eye(6), np.full((ticks, mounts, 3), self.largest)
        sensors = {name: np.zeros((ticks, 3)) for name in like}
        return OutputBlock(
            stamp_ns=block.stamps_ns, valid=np.zeros(ticks, dtype=bool), cg_accel=six, cg_accel_covariance=unknown,
            cg_specific_force=six, cg_specific_force_covariance=unknown, angular_rate=three,
            angular_rate_std=np.full(3, math.sqrt(_UNKNOWN_VARIANCE)), tilt=three,
            inertial_load=six, support_load=six, load_covariance=self.largest**2 * np.eye(6),
            inertial_load_covariance=self.largest**2 * np.eye(6), mount_force=forces, mount_force_std=wide,
            mount_force_std_equilibrium=wide, mount_force_std_model=wide, mount_deflection=forces, mount_rate=forces,
            mount_deflection_std=np.ones((mounts, 3)), measured=sensors, predicted=sensors, incomplete=True, loaded=False,
            left_out=(),
        )  # fmt: skip
