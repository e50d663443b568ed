# Copyright 2026 ride_estimation contributors
"""The parts of the diagnosis against closed forms and independent least squares."""

from __future__ import annotations

import dataclasses
import math
import types

import numpy as np
import pytest
from diagnosis_runs import quarter_car, quarter_car_run

from ride_estimation.diagnosis.answer.result import Gain, ValidationGain
from ride_estimation.diagnosis.answer.verdict import gained_nothing, reversal_odds, shows_elsewhere, weighed_sizes, within_library
from ride_estimation.diagnosis.calibration.baseline import Adjustable, baseline_columns, mean_table
from ride_estimation.diagnosis.calibration.linear_model import (
    Calibrated,
    calibrate,
    file_parameters,
    tolerance_limits,
    with_held_faults,
)
from ride_estimation.diagnosis.calibration.regression import Regression, offset_deviance
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.spectra import make_grid
from ride_estimation.diagnosis.common.splits import make_splits
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted, Reported, Sign
from ride_estimation.diagnosis.hypotheses.operators import friction_level, loose_friction, relaxed, resonant
from ride_estimation.diagnosis.hypotheses.sensor_column import fault_std
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.model.response import respond
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.noise import noise_scale, temper_of
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.free_law import NO_LAW, FreeLaw
from ride_estimation.diagnosis.search.prediction import bootstrap_interval
from ride_estimation.diagnosis.search.screening import solve_signed
from ride_estimation.diagnosis.search.selection import Candidate, beyond_tolerance
from ride_estimation.frames import rotation_matrices
from ride_estimation.sensors.installation import USUAL, Installation
from ride_estimation.signals.recording import UniformRun


def test_friction_reaches_its_level_and_its_loop_is_as_high_as_twice_the_level():
    time = np.arange(0.0, 4.0, 1e-3)
    x = 0.01 * np.sin(2 * np.pi * time)
    level = friction_level(x, 2e-4)
    last = time > 2.0
    # sliding distance 0.2 mm against a stroke of 20 mm: saturated to exp(-100)
    assert level[last].max() == pytest.approx(1.0, abs=1e-6)
    area = abs(float(np.sum(0.5 * (level[last][1:] + level[last][:-1]) * np.diff(x[last])))) / 2.0
    # Coulomb loop 4 x level x amplitude per cycle, less what presliding cuts off (about 2 x reach / amplitude)
    assert area == pytest.approx(4 * 0.01, rel=0.05)


def test_friction_behind_a_play_is_nothing_while_the_play_is_crossed():
    x = np.concatenate([np.linspace(0.0, 0.010, 101), np.linspace(0.010, -0.010, 201)[1:]])
    share = loose_friction(x, 0.002, 0.001)
    # contact after 2 mm, sliding after 3 mm; after the reversal 1 mm of unloading, 4 mm of play, 1 mm of loading
    expected = np.interp(x[:101], [0.0, 0.002, 0.003, 0.010], [0.0, 0.0, 1.0, 1.0])
    expected_back = np.interp(0.010 - x[101:], [0.0, 0.001, 0.005, 0.006, 0.020], [1.0, 0.0, 0.0, -1.0, -1.0])
    np.testing.assert_allclose(share, np.concatenate([expected, expected_back]), atol=1e-9)


def test_a_response_is_the_same_at_the_sample_rate_and_at_that_of_laws():
    grid = make_grid(1000, 100.0, (0.4, 40.0))
    spectrum = grid.spectrum(np.random.default_rng(2).standard_normal(1000) * np.hanning(1000))
    response = 1j * grid.omega / (1j * grid.omega + 6.0)
    assert grid.refinement == 2
    fine = grid.filtered(grid.refined(spectrum), response)
    inner = slice(200, -200)  # the ends fold what padding holds of them
    coarse = grid.filtered(grid.signal(spectrum), response)
    np.testing.assert_allclose(fine[::2][inner], coarse[inner], atol=1e-3 * np.std(coarse))


def test_a_maxwell_cell_is_stiff_above_its_corner_and_loses_half_at_it():
    omega = 2 * np.pi * np.array([0.01, 1.0, 100.0])
    cell = relaxed(omega, np.ones(3, complex), 1.0)
    assert abs(cell[0]) < 0.02
    assert cell[1] == pytest.approx(0.5 + 0.5j, rel=1e-12)
    assert cell[2] == pytest.approx(1.0, abs=0.02)


