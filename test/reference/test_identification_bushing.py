# Copyright 2026 ride_estimation contributors
"""Bench identification of rubber bushings against an independent simulation (items B10-B18 of the coverage list)."""

import dataclasses

import numpy as np
import pytest
from bushing_truth import (
    TABLE_3,
    TRUTH,
    brute_force_stiffness,
    dma_plan,
    overlay_force,
    stepped_chirp,
    validation_signals,
)

from ride_estimation.identification.bench.frequency_domain import fit_frequency_domain
from ride_estimation.identification.bench.harmonic_stiffness import complex_stiffness
from ride_estimation.identification.bench.models import model_by_name
from ride_estimation.identification.bench.record import BenchRecord, check_record
from ride_estimation.identification.bench.steady_cycles import OperatingPoints, find_operating_points, operating_points
from ride_estimation.identification.bench.time_domain import fit_time_domain, prepare
from ride_estimation.identification.bench.uncertainty import uncertainty
from ride_estimation.metrics import nrmse

MODIFIED = model_by_name("modified_berg")


@pytest.fixture(scope="module")
def chirp():
    t, x = stepped_chirp()
    return t, x, overlay_force(TRUTH, x, 1e-3)


def record(t, x, force):
    return prepare(check_record(BenchRecord("chirp", t, x, force)))


def noisy(chirp, seed):
    t, x, force = chirp
    return record(t, x, force + 0.005 * np.abs(force).max() * np.random.default_rng(seed).standard_normal(t.size))


def test_time_domain_recovers_all_parameters_within_their_stated_uncertainty(chirp):
    # B14: 200 s at 1 kHz, noise 0.5 % of peak force
    item = noisy(chirp, 0)
    fit = fit_time_domain(MODIFIED, [item])
    spread = uncertainty(fit, [item])
    std = np.array([p.std for p in spread.parameters])
    # 4 standard deviations over 8 parameters: a correct std is exceeded once in 2000 runs
    assert np.all(np.abs(fit.values - TRUTH) < 4.0 * std)
    # Cramer-Rao bounds of this record in % (document notes, section 5, first row), to 30 %
    published = np.array([0.008, 0.09, 0.36, 0.31, 3.1, 1.2, 0.11, 0.27])
    ratio = 100 * spread.white_std / np.abs(TRUTH) / published
    assert np.all((ratio > 0.7) & (ratio < 1.3)), ratio
    # the largest error allowed per parameter in %, three of those bounds
    assert np.all(100 * np.abs(fit.values / TRUTH - 1) < 3 * published)


@pytest.mark.slow
def test_scatter_over_seeds_stays_within_1_3_cramer_rao(chirp):
    # B14: sd over 40 seeds; the ratio's own scatter is 1/sqrt(80) = 11 %, so 1.3 is 2.7 of its standard deviations
    values, bound = [], None
    for seed in range(40):
        item = noisy(chirp, seed)
        fit = fit_time_domain(MODIFIED, [item], starts=2)
        bound = uncertainty(fit, [item]).white_std if bound is None else bound
        values.append(fit.values)
    scatter = np.std(values, axis=0, ddof=1) / bound
    assert np.all(scatter < 1.3), scatter
    bias = (np.mean(values, axis=0) - TRUTH) / (bound / np.sqrt(40))
    assert np.all(np.abs(bias) < 4.0), bias


def random_starts(count, seed):
    rng = np.random.default_rng(seed)
    return [np.log([10 ** rng.uniform(-1, 3), 10 ** rng.uniform(-1, 3), 10 ** rng.uniform(-4.5, -2)]) for _ in range(count)]


@pytest.mark.parametrize("count", [8, pytest.param(40, marks=pytest.mark.slow)])
def test_every_random_start_reaches_the_same_optimum(chirp, count):
    # B10: starts over more than two decades in each nonlinear parameter
    item = noisy(chirp, 1)
    reference = fit_time_domain(MODIFIED, [item]).result.cost
    costs = np.array([fit_time_domain(MODIFIED, [item], start=s).result.cost for s in random_starts(count, 3)])
    # relative cost difference of 1e-7: 0.1 of a standard deviation at 200 000 samples
    assert np.sum(costs < reference * (1 + 1e-7)) == count


