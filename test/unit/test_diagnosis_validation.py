# Copyright 2026 ride_estimation contributors
"""Validation runs weigh causes that the fitted run alone cannot tell apart."""

from __future__ import annotations

import types

import numpy as np
import pytest
from diagnosis_runs import hiding_law, quarter_car, quarter_car_run
from scipy.stats import norm

from ride_estimation.diagnosis.answer import validation_evidence
from ride_estimation.diagnosis.answer.verdict import reversal_odds
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.splits import make_splits
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.hypotheses.hypothesis import FORM
from ride_estimation.diagnosis.search.selection import Candidate, Elsewhere, Round, Selection
from ride_estimation.diagnosis.search.work import Work

NOISE = 0.02


def driven(form, size, seed):
    return quarter_car_run(seed, 30.0, law=hiding_law(form, size), noise=NOISE)


def answers(form, size, seed):
    """Return the diagnosis of a run alone and with a second run of the same vehicle on another road."""
    car, run, settings = quarter_car(NOISE), driven(form, size, seed), Settings(stability=False)
    return diagnose(car, run, settings=settings), diagnose(car, run, [driven(form, size, seed + 100)], settings=settings)


def test_a_rival_that_predicts_the_validation_run_better_takes_the_place_of_the_cause():
    """Rubber that hardens has the force of no stop in the library, and on one road a stop fits it as well."""
    alone, both = answers("hollow_rubber", 0.1, 13)
    assert {alone.causes[0].id, alone.causes[0].rivals[0].id} == {"stiffness_nonlinearity", "bump_stop"}
    assert [c.id for c in both.causes] == ["stiffness_nonlinearity"]
    assert both.causes[0].rivals[0].id == "bump_stop"
    assert both.gain.validation[0].extended < both.gain.validation[0].baseline
    assert any(m.elements["z"].to_mapping()["kind"] != "kelvin_voigt" for m in both.extended.mounts.values())


def test_evidence_of_a_validation_run_adds_to_that_of_the_fitted_one():
    alone, both = answers("relief_valve", 0.08, 11)
    for answer in (alone, both):
        assert [c.id for c in answer.causes] == ["damping_nonlinearity"]
        assert answer.causes[0].rivals[0].id == "coulomb_friction"
    first, second = (a.causes[0] for a in (alone, both))
    assert second.rivals[0].log_likelihood_deficit > first.rivals[0].log_likelihood_deficit + 5.0
    assert second.confidence > first.confidence


def test_a_cause_that_one_run_proves_needs_no_other():
    alone, both = answers("jenkins_chain", 0.06, 12)
    assert [c.id for c in both.causes] == ["coulomb_friction"]
    assert both.causes[0].confidence == pytest.approx(alone.causes[0].confidence, rel=1e-9)


def test_odds_hold_the_scatter_of_both_runs_and_the_form_of_the_law():
    """Closed form: gap over the root of the squares of the scatter of both runs and of what the form of a law leaves open."""

    class Fit:
        def __init__(self, blocks):
            self.block_misfit = np.asarray(blocks, dtype=float)

    blocks = np.arange(4)
    leader = Candidate(Fit([0.0, 0.0, 0.0, 0.0]), 0.0)
    per_block = np.array([1.0, 3.0, 1.0, 3.0])
    other = Candidate(Fit(2.0 * per_block), -float(per_block.sum()), elsewhere=Elsewhere(5.0, 4.0, 300.0))
    assert other.behind(leader) == pytest.approx(13.0)
    spread = np.sqrt(4.0 * np.var(per_block, ddof=1) + 4.0**2 + (FORM * (100.0 + 300.0)) ** 2)
    below = norm.cdf(-13.0 / spread)
    assert reversal_odds(leader, other, 1.0, blocks, 100.0) == pytest.approx(below / (1.0 - below))


def test_every_cause_is_weighed_once_at_its_place_also_after_another_gave_way(monkeypatch):
    """A rival that takes over stands where the cause stood: contests and hypotheses of the model stay in one order."""

    def fitted(cause):
        return types.SimpleNamespace(hypothesis=types.SimpleNamespace(cause=cause, run_bound=False))

    def fit(*causes):
        return types.SimpleNamespace(fitted=tuple(causes), block_misfit=np.zeros(4))

    names = "bump_stop", "sensor_delay", "stiffness_nonlinearity", "sensor_gain"
    first, second, rival, other = map(fitted, names)
    accepted = fit(first, second)
    # the contest of the first cause was made before the second one was known
    contests = (
        Round((Candidate(fit(first), 100.0), Candidate(fit(rival), 98.0)), 0.0, 1.0),
        Round((Candidate(accepted, 100.0, 1), Candidate(fit(first, other), 97.0, 1)), 0.0, 1.0),
    )
    tried = []

    def compared(run, fits):
        tried.append([f.fitted for f in fits])
        return [Elsewhere(-5.0 if rival in f.fitted and first in fits[0].fitted else 5.0, 1.0, 10.0) for f in fits[1:]]

    monkeypatch.setattr(validation_evidence, "_compared", compared)
    selector = types.SimpleNamespace(fitter=types.SimpleNamespace(fit=lambda start, passes: fit(*start)))
    work = Work(None, None, make_splits(4), selector, Selection(accepted, (), contests), None)
    found = validation_evidence.weighed(work, ["run"]).selection
    assert tried == [[(first, second), (rival, second)], [(rival, second), (rival, other)]]
    assert found.accepted.fitted == (rival, second)
    assert [c.candidates[0].hypothesis.cause for c in found.contests] == ["stiffness_nonlinearity", "sensor_delay"]
    assert [c.candidates[1].behind(c.candidates[0]) for c in found.contests] == pytest.approx([3.0, 8.0])