def test_a_sprung_mass_follows_slowly_and_isolates_fast():
    omega = 2 * np.pi * np.array([0.05, 3.0, 60.0])
    motion = resonant(omega, np.ones(3, complex), 3.0, 0.1)
    assert motion[0] == pytest.approx(1.0, abs=1e-3)
    assert abs(motion[1]) == pytest.approx(np.sqrt(1 + 1 / (2 * 0.1) ** 2), rel=1e-9)
    assert abs(motion[2]) < 0.02


def test_rotation_matrices_are_orthogonal_and_turn_a_vector_by_the_angle():
    r = rotation_matrices(np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.0], [1e-10, 0.0, 0.0]]))
    np.testing.assert_allclose(r[0] @ [1.0, 0.0, 0.0], [np.cos(0.3), np.sin(0.3), 0.0], atol=1e-14)
    np.testing.assert_allclose(r[1], np.eye(3), atol=1e-15)


def test_quarter_car_transmissibility_is_the_closed_form():
    vehicle = quarter_car()
    plant = build_plant(vehicle, {"body": 3, "base": 3})
    omega = 2 * np.pi * np.array([0.5, 1.5, 4.0, 12.0])
    k, c, m = 40e3, 2.5e3, 400.0
    response = respond(plant, np.array([k]), np.array([c]), omega)
    row = [s.name for s in plant.outputs].index("body.z")
    column = [s.name for s in plant.inputs].index("base.z")
    expected = (k + 1j * omega * c) / (k - m * omega**2 + 1j * omega * c)
    np.testing.assert_allclose(response.output_from_input[:, row, column], expected, rtol=1e-10)
    # a tension f in the mount pulls the body down: a = -f / m of the closed loop
    np.testing.assert_allclose(
        response.output_from_port[:, row, 0], omega**2 / (k - m * omega**2 + 1j * omega * c), rtol=1e-10
    )


def test_regression_equals_stacked_least_squares_with_priors():
    rng = np.random.default_rng(3)
    # rows are kept in single precision, and what becomes of them is exact for these
    columns, residual = (rng.normal(size=shape).astype(np.float32).astype(float) for shape in ((4, 50, 3), (4, 50)))
    std, offset = np.array([0.5, 2.0, 10.0]), np.array([0.1, 0.0, -1.0])
    regression = Regression(residual, columns, np.array([3.0]), np.array([[0.0, 1.0, 0.0]]), std, offset)
    fit = regression.fit(regression.grams, [0, 2, 3])
    rows = np.vstack([columns[[0, 2, 3]].reshape(-1, 3), np.diag(1 / std), [[0.0, 1.0, 0.0]]])
    right = np.concatenate([residual[[0, 2, 3]].ravel(), offset / std, [3.0]])
    expected, *_ = np.linalg.lstsq(rows, right, rcond=None)
    np.testing.assert_allclose(fit.coefficients, expected, rtol=1e-8)
    assert fit.objective == pytest.approx(float(np.sum((right - rows @ expected) ** 2)), rel=1e-8)
    left_out = residual[1] - columns[1] @ fit.coefficients
    assert regression.misfit(regression.grams, [1], fit.coefficients) == pytest.approx(float(left_out @ left_out), rel=1e-9)


def test_one_offset_among_readings_that_agree_counts_more_than_among_readings_that_scatter():
    """Closed form: with squares at or above their number the deviance is their sum, below it n + n ln(squares / n)."""
    lone, scattered = 4.0**2, 24.0  # one of 24 readings four tolerances off; all of them off by one tolerance
    assert offset_deviance(scattered + lone, 24) - offset_deviance(scattered, 24) == pytest.approx(lone)
    assert offset_deviance(lone, 24) == pytest.approx(24.0 + 24.0 * np.log(lone / 24.0))
    assert offset_deviance(lone, 24) - offset_deviance(0.0, 24) > 4.0 * lone
    assert offset_deviance(0.0, 0) == 0.0


