# Copyright 2026 ride_estimation contributors
"""Which run to drive next where a rival of the named cause is alive."""

from __future__ import annotations

import json

import numpy as np
import pytest
from diagnosis_runs import GRAVITY, hiding_law, quarter_car, quarter_car_run
from scipy.stats import norm

from ride_estimation.diagnosis.answer.next_run import candidate_runs, decision_probability
from ride_estimation.diagnosis.answer.result import DECIDES, CandidateRun, NextRun
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant

PLANNED = Settings(plan_next=True)


def test_a_small_law_of_a_damper_leaves_friction_alive_and_names_the_run_that_decides():
    """On one road a degressive damper and friction look alike; on one twice as rough they do not."""
    run = quarter_car_run(11, 30.0, law=hiding_law("relief_valve", 0.08), noise=0.02)
    answer = diagnose(quarter_car(0.02), run, settings=PLANNED)
    assert answer.next_run is not None
    assert {answer.next_run.first, answer.next_run.second} == {"damping nonlinearity at strut z", "coulomb friction at strut z"}
    assert answer.next_run.tried[0].words == "this run once more"
    assert answer.next_run.best.worse > DECIDES
    assert answer.next_run.best.words in answer.next_run.sentence
    document = json.loads(json.dumps(answer.to_mapping()))["next_run"]
    assert 0.05 <= document["odds"] <= 1.0
    assert document["run"] == answer.next_run.best.words
    assert all(0.0 <= c["first"] <= 1.0 and 0.0 <= c["second"] <= 1.0 for c in document["tried"])


def test_a_clear_law_needs_no_further_run():
    answer = diagnose(quarter_car(), quarter_car_run(11, law=hiding_law("relief_valve", 0.3)), settings=PLANNED)
    assert [c.id for c in answer.causes] == ["damping_nonlinearity"]
    assert answer.next_run is None
    assert answer.to_mapping()["next_run"] is None


def test_runs_that_separate_nothing_are_not_recommended():
    tried = tuple(CandidateRun(words, 0.99, second) for words, second in (("once more", 0.9), ("rougher", 0.4), ("bumps", 0.6)))
    found = NextRun("backlash", "bump stop", 0.3, tried, "a slow force-deflection line")
    assert found.best.words == "bumps", "the worse of both cases counts, this run once more does not"
    assert "No simulated run" in found.sentence
    assert "slow force-deflection line" in found.sentence


def test_a_run_decides_where_a_diagnosis_of_it_would_rule_the_false_one_out():
    """Closed form: a gap of its own scatter times the quantile of the certainty is ruled out half of the time."""
    certain = norm.ppf(DECIDES)
    gap = 2.0 * certain**2  # noise alone scatters it by sqrt(2 gap)
    assert gap / np.sqrt(2.0 * gap) == pytest.approx(certain)
    assert decision_probability(gap, 0.0) == pytest.approx(0.5)
    assert decision_probability(4.0 * gap, 0.0) == pytest.approx(norm.cdf(certain))
    assert decision_probability(gap, 1e4) < 0.5, "a law of another form scatters it too"
    assert decision_probability(-gap, 0.0) < 1.0 - DECIDES


def test_candidate_runs_move_the_base_as_they_say():
    car, run = quarter_car(), quarter_car_run(3, 20.0)
    plant = build_plant(car, {"body": 3, "base": 3}, 0.5, 0.7)
    data = measurement(plant, run)
    runs = dict(candidate_runs(plant, data))
    column = next(i for i, s in enumerate(plant.inputs) if s.component == 2)
    own = data.inputs[:, column] - data.inputs[:, column].mean()
    for m in runs.values():
        assert m.inputs[:, column].mean() == pytest.approx(GRAVITY, abs=0.1)
        assert np.all(np.isfinite(m.inputs))
        assert len(m.inputs) == len(m.outputs) == len(m.valid) <= len(own)
    moved = {words: m.inputs[:, column] - data.inputs[:, column].mean() for words, m in runs.items()}
    rougher = next(v for words, v in moved.items() if "rougher" in words)
    assert rougher == pytest.approx(2.0 * own)
    faster = next(v for words, v in moved.items() if "1.4 times the speed" in words)
    assert faster[:100] == pytest.approx(1.96 * np.interp(1.4 * np.arange(100), np.arange(len(own)), own))
    bumps = next(v for words, v in moved.items() if "bumps" in words)
    # a cosine bump of 40 mm: its acceleration, twice integrated over its length, comes to rest at zero
    first = bumps[: round(1.5 / 4.0 * 100.0) + 1]
    rate = np.cumsum(first) / 100.0
    assert np.cumsum(rate)[: len(first)].max() / 100.0 == pytest.approx(0.04, rel=0.2)
    assert abs(rate[-1]) < 0.1 * np.abs(rate).max()
