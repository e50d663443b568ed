# Copyright 2026 ride_estimation contributors
"""Document 004: jounce-bumper laws, preprocessing and programme (items J3, J4, J6-J11, J14)."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from ride_estimation.elements import terms as kernel
from ride_estimation.elements.base import Array
from ride_estimation.elements.contact_maxwell import ContactMaxwell
from ride_estimation.elements.dahl import Dahl
from ride_estimation.elements.jounce_bumper import JounceBumper
from ride_estimation.elements.kernels_static import engagement, penetration
from ride_estimation.elements.local_linear_network import LocalLinearNetwork, continuous_gains
from ride_estimation.elements.maxwell import Maxwell, bilinear_response
from ride_estimation.elements.stability import largest_explicit_step, require_explicit_step
from ride_estimation.elements.weighted_dahl import WeightedDahl
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.excitation.jounce_programme import jounce_programme, operating_hull, reference_travel
from ride_estimation.signals.smoothing import fourth_order_rate, gauss_kernel, gauss_smooth

BUMPER = JounceBumper.example()
FRICTION = WeightedDahl.example()


def buffer_road(seed: int, peak_m: float) -> tuple[Array, Array]:
    """Return travel [m] and rate [m/s] of a road-like record, scaled to a peak travel."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 20.0, 1e-3)
    x, v = np.zeros_like(t), np.zeros_like(t)
    for f in np.linspace(0.8, 12.0, 60):
        a, phase = rng.normal() / f**1.5, rng.uniform(0, 2 * np.pi)
        x += a * np.sin(2 * np.pi * f * t + phase)
        v += a * 2 * np.pi * f * np.cos(2 * np.pi * f * t + phase)
    scale = peak_m / np.max(x)
    return scale * x, scale * v


# --- J3 ------------------------------------------------------------------------------------------------------------


def test_programme_scales_with_the_reference_travel() -> None:
    short, long = jounce_programme(0.040), jounce_programme(0.080)
    assert [e.name for e in short] == ["static_ramps", "dynamic_ramps", "amplitude_sweep"]
    for a, b in zip(short, long):
        # a sample of the fastest ramp is 2 mm long
        assert np.max(a.travel) == pytest.approx(0.040, abs=2.1e-3)
        assert np.max(b.travel) == pytest.approx(0.080, abs=2.1e-3)
    for e in long:
        # nothing faster than the peak rate of 2 m/s: the rig can follow
        assert np.max(np.abs(np.diff(e.travel))) * 1000.0 <= 2.0 * (1 + 1e-9)
    total = sum(e.time_s[-1] for e in long)
    assert 5 * 60 < total < 15 * 60


def test_programme_covers_the_operating_range_of_the_roads() -> None:
    # roads of 68 mm and about 1 m/s; reference travel 10 % beyond
    roads = [buffer_road(1, 0.068), buffer_road(2, 0.055)]
    assert 0.6 < max(np.max(np.abs(v)) for _, v in roads) < 2.0
    travel = np.concatenate([e.travel for e in jounce_programme(1.1 * 0.068)])
    rate = np.concatenate([np.gradient(e.travel, 1e-3) for e in jounce_programme(1.1 * 0.068)])
    programme = operating_hull(travel, rate, margin=0.0)
    for x, v in roads:
        loaded = x >= 0
        inside = programme.contains(x[loaded], v[loaded])
        assert np.all(inside)
    both = operating_hull(np.concatenate([x for x, _ in roads]), np.concatenate([v for _, v in roads]))
    for x, v in roads:
        assert np.all(both.contains(x[x >= 0], v[x >= 0]))
    assert np.max(both.vertices[:, 0]) == pytest.approx(1.1 * 0.068, rel=1e-9)
    assert not both.contains(np.array([0.09]), np.array([0.0]))[0]


def test_reference_travel_is_read_at_nine_kilonewton() -> None:
    travels, forces = np.array(BUMPER.travels), np.array(BUMPER.forces)
    assert reference_travel(travels, forces) == pytest.approx(0.07)
    assert reference_travel(travels, forces, 4000.0) == pytest.approx(0.06)
    with pytest.raises(InputDataError, match="9000 N"):
        reference_travel(travels, 0.5 * forces)
    with pytest.raises(InputDataError):
        operating_hull(np.linspace(0, 1, 50), np.linspace(0, 1, 50))


