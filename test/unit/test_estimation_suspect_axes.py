# Copyright 2026 ride_estimation contributors
"""Horizontal stiffness that changed suddenly, or is far from the file: mount or base sensor, and nothing is called valid."""

from __future__ import annotations

import numpy as np
import pytest

from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.parameters.parameter_estimator import ParameterEstimator
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.vehicle_file import load_vehicle


@pytest.fixture
def parameters() -> ParameterEstimator:
    """Return parameters that are all well known and as the file says."""
    found = Pipeline(load_vehicle("truck_cab"))._parameters
    known = np.full(found.count, 0.02)
    found.std[: found.count] = known
    found.status.follow(known, found._prior_std, found.theta, 100, found._lower, found._upper)
    assert {e.status for e in found.estimates()} == {Status.VALID}
    return found


def put(parameters: ParameterEstimator, name: str, log: float) -> None:
    parameters.theta[parameters._names().index(name)] = log


def suspects(parameters: ParameterEstimator) -> set[str]:
    """Return the axes with suspect parameters."""
    return {e.name.split(".")[1] for e in parameters.estimates() if e.status is Status.SUSPECT}


@pytest.mark.parametrize(
    ("axis", "log", "expected"), [("x", -1.5, {"x"}), ("x", -0.6, set()), ("y", 1.5, {"y"}), ("z", -1.5, set())]
)
def test_a_horizontal_stiffness_far_from_the_file(parameters, axis, log, expected):
    put(parameters, f"front_left.{axis}.stiffness", log)
    put(parameters, f"rear_left.{axis}.stiffness", -0.3 * log)
    assert suspects(parameters) == expected
    said = [note for note in parameters.notes() if "far from the file" in note]
    assert len(said) == len(expected)
    assert all("front_left" in note and "base sensor chassis_front_left" in note for note in said)


def test_a_horizontal_stiffness_that_changed_suddenly_until_it_is_again_as_it_was(parameters):
    put(parameters, "rear_right.y.stiffness", 0.1)
    parameters._note_changes(1, parameters._now())
    assert not suspects(parameters)
    put(parameters, "rear_right.y.stiffness", -0.2)
    assert suspects(parameters) == {"y"}
    assert any("changed suddenly, most at rear_right" in note for note in parameters.notes())
    saved = parameters.save()
    put(parameters, "rear_right.y.stiffness", 0.1)
    assert not suspects(parameters)
    parameters.load(saved)
    assert suspects(parameters) == {"y"}
