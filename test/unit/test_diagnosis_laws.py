# Copyright 2026 ride_estimation contributors
"""Law causes: how a stop hardens, how large a sprung mass may be, what a stated deviation holds; the budget; names of runs."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_runs import GRAVITY, MASS, SITE, quarter_car, quarter_car_run

from ride_estimation.diagnosis.answer.gain import in_range
from ride_estimation.diagnosis.answer.result import EXPLAINED, Gain, NamedCause, ValidationGain
from ride_estimation.diagnosis.answer.verdict import describe
from ride_estimation.diagnosis.causes.bump_stop import BumpStop, _hardening
from ride_estimation.diagnosis.causes.damping_nonlinearity import DampingNonlinearity
from ride_estimation.diagnosis.causes.stiffness_nonlinearity import StiffnessNonlinearity
from ride_estimation.diagnosis.common.extension import parts_of
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.spectra import edge_taper, make_grid
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.hypotheses.characteristic import CORNERS, Family, characteristic_forms, straight_beyond
from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted, Hypothesis
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.waveform import _solved
from ride_estimation.elements.curve import CurveDamper, CurveSpring


def test_a_stop_hardens_from_a_square_to_an_exponential_and_goes_on_straight_where_the_run_never_was():
    depth = np.linspace(0.0, 0.004, 2001)
    # a scale far above the depth leaves the square: the next terms of the series are depth / (3 scale) and its square / 12
    np.testing.assert_allclose(_hardening(depth, 1.0, 1.0), depth**2, rtol=0.004 / 3.0 + 0.004**2, atol=1e-15)
    steep = _hardening(depth, 0.0005, 0.002)
    u = depth / 0.0005
    known = depth <= 0.002
    np.testing.assert_allclose(steep[known], 2.0 * 0.0005**2 * (np.exp(u) - 1.0 - u)[known], rtol=1e-9, atol=1e-18)
    slope = np.diff(steep) / np.diff(depth)
    # convex up to what is known, then one slope: the last one
    assert np.all(np.diff(slope[: known.sum() - 1]) > 0.0)
    np.testing.assert_allclose(slope[known.sum() :], 2.0 * 0.0005 * np.expm1(4.0), rtol=1e-9)


def test_both_parts_of_a_growing_spring_make_one_that_stiffens_in_one_direction_only():
    """Closed form: s sinh(u / s) + s (cosh(u / s) - 1) = s (exp(u / s) - 1), which has unit slope at rest."""
    u, shape = np.linspace(-3.0, 3.0, 61), {"family": float(Family.GROWING), "scale": 1.3}
    both = sum(characteristic_forms(u, shape, over_rate=False))
    np.testing.assert_allclose(both, 1.3 * np.expm1(u / 1.3), atol=1e-12)


@pytest.mark.parametrize("over_rate", [False, True])
@pytest.mark.parametrize("further", [{}, {CORNERS: 1.0}])
@pytest.mark.parametrize("family", list(Family))
def test_a_characteristic_goes_on_straight_where_the_run_never_was(family, further, over_rate):
    u, shape, reach = np.linspace(-9.0, 9.0, 3601), {"family": float(family), "scale": 0.9, **further}, 3.0
    known = np.abs(u) <= reach
    for form, straight in zip(characteristic_forms(u, shape, over_rate), straight_beyond(u, reach, shape, over_rate)):
        np.testing.assert_array_equal(straight[known], form[known])
        for beyond, edge in ((u > reach, slice(-2, None)), (u < -reach, slice(0, 2))):
            slope, last = np.diff(straight[beyond]) / np.diff(u[beyond]), np.diff(form[known][edge]) / 0.005
            np.testing.assert_allclose(slope, slope[0], rtol=1e-6, atol=1e-9)
            np.testing.assert_allclose(slope[0], last[0], rtol=0.01, atol=1e-3)


def test_a_spring_that_softens_on_a_road_does_not_turn_its_force_round_on_a_rougher_one():
    vehicle, run = quarter_car(), quarter_car_run(seed=4)
    plant, state = build_plant(vehicle, {"body": 3, "base": 3}), ModelState(np.array([44e3]), np.array([2e3]))
    data = measurement(plant, run)
    view = RunView(RunData(plant, data, Settings()), state)
    spring = StiffnessNonlinearity().hypotheses(view)[0]
    for signals in (data.outputs, data.inputs):
        signals[:] = signals.mean(axis=0) + 3.0 * (signals - signals.mean(axis=0))
    rougher = RunView(RunData(plant, data, Settings()), state, scales=view.scales)
    forces = [
        spring.columns(at, {"family": float(Family.GROWING), "scale": 0.9})[0][0].signal[at.data.block_window(np.arange(4)) > 0.0]
        for at in (view, rougher)
    ]
    reach = float(np.max(np.abs(view.strokes[0][:, 0]))) / view.scales[0][0]
    # three times the stroke: at most the last slope on top, where the form itself would be thousands of times larger
    slope = float(np.cosh(reach / 0.9))
    assert np.max(np.abs(forces[1])) < np.max(np.abs(forces[0])) + 2.5 * slope * reach
    assert 0.9 * np.sinh(3.0 * reach / 0.9) > 20.0 * np.max(np.abs(forces[1]))


def test_a_characteristic_has_corners_only_where_the_run_went_beyond_them():
    plant = build_plant(quarter_car(), {"body": 3, "base": 3})
    data = RunData(plant, measurement(plant, quarter_car_run(seed=4)), Settings())
    view = RunView(data, ModelState(np.array([44e3]), np.array([2e3])))
    shape = {"family": float(Family.CUBIC), "scale": 1.0}
    for cause, strokes in ((StiffnessNonlinearity(), view.strokes[0]), (DampingNonlinearity(), view.strokes[1])):
        law = cause.hypotheses(view)[0]
        count, u = len(law.columns(view, shape)), strokes[:, 0] / np.std(strokes[:, 0])
        corners = [e[0].signal for e in law.columns(view, {**shape, CORNERS: 1.0})[count:]]
        beyond = [np.mean(sign * u > place) for sign in (1.0, -1.0) for place in (0.5, 1.0, 1.8, 2.6)]
        assert [bool(np.any(c)) for c in corners] == [share > 0.005 for share in beyond]
        assert 0.0 < min(beyond) < 0.005 < max(beyond)


def test_a_damper_of_no_family_is_found_as_a_curve_that_holds_on_another_road():
    """Degressive from a knee on in one direction, progressive in the other: no family has both."""

    def force(v: float) -> float:
        u = v / SITE.rate
        return 0.5 * SITE.damping * SITE.rate * (
            0.5 * max(u - 0.6, 0.0) ** 2 - 0.7 * max(-u - 0.3, 0.0) + 0.5 * max(-u - 1.5, 0.0)
        )

    run, other = (quarter_car_run(s, law=lambda x, v: force(v)) for s in (51, 52))
    answer = diagnose(quarter_car(), run, [other], Settings(stability=False))
    assert answer.verdict == EXPLAINED and [c.id for c in answer.causes] == ["damping_nonlinearity"]
    assert answer.causes[0].confidence > 0.95
    gain = answer.gain.validation[0]
    assert gain.baseline > 5.0 * gain.noise_floor and gain.extended < 1.2 * gain.noise_floor  # 5.7 -> 0.96 %, families 1.45 %
    curve = next(p for p in parts_of(answer.extended.mounts["strut"].elements["z"]) if isinstance(p, CurveDamper))
    rates = SITE.rate * np.array([-2.0, -1.5, -1.0, -0.5, 0.5, 1.0, 1.5, 2.0])
    true = [SITE.damping * v + force(v) for v in rates]
    np.testing.assert_allclose(np.interp(rates, curve.rates, curve.forces), true, rtol=0.03)


@pytest.mark.parametrize(("mass", "means"), [(150.0, True), (250.0, False)])
def test_a_coefficient_beyond_what_is_possible_means_nothing(mass, means):
    h = Hypothesis("missing_degree_of_freedom", "cab", "z", lambda view, shape: [], essential=(0,), largest=200.0)
    assert h.meaningful(np.array([mass, 3.0]), {}) is means


def test_overtones_that_a_law_makes_beyond_the_band_do_not_fold_into_it():
    """Fourier series of ``sign(sin)``: 4 / pi / n at the odd multiples of 7.3 Hz; 1, 3 and 5 lie below 40 Hz."""
    grid = make_grid(4000, 100.0, (0.4, 40.0))
    time = np.arange(4000) / 100.0

    def jump(frequency: float, times: int) -> tuple[np.ndarray, np.ndarray]:
        phase = 2.0 * np.pi * frequency * time
        wanted = sum(4.0 / np.pi / n * np.sin(n * phase) for n in (1, 3, 5))
        x = grid.refined(grid.spectrum(np.sin(phase) * edge_taper(4000, 100.0)))
        return wanted, grid.unrefined(np.sign(x)) if times > 1 else grid.signal(grid.spectrum(np.sign(np.sin(phase))))

    inner = slice(300, -300)
    wanted, got = jump(7.3, grid.refinement)
    _, coarse = jump(7.3, 1)
    size = np.std(wanted[inner])
    folded, plain = (np.std((found - wanted)[inner]) / size for found in (got, coarse))
    # what folds at a rate r lies within 40 Hz of its multiples: the overtones 9 to 19 (60 to 140 Hz) no longer do at 2 r,
    # those of 160 to 240 Hz (23 to 31) and 360 to 440 Hz (51 to 59) still do, and beyond them a tenth more
    stays = np.sqrt(sum(n**-2.0 for n in (*range(23, 33, 2), *range(51, 61, 2))) / sum(n**-2.0 for n in (1, 3, 5)))
    assert grid.refinement == 2
    assert folded < 1.25 * stays
    assert plain > 2.0 * folded


def test_what_a_law_holds_below_the_band_stays_in_its_force():
    """Closed form: the cube of a slow lean m and a motion a sin(w t) holds m^3 + 3 m a^2 / 2 below the band."""
    lean, size, time = -1.5, 0.8, np.arange(8000) / 200.0
    for rate, step in ((200.0, 1), (100.0, 2)):
        grid = make_grid(len(time[::step]), rate, (0.4, 40.0))
        fine = np.arange(grid.refinement * grid.samples) / (grid.refinement * rate)
        slow = lean * np.sin(2.0 * np.pi * 0.05 * fine)
        force = (slow + size * np.sin(2.0 * np.pi * 5.0 * fine)) ** 3 * edge_taper(len(fine), grid.refinement * rate)
        got = grid.unrefined(force) if grid.refinement > 1 else force
        wanted = (slow**3 + 1.5 * slow * size**2)[:: grid.refinement]
        below = grid.below(got[:, None], flank=True)[:, 0]
        inner = slice(round(4.0 * rate), -round(4.0 * rate))
        assert np.std((below - wanted)[inner]) < 0.02 * np.std(wanted[inner])


def test_of_no_blocks_none_lies_within_the_range_of_a_law():
    """The laws of two rivals leave no block of a rougher run that both were fitted on."""
    none = np.zeros(0, dtype=np.int64)
    stop = Hypothesis("bump_stop", "strut", "z", lambda view, shape: [], ports=(0,))
    data = SimpleNamespace(block_window=lambda blocks: np.ones(10))
    view = SimpleNamespace(deflection=np.ones((10, 1)), blocks=SimpleNamespace(count=1), data=data)
    accepted = SimpleNamespace(fitted=(SimpleNamespace(hypothesis=stop),), view=view)
    assert in_range(accepted, view, np.arange(1)).tolist() == [0]
    assert not len(in_range(accepted, view, none))


def test_the_range_of_a_law_is_that_of_the_analysed_stretch():
    """Faded ends move a mount several times as far as it ever goes: a stop that hardened up to there would weigh as a planet."""
    plant = build_plant(quarter_car(), {"body": 3, "base": 3})
    data = RunData(plant, measurement(plant, quarter_car_run(11, 24.0)), Settings())
    view = RunView(data, ModelState(np.array([44e3]), np.array([2e3])))
    most = np.max(np.abs(view.strokes[0]))
    view.deflection[:5] = 10.0 * most
    stop = next(h for h in BumpStop().hypotheses(view) if h.variant == "compression")
    shape = {"gap": 1.8, "hardening": 0.5}
    fitted = Fitted(stop, np.array([1e4, 1e5, 0.0]), np.zeros((3, 3)), shape)
    assert np.max(np.abs(view.strokes[0])) == most
    extended, _ = BumpStop().extend(quarter_car(), view, fitted)
    curve = next(p for p in parts_of(extended.mounts["strut"].elements["z"]) if isinstance(p, CurveSpring))
    assert np.max(np.abs(curve.deflections)) == pytest.approx(1.5 * most)
    deepest = {r.name: r.value for r in BumpStop().parameters(view, fitted)}["force at the deepest contact"]
    assert np.max(np.abs(curve.forces)) < 20.0 * deepest


def test_the_measured_loop_of_a_mount_is_its_real_force_whatever_the_model_misses():
    """A quarter car has one mount: its tension is minus mass times acceleration."""
    run = quarter_car_run(23, seconds=24.0, law=lambda x, v: 120.0 * np.tanh(v / 0.002))
    answer = diagnose(quarter_car(), run, causes=())
    _, linear, extended, measured = answer.evidence.loops["strut.z"]
    # the pictured seconds begin with the third; 1 to 15 Hz, where the base moves far above the noise of its sensor
    real = (-MASS * (run.data["body"][:, 2] - GRAVITY))[300:1300]
    spectra = np.fft.rfft(np.stack([real, linear, measured]) * np.hanning(1000))
    frequency = np.fft.rfftfreq(1000, 0.01)
    spectra = spectra[:, (frequency > 1.0) & (frequency < 15.0)]
    missed = [np.linalg.norm(force - spectra[0]) / np.linalg.norm(spectra[0]) for force in spectra[1:]]
    np.testing.assert_array_equal(linear, extended)  # no cause was allowed
    assert missed[0] > 0.1
    # noise of 0.005 m/s^2 of 0.6 m/s^2 in that band, and as much of the Wiener estimate
    assert missed[1] < 0.015


def test_a_run_sampled_densely_enough_is_not_refined():
    assert make_grid(4000, 200.0, (0.4, 40.0)).refinement == 1


def test_the_deviation_of_a_friction_level_holds_that_its_law_has_another_form():
    # a friction that falls from 80 N at rest to 50 N: the library has no such law
    run = quarter_car_run(17, seconds=24.0, law=lambda x, v: (50.0 + 30.0 * np.exp(-abs(v) / 0.02)) * np.tanh(v / 0.002))
    answer = diagnose(quarter_car(), run)
    assert [c.id for c in answer.causes] == ["coulomb_friction"]
    level = next(p for p in answer.causes[0].parameters if p.name == "friction level")
    assert 0.07 * level.value < level.std < 0.15 * level.value
    assert 50.0 - 2.0 * level.std < level.value < 80.0 + 2.0 * level.std


def test_a_search_that_ends_at_its_budget_says_so():
    run = quarter_car_run(18, seconds=24.0, law=lambda x, v: 60.0 * np.tanh(v / 0.002))
    answer = diagnose(quarter_car(), run, settings=Settings(most_fits=1))
    assert any("budget of 1 full fits" in w for w in answer.warnings)


def test_the_sentence_names_a_run_and_not_its_path():
    cause = NamedCause("bump_stop", "strut", "z", (), 0.9, (), "", "", "")
    judged = ValidationGain("/some/where/second_drive/bag", 0.1, 0.02, (0.07, 0.09), 0.01)
    gain = Gain("", 0.1, 0.02, 0.01, (judged,))
    sentence = describe(EXPLAINED, (cause,), gain, 0.0)
    assert "the error on second_drive/bag from 10.0 %" in sentence
    assert "/some" not in sentence


def test_forces_of_a_stop_that_no_plain_iteration_reaches_are_the_closed_form():
    rng = np.random.default_rng(6)
    free = rng.standard_normal((400, 2))
    stiffness, compliance, gap = np.array([50.0, 400.0]), 1.0, 0.5

    def along(force: np.ndarray) -> np.ndarray:
        # tension of a stop at a deflection that the tension shortens: plain iteration grows by 50 and 400 a step
        return stiffness * np.maximum(free - compliance * force - gap, 0.0)

    expected = stiffness * np.maximum(free - gap, 0.0) / (1.0 + stiffness * compliance)
    got = _solved(along, np.zeros_like(free))
    # the forces may miss their laws by a hundredth, so they miss the forces of equilibrium by less
    assert np.linalg.norm(got - expected) < 0.01 * np.linalg.norm(expected)


def test_a_steep_stop_is_written_with_what_the_run_showed_on_its_side():
    """The other side moves five times as far: there the exponential would be 1e16 N, which no element may have."""
    run = quarter_car_run(11)
    plant = build_plant(quarter_car(), {"body": 3, "base": 3}, 0.5, 0.7)
    view = RunView(RunData(plant, measurement(plant, run), Settings()), ModelState(np.array([44e3]), np.array([2e3])))
    x = view.deflection[:, 0]
    view.deflection = np.where(x > 0.0, 5.0 * x, x)[:, None]
    stop = next(h for h in BumpStop().hypotheses(view) if h.variant == "compression")
    written = Fitted(stop, np.array([0.0, 1e3, 0.0]), np.eye(3), {"gap": 1.5, "hardening": 0.5})
    vehicle, _ = BumpStop().extend(quarter_car(), view, written)
    curve = parts_of(vehicle.mounts["strut"].elements["z"])[-1]
    rms = view.scales[0][0]
    depth = 1.1 * float(np.max(-x)) - 1.5 * rms
    inside = [(d, f) for d, f in zip(curve.deflections, curve.forces) if 0.0 < -d - 1.5 * rms < depth]
    assert len(inside) >= 2
    for d, force in inside:
        u = (-d / rms - 1.5) / 0.5
        assert force == pytest.approx(-1e3 * rms * 0.5 * (np.expm1(u) - u), rel=1e-6)
