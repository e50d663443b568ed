# Copyright 2026 ride_estimation contributors
"""Motion of the centre of gravity over a block of ticks."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.motion.motion_kernel import motion_at

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclasses.dataclass(frozen=True)
class MotionBlock:
    """CG motion at K ticks: specific force and angular acceleration (K, 6), rate, tilt (K, 3), what the accelerometers read for
    it (K, C); variance of the rate (3,).
    """

    motion: Array
    covariance: Array
    rate: Array
    tilt: Array
    tilt_variance: float
    predicted: Array
    valid: BoolArray
    rate_variance: Array = dataclasses.field(default_factory=lambda: np.zeros(3))

    def at(self, arms: Array) -> Array:
        """Return the specific force of the body at points (M, 3) relative to the CG, shape (K, M, 3)."""
        result = np.empty((len(self.motion), len(arms), 3))
        motion_at(self.motion, self.rate, arms, result)
        return result
