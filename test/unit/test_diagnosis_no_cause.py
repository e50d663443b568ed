# Copyright 2026 ride_estimation contributors
"""What is no cause: errors near a node, errors of an installation; and a turned base sensor that predicts no better."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_runs import quarter_car, quarter_car_run
from worlds.adapters import product_inputs
from worlds.scenario import Scenario, make_scenario

from ride_estimation.diagnosis.answer.gain import judged_in_band
from ride_estimation.diagnosis.answer.result import NO_DISCREPANCY
from ride_estimation.diagnosis.calibration.baseline import Adjustable
from ride_estimation.diagnosis.calibration.installation import installation_remarks
from ride_estimation.diagnosis.calibration.linear_model import calibrate, calibrated_at, moved_plant, stepped
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.splits import make_splits
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.noise import gross_power
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.signals.recording import UniformRun


def test_the_error_of_a_small_difference_refers_to_what_it_is_the_difference_of():
    # two coordinates of power 4 and 9 whose parts cancel to 1 in the first channel, and a channel of one coordinate
    samples, bins = 100, 40
    coordinates = np.sqrt(samples) * np.tile([2.0 + 0j, 3.0 + 0j], (bins, 1))
    transfer = np.tile(np.array([[1.0 + 0j, -1.0], [0.0, 1.0], [1.0, -1.0]]), (bins, 1, 1))
    measured = np.tile([1.0, 9.2, 1.0], (bins, 1))
    found = gross_power(measured, transfer, coordinates, samples, 5, np.array([True, True, False]))
    np.testing.assert_allclose(found[:, 0], 13.0)
    np.testing.assert_allclose(found[:, 1], 9.2)  # the model predicts 9; more was measured
    np.testing.assert_allclose(found[:, 2], 1.0)  # a transducer


def test_an_error_at_the_edge_of_the_tolerances_is_reported_and_what_is_unknown_or_named_is_not():
    items = [
        Adjustable("misalignment", "roof", "y", 0.004, offset=-0.004),  # 0.004 are in the plant already
        Adjustable("misalignment", "floor", "y", 0.004),
        Adjustable("gain", "named", "x", 0.003),
        Adjustable("delay", "unsure", "", 1e-4),
        Adjustable("stiffness", "mount", "z", 0.3),
    ]
    coefficients = np.array([0.008, 0.004, 0.012, 4e-4, 3.0])
    covariance = np.diag(np.array([4e-4, 4e-4, 1e-4, 2e-4, 0.01]) ** 2)
    (words,) = installation_remarks(items, coefficients, covariance, {"named"})
    assert words.startswith("roof about y: turned 0.688 +- 0.023 deg, 3.0 standard deviations")


def late(run: UniformRun, seconds: float) -> UniformRun:
    """Return a run whose base sensor is late, by its spectrum."""
    values = run.data["base"]
    omega = 2.0 * np.pi * np.fft.rfftfreq(len(values), 1.0 / run.rate_hz)
    mean = values.mean(axis=0)
    shifted = np.fft.irfft(np.fft.rfft(values - mean, axis=0) * np.exp(-1j * omega * seconds)[:, None], len(values), axis=0)
    return UniformRun(run.name, run.rate_hz, 0, {**run.data, "base": shifted + mean}, run.valid)


@pytest.mark.parametrize(("seconds", "named"), [(3e-4, []), (3e-3, ["sensor_delay"])])
def test_a_skew_of_a_converter_is_calibration_and_a_late_sensor_is_not(seconds: float, named: list[str]):
    answer = diagnose(quarter_car(), late(quarter_car_run(61), seconds))
    assert [c.id for c in answer.causes] == named


def healthy(seed: int) -> Scenario:
    """Return a healthy cab with errors of all sensors, as the benchmark of false alarms draws it."""
    follow = tuple(np.random.default_rng([seed, 1]).uniform(0.0, 1.0, 2))
    return make_scenario(("none",), seed, residual=0.05, noise=0.02, duration=60.0, installation=1.0, follow=follow)


@pytest.mark.slow
def test_a_cab_that_moves_far_on_soft_mounts_is_calibrated_down_to_its_noise():
    # stiffness, tilt of brackets and sensors are bilinear: with the little weight of a model that misses much nothing moves,
    # and 1.4 times the noise would be left, on a third road 3.2 % against a floor of 1.7 %
    vehicle, run, _ = product_inputs(healthy(700006))
    plant = build_plant(vehicle, {name: np.shape(values)[1] for name, values in run.data.items()})
    data = RunData(plant, measurement(plant, run), Settings())
    found = calibrate(data, make_splits(data.blocks.count).train)
    misfit = found.regression.misfit(found.regression.grams, found.blocks, found.fit.coefficients)
    assert misfit < 1.1 * float(found.view.block_dof[found.blocks].sum())
    assert not found.strained


@pytest.mark.slow
def test_calibration_ends_where_a_further_step_gains_nothing():
    # one step earlier sensors are strained by 120 instead of 86, and any cause that is fitted further seems to explain that
    vehicle, run, _ = product_inputs(healthy(1100005))
    plant = build_plant(vehicle, {name: np.shape(values)[1] for name, values in run.data.items()})
    data = RunData(plant, measurement(plant, run), Settings())
    blocks = make_splits(data.blocks.count).train
    found = calibrate(data, blocks)
    view = found.view
    state = stepped(view.state, view, found.adjustables, found.fit.coefficients)
    moved = moved_plant(view.plant, found.adjustables, found.fit.coefficients, view.settings, True)
    further = calibrated_at(RunView(data.with_plant(moved), state), blocks)
    levels = [c.regression.misfit(c.regression.grams, blocks, c.fit.coefficients) + c.penalty for c in (found, further)]
    assert levels[0] - levels[1] < 2.0 * view.settings.significance


@pytest.mark.slow
def test_a_law_that_leaves_most_of_very_little_is_not_named():
    # 23 N of friction would take a fifth of what a model misses that explains the run to 2 % of the noise power
    answer = diagnose(*product_inputs(healthy(700000)))
    assert answer.verdict == NO_DISCREPANCY and not answer.causes


@pytest.mark.parametrize(
    ("in_band", "strained_before", "strained_after", "judged"),
    [(True, False, False, True), (True, True, True, True), (True, True, False, False), (False, False, False, False)],
)
def test_what_shows_in_mean_readings_or_strained_tolerances_is_not_judged_by_the_residual(
    in_band, strained_before, strained_after, judged
):
    accepted = SimpleNamespace(in_band=in_band, strained=strained_after)
    calibrated, selection = SimpleNamespace(strained=strained_before), SimpleNamespace(accepted=accepted)
    assert judged_in_band(SimpleNamespace(calibrated=calibrated, selection=selection)) is judged


@pytest.mark.slow
def test_an_offset_that_leaves_the_residual_as_it_is_is_named_all_the_same():
    answer = diagnose(*product_inputs(make_scenario(("sensor_bias",), 4100, residual=0.15, noise=0.02, duration=40.0)))
    assert [(c.id, c.location, c.axis) for c in answer.causes] == [("sensor_bias", "cab_rear_right", "y")]
