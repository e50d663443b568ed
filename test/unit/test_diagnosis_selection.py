# Copyright 2026 ride_estimation contributors
"""Selection of causes: laws stronger than the spring they sit on, two causes at once, groups of mounts, odds of a reversal."""

from __future__ import annotations

import dataclasses
import itertools
import types

import numpy as np
import pytest
from diagnosis_runs import DAMPING, GRAVITY, MASS, STIFFNESS, hiding_law, quarter_car, quarter_car_run
from scipy.special import ndtr

from ride_estimation.diagnosis.answer.verdict import reversal_odds
from ride_estimation.diagnosis.common.effect import Effect, Shape, Where
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.hypotheses.hypothesis import Hypothesis
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.search.candidates import identity, shortlist
from ride_estimation.diagnosis.search.fits import Fits
from ride_estimation.diagnosis.search.fitting import with_effects
from ride_estimation.diagnosis.search.refinement import Refinement
from ride_estimation.diagnosis.search.screening import Score
from ride_estimation.diagnosis.search.selection import Candidate, Selector, required_evidence
from ride_estimation.diagnosis.search.shape_search import searched_shape
from ride_estimation.signals.recording import UniformRun

STEP = 1.0 / 1600.0  # of the integration in diagnosis_runs


def relaxing(stiffnesses: tuple[float, ...], corners_hz: tuple[float, ...]):
    """Return a law of Maxwell cells, each integrated exactly over a step of constant rate."""
    force = np.zeros(len(stiffnesses))
    tau = 1.0 / (2.0 * np.pi * np.array(corners_hz))
    decay = np.exp(-STEP / tau)

    def law(x: float, v: float) -> float:
        force[:] = decay * force + np.array(stiffnesses) * tau * (1.0 - decay) * v
        return float(force.sum())

    return law


def test_a_law_that_carries_more_than_the_spring_is_found():
    # three cells of one and a half times the static stiffness between them, where the library has two at a fixed ratio
    law = [relaxing((22e3, 22e3, 22e3), (1.0, 3.0, 9.0)) for _ in range(2)]
    answer = diagnose(quarter_car(), quarter_car_run(31, law=law[0]), [quarter_car_run(32, law=law[1])])
    assert [c.id for c in answer.causes] == ["viscoelasticity"]
    assert answer.gain is not None
    judged = answer.gain.validation[0]
    assert judged.extended < judged.baseline / 3.0
    share = answer.causes[0].parameters[0]
    # 66 kN/m over 44 kN/m; slow cells pass for stiffness and fast ones for damping, so that only a part is certain
    assert 0.75 < share.value < 2.25


def test_two_causes_are_named_together():
    counter, friction = itertools.count(), hiding_law("jenkins_chain", 0.6)

    def law(x: float, v: float) -> float:
        return friction(x, v) - 40.0 * np.sin(2.0 * np.pi * 11.3 * STEP * next(counter))

    answer = diagnose(quarter_car(), quarter_car_run(33, law=law))
    assert answer.verdict == "explained"
    assert {c.id for c in answer.causes} == {"coulomb_friction", "harmonic_disturbance"}


def sprung_run(seed: int, sprung: float, frequency_hz: float, ratio: float) -> UniformRun:
    """Return a run whose body carries part of its mass on a spring: periodic base, closed form per frequency."""
    rng = np.random.default_rng(seed)
    rate, count = 100.0, 4000
    w = 2.0 * np.pi * np.fft.rfftfreq(count, 1.0 / rate)
    f = w / (2.0 * np.pi)
    base = np.where((f > 0.5) & (f < 20.0), 1.0 / np.maximum(f, 0.5) ** 1.5, 0.0) * np.exp(2j * np.pi * rng.random(len(f)))
    base *= 0.006 / np.std(np.fft.irfft(base, count))
    spring = sprung * ((2.0 * np.pi * frequency_hz) ** 2 + 2j * ratio * 2.0 * np.pi * frequency_hz * w)
    carried = sprung * spring / (spring - sprung * w**2)
    modulus = STIFFNESS + 1j * w * DAMPING
    body = modulus * base / (modulus - w**2 * (MASS - sprung + carried))
    data = {}
    for name, motion in (("body", body), ("base", base)):
        clean = np.zeros((count, 3))
        clean[:, 2] = np.fft.irfft(-(w**2) * motion, count) + GRAVITY
        data[name] = clean + 0.005 * rng.standard_normal(clean.shape)
    return UniformRun(f"sprung_{seed}", rate, 0, data, {name: np.ones(count, dtype=bool) for name in data})


