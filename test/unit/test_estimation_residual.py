# Copyright 2026 ride_estimation contributors
"""The residual test of the body sensors: quiet for sensors in good order, loud for those that are not."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from worlds.adapters import arrivals, believed_vehicle
from worlds.cab import drive, measure, random_sensors, random_vehicle, rotation_of_degrees
from worlds.roads import Road

from ride_estimation.estimation.pipeline import Pipeline

RATE = 250.0
CULPRIT = "cab_front_right"


@functools.cache
def drive_of(seed: int):
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air")
    sensors = random_sensors(cab, rng)
    return drive(cab, Road.random(rng), 10.0, seed, step=1e-3), sensors


def residual_of(seed: int, **fault):
    """Return (residual test, messages) with ordinary sensors: 1.5 mg bias, 0.2 % gain, 0.12 deg mounting, 16 bit steps."""
    run, sensors = drive_of(seed)
    rng = np.random.default_rng(seed + 1000)
    used = []
    for s in sensors:
        turn = rotation_of_degrees(rng.normal(0.0, 0.12, 3))
        ordinary = dataclasses.replace(
            s, bias=rng.normal(0.0, 0.015, 3), gain=1.0 + rng.normal(0.0, 0.002, 3), true_rotation=s.rotation @ turn,
            quantum=0.0024,
        )  # fmt: skip
        used.append(dataclasses.replace(ordinary, **fault) if s.name == CULPRIT else ordinary)
    data = measure(run, tuple(used), RATE, seed)
    pipeline = Pipeline(believed_vehicle(data, seed=seed))
    for stamp, name, values in arrivals(data):
        pipeline.observe(name, stamp, values.tolist())
    pipeline.finish()
    health = pipeline.health()
    return health.residual, " ".join(health.messages)


@pytest.mark.parametrize("seed", [50, 51, 52])
def test_ordinary_sensors_are_no_reason_to_worry(seed):
    """Bias, gain, mounting and resolution of ordinary sensors: passed, and not a word."""
    test, text = residual_of(seed)
    assert test.passed
    assert "disagree" not in text


@pytest.mark.parametrize("seed", [50, 52])
@pytest.mark.parametrize(
    ("what", "amount"), [("true_position", 0.2), ("true_rotation", 2.0), ("gain", 1.03), ("delay_s", 0.005)]
)
def test_one_wrong_sensor_is_found(seed, what, amount):
    """200 mm beside its place (50 mm drown in the noise here), turned by 2 deg, gain 3 % high, 5 ms late: found within 10 s."""
    sensor = next(s for s in drive_of(seed)[1] if s.name == CULPRIT)
    value = {
        "true_position": sensor.position + np.array([0.0, 0.6, 0.8]) * amount,
        "true_rotation": sensor.rotation @ rotation_of_degrees(np.array([amount, 0.0, 0.0])),
    }.get(what, amount)
    test, text = residual_of(seed, **{what: value})
    assert not test.passed
    assert test.sensor == CULPRIT or CULPRIT in test.rivals
    assert "disagree" in text