# --- J4 ------------------------------------------------------------------------------------------------------------


def test_gauss_kernel_has_its_gain() -> None:
    # exp(-(2 pi f sd)^2 / 2) at 5 ms; three decimals
    t = np.arange(0, 4.0, 1e-3)
    for f, gain in ((5, 0.988), (10, 0.952), (14, 0.908), (20, 0.821), (25, 0.735)):
        x = np.sin(2 * np.pi * f * t)
        middle = slice(1000, 3000)
        smooth = gauss_smooth(x, 1000.0)[middle]
        wave = 2.0 * np.mean(smooth * np.exp(-2j * np.pi * f * t[middle]))
        assert abs(wave) == pytest.approx(gain, abs=6e-4)
        # zero phase
        assert np.angle(wave) == pytest.approx(-0.5 * np.pi, abs=1e-9)
    assert np.sum(gauss_kernel(0.005, 1000.0)) == pytest.approx(1.0, abs=1e-15)
    # straight lines pass, also at the ends
    assert gauss_smooth(3.0 * t, 1000.0) == pytest.approx(3.0 * t, abs=1e-9)


def test_difference_is_of_fourth_order() -> None:
    errors = []
    for n in (100, 200):
        t = np.linspace(0, 1, n + 1)
        error = fourth_order_rate(np.sin(7 * t + 0.3), 1 / n) - 7 * np.cos(7 * t + 0.3)
        errors.append((np.max(np.abs(error[2:-2])), np.max(np.abs(error))))
    inner, all_ = (np.log2(a / b) for a, b in zip(errors[0], errors[1]))
    assert inner == pytest.approx(4.0, abs=0.02)
    assert all_ > 3.7
    with pytest.raises(InputDataError):
        fourth_order_rate(np.zeros(4), 1e-3)
    with pytest.raises(InputDataError):
        gauss_smooth(np.full(100, np.nan), 1000.0)


# --- J6, J7 --------------------------------------------------------------------------------------------------------


def slow_loop(element: JounceBumper | WeightedDahl, peak: float, points: int = 4001) -> tuple[Array, Array, Array]:
    """Return travels and the push going in and coming out, both over the same travels, of the third slow cycle."""
    rise = np.linspace(0.0, peak, points)
    codes, params = kernel.pack_terms(element.terms())
    states = kernel.initial_states(codes, params)
    for _ in range(3):
        out = [-kernel.continued(codes, params, states, -x, np.zeros(points), 1e5) for x in (rise, rise[::-1])]
    return rise, out[0], out[1][::-1]


def flat_end_curve(travels: tuple[float, ...], values: tuple[float, ...], flat_last: bool) -> CubicHermiteSpline:
    """Return the curve of the elements from scipy's parts: monotone slopes, none at the first (and last) point."""
    slopes = PchipInterpolator(travels, values).derivative()(np.array(travels))
    slopes[0] = 0.0
    if flat_last:
        slopes[-1] = 0.0
    return CubicHermiteSpline(travels, values, slopes)


def test_static_branches_have_the_curve_as_mean_and_the_height_between() -> None:
    # J6: with a steep Dahl slope (transition of 0.2 mm), away from the ends, within 1e-6 of the height
    steep = BUMPER.replace(lowest_slope=5e6, highest_slope=5e6)
    travel, going_in, coming_out = slow_loop(steep, 0.07)
    mean = flat_end_curve(BUMPER.travels, BUMPER.forces, False)(travel)
    height = flat_end_curve(BUMPER.travels, BUMPER.heights, True)(travel)
    middle = (travel > 0.01) & (travel < 0.065)
    assert np.max(np.abs(0.5 * (going_in + coming_out) - mean)[middle] / height[middle]) < 1e-6
    assert np.max(np.abs(going_in - coming_out - height)[middle] / height[middle]) < 1e-6


