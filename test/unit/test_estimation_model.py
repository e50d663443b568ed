# Copyright 2026 ride_estimation contributors
"""The stochastic model: filter and smoother against oracles, derivatives against differences, linear truth."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scipy.linalg as sl
from worlds.adapters import vehicle_of_text
from worlds.cab import random_sensors, random_vehicle
from worlds.vehicle_text import vehicle_yaml

from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.estimation.model.joint import JointEstimate
from ride_estimation.estimation.model.kalman import Derivatives, filter_derivatives, run, sensitivities, smooth, stationary
from ride_estimation.estimation.model.plant import Plant
from ride_estimation.vehicles.vehicle import Vehicle


def small_system(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Two oscillators driven by white noise, three readings."""
    A = sl.block_diag([[0.0, 1.0], [-40.0, -1.0]], [[0.0, 1.0], [-90.0, -2.0]])
    F = sl.expm(0.02 * A)
    root = rng.normal(size=(4, 4))
    return F, rng.normal(size=(3, 4)), 0.01 * root @ root.T, np.diag([0.02, 0.05, 0.1])


def simulate(rng: np.random.Generator, F: np.ndarray, H: np.ndarray, Q: np.ndarray, R: np.ndarray, P: np.ndarray, count: int):
    """Return states and readings that begin with covariance P."""
    x = np.linalg.cholesky(P) @ rng.normal(size=len(F))
    states, root = [], np.linalg.cholesky(Q)
    for _ in range(count):
        states.append(x)
        x = F @ x + root @ rng.normal(size=len(F))
    truth = np.array(states)
    return truth, truth @ H.T + rng.normal(size=(count, len(H))) @ np.sqrt(R)


def test_filter_is_that_of_filterpy() -> None:
    kalman = pytest.importorskip("filterpy.kalman")
    rng = np.random.default_rng(1)
    F, H, Q, R = small_system(rng)
    f = stationary(F, H, Q, R)
    _, y = simulate(rng, F, H, Q, R, f.P, 200)
    oracle = kalman.KalmanFilter(dim_x=4, dim_z=3)
    oracle.F, oracle.H, oracle.Q, oracle.R, oracle.P = F, H, Q, R, f.P.copy()
    oracle.x = np.zeros((4, 1))
    innovations, predicted = run(f, y)
    for k, row in enumerate(y):
        np.testing.assert_allclose(predicted[k], oracle.x[:, 0], atol=1e-9)
        oracle.update(row[:, None])
        np.testing.assert_allclose(innovations[k], oracle.y[:, 0], atol=1e-9)
        oracle.predict()
    np.testing.assert_allclose(oracle.P, f.P, rtol=1e-7)


