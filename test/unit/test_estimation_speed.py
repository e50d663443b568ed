# Copyright 2026 ride_estimation contributors
"""The speed of the vehicle separates slow longitudinal acceleration from pitch."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from worlds.adapters import START_NS, believed_vehicle
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.roads import Road

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator
from ride_estimation.estimation.motion.motion_kernel import follow_speed
from ride_estimation.estimation.offline import EstimateDigest
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.messages import accepted_types, make_converter
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import Channel, Recording

DT, GRAVITY = 0.01, 9.81
PLACES = ((0.8, 0.6, 0.2), (0.8, -0.6, -0.3), (-0.8, 0.5, 0.1), (-0.8, -0.6, 0.4))
METER = Sensor("speed", "speed", "/vehicle/speed", "chassis", noise_std=0.05)


def braking(seconds=30.0):
    """Return time, pitch, specific force at the CG and speed of a cab that shakes, brakes and dives."""
    rng = np.random.default_rng(4)
    time = np.arange(0.0, seconds, DT)
    accel = -2.0 * ((time > 12.0) & (time < 17.0)) + 1.0 * ((time > 20.0) & (time < 25.0))
    accel = np.convolve(accel, np.ones(50) / 50.0, mode="same")
    pitch = 0.02 + 0.01 * np.convolve(accel, np.ones(30) / 30.0, mode="same")
    shake = 2.0 * np.sin(2.0 * np.pi * 2.3 * time)
    force = np.column_stack([accel + 0.6 * shake - GRAVITY * np.sin(pitch), 0.0 * time, GRAVITY * np.cos(pitch) + shake])
    speed = 20.0 + np.cumsum(accel) * DT + 0.05 * rng.standard_normal(len(time))
    speed = np.repeat(speed[::4], 4)[: len(time)]  # a quarter of the rate, held
    return time, pitch, force, speed


def estimated(with_speed):
    time, pitch, force, speed = braking()
    sensors = [Sensor(f"s{i}", "accelerometer", "", "cab", position=np.array(p)) for i, p in enumerate(PLACES)]
    turn = np.gradient(np.gradient(pitch, DT), DT)
    alpha = np.outer(turn, [0.0, 1.0, 0.0])
    noise = 0.02 * np.random.default_rng(5).standard_normal((len(time), 12))
    samples = np.hstack([force + np.cross(alpha, p) for p in np.array(PLACES)]) + noise
    estimator = CgMotionEstimator(sensors, np.zeros(3), np.ones(6, dtype=bool), GRAVITY)
    estimator.speed_std = 0.05 if with_speed else 0.0
    found, std = [], []
    for start in range(0, len(time), 10):
        part = slice(start, start + 10)
        there = np.ones(len(time[part]), dtype=bool)
        given = (speed[part].copy(), there) if with_speed else None
        block = estimator.observe(samples[part], np.zeros((len(there), 0)), np.ones((len(there), 4), dtype=bool), DT, given)
        motion, covariance = estimator.accelerate(block)
        found.append(motion[:, 0])
        std.append(np.full(len(there), np.sqrt(covariance[0, 0])))
    right = force[:, 0] + GRAVITY * np.sin(pitch)
    slow = np.ones(100) / 100.0
    keep = (time > 8.0) & (time < 29.0)
    error = np.concatenate(found) - right
    return np.convolve(error, slow, mode="same")[keep], error[keep], np.concatenate(std)[keep]


def test_braking_is_not_taken_for_tilt():
    slow, error, std = estimated(with_speed=True)
    assert np.sqrt(np.mean(slow**2)) < 0.06
    assert np.mean(np.abs(error) <= 2.0 * std) > 0.9
    assert np.sqrt(np.mean(estimated(with_speed=False)[0] ** 2)) > 0.25


def test_rate_of_a_speed_begins_at_zero_and_again_after_a_gap():
    speed, there = 10.0 + 2.0 * DT * np.arange(300), np.ones(300, dtype=bool)
    there[150:160] = False
    state, surge = np.zeros(4), np.empty(300)
    follow_speed(speed, there, 0.1, DT, state, surge)
    assert surge[0] == 0.0
    assert surge[140] == pytest.approx(2.0, rel=1e-3)
    assert not surge[150:161].any()
    assert surge[290] == pytest.approx(2.0, rel=1e-3)


def test_odometry_and_twist_are_speeds():
    assert accepted_types("speed") == ("geometry_msgs/msg/TwistStamped", "nav_msgs/msg/Odometry")
    header = SimpleNamespace(stamp=SimpleNamespace(sec=3, nanosec=4))
    twist = SimpleNamespace(linear=SimpleNamespace(x=7.5))
    for kind, message in (
        ("geometry_msgs/msg/TwistStamped", SimpleNamespace(header=header, twist=twist)),
        ("nav_msgs/msg/Odometry", SimpleNamespace(header=header, twist=SimpleNamespace(twist=twist))),
    ):
        convert = make_converter(kind, [METER])
        assert convert(message)[0][1:3] == (3_000_000_004, (7.5,))


def test_live_and_replay_are_the_same_with_a_speed_that_stops():
    rng = np.random.default_rng(8310)
    cab = random_vehicle(rng, "air")
    sensors = random_sensors(cab, rng)
    data = measure(drive(cab, Road.random(rng), 5.0, 8310, step=1e-3), sensors, 250.0, 8310, noise_share=0.01, anti_alias=0.0)
    vehicle = believed_vehicle(data, seed=8310)
    vehicle = dataclasses.replace(vehicle, sensors={**vehicle.sensors, "speed": METER})
    assert geometry_of(vehicle).speed_sensor is METER
    channels = {}
    for name in data.data:
        stamps = START_NS + np.round(data.stamps[name] * 1e9).astype(np.int64)
        channels[name] = Channel(name, stamps, np.asarray(data.data[name]), stamps)
    time = np.arange(0.1, 2.0, 0.04)
    stamps = START_NS + np.round(time * 1e9).astype(np.int64)
    channels["speed"] = Channel("speed", stamps, (10.0 + 0.5 * time)[:, None], stamps + 5_000_000)
    recording = Recording("world", {n: channels[n] for n in vehicle.sensors})
    live, replayed = EstimateDigest(), EstimateDigest()
    pipeline = Pipeline(vehicle)
    for blocks, _ in pipeline.replay(recording):
        for block in blocks:
            replayed.update(block)
    for block in pipeline.finish():
        replayed.update(block)
    own, names = Pipeline(vehicle), list(vehicle.sensors)
    for index, stamp, values, variance in recording.in_order():
        for block in own.observe(names[index], stamp, values, variance):
            live.update(block)
    for block in own.finish():
        live.update(block)
    assert live.hexdigest() == replayed.hexdigest()
    bare = dataclasses.replace(vehicle, sensors={n: s for n, s in vehicle.sensors.items() if n != "speed"})
    without = EstimateDigest()
    other = Pipeline(bare)
    for blocks, _ in other.replay(dataclasses.replace(recording, channels={n: channels[n] for n in bare.sensors})):
        for block in blocks:
            without.update(block)
    for block in other.finish():
        without.update(block)
    assert without.hexdigest() != live.hexdigest()