def test_physical_bounds_hold_and_are_reported(chirp):
    # B10: a record without friction must not get a negative friction force
    t, x, _ = chirp
    force = 1e5 * x + 50.0 * np.gradient(x, t) + 0.5 * np.random.default_rng(2).standard_normal(t.size)
    item = record(t[::4], x[::4], force[::4])
    fit = fit_time_domain(model_by_name("berg_viscous"), [item])
    assert np.all(fit.values[2:] >= 0.0)
    assert fit.values[2] < 2.0  # N friction against 1000 N force
    spread = uncertainty(fit, [item])
    assert {p.status for p in spread.parameters[2:]} & {"at_bound", "not_identifiable"} or fit.values[2] < 0.2


def measured_points(noise=0.0, seed=0):
    """K* of the 35 DMA tests by brute force; force noise [N] on the first harmonic of 6 cycles at 200 samples each."""
    rng = np.random.default_rng(seed)
    plan = dma_plan()
    k = np.array([brute_force_stiffness(TRUTH, a, f) for a, f in plan])
    amplitude, omega = np.array([a for a, _ in plan]), 2 * np.pi * np.array([f for _, f in plan])
    std = noise * np.sqrt(2 / 1200)
    k = k + std / amplitude * (rng.standard_normal(k.size) + 1j * rng.standard_normal(k.size))
    return OperatingPoints(omega, amplitude, k, np.full(k.size, std))


def test_closed_form_of_the_fit_equals_brute_force():
    points = measured_points()
    theta, coefficients = MODIFIED.searched(TRUTH)
    model = complex_stiffness(MODIFIED.layout, theta, coefficients, points.omega, points.amplitude)
    # 1024 samples a cycle leave 1e-4 in the friction loop's corners
    assert np.max(np.abs(model / points.stiffness - 1)) < 3e-4


@pytest.mark.parametrize("norm", ["complex_modulus", "repaired", "printed"])
def test_frequency_domain_is_exact_without_noise(norm):
    # B12: all eight parameters within 0.15 %
    exact = measured_points()
    points = operating_points(exact.omega, exact.amplitude, np.abs(exact.stiffness), exact.loss_energy)
    fit = fit_frequency_domain(MODIFIED, points, norm=norm, force_noise=0.0)
    assert np.all(np.abs(fit.values / TRUTH - 1) < 0.0015), 100 * (fit.values / TRUTH - 1)


def cramer_rao(points):
    """Smallest standard deviations of unbiased parameters from K* whose noise is `force_std` over the amplitude, shape (8,)."""

    def stiffness(values):
        theta, coefficients = MODIFIED.searched(values)
        return complex_stiffness(MODIFIED.layout, theta, coefficients, points.omega, points.amplitude)

    rows = []
    for i in range(TRUTH.size):
        up, down = TRUTH.copy(), TRUTH.copy()
        up[i] *= 1 + 1e-5
        down[i] *= 1 - 1e-5
        rows.append((stiffness(up) - stiffness(down)) / (2e-5 * TRUTH[i]) * points.amplitude / points.force_std)
    jacobian = np.hstack([np.real(rows), np.imag(rows)])
    return np.sqrt(np.diag(np.linalg.inv(jacobian @ jacobian.T)))


def noisy_fits(noise, seeds, norm="complex_modulus"):
    fits = [fit_frequency_domain(MODIFIED, measured_points(noise, seed), norm=norm) for seed in seeds]
    return np.array([f.values / TRUTH - 1 for f in fits]), np.array([f.std for f in fits]) / np.abs(TRUTH)


