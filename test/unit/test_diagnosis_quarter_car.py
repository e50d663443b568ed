# Copyright 2026 ride_estimation contributors
"""The whole chain on a quarter car integrated by the test, with laws of forms the library does not use."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_runs import quarter_car, quarter_car_run

from ride_estimation.diagnosis.diagnose import diagnose

LAWS = {
    "stiffness_nonlinearity": lambda x, v: 15e3 * (0.006 * np.sinh(x / 0.006) - x),
    "coulomb_friction": lambda x, v: 60.0 * np.tanh(v / 0.002),
    "damping_nonlinearity": lambda x, v: 1500.0 * (0.05 * np.tanh(v / 0.05) - v),
    "bump_stop": lambda x, v: 2e5 * (max(x - 0.012, 0.0) - max(-x - 0.012, 0.0)),
}


def test_a_clean_run_has_no_discrepancy():
    answer = diagnose(quarter_car(), quarter_car_run(11))
    assert answer.verdict == "no_discrepancy"
    assert answer.causes == ()
    by_name = {p.name: p.value for p in answer.parameters}
    # truth 44 kN/m; 40 s at 0.5 % noise
    assert by_name["strut.z.stiffness"] == pytest.approx(44e3, rel=0.01)


@pytest.mark.parametrize("cause", LAWS)
def test_a_planted_law_is_named_and_pays_on_the_other_run(cause):
    answer = diagnose(quarter_car(), quarter_car_run(11, law=LAWS[cause]), [quarter_car_run(12, law=LAWS[cause])])
    assert answer.verdict == "explained"
    assert [(c.id, c.location, c.axis) for c in answer.causes] == [(cause, "strut", "z")]
    assert answer.gain is not None
    judged = answer.gain.validation[0]
    # at least two thirds of the error is gone on a road that neither fitted nor selected
    assert judged.extended < judged.baseline / 3.0
    assert judged.ci95[0] > 0.0
    document = answer.to_mapping()
    assert document["causes"][0]["would_refute"]
    assert 0.0 < document["causes"][0]["confidence"] <= 0.99


def test_the_friction_level_is_reported_in_newton():
    answer = diagnose(quarter_car(), quarter_car_run(11, law=LAWS["coulomb_friction"]))
    level = next(p for p in answer.causes[0].parameters if p.name == "friction level")
    assert level.unit == "N"
    assert level.value == pytest.approx(60.0, rel=0.03)
