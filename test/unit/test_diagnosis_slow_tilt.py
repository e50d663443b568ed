# Copyright 2026 ride_estimation contributors
"""Bodies that lean on their bases below the band: what a model with the true numbers misses when braking and on slopes."""

from __future__ import annotations

import numpy as np
import pytest
from worlds.adapters import believed_vehicle, uniform_run
from worlds.cab import CabRun, drive, measure, random_sensors, random_vehicle
from worlds.roads import Road
from worlds.vehicle_text import Belief

from ride_estimation.diagnosis.common.effect import Effect, Where
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.model_run import ModelRun, ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView

BRAKES = (("brake", 4.0, 3.0, -2.0), ("brake", 8.0, 3.0, 2.0), ("brake", 13.0, 3.0, -2.0), ("brake", 17.0, 3.0, 2.0))
SLOPES = (("slope", 5.0, 4.0, 0.06), ("slope", 14.0, 4.0, -0.06))


def driven(course: tuple[tuple[str, float, float, float], ...], seed: int) -> tuple[CabRun, RunData, ModelState]:
    """Return the truth of a drive, its run and the state of a model with the true numbers."""
    rng = np.random.default_rng(seed)
    true = random_vehicle(rng, "air")
    sensors = random_sensors(true, rng)
    run = drive(true, Road(roughness=64e-6, speed=12.0, twist=0.0, local=0.0, course=course), 26.0, seed, step=1e-3)
    measured = measure(run, sensors, 100.0, seed, noise_share=1e-4)
    exact = Belief(stiffness_off=0.0, damping_off=0.0)
    vehicle = believed_vehicle(measured, exact)
    plant = build_plant(vehicle, {name: np.shape(values)[1] for name, values in measured.data.items()})
    data = RunData(plant, measurement(plant, uniform_run(measured)), Settings())
    return run, data, ModelState(np.array([p.stiffness for p in plant.ports]), np.array([p.damping for p in plant.ports]))


def missed(course: tuple[tuple[str, float, float, float], ...], seed: int) -> float:
    """Return what a model with the true numbers misses of the readings in the band, share of their rms."""
    _, data, state = driven(course, seed)
    error = data.output_spectrum - ModelRun(data, state).predicted_spectrum
    weight = data.grid.band_weight[:, None]
    return float(np.linalg.norm(data.inside(weight * error)) / np.linalg.norm(data.inside(weight * data.output_spectrum)))


@pytest.mark.parametrize(("course", "limit"), [(BRAKES, 0.012), (SLOPES, 0.006)], ids=["brakes", "slopes"])
def test_a_tilted_body_is_predicted_in_the_band(course: tuple[tuple[str, float, float, float], ...], limit: float):
    # with bodies that stand upright below the band 3.9 % (brakes) and 1.0 % (slopes) are missed
    assert missed(course, 2) < limit


def test_a_law_sees_the_slow_deflection_of_its_mount():
    run, data, state = driven(BRAKES, 2)
    view = RunView(data, state)
    inner = (data.time_s > 3.0) & (data.time_s < data.time_s[-1] - 3.0)
    for name in run.vehicle.mount_names:
        true = run.deflection[:, run.vehicle.mount_names.index(name), 2]
        true = np.interp(data.time_s, run.time - run.time[0], true)
        error = (view.deflection[:, view.port_index(name, "z")] - true)[inner]
        # what lies in the band alone misses 73 to 83 % of the deflection while braking
        assert np.std(error) < 0.1 * np.std(true[inner])


def test_what_force_laws_hold_below_the_band_moves_the_mounts_to_rest():
    _, data, state = driven(BRAKES, 2)
    plant, held = data.plant, 200.0
    ports = [i for i, p in enumerate(plant.ports) if p.axis == "z"]
    pull = np.full(data.grid.samples, held)
    pulled = ModelState(state.stiffness, state.damping, tuple(Effect(Where.PORT, p, pull) for p in ports))
    plain, moved = ModelRun(data, state), ModelRun(data, pulled)
    shift = (moved.slow_deflection - plain.slow_deflection)[data.grid.samples // 2]
    heave = [c == "z" for _, c in plant.coordinates].index(True)
    # at rest the springs of the mounts carry what the laws pull
    assert (plant.port_map.T @ (state.stiffness * shift))[heave] == pytest.approx(-held * len(ports), rel=0.02)