def test_temper_weights_the_prior_and_not_the_data():
    rng = np.random.default_rng(4)
    columns = rng.normal(size=(1, 200, 1))
    regression = Regression(columns[:, :, 0] * 2.0, columns, np.zeros(0), np.zeros((0, 1)), np.array([0.1]), np.zeros(1))
    mild = regression.fit(regression.grams, [0]).coefficients[0]
    strong = regression.with_temper(100.0)
    assert 0.0 < strong.fit(strong.grams, [0]).coefficients[0] < 0.1 * mild


def test_coefficients_of_the_wrong_sign_are_dropped():
    normal, right = np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([2.0, -3.0])
    coefficients, drop = solve_signed(normal, right, (Sign.POSITIVE, Sign.POSITIVE))
    np.testing.assert_allclose(coefficients, [2.0, 0.0], atol=1e-6)
    assert drop == pytest.approx(4.0, rel=1e-6)


def test_a_lead_that_comes_from_one_block_is_less_sure_than_one_of_all_blocks():
    def candidate(level: float, per_block: list[float]) -> Candidate:
        return Candidate(types.SimpleNamespace(block_misfit=np.array(per_block)), level)

    blocks = np.arange(16)
    leader, steady = candidate(0.0, [1.0] * 16), candidate(-16.0, [3.0] * 16)
    assert reversal_odds(leader, steady, 1.0, blocks) == 0.0
    single = candidate(-16.0, [33.0] + [1.0] * 15)
    # per block 16 and fifteen zeros: standard deviation 4, of the sum 16; a lead of 16 is one of it: Phi(-1) = 0.1587
    assert reversal_odds(leader, single, 1.0, blocks) == pytest.approx(0.15866 / 0.84134, rel=1e-3)


@pytest.mark.parametrize(("shift", "counts"), [(0.025, False), (0.035, True)])
def test_a_further_cause_must_exceed_three_tolerances(shift, counts):
    tolerance = Adjustable("cg", "cab", "z", 0.01)
    last = types.SimpleNamespace(
        hypothesis=types.SimpleNamespace(cause="cg_offset", location="cab", axis="z"), coefficients=np.array([-shift])
    )
    assert beyond_tolerance(types.SimpleNamespace(fitted=(last,), adjustables=(tolerance,))) is counts
    large = types.SimpleNamespace(hypothesis=last.hypothesis, coefficients=np.array([1e3]))
    assert beyond_tolerance(types.SimpleNamespace(fitted=(last, large), adjustables=(tolerance,)), 0) is counts


def test_splits_are_disjoint_and_cover_every_part_of_the_run():
    splits = make_splits(27)
    everything = np.concatenate([splits.fit, splits.select, splits.judge])
    assert sorted(everything.tolist()) == list(range(27))
    assert np.max(np.diff(splits.judge)) == 4


def test_blocks_dealt_in_an_order_are_spread_over_the_parts_by_it_and_a_copy_keeps_them():
    order = [20, 3, 7, 11, 0, *(b for b in range(24) if b not in (20, 3, 7, 11, 0))]
    splits = make_splits(24, [0, 11], order)
    parts = {b: name for name in ("fit", "select", "judge") for b in getattr(splits, name).tolist()}
    # the fourth may not judge, the fifth neither: the sixth does
    assert [parts[b] for b in order[:6]] == ["fit", "select", "fit", "fit", "fit", "judge"]
    assert sorted(parts) == list(range(24))
    for count in (22, 24, 25):
        copy = splits.of_copy(count)
        again = {b: name for name in ("fit", "select", "judge") for b in getattr(copy, name).tolist()}
        assert again == {b: parts.get(b, "fit") for b in range(count)}


def test_temper_of_a_right_model_is_one():
    assert temper_of(0.97, 30.0) == 1.0
    assert temper_of(1.1, 30.0) == pytest.approx(4.0)


def test_noise_is_measured_in_directions_rigid_motion_cannot_reach():
    rng = np.random.default_rng(5)
    motion = rng.normal(size=(12, 6))
    samples = 4000
    data = 3.0 * 0.02 * rng.normal(size=(samples, 12)) + rng.normal(size=(samples, 6)) @ motion.T
    spectrum = np.fft.rfft(data, axis=0)[1:-1]
    frequency = np.fft.rfftfreq(samples, 0.005)[1:-1]
    # 6 directions x 660 bins: the median of an exponential is known within 2 %
    assert noise_scale(spectrum, motion, np.full(12, 0.02), frequency, samples) == pytest.approx(3.0, rel=0.05)


