# Copyright 2026 ride_estimation contributors
"""CG motion and inertial loads against motion made by hand: centripetal terms, gravity, missing and faulty sensors."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.faults.health import base_messages
from ride_estimation.estimation.forces.base_fill import BaseFill
from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator
from ride_estimation.estimation.motion.loads import InertialLoads
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.resources import shared_path
from ride_estimation.sensors.sensor import Sensor

GRAVITY = 9.80665
RATE = 500.0
PLACES = np.array([[0.75, 0.6, -0.35], [0.75, -0.6, -0.35], [-0.8, 0.6, -0.35], [-0.8, -0.6, 0.9]])


def rolling_body(duration: float, amplitude: float = 0.08, frequency: float = 1.5):
    """Return time, specific force and angular motion of a body that rolls and pitches about a fixed CG (exact)."""
    t = np.arange(round(duration * RATE)) / RATE
    w = 2 * np.pi * frequency
    roll = amplitude * np.cos(w * t)
    rate = np.column_stack([-amplitude * w * np.sin(w * t), np.zeros_like(t), np.zeros_like(t)])
    accel = np.column_stack([-amplitude * w**2 * np.cos(w * t), np.zeros_like(t), np.zeros_like(t)])
    force = GRAVITY * np.column_stack([np.zeros_like(t), np.sin(roll), np.cos(roll)])
    return t, roll, force, rate, accel


def readings(force, rate, accel, places=PLACES):
    return np.hstack([force + np.cross(accel, r) + np.cross(rate, np.cross(rate, r)) for r in places])


def sensors(kind: str = "accelerometer", noise: float = 0.01) -> list[Sensor]:
    return [Sensor(f"s{i}", kind, f"/s{i}", "cab", position=p, noise_std=noise) for i, p in enumerate(PLACES)]


def estimator(**kwargs) -> CgMotionEstimator:
    return CgMotionEstimator(sensors(**kwargs), np.zeros(3), np.ones(6, dtype=bool), GRAVITY)


def feed(e, samples, valid=None, gyro=None):
    n = len(samples)
    valid = np.ones((n, len(e.sensors)), dtype=bool) if valid is None else valid
    return e.observe(samples, np.zeros((n, 0)) if gyro is None else gyro, valid, 1.0 / RATE)


def test_centripetal_terms_are_removed():
    """Roll rate 0.75 rad/s: omega x (omega x r) is 0.5 m/s^2 at a sensor; less than 1 % of it may stay in the CG motion."""
    _, _, force, rate, accel = rolling_body(30.0)
    block = feed(estimator(), readings(force, rate, accel))
    late = slice(5000, None)
    left = block.motion[late, :3] - force[late]
    assert np.max(np.abs(left)) < 0.005  # m/s^2
    without = np.hstack([np.cross(rate, np.cross(rate, p)) for p in PLACES])[late]
    assert np.max(np.abs(without)) > 0.4  # the test has something to remove


def test_noise_of_the_gyros_is_in_the_covariance_of_the_motion():
    """A body that rolls fast, centripetal terms of noisy rates: the normalised error squared is one, neither more nor less."""
    rng, (t, _, force, rate, accel) = np.random.default_rng(4), rolling_body(8.0, amplitude=0.3)
    own, noise = 0.01, 0.05
    imus = [dataclasses.replace(s, gyro_noise_std=noise) for s in sensors("imu", own)]
    e = CgMotionEstimator(imus, np.zeros(3), np.ones(6, dtype=bool), GRAVITY)
    read = readings(force, rate, accel) + own * rng.standard_normal((len(t), 12))
    gyro = np.tile(rate, 4) + noise * rng.standard_normal((len(t), 12))
    squares = []
    for k in range(0, len(t), 20):
        part = slice(k, k + 20)
        block = feed(e, read[part], gyro=gyro[part])
        error = block.motion - np.hstack([force[part], accel[part]])
        squares += [float(d @ np.linalg.solve(block.covariance, d)) / 6.0 for d in error]
    assert 0.8 < np.mean(squares[200:]) < 1.25


def test_gravity_is_removed_by_attitude_not_by_a_mean():
    """The CG of the body is at rest: what is called acceleration may be 3 % of the g sin(roll) that is in the signal."""
    _, roll, force, rate, accel = rolling_body(40.0)
    e = estimator()
    block = feed(e, readings(force, rate, accel))
    a, covariance = e.accelerate(block)
    late = slice(10000, None)
    signal = np.std(GRAVITY * np.sin(roll))
    assert np.std(a[late, 1]) < 0.03 * signal
    assert np.all(np.linalg.eigvalsh(covariance) > 0.0)


def test_missing_sensor_changes_the_weights_and_the_covariance():
    _, _, force, rate, accel = rolling_body(4.0, 0.02)
    samples = readings(force, rate, accel)
    valid = np.ones((len(samples), 4), dtype=bool)
    valid[1000:1500, 1] = False
    samples[1000:1500, 3:6] = 0.0  # what a silent sensor leaves behind must not matter
    block = feed(estimator(), samples, valid)
    assert np.max(np.abs(block.motion[1000:1500, :3] - force[1000:1500])) < 0.02  # m/s^2
    e = estimator()
    full = e.weights(np.ones(4, dtype=bool), 0.002).covariance
    three = e.weights(np.array([True, False, True, True]), 0.002).covariance
    assert np.all(np.diag(three) > np.diag(full))


def test_no_sensor_at_all_is_not_valid_and_not_nan():
    samples = readings(*rolling_body(0.2)[2:])
    valid = np.ones((100, 4), dtype=bool)
    valid[50:] = False
    block = feed(estimator(), samples, valid)
    assert block.valid[:50].all()
    assert not block.valid[50:].any()
    assert np.isfinite(block.motion).all()


def test_one_imu_says_what_it_cannot_know():
    one = CgMotionEstimator(sensors()[:1], np.zeros(3), np.ones(6, dtype=bool), GRAVITY)
    covariance = one.weights(np.ones(1, dtype=bool), 0.002).covariance
    assert np.sqrt(np.diag(covariance)).min() > 1.0  # m/s^2, rad/s^2: nothing is known to less than this at the CG
    imu = CgMotionEstimator(
        [Sensor("i", "imu", "/i", "cab", position=PLACES[0], noise_std=0.01, gyro_noise_std=1e-4)],
        np.zeros(3),
        np.ones(6, dtype=bool),
        GRAVITY,
    )
    with_gyro = imu.weights(np.ones(1, dtype=bool), 0.002).covariance
    assert np.sqrt(np.diag(with_gyro)).max() < 0.2


@pytest.mark.parametrize(("sensor", "seed"), [(1, 0), (2, 1)])
def test_residuals_point_at_the_sensor_that_is_turned(sensor, seed):
    """A sensor turned by 3 degrees on a moving body: named, with most of the excess explained."""
    rng = np.random.default_rng(seed)
    _, _, force, rate, accel = rolling_body(10.0, 0.03)
    force = force + rng.normal(scale=0.3, size=force.shape)
    samples = readings(force, rate, accel) + rng.normal(scale=0.01, size=(len(force), 12))
    clean = estimator()
    feed(clean, samples)
    assert clean.residual_test().passed
    angle = np.radians(3.0)
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    part = slice(3 * sensor, 3 * sensor + 3)
    samples[:, part] = samples[:, part] @ turn.T
    faulty = estimator()
    feed(faulty, samples)
    test = faulty.residual_test()
    assert not test.passed
    assert test.sensor == f"s{sensor}"
    assert test.explained > 0.5


def frame_readings(places, twist=0.0):
    """Return what triaxial accelerometers read on a frame that heaves, rolls, pitches, yaws and twists (roll growing with x)."""
    rng = np.random.default_rng(3)
    linear, alpha = rng.normal(size=(50, 3)), rng.normal(size=(50, 3))
    turning = rng.normal(size=50)
    read = np.stack([linear + np.cross(alpha, p) + np.array([0.0, 0.0, GRAVITY]) for p in places], axis=1)
    read[:, :, 2] += twist * turning[:, None] * places[:, 0] * places[:, 1]
    return read


@pytest.mark.parametrize("twist", [0.0, 0.4])
def test_base_sensors_beside_their_mounts_are_carried_over(twist):
    """Sensors 0.2 m outside and 0.1 m behind: readings of a frame that moves as a whole and twists, at the mounts, to 1e-9."""
    vehicle = load_vehicle(shared_path("config", "vehicles", "truck_cab.yaml"))
    shift = {"left": np.array([-0.1, 0.2, 0.0]), "right": np.array([-0.1, -0.2, 0.0])}
    moved = {
        n: dataclasses.replace(s, position=s.position + shift[n.rsplit("_", 1)[1]]) if n.startswith("chassis_") else s
        for n, s in vehicle.sensors.items()
    }
    a = geometry_of(dataclasses.replace(vehicle, sensors=moved))
    mounts, sensors = [m.position for m in a.mounts], [s.position for s in a.base_sensors]
    read, wanted = frame_readings(np.array(sensors), twist), frame_readings(np.array(mounts), twist)
    carried, ok = BaseFill(a).fill(read, np.ones((50, 4), dtype=bool), 0.1)
    assert ok.all()
    assert np.max(np.abs(read - wanted)) > 0.1
    if twist == 0.0:
        np.testing.assert_allclose(carried, wanted, atol=1e-9)
    else:
        # what twist bends between sensor and mount along y is carried, the rest is second order in the distance
        assert np.max(np.abs(carried - wanted)) < 0.25 * np.max(np.abs(read - wanted))
    assert base_messages(a) == []


@pytest.mark.parametrize("lost", [(0,), (0, 2), (1, 3), (0, 3), (0, 1, 2)])
def test_lost_base_sensors_are_made_up_for_without_making_their_motion_larger(lost):
    """Sensors some centimetres off a line: what brackets move on their own is no slope over so short a lever."""
    vehicle = load_vehicle(shared_path("config", "vehicles", "truck_cab.yaml"))
    rng = np.random.default_rng(4)
    moved = {
        n: dataclasses.replace(s, position=s.position + rng.uniform(-0.03, 0.03, 3)) if n.startswith("chassis_") else s
        for n, s in vehicle.sensors.items()
    }
    a = geometry_of(dataclasses.replace(vehicle, sensors=moved))
    read = rng.normal(size=(200, 4, 3)) + np.array([0.0, 0.0, GRAVITY])
    ok = np.ones((200, 4), dtype=bool)
    ok[:, lost] = False
    read[:, lost] = 0.0
    filled, spoke = BaseFill(a)._filled(read, ok, 0.1)
    assert spoke.all()
    made_up = filled[:, lost]
    np.testing.assert_allclose(made_up.mean(axis=(0, 1)), [0.0, 0.0, GRAVITY], atol=0.5)
    assert made_up.std(axis=0).max() < 2.5
    # what all have in common goes over whole
    still = np.tile([0.1, -0.2, GRAVITY], (10, 4, 1))
    np.testing.assert_allclose(BaseFill(a)._filled(still, ok[:10], 0.1)[0], still, atol=1e-9)


def test_a_base_sensor_away_from_its_mount_that_cannot_be_carried_over_is_named():
    vehicle = load_vehicle(shared_path("config", "vehicles", "truck_cab.yaml"))
    sensors = {n: s for n, s in vehicle.sensors.items() if n not in ("chassis_rear_left", "chassis_rear_right")}
    sensors["chassis_front_left"] = dataclasses.replace(
        sensors["chassis_front_left"], position=sensors["chassis_front_left"].position + np.array([0.3, 0.0, 0.4])
    )
    a = geometry_of(dataclasses.replace(vehicle, sensors=sensors))
    said = base_messages(a)
    assert len(said) == 1
    assert "chassis_front_left is 0.50 m from the base of front_left" in said[0]


def test_moment_has_products_of_inertia_and_the_gyroscopic_term():
    j = np.array([[730.0, -8.0, -25.0], [-8.0, 540.0, 5.0], [-25.0, 5.0, 810.0]])
    loads = InertialLoads(1200.0, 0.0, j)
    accel = np.array([[0.1, -0.2, 0.3, 1.0, 2.0, -1.0]])
    rate = np.array([[0.4, 0.2, -0.1]])
    by_hand = j @ accel[0, 3:] + np.cross(rate[0], j @ rate[0])
    np.testing.assert_allclose(loads.load(accel, rate)[0], [120.0, -240.0, 360.0, *by_hand], rtol=1e-12)


def test_load_covariance_agrees_with_sampling():
    """Motion noise, 2 % mass and 3 % inertia: covariance against 40000 samples within 5 %."""
    rng = np.random.default_rng(0)
    j = np.diag([700.0, 500.0, 800.0])
    motion = np.array([1.0, -2.0, 9.0, 2.0, 1.0, -1.5])
    spread = np.diag([0.01, 0.02, 0.01, 0.03, 0.03, 0.02]) ** 2
    stated = InertialLoads(1000.0, 20.0, j, 0.03).covariance(spread, motion)
    n = 40000
    m = 1000.0 + 20.0 * rng.normal(size=n)
    scale = 1.0 + 0.03 * rng.normal(size=n)
    noisy = motion + rng.normal(size=(n, 6)) * np.sqrt(np.diag(spread))
    loads = np.hstack([m[:, None] * noisy[:, :3], scale[:, None] * (noisy[:, 3:] @ j)])
    np.testing.assert_allclose(np.sqrt(np.diag(stated)), loads.std(axis=0), rtol=0.05)