@pytest.mark.parametrize(
    ("noise", "seeds"), [(1.0, range(400, 412)), pytest.param(15.0, range(300, 340), marks=pytest.mark.slow)]
)
def test_frequency_domain_reaches_the_cramer_rao_bound(noise, seeds):
    # force noise 1 N and 15 N per sample, 1200 samples per test
    bound = cramer_rao(measured_points(noise, 0)) / np.abs(TRUTH)
    error, std = noisy_fits(noise, seeds)
    # the bound is that of a linear problem: parameters it leaves undetermined by more than 5 % are not asked to keep it
    # (at 15 N both cells: 9 to 95 %; at 1 N only the second spring, 6.4 %, where it still holds)
    told = bound < 0.07
    assert told.sum() == (8 if noise < 2.0 else 4)
    # rms over n seeds scatters by 1/sqrt(2 n) of itself; three of those
    ratio = np.sqrt(np.mean(error**2, axis=0)) / bound
    assert np.all(ratio[told] < 1.0 + 3.0 / np.sqrt(2 * len(seeds))), ratio
    # the stated standard deviation is neither too small (5 % of normal errors lie beyond two of it; 12.5 % of about a hundred
    # correlated ones are three deviations of that count) nor useless (it contains the 0.01 % below which no cell is linear)
    assert np.mean(np.abs(error[:, told]) > 2.0 * std[:, told]) <= 0.125
    assert np.all(np.median(std, axis=0)[told] < 2.5 * bound[told])
    # what the points cannot tell says so
    assert np.all(np.median(std, axis=0)[~told] > 0.05)


def test_second_cell_of_the_dma_plan_is_not_identifiable_to_two_per_cent():
    # the 2.3 % of the document notes (one seed) is below the bound for the second spring: 6.4 % for 1200 samples per test, and
    # more for six cycles at 1 kHz, where the fast tests have the fewest samples; the other parameters can keep it
    even = 100 * cramer_rao(measured_points(1.0)) / np.abs(TRUTH)
    assert even[4] > 6.0 and even[5] > 3.0
    assert np.all(np.delete(even, [4, 5]) < 1.1)
    points = measured_points()
    cycles = dataclasses.replace(points, force_std=np.sqrt(2 * points.omega / (2 * np.pi) / 6000.0))
    at_1_khz = 100 * cramer_rao(cycles) / np.abs(TRUTH)
    assert at_1_khz[4] > even[4]


def test_repaired_weighting_is_less_hurt_by_noise_than_the_printed_one():
    # 1 N force noise on 1200 samples per test, three paired seeds; errors as root mean square over the seeds
    size = {n: np.sqrt(np.mean(noisy_fits(1.0, range(3), n)[0] ** 2, axis=0)) for n in ("complex_modulus", "printed")}
    # friction force and displacement, the two that document 003 Table 3 shows 30 % and 41 % apart
    assert np.all(size["complex_modulus"][6:] < 0.1 * size["printed"][6:]), size
    # the 2.3 % of the document notes for all parameters but those of the second cell, see the test above
    assert np.all(np.delete(size["complex_modulus"], [4, 5]) < 0.023), size


def test_operating_points_are_found_in_a_test_record():
    # three tests in one record with rests between; steady part only
    h, rng = 1e-3, np.random.default_rng(0)
    parts, expected = [], []
    for amplitude, f in ((2e-3, 1.0), (0.5e-3, 5.0), (4e-3, 0.5)):
        n = round(8 / f / h)
        parts += [amplitude * np.sin(2 * np.pi * f * h * np.arange(n)), np.zeros(500)]
        expected.append((amplitude, f))
    x = np.concatenate(parts)
    force = overlay_force(TRUTH, x, h) + rng.standard_normal(x.size)
    points = find_operating_points([record(np.arange(x.size) * h, x, force)])
    order = [int(np.argmin(np.abs(points.amplitude - a))) for a, _ in expected]
    for i, (amplitude, f) in zip(order, expected, strict=True):
        assert points.omega[i] / (2 * np.pi) == pytest.approx(f, rel=1e-3)
        assert points.amplitude[i] == pytest.approx(amplitude, rel=1e-3)
        # 1 N noise on at least 65 N: 0.5 % covers it, settling included
        assert abs(points.stiffness[i] / brute_force_stiffness(TRUTH, amplitude, f) - 1) < 0.005


def test_validation_errors_fall_along_the_published_ladder(chirp):
    # B15, B16: fit on the noise-free chirp, NRMSE (std) on V1, V2, V3; model = truth below 0.1 %
    t, x, force = chirp
    item = record(t[::2], x[::2], force[::2])
    errors = {}
    for name in ("kelvin_voigt", "berg", "modified_berg"):
        fit = fit_time_domain(model_by_name(name), [item], starts=3)
        row = []
        for signal_t, signal_x in validation_signals().values():
            motion = prepare(BenchRecord("v", signal_t, signal_x, signal_x)).motion
            row.append(nrmse(overlay_force(TRUTH, signal_x, 1e-3), fit.force(motion)))
        errors[name] = np.array(row)
    assert np.all(errors["kelvin_voigt"] > errors["berg"])
    assert np.all(errors["berg"] > 5 * errors["modified_berg"])
    assert np.all(errors["modified_berg"] < 1e-3), errors