def test_whitened_noise_has_one_unit_per_degree_of_freedom():
    grid = make_grid(6000, 100.0, (0.4, 40.0))
    rng = np.random.default_rng(6)
    noise = rng.normal(size=(6000, 20))
    signal = grid.decimated_signal(grid.spectrum(noise) * grid.band_weight[:, None])
    share = np.sum(grid.band_weight**2) / (grid.decimated / 2)
    inner = signal[600:-600]
    # 20 channels x 4800 samples: standard error of the mean square 0.5 %
    assert np.mean(inner**2) == pytest.approx(share, rel=0.03)


def test_calibration_recovers_stiffness_and_damping_of_a_quarter_car():
    vehicle = quarter_car()
    run = quarter_car_run(seed=1)
    plant = build_plant(vehicle, {"body": 3, "base": 3})
    found = calibrate(RunData(plant, measurement(plant, run), Settings()))
    # truth 44 kN/m and 2 kN s/m; 0.5 % noise, 40 s: standard errors below 0.3 % and 1 %
    assert found.view.state.stiffness[0] * np.exp(found.fit.coefficients[0]) == pytest.approx(44e3, rel=0.01)
    assert found.view.state.damping[0] * np.exp(found.fit.coefficients[1]) == pytest.approx(2e3, rel=0.03)


def test_a_worse_installation_of_the_file_counts_and_a_better_one_makes_no_fault():
    vehicle = quarter_car()
    stated = Installation(gain=0.02, misalignment=0.001, bias=0.3)
    told = dataclasses.replace(vehicle.sensors["body"], installation=stated)
    vehicle = dataclasses.replace(vehicle, sensors={**vehicle.sensors, "body": told})
    plant = build_plant(vehicle, {"body": 3, "base": 3})
    view = RunView(RunData(plant, measurement(plant, quarter_car_run(5, 12.0)), Settings()), ModelState(*file_parameters(plant)))
    table = mean_table(view)
    std = {(a.kind, a.place): a.prior_std for a in baseline_columns(view, table, file_parameters(plant))[0]}
    assert (std["gain", "body"], std["misalignment", "body"]) == (0.02, USUAL.misalignment)
    assert (std["gain", "base"], std["delay", "body"]) == (USUAL.gain, USUAL.delay)
    assert {s.sensor: float(v) for s, v in zip(table.signals, table.std)} == {"body": 0.3, "base": USUAL.bias}


def test_a_fault_of_a_sensor_is_no_better_known_than_what_a_good_one_has():
    vehicle = quarter_car()
    told = dataclasses.replace(vehicle.sensors["body"], installation=Installation(gain=0.02))
    plant = build_plant(dataclasses.replace(vehicle, sensors={**vehicle.sensors, "body": told}), {"body": 3, "base": 3})
    view = RunView(RunData(plant, measurement(plant, quarter_car_run(5, 12.0)), Settings()), ModelState(*file_parameters(plant)))
    assert fault_std(view, "body", "gain", 0.015) == pytest.approx(0.025)
    assert fault_std(view, "body", "delay", 0.0) == USUAL.delay
    for cause, tolerance in (("sensor_gain", 0.02), ("sensor_delay", USUAL.delay)):
        found = next(h for h in library()[cause].hypotheses(view) if h.location == "body")
        (stated,) = library()[cause].parameters(view, Fitted(found, np.array([0.3]), np.array([[0.001**2]]), {}))
        assert stated.std == pytest.approx(np.hypot(0.001, tolerance))


@pytest.mark.parametrize(
    ("sensor", "coefficient", "possible"),
    [
        ("base", -1.2349, True), ("base", 0.9, True), ("base", 0.96, False), ("base", 1.0, False), ("base", 1.5, False),
        ("body", 1.5, True), ("body", -0.94, True), ("body", -0.96, False), ("body", -1.5, False), ("body", 20.0, False),
    ],
)  # fmt: skip
def test_a_reading_has_a_positive_factor_from_a_twentieth_to_twenty(sensor, coefficient, possible):
    """Of a base sensor the coefficient is the share of its reading that is too much: 1.2 less than none is a factor of 0.45."""
    plant = build_plant(quarter_car(), {"body": 3, "base": 3})
    view = RunView(RunData(plant, measurement(plant, quarter_car_run(5, 12.0)), Settings()), ModelState(*file_parameters(plant)))
    gain = next(h for h in library()["sensor_gain"].hypotheses(view) if h.location == sensor)
    assert gain.meaningful(np.array([coefficient]), {}) == possible