def test_a_sprung_part_of_the_mass_is_found_with_its_share():
    vehicle = quarter_car()
    answer = diagnose(vehicle, sprung_run(34, 60.0, 4.0, 0.2), [sprung_run(35, 60.0, 4.0, 0.2)])
    assert [c.id for c in answer.causes] == ["missing_degree_of_freedom"]
    # accelerations tell masses up to one factor: the share of the rigid rest is what is found, 60 of 340 kg
    sprung, rigid = sorted(b.mass.value for b in answer.extended.bodies.values())
    assert sprung / rigid == pytest.approx(60.0 / 340.0, rel=0.03)
    frequency = next(p for p in answer.causes[0].parameters if p.name == "natural frequency")
    assert frequency.value == pytest.approx(4.0, rel=0.01)
    assert answer.gain is not None
    # noise is one part in a hundred: the extended model is at the floor on the other road
    assert answer.gain.validation[0].extended < 1.2 * answer.gain.validation[0].noise_floor


def test_what_the_linear_response_holds_of_a_law_is_missing_in_its_effect_and_nothing_else():
    rng = np.random.default_rng(5)
    x, v = rng.normal(size=(2, 500, 1))
    view = types.SimpleNamespace(deflection=x, deflection_rate=v)
    state = ModelState(np.array([100.0]), np.array([10.0]))
    signal = 250.0 * x[:, 0] - 30.0 * v[:, 0] + np.tanh(x[:, 0])
    after = with_effects(view, state, [Effect(Where.PORT, 0, signal), Effect(Where.OUTPUT, 0, np.ones(500))])
    stiffness, damping = after.linear
    assert stiffness[0] > 300.0
    assert damping[0] == pytest.approx(1.0)  # a response with negative damping would grow: a tenth is kept
    held = after.held
    np.testing.assert_allclose(after.effects[0].signal + held[0, 0] * x[:, 0] + held[1, 0] * v[:, 0], signal, atol=1e-9)
    np.testing.assert_array_equal(after.effects[1].signal, np.ones(500))


def score(cause: str, location: str, ports: tuple[int, ...], gain: float) -> Score:
    h = Hypothesis(cause, location, "z", lambda view, shape: [], ports=ports)
    return Score(h, {}, np.zeros(1), gain, gain)


@pytest.mark.parametrize(("group", "kept"), [(104.0, False), (130.0, True)])
def test_a_group_of_mounts_competes_only_where_it_brings_more_than_its_best_mount(group, kept):
    single = score("stiffness_nonlinearity", "front_left", (0,), 100.0)
    everything = score("stiffness_nonlinearity", "all", (0, 1, 2, 3), group)
    short = shortlist([everything, single], 6)
    assert (everything in short) is kept
    assert single in short


def test_several_hypotheses_about_one_sensor_leave_room_for_another_sensor():
    near = [score("sensor_gain", "cab_left", (), 100.0 - i) for i in range(4)]
    other, third = score("sensor_gain", "cab_right", (), 60.0), score("sensor_gain", "cab_rear", (), 50.0)
    assert shortlist([*near, other, third], 6) == [*near[:2], other]


def test_what_readings_themselves_show_is_fitted_whatever_its_score():
    seen = score("sensor_clipping", "chassis_front_left", (), -1.0)
    seen = dataclasses.replace(seen, hypothesis=dataclasses.replace(seen.hypothesis, seen_in_readings=True))
    others = [score(f"cause_{i}", "front_left", (), 100.0 - i) for i in range(6)]
    assert shortlist([*others, seen], 6) == [seen, *others[:5]]
    assert shortlist([], 6) == []


def test_the_form_of_a_law_limits_how_sure_a_lead_is():
    def candidate(level: float, misfit: float) -> Candidate:
        return Candidate(types.SimpleNamespace(block_misfit=np.full(16, misfit)), level)

    blocks = np.arange(16)
    leader, other = candidate(0.0, 1.0), candidate(-20.0, 3.5)
    # equal blocks: no sampling scatter; half a per cent of an effect of 4000 nat is 20 nat, one standard deviation
    below = float(ndtr(-1.0))
    assert reversal_odds(leader, other, 1.0, blocks, 4000.0) == pytest.approx(below / (1.0 - below), rel=1e-9)
    assert reversal_odds(leader, other, 1.0, blocks, 0.0) == 0.0
    assert reversal_odds(leader, Candidate(other.fit, -20.0), 1.0, blocks, 400.0) < 1e-12


