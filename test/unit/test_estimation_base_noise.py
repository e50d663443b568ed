# Copyright 2026 ride_estimation contributors
"""Noise and hum that only one of the base sensors shows are told from what a road does to all of them."""

from __future__ import annotations

import numpy as np

from ride_estimation.estimation.faults.base_noise import BaseNoise
from ride_estimation.io.vehicle_file import load_vehicle

SENSORS = [s for s in load_vehicle("truck_cab").sensors.values() if s.body == "chassis"]
DT = 0.005


def rough(seconds: float, seed: int = 0) -> np.ndarray:
    """Return readings (K, 3 N): every base shakes on its own, one of them half as much again, with a line that all see."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, DT)
    values = 0.5 * rng.normal(size=(len(time), 12)) + 0.5 * np.sin(2.0 * np.pi * 28.0 * time)[:, None]
    values[:, 3:6] *= 1.5
    return values


def judged(values: np.ndarray, given: BaseNoise | None = None) -> BaseNoise:
    found = given or BaseNoise(SENSORS)
    for k in range(0, len(values) - 9, 10):
        found.gather(values[k : k + 10])
        found.learn(DT)
    return found


def test_a_rough_road_and_an_engine_are_no_fault_of_a_sensor() -> None:
    for seed in range(4):
        assert judged(rough(30.0, seed)).messages() == []


def test_noise_that_comes_is_named_and_its_end_is_seen() -> None:
    found = judged(rough(10.0))
    noise = np.zeros((round(5.0 / DT), 12))
    noise[:, 6:9] = 2.5 * np.random.default_rng(5).normal(size=(len(noise), 3))
    judged(rough(5.0, 1) + noise, found)
    assert list(found.refused) == [2] and found.messages()[0].startswith("chassis_rear_left is not used")
    assert not judged(rough(20.0, 2), found).refused


def test_a_line_of_one_sensor_is_said_and_the_sensor_used() -> None:
    values = rough(8.0, 3)
    values[:, 2] += 3.0 * np.sin(2.0 * np.pi * 50.0 * DT * np.arange(len(values)))
    found = judged(values)
    assert not found.refused
    assert len(found.messages()) == 1
    assert found.messages()[0].startswith("chassis_front_left at the mount base shows a line of 50 Hz that none of the others")
