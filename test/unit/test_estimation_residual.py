# Copyright 2026 ride_estimation contributors
"""The residual test of the body sensors: quiet for sensors in good order, names the sensor and its error where one is not."""

from __future__ import annotations

import dataclasses
import functools
import json

import numpy as np
import pytest
from worlds.adapters import arrivals, believed_vehicle
from worlds.cab import drive, measure, random_sensors, random_vehicle, rotation_of_degrees
from worlds.roads import Road

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.faults.health import SensorHealth, rate_message, residual_message
from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.alignment import StampAligner, StreamSpec

RATE = 250.0
CULPRIT = "cab_front_right"


@functools.cache
def drive_of(seed: int):
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air")
    sensors = random_sensors(cab, rng)
    return drive(cab, Road.random(rng), 16.0, seed, step=1e-3), tuple(s for s in sensors if s.place == "cab")


def measured(seed: int, **fault):
    """Return 16 s of ordinary sensors: 1.5 mg bias, 0.2 % gain, 0.12 deg and 2 mm mounting (std), 16 bit steps, 50 us jitter."""
    run, sensors = drive_of(seed)
    rng = np.random.default_rng(seed + 1000)
    used = []
    for s in sensors:
        turn = rotation_of_degrees(rng.normal(0.0, 0.12, 3))
        ordinary = dataclasses.replace(
            s, bias=rng.normal(0.0, 0.015, 3), gain=1.0 + rng.normal(0.0, 0.002, 3), true_rotation=s.rotation @ turn,
            true_position=s.position + rng.normal(0.0, 0.002, 3), quantum=0.0024,
        )  # fmt: skip
        used.append(dataclasses.replace(ordinary, **fault) if s.name == CULPRIT else ordinary)
    return measure(run, tuple(used), RATE, seed, jitter_s=5e-5)


def estimator_of(vehicle):
    a = geometry_of(vehicle)
    return CgMotionEstimator(a.body_sensors, a.body.cg, a.free, vehicle.gravity)


def observed(seed: int, data, estimator=None):
    """Return the motion estimator after a run, block by block as the pipeline does it."""
    vehicle = believed_vehicle(data, seed=seed)
    estimator = estimator or estimator_of(vehicle)
    index = {s.name: i for i, s in enumerate(estimator.sensors)}
    aligner = StampAligner([StreamSpec(s.name, s.channels) for s in estimator.sensors])
    for stamp, name, values in arrivals(data):
        for block in aligner.push(index[name], stamp, values.tolist()):
            estimator.observe(block.values, np.zeros((len(block.values), 0)), block.valid, block.step_ns * 1e-9)
    return estimator


@pytest.mark.parametrize("seed", [50, 51, 52])
def test_ordinary_sensors_are_no_reason_to_worry(seed):
    """Bias, gain, mounting and resolution of ordinary sensors: passed, and not a word."""
    test = observed(seed, measured(seed)).residual_test()
    assert test.passed
    assert test.fault is None
    assert residual_message(test) == ""


def faults(sensor):
    turned = {axis: sensor.rotation @ rotation_of_degrees(2.0 * np.eye(3)["xz".index(axis) * 2]) for axis in "xz"}
    return {
        "50 mm sideways": ({"true_position": sensor.position + np.array([0.0, 0.03, 0.04])}, "position"),
        "50 mm ahead": ({"true_position": sensor.position + np.array([0.05, 0.0, 0.0])}, "position"),
        "2 deg about x": ({"true_rotation": turned["x"]}, "misalignment"),
        "2 deg about z": ({"true_rotation": turned["z"]}, "misalignment"),
        "gain 3 %": ({"gain": 1.03}, "gain"),
        "vertical gain 3 %": ({"gain": np.array([1.0, 1.0, 1.03])}, "gain"),
        "2 ms late": ({"delay_s": 0.002}, "delay"),
        "5 ms late": ({"delay_s": 0.005}, "delay"),
    }


@pytest.mark.parametrize("seed", [50, 52])
@pytest.mark.parametrize("what", list(faults(drive_of(50)[1][0])))
def test_one_wrong_sensor_is_found_and_named_with_its_error(seed, what):
    """Found within 16 s of road; sensor and kind of error are named, the amount lies within 4 std of the truth."""
    sensor = next(s for s in drive_of(seed)[1] if s.name == CULPRIT)
    change, kind = faults(sensor)[what]
    test = observed(seed, measured(seed, **change)).residual_test()
    assert not test.passed
    assert test.fault is not None
    assert test.sensor == CULPRIT
    assert test.fault.kind == kind
    text = residual_message(test)
    assert CULPRIT in text
    words = test.fault.amount.replace("misaligned by ", "").replace("gain of", "").split()
    value, std = (float(words[words.index("+-") + k]) for k in (-1, 1))
    true = {"position": 50.0, "misalignment": 2.0, "gain": 3.0, "delay": float(what.split()[0]) if kind == "delay" else 0.0}[kind]
    assert abs(value - true) < 4.0 * std


def test_what_was_found_survives_a_restart():
    """The sums saved and loaded into a fresh estimator give the same verdict."""
    data = measured(50, gain=1.03)
    first = observed(50, data)
    again = estimator_of(believed_vehicle(data, seed=50))
    again.load(json.loads(json.dumps(first.save())))
    assert again.residual_test().fault == first.residual_test().fault


def test_slower_sensors_are_named_with_their_rates():
    """A sensor at half the rate sees less of quick motion; nothing is said of jitter, of what is not known, of transducers."""

    def said(**rates: float) -> str:
        kinds = {"string": "displacement"}
        sensors = [Sensor(name, kinds.get(name, "accelerometer"), "", "cab") for name in rates]
        return rate_message(sensors, {n: SensorHealth(n, 9, {}, rate, 0, 0.0, False, 0, 0, 0.0) for n, rate in rates.items()})

    assert said(a=100.0, b=93.0, c=0.0, string=20.0) == ""
    assert said(a=100.0, b=50.0).startswith("b samples at 50 Hz where others do at 100 Hz")
