# Copyright 2026 ride_estimation contributors
"""A force that turns with the wheels: its frequency sweeps with the speed, and is a line over the distance driven."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from diagnosis_runs import FINE, RATE_HZ, quarter_car, quarter_car_run

from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.hypotheses.lines import residual_orders
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Vehicle

SECONDS, ORDER = 40.0, 0.41


def speed_at(time: np.ndarray, swing: float) -> np.ndarray:
    """Speed of the drive [m/s]."""
    return 10.0 + swing * np.sin(2.0 * np.pi * time / 27.0)


def with_speed(run: UniformRun, swing: float) -> UniformRun:
    """Return a run in which the speed is measured, ten times a second and held between."""
    held = np.floor(np.arange(run.samples) / 10.0) * 10.0 / RATE_HZ
    data = {**run.data, "speed": speed_at(held, swing)[:, None]}
    return dataclasses.replace(run, data=data, valid={**run.valid, "speed": np.ones(run.samples, dtype=bool)})


def vehicle() -> Vehicle:
    car = quarter_car()
    return dataclasses.replace(car, sensors={**car.sensors, "speed": Sensor("speed", "speed", "/speed", "axle")})


def turning(amplitude: float, swing: float) -> Callable[[float, float], float]:
    """Return a force [N] that turns :data:`ORDER` times per metre driven, as a law for one run."""
    step = 1.0 / (RATE_HZ * FINE)
    distance = np.cumsum(speed_at(np.arange(round(SECONDS / step) + 1) * step, swing)) * step
    force = iter(amplitude * np.cos(2.0 * np.pi * ORDER * distance))
    return lambda x, v: float(next(force))


def driven(seed: int, amplitude: float, swing: float = 4.0) -> UniformRun:
    return with_speed(quarter_car_run(seed, SECONDS, law=turning(amplitude, swing)), swing)


@pytest.mark.parametrize("known", [True, False], ids=["speed measured", "not measured"])
def test_a_force_that_turns_with_the_wheels_is_named_where_the_speed_is_measured(known):
    car = vehicle() if known else quarter_car()
    answer = diagnose(car, driven(3, 25.0), [driven(4, 25.0)], settings=Settings(stability=known))
    if not known:
        assert answer.verdict == "unexplained"
        return
    assert answer.verdict == "explained"
    (cause,) = answer.causes
    assert (cause.id, cause.location) == ("harmonic_disturbance", "body_mass") and cause.confidence > 0.9
    stated = {p.name: p for p in cause.parameters}
    order = stated["cycles per metre driven"]
    assert abs(order.value - ORDER) < 2.0 * order.std < 0.003
    assert abs(stated["amplitude z"].value - 25.0) < 2.0 * stated["amplitude z"].std + 1.0
    judged = answer.gain.validation[0]
    assert judged.extended < 1.2 * judged.noise_floor < 0.5 * judged.baseline
    assert any("times per metre driven" in r for r in answer.remarks)


@pytest.mark.parametrize(("amplitude", "swing"), [(0.0, 4.0), (25.0, 0.0)], ids=["no force", "one speed"])
def test_no_order_is_found_where_there_is_none_or_the_speed_stays(amplitude, swing):
    run = driven(5, amplitude, swing)
    plant = build_plant(vehicle(), {s: np.asarray(v).shape[1] for s, v in run.data.items()})
    data = RunData(plant, measurement(plant, run), Settings())
    assert residual_orders(RunView(data, ModelState(np.array([44e3]), np.array([2e3])))) == []
