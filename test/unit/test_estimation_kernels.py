# Copyright 2026 ride_estimation contributors
"""Compiled loops of the estimators against the formulas of their docstrings in plain numpy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from ride_estimation.estimation.common.block_math import biquad_block, follow_moments
from ride_estimation.estimation.faults.base_kernel import follow_bases
from ride_estimation.estimation.faults.gate_kernel import median, median_root
from ride_estimation.estimation.forces.force_kernel import balanced_forces, follow_scaled, turned_motion, with_deformation
from ride_estimation.estimation.kinematics.bracket_tilt import take_readings
from ride_estimation.estimation.kinematics.frame_kernel import deformation_block, frame_block, straighten
from ride_estimation.estimation.motion.centripetal import centripetal_covariance
from ride_estimation.estimation.parameters.balance_kernel import response_block
from ride_estimation.signals.interpolation import interpolate_streams, interpolate_ticks

#: rounding of sums of some tens of terms of order one
ROUNDING = 1e-12
K, M = 7, 4


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def test_forces_are_those_of_the_law_corrected_by_equilibrium(rng):
    tension, turn = rng.normal(size=(2, K, M, 3))
    static, support, wrench = rng.normal(size=(M, 3)), rng.normal(size=(K, 6)), rng.normal(size=(6, 3 * M))
    gain, gain_slow, slow, square = rng.normal(size=(3 * M, 6)), rng.normal(size=(3 * M, 6)), rng.normal(size=6), np.zeros(6)
    state, told = slow.copy(), np.ones(K, dtype=bool)
    force, missing = np.empty((K, M, 3)), np.empty((K, 6))
    balanced_forces(tension, turn, 0.7, static, support, told, wrench, gain, gain_slow, 0.2, slow, square, missing, force)
    in_mount_axes = static - tension
    across = np.cross(0.7 * turn, in_mount_axes)
    law = (in_mount_axes - across + 0.5 * np.cross(0.7 * turn, across)).reshape(K, -1)
    error = support - law @ wrench.T
    followed = np.empty_like(error)
    for k in range(K):
        state += 0.2 * (error[k] - state)
        followed[k] = state
    wanted = law + (error - followed) @ gain.T + followed @ gain_slow.T
    np.testing.assert_allclose(force.reshape(K, -1), wanted, atol=ROUNDING)
    np.testing.assert_allclose(missing, error, atol=ROUNDING)
    np.testing.assert_allclose(slow, state, atol=ROUNDING)
    np.testing.assert_allclose(square, np.sum(error**2, axis=0), atol=ROUNDING)


def test_motion_is_turned_into_the_axes_of_the_mounts(rng):
    value, rate, turn, turn_rate = rng.normal(size=(4, K, M, 3))
    known = rng.random((M, 3)) < 0.7
    x, v = np.empty((K, M, 3)), np.empty((K, M, 3))
    turned_motion(value, rate, turn, turn_rate, 0.6, known, x, v)
    t, w = 0.6 * turn, 0.6 * turn_rate
    np.testing.assert_allclose(x, known * (value + np.cross(t, value) + 0.5 * np.cross(t, np.cross(t, value))), atol=ROUNDING)
    np.testing.assert_allclose(v, known * (rate + np.cross(t, rate) + np.cross(w, value)), atol=ROUNDING)


def test_deformation_replaces_what_no_rigid_motion_makes(rng):
    total, deformation, projector = rng.normal(size=(K, M, 3)), rng.normal(size=(K, M, 3)), rng.normal(size=(3 * M, 3 * M))
    measured = rng.random(3 * M) < 0.3
    out = np.empty((K, M, 3))
    with_deformation(total, projector, deformation, measured, out)
    flat = total.reshape(K, -1)
    wanted = np.where(measured, flat, flat - flat @ projector.T + deformation.reshape(K, -1))
    np.testing.assert_allclose(out.reshape(K, -1), wanted, atol=ROUNDING)


def test_mean_squares_are_followed(rng):
    signals, scale, square = rng.normal(size=(K, M, 3)), rng.normal(size=(M, 3)), rng.random((M, 3))
    wanted = square + 0.3 * (np.mean((scale * signals) ** 2, axis=0) - square)
    follow_scaled(signals, scale, 0.3, square)
    np.testing.assert_allclose(square, wanted, atol=ROUNDING)


def test_strain_of_a_finite_rotation_is_the_second_order_of_a_rotation_matrix(rng):
    """``R(t) r`` with R of Rodrigues: value, rate and acceleration beyond the first order, by finite differences of R."""
    arms, axis = rng.normal(size=(M, 3)), np.array([0.2, -0.5, 0.3])
    size, step = 2e-3, 1e-3

    def theta(t):
        return size * axis * np.sin(3.0 * t)

    def by_rodrigues(t):
        w = theta(t)
        return np.array([0.5 * np.cross(w, np.cross(w, r)) for r in arms])

    t = 0.4
    omega = (theta(t + step) - theta(t - step)) / (2.0 * step)
    spin = (theta(t + step) - 2.0 * theta(t) + theta(t - step)) / step**2
    flat, second_order, second_order_rate = np.empty((3, 1, 3 * M))
    # the map takes the angular acceleration out of a relative acceleration that holds it in its first entry
    turn_map = np.zeros((3, 3 * M))
    turn_map[:, 0] = spin
    relative = np.zeros((1, M, 3))
    relative[0, 0, 0] = 1.0
    straighten(relative, theta(t)[None], omega[None], turn_map, arms, flat, second_order, second_order_rate)
    rate = (by_rodrigues(t + step) - by_rodrigues(t - step)) / (2.0 * step)
    accel = (by_rodrigues(t + step) - 2.0 * by_rodrigues(t) + by_rodrigues(t - step)) / step**2
    tolerance = (3.0 * step) ** 2 * size**2 * 10.0  # of the differences, of quantities of order size^2 times 3^2
    np.testing.assert_allclose(second_order.reshape(M, 3), -by_rodrigues(t), atol=1e-15)
    np.testing.assert_allclose(second_order_rate.reshape(M, 3), -rate, atol=tolerance)
    np.testing.assert_allclose(relative[0] - flat.reshape(M, 3), -accel, atol=3.0 * tolerance)


def test_response_is_the_recursion_of_its_docstring(rng):
    n = 5
    residual, columns = rng.normal(size=(K, 6)), rng.normal(size=(K, 6, n))
    elastic, viscous, transition = rng.normal(size=(n, 6)), rng.normal(size=(n, 6)), 0.2 * rng.normal(size=(12, 12))
    old, new, feedback = 0.1 * rng.normal(size=(12, 6)), 0.1 * rng.normal(size=(12, 6)), rng.normal(size=(6, 12))
    gain, direction = 0.05 * rng.normal(size=(12, 6)), rng.normal(size=(6, n))
    state, last = rng.normal(size=(12, 1 + n)), rng.normal(size=(12, 1 + n))
    z, inputs, output = state.copy(), last[:6].copy(), last[6:].copy()
    innovation, gradient = np.empty((K, 6)), np.empty((K, 6, n))
    response_block(
        residual, columns, elastic, viscous, transition, old, new, feedback, gain, direction, state, last, innovation, gradient
    )
    for k in range(K):
        free = transition @ z + old @ inputs - gain @ output
        e = free[:, 0] + new @ residual[k]
        inputs = np.column_stack([residual[k], columns[k] + direction * (elastic @ e[:6] + viscous @ e[6:])])
        z = free + new @ inputs
        output = inputs - feedback @ z
        np.testing.assert_allclose(innovation[k], -output[:, 0], atol=ROUNDING)
        np.testing.assert_allclose(gradient[k], output[:, 1:], atol=ROUNDING)
    np.testing.assert_allclose(state, z, atol=ROUNDING)
    np.testing.assert_allclose(last, np.vstack([inputs, output]), atol=ROUNDING)


def test_readings_of_brackets(rng):
    base, body, fit = rng.normal(size=(K, M, 3)), rng.normal(size=(K, M, 3)), rng.normal(size=(4, M))
    slopes, horizontal = np.empty((K, 5)), np.empty((K, 2 * M))
    take_readings(base, body, fit, slopes, horizontal)
    frame, against = base[:, :, 2] @ fit.T, (base - body)[:, :, 2] @ fit.T
    wanted = np.column_stack([against[:, 3], frame[:, 2], -frame[:, 1], against[:, 2], -against[:, 1]])
    np.testing.assert_allclose(slopes, wanted, atol=ROUNDING)
    np.testing.assert_allclose(horizontal, (base - body)[:, :, :2].reshape(K, -1), atol=ROUNDING)


@pytest.mark.parametrize("count", [1, 2, 3, 6, 9])
def test_median(rng, count):
    values = rng.normal(size=12) ** 2
    assert median(values.copy(), count) == np.median(values[:count])
    assert median_root(values, count) == pytest.approx(np.median(np.sqrt(values[:count])), rel=1e-15)


def test_streams_one_after_the_other_are_interpolated_as_each_alone(rng):
    """Different rates, widths and kinds of streams, one of them empty."""
    stamps = [np.cumsum(rng.integers(9, 12, 30)).astype(np.int64), np.arange(0, 330, 5, dtype=np.int64), np.zeros(0, np.int64)]
    samples = [rng.normal(size=(len(s), w)) for s, w in zip(stamps, (3, 2, 1), strict=True)]
    numbers = [(len(s), v.shape[1], c, widest, points, hold) for s, v, c, widest, points, hold in zip(
        stamps, samples, (0, 3, 5), (30, 15, 30), (1, 2, 1), (0, 0, 1), strict=True
    )]  # fmt: skip
    values, valid = np.empty((20, 6)), np.empty((20, 3), dtype=bool)
    joined = np.concatenate([v.ravel() for v in samples])
    interpolate_streams(np.concatenate(stamps), joined, np.array(numbers), 40, 10, values, valid)
    for i, (s, v) in enumerate(zip(stamps, samples, strict=True)):
        own, own_valid = np.empty((20, v.shape[1])), np.empty(20, dtype=bool)
        interpolate_ticks(s, v, 40, 10, numbers[i][3], numbers[i][4], bool(numbers[i][5]), own, own_valid)
        column = numbers[i][2]
        np.testing.assert_array_equal(values[:, column : column + v.shape[1]], own)
        np.testing.assert_array_equal(valid[:, i], own_valid)


def test_biquad_is_that_of_scipy(rng):
    b, a = signal.butter(2, 0.1, "highpass")
    signals, state = rng.normal(size=(K, 5)), rng.normal(size=(2, 5))
    wanted, left = signal.lfilter(b, a, signals, axis=0, zi=state)
    out = np.empty_like(signals)
    biquad_block(signals, b, a, state, out)
    np.testing.assert_allclose(out, wanted, atol=ROUNDING)
    np.testing.assert_allclose(state, left, atol=ROUNDING)


def test_fading_sums_of_products(rng):
    values, columns, total, square = rng.normal(size=(K, 8)), np.array([1, 2, 6]), rng.normal(size=3), rng.normal(size=(3, 3))
    own = values[:, columns]
    wanted, wanted_square = 0.9 * total + own.sum(axis=0), 0.9 * square + own.T @ own
    follow_moments(values, columns, 0.9, total, square)
    np.testing.assert_allclose(total, wanted, atol=ROUNDING)
    np.testing.assert_allclose(square, wanted_square, atol=ROUNDING)


@pytest.mark.parametrize("ticks", [3, 10])
def test_sums_of_the_check_of_the_bases(rng, ticks):
    n, lag, spare = 6, 5, 3.0
    columns, to_plane, project = np.array([1, 2, 3, 5, 6, 7, 8, 9, 11]), rng.normal(size=(9, n)), rng.normal(size=(n, n))
    project = project + project.T
    b, a = signal.butter(2, 0.1, "highpass")
    state, before, size = rng.normal(size=(2, n)), rng.normal(size=(lag, n)), 0.4
    half = rng.normal(size=(3 * n, 3 * n))
    joint = half + half.T
    moments = joint[2 * n :, 2 * n :] / 7.0
    values, numbers = rng.normal(size=(ticks, 12)), np.array([0.01, 0.05**2, spare])
    moving, left = signal.lfilter(b, a, values[:, columns] @ to_plane, axis=0, zi=state)
    residual = moving @ project
    rigid = moving - residual
    course = np.concatenate([before, rigid])
    wanted_size = size + 0.1 * (np.mean(moving**2) - size)
    usual = 0.01 + 0.05**2 * wanted_size
    table = np.hstack([rigid, course[:ticks], residual])
    weight = np.mean(residual**2) * n / (spare * usual)
    wanted_joint = joint + 0.1 * (weight * table.T @ table / ticks - joint)
    wanted_moments = moments + 0.1 * (residual.T @ residual / ticks - moments)
    found = follow_bases(values, columns, to_plane, project, b, a, state, before, numbers, 0.1, size, moments, joint)
    np.testing.assert_allclose(found, (wanted_size, np.trace(wanted_moments) / (spare * usual)), rtol=ROUNDING)
    for own, wanted in ((state, left), (before, course[-lag:]), (moments, wanted_moments), (joint, wanted_joint)):
        np.testing.assert_allclose(own, wanted, rtol=ROUNDING, atol=ROUNDING * np.abs(wanted).max())


@pytest.mark.parametrize("trust", [0.0, 0.6])
def test_deformation_of_a_block_is_that_of_its_steps(rng, trust):
    n = 3 * M
    relative, turn, turn_rate = rng.normal(size=(3, K, M, 3))
    frame_turn, frame_turn_rate = rng.normal(size=(2, K, 3))
    turn_map, arms = rng.normal(size=(3, n)), rng.normal(size=(M, 3))
    projector, tilt = rng.normal(size=(n, n)), rng.normal(size=(n, M))
    filters = 0.3 * rng.normal(size=(3, 4, 4)), rng.normal(size=(3, 4)), rng.normal(size=(3, 4))
    state = rng.normal(size=(6, n))
    wanted_state = state.copy()
    flat, value, rate = np.empty((3, K, n))
    frame_block(
        relative, turn, turn_rate, frame_turn, frame_turn_rate, turn_map, arms, projector, tilt, trust, 0.01, 0.2, *filters,
        state, flat, value, rate,
    )  # fmt: skip
    straight, second_order, second_order_rate = np.empty((3, K, n))
    mean, mean_rate = turn.mean(axis=1) - frame_turn, turn_rate.mean(axis=1) - frame_turn_rate
    straighten(relative, mean, mean_rate, turn_map, arms, straight, second_order, second_order_rate)
    wanted = straight @ projector.T
    own, own_rate = np.zeros((2, K, n))
    for axis in (2, 0, 1):
        if axis == 0:
            wanted += trust * own[:, 2::3] @ tilt.T
        deformation_block(wanted, axis, 3, 0.01, 0.2, *(part[axis] for part in filters), wanted_state, own, own_rate)
    for found, right in (
        (flat, wanted),
        (state, wanted_state),
        (value, (own + second_order) @ projector.T),
        (rate, (own_rate + second_order_rate) @ projector.T),
    ):
        np.testing.assert_allclose(found, right, rtol=ROUNDING, atol=ROUNDING * np.abs(right).max())


def test_covariance_of_the_centripetal_terms(rng):
    weights, terms, rate, variance = rng.normal(size=(6, 12)), rng.normal(size=(12, 9)), rng.normal(size=(K, 3)), rng.random(3)
    mapped = (weights @ terms).reshape(6, 3, 3)
    size = rate.T @ rate / K + 0.5 * np.diag(variance)
    wanted = sum(variance[a] * mapped[:, a] @ size @ mapped[:, a].T for a in range(3))
    found = centripetal_covariance(weights, terms, rate, variance)
    np.testing.assert_allclose(found, wanted, atol=ROUNDING * np.abs(wanted).max())
