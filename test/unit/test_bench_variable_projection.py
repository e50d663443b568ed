# Copyright 2026 ride_estimation contributors
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from ride_estimation.identification.bench import columns
from ride_estimation.identification.bench.columns import (
    FRICTION_BERG,
    FRICTION_DAHL,
    Layout,
    fused_gram,
    numpy_columns,
    numpy_gram,
)
from ride_estimation.identification.bench.reversals import find_motion
from ride_estimation.identification.bench.variable_projection import eliminate_offset, first_order, minimise, solve_linear

H = 2e-3


def signal(n=4000, seed=0):
    rng = np.random.default_rng(seed)
    f = np.fft.rfftfreq(n, H)
    x = np.fft.irfft((f > 0.3) * (f < 8.0) * np.exp(2j * np.pi * rng.random(f.size)), n)
    return 2e-3 * x / np.std(x)


LAYOUTS = [
    Layout(),
    Layout(viscous=True),
    Layout(cubic=True, viscous=True, friction=FRICTION_DAHL),
    Layout(cubic=True, cells=2, friction=FRICTION_BERG),
    Layout(cells=3),
]


def theta_of(layout):
    theta = list(np.log([3.0, 25.0, 90.0])[: layout.cells])
    return np.array([*theta, np.log(0.7e-3)] if layout.friction else theta)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("weighted", [False, True])
def test_fused_and_numpy_passes_give_the_same_matrix(layout, weighted):
    motion = find_motion(signal(), H)
    force = np.random.default_rng(1).standard_normal(motion.x.size)
    weight = (np.arange(motion.x.size) % 7 > 0).astype(float) if weighted else None
    a, b = (f(layout, motion, theta_of(layout), force, 3777, weight) for f in (fused_gram, numpy_gram))
    scale = np.sqrt(np.outer(np.diag(b), np.diag(b)))
    # relative to the columns' norms: rounding of a sum of 4000 products
    assert np.max(np.abs(a - b) / scale) < 1e-12


def test_a_small_step_needs_no_pass_over_the_data():
    layout, motion = LAYOUTS[3], find_motion(signal(), H)
    force = np.random.default_rng(1).standard_normal(motion.x.size)
    theta, step = theta_of(layout), np.array([2e-3, -3e-3, 1e-3])
    here, there = (eliminate_offset(numpy_gram(layout, motion, at, force, force.size)) for at in (theta, theta + step))
    moved = first_order(here, step, layout.linear, np.arange(layout.static, layout.linear))
    basis = slice(0, layout.linear)
    scale = np.sqrt(np.outer(np.diag(there), np.diag(there)))
    # the columns move by their sensitivities: what is left is of second order
    assert np.max(np.abs(moved - there)[basis, basis] / scale[basis, basis]) < 1e-5
    assert np.max(np.abs(here - there)[basis, basis] / scale[basis, basis]) > 1e-3
    assert np.max(np.abs(moved - there)[basis, -1] / scale[basis, -1]) < 1e-5


def test_means_keep_the_noise_of_all_samples_and_the_branches():
    motion = find_motion(signal(), H)
    few = motion.decimated(7)
    assert few.x == pytest.approx(motion.x[: few.x.size * 7].reshape(-1, 7).mean(axis=1), abs=1e-18)
    # a mean belongs to the branch in which its middle lies
    middle = np.arange(few.x.size) * 7 + 3
    expected = np.searchsorted(motion.starts, middle, side="right")
    assert np.array_equal(np.searchsorted(few.starts, np.arange(few.x.size), side="right"), expected)


@pytest.mark.parametrize("layout", [x for x in LAYOUTS if x.nonlinear])
def test_sensitivities_are_the_derivatives_of_the_columns(layout):
    motion, theta, step = find_motion(signal(), H), theta_of(layout), 1e-5
    found = numpy_columns(layout, motion, theta)
    for q in range(layout.nonlinear):
        up, down = theta.copy(), theta.copy()
        up[q] += step
        down[q] -= step
        central = (numpy_columns(layout, motion, up) - numpy_columns(layout, motion, down))[layout.static + q] / (2 * step)
        assert np.max(np.abs(found[layout.linear + q] - central)) < 1e-7 * np.max(np.abs(central)) + 1e-9 * np.max(
            np.abs(found[q])
        )