def test_columns_of_stiffness_are_the_derivative_of_the_simulated_output():
    vehicle, run = quarter_car(), quarter_car_run(seed=2)
    plant = build_plant(vehicle, {"body": 3, "base": 3})
    data = RunData(plant, measurement(plant, run), Settings())
    k, c = file_parameters(plant)
    here = RunView(data, ModelState(k, c), sees_outputs=False)
    shifted = RunView(data, ModelState(k * 1.001, c), here.noise, sees_outputs=False)
    adjustables, rows, _ = baseline_columns(here, mean_table(here), (k, c))
    index = [a.kind for a in adjustables].index("stiffness")
    difference = (here.residual - shifted.residual) / np.log(1.001)
    error = np.linalg.norm(rows[:, :, index] - difference) / np.linalg.norm(difference)
    # columns use deflections freed of sensor noise: a few per cent apart from the raw simulation
    assert error < 0.05


def test_bootstrap_interval_holds_the_difference_and_widens_with_scatter():
    rng = np.random.default_rng(8)
    signal = np.full(30, 100.0)
    steady = bootstrap_interval(np.full(30, 4.0), np.full(30, 1.0), signal, np.arange(30), 300, 1)
    assert steady[0] == pytest.approx(0.1, abs=1e-12)
    rough = bootstrap_interval(4.0 * rng.lognormal(0.0, 1.0, 30), np.full(30, 1.0), signal, np.arange(30), 300, 1)
    assert rough[1] - rough[0] > 0.01


@pytest.mark.parametrize(("memory", "apart"), [(0.0, 1), (0.3, 1), (0.0, 2)], ids=["alone", "remember", "no neighbours"])
def test_bootstrap_interval_covers_the_truth_as_often_as_it_says(memory, apart):
    rng = np.random.default_rng(10)
    hits, trials, blocks = 0, 300, 20
    places = apart * np.arange(blocks)
    for _ in range(trials):
        # neighbours that hold a share of one another
        own = rng.normal(0.0, 1.0, (2, blocks + 1))
        scatter = (own[:, 1:] + memory * own[:, :-1]) / np.hypot(1.0, memory)
        before, after = 4.0 + 0.8 * scatter[0], 1.0 + 0.2 * scatter[1]
        low, high = bootstrap_interval(before, after, np.full(blocks, 100.0), places, 300, 1)
        hits += low <= np.sqrt(0.04) - np.sqrt(0.01) <= high
    # 95 % of 300: 2.5 standard errors are 3 %
    assert hits / trials == pytest.approx(0.95, abs=0.032)


def test_too_short_a_run_is_insufficient_and_says_how_much_is_needed():
    answer = diagnose(quarter_car(), quarter_car_run(seed=1, seconds=6.0))
    assert answer.verdict == "insufficient_data"
    assert "12 s" in answer.sentence
    assert answer.causes == ()


def test_a_standing_vehicle_is_insufficient_data():
    run = quarter_car_run(seed=1)
    rng = np.random.default_rng(9)
    still = {k: np.array([0.0, 0.0, 9.80665]) + 0.005 * rng.normal(size=v.shape) for k, v in run.data.items()}
    answer = diagnose(quarter_car(), dataclasses.replace(run, data=still))
    assert answer.verdict == "insufficient_data"
    assert "rougher road" in answer.sentence


def test_a_run_without_base_motion_is_insufficient_data():
    run = quarter_car_run(seed=1)
    only = UniformRun(run.name, run.rate_hz, run.start_ns, {"body": run.data["body"]}, {"body": run.valid["body"]})
    answer = diagnose(quarter_car(), only)
    assert answer.verdict == "insufficient_data"
    assert "chassis side" in answer.sentence or "base motion" in answer.sentence



