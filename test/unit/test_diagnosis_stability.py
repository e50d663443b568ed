# Copyright 2026 ride_estimation contributors
"""Whether perturbed copies of a run give the same answer, and what that makes of the confidence."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from diagnosis_runs import hiding_law, quarter_car, quarter_car_run
from scipy import signal

from ride_estimation.diagnosis.answer import stability as module
from ride_estimation.diagnosis.answer.result import PerturbedCopy, Stability
from ride_estimation.diagnosis.answer.stability import PerturbedRun, overlap, rebuilt, resampled, spare_sensor
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted, Hypothesis
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.sensors.sensor import Sensor

ASKED = Settings(stability=True)
SAME, OTHER, SILENT = (PerturbedCopy("a copy", agrees, "") for agrees in (True, False, None))


@pytest.mark.parametrize(
    ("copies", "counts", "factor"),
    [
        ((SAME,) * 4, (4, 4), 1.0), ((SAME, OTHER, SAME, SAME), (3, 4), 0.8), ((OTHER,) * 4, (0, 4), 0.2),
        ((SAME, SILENT), (1, 1), 1.0), ((SILENT,), (0, 0), 1.0), ((), (0, 0), 1.0),
    ],
)  # fmt: skip
def test_the_run_counts_as_one_of_its_copies(copies, counts, factor):
    found = Stability(copies)
    assert found.counts == counts
    assert found.factor == pytest.approx(factor)
    assert (f"{counts[0]} of {counts[1]}" in found.sentence) == (counts[1] > 0)


@pytest.mark.parametrize(("form", "size", "cause"), [("", 0.0, None), ("jenkins_chain", 0.3, "coulomb_friction")])
def test_copies_of_a_run_give_its_answer(form, size, cause):
    run = quarter_car_run(11, law=hiding_law(form, size)) if form else quarter_car_run(11)
    plain, asked = diagnose(quarter_car(), run), diagnose(quarter_car(), run, settings=ASKED)
    assert [c.id for c in asked.causes] == ([cause] if cause else [])
    assert asked.stability is not None
    assert asked.stability.counts == (3, 3), "there is no sensor to spare"
    assert asked.sentence == f"{plain.sentence} The answer is the same on 3 of 3 perturbed copies of the run."
    assert [c.confidence for c in asked.causes] == [c.confidence for c in plain.causes]
    document = json.loads(json.dumps(asked.to_mapping()))
    assert document["stability"]["same"] == document["stability"]["answers"] == 3
    assert plain.to_mapping()["stability"] is None


@pytest.mark.parametrize(
    ("named", "copied"),
    [
        ("jenkins_chain", ""), pytest.param("", "jenkins_chain", marks=pytest.mark.slow),
        pytest.param("jenkins_chain", "foam_both_sides", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_a_copy_that_shows_something_else_is_reported_and_costs_confidence(monkeypatch, named, copied):
    """Copies of another run: without the effect, with one where there is none, with another one."""
    run, other = (quarter_car_run(11, law=hiding_law(form, 0.3)) if form else quarter_car_run(11) for form in (named, copied))
    plain = diagnose(quarter_car(), run)

    def copies(work):
        yield PerturbedRun("of another run", work.calibrated.view.plant, measurement(work.calibrated.view.plant, other), 0.5)

    monkeypatch.setattr(module, "perturbed", copies)
    asked = diagnose(quarter_car(), run, settings=ASKED)
    assert asked.stability.counts == (0, 1)
    assert "0 of 1" in asked.sentence
    assert "of another run: " in asked.sentence
    assert [c.confidence for c in asked.causes] == pytest.approx([0.5 * c.confidence for c in plain.causes])


@pytest.mark.parametrize(
    ("other", "one_answer"),
    [(("gain", "axle", ""), True), (("gain", "axle", "z"), True), (("gain", "axle", "x"), False),
     (("gain", "body", "z"), False), (("delay", "axle", ""), False)],
)  # fmt: skip
def test_a_sensor_named_without_an_axis_is_no_other_answer_than_one_of_its_axes(other, one_answer):
    """Where one axis moves, both describe the run equally well, and rounding decides which of them a copy prefers."""
    named, rival = (Hypothesis(*place, lambda view, shape: []) for place in (("gain", "axle", "z"), other))
    assert overlap(named, rival) == overlap(rival, named) == one_answer


def test_a_line_is_the_same_line_on_a_copy_and_not_another_one_of_its_body():
    def line(body, frequency):
        return Hypothesis("harmonic_disturbance", body, "", lambda view, shape: [], ({"frequency": frequency},))

    found = Fitted(line("cab", 11.86), np.ones(2), np.eye(2), {"frequency": 11.86})
    near, far, other = line("cab", 11.87), line("cab", 23.7), line("seat", 11.86)
    assert rebuilt(found, [far, near, other]) is rebuilt(found, [near, far]) is near
    assert rebuilt(found, [other]) is None


@pytest.mark.parametrize(
    ("refused", "same"), [("too little of any channel", 1), pytest.param("", 0, marks=pytest.mark.slow)]
)
def test_a_copy_refuses_what_predicts_nothing_that_matters_as_the_run_does(monkeypatch, refused, same):
    run, other = quarter_car_run(11), quarter_car_run(11, law=hiding_law("jenkins_chain", 0.3))

    def copies(work):
        yield PerturbedRun("of another run", work.calibrated.view.plant, measurement(work.calibrated.view.plant, other), 0.5)

    monkeypatch.setattr(module, "perturbed", copies)
    monkeypatch.setattr(module, "refusal", lambda work, base, extended: refused)
    assert diagnose(quarter_car(), run, settings=ASKED).stability.counts == (same, 1)


@pytest.mark.parametrize(("lacks", "fits"), [(0.0, 1), pytest.param(1.0, 3, marks=pytest.mark.slow)])
def test_rivals_that_a_copy_cannot_bring_forward_are_not_fitted_on_it(monkeypatch, lacks, fits):
    run, started = quarter_car_run(11, law=hiding_law("jenkins_chain", 0.3)), []
    fit = module._Copy._fit

    def copies(work):
        yield PerturbedRun("the run itself", work.plant, work.data.measured, lacks)

    def counted(copy, starts):
        started.append([s.hypothesis.cause for s in starts])
        return fit(copy, starts)

    monkeypatch.setattr(module, "perturbed", copies)
    monkeypatch.setattr(module._Copy, "_fit", counted)
    assert diagnose(quarter_car(), run, settings=ASKED).stability.counts == (1, 1)
    assert started[0] == ["coulomb_friction"] and len(started) == fits


def test_a_copy_that_is_too_short_says_so(monkeypatch):
    run = quarter_car_run(11)

    def copies(work):
        data = work.data.measured
        few = slice(0, int(13 * data.rate_hz))
        short = dataclasses.replace(data, outputs=data.outputs[few], inputs=data.inputs[few], valid=data.valid[few])
        yield PerturbedRun("short", work.calibrated.view.plant, short, 0.5)

    monkeypatch.setattr(module, "perturbed", copies)
    found = diagnose(quarter_car(), run, settings=ASKED).stability
    assert found.counts == (0, 0)
    assert "blocks remain" in found.copies[0].found
    assert found.sentence.startswith("No perturbed copy")


def test_a_redundant_sensor_is_one_whose_readings_the_others_determine():
    car = quarter_car()
    twin = Sensor("twin", "accelerometer", "/twin", "body_mass", noise_std=0.005)
    both = dataclasses.replace(car, sensors={**car.sensors, "twin": twin})
    assert spare_sensor(build_plant(car, {"body": 3, "base": 3}, 0.5, 0.7), set()) == ""
    plant = build_plant(both, {"body": 3, "base": 3, "twin": 3}, 0.5, 0.7)
    assert spare_sensor(plant, set()) == "twin"
    assert spare_sensor(plant, {"twin"}) == "body", "the sensor that is named stays"
    assert np.linalg.matrix_rank(plant.out_acceleration) == 1


def test_a_clipped_signal_is_clipped_at_another_time_base_too():
    time = np.arange(2000) / 200.0
    free = np.stack([np.sin(2.0 * np.pi * 3.0 * time), np.cos(2.0 * np.pi * 1.7 * time)], axis=1)
    cut = np.stack([np.clip(free[:, 0], -2.0, 0.7), free[:, 1]], axis=1)
    again = resampled(cut, 9, 10)
    plain = signal.resample_poly(cut, 9, 10, axis=0, padtype="line")
    assert again.shape == (1800, 2)
    # as much of the time lies at the limit as before, and nothing beyond it
    share = np.mean(again[:, 0] > 0.7 - 1e-9)
    assert share == pytest.approx(np.mean(cut[:, 0] > 0.7 - 1e-9), rel=0.15) and again[:, 0].max() <= 0.7
    assert np.mean(plain[:, 0] > 0.7 - 1e-9) < 0.7 * share
    # what is not cut is what it was but for its very peaks
    assert again[50:-50, 1] == pytest.approx(np.cos(2.0 * np.pi * 1.7 * np.arange(1800) / 180.0)[50:-50], abs=2e-3)
