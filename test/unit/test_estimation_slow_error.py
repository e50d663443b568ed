# Copyright 2026 ride_estimation contributors
"""Quiet sensors that are not quite straight: pulling away must not make attitude and deflections run away."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.kinematics.bracket_tilt import BracketTilt
from ride_estimation.estimation.kinematics.deflection import DeflectionEstimator
from ride_estimation.estimation.motion.centripetal import centripetal_covariance, centripetal_terms
from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator
from ride_estimation.estimation.motion.motion_block import MotionBlock
from ride_estimation.estimation.motion.slow_error import LastingAcceleration, with_slow_error
from ride_estimation.io.vehicle_file import load_vehicle

VEHICLE = load_vehicle(pathlib.Path(__file__).parents[2] / "config/vehicles/truck_cab.yaml")
#: sensors with a noise of 0.0002 m/s^2
GEOMETRY = geometry_of(VEHICLE.with_noise_scaled(0.01))
G, DT, BLOCK = 9.80665, 0.01, 10
ANGLE = np.radians(0.3)
#: what sensors in good order read wrongly of an acceleration: 0.3 % of gain and 0.004 rad
SHARE = 0.005


def pulling_away(seconds: float) -> np.ndarray:
    """Specific force (K, 3) of a truck that stands, pulls away with 1.5 m/s^2 from 5 s to 13 s and then holds its speed."""
    time = np.arange(0.0, seconds, DT)
    forward = 1.5 * ((time > 5.0) & (time < 13.0))
    return np.column_stack([forward, np.zeros_like(time), np.full_like(time, G)])


def test_attitude_returns_after_pulling_away_with_quiet_sensors_at_a_slight_angle():
    rng = np.random.default_rng(3)
    a = GEOMETRY
    estimator = CgMotionEstimator(a.body_sensors, a.body.cg, a.free, G)
    for s in range(len(a.body_sensors)):
        estimator.set_variance(s, np.full(3, 0.002**2))
    force = pulling_away(45.0)
    readings = []
    for sensor in a.body_sensors:
        e = ANGLE * rng.standard_normal(3)
        turned = force + np.cross(force, e)
        readings.append(turned @ sensor.rotation + 0.002 * rng.standard_normal(force.shape))
    samples = np.hstack(readings)
    there = np.ones((BLOCK, len(a.body_sensors)), dtype=bool)
    tilt = []
    for start in range(0, len(samples), BLOCK):
        block = estimator.observe(samples[start : start + BLOCK], np.zeros((BLOCK, 0)), there, DT)
        tilt.append(block.tilt[-1, :2])
    error = np.degrees(np.abs(np.array(tilt)))
    # an acceleration cannot be told from a slope while it lasts: 1.5 m/s^2 look like 8.7 degrees; its onset overshoots
    assert error.max() < 2.0 * 8.7
    # ten seconds after which it cannot be an acceleration, and as much again
    assert error[-100:].max() < 1.0


def test_deflections_stay_near_while_bracket_sensors_at_an_angle_pull_away():
    a = GEOMETRY
    count = len(a.mounts)
    estimator = DeflectionEstimator(a, BracketTilt(a))
    force = pulling_away(20.0)
    rng = np.random.default_rng(5)
    base = np.stack([force + np.cross(force, ANGLE * rng.standard_normal(3)) for _ in range(count)], axis=1)
    motion = np.hstack([force, np.zeros((len(force), 3))])
    largest = 0.0
    for start in range(0, len(force), BLOCK):
        part = slice(start, start + BLOCK)
        block = MotionBlock(
            motion[part], 1e-8 * np.eye(6), np.zeros((BLOCK, 3)), np.zeros((BLOCK, 3)), 0.0,
            np.zeros((BLOCK, 0)), np.ones(BLOCK, dtype=bool),
        )  # fmt: skip
        none = np.zeros((BLOCK, count, 3))
        found = estimator.observe(
            block, base[part], np.ones((BLOCK, count), dtype=bool), np.ones(BLOCK, dtype=bool), none, none > 0.0,
            np.full((count, 3), 1e-8), DT,
        )
        largest = max(largest, float(np.abs(found.deflection[:, :, 2]).max()))
    # nothing moves: what is left is the angle times the acceleration over the square of a corner near 0.4 Hz
    assert largest < ANGLE * 1.5 / (2.0 * np.pi * 0.4) ** 2


@pytest.mark.parametrize(("white", "slow"), [(1e-4, 0.0), (1e-6, 1e-5), (1e-9, 1e-4), (1e-3, 1e-7)])
def test_slow_error_is_the_density_at_the_corner_it_leads_to(white, slow):
    held = 4e-3
    found = with_slow_error(white, slow, held, DT)
    roots = np.roots([held * DT, 0.0, 0.0, 0.0, -white * DT, -2.0 * slow])
    corner = max(r.real for r in roots if abs(r.imag) < 1e-9)
    # the larger of both corners instead of their joint one: at most a fifth root of two apart
    assert (found / held) ** 0.25 == pytest.approx(corner, rel=2.0**0.2 - 1.0)
    if slow == 0.0:
        assert found == white


def test_lasting_acceleration_ignores_vibration_and_a_constant_and_survives_saving():
    time = np.arange(0.0, 20.0, DT)
    shaking = np.column_stack([5.0 * np.sin(30.0 * time), 0.0 * time, G + 3.0 * np.cos(25.0 * time)])
    calm, pulling = LastingAcceleration(SHARE), LastingAcceleration(SHARE)
    for start in range(0, len(time), BLOCK):
        calm.observe(shaking[start : start + BLOCK], BLOCK * DT)
    for start in range(0, 1300, BLOCK):
        pulling.observe(pulling_away(13.0)[start : start + BLOCK], BLOCK * DT)
    # half a second leaves a fifteenth of 30 rad/s: 5 m/s^2 become 0.33 m/s^2 and ring at the start
    assert calm.error_variance < 2.0 * (0.005 * 3.0 * 0.33) ** 2 / 3.0
    # half a per cent of the angle and of the gain, of one axis out of three; 8 s of 13 s are in the mean by then
    whole = 2.0 * (0.005 * 1.5) ** 2 / 3.0
    assert (5.0 / 13.0) ** 2 * whole < pulling.error_variance < whole
    other = LastingAcceleration(SHARE)
    other.load(pulling.save())
    assert other.error_variance == pulling.error_variance


def test_covariance_of_centripetal_terms_agrees_with_drawn_rates():
    rng = np.random.default_rng(8)
    directions, points, weights = rng.standard_normal((9, 3)), rng.standard_normal((9, 3)), rng.standard_normal((6, 9))
    rate, variance = np.array([[0.3, -0.2, 0.5]]), np.array([0.01, 0.04, 0.02])

    def read(omega: np.ndarray) -> np.ndarray:
        inner = np.cross(omega[:, None, :], points)
        return np.sum(np.cross(np.broadcast_to(omega[:, None, :], inner.shape), inner) * directions, axis=2)

    drawn = rate + np.sqrt(variance) * rng.standard_normal((200000, 3))
    error = (read(drawn) - read(rate)) @ weights.T
    found = centripetal_covariance(weights, centripetal_terms(directions, points), rate, variance)
    # 200 000 draws: half a per cent of a variance
    assert np.allclose(found, np.cov(error.T), atol=0.02 * np.max(np.diag(found)))


def test_share_read_wrongly_is_learned_from_residuals_and_never_below_the_tolerances():
    size = LastingAcceleration(SHARE)
    for start in range(0, 1300, BLOCK):
        size.observe(pulling_away(13.0)[start : start + BLOCK], BLOCK * DT)
    tolerated = size.error_variance
    noise, reading = np.full(12, 0.02**2), np.full(12, 1.0)
    # twelve channels of which six equations are spare keep half of what every channel reads wrongly
    size.learn_share(0.5 * (noise + 0.03**2 * reading), noise, reading, 6)
    assert size.error_variance == pytest.approx((0.03 / SHARE) ** 2 / 2.0 * tolerated)
    size.learn_share(0.5 * noise, noise, reading, 6)
    assert size.error_variance == tolerated
