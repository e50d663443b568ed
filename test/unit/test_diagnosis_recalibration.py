# Copyright 2026 ride_estimation contributors
"""A named fault gives the installation back: what it had bent before it was named is calibrated anew with it in the model."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from diagnosis_runs import GRAVITY, hiding_law, quarter_car, quarter_car_run

from ride_estimation.diagnosis.calibration.baseline import faulty_rows, sensor_error_spectra
from ride_estimation.diagnosis.calibration.linear_model import calibrate, file_parameters, seen_from, with_held_faults
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.splits import make_splits
from ride_estimation.diagnosis.hypotheses.hypothesis import Hypothesis
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.fitting import FullFitter
from ride_estimation.diagnosis.search.screening import Score
from ride_estimation.diagnosis.search.selection import Selector


def misread(sensor: str, factor: float, trimmed: bool = True):
    """Return a run of the quarter car whose sensor reads too much, about its value at rest where it was zeroed with it."""
    run = quarter_car_run(5)
    wrong = run.data[sensor].copy()
    rest = GRAVITY if trimmed else 0.0
    wrong[:, 2] = rest + factor * (wrong[:, 2] - rest)
    return dataclasses.replace(run, data={**run.data, sensor: wrong})


def selected(run, sensor: str):
    """Return calibrated model and selection where only the gain of one sensor may be named."""
    data = RunData(build_plant(quarter_car(), {"body": 3, "base": 3}), measurement_of(run), Settings())
    splits = make_splits(data.blocks.count)
    calibrated = with_held_faults(calibrate(data, splits.train))

    def build(view: RunView) -> list[Hypothesis]:
        return [h for h in library()["sensor_gain"].hypotheses(view) if h.location == sensor and h.axis == "z"]

    return calibrated, Selector(calibrated, splits, build, Settings()).run()


def measurement_of(run):
    return measurement(build_plant(quarter_car(), {"body": 3, "base": 3}), run)


@pytest.mark.parametrize("trimmed", [True, False])
@pytest.mark.parametrize(("sensor", "factor"), [("body", 1.3), ("base", 1.3), ("base", 0.8)])
def test_a_gain_is_found_whatever_it_biased_before_it_was_named(sensor, factor, trimmed):
    calibrated, found = selected(misread(sensor, factor, trimmed), sensor)
    bent = calibrated.view.plant.reading_errors[("gain", "base", "z")]
    assert abs(bent) > 0.0085  # at the limit of the tolerance, which holds the gain of the other sensor alike
    assert found.accepted is not None
    (fitted,) = found.accepted.fitted
    assert (fitted.hypothesis.variant == "") is trimmed and not found.accepted.strained
    (gain,) = library()["sensor_gain"].parameters(found.accepted.view, fitted)
    assert gain.value == pytest.approx(factor - 1.0, abs=2.0 * gain.std)
    # the tolerance of the other sensor is in it, 0.003 and what its mean reading leaves of that
    assert (0.001 if trimmed else 0.0007) < gain.std < 0.01
    other = found.accepted.view.plant.reading_errors[("gain", "base", "z")]
    if sensor == "body":
        assert abs(other) < 0.3 * abs(bent)


@pytest.mark.parametrize("trimmed", [True, False])
def test_the_extended_file_puts_the_reading_of_a_gain_right(trimmed):
    vehicle, (sensor, factor) = quarter_car(), ("body", 1.3)
    right = quarter_car_run(5).data[sensor]
    _, found = selected(misread(sensor, factor, trimmed), sensor)
    assert found.accepted is not None
    extended, _ = library()["sensor_gain"].extend(vehicle, found.accepted.view, found.accepted.fitted[0])
    again = extended.sensors[sensor].correction.apply(misread(sensor, factor, trimmed).data[sensor])
    assert np.sqrt(np.mean((again - right)[:, 2] ** 2)) < 0.02 * np.std(right[:, 2])


def view_of_cab():
    plant = build_plant(quarter_car(), {"body": 3, "base": 3})
    return RunView(RunData(plant, measurement_of(quarter_car_run(3)), Settings()), ModelState(*file_parameters(plant)))


def test_adjustables_are_seen_from_the_errors_that_a_plant_holds():
    view = view_of_cab()
    calibrated = calibrate(view.data)
    held = {("gain", "base", "z"): 0.004}
    moved = dataclasses.replace(calibrated.view.plant, reading_errors=held)
    offsets = {(a.kind, a.place, a.axis): a.offset for a in seen_from(moved, calibrated.adjustables)}
    assert offsets[("gain", "base", "z")] == -0.004 and offsets[("gain", "body", "z")] == 0.0
    ports = [i for i, a in enumerate(calibrated.adjustables) if a.kind in ("stiffness", "damping")]
    assert ports and all(seen_from(moved, calibrated.adjustables)[i] is calibrated.adjustables[i] for i in ports)


def test_small_errors_of_a_faulty_sensor_show_through_its_fault():
    view = view_of_cab()
    fault = np.diag([1.0, 1.0, 1.3])
    for sensor, factor in (("body", 1.3), ("base", 1.0 / 1.3)):
        plain, is_input = sensor_error_spectra(view, sensor, "delay", 0)
        seen, same = sensor_error_spectra(view, sensor, "delay", 0, fault)
        signals = view.plant.inputs if is_input else view.plant.outputs
        assert is_input == same == (sensor == "base")
        for row, spectrum in plain.items():
            share = factor if signals[row].component == 2 else 1.0
            np.testing.assert_allclose(seen[row], share * spectrum, atol=1e-12 * np.abs(spectrum).max())
    adjustables = calibrate(view.data).adjustables
    places, rows = faulty_rows(view, adjustables, {"base": fault})
    assert {adjustables[i].place for i in places} == {"base"} and rows.shape[2] == len(places)


def test_a_magnitude_is_as_open_as_the_shape_beside_it():
    run = quarter_car_run(3, law=hiding_law("bouc_wen", 1.5))
    data = RunData(build_plant(quarter_car(), {"body": 3, "base": 3}), measurement_of(run), Settings())
    splits = make_splits(data.blocks.count)
    fitter = FullFitter(calibrate(data, splits.train), splits)
    (h,) = [h for h in library()["missing_degree_of_freedom"].hypotheses(calibrate(data).view) if h.axis == "z"]
    fit = fitter.fit([Score(h, dict(h.grid[0]), np.zeros(6), 0.0, 0.0)], 3)
    alone, (together,) = fit.fitted[0], fitter.stated(fit).fitted
    assert set(together.shape_std) == {"frequency", "damping"} and min(together.shape_std.values()) > 0.0
    assert together.std(0) > 1.02 * alone.std(0)
    np.testing.assert_allclose(together.coefficients, alone.coefficients)
    (frequency,) = [p for p in library()["missing_degree_of_freedom"].parameters(fit.view, together) if "frequency" in p.name]
    assert frequency.std > together.shape_std["frequency"]