def test_maxwell_column_equals_a_differential_equation_solver():
    # B3: displacement linear between samples
    x, rate = signal(400), 40.0
    motion = find_motion(x, H)
    slopes = np.diff(x) / H
    m = [0.0]
    for k in range(x.size - 1):
        part = solve_ivp(lambda s, y, v=slopes[k]: -rate * y + v, (0.0, H), [m[-1]], method="DOP853", rtol=1e-12, atol=1e-18)
        m.append(part.y[0, -1])
    column = numpy_columns(Layout(spring=False, cells=1), motion, np.log([rate]))[0]
    assert np.max(np.abs(column - m)) < 1e-10 * np.max(np.abs(m))


@pytest.mark.parametrize(
    ("kind", "law"),
    [
        (FRICTION_BERG, None),
        (FRICTION_DAHL, lambda w, s, length: (1.0 - s * w) / length),
    ],
)
def test_friction_column_equals_its_differential_form(kind, law):
    # Berg: dF/dx = (1/x2) ((1 - s F)/(1 - s F_s))^2, F_s at the last reversal; Dahl: dF/dx = (1 - s F)/length
    x, length = signal(1500), 0.5e-3
    motion = find_motion(x, H)
    column = numpy_columns(Layout(spring=False, friction=kind), motion, np.log([length]))[0]
    w = start = 0.0
    sign = 0.0
    found = [0.0]
    for step in np.diff(x):
        s = 1.0 if step > 0 else -1.0
        if s != sign:
            sign, start = s, w
        for _ in range(200):  # second-order steps, 200 per sample
            d = step / 200

            def slope(value):
                return law(value, s, length) if law else ((1 - s * value) / (1 - s * start)) ** 2 / length  # noqa: B023

            w += d * slope(w + 0.5 * d * slope(w))
        found.append(w)
    # unit friction; 200 midpoint steps per sample
    assert np.max(np.abs(column - found)) < 2e-5


def test_search_reaches_what_a_general_solver_reaches():
    layout = Layout(cubic=True, cells=2, friction=FRICTION_BERG)
    motion = find_motion(signal(), H)
    truth, coefficients = theta_of(layout), np.array([1e5, 3e8, 2e4, 5e4, 60.0])
    clean = coefficients @ numpy_columns(layout, motion, truth)[:5]
    force = clean + 5.0 * np.random.default_rng(2).standard_normal(clean.size)
    lower, upper = truth - 3.0, truth + 3.0
    result = minimise(
        lambda th: eliminate_offset(columns.best_gram(layout, motion, th, force, force.size)),
        truth + np.array([0.8, -0.7, 0.5]),
        lower,
        upper,
        5,
        np.array([2, 3, 4]),
        np.zeros(5, dtype=bool),
    )
    assert result.converged

    def residual(p):
        model = p[:5] * coefficients @ numpy_columns(layout, motion, p[5:8])[:5]
        return model + p[8] - force

    general = least_squares(residual, np.concatenate([np.ones(5), truth, [0.0]]), x_scale="jac", xtol=1e-12, ftol=1e-12)
    assert result.cost == pytest.approx(2 * general.cost, rel=1e-8)
    # well below the standard deviations of about 0.02
    assert result.theta == pytest.approx(general.x[5:8], abs=2e-4)
    assert result.coefficients == pytest.approx(general.x[:5] * coefficients, rel=2e-4)


def test_bounded_linear_solution_is_the_constrained_optimum():
    rng = np.random.default_rng(3)
    for _ in range(50):
        design = rng.standard_normal((30, 5))
        target = rng.standard_normal(30)
        positive = np.array([False, True, True, True, True])
        found, at_zero = solve_linear(design.T @ design, design.T @ target, positive)
        assert np.all(found[1:] >= 0)
        gradient = design.T @ (design @ found - target)
        free = np.setdiff1d(np.arange(5), at_zero)
        assert np.max(np.abs(gradient[free])) < 1e-9
        assert np.all(gradient[list(at_zero)] > -1e-9)


def test_offset_elimination_equals_centred_columns():
    rng = np.random.default_rng(4)
    data = rng.standard_normal((4, 50)) + 3.0
    full = np.vstack([data[:3], np.ones(50), data[3:]])
    centred = data - data.mean(axis=1, keepdims=True)
    assert eliminate_offset(full @ full.T) == pytest.approx(centred @ centred.T, abs=1e-10)
