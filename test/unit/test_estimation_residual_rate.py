# Copyright 2026 ride_estimation contributors
"""Angular rate from centripetal acceleration, judged by rigid bodies that turn at a known rate."""

import numpy as np
import pytest

from ride_estimation.estimation.forces.mount_forces import double_cross_gradient
from ride_estimation.estimation.motion.centripetal import centripetal_terms
from ride_estimation.estimation.motion.residual_rate import ResidualRate

PLACES = np.array([[0.8, 0.6, -0.3], [0.8, -0.6, -0.4], [-0.8, 0.6, -0.3], [-0.7, -0.6, 0.9]])
DIRECTIONS, POINTS = np.tile(np.eye(3), (4, 1)), np.repeat(PLACES, 3, axis=0)
ROWS = np.hstack([DIRECTIONS, np.cross(POINTS, DIRECTIONS)])
WEIGHTS = np.linalg.pinv(ROWS)
DT, NOISE = 0.005, 0.02


def windows(true, guess, error=0.0):
    """Return state and covariances after 20 s at rest and 2 s at ``true`` [rad/s], first thought to be ``guess``."""
    rng = np.random.default_rng(8)
    test = ResidualRate(centripetal_terms(DIRECTIONS, POINTS), ROWS, 6, 0.044)
    state = np.zeros((5, 3))
    for n in range(220):
        omega = true if n >= 200 else np.zeros(3)
        if n in (0, 200):
            state[1] = guess if n else 0.0
            tilt, yaw = np.diag([0.1, 0.1, 0.01]) ** 2, np.diag([0.1, 0.1, 0.01]) ** 2
        turned, w = np.cross(omega, np.cross(omega, PLACES)).ravel(), state[1].copy()
        seen = turned - np.cross(w, np.cross(w, PLACES)).ravel() + error + rng.normal(0.0, NOISE, (20, 12))
        left = seen - seen @ (ROWS @ WEIGHTS).T
        if test.observe(left, np.tile(w, (20, 1)), DT):
            test.correct(WEIGHTS, NOISE**2, 0.01**2, state, tilt, yaw, DT)
    return state, tilt, yaw


@pytest.mark.parametrize("true", [(0.02, 0.0, 0.35), (0.25, -0.1, 0.2)])
def test_the_rate_of_a_rotating_body_is_observable(true):
    state, tilt, yaw = windows(np.array(true), np.array(true) + np.array([0.04, -0.04, -0.06]))
    std = np.sqrt([tilt[1, 1], tilt[1, 1], yaw[1, 1]])
    assert np.all(np.abs(state[1] - true) < 3.0 * std)
    assert np.all(np.abs(state[1] - true) < 0.03)
    assert yaw[1, 1] < 0.05**2


def test_without_rotation_no_rate_is_taken():
    state, tilt, yaw = windows(np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(state[1], 0.0, atol=0.01)
    # what is left to know is as wide as before: a hundredth for the noise that looks like turning
    np.testing.assert_allclose([tilt[1, 1], yaw[1, 1]], 0.01, rtol=0.2)


def test_a_constant_error_of_a_sensor_is_no_rate():
    wrong = np.zeros(12)
    wrong[1] = 0.05
    state, _, yaw = windows(np.array([0.0, 0.0, 0.3]), np.array([0.0, 0.0, 0.3]), wrong)
    assert abs(state[1, 2] - 0.3) < 2.0 * np.sqrt(yaw[1, 1])


def test_the_gradient_of_a_double_cross_product_is_its_difference_quotient():
    rng = np.random.default_rng(4)
    w, arms, step = rng.normal(size=3), rng.normal(size=(4, 3)), 1e-6

    def product(vector):
        return np.cross(vector, np.cross(vector, arms)).ravel()

    found = double_cross_gradient(w, arms)
    for axis in range(3):
        d = step * np.eye(3)[axis]
        # a quadratic form: the central difference is exact but for rounding of 1e-16 / step
        np.testing.assert_allclose(found[:, axis], (product(w + d) - product(w - d)) / (2.0 * step), atol=1e-8)