def test_a_scan_finds_a_peak_too_narrow_for_steps():
    """As the instant of a sudden load: a broad hill at 3, a peak at 5 a twentieth wide, and steps that stop on the hill."""

    def drop(trial):
        return 10.0 * np.exp(-((trial["at"] - 3.0) ** 2)) + 40.0 * np.exp(-((20.0 * (trial["at"] - 5.0)) ** 2))

    found = {}
    for scan in (0.0, 2.5):
        bounds = (Shape("at", 5.0, 0.0, 10.0, 0.4, scan),)
        hypothesis = Hypothesis("mass_change", "cab", "", lambda view, shape: [], ({"at": 3.0},), bounds)
        found[scan] = searched_shape(hypothesis, {"at": 3.0}, lambda trials: [drop(trial) for trial in trials])["at"]
    assert abs(found[0.0] - 3.0) < 0.2
    assert abs(found[2.5] - 5.0) < 0.05
    assert min(bounds[0].scanned(9.0)) == 6.5
    assert max(bounds[0].scanned(9.0)) == 10.0


@pytest.mark.parametrize(("gained", "taken"), [(100.0, True), (5.0, False)])
def test_a_law_of_its_own_takes_the_place_of_a_group_law_at_its_mount(gained: float, taken: bool):
    def sited(cause: str, location: str, *ports: int) -> Hypothesis:
        return Hypothesis(cause, location, "z", lambda view, shape: [], ports=ports)

    def fit_of(log_likelihood: float, held_out: float, *hypotheses: Hypothesis) -> types.SimpleNamespace:
        fitted = tuple(types.SimpleNamespace(hypothesis=h, shape={}) for h in hypotheses)
        return types.SimpleNamespace(fitted=fitted, log_likelihood=lambda temper: log_likelihood, held_out=held_out, view=None)

    front, left, right = (sited("coulomb_friction", n, *p) for n, p in (("front", (2, 5)), ("fl", (2,)), ("fr", (5,))))
    valve = sited("damping_nonlinearity", "fr", 5)
    selector = object.__new__(Selector)
    selector._build, selector._settings = lambda view: [front, left, right], Settings()
    selector._fits = types.SimpleNamespace(
        temper=lambda fits: 1.0, one=lambda start, passes, after: fit_of(gained, 1.0, *(s.hypothesis for s in start))
    )
    found = selector._split(fit_of(50.0, 1.5, front, valve), fit_of(0.0, 2.0, front))
    assert (found is not None) is taken
    if found is not None:
        assert [(f.hypothesis.cause, f.hypothesis.location) for f in found.fitted] == [
            ("coulomb_friction", "fl"), ("damping_nonlinearity", "fr"),
        ]  # fmt: skip
    other = sited("damping_nonlinearity", "rear", 8, 11)
    assert selector._split(fit_of(50.0, 1.5, front, other), fit_of(0.0, 2.0, front)) is None


@pytest.mark.parametrize(("moves", "place", "needed"), [(True, 1, 15.0), (False, 1, 7.0), (False, 0, 15.0)])
def test_a_fault_that_shows_in_mean_readings_alone_needs_less_evidence(moves: bool, place: int, needed: float):
    law = Hypothesis("backlash", "s", "z", lambda view, shape: [])
    bias = Hypothesis("sensor_bias", "s", "z", lambda view, shape: [], shows_in_means=True)
    rows = np.zeros((2, 3, 2))
    rows[..., 0] = 1.0
    rows[..., 1] = float(moves)
    fitted = tuple(types.SimpleNamespace(hypothesis=h, coefficients=np.ones(1)) for h in (law, bias))
    fit = types.SimpleNamespace(rows=rows, fitted=fitted, part=lambda n: slice(n, n + 1))
    assert required_evidence(fit, place, Settings()) == needed
    assert required_evidence(fit, place - 2, Settings()) == needed


@pytest.mark.parametrize(
    ("misfits", "rounds", "kept"),
    [([1.4, 0.9], 0, 0), ([5.0, 4.4, 4.39, 1.0], 2, 1), ([5.0, 4.0, 3.0, 2.5, 1.0], 3, 3), ([5.0, 6.0], 1, 0)],
)
def test_accepted_causes_are_fitted_until_a_round_removes_little(misfits: list[float], rounds: int, kept: int):
    fits = [types.SimpleNamespace(misfit=m, fitted=(), number=i) for i, m in enumerate(misfits)]
    asked = iter(fits[1:])
    work = object.__new__(Fits)
    work.dof, work.count, work.settings = 1.0, 0, Settings()
    work.fitter = types.SimpleNamespace(fit=lambda fitted, passes, after, settle: next(asked))
    assert Refinement(work, lambda view: []).converged(fits[0]) is fits[kept]
    assert work.count == rounds


