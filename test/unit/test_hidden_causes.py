# Copyright 2026 ride_estimation contributors
"""Every cause of the library hidden in a cab with six degrees of freedom and base accelerometers, and required by name.

Named alone, at its place and axis, with what it explains on a road that took no part; and not so where the library lacks it.
"""

from __future__ import annotations

import functools
import math

import pytest
from worlds.adapters import believed_vehicle, uniform_run
from worlds.hidden_cab import HIDDEN, SEED, Hidden, cab_on_roads, driven, effect_of

from ride_estimation.diagnosis.answer.result import EXPLAINED, Diagnosis
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Vehicle

#: what leaves nothing in the band: the calibrated model holds the soft mount, and an offset moves mean readings alone
NOT_IN_BAND = ("one_soft_mount", "sensor_bias")
ANGLES = {"roll": "x", "pitch": "y", "yaw": "z"}
#: cheap
FAST = ("coulomb_friction",)


def slow_but(*fast: str) -> list[object]:
    """Return the cases, those whose cause is not among some marked as slow."""
    return [pytest.param(c, id=c.label, marks=[] if c.cause in fast else pytest.mark.slow) for c in HIDDEN]


@functools.cache
def case(hidden: Hidden | None) -> tuple[Vehicle, UniformRun, UniformRun]:
    """Return the file, the fitted and the other run."""
    fit, other, belief = driven(hidden)
    return believed_vehicle(fit, belief, SEED, cab_on_roads()[0]), uniform_run(fit, "fitted"), uniform_run(other, "other road")


def diagnosed(hidden: Hidden | None, without: str = "") -> Diagnosis:
    """Return the diagnosis of a case; where a cause is taken out of the library, of one round: no set of others is the one."""
    vehicle, fitted, other = case(hidden)
    settings = Settings(maximum_causes=1) if without else Settings()
    return diagnose(vehicle, fitted, [other], settings, causes=set(library()) - {without})


def require(answer: Diagnosis, hidden: Hidden) -> None:
    """Fail unless the hidden cause and nothing else is named, where it is, and explains what the model missed."""
    planted = effect_of(hidden)
    assert answer.verdict == EXPLAINED, answer.sentence
    assert [(c.id, c.location) for c in answer.causes] == [(planted.cause, planted.location)], answer.sentence
    axis = answer.causes[0].axis
    assert ANGLES.get(axis, axis) == planted.axis or not planted.axis
    assert answer.causes[0].confidence > 0.5
    assert answer.gain is not None
    judged = answer.gain.validation[0]
    assert judged.run == "other road"
    missed, left = (math.sqrt(max(e**2 - judged.noise_floor**2, 0.0)) for e in (judged.baseline, judged.extended))
    if hidden.cause in NOT_IN_BAND:
        assert judged.extended < 1.02 * judged.baseline
    else:
        assert 0.02 < missed < judged.baseline < 0.05, "the level of the effect"
        assert left < 0.5 * missed, answer.sentence
        assert judged.ci95[0] > 0.0


def test_every_cause_of_the_library_is_hidden():
    assert {c.cause for c in HIDDEN} == set(library())


@pytest.mark.slow
def test_the_healthy_cab_has_no_discrepancy():
    answer = diagnosed(None)
    assert (answer.verdict, answer.causes) == ("no_discrepancy", ())


@pytest.mark.parametrize("hidden", slow_but(*FAST))
def test_a_hidden_cause_is_named_at_its_place_and_pays_on_the_other_road(hidden):
    require(diagnosed(hidden), hidden)


@pytest.mark.parametrize("hidden", slow_but())
def test_a_library_without_the_cause_does_not_meet_the_requirement(hidden):
    with pytest.raises(AssertionError):
        require(diagnosed(hidden, without=hidden.cause), hidden)
