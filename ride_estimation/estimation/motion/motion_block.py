# Copyright 2026 ride_estimation contributors
"""Motion of the centre of gravity over a block of ticks."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclasses.dataclass(frozen=True)
class MotionBlock:
    """CG motion at K ticks: specific force and angular acceleration (K, 6), rate, tilt (K, 3), what the accelerometers read for
    it (K, C); variances of roll, rate (3,) and pitch.
    """

    motion: Array
    covariance: Array
    rate: Array
    tilt: Array
    roll_variance: float
    predicted: Array
    valid: BoolArray
    rate_variance: Array = dataclasses.field(default_factory=lambda: np.zeros(3))
    pitch_variance: float = 0.0
