# Copyright 2026 ride_estimation contributors
"""The driving cases of documents 000 (truck) and 001 (loader), rows 0-21, 1-12: simulated, replayed, scored."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.assessment.seat import separation_times
from ride_estimation.assessment.truth import at_times, score
from ride_estimation.estimation.offline import run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.estimation.settings import PipelineSettings
from ride_estimation.io.scenario_file import load_scenario
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.simulation.field_run import run_scenario

ROOT = Path(__file__).parents[2]
VEHICLES, SCENARIOS = ROOT / "config" / "vehicles", ROOT / "config" / "scenarios"
TRUCK = sorted(SCENARIOS.glob("document_000_*.yaml"))
LOADER = sorted(SCENARIOS.glob("document_001_*.yaml"))
SHORT_S = 9.0


def replayed(path, duration, estimated="truck_cab"):
    """Simulate and replay; return (score of the vertical CG acceleration, true and found vertical force by mount).

    Forces are taken over the last two thirds. The vehicle that drives is the scenario's; ``estimated`` is what the estimator
    knows of it.
    """
    scenario = dataclasses.replace(load_scenario(path), duration=duration)
    run = run_scenario(scenario, load_vehicle(ROOT / scenario.vehicle_file))
    result = run_offline(run.recording, Pipeline(load_vehicle(VEHICLES / f"{estimated}.yaml"), PipelineSettings()))
    truth = run.truth.signals
    stamps = scenario.start_ns + np.round(truth["time_s"] * 1e9).astype(np.int64)
    kept = (result.stamp_ns >= stamps[0]) & (result.stamp_ns <= stamps[-1]) & result.valid
    kept &= result.stamp_ns > stamps[0] + int(duration * 0.3e9)
    force = at_times(result.stamp_ns[kept], stamps, truth["mount_force"])[:, :, 2]
    names = list(truth["mount_names"])
    pairs = {
        name: (force[:, names.index(name)], result.signals["mount_force"][kept, i, 2])
        for i, name in enumerate(result.mount_names)
    }
    accel = at_times(result.stamp_ns[kept], stamps, truth["cg_accel"])
    return score(accel[:, 2], result.signals["cg_accel"][kept, 2]), pairs


def test_all_five_cases_are_there():
    assert [p.stem for p in TRUCK + LOADER] == [
        "document_000_belgian_pave", "document_000_humps", "document_001_bump_10_km_per_h", "document_001_rough_10_km_per_h",
        "document_001_rough_15_km_per_h",
    ]


@pytest.mark.parametrize("path", TRUCK, ids=lambda p: p.stem)
def test_case_runs_and_is_scored(path):
    """9 s of each: CG acceleration within 5 %; vertical mount forces within 30 % while the parameters still settle."""
    motion, forces = replayed(path, SHORT_S)
    assert motion.nrmse < 0.05
    for name in ("front_left", "front_right", "rear_left", "rear_right"):
        assert score(*forces[name]).nrmse < 0.30, name


def loader_errors(path, duration):
    """Return the score of the motion and the errors of both forces in shares of their moving part.

    The seat of 110 kg on the cab is carried by the estimator (row 1-22): its weight and reaction are part of both forces.
    """
    motion, forces = replayed(path, duration, "backhoe_loader_cab")
    return motion, {name: score(*pair) for name, pair in forces.items()}


@pytest.mark.parametrize("path", LOADER, ids=lambda p: p.stem)
def test_loader_case_runs_and_is_scored(path):
    """9 s of each run of document 001 with the loader itself: motion within 5 %, forces within 15 %, weight of the seat in."""
    motion, forces = loader_errors(path, SHORT_S)
    assert motion.nrmse < 0.05
    for name, found in forces.items():
        assert found.nrmse < 0.15, name


def test_nobody_leaves_the_seat_on_the_bump_and_the_rough_runs_differ_by_speed():
    """Rows 1-12, 1-13 and 1-18: what the seat pad felt; the rear wheels meet the bump a wheelbase later."""
    peak = {}
    for path in LOADER:
        scenario = dataclasses.replace(load_scenario(path), duration=SHORT_S)
        truth = run_scenario(scenario, load_vehicle(ROOT / scenario.vehicle_file)).truth.signals
        seat = truth["cg_accel_seat"][:, 2].astype(float)
        peak[path.stem.removeprefix("document_001_")] = (np.sqrt(np.mean(seat**2)), separation_times(seat, scenario.truth_rate))
    assert peak["bump_10_km_per_h"][1] == []
    assert peak["rough_15_km_per_h"][0] > 1.1 * peak["rough_10_km_per_h"][0]  # m/s^2


@pytest.mark.slow
@pytest.mark.parametrize("path", TRUCK, ids=lambda p: p.stem)
def test_whole_case_meets_ten_percent(path):
    """20 s: mount forces within 10 %."""
    for name, pair in replayed(path, 20.0)[1].items():
        assert score(*pair).nrmse < 0.10, name


@pytest.mark.slow
@pytest.mark.parametrize("path", LOADER, ids=lambda p: p.stem)
def test_whole_loader_case_meets_ten_percent(path):
    """20 s: forces of both mounts, static share included, within 10 %."""
    for name, found in loader_errors(path, 20.0)[1].items():
        assert found.nrmse < 0.10, name


@pytest.mark.slow
@pytest.mark.xfail(reason="target missed: 10.5 % measured at the rear mounts, slow twist of the frame")
def test_truck_on_rough_ground_meets_ten_percent():
    for name, pair in replayed(SCENARIOS / "truck_rough_10_km_per_h.yaml", 20.0)[1].items():
        assert score(*pair).nrmse < 0.10, name