def test_static_curve_is_smooth_and_silent_out_of_contact() -> None:
    # J6: C1 at contact and between the points
    x = np.linspace(-0.01, 0.08, 90_001)
    f = np.array([BUMPER.static_force(float(u)) for u in x[::30]])
    assert np.all(f[x[::30] <= 0] == 0.0)
    assert np.all(np.diff(f) >= 0.0)
    slope = np.diff(f) / (30e-6)
    # no jump of the slope: it changes by less than 3 % of the largest from one 30 um step to the next
    assert np.max(np.abs(np.diff(slope))) < 0.03 * np.max(slope)


def test_modified_dahl_saturates_at_half_the_height() -> None:
    # J7: +-w(x)/2, the loop is w(x) high
    for friction, tolerance in ((FRICTION, 0.05), (FRICTION.replace(lowest_slope=5e6, highest_slope=5e6), 1e-6)):
        travel, going_in, coming_out = slow_loop(friction, 0.07)
        height = flat_end_curve(FRICTION.travels, FRICTION.heights, True)(travel)
        assert np.all(np.abs(going_in) <= 0.5 * height * (1 + 1e-12))
        assert np.all(np.abs(coming_out) <= 0.5 * height * (1 + 1e-12))
        middle = (travel > 0.035) & (travel < 0.055)
        assert np.max(np.abs(going_in - coming_out - height)[middle] / height[middle]) < tolerance


def test_modified_dahl_against_its_differential_equation() -> None:
    # J7: (3)-(5) by DOP853 between reversals; 0.02 ms steps, 2e-5 of the largest force
    w = flat_end_curve(FRICTION.travels, FRICTION.heights, True)
    reference = float(w(0.07))

    def rate(x: float, y: Array, s: float) -> Array:
        share = max(float(w(min(max(x, 0.0), 0.07))), 0.0) / reference
        sigma = 30e3 + share**0.8 * (500e3 - 30e3)
        return np.asarray(sigma * (1.0 - s * y / (reference / 2)))

    corners = [0.0, 0.06, 0.02, 0.065, 0.04, 0.05, 0.01]
    state, oracle, path = 0.0, [], []
    for a, b in itertools.pairwise(corners):
        grid = np.linspace(a, b, 2001)
        s = float(np.sign(b - a))
        run = solve_ivp(rate, (a, b), [state], args=(s,), t_eval=grid, method="DOP853", rtol=1e-10, atol=1e-9, max_step=1e-3)
        state = float(run.y[0, -1])
        oracle.append(run.y[0] * w(grid) / reference)
        path.append(grid)
    x, expected = np.concatenate(path), np.concatenate(oracle)
    push = -FRICTION.response(np.arange(x.size) * 1e-3, -x)
    assert np.max(np.abs(push - expected)) <= 2e-5 * np.max(np.abs(expected))