@pytest.mark.parametrize("kind", ["cg", "delay"])
@pytest.mark.parametrize(("true", "held"), [(0.025, False), (-0.045, True)])
def test_an_error_beyond_three_tolerances_is_left_in_the_residual(true, held, kind):
    rng = np.random.default_rng(11)
    blocks, rows = 6, 40
    columns = np.stack([np.full((blocks, rows), 200.0), rng.standard_normal((blocks, rows))], axis=2)
    residual = columns @ np.array([true, 0.4]) + rng.standard_normal((blocks, rows))
    adjustables = (Adjustable(kind, "cab", "z", 0.01), Adjustable("gain", "roof", "x", 0.1))
    regression = Regression(residual, columns, np.zeros(0), np.zeros((0, 2)), np.array([0.01, 0.1]), np.zeros(2))
    used = np.arange(blocks)
    fit = regression.fit(regression.grams, used)
    view = types.SimpleNamespace(block_dof=np.full(blocks, float(rows)), inefficiency=1.0)
    found = with_held_faults(Calibrated(view, None, adjustables, regression, fit, used))
    # the data determine it to 1 / (200 sqrt(240)) = 0.3 mm
    # a CG stays at its limit, an error of a sensor is left to its cause as a whole
    kept = (-0.03 if kind == "cg" else 0.0) if held else true
    assert found.fit.coefficients[0] == pytest.approx(kept, abs=2e-3)
    # what 15 mm too little leave, (0.015 x 200)^2 = 9 noise powers, weakens 240 rows against the prior of the gain as 10 would
    evidence = 240.0 / (1.0 + (200.0 * (true - kept)) ** 2)
    assert found.fit.coefficients[1] == pytest.approx(0.4 * evidence / (evidence + 100.0), abs=0.08)
    assert dict(found.held) == ({0: pytest.approx(kept)} if held else {})


def test_of_many_errors_more_is_chance():
    """One of a hundred normal errors lies beyond 3.9 standard deviations in a hundredth of all runs."""
    limits = tolerance_limits([Adjustable("gain", f"s{i}", "x", 0.1) for i in range(100)])
    draws = np.abs(np.random.default_rng(5).standard_normal((20000, 100))).max(axis=1)
    assert np.mean(draws > limits[0]) == pytest.approx(0.01, abs=0.002)  # three standard errors of a rate of 1 % in 20 000


@pytest.mark.parametrize(("mass_std", "share"), [(None, 0.0), (8.0, 0.02), (math.inf, 0.0)])
def test_forces_and_masses_are_known_no_better_than_the_mass_of_the_file(mass_std, share):
    vehicle = quarter_car()
    body = vehicle.bodies["body_mass"]
    mass = dataclasses.replace(body.mass, value=400.0, std=mass_std)
    bodies = {"body_mass": dataclasses.replace(body, mass=mass)}
    view = types.SimpleNamespace(plant=types.SimpleNamespace(vehicle=dataclasses.replace(vehicle, bodies=bodies)))
    sizes = [Reported("amplitude z", -150.0, 4.0, "N"), Reported("added mass", 20.0, 0.3, "kg"), Reported("gap", 0.1, 0.01, "m")]
    stated = weighed_sizes(sizes, view)
    assert [r.std for r in stated] == pytest.approx([math.hypot(4.0, 150.0 * share), math.hypot(0.3, 20.0 * share), 0.01])
    assert [(r.name, r.value, r.unit) for r in stated] == [(r.name, r.value, r.unit) for r in sizes]


