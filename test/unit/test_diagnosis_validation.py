# Copyright 2026 ride_estimation contributors
"""Validation runs weigh causes that the fitted run alone cannot tell apart."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from diagnosis_runs import hiding_law, quarter_car, quarter_car_run
from scipy.stats import norm

from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.hypothesis import FORM
from ride_estimation.diagnosis.selection import Candidate, Elsewhere
from ride_estimation.diagnosis.settings import Settings
from ride_estimation.diagnosis.verdict import reversal_odds

NOISE = 0.02


def driven(form, size, seed, **options):
    return quarter_car_run(seed, 30.0, law=hiding_law(form, size), noise=NOISE, **options)


def answers(form, size, seed):
    """Return the diagnosis of a run alone and with a second run of the same vehicle on another road."""
    car = quarter_car()
    car = dataclasses.replace(car, sensors={k: dataclasses.replace(s, noise_std=NOISE) for k, s in car.sensors.items()})
    run, settings = driven(form, size, seed), Settings(stability=False)
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
