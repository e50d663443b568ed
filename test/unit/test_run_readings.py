# Copyright 2026 ride_estimation contributors
"""Readings of a run as the stochastic model takes them."""

from __future__ import annotations

import numpy as np
from worlds.adapters import vehicle_of_text
from worlds.cab import random_sensors, random_vehicle
from worlds.vehicle_text import vehicle_yaml

from ride_estimation.estimation.model.run_readings import run_readings
from ride_estimation.signals.recording import Channel, Recording


def test_noise_of_fast_sensors_is_not_aliased_and_gaps_part_segments() -> None:
    rng = np.random.default_rng(3)
    cab = random_vehicle(rng, "air")
    vehicle = vehicle_of_text(vehicle_yaml(cab, random_sensors(cab, rng)))
    # four times as fast as the model, one sensor silent for 0.6 s
    stamps = 10**9 + np.arange(6500, dtype=np.int64) * 2_000_000
    channels = {}
    for name, s in vehicle.sensors.items():
        at = stamps if name != "cab_front_left" else np.delete(stamps, slice(2850, 3150))
        values = s.noise_std * rng.standard_normal((len(at), 3)) + s.rotation.T @ [0.0, 0.0, 9.81]
        channels[name] = Channel(name, at, values, at)
    found = run_readings(Recording("noise", channels), vehicle)
    assert [round(len(s) * found.dt, 1) for s in found.segments] == [5.7, 6.7]
    stated = np.repeat([s.noise_std for s in found.plant.sensors], 3)
    measured = np.mean([s[50:-50].std(axis=0) for s in found.segments], axis=0)
    # 24 channels, 600 samples each: their mean is known to 1 %
    assert abs(np.mean(measured / stated) - 1.0) < 0.05
