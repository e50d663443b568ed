# Copyright 2026 ride_estimation contributors
"""A cab that leans far in a bend: its full rotation is no small correction of its linear motion."""

from __future__ import annotations

import dataclasses

import numpy as np
from worlds.adapters import believed_vehicle, uniform_run
from worlds.cab import measure, random_sensors, random_vehicle, simulate
from worlds.roads import Road, base_motion
from worlds.vehicle_text import Belief

from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs import model_run
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView

#: share of the vertical stiffness that puts the roll mode to the lower edge of the band
SOFTER = 0.22
SECONDS, RATE_HZ, STEP = 40.0, 100.0, 1e-3


def missed(view: RunView) -> float:
    """Return the rms in the band of what a model misses."""
    return float(np.sqrt(np.mean(view.grid.signal(view.residual_spectrum * view.grid.band_weight[:, None]) ** 2)))


def test_a_cab_that_leans_far_on_a_soft_roll_mode_moves_no_further_from_the_truth_than_with_small_rotation(monkeypatch):
    rng = np.random.default_rng(9301)
    vehicle = random_vehicle(rng, "air")
    vertical = np.array([1.0, 1.0, SOFTER])
    vehicle = dataclasses.replace(
        vehicle, stiffness=vehicle.stiffness * vertical, damping=vehicle.damping * np.sqrt(vertical)
    )
    assert 0.3 < vehicle.modes()[0] < 0.45
    sensors = random_sensors(vehicle, rng)
    road = dataclasses.replace(Road.random(rng, "smooth"), speed=8.0, course=(("bend", 15.0, 4.0, 1.3),))
    run = measure(simulate(vehicle, base_motion(road, vehicle.mounts, SECONDS, STEP, 5)), sensors, RATE_HZ, 5, noise_share=0.01)
    file = believed_vehicle(run, Belief(), 5, vehicle)
    plant = build_plant(file, dict.fromkeys(file.sensors, 3))
    data = RunData(plant, measurement(plant, uniform_run(run, "bend")), Settings())
    places = [(vehicle.mount_names.index(p.mount), "xyz".index(p.axis)) for p in plant.ports]
    state = ModelState(*(np.array([values[place] for place in places]) for values in (vehicle.stiffness, vehicle.damping)))
    full = missed(RunView(data, state))
    monkeypatch.setattr(model_run, "_KINEMATIC_PASSES", 1)
    # two to five times as much where a growing series of corrections was kept
    assert full < 1.1 * missed(RunView(data, state))

