# Copyright 2026 ride_estimation contributors
"""The law without a name: how much it explains, where, and that a mimic of the real cause is found out by it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from diagnosis_runs import quarter_car, quarter_car_run

from ride_estimation.diagnosis.calibration.linear_model import calibrate
from ride_estimation.diagnosis.calibration.regression import Regression
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.common.effect import Effect, Where
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.search.free_law import free_law


def planted(force: float, noise: float) -> tuple[float, str, float]:
    """Return what a law on top of the linear quarter car explains, its place, and what of it the linear model cannot."""
    plant = build_plant(quarter_car(), {"body": 3, "base": 3})
    calibrated = calibrate(RunData(plant, measurement(plant, quarter_car_run(41, 30.0)), Settings()))
    view, base = calibrated.view, calibrated.regression
    u = view.deflection[:, 0] / view.scales[0][0]
    # a spring that bends between two bends of the general law: none of its columns is the law
    column = view.push([(Effect(Where.PORT, 0, force * np.maximum(u - 0.75, 0.0)),)])[:, :, 0]
    residual = column + noise * np.random.default_rng(42).standard_normal(column.shape)
    columns = base.rows(np.arange(len(column))).reshape(*column.shape, -1)[:, :, :-1]
    problem = Regression(
        residual, columns, 0.0 * base.mean_residual, 0.0 * base.mean_columns, np.full(base.count, 1e9), np.zeros(base.count)
    )
    flat = columns.reshape(-1, base.count)
    flat = flat[:, np.any(flat, axis=0)]
    flat = flat / np.linalg.norm(flat, axis=0)
    own = column.reshape(-1) - flat @ np.linalg.lstsq(flat, column.reshape(-1), rcond=1e-12)[0]
    law = free_law(view, calibrated.table, problem, 1.0, 0.0)
    return law.share, f"{law.location} {law.axis}", float(own @ own)


def test_a_law_without_a_name_explains_the_energy_of_a_law_it_does_not_contain():
    explained, place, energy = planted(40.0, 0.1)
    assert place == "strut z"
    # two bends at 0.5 and 1 rms draw a bend at 0.75 but for the corner between them
    assert 0.95 * energy < explained < energy


def test_a_law_without_a_name_explains_no_noise():
    explained, _, _ = planted(0.0, 1.0)
    assert explained == 0.0


@pytest.mark.parametrize(("left_out", "verdict"), [((), "explained"), (("damping_nonlinearity",), "unexplained")])
def test_a_neighbour_of_the_real_cause_is_found_out(left_out, verdict):
    # friction draws a damper that saturates so well that a tenth of its residual remains
    def law(x: float, v: float) -> float:
        return 190.0 * math.tanh(v / 0.15)

    known = set(library()) - set(left_out)
    answer = diagnose(quarter_car(), quarter_car_run(43, law=law), [quarter_car_run(44, law=law)], causes=known)
    assert answer.verdict == verdict, answer.sentence
    if left_out:
        assert [c.id for c in answer.causes] == ["coulomb_friction"]
        assert answer.causes[0].confidence < 0.5
        assert "a force of another form at strut z" in answer.sentence
    else:
        assert answer.causes[0].id == "damping_nonlinearity"
        assert answer.causes[0].confidence > 0.9
