# Copyright 2026 ride_estimation contributors
"""Every cause of the library keeps the contract: texts, columns, numbers, an extended vehicle that loads again."""

from __future__ import annotations

import copy
import functools

import numpy as np
import pytest

from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted, Sign
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.io.vehicle_file import load_vehicle, save_vehicle
from ride_estimation.signals.recording import UniformRun

IDS = (
    "coulomb_friction", "viscoelasticity", "stiffness_nonlinearity", "damping_nonlinearity", "bump_stop", "backlash",
    "harmonic_disturbance", "mass_change", "cg_offset", "parameter_drift", "one_soft_mount", "flexible_mode",
    "missing_degree_of_freedom", "sensor_delay", "sensor_gain", "sensor_bias", "sensor_misalignment", "sensor_clipping",
    "wrong_sensor_position",
)  # fmt: skip


@functools.cache
def cab_view() -> RunView:
    """Return a short run of the cab: white vibration on every sensor, one line, one clipped channel."""
    vehicle = load_vehicle("config/vehicles/truck_cab.yaml")
    rng = np.random.default_rng(1)
    count, rate = 1400, 100.0
    time = np.arange(count) / rate
    data = {}
    for name in vehicle.sensors:
        values = np.array([0.0, 0.0, 9.80665]) + rng.normal(size=(count, 3)) * 0.5
        values[:, 2] += 0.8 * np.sin(2 * np.pi * 11.0 * time)
        data[name] = values
    data["cab_rear_left"][:, 2] = np.minimum(data["cab_rear_left"][:, 2], 10.2)
    valid = {name: np.ones(count, dtype=bool) for name in data}
    plant = build_plant(vehicle, dict.fromkeys(data, 3))
    state = ModelState(np.array([p.stiffness for p in plant.ports]), np.array([p.damping for p in plant.ports]))
    return RunView(RunData(plant, measurement(plant, UniformRun("contract", rate, 0, data, valid)), Settings()), state)


def test_the_library_is_exactly_the_nineteen_published_ids():
    assert sorted(library()) == sorted(IDS)


@pytest.mark.parametrize("name", IDS)
def test_a_cause_says_what_it_asks_needs_and_what_would_refute_it(name):
    cause = library()[name]
    assert cause.QUESTION.endswith("?")
    assert cause.NEEDS and cause.WOULD_REFUTE and cause.MEASURE_NEXT
    assert cause.RIVALS and set(cause.RIVALS) <= set(IDS) - {name}


@pytest.mark.parametrize("name", [n for n in IDS if n != "one_soft_mount"])
def test_hypotheses_have_finite_columns_at_declared_places(name):
    view = cab_view()
    hypotheses = library()[name].hypotheses(view)
    assert hypotheses
    plant = view.plant
    places = {*plant.mounts, *plant.sensors, *(b for b, _ in plant.coordinates), "all", "front", "rear", "left", "right"}
    for h in hypotheses:
        assert h.cause == name
        assert h.location in places
        assert h.axis in ("", "x", "y", "z", "roll", "pitch", "yaw")
    h = hypotheses[0]
    columns = h.columns(view, h.grid[0])
    assert columns
    for column in columns:
        for effect in column:
            assert np.all(np.isfinite(effect.signal))


@pytest.mark.parametrize("name", IDS)
def test_the_extended_vehicle_is_written_and_loads_again(name, tmp_path):
    view = cab_view()
    cause = library()[name]
    hypotheses = cause.hypotheses(view)
    if name == "one_soft_mount":
        from ride_estimation.diagnosis.hypotheses.hypothesis import Hypothesis

        h, size, shape = Hypothesis(name, "front_left", "z", lambda view, shape: []), 1, {}
    else:
        h = hypotheses[0]
        shape = dict(h.grid[0])
        size = len(h.columns(view, shape))
    signs = h.column_signs(size)
    coefficients = np.array([-0.01 if s == Sign.NEGATIVE else 0.01 for s in signs])
    fitted = Fitted(h, coefficients, 1e-6 * np.eye(size), shape)
    for reported in cause.parameters(view, fitted):
        assert np.isfinite(reported.value)
        assert reported.std >= 0.0
        assert reported.unit
    vehicle, remarks = cause.extend(view.plant.vehicle, view, fitted)
    path = tmp_path / "vehicle_extended.yaml"
    save_vehicle(vehicle, path)
    again = load_vehicle(path)
    assert set(again.mounts) == set(vehicle.mounts)
    assert all(isinstance(r, str) for r in remarks)


@pytest.mark.parametrize("name", ["flexible_mode", "viscoelasticity", "missing_degree_of_freedom"])
def test_what_a_linear_cause_does_on_a_road_twice_as_rough_is_twice_as_large(name):
    """Coefficients are those of the vehicle and not of the run they were found on."""
    view = cab_view()
    rougher = copy.copy(view)
    rougher.deflection_spectrum = 2.0 * view.deflection_spectrum
    rougher.coordinate_spectrum = 2.0 * view.coordinate_spectrum
    h = library()[name].hypotheses(view)[0]
    for one, two in zip(h.columns(view, h.grid[0]), h.columns(rougher, h.grid[0]), strict=True):
        for before, after in zip(one, two, strict=True):
            np.testing.assert_allclose(after.signal, 2.0 * before.signal, rtol=1e-9, atol=1e-12 * np.max(np.abs(after.signal)))


def test_a_mass_changes_within_the_segment_that_is_analysed():
    """What happened before its first block is a wrong mass and no change."""
    view = cab_view()
    (h,) = (h for h in library()["mass_change"].hypotheses(view) if h.shapes)
    first, last = view.blocks.time_s[[0, -1]]
    instant = next(s for s in h.shapes if s.name == "at")
    assert first <= instant.lower <= min(g["at"] for g in h.grid) < max(g["at"] for g in h.grid) <= instant.upper <= last


def test_one_soft_mount_has_no_residual_hypothesis():
    assert library()["one_soft_mount"].hypotheses(cab_view()) == ()


def test_clipping_is_only_suspected_where_samples_heap_up_at_an_extreme():
    found = library()["sensor_clipping"].hypotheses(cab_view())
    assert [h.location for h in found] == ["cab_rear_left"]