@pytest.mark.parametrize(("lost", "kept"), [(10.0, 2), (5.0, 1)])
def test_a_fault_in_mean_readings_is_kept_beside_another_cause_on_the_evidence_it_needs(lost: float, kept: int):
    """Both are lost by the fit without the fault, of which 7 nat are asked; the law is necessary beyond doubt."""
    law = Hypothesis("backlash", "s", "z", lambda view, shape: [])
    bias = Hypothesis("sensor_bias", "s", "z", lambda view, shape: [], shows_in_means=True)
    fitted = tuple(types.SimpleNamespace(hypothesis=h) for h in (law, bias))
    rows = np.zeros((2, 3, 2))
    rows[..., 0] = 1.0
    both, alone = (
        types.SimpleNamespace(
            fitted=causes, misfit=1.0, inefficiency=1.0, rows=rows, part=lambda n: slice(n, n + 1),
            misfit_without=lambda place, blocks: 1.0 if place else 1e6, log_likelihood=lambda temper, level=level: level,
        )
        for causes, level in ((fitted, 0.0), (fitted[:1], -lost))
    )  # fmt: skip
    selector = object.__new__(Selector)
    selector._settings = Settings()
    selector._fits = types.SimpleNamespace(
        dof=1.0, blocks=np.arange(2), all=lambda rests, passes, after: [alone for _ in rests]
    )
    assert len(selector._without_idle(both).fitted) == kept


@pytest.mark.parametrize(
    ("start", "gained", "misfit", "held_out", "energy", "found"),
    [
        ((("left", 0, 1),), 100.0, 1.0, 0.9, 1.0, ["all"]),
        ((("left", 0, 1),), 10.0, 1.0, 0.9, 1.0, ["left"]),  # too little evidence
        ((("left", 0, 1),), 100.0, 1.0, 1.1, 1.0, ["left"]),  # predicts no better
        ((("left", 0, 1),), 100.0, 2.0, 0.9, 1.0, ["left"]),  # half remains: a law that is described badly
        ((("left", 0, 1),), 100.0, 1.5, 0.9, 1.0, ["all"]),
        ((("left", 0, 1),), 100.0, 1.0, 0.9, 0.01, ["left"]),  # hardly any force at one of the further mounts
        # one law in place of two at the mounts that it covers
        ((("left", 0, 1), ("right", 2, 3)), -10.0, 1.0, 1.1, 1.0, ["all"]),
        ((("left", 0, 1), ("right", 2, 3)), -20.0, 1.0, 0.9, 1.0, ["left", "right"]),
    ],
)
def test_a_law_is_named_at_more_mounts_where_they_show_it_too_and_nothing_else_is_left(
    start, gained, misfit, held_out, energy, found
):
    def sited(location: str, *ports: int) -> Hypothesis:
        return Hypothesis("viscoelasticity", location, "y", lambda view, shape: [], ports=ports)

    def fit_of(level: float, misfit: float, held_out: float, *hypotheses: Hypothesis) -> types.SimpleNamespace:
        fitted = tuple(types.SimpleNamespace(hypothesis=h, shape={}) for h in hypotheses)
        return types.SimpleNamespace(
            fitted=fitted, misfit=misfit, log_likelihood=lambda temper: level, held_out=held_out, view=None,
            port_energies=lambda place: np.array([1.0, 1.0, 1.0, energy]),
        )  # fmt: skip

    everywhere = sited("all", 0, 1, 2, 3)
    work = types.SimpleNamespace(
        dof=1.0, spent=False, settings=Settings(), temper=lambda fits: 1.0, explained=lambda fit: fit.misfit < 1.2,
        one=lambda start, passes, after: fit_of(gained, misfit, held_out, *(s.hypothesis for s in start)),
    )  # fmt: skip
    own = [sited(*place) for place in start]
    refinement = Refinement(work, lambda view: [*own, everywhere])
    refinement._shown_at = lambda accepted, f, groups: everywhere
    contests = {identity(h): h.location for h in own}
    answer = refinement.widened(fit_of(0.0, 3.4, 1.0, *own), contests)
    assert [f.hypothesis.location for f in answer.fitted] == found
    assert all(identity(f.hypothesis) in contests for f in answer.fitted)
    # a cause without a contest of its own has none afterwards
    assert [f.hypothesis.location for f in refinement.widened(fit_of(0.0, 3.4, 1.0, *own), {}).fitted] == found