def test_three_norms_are_those_of_the_documents():
    # B16: std as in document 004 (2), max as in document 003 Fig. 16-18, range
    y = np.array([1.0, -3.0, 2.0, 0.5])
    e = np.array([0.1, -0.2, 0.0, 0.1])
    rms = np.sqrt(np.mean(e**2))
    assert nrmse(y, y - e) == pytest.approx(np.sqrt(np.sum(e**2) / np.sum((y - y.mean()) ** 2)), abs=1e-12)
    assert nrmse(y, y - e, "max") == pytest.approx(rms / 3.0, abs=1e-12)
    assert nrmse(y, y - e, "range") == pytest.approx(rms / 5.0, abs=1e-12)


def test_table_3_rates():
    # B17: corner frequencies k / (2 pi c) of the printed cells
    def rate(k, c):
        return k / c / (2 * np.pi)

    assert rate(*TABLE_3["berg", "frequency"][1:3]) == pytest.approx(8.99, abs=0.01)
    assert rate(*TABLE_3["berg", "time"][1:3]) == pytest.approx(0.53, abs=0.005)
    assert [rate(*TABLE_3["modified_berg", "frequency"][i : i + 2]) for i in (2, 4)] == pytest.approx([0.944, 10.11], abs=0.01)
    assert [rate(*TABLE_3["modified_berg", "time"][i : i + 2]) for i in (2, 4)] == pytest.approx([0.643, 20.02], abs=0.01)


@pytest.mark.parametrize(("name", "method"), list(TABLE_3))
def test_each_published_set_survives_a_round_trip_through_its_own_force(name, method):
    # B17: simulate each printed set by the independent loop, identify it again; 100 Hz, 40 Hz chirp content left out
    model = model_by_name(name)
    values = np.array(TABLE_3[name, method])
    t, x = stepped_chirp(2e-3, 160.0)
    full = {
        "kelvin_voigt": None,
        "berg": lambda v: (v[0], 0.0, v[1], v[2], 0.0, 1.0, v[3], v[4]),
        "modified_berg": tuple,
    }[name]
    force = values[0] * x + values[1] * np.gradient(x, t) if full is None else overlay_force(full(values), x, 2e-3)
    fit = fit_time_domain(model, [record(t, x, force)], starts=3)
    # trapezoidal truth against exact cells at 2 ms: (2 pi 20 Hz 2 ms)^2 / 12 = 0.5 %
    assert np.all(np.abs(fit.values / values - 1) < 0.015), fit.values / values - 1


def test_test_time_of_both_methods():
    # B11, B18: 35 tests of six cycles against one chirp
    plan = dma_plan()
    duration = sum(6 / f for _, f in plan)
    assert len(plan) == 35
    assert duration == pytest.approx(1453, abs=1)  # s, printed "about 1500 s"
    assert 1 - 200 / duration == pytest.approx(0.862, abs=0.001)  # printed "about 86 %"


def test_sensor_noise_on_displacement_does_not_destroy_friction(chirp):
    # 1 um white noise at 1 kHz; raw turning points lose a third of the friction force
    t, x, force = chirp
    measured = x + 1e-6 * np.random.default_rng(4).standard_normal(x.size)
    checked = check_record(BenchRecord("noisy", t, measured, force))
    robust = prepare(checked)
    raw = prepare(checked, raw_reversals=True)
    assert abs(robust.motion.noise_std - 1e-6) < 0.1e-6
    assert abs(robust.motion.directions.size - 1430) < 60
    assert raw.motion.directions.size > 10 * robust.motion.directions.size
    fit = fit_time_domain(MODIFIED, [robust], starts=3)
    good, bad = fit.values / TRUTH - 1, fit_time_domain(MODIFIED, [raw], start=fit.theta).values / TRUTH - 1
    assert abs(bad[6]) > 0.2
    # shares; the second cell is the least determined (3 % standard deviation at 6 N noise)
    limits = np.array([0.001, 0.01, 0.02, 0.02, 0.05, 0.02, 0.005, 0.01])
    assert np.all(np.abs(good) < limits), 100 * good