@pytest.mark.parametrize("step_m", [1e-5, 1e-3, 0.02, 0.5])
def test_exact_dahl_step_is_stable_for_every_step(step_m: float) -> None:
    # J7: no step, however long, takes the force past its limit
    for element, limit in ((Dahl(900.0, 500e3), 900.0), (FRICTION, 900.0)):
        codes, params = kernel.pack_terms(element.terms())
        states = kernel.initial_states(codes, params)
        x = 0.0
        for k in range(200):
            x += step_m * (-1.0 if (k // 7) % 2 else 1.0)
            assert abs(kernel.terms_commit(codes, params, states, -x, 0.0, 1e-3)) <= limit * (1 + 1e-12)


# --- J8, J11 -------------------------------------------------------------------------------------------------------


def test_contact_cell_is_silent_before_and_smooth_through_contact() -> None:
    # J8: no force below CP - p, value and slope continuous at CP +- p
    cell = ContactMaxwell(stiffness=9e3, corner=30.0, contact_point=0.018, entry=0.003)
    t = np.arange(0, 1.0, 1e-4)
    x = -0.0149 * np.sin(2 * np.pi * 3 * t) ** 2
    assert np.all(cell.response(t, x) == 0.0)
    for edge, slope in ((0.015, 0.0), (0.021, 1.0)):
        below, above = (penetration(-(edge + d), -1.0, 0.018, 0.003) for d in (-1e-9, 1e-9))
        assert abs(above - below) <= 2.1e-9
        for d in (-1e-9, 0.0, 1e-9):
            assert engagement(-(edge + d), -1.0, 0.018, 0.003) == pytest.approx(slope, abs=1e-6)


def test_contact_cell_pushes_only_and_forgets() -> None:
    # J8: compression only; after each load event the next one starts from nothing
    cell = ContactMaxwell(stiffness=9e3, corner=30.0, contact_point=0.018, entry=0.003)
    t = np.arange(0, 2.0, 1e-4)
    x = 0.04 * np.sin(2 * np.pi * t)
    force = cell.response(t, x)
    assert np.all(force <= 0.0)
    assert np.min(force) < -20.0
    first, second = force[5000:10000], force[15000:20000]
    assert np.max(np.abs(first - second)) <= 1e-9 * np.max(np.abs(force))


def test_the_cubic_coefficient_of_the_entry_is_zero() -> None:
    # J11: value and slope 0 at CP - p, value p and slope 1 at CP + p
    p, point = 0.003, 0.018
    a, b = point - p, point + p
    system = np.array([[1, a, a**2, a**3], [0, 1, 2 * a, 3 * a**2], [1, b, b**2, b**3], [0, 1, 2 * b, 3 * b**2]])
    coefficients = np.linalg.solve(system, [0.0, 0.0, p, 1.0])
    assert abs(coefficients[3]) * p**2 < 1e-6 * abs(coefficients[2]) * p
    for x in np.linspace(a, b, 17):
        assert penetration(-x, -1.0, point, p) == pytest.approx(float(np.polyval(coefficients[::-1], x)), abs=1e-9)


# --- J9, J10 -------------------------------------------------------------------------------------------------------


def rms_ratio(error: Array, signal: Array) -> float:
    return float(np.sqrt(np.mean(error**2) / np.mean(signal**2)))


@pytest.mark.parametrize("product", [0.02, 0.1, 0.5, 2.0, 5.0])
def test_bilinear_and_exact_step_against_the_analytic_sine(product: float) -> None:
    # J9: 5 Hz at 1 ms, second half of the record (the transient of Omega T = 0.02 has gone), rms over rms. The bilinear map
    # takes w to (2 / T) tan(w T / 2): off by (w T)^2 / 12 = 8.2e-5 in frequency; 4e-5 to 8e-5 in the document
    h, k = 1e-3, 20e3
    corner, w = product / h, 2 * np.pi * 5.0
    t = np.arange(0, 4.0, h)
    analytic = np.imag(k * 1j * w / (corner + 1j * w) * 1e-3 * np.exp(1j * w * t))
    late = slice(t.size // 2, None)
    x = 1e-3 * np.sin(w * t)
    bilinear = rms_ratio((bilinear_response(x, h, k, corner) - analytic)[late], analytic[late])
    assert 4e-5 < bilinear < 1.01 * (w * h) ** 2 / 12
    # the exact step takes the deflection as a polygon: its rate is late by at most half a step, w T / 2 of the force
    exact = rms_ratio((Maxwell(k, k / corner).response(t, x) - analytic)[late], analytic[late])
    assert exact < 1.01 * w * h / 2
    # the transcribed sign of (14), +a, is 0.99 / 0.95 / 0.75 off at 0.02 / 0.1 / 0.5 and invisible at 2, where a = 0
    a, b = (product - 2) / (product + 2), 2 * k / (product + 2)
    wrong = np.zeros(t.size)
    for i in range(1, t.size):
        wrong[i] = a * wrong[i - 1] + b * (x[i] - x[i - 1])
    error = rms_ratio((wrong - analytic)[late], analytic[late])
    printed = {0.02: 0.99, 0.1: 0.95, 0.5: 0.75}
    if product in printed:
        assert error == pytest.approx(printed[product], abs=0.005)
    if product == 2.0:
        assert error < 1e-4


def explicit_euler(cell: Maxwell, x: Array, h: float) -> Array:
    s, found = cell.initial(), [0.0]
    for k in range(x.size - 1):
        s = s + h * cell.rate(s, x[k], (x[k + 1] - x[k]) / h)
        found.append(float(s[0]))
    return np.array(found)


def test_explicit_euler_bound_of_a_maxwell_cell() -> None:
    # J10: at 1 ms stable below 2000 rad/s. At 2.0 the start-up error (as large as the force) alternates in sign for ever and
    # never fades: sqrt(2) of the force's rms, the 1.4 of the document; at 5 not a number. Below, at 0.5, the rate is early by
    # half a step once the start has passed: w T / 2 = 1.6 %
    h, k, w = 1e-3, 20e3, 2 * np.pi * 5.0
    t = np.arange(0, 2.0, h)
    x = 1e-3 * np.sin(w * t)
    late = slice(t.size // 2, None)
    errors = {}
    for product in (0.5, 2.0, 5.0):
        cell = Maxwell(k, k * h / product)
        analytic = np.imag(k * 1j * w / (product / h + 1j * w) * 1e-3 * np.exp(1j * w * t))
        with np.errstate(over="ignore", invalid="ignore"):
            errors[product] = rms_ratio((explicit_euler(cell, x, h) - analytic)[late], analytic[late])
        assert largest_explicit_step(cell, 0.0) == pytest.approx(2.0 * h / product)
        assert rms_ratio((cell.response(t, x) - analytic)[late], analytic[late]) < 1.01 * w * h / 2
    assert errors[0.5] < 1.01 * w * h / 2
    assert errors[2.0] == pytest.approx(np.sqrt(2.0), abs=0.005)
    assert np.isnan(errors[5.0])
    with pytest.raises(ConfigurationError, match="take a step below") as caught:
        require_explicit_step(Maxwell(k, k / 5000.0), h, 0.0)
    assert "5000 1/s" in str(caught.value)
    assert "0.001 s" in str(caught.value)
    require_explicit_step(Maxwell(k, k / 1900.0), h, 0.0)


def test_explicit_dahl_overshoots_from_one_and_diverges_from_two() -> None:
    # J10: sigma v T / f_c: 500 N/mm, 900 N, 1 ms: 2 m/s gives 1.11 (overshoots by 11 %), 4 m/s gives 2.22 (diverges)
    dahl, h = Dahl(900.0, 500e3), 1e-3
    peaks = {}
    for speed in (1.0, 2.0, 4.0):
        s, worst = dahl.initial(), 0.0
        for _ in range(100):
            s = s + h * 500e3 * (1.0 - s / 900.0) * speed
            worst = max(worst, abs(float(s[0])))
        peaks[speed] = worst / 900.0
    assert peaks[1.0] <= 1.0 + 1e-12
    assert peaks[2.0] == pytest.approx(1.11, abs=0.005)
    assert peaks[4.0] > 1e3
    assert dahl.fastest_rate(4.0) * h == pytest.approx(2.22, abs=0.005)
    with pytest.raises(ConfigurationError, match=r"dahl.*4 m/s"):
        require_explicit_step(dahl, h, 4.0)
    require_explicit_step(dahl, h, 2.0)


# --- J14 (evaluation) ----------------------------------------------------------------------------------------------


def test_discrete_local_model_becomes_continuous() -> None:
    # (19)-(25): same response at low frequency, same final value of the offset, pole by the bilinear map
    a, inputs, offset, h = 0.95, ((4000.0, -3900.0), (1.3, -1.25)), 7.0, 1e-3
    pole, gains, final = continuous_gains(a, inputs, offset, h)
    assert pole == pytest.approx(2 / h * 0.05 / 1.95)
    assert final == pytest.approx(7.0 / 0.05)
    for w in (0.5, 5.0, 50.0):
        z = np.exp(1j * w * h)
        for (b0, b1), (d, c) in zip(inputs, gains):
            discrete = (b0 + b1 / z) / (1 - a / z)
            continuous = d + c / (1j * w + pole)
            assert abs(continuous / discrete - 1) < (w * h) ** 2
    with pytest.raises(ValueError, match="not stable"):
        continuous_gains(1.0, inputs, offset, h)


def test_network_against_its_differential_equation() -> None:
    # states by DOP853, validity and outputs by hand; 0.25 ms, 1e-5 of the largest force
    net = LocalLinearNetwork.example()
    curve = flat_end_curve(net.travels, net.forces, False)

    def travel(t: float) -> tuple[float, float]:
        return 0.035 - 0.03 * np.cos(2 * np.pi * 2 * t), 0.03 * 4 * np.pi * np.sin(2 * np.pi * 2 * t)

    def drive(t: float) -> Array:
        u, _ = travel(t)
        return np.array(net.travel_inputs) * u + np.array(net.force_inputs) * float(curve(u))

    poles = np.array(net.poles)
    h = 2.5e-4
    t = np.arange(0, 1.0, h)
    run = solve_ivp(lambda s, w: drive(s) - poles * w, (0, t[-1]), drive(0.0) / poles, method="DOP853", t_eval=t, rtol=1e-10,
                    atol=1e-8, max_step=1e-3)
    expected = []
    for k, s in enumerate(t):
        u, v = travel(s)
        z1, z2 = u / 0.07, (v + 2.0) / 4.0
        mu = np.exp(-0.5 * (((z1 - np.array(net.travel_centres)) / np.array(net.travel_widths)) ** 2
                            + ((z2 - np.array(net.rate_centres)) / np.array(net.rate_widths)) ** 2))
        y = np.array(net.offsets) + run.y[:, k] + np.array(net.travel_gains) * u + np.array(net.force_gains) * float(curve(u))
        expected.append(-mu @ y / mu.sum())
    u, v = np.array([travel(s) for s in t]).T
    codes, params = kernel.pack_terms(net.terms())
    force = kernel.response(codes, params, -u, -v, h)
    assert np.max(np.abs(force - expected)) <= 1e-5 * np.max(np.abs(expected))


def test_network_starts_from_a_measured_force() -> None:
    # (26): at rest with the force of rest nothing moves; with another force the states meet it and decay little
    net = LocalLinearNetwork.example()
    x = -0.03
    rest = net.consistent_state(x, 0.0)
    steady = net.rate(rest * 0.0, x, 0.0) / np.array(net.poles)
    at_rest = net.consistent_state(x, net.force(steady, x, 0.0))
    assert at_rest == pytest.approx(steady, rel=1e-9)
    assert np.max(np.abs(net.rate(at_rest, x, 0.0))) < 1e-6 * np.max(np.abs(steady * net.poles))
    off = net.force(steady, x, 0.0) - 50.0
    # the compromise of least squares moves the force towards the measured one
    moved = net.force(net.consistent_state(x, off), x, 0.0)
    assert off <= moved < net.force(steady, x, 0.0)


def test_network_far_outside_the_trained_range_stays_finite() -> None:
    net = LocalLinearNetwork.example()
    for x, v in ((-5.0, 80.0), (5.0, -80.0)):
        assert np.sum(net.validity(x, v)) == pytest.approx(1.0)
        codes, params = kernel.pack_terms(net.terms())
        states = kernel.initial_states(codes, params)
        assert np.isfinite(kernel.terms_force(codes, params, states, x, v, 1e-3))


def test_network_of_many_models_gets_enough_memory() -> None:
    net = LocalLinearNetwork.example()
    many = LocalLinearNetwork(**{
        **{f: getattr(net, f) for f in ("travels", "forces", "lowest_travel", "highest_travel", "lowest_rate", "highest_rate")},
        **{f: getattr(net, f) * 7 for f in (
            "travel_centres", "rate_centres", "travel_widths", "rate_widths", "poles", "offsets", "travel_gains",
            "travel_inputs", "force_gains", "force_inputs")},
    })
    codes, params = kernel.pack_terms(many.terms())
    assert kernel.initial_states(codes, params).shape[1] >= 2 + 21
    t = np.arange(0, 0.5, 1e-3)
    x = -0.03 * np.sin(2 * np.pi * 2 * t) ** 2
    # seven copies of each model weigh as much as one
    assert many.response(t, x) == pytest.approx(net.response(t, x), rel=1e-9)
