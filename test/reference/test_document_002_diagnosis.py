# Copyright 2026 ride_estimation contributors
"""Document 002 replayed: the vehicle sinusoid is found without a hint, the six models are ranked, doubtful parameters flagged."""

from __future__ import annotations

import numpy as np
import pytest
from worlds.quarter_car import FireTruck

from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.identification.quarter_car.fit import fit_models
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

AMPLITUDE, FREQUENCY = 1500.0, 6.3  # N, Hz
GRAVITY = 9.80665


def believed() -> Vehicle:
    """Return the body on its axle with stiffness 17 % low and damping 25 % high."""
    body = Body("body", Prior(2500.0), np.zeros(3), np.eye(3), coordinates=("z",))
    mount = Mount("suspension", np.zeros(3), "body", "axle", {"z": KelvinVoigt(2.5e5, 2.5e4)})
    sensors = {
        "on_body": Sensor("on_body", "accelerometer", "/on_body", "body", noise_std=0.02),
        "on_axle": Sensor("on_axle", "accelerometer", "/on_axle", "axle", mount="suspension", noise_std=0.02),
    }
    return Vehicle("fire_truck", {"body": body}, {"suspension": mount}, sensors)


def fire_truck_run(disturbance: tuple[float, float]) -> UniformRun:
    """Return 30 s at 200 Hz over the block."""
    time, _, y = FireTruck(duration=30.0, start=8.0, disturbance=disturbance).record(200.0)
    zero = np.zeros(time.size)
    data = {name: np.stack([zero, zero, y[:, i] + GRAVITY], axis=1) for i, name in enumerate(("on_body", "on_axle"))}
    return UniformRun("fire truck", 200.0, 0, data, {name: np.ones(time.size, dtype=bool) for name in data})


def test_the_sinusoid_is_named_with_frequency_and_amplitude():
    answer = diagnose(believed(), fire_truck_run((AMPLITUDE, FREQUENCY)))
    assert answer.verdict == "explained"
    assert [(c.id, c.location, c.axis) for c in answer.causes] == [("harmonic_disturbance", "body", "z")]
    by_name = {p.name: p for p in answer.causes[0].parameters}
    # a tenth of a bin of 30 s, and what it states itself
    assert by_name["frequency"].value == pytest.approx(FREQUENCY, abs=0.003)
    assert abs(by_name["frequency"].value - FREQUENCY) < 3.0 * by_name["frequency"].std < 0.01
    assert by_name["amplitude z"].value == pytest.approx(AMPLITUDE, rel=0.01)
    calibrated = {p.name: p.value for p in answer.parameters}
    # truth of the simulated truck; standard errors 0.2 %
    assert calibrated["suspension.z.stiffness"] == pytest.approx(3.0e5, rel=0.01)
    assert calibrated["suspension.z.damping"] == pytest.approx(2.0e4, rel=0.01)


def test_without_the_sinusoid_nothing_is_named():
    answer = diagnose(believed(), fire_truck_run((0.0, 0.0)))
    assert answer.verdict == "no_discrepancy"
    assert answer.causes == ()


def test_the_step_that_the_document_drives_over_puts_parameters_on_bounds_and_says_so():
    time, _, y = FireTruck(duration=3.0, start=0.8).record(400.0)
    step = np.where(5.0 / 3.6 * time > 0.8, 0.1, 0.0)
    found = fit_models(
        step, y, 400.0, sprung_mass=2500.0, unsprung_mass=310.0, noise_std=(0.02, 0.02), models=(2,), starts=1
    )[0]
    assert "tyre_rate" in found.on_bounds
    assert "tyre_damping" in found.not_identified
    assert any("sag" in words for words in found.plausible.objections)