def test_identified_element_is_the_fitted_model(chirp):
    from ride_estimation.elements.registry import element_from_mapping
    from ride_estimation.identification.bench.element_mapping import element_mapping

    t, x, force = (s[::2] for s in chirp)
    item = record(t, x, force)
    for name in ("kelvin_voigt", "dahl", "berg", "cubic_berg", "modified_berg", "three_cell_berg"):
        fit = fit_time_domain(model_by_name(name), [item], starts=2)
        element = element_from_mapping(element_mapping(fit))
        # two implementations of one law on the same samples
        assert nrmse(element.response(t, x), fit.force(item.motion)) < 2e-3, name
        k = element.dynamic_stiffness(2 * np.pi * 3.0, 1e-3)
        if k is not None:
            mine = complex_stiffness(fit.model.layout, fit.theta, fit.coefficients, 2 * np.pi * 3.0, np.asarray(1e-3))
            assert abs(complex(mine) / k - 1) < 1e-6, name


def test_force_offset_does_not_bias(chirp):
    t, x, force = (s[::4] for s in chirp)
    plain = fit_time_domain(MODIFIED, [record(t, x, force)], starts=2).values
    shifted = fit_time_domain(MODIFIED, [record(t, x, force + 345.0)], starts=2).values
    assert shifted == pytest.approx(plain, rel=1e-6)


def test_clipped_force_is_left_out(chirp):
    t, x, force = (s[::4] for s in chirp)
    clipped = check_record(BenchRecord("clipped", t, x, np.clip(force, -1000.0, 1000.0)))
    assert any("clipped" in w for w in clipped.warnings)
    fit = fit_time_domain(MODIFIED, [prepare(clipped)], starts=3)
    # shares; the clipped part is 1 kN to 1.23 kN
    assert np.all(np.abs(fit.values / TRUTH - 1)[[0, 6, 7]] < 0.01), fit.values / TRUTH - 1


def test_two_records_weigh_with_their_own_offsets(chirp):
    t, x, force = (s[::4] for s in chirp)
    half = t.size // 2
    first = record(t[:half], x[:half], force[:half] + 50.0)
    second_x = x[half:]
    second = record(t[half:] - t[half], second_x, overlay_force(TRUTH, second_x, 4e-3) - 20.0)
    fit = fit_time_domain(MODIFIED, [dataclasses.replace(first), second], starts=4)
    # shares of the well-told parameters
    assert np.all(np.abs(fit.values / TRUTH - 1)[[0, 6, 7]] < 0.01), fit.values / TRUTH - 1


def test_extraction_definitions_agree_on_a_linear_element_and_differ_on_friction():
    # a definition is an option by name because K depends on it
    h, f, amplitude = 1e-3, 2.0, 1e-3
    t = np.arange(round(10 / f / h)) * h
    x = amplitude * np.sin(2 * np.pi * f * t)
    linear = record(t, x, 1e5 * x + 300 * 2 * np.pi * f * amplitude * np.cos(2 * np.pi * f * t))
    friction = record(t, x, overlay_force(TRUTH, x, h))
    names = ("harmonic", "peak", "range")
    by_linear = {n: find_operating_points([linear], n).stiffness[0] for n in names}
    by_friction = {n: abs(find_operating_points([friction], n).stiffness[0]) for n in names}
    expected = 1e5 + 2j * np.pi * f * 300
    assert abs(by_linear["harmonic"] / expected - 1) < 1e-6
    # the range of the force is the magnitude; at largest displacement the damper carries nothing
    assert abs(by_linear["range"]) == pytest.approx(abs(expected), rel=1e-4)
    assert abs(by_linear["peak"]) == pytest.approx(expected.real, rel=1e-3)
    # up to 1.6 % between definitions for this set (document notes); here more than 0.2 %
    assert abs(by_friction["peak"] / by_friction["harmonic"] - 1) > 0.002
