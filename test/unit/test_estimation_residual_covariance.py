# Copyright 2026 ride_estimation contributors
"""What the spare equations say about noise and biases, against drawn errors."""

from __future__ import annotations

import numpy as np
import pytest

from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator
from ride_estimation.estimation.motion.residual_covariance import error_of_one, residual_covariance
from ride_estimation.sensors.installation import Installation
from ride_estimation.sensors.sensor import Sensor

STATED = 0.02**2
SPARE = 6


def layout(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Rows of four triaxial sensors at random places, shape (12, 6), and their least squares."""
    places = rng.uniform(-1.0, 1.0, (4, 3))
    blocks = []
    for x, y, z in places:
        # a_i = a + alpha x r_i
        blocks.append(np.hstack([np.eye(3), np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])]))
    rows = np.vstack(blocks)
    return rows, np.linalg.pinv(rows)


def judged(rng: np.random.Generator, rows: np.ndarray, weights: np.ndarray, noise: float, bias: np.ndarray, ticks: int = 4000):
    """Return factor and covariance by biases for drawn noise, independent from tick to tick."""
    errors = bias + noise * rng.standard_normal((ticks, 12))
    residuals = errors - errors @ weights.T @ rows.T
    return residual_covariance(residuals.mean(axis=0), residuals.var(axis=0), np.full(12, STATED), weights, float(ticks), SPARE)


def test_noise_as_stated_adds_nothing_and_more_noise_scales_by_as_much():
    rng = np.random.default_rng(1)
    rows, weights = layout(rng)
    factor, biases = judged(rng, rows, weights, 0.02, np.zeros(12))
    # chance of 1 000 independent ticks
    assert factor == 1.0 and np.trace(biases) < 1e-2 * STATED * np.trace(weights @ weights.T)
    factor, _ = judged(rng, rows, weights, 0.06, np.zeros(12))
    # 24 000 squares: one per cent
    assert factor == pytest.approx(3.0, rel=0.03)


def test_biases_of_all_sensors_are_as_large_in_the_motion_as_said():
    rng = np.random.default_rng(2)
    rows, weights = layout(rng)
    normalised = []
    for _ in range(300):
        bias = 0.1 * rng.standard_normal(12)
        factor, covariance = judged(rng, rows, weights, 0.02, bias, ticks=200)
        assert factor == 1.0
        normalised.append(np.einsum("i,ij,j->", weights @ bias, np.linalg.inv(covariance), weights @ bias) / 6.0)
    # a ratio of two estimates of the same variance with six degrees of freedom each: F(6, 6), whose median is one
    assert np.median(normalised) == pytest.approx(1.0, abs=0.25)


def test_error_of_one_sensor_is_read_from_its_residuals():
    rng = np.random.default_rng(3)
    rows, weights = layout(rng)
    error = np.zeros(12)
    error[3:6] = [0.3, -0.2, 0.5]
    residuals = error - rows @ (weights @ error)
    moved = weights @ error
    constant, nothing = error_of_one(rows, weights, 1, residuals, np.zeros((12, 12)), np.ones(12), np.ones(12))[::-1]
    assert np.allclose(constant, np.outer(moved, moved), atol=0.04 * moved @ moved) and not nothing.any()


def test_what_three_sensors_do_not_show_of_one_is_as_wrong_as_what_they_show():
    """Three sensors in a plane: an error across it is a rotation to them. Along it the sensor reads a tenth too much."""
    corners = [(0.8, 0.7), (-0.9, 0.6), (0.1, -0.8)]
    rows = np.vstack([np.hstack([np.eye(3), [[0.0, 0.0, -y], [0.0, 0.0, x], [y, -x, 0.0]]]) for x, y in corners])
    weights = np.linalg.pinv(rows)
    rng = np.random.default_rng(4)
    readings = rng.normal(size=(4000, 3)) * [1.0, 2.0, 3.0] + [0.0, 0.0, 9.81]
    errors = np.zeros((4000, 9))
    errors[:, :3] = 0.1 * readings
    residuals = errors - errors @ weights.T @ rows.T
    mean, variance = np.tile(readings.mean(axis=0), 3), np.tile(readings.var(axis=0), 3)
    moving, constant = error_of_one(rows, weights, 0, residuals.mean(axis=0), np.cov(residuals.T), mean, variance)
    moved = errors @ weights.T
    # chance of 4 000 draws, and of how far the axes in the plane happen to be alike
    assert np.allclose(np.sqrt(np.diag(moving)), moved.std(axis=0), rtol=0.05, atol=1e-6)
    assert np.allclose(np.sqrt(np.diag(constant)), np.abs(moved.mean(axis=0)), rtol=0.05, atol=0.01)


def test_a_body_of_one_sensor_states_what_its_installation_leaves() -> None:
    """Nothing to spare shows gain, angle and bias: over many installations the stated covariance is that of the errors."""
    rng = np.random.default_rng(41)
    sensor = Sensor("one", "accelerometer", "/one", "body", noise_std=0.005, installation=Installation(0.03, 0.02, 0.01))
    moved = rng.standard_normal((200, 3)) * [0.5, 0.5, 3.0]
    squares = []
    for _ in range(200):
        gain, turn, bias = rng.standard_normal((3, 3)) * [[0.02], [0.01], [0.03]]
        true = moved + np.array([0.0, 0.0, 9.81])
        read = (1.0 + gain) * (true - np.cross(turn, true)) + bias
        free = np.array([False, False, True, False, False, False])
        estimator = CgMotionEstimator([sensor], np.zeros(3), free, 9.81)
        out = estimator.observe(read, np.zeros((len(read), 0)), np.ones((len(read), 1), dtype=bool), 0.01)
        _, added, constant = estimator.disagreement(0.01)
        error = out.motion[:, :3] - true
        lasting, moving = error.mean(axis=0) ** 2 / np.diag(constant)[:3], error.var(axis=0) / np.diag(added)[:3]
        squares.append([lasting.mean(), moving.mean()])
    assert np.allclose(np.mean(squares, axis=0), 1.0, rtol=0.15)
