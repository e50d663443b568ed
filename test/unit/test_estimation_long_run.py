# Copyright 2026 ride_estimation contributors
"""Hours of driving with sensors in good order: their residuals say the same after an hour as after a minute."""

from __future__ import annotations

import numpy as np
import pytest

from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator
from ride_estimation.sensors.sensor import Sensor

GRAVITY, NOISE, RATE, BLOCK = 9.81, 0.05, 20.0, 10
PLACES = np.array([[0.6, 0.8, 0.3], [0.7, -0.8, -0.2], [-0.8, 0.7, 0.1], [-0.7, -0.9, 0.5]])


def drift(seconds: float, drifting_from: float) -> tuple[np.ndarray, float]:
    """Return the largest constant part added to the covariance of the motion in the last minute, and the bias std of the rate."""
    rng = np.random.default_rng(5)
    sensors = [Sensor(f"s{i}", "accelerometer", "", "cab", position=p, noise_std=NOISE) for i, p in enumerate(PLACES)]
    motion = CgMotionEstimator(sensors, np.zeros(3), np.ones(6, dtype=bool), GRAVITY, PipelineSettings())
    added = [np.zeros(6)]
    for k in range(round(seconds * RATE / BLOCK)):
        force = rng.normal(size=(BLOCK, 3)) + np.array([0.0, 0.0, GRAVITY])
        samples = force @ motion.rows[:, :3].T + rng.normal(scale=NOISE, size=(BLOCK, 12))
        samples[:, 5] += 0.05 * max(k * BLOCK / RATE - drifting_from, 0.0)  # z of the second sensor
        motion.observe(samples, np.zeros((BLOCK, 0)), np.ones((BLOCK, 4), dtype=bool), 1.0 / RATE)
        constant = motion.disagreement(1.0 / RATE)[2]
        if k * BLOCK / RATE > seconds - 60.0:
            added.append(np.sqrt(np.diagonal(constant)))
    return np.max(added, axis=0), float(np.sqrt(motion._p_tilt[2, 2]))


@pytest.mark.parametrize("seconds", [90.0, 400.0])
def test_sensors_in_good_order_never_seem_to_drift(seconds: float) -> None:
    added, bias_std = drift(seconds, np.inf)
    # biases by chance: what noise leaves of a mean over a minute
    assert added.max() < NOISE / np.sqrt(60.0 * RATE / 4.0) * 5.0
    assert bias_std < 0.02


@pytest.mark.parametrize("seconds", [90.0, 400.0])
def test_a_drift_is_seen_at_any_time(seconds: float) -> None:
    added, bias_std = drift(seconds, seconds - 10.0)
    # half a metre per second squared in ten seconds on one of four sensors: an eighth of it in the motion at least
    assert added[2] > 0.5 / 8.0
    assert bias_std > 0.02