def test_stated_probability_counts_what_no_library_lists():
    settings = Settings(unknown_probability=0.1, further_cause=0.2)

    def right(share, mean):
        """Return the mean of the Lomax density 1.5 / m (1 + r / 2 m)^-4 over shares within m of a share, by quadrature."""
        shares = np.linspace(max(share - mean, 0.0), share + mean, 20001)
        return np.mean(1.5 / mean * (1.0 + shares / (2.0 * mean)) ** -4)

    # a right cause leaves 5 % on average, a mimic anything; nothing left is no more certain than what is known of mimics
    certain = within_library((1,), 0.0, NO_LAW, settings)
    for share in (0.0, 0.05, 0.3):
        assert within_library((1,), share, NO_LAW, settings) == pytest.approx(9.0 / (9.0 + 1.0 / right(share, 0.05)), rel=1e-4)
    assert within_library((1,), 0.05, NO_LAW, settings) < certain < 0.995
    # odds of an unknown effect against two causes: five times as likely
    assert 1.0 / within_library((2,), 0.0, NO_LAW, settings) - 1.0 == pytest.approx(5.0 * (1.0 / certain - 1.0))
    # no effect is a force and an error of a sensor at once: one of either kind could stand for one of two such causes only
    assert 1.0 / within_library((1, 1), 0.0, NO_LAW, settings) - 1.0 == pytest.approx(2.0 * (1.0 / certain - 1.0))
    # nobody knows how far real laws are from a library: what explains half of an effect is not impossible
    assert 0.1 < within_library((1,), 0.5, NO_LAW, settings) < 0.25
    # a law of general form explains 7.8 % more: six times the mean of a right cause, three times where 39 % are left by something
    refuted, doubted = (within_library((1,), 0.0, FreeLaw("mount", "z", 0.078, left), settings) for left in (0.0, 0.39))
    assert refuted == pytest.approx(9.0 / (9.0 + 1.0 / right(0.078, 0.013)), rel=1e-4)
    assert doubted == pytest.approx(9.0 / (9.0 + 1.0 / right(0.078, 0.026)), rel=1e-4)
    # a law at one mount explains 97 % of what a sprung mass does: likelier by as much as right laws leave 3 %; 60 % is no rival
    rival, none = (within_library((1,), 0.0, FreeLaw("mount", "x", 0.0, alone=share), settings) for share in (0.97, 0.6))
    assert 1.0 / rival - 1.0 == pytest.approx((1.0 / certain - 1.0) * right(0.03, 0.05), rel=1e-4)
    assert none == certain


@pytest.mark.parametrize(
    ("judge", "other", "shown"),
    [
        ((0.0234, 0.0203), (0.058, 0.069), False),  # a little on its own judge blocks, nothing on the other run
        ((0.0234, 0.0203), (0.058, 0.050), True),
        ((0.0434, 0.0203), (0.058, 0.069), True),  # clearly wrong on blocks that fitted nothing, whatever the other run shows
    ],
)
def test_what_a_model_misses_has_to_show_where_nothing_was_fitted(judge, other, shown):
    run = ValidationGain("other", other[0], other[0], (0.0, 0.0), other[1])
    assert shows_elsewhere(Gain("NRMSE", judge[0], judge[0], judge[1], (run,)), Settings()) is shown


@pytest.mark.parametrize(
    ("extended", "ci95", "floor", "named"),
    [
        (0.059, (-0.005, 0.001), 0.013, False),  # nothing is gained where 4.4 % could be
        (0.036, (-0.005, 0.038), 0.013, True),  # a gain that a short run leaves open
        (0.030, (0.020, 0.034), 0.013, True),
        (0.057, (-0.001, 0.001), 0.057, True),  # nothing to gain: the effect is not excited there
    ],
)
def test_a_cause_that_gains_nothing_on_another_run_is_not_named(extended, ci95, floor, named):
    other = ValidationGain("other", 0.057, extended, ci95, floor)
    gain = Gain("NRMSE", 0.06, 0.03, 0.01, (other,))
    assert (gained_nothing(gain, Settings()) == "") is named


def test_the_expected_penalty_is_the_mean_of_what_a_good_installation_has():
    """Errors drawn from their priors deviate by ``n - tr(C P)`` on average, not by nothing: from both sides."""
    rng, blocks, rows, count = np.random.default_rng(5), 4, 30, 12
    columns = rng.standard_normal((blocks, rows, count)) * np.geomspace(0.03, 3.0, count)
    std, found = np.ones(count), []
    for _ in range(200):
        residual = columns @ rng.standard_normal(count) + rng.standard_normal((blocks, rows))
        regression = Regression(residual, columns, np.zeros(0), np.zeros((0, count)), std, np.zeros(count))
        fit = regression.fit(regression.grams, np.arange(blocks))
        found.append(fit.objective - regression.misfit(regression.grams, np.arange(blocks), fit.coefficients))
    assert 0.2 * count < fit.expected_penalty < 0.95 * count
    assert np.mean(found) == pytest.approx(fit.expected_penalty, abs=4.0 * np.std(found) / np.sqrt(200))
