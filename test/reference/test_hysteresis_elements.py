# Copyright 2026 ride_estimation contributors
"""Bouc-Wen, return points and fractional damping against closed forms and their own differential equations (row 1-23)."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import gamma

from ride_estimation.elements import terms as kernel
from ride_estimation.elements.base import Array
from ride_estimation.elements.bouc_wen import BoucWen
from ride_estimation.elements.dahl import Dahl
from ride_estimation.elements.fractional import Fractional
from ride_estimation.elements.harmonic import loop_loss, steady_loop
from ride_estimation.elements.kernels_hysteresis import DEPTH
from ride_estimation.elements.return_point_friction import ReturnPointFriction
from ride_estimation.elements.stability import largest_explicit_step
from ride_estimation.errors import ConfigurationError

T = np.arange(3000) * 1e-3
WALK = np.cumsum(np.random.default_rng(2).normal(0, 3e-5, 3000))


def test_bouc_wen_with_exponent_one_and_no_second_slope_is_dahl() -> None:
    dahl, bouc = Dahl(60.0, 240e3), BoucWen(60.0, 240e3, 1.0, 1.0)
    # Runge-Kutta at a tenth of the rate: 1e-7 of the limit per unit of stroke
    assert np.max(np.abs(dahl.response(T, WALK) - bouc.response(T, WALK))) < 1e-6 * 60.0
    for amplitude in (1e-5, 2.5e-4, 3e-3):
        assert bouc.loss_energy(1.0, amplitude) == pytest.approx(dahl.loss_energy(1.0, amplitude), rel=1e-10)


def test_bouc_wen_of_exponent_two_loads_as_a_hyperbolic_tangent() -> None:
    # virgin loading 1 - w^2: w = tanh(tau); with b = 1/2 unloading runs along k until the force is zero
    bouc = BoucWen(80.0, 40e3)
    x = np.linspace(0, 5e-3, 200)
    assert bouc.response(T[:200], x) == pytest.approx(80.0 * np.tanh(40e3 * x / 80.0), abs=80.0 * 1e-6)
    back = x[-1] - np.linspace(0, 0.9 * 80.0 / 40e3, 50)
    force = bouc.response(T[:250], np.concatenate([x, back]))[200:]
    assert force - force[0] == pytest.approx(40e3 * (back - back[0]), abs=80.0 * 1e-6)


def test_sharp_bouc_wen_is_a_spring_and_a_dry_slider() -> None:
    # n = 20 against n -> infinity: W = 4 f (A - f / k); the rounded corner takes about 1/n of the corner's f^2 / k
    bouc = BoucWen(80.0, 40e3, 20.0)
    for amplitude in (4e-3, 10e-3):
        exact = 4 * 80.0 * (amplitude - 80.0 / 40e3)
        assert bouc.loss_energy(1.0, amplitude) == pytest.approx(exact, abs=4 * 80.0**2 / 40e3 / 20.0)
    # without sliding there is no loss
    assert bouc.loss_energy(1.0, 1.5e-3) < 1e-3 * 4 * 80.0 * 1.5e-3


@pytest.mark.parametrize(("n", "b"), [(1.0, 0.5), (1.5, 0.7), (2.0, 0.5), (4.0, 2.0), (8.0, 5.0)])
def test_bouc_wen_loss_of_a_steady_loop(n: float, b: float) -> None:
    # strokes of the equation itself by DOP853; the steady end force by root search: 1e-8
    f, k, amplitude = 80.0, 40e3, 4e-3

    def stroke(w0: float) -> tuple[float, float]:
        def slope(_: float, y: Array) -> list[float]:
            room = 1.0 - abs(y[0]) ** n * (b * math.copysign(1.0, y[0]) + 1.0 - b)
            return [k / f * room, f * y[0]]

        found = solve_ivp(slope, (0, 2 * amplitude), [w0, 0.0], method="DOP853", rtol=1e-12, atol=1e-14, max_step=2e-5)
        return float(found.y[0, -1]), float(found.y[1, -1])

    end = brentq(lambda w: stroke(-w)[0] - w, 0.0, 1.0, xtol=1e-13)
    expected = 2.0 * stroke(-end)[1]
    bouc = BoucWen(f, k, n, b)
    assert bouc.loss_energy(1.0, amplitude) == pytest.approx(expected, rel=1e-8)
    assert loop_loss(*steady_loop(bouc, 1.0, amplitude)) == pytest.approx(expected, rel=1e-6)


def test_bouc_wen_outside_its_stable_range_is_refused() -> None:
    # b < 1/2 is |gamma| > beta: the law yields energy
    with pytest.raises(ConfigurationError, match=r"share: 0.4 1 is outside 0.5"):
        BoucWen(80.0, 40e3, 2.0, 0.4)
    with pytest.raises(ConfigurationError, match="exponent"):
        BoucWen(80.0, 40e3, 0.5)
    bouc = BoucWen(80.0, 40e3, 4.0, 2.0)
    # explicit Euler of z near its limit: n k v / f times 2 b - 1, 2 over it
    assert largest_explicit_step(bouc, 0.5) == pytest.approx(2.0 / (4.0 * 3.0 * 40e3 * 0.5 / 80.0))
    # the exact step has no bound: half a metre per step
    codes, params = kernel.pack_terms(bouc.terms())
    states = kernel.initial_states(codes, params)
    for k in range(50):
        assert abs(kernel.terms_commit(codes, params, states, 0.5 * (-1.0) ** k, 0.0, 1e-3)) <= 80.0


def test_closed_loops_are_forgotten_and_nested_ones_come_back() -> None:
    # into three nested loops and out again: the way on is that of the motion without them
    law = ReturnPointFriction(60.0, 0.25e-3)
    plain = np.array([0.0, 1.0, -0.6, 0.9])
    nested = np.array([0.0, 1.0, -0.6, 0.4, -0.2, 0.3, -0.1, 0.2, -0.5, 0.1, 0.9])

    def end(points: Array) -> float:
        x = 1e-3 * np.concatenate([np.linspace(a, b, 400) for a, b in itertools.pairwise(points)])
        return float(law.response(np.arange(x.size) * 1e-3, x)[-1])

    assert end(nested) == pytest.approx(end(plain), rel=1e-12)
    # beyond the farthest point ever reached it is the first loading again
    assert end(np.array([*nested, -0.3, 1.5])) == pytest.approx(60.0 * 1.5 / 1.75, rel=1e-12)
    # Masing: the branch after a turn is the first loading at twice its size
    assert end(np.array([0.0, 1.0, 0.5])) == pytest.approx(60.0 * 1.0 / 1.25 - 2 * 60.0 * 0.25 / 0.5, rel=1e-12)


def test_more_loops_than_fit_into_the_memory_cost_little() -> None:
    # nested reversals three times as many as are kept, each 3 % inside the last, then out again through larger and larger
    # strokes, against springs with dry sliders, which have room for any number
    law = ReturnPointFriction(60.0, 0.25e-3)
    turns = 1e-3 * np.array([(-1.0) ** k * 0.97**k for k in range(3 * DEPTH)])
    points = np.concatenate([[0.0], turns, turns[::-1], [1.2e-3]])
    x = np.concatenate([[0.0], *(np.linspace(a, b, 60)[1:] for a, b in itertools.pairwise(points))])
    force = law.response(np.arange(x.size) * 1e-3, x)
    edges = 0.25e-3 * np.concatenate([[0.0], np.geomspace(1e-3, 1e4, 2000)])
    stiffness, strokes = -np.diff(60.0 * 0.25e-3 / (0.25e-3 + edges) ** 2), 0.5 * (edges[1:] + edges[:-1])
    stretch, expected = np.zeros(strokes.size), np.zeros(x.size)
    for k in range(1, x.size):
        stretch = np.clip(stretch + x[k] - x[k - 1], -strokes, strokes)
        expected[k] = stiffness @ stretch
    assert np.max(np.abs(force)) <= 60.0
    # what is forgotten is at most one loop in three: the force then is that of a turn up to 10 % of the stroke away
    assert np.sqrt(np.mean((force - expected) ** 2)) < 0.01 * 60.0
    assert force[-1] == pytest.approx(60.0 * 1.2 / 1.45, rel=1e-12)


@pytest.mark.parametrize("order", [0.05, 0.2, 0.5, 0.8, 0.95])
@pytest.mark.parametrize("band", [(0.1, 300.0), (1.0, 2.0), (1e-3, 1e4)])
def test_fractional_law_inside_its_band(order: float, band: tuple[float, float]) -> None:
    # 0.1 % in magnitude and angle together; the angle is alpha pi / 2
    element = Fractional(1e4, order, 1.0, *band)
    assert element.band_error() < 1.05e-3
    middle = math.sqrt(band[0] * band[1])
    value = element.dynamic_stiffness(middle, 1e-3)
    assert value is not None
    assert np.angle(value) == pytest.approx(0.5 * math.pi * order, abs=1.1e-3)
    assert abs(value) == pytest.approx(1e4 * middle**order, rel=1.1e-3)
    loss = element.loss_energy(middle, 1e-3)
    assert loss == pytest.approx(math.pi * 1e-6 * 1e4 * middle**order * math.sin(0.5 * math.pi * order), rel=1e-2)


def test_fractional_relaxation_is_a_power_of_time() -> None:
    # after a step F = k x (omega_ref t)^-alpha / Gamma(1 - alpha); 0.3 % for times well inside the band
    element = Fractional(150e3, 0.3, 2.0, 0.01, 1e3)
    h = 1e-3
    t = np.arange(10_000) * h
    x = np.where(t > 0.0, 1e-3, 0.0)
    # the step takes one sample: it happened on average half a sample before
    expected = 150.0 * (2.0 * (t - 0.5 * h)[50:]) ** -0.3 / gamma(0.7)
    codes, params = kernel.pack_terms(element.terms())
    force = kernel.response(codes, params, x, np.zeros_like(x), h)[50:]
    assert np.max(np.abs(force / expected - 1.0)) < 3e-3


def test_fractional_refuses_an_empty_band_and_impossible_cells() -> None:
    with pytest.raises(ConfigurationError, match="twice lowest_rad_per_s"):
        Fractional(1e4, 0.3, 1.0, 10.0, 11.0)
    with pytest.raises(ConfigurationError, match="impossible cells"):
        Fractional(1e10, 0.9, 1e-3, 1.0, 10.0)
