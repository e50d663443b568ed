# Copyright 2026 ride_estimation contributors
"""Gyros against the turning of accelerometers whose readings are written down from a rotation with known derivatives."""

from __future__ import annotations

import re

import numpy as np
import pytest

from ride_estimation.estimation.faults.gyro_check import GyroCheck
from ride_estimation.estimation.motion.sensor_drift import motion_error
from ride_estimation.sensors.layout import motion_rows
from ride_estimation.sensors.sensor import Sensor

RATE, BLOCK = 200.0, 20
PLACES = np.array([[0.8, 0.6, -0.3], [0.8, -0.6, -0.3], [-0.8, 0.6, -0.3], [-0.7, -0.6, 0.9]])
SENSORS = [Sensor(f"s{i}", "imu" if i == 0 else "accelerometer", f"/s{i}", "cab", position=p) for i, p in enumerate(PLACES)]
ROWS = motion_rows(SENSORS, np.zeros(3))


def found(factors: tuple[float, float, float], readings_off: float = 1.0, seconds: float = 3.0) -> tuple[GyroCheck, list[int]]:
    rng = np.random.default_rng(3)
    t = np.arange(0.0, seconds, 1.0 / RATE)
    hertz, size, phase = rng.uniform(1.0, 4.0, (5, 3)), rng.uniform(0.02, 0.1, (5, 3)), rng.uniform(0.0, 6.0, (5, 3))
    angle = 2.0 * np.pi * hertz * t[:, None, None] + phase
    rate = np.sum(size * np.sin(angle), axis=1)
    turning = np.sum(size * 2.0 * np.pi * hertz * np.cos(angle), axis=1)
    force = np.column_stack([np.sin(9.0 * t), np.cos(7.0 * t), 9.8 + 2.0 * np.sin(11.0 * t)])
    readings = np.hstack([force + np.cross(turning, p) + np.cross(rate, np.cross(rate, p)) for p in PLACES])
    readings += 0.02 * rng.normal(size=readings.shape)
    readings[:, 3:6] *= readings_off
    gyro = (rate * factors + 0.001 * rng.normal(size=rate.shape) + 0.01)[:, None]
    check, new = GyroCheck(SENSORS, (0,), ROWS, np.ones(6, dtype=bool)), []
    for k in range(0, len(t) - BLOCK, BLOCK):
        part = slice(k, k + BLOCK)
        new += check.observe(readings[part], gyro[part], np.ones((BLOCK, 4), dtype=bool), 1.0 / RATE)
    return check, new


@pytest.mark.parametrize(
    ("factors", "words"),
    # two seconds of turning and the noise of the readings tell a factor to a few hundredths
    [
        ((57.2958,) * 3, "deg/s instead of rad/s"),
        ((1.0, -1.0, 1.0), r"-(0\.9|1\.0)\d about y"),
        ((0.5, 0.5, 0.5), r"\+0\.(4[5-9]|5[0-5]) about x"),
    ],
)
def test_wrong_unit_sign_and_gain(factors: tuple[float, float, float], words: str) -> None:
    check, new = found(factors)
    assert new == [0]
    (message,) = check.messages()
    assert re.search(words, message)
    again = GyroCheck(SENSORS, (0,), ROWS, np.ones(6, dtype=bool))
    again.load(check.save())
    assert again.messages() == check.messages()


def test_good_gyro_and_faulty_accelerometer() -> None:
    assert found((1.0, 1.0, 1.0))[1] == []
    assert found((1.1, 1.1, 1.1))[1] == []
    # it is not the gyro where an accelerometer contradicts the body
    assert found((1.0, 1.0, 1.0), readings_off=-1.0)[1] == []


def test_too_few_accelerometers_leave_gyros_untested() -> None:
    assert not GyroCheck(SENSORS[:2], (0,), ROWS[:6], np.ones(6, dtype=bool)).possible


@pytest.mark.parametrize("place", range(4))
def test_drift_of_one_sensor_moves_the_motion_as_least_squares_does(place: int) -> None:
    error = np.zeros(12)
    error[3 * place : 3 * place + 3] = (0.3, -0.2, 0.5)
    moved = np.linalg.lstsq(ROWS, error, rcond=None)[0]
    change = error - ROWS @ moved
    assert np.allclose(motion_error(change, ROWS, np.linalg.pinv(ROWS)), moved, atol=1e-12)