def test_smoother_is_dense_least_squares() -> None:
    rng = np.random.default_rng(2)
    F, H, Q, R = small_system(rng)
    f = stationary(F, H, Q, R)
    count = 40
    _, y = simulate(rng, F, H, Q, R, f.P, count)
    n = 4 * count
    information, right = np.zeros((n, n)), np.zeros(n)
    information[:4, :4] += np.linalg.inv(f.P)
    weight, noise = np.linalg.inv(Q), np.linalg.inv(R)
    for k in range(count):
        here = slice(4 * k, 4 * k + 4)
        information[here, here] += H.T @ noise @ H
        right[here] += H.T @ noise @ y[k]
        if k + 1 < count:
            both = slice(4 * k, 4 * k + 8)
            step = np.hstack([-F, np.eye(4)])
            information[both, both] += step.T @ weight @ step
    exact = np.linalg.solve(information, right).reshape(count, 4)
    np.testing.assert_allclose(smooth(f, *run(f, y)), exact, atol=1e-8)
    covariance = np.linalg.inv(information)
    middle = slice(4 * (count // 2), 4 * (count // 2) + 4)
    np.testing.assert_allclose(f.smoothed_covariance(), covariance[middle, middle], rtol=2e-2)


def test_smoothed_and_predicted_states_have_the_covariance_they_state() -> None:
    rng = np.random.default_rng(3)
    F, H, Q, R = small_system(rng)
    f = stationary(F, H, Q, R)
    truth, y = simulate(rng, F, H, Q, R, f.P, 20000)
    innovations, predicted = run(f, y)
    for states, covariance in ((predicted, f.P), (smooth(f, innovations, predicted), f.smoothed_covariance())):
        error = (states - truth)[100:-100]
        nees = np.einsum("ki,ij,kj->k", error, np.linalg.inv(covariance), error).mean() / 4.0
        assert 0.95 < nees < 1.05
        assert np.all(np.abs(error.mean(axis=0)) < 0.3 * np.sqrt(np.diag(covariance)))
    white = innovations @ f.whitening().T
    assert np.mean(white**2) == pytest.approx(1.0, abs=0.03)


def test_an_unstable_system_without_readings_is_refused() -> None:
    with pytest.raises(InputDataError, match="no stationary value"):
        stationary(np.array([[1.1]]), np.zeros((1, 1)), np.eye(1), np.eye(1))


def test_derivatives_of_the_filter_are_differences() -> None:
    rng = np.random.default_rng(4)
    F, H, Q, R = small_system(rng)
    dF, dH, h = rng.normal(size=F.shape), rng.normal(size=H.shape), 1e-6
    root = rng.normal(size=(4, 4))
    dQ, dR, dc = root @ root.T, np.array([0.3, 0.1, 0.2]), rng.normal(size=3)
    f = stationary(F, H, Q, R)
    up, down = (stationary(F + e * dF, H + e * dH, Q + e * dQ, R + e * np.diag(dR)) for e in (h, -h))
    d = Derivatives(dF[None], dQ[None], dH[None], dc[None], dR[None], np.full(3, -1))
    gains, covariances = filter_derivatives(f, d)
    np.testing.assert_allclose(covariances[0], (up.S - down.S) / (2 * h), rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(gains[0], (up.F @ up.K - down.F @ down.K) / (2 * h), rtol=1e-4, atol=1e-5)
    _, y = simulate(rng, F, H, Q, R, f.P, 250)
    nu, x = run(f, y)
    difference = (run(up, y - h * dc)[0] - run(down, y + h * dc)[0]) / (2 * h)
    found = np.vstack([part[:, :, 0] for _, part in sensitivities(f, nu, x, d, gains)])
    np.testing.assert_allclose(found, difference, rtol=1e-4, atol=1e-4)


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    rng = np.random.default_rng(5)
    cab = random_vehicle(rng, "air")
    sensors = random_sensors(cab, rng, displacement=(("front_left", "z"),))
    return vehicle_of_text(vehicle_yaml(cab, sensors))


def test_the_score_is_the_derivative_of_the_likelihood(vehicle: Vehicle) -> None:
    plant = Plant(vehicle)
    rng = np.random.default_rng(6)
    widths = [1 if s.kind == "displacement" else 3 for s in plant.sensors]
    size = np.repeat([1e-3 if w == 1 else 0.5 for w in widths], widths)
    joint = JointEstimate(plant, [rng.normal(size=(300, sum(widths))) * size], 0.005)
    slow = plant.slow
    _, gradient = joint.normal_equations(joint.model())
    start = joint.theta.copy()
    base = slow.sensors["chassis_front_left"]
    body = slow.sensors["cab_front_left"]
    for i in (
        slow.log_stiffness.start + 2, slow.log_damping.start, slow.cg.start, slow.log_deforming.start, slow.log_model.start,
        body["gain"].start, body["position"].start, base["misalignment"].start + 1,
    ):  # fmt: skip
        values = []
        for h in (1e-5, -1e-5):
            joint.theta = start.copy()
            joint.theta[i] += h
            values.append(joint.cost(joint.model()))
        joint.theta = start
        at = int(np.searchsorted(slow.free, i))
        assert gradient[at] == pytest.approx((values[0] - values[1]) / 2e-5, rel=2e-3, abs=0.05), i


def test_a_vehicle_the_model_does_not_describe_is_refused_in_one_line(vehicle: Vehicle) -> None:
    sensors = {n: s for n, s in vehicle.sensors.items() if n not in ("chassis_front_left", "cab_front_left", "cab_front_right")}
    with pytest.raises(ConfigurationError, match=r"front_left") as caught:
        Plant(dataclasses.replace(vehicle, sensors=sensors))
    assert "at least 3" in str(caught.value)
