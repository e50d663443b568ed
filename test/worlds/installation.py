# Copyright 2026 ride_estimation contributors
"""Sensors as a workshop installs them: every kind of error at once, normally distributed."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

from .cab import CabSensor


def installed(
    sensors: tuple[CabSensor, ...], seed: int, *, bias: float, gain: float, misalignment: float, position: float, delay: float
) -> tuple[CabSensor, ...]:  # fmt: skip
    """Return sensors with errors of given standard deviations [m/s^2, -, rad, m, s]."""
    rng = np.random.default_rng([seed, 9])
    return tuple(
        dataclasses.replace(
            s, true_rotation=s.rotation @ Rotation.from_rotvec(misalignment * rng.standard_normal(3)).as_matrix(),
            true_position=s.position + position * rng.standard_normal(3), gain=1.0 + gain * rng.standard_normal(3),
            bias=bias * rng.standard_normal(3), delay_s=delay * rng.standard_normal(),
        )
        for s in sensors
    )  # fmt: skip
