# Copyright 2026 ride_estimation contributors
"""The six-channel matrix B of document 000 eq. (3), (4): hand-written rows, determinant, singular layouts, least squares."""

from __future__ import annotations

import numpy as np
import pytest

from ride_estimation.errors import ConfigurationError
from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator
from ride_estimation.sensors.layout import b_matrix
from ride_estimation.sensors.sensor import Sensor


def printed_b(r1, r2, r3):
    """Return B as eq. (3) prints it; measurements in the order [a2x, a2y, a2z, a3z, a1z, a3y], which the paper never states."""
    (x1, y1, _), (x2, y2, z2), (x3, y3, z3) = r1, r2, r3
    return np.array([
        [1, 0, 0, 0, z2, -y2],
        [0, 1, 0, -z2, 0, x2],
        [0, 0, 1, y2, -x2, 0],
        [0, 0, 1, y3, -x3, 0],
        [0, 0, 1, y1, -x1, 0],
        [0, 1, 0, -z3, 0, x3],
    ], dtype=float)  # fmt: skip


R1, R2, R3 = np.array([0.8, 0.5, -0.7]), np.array([-0.8, 0.5, -0.6]), np.array([0.7, -0.5, -0.7])
CHANNELS = [(R2, "x"), (R2, "y"), (R2, "z"), (R3, "z"), (R1, "z"), (R3, "y")]


def test_rows_agree_with_the_printed_matrix_to_rounding():
    np.testing.assert_allclose(b_matrix(CHANNELS), printed_b(R1, R2, R3), atol=1e-15)


def test_determinant_is_distance_times_twice_the_plan_triangle():
    x1, y1, x2, y2, x3, y3 = R1[0], R1[1], R2[0], R2[1], R3[0], R3[1]
    closed_form = -(x2 - x3) * (x1 * (y2 - y3) + x2 * (y3 - y1) + x3 * (y1 - y2))
    assert np.linalg.det(b_matrix(CHANNELS)) == pytest.approx(closed_form, rel=1e-12)


def test_six_channels_return_rigid_motion_exactly():
    rng = np.random.default_rng(3)
    motion = rng.normal(size=6)
    # a_i = a + alpha x r_i, written out without the product's matrix
    measured = [(motion[:3] + np.cross(motion[3:], r))["xyz".index(axis)] for r, axis in CHANNELS]
    np.testing.assert_allclose(np.linalg.solve(b_matrix(CHANNELS), measured), motion, atol=1e-12)


@pytest.mark.parametrize(
    "places",
    [
        (R1, R2, np.array([-0.8, -0.5, -0.7])),  # sensors 2 and 3 with equal x
        (np.array([0.0, 0.0, 0.0]), np.array([-0.8, 0.4, 0.0]), np.array([0.8, -0.4, 0.0])),  # on one line in plan
    ],
)
def test_singular_layouts_are_refused_in_words(places):
    r1, r2, r3 = places
    with pytest.raises(ConfigurationError, match="off one line"):
        b_matrix([(r2, "x"), (r2, "y"), (r2, "z"), (r3, "z"), (r1, "z"), (r3, "y")])


def test_twelve_channels_are_better_than_six_and_leave_the_expected_residual():
    """Noise 0.02 m/s^2: residual RMS sigma sqrt(6/12) = 0.0141 (ride_models 0-3)."""
    rng = np.random.default_rng(5)
    corners = [np.array([x, y, -0.7]) for x in (0.8, -0.8) for y in (0.5, -0.5)]
    sensors = [Sensor(f"s{i}", "accelerometer", f"/s{i}", "cab", position=r, noise_std=0.02) for i, r in enumerate(corners)]
    estimator = CgMotionEstimator(sensors, np.zeros(3), np.ones(6, dtype=bool), 9.80665)
    samples = rng.normal(scale=0.02, size=(20000, 12)) + np.tile([0.0, 0.0, 9.80665], 4)
    block = estimator.observe(samples, np.zeros((20000, 0)), np.ones((20000, 4), dtype=bool), 0.002)
    residual = samples - block.predicted
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(0.02 * np.sqrt(0.5), rel=0.02)
    six = np.linalg.inv(printed_b(corners[0], corners[2], corners[1]))
    six_std = 0.02 * np.sqrt(np.sum(six**2, axis=1))
    twelve_std = block.motion.std(axis=0)
    np.testing.assert_allclose(twelve_std, np.sqrt(np.diag(block.covariance)), rtol=0.05)
    assert np.all(six_std[:3] > 1.3 * twelve_std[:3])
