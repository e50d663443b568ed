# Copyright 2026 ride_estimation contributors
"""Which of two sensors side by side is wrong: bases that move alike, seen by the body through the sum of their springs."""

from __future__ import annotations

import types

import numpy as np
import pytest
from test_diagnosis_load import SITTING, runs_of
from test_diagnosis_wiring import axes, recorded

from ride_estimation.diagnosis.answer.isolability import confusions
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.hypotheses.hypothesis import Hypothesis
from ride_estimation.diagnosis.search.selection import Candidate, Round


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["chassis_rear_right", "chassis_front_left"])
def test_a_base_sensor_that_reads_half_too_much_sideways_is_the_one_that_is_named(sensor: str):
    """Calibration leaves the mount a quarter of its stiffness, with which the error of the sensor looks larger than it can be."""
    _, file, runs = runs_of(9243, 0.0, SITTING, transducers=False)
    factor = np.ones(3)
    factor[np.argmax(np.abs(file.sensors[sensor].rotation[1]))] = 1.55
    run, other = (recorded(r, axes(sensor, [0, 1, 2], tuple(factor))) for r in runs)
    answer = diagnose(file, run, [other])
    assert [(c.id, c.location) for c in answer.causes] == [("sensor_gain", sensor)], answer.sentence
    (gain,) = answer.causes[0].parameters
    assert abs(gain.value - 0.55) < 2.5 * gain.std and gain.std < 0.03


def candidate(cause: str, location: str, axis: str, value: float, ports: tuple[int, ...] = ()) -> Candidate:
    hypothesis = Hypothesis(cause, location, axis, lambda view, shape: [], ports=ports)
    return Candidate(types.SimpleNamespace(fitted=[types.SimpleNamespace(hypothesis=hypothesis)]), value)


SIDES = "sensor gain at left y and sensor gain at right y"


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (candidate("sensor_gain", "right", "y", 98.0), f"{SIDES} cannot be distinguished on this run"),
        (candidate("sensor_gain", "right", "y", 96.0), f"{SIDES} can hardly be distinguished on this run"),
        (candidate("sensor_gain", "right", "y", 90.0), ""),
        (candidate("sensor_gain", "left", "", 98.0), ""),  # the same sensor as a whole
        (candidate("sensor_delay", "left", "", 98.0), "sensor gain and sensor delay cannot be distinguished on this run"),
    ],
)
def test_places_of_one_cause_that_a_run_does_not_tell_apart_are_said(other: Candidate, said: str):
    first = candidate("sensor_gain", "left", "y", 100.0)
    assert [c.claim for c in confusions([Round((first, other), 0.0, 1.0)])] == ([said] if said else [])


def test_a_law_at_all_mounts_and_at_some_of_them_is_one_place():
    first, group = candidate("backlash", "rear_left", "z", 100.0, (2,)), candidate("backlash", "rear", "z", 99.0, (2, 5))
    apart = candidate("backlash", "front_left", "z", 99.0, (8,))
    assert [c.second for c in confusions([Round((first, group, apart), 0.0, 1.0)])] == ["backlash at front_left z"]
