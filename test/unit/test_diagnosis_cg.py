# Copyright 2026 ride_estimation contributors
"""A CG that lies off its place in the file: the plant of the model that names it is moved there."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from test_diagnosis_load import SITTING, runs_of

from ride_estimation.diagnosis.calibration.baseline import Adjustable
from ride_estimation.diagnosis.calibration.linear_model import rebalanced, with_named_cg
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.frames import AXES

_MATRICES = ("mass", "gravity_stiffness", "port_map", "out_acceleration", "static_force")


def _moved(file, axis: str, offset: float):
    body = file.bodies["cab"]
    cg = body.cg + offset * np.eye(3)[AXES.index(axis)]
    return dataclasses.replace(file, bodies={**file.bodies, "cab": dataclasses.replace(body, cg=cg)})


def _same(one, other) -> None:
    for name in _MATRICES:
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(("seed", "axis"), [(9241, "x"), pytest.param(9241, "y", marks=pytest.mark.slow)])
def test_a_cg_five_centimetres_off_is_named_with_its_offset(seed: int, axis: str):
    # a wrench along the motion about the wrong point leaves static loads and inertia where they were: a missing degree of
    # freedom then fits better
    _, file, (run, other) = runs_of(seed, 0.0, SITTING, transducers=False)
    answer = diagnose(_moved(file, axis, -0.05), run, [other])
    assert (answer.verdict, [(c.id, c.axis) for c in answer.causes]) == ("explained", [("cg_offset", axis)])
    (found,) = answer.causes[0].parameters
    assert found.value == pytest.approx(0.05, abs=0.006)
    # the run tells it to a few millimetres; how much of it the CG of a right file would be off, it does not
    tolerance = Settings().tolerances.of_cg(file.bodies["cab"])["xyz".index(axis)]
    assert tolerance < found.std < np.hypot(tolerance, 0.004)


def test_a_named_cg_is_in_the_matrices_and_no_tolerance():
    _, file, _ = runs_of(9241, 0.0, SITTING, transducers=False)
    channels, settings = dict.fromkeys(file.sensors, 3), Settings()
    plant = build_plant(file, channels)
    tolerated = rebalanced(plant, (Adjustable("cg", "cab", "y", 0.0075),), np.array([0.004]), settings)
    named = with_named_cg(tolerated, {("cab", "y"): 0.05}, settings)
    _same(named, build_plant(_moved(file, "y", 0.05), channels))
    assert named.body_errors == {}
    _same(with_named_cg(named, {}, settings), plant)
    again = with_named_cg(named, {("cab", "x"): -0.02}, settings)
    _same(again, build_plant(_moved(file, "x", -0.02), channels))
    assert again.named_cg == {("cab", "x"): -0.02}
