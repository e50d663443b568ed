# Copyright 2026 ride_estimation contributors
"""What accelerometers on one frame say about errors of one of them."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from test_diagnosis_load import SITTING, runs_of

from ride_estimation.diagnosis.calibration.base_agreement import BaseAgreement
from ride_estimation.diagnosis.calibration.linear_model import file_parameters
from ride_estimation.diagnosis.common.effect import combined_effects
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.hypotheses.sensor_column import sensor_column
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView

GAIN = 1.5
WRONG = "chassis_rear_right"


@functools.cache
def drive():
    _, file, (run, _) = runs_of(9241, 0.0, SITTING, transducers=False)
    return file, run


def agreement_of(gain: float) -> tuple[BaseAgreement, RunView]:
    """Return the agreement of the bases of a drive with a gain of one lateral axis."""
    file, run = drive()
    component = int(np.argmax(np.abs(file.sensors[WRONG].rotation[1])))
    wrong = run.data[WRONG].copy()
    wrong[:, component] *= gain
    run = dataclasses.replace(run, data={**run.data, WRONG: wrong})
    plant = build_plant(file, dict.fromkeys(file.sensors, 3), 0.3, 0.5)
    view = RunView(RunData(plant, measurement(plant, run), Settings()), ModelState(*file_parameters(plant)))
    return BaseAgreement(view), view


def evidence_of(bases: BaseAgreement, view: RunView, sensor: str, share: float) -> float:
    component = int(np.argmax(np.abs(view.plant.vehicle.sensors[sensor].rotation[1])))
    return bases.evidence(combined_effects([sensor_column(view, sensor, "gain", component)], np.array([share])))


def test_the_sensor_that_is_wrong_is_the_one_without_which_the_bases_agree():
    bases, view = agreement_of(GAIN)
    told = {name: evidence_of(bases, view, name, 1.0 - 1.0 / GAIN) for name in ("chassis_rear_left", WRONG)}
    assert told[WRONG] > 5.0 and told["chassis_rear_left"] < -1.0
    # the share that is too much and no other
    assert all(evidence_of(bases, view, WRONG, share) < told[WRONG] for share in (-0.3, 0.1, 0.6))


@pytest.mark.parametrize("share", [0.05, 0.3, -0.3])
def test_sensors_in_order_speak_against_an_error(share: float):
    bases, view = agreement_of(1.0)
    assert evidence_of(bases, view, WRONG, share) < (-2.0 if abs(share) > 0.1 else 0.0)
    # within the tolerance of a sensor there is nothing to tell
    assert abs(evidence_of(bases, view, WRONG, 0.001)) < 0.3


def test_errors_of_sensors_on_the_body_are_none_of_the_bases():
    bases, view = agreement_of(GAIN)
    assert evidence_of(bases, view, "cab_rear_right", 0.3) == 0.0
