# Copyright 2026 ride_estimation contributors
"""Guarded filter, least squares with forgetting and the common high-pass, each against an oracle of its own."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal, stats
from scipy.linalg import solve_discrete_are

from ride_estimation.errors import InputDataError
from ride_estimation.estimation.parameters.balance_kernel import high_pass_block, integrate_block, low_pass_block
from ride_estimation.estimation.parameters.guarded_ekf import GuardedEkf
from ride_estimation.estimation.parameters.response import _riccati
from ride_estimation.estimation.parameters.rls import RecursiveLeastSquares, forgetting_noise


def test_update_is_the_textbook_kalman_update():
    rng = np.random.default_rng(0)
    p = np.diag([1.0, 4.0, 0.5])
    h, r, y = rng.normal(size=(2, 3)), np.diag([0.1, 0.2]), np.array([0.3, -0.4])
    ekf = GuardedEkf(np.zeros(3), p)
    assert ekf.nis(y, h, r) == pytest.approx(y @ np.linalg.inv(h @ p @ h.T + r) @ y)
    assert not ekf.update(y, h, r)
    gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + r)
    np.testing.assert_allclose(ekf.x, gain @ y, rtol=1e-10)
    np.testing.assert_allclose(ekf.p, (np.eye(3) - gain @ h) @ p, atol=1e-12)


@pytest.mark.parametrize(
    ("innovation", "jacobian", "r", "reason"),
    [
        (np.array([np.nan]), np.ones((1, 2)), np.eye(1), "not_finite"),
        (np.array([1.0]), np.full((1, 2), np.inf), np.eye(1), "not_finite"),
        (np.ones((1, 1)), np.ones((1, 2)), np.eye(1), "shape"),
        (np.array([1.0]), np.ones((1, 3)), np.eye(1), "shape"),
        (np.array([1.0]), np.ones((1, 2)), np.eye(2), "shape"),
    ],
)
def test_bad_measurements_change_nothing(innovation, jacobian, r, reason):
    ekf = GuardedEkf(np.array([1.0, 2.0]), np.eye(2))
    assert ekf.update(innovation, jacobian, r) == reason
    np.testing.assert_array_equal(ekf.x, [1.0, 2.0])
    np.testing.assert_array_equal(ekf.p, np.eye(2))


def test_normalised_innovation_squared_is_chi_squared():
    """4000 good measurements of two channels: mean 2 and 5 % above the quantile, within 3 sigma."""
    rng = np.random.default_rng(1)
    p, h = np.diag([0.5, 2.0]), np.array([[1.0, 0.5], [0.0, 1.0]])
    ekf = GuardedEkf(np.zeros(2), p)
    drawn = rng.multivariate_normal(np.zeros(2), h @ p @ h.T + np.eye(2), size=4000)
    found = np.array([ekf.nis(y, h, np.eye(2)) for y in drawn])
    assert found.mean() == pytest.approx(2.0, abs=3.0 * 2.0 / np.sqrt(4000))
    assert 0.039 < np.mean(found > stats.chi2.ppf(0.95, 2)) < 0.061


def test_zero_noise_and_repeated_updates_keep_the_covariance_positive():
    ekf = GuardedEkf(np.zeros(3), np.eye(3))
    for k in range(500):
        h = np.eye(3)[[k % 3]] + 1e-9
        ekf.update(np.array([0.1]), h, np.zeros((1, 1)))
        ekf.predict(np.zeros((3, 3)))
    assert np.linalg.eigvalsh(ekf.p).min() > 0.0
    assert np.all(np.isfinite(ekf.x))


def test_bad_process_noise_and_bad_start_are_refused():
    ekf = GuardedEkf(np.zeros(2), np.eye(2))
    assert not ekf.predict(np.full((2, 2), np.nan))
    assert not ekf.predict(-2.0 * np.eye(2))
    np.testing.assert_array_equal(ekf.p, np.eye(2))
    with pytest.raises(InputDataError, match="positive definite"):
        GuardedEkf(np.zeros(2), -np.eye(2))
    with pytest.raises(InputDataError, match="do not match"):
        GuardedEkf(np.zeros(2), np.eye(3))


def test_rls_agrees_with_batch_least_squares():
    rng = np.random.default_rng(2)
    phi = rng.normal(size=(200, 4))
    truth = np.array([1.0, -2.0, 0.5, 3.0])
    y = phi @ truth + 0.1 * rng.normal(size=200)
    rls = RecursiveLeastSquares(np.zeros(4), np.full(4, 1e3), forgetting=1.0 - 1e-12)
    for rows, part in zip(np.split(phi, 20), np.split(y, 20)):
        rls.update(rows.T @ rows, rows.T @ (part - rows @ rls.theta))
    np.testing.assert_allclose(rls.theta, np.linalg.lstsq(phi, y, rcond=None)[0], atol=1e-5)


def test_rls_does_not_wind_up_without_excitation_and_still_tracks_with_it():
    """10000 updates that excite one direction only leave the covariance of the others where it was."""
    rng = np.random.default_rng(3)
    rls = RecursiveLeastSquares(np.zeros(2), np.ones(2), forgetting=0.95)
    for _ in range(50):
        rows = rng.normal(size=(20, 2))
        rls.update(rows.T @ rows, rows.T @ (rows @ np.array([1.0, 2.0]) - rows @ rls.theta))
    before = rls.p.copy()
    for _ in range(10000):
        rows = np.array([[rng.normal(), 0.0]])
        rls.update(rows.T @ rows, rows.T @ (rows @ np.array([1.5, 2.0]) - rows @ rls.theta))
    assert rls.p[1, 1] < 1.05 * before[1, 1]
    assert rls.theta[0] == pytest.approx(1.5, abs=1e-3)
    assert rls.theta[1] == pytest.approx(2.0, abs=0.05)  # moved once, by its old correlation with the one that jumped
    assert not rls.update(np.full((2, 2), np.nan), np.zeros(2))
    assert rls.rejected == 1


def test_forgetting_never_loses_more_than_arrives():
    rng = np.random.default_rng(4)
    a = rng.normal(size=(5, 5))
    p = a @ a.T + np.eye(5)
    rows = rng.normal(size=(2, 5))
    information = rows.T @ rows
    after = np.linalg.inv(p + forgetting_noise(p, information, 0.9)) + information
    assert np.linalg.eigvalsh(after - np.linalg.inv(p)).min() > -1e-9


@pytest.mark.parametrize("frequency", [2.0, 8.0, 25.0])
def test_deflection_and_rate_belong_together_with_the_high_passed_signal(frequency):
    """Acceleration of a known deflection, integrated, against that deflection high-passed: 0.1 % of the deflection and
    0.2 % of the rate up to 25 Hz at 500 Hz."""
    rate, corner = 500.0, 2.5
    t = np.arange(9000) / rate
    w = 2 * np.pi * frequency
    x, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    passed = np.empty((9000, 1))
    high_pass_block(a[:, None], corner, 1 / rate, np.zeros((3, 1)), passed)
    deflection, speed = np.empty((9000, 1)), np.empty((9000, 1))
    integrate_block(passed, corner, 1 / rate, np.zeros((9, 1)), deflection, speed)
    wanted = np.empty((9000, 2))
    high_pass_block(np.column_stack([x, v]), corner, 1 / rate, np.zeros((7, 2)), wanted)
    late = slice(7500, None)
    for mine, true, tolerance in ((deflection, wanted[:, :1], 1e-3), (speed, wanted[:, 1:], 2e-3)):
        assert np.max(np.abs(mine[late] - true[late])) < tolerance * np.max(np.abs(true[late]))


def test_sections_agree_with_scipy():
    """Bilinear sections against scipy's filters to rounding."""
    rng = np.random.default_rng(6)
    u = rng.normal(size=(800, 2))
    corner, dt = 2.5, 0.002
    b, a = signal.bilinear([1.0, 0.0], [1.0, corner], 1 / dt)
    wanted = u
    for _ in range(6):
        wanted = signal.lfilter(b, a, wanted, axis=0)
    got = np.empty_like(u)
    high_pass_block(u, corner, dt, np.zeros((7, 2)), got)
    np.testing.assert_allclose(got, wanted, atol=1e-12)
    b, a = signal.bilinear([1.0], [1.0, corner], 1 / dt)
    low_pass_block(u, corner, dt, np.zeros((3, 2)), got)
    np.testing.assert_allclose(got, signal.lfilter(b, a, signal.lfilter(b, a, u, axis=0), axis=0), atol=1e-12)


def test_riccati_agrees_with_scipy():
    rng = np.random.default_rng(7)
    a = rng.normal(size=(6, 6))
    a *= 0.99 / np.abs(np.linalg.eigvals(a)).max()
    c = rng.normal(size=(2, 6))
    q, r = np.eye(6), np.diag([1.0, 3.0])
    np.testing.assert_allclose(_riccati(a, c, q, r), solve_discrete_are(a.T, c.T, q, r), rtol=1e-8)
