# Copyright 2026 ride_estimation contributors
"""A recording that begins while the body moves: its initial state is an unknown of the run."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from diagnosis_runs import DAMPING, MASS, STIFFNESS, hiding_law, quarter_car, quarter_car_run
from worlds.adapters import stretch, with_gaps

from ride_estimation.diagnosis.answer.result import EXPLAINED, NO_DISCREPANCY, Diagnosis
from ride_estimation.diagnosis.calibration.initial_state import found_motion, initial_motions
from ride_estimation.diagnosis.calibration.linear_model import calibrate
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.spectra import FADE_S
from ride_estimation.diagnosis.common.splits import make_splits
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.blocks import fading, stretches_of
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.prediction import block_squares, predict
from ride_estimation.diagnosis.search.work import plain_model
from ride_estimation.signals.recording import UniformRun

LIGHT = 200.0  # N s/m: free motion of 1.7 Hz decays within four seconds


def lightly_damped(seed: int, law=lambda x, v: 0.0, seconds: float = 60.0) -> UniformRun:
    """Return a run of the quarter car with a light damper and another law beside it."""
    return quarter_car_run(seed, seconds, law=lambda x, v: (LIGHT - DAMPING) * v + law(x, v), roughness=0.5)


def begun_late(run: UniformRun, seconds: float) -> UniformRun:
    """Return a run without its first seconds."""
    return stretch(run, round(seconds * run.rate_hz))


def seen(run: UniformRun, damping: float = LIGHT) -> RunView:
    """Return a run through the true model with some damping."""
    vehicle = quarter_car()
    plant = build_plant(vehicle, {s: np.asarray(v).shape[1] for s, v in run.data.items()})
    data = RunData(plant, measurement(plant, run), Settings())
    return RunView(data, ModelState(np.array([STIFFNESS]), np.array([damping])))


def test_free_motions_are_those_of_a_mass_on_a_spring_and_a_damper():
    view = seen(lightly_damped(1, seconds=30.0))
    names, std, spectra = initial_motions(view)
    assert names == [("mode_1", "displacement"), ("mode_1", "velocity")]
    grid = view.grid
    time = np.arange(grid.samples) / grid.rate_hz - FADE_S
    decay, square = 0.5 * LIGHT / MASS, STIFFNESS / MASS
    omega = np.sqrt(square - decay**2)
    # x'' of x(0) = 1, x'(0) = 0 and of x(0) = 0, x'(0) = 1
    free = np.exp(-decay * time)
    from_velocity = -free * (2.0 * decay * np.cos(omega * time) + (square - 2.0 * decay**2) / omega * np.sin(omega * time))
    from_displacement = -square * free * (np.cos(omega * time) - decay / omega * np.sin(omega * time))
    inside = (time > 2.0) & (time < 12.0)
    # one unit of a modal coordinate is mass ** -0.5 of a displacement
    wanted = np.stack([from_displacement, from_velocity], axis=1)[inside] / np.sqrt(MASS)
    found = grid.signal(spectra[:, 0] * grid.band_weight[:, None])[inside]
    mixed, *_ = np.linalg.lstsq(found, wanted, rcond=None)
    assert np.all(np.std(found @ mixed - wanted, axis=0) < 0.01 * np.std(wanted, axis=0))
    sizes = np.array([1.0, np.sqrt(square)])
    # the state after the blow is the one meant up to the damping ratio
    np.testing.assert_allclose(mixed * (sizes / sizes[:, None]), np.eye(2), atol=2.0 * decay / omega)
    deflection = view.deflection[view.data.block_window(np.arange(view.blocks.count)) > 0.0, 0]
    assert std[0] == pytest.approx(np.sqrt(2.0 * MASS) * np.std(deflection), rel=0.3)
    assert std[1] == pytest.approx(std[0] * np.sqrt(square), rel=0.3)


@pytest.mark.parametrize("damping", [4e3, 30e3], ids=["decays", "decays beyond critical damping"])
def test_a_free_motion_that_is_forgotten_is_no_unknown(damping):
    view = seen(lightly_damped(1, seconds=30.0), damping)
    names, _, _ = initial_motions(view)
    # 30 kN s/m: the slower of two rates is 1.5 per second, a twentieth is left after two seconds
    assert bool(names) == (damping == 30e3)
    assert bool(np.any(found_motion(view, view.residual_spectrum))) == bool(names)


def test_a_run_that_begins_while_the_body_moves_is_predicted_as_well_as_one_from_rest():
    vehicle, whole = quarter_car(), lightly_damped(3)
    plant = build_plant(vehicle, {s: np.asarray(v).shape[1] for s, v in whole.data.items()})
    calibrated = calibrate(RunData(plant, measurement(plant, whole), Settings()))
    late = RunData(calibrated.view.plant, measurement(plant, begun_late(whole, 20.0)), Settings())
    model = plain_model(calibrated)
    errors, signal = block_squares(predict(late, model))
    share = np.sqrt(errors / signal)
    assert share[0] < 1.5 * np.median(share)
    errors, signal = block_squares(predict(late, model, at_rest=True))
    assert np.sqrt(errors / signal)[0] > 5.0 * np.median(share)


def test_a_long_gap_ends_a_stretch_and_a_short_one_is_bridged():
    valid = np.ones(1000, dtype=bool)
    valid[300:310] = valid[600:611] = valid[:20] = False  # 0.10, 0.11 and 0.2 s
    assert stretches_of(valid, 100.0) == ((20, 600), (611, 1000))
    window = fading(1000, stretches_of(valid, 100.0), 100.0)
    assert np.all(window[:20] == 0.0) and np.all(window[600:611] == 0.0) and np.all(window[120:500] == 1.0)
    assert stretches_of(np.zeros(50, dtype=bool), 100.0) == ()


def test_a_run_with_gaps_is_predicted_as_well_as_one_without():
    vehicle, whole = quarter_car(), lightly_damped(3)
    broken = with_gaps(whole, (15.0, 16.5), (30.0, 30.3))
    plant = build_plant(vehicle, {s: np.asarray(v).shape[1] for s, v in whole.data.items()})
    found = []
    for run in (whole, broken):
        data = RunData(plant, measurement(plant, run), Settings())
        calibrated = calibrate(data)
        names = {a.place for a in calibrated.adjustables if a.kind == "initial_state"}
        later = {f"mode_1_after_gap_{number}" for number in (1, 2)}
        assert names == ({"mode_1"} if run is whole else {"mode_1", *later})
        errors, signal = block_squares(predict(data, plain_model(calibrated)))
        found.append(np.sqrt(errors / signal).max())
        misfit = calibrated.regression.block_misfit(calibrated.regression.grams, calibrated.fit.coefficients)
        # bridged by a line, 1.5 s leave the misfit of a block at several hundred
        assert (misfit / calibrated.view.block_dof).max() < 1.5
    assert found[1] < 1.2 * found[0]


def test_strokes_that_laws_refer_to_are_those_of_what_is_analysed():
    view = seen(with_gaps(lightly_damped(3), (15.0, 16.5), (30.0, 30.3)))
    reach = 0.5 * view.blocks.index.shape[1] / view.grid.decimated_rate_hz
    inside = np.any(np.abs(view.data.time_s[:, None] - view.blocks.time_s) < reach, axis=1)
    for scale, signal in zip(view.scales[0], (view.deflection, view.deflection_rate)):
        rms = [np.sqrt(np.mean(signal[part] ** 2)) for part in (inside, slice(None))]
        assert scale == pytest.approx(rms[0], rel=0.004)
        assert abs(rms[1] / rms[0] - 1.0) > 0.01  # fading moves a mount, too, and in a gap it rests


def test_blocks_after_a_gap_tell_the_state_and_others_judge():
    plain, broken = make_splits(12), make_splits(12, [0, 3, 9])
    np.testing.assert_array_equal(plain.judge, [3, 7, 11])
    np.testing.assert_array_equal(broken.judge, [4, 8])
    assert sorted([*broken.train, *broken.judge]) == list(range(12))
    # where every block begins a stretch, some have to judge all the same
    np.testing.assert_array_equal(make_splits(4, range(4)).judge, [3])
    # the second stretch begins with the fourth block; the fifth judges
    run = with_gaps(lightly_damped(3), (12.5, 13.5))
    view = seen(run)
    assert view.blocks.begins == [0, 3]
    residual = view.grid.signal(view.residual_spectrum)
    found = found_motion(view, view.residual_spectrum)
    changes = []
    for block in (3, 4):
        spoiled = residual.copy()
        # within the block: the band of the spectra spreads what is done at its ends
        inside = np.flatnonzero(view.data.block_window(np.array([block])))[50:-50]
        spoiled[inside] += 5.0 * np.std(residual) * np.hanning(len(inside))[:, None] * np.sin(0.1 * inside)[:, None]
        other = found_motion(view, view.grid.spectrum(spoiled))
        changes.append(np.sqrt(np.sum(np.abs(other - found) ** 2) / np.sum(np.abs(found) ** 2)))
    assert changes[1] < 0.1 * changes[0]


def test_a_prediction_from_rest_does_not_look_at_outputs():
    vehicle, run = quarter_car(), lightly_damped(4, seconds=30.0)
    plant = build_plant(vehicle, {s: np.asarray(v).shape[1] for s, v in run.data.items()})
    calibrated = calibrate(RunData(plant, measurement(plant, run), Settings()))
    measured = measurement(plant, run)
    other = dataclasses.replace(measured, outputs=measured.outputs[::-1].copy())
    first, second = (
        predict(RunData(calibrated.view.plant, m, Settings()), plain_model(calibrated), at_rest=True).spectrum
        for m in (measured, other)
    )
    # up to rounding, which depends on where in memory the arrays lie
    np.testing.assert_allclose(first, second, rtol=0.0, atol=1e-12 * np.abs(first).max())


@functools.cache
def from_rest(hidden: str) -> tuple[list[UniformRun], Diagnosis]:
    """Return two runs with a hidden law and what the first of them is said to show."""
    runs = []
    for seed in (5, 6):
        force = hiding_law(hidden, 0.15) if hidden else lambda x, v: 0.0
        runs.append(lightly_damped(seed, force))
    return runs, diagnose(quarter_car(), runs[0], validation=runs[1:])


@pytest.mark.parametrize("hidden", ["", "stribeck"])
@pytest.mark.parametrize(
    "recorded", [lambda r: begun_late(r, 20.0), lambda r: with_gaps(r, (20.0, 21.0), (40.0, 42.0))], ids=["late", "gaps"]
)
def test_runs_that_begin_late_or_have_gaps_get_the_answer_of_those_from_rest(hidden, recorded):
    runs, whole = from_rest(hidden)
    late = diagnose(quarter_car(), recorded(runs[0]), validation=[recorded(runs[1])])
    assert whole.verdict == late.verdict == (EXPLAINED if hidden else NO_DISCREPANCY)
    assert [c.id for c in whole.causes] == [c.id for c in late.causes]
    gaps = [w for w in late.warnings if "2 gaps longer than 0.1 s" in w]
    assert len(gaps) == (2 if np.isnan(recorded(runs[0]).data["body"]).any() else 0)
    assert all("34 of 60 s are analysed" in w for w in gaps)
    first, second = (d.gain.validation[0] for d in (whole, late))
    assert second.extended < 1.3 * first.extended
