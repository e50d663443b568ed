# Copyright 2026 ride_estimation contributors
"""Document 003: bushing laws against brute force that shares no formula with the elements (items B1-B9)."""

from __future__ import annotations

import functools
import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.signal import lfilter

from ride_estimation.elements import terms as kernel
from ride_estimation.elements.base import Array
from ride_estimation.elements.berg import Berg
from ride_estimation.elements.berg_friction import BergFriction
from ride_estimation.elements.harmonic import loop_loss, loop_stiffness
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.maxwell import Maxwell
from ride_estimation.elements.modified_berg import ModifiedBerg
from ride_estimation.elements.return_point_friction import ReturnPointFriction
from ride_estimation.excitation.sigmoid_chirp import SigmoidChirp

# document 003, Table 1, SI
TABLE_1_KV = KelvinVoigt(60e3, 2387.0)
TABLE_1_BERG = Berg(stiffness=60e3, cell_stiffness=60e3, cell_damping=2387.0, friction=60.0, half_stroke=0.25e-3)
TABLE_1_MODIFIED = ModifiedBerg(
    stiffness=60e3, cubic=-0.15e9, cell_1_stiffness=30e3, cell_1_damping=2387.0, cell_2_stiffness=30e3, cell_2_damping=238.7,
    friction=60.0, half_stroke=0.25e-3,
)
TABLE_3_MODIFIED = ModifiedBerg.example()
AMPLITUDES = 0.02e-3 * 2.0 ** np.arange(10)
FREQUENCIES = 0.04 * 10.0 ** (0.3 * np.arange(11))


def test_kelvin_voigt_stiffness_and_loss_of_a_sine() -> None:
    # B1, B2: K = sqrt(k^2 + w^2 c^2), W = pi w c A^2, to 1e-9
    for frequency, amplitude in ((0.1, 5e-3), (4.0, 1e-3), (40.0, 0.05e-3)):
        w = 2 * np.pi * frequency
        phase = 2 * np.pi * np.arange(256) / 256
        x, v = amplitude * np.sin(phase), amplitude * w * np.cos(phase)
        force = np.array([TABLE_1_KV.force(np.zeros(0), a, b) for a, b in zip(x, v)])
        stiffness, loss = np.sqrt(60e3**2 + (w * 2387.0) ** 2), np.pi * w * 2387.0 * amplitude**2
        assert loop_stiffness(x, force) == pytest.approx(stiffness, rel=1e-9)
        assert loop_loss(x, force) == pytest.approx(loss, rel=1e-9)
        assert abs(TABLE_1_KV.dynamic_stiffness(w, amplitude)) == pytest.approx(stiffness, rel=1e-12)
        assert TABLE_1_KV.loss_energy(w, amplitude) == pytest.approx(loss, rel=1e-12)


def test_maxwell_step_is_exact_for_straight_deflection() -> None:
    # B3: polygon through random points, against DOP853 from corner to corner, 1e-10 of the largest force
    cell = Maxwell(20e3, 159.0)
    rng = np.random.default_rng(2)
    x, h = rng.normal(0, 1e-3, 60), 4e-3
    codes, params = kernel.pack_terms(cell.terms())
    force = kernel.response(codes, params, x, np.zeros(60), h)
    m, oracle = 0.0, [0.0]
    for k in range(59):
        v = (x[k + 1] - x[k]) / h
        run = solve_ivp(lambda _, y, v=v: -cell.corner * y + 20e3 * v, (0, h), [m], method="DOP853", rtol=1e-13, atol=1e-13)
        m = float(run.y[0, -1])
        oracle.append(m)
    assert np.max(np.abs(force - oracle)) <= 1e-10 * np.max(np.abs(oracle))


def test_runge_kutta_agrees_with_the_exact_step_on_the_chirp() -> None:
    # B3: both at 1 kHz over the whole chirp taken as a polygon; 4.4e-6 of rms in the prototype, 1e-5 allowed
    cell, h = Maxwell(20e3, 159.0), 1e-3
    t, x = SigmoidChirp().signal(1.0 / h)
    z = cell.corner * h
    # classical Runge-Kutta of m' = -Omega m + k v at constant v, written as one recursion
    decay = 1 - z + z**2 / 2 - z**3 / 6 + z**4 / 24
    gain = 20e3 * (1 - z / 2 + z**2 / 6 - z**3 / 24)
    runge_kutta = lfilter([gain], [1.0, -decay], np.diff(x, prepend=x[0]))
    exact = cell.response(t, x)
    assert np.sqrt(np.mean((runge_kutta - exact) ** 2)) <= 1e-5 * np.sqrt(np.mean(exact**2))


def berg_ode(friction: BergFriction, corners: Array, samples: int) -> Array:
    """Return the friction over strokes between corners from the rate form dF/dx, samples per stroke."""
    f, x2 = friction.friction, friction.half_stroke
    force, found = 0.0, []
    for a, b in itertools.pairwise(corners):
        s, start = np.sign(b - a), force
        grid = np.linspace(a, b, samples)
        run = solve_ivp(
            lambda _, y, s=s, start=start: (f / x2) * ((f - s * y) / (f - s * start)) ** 2, (a, b), [force], t_eval=grid,
            method="DOP853", rtol=1e-12, atol=1e-12,
        )
        found.append(run.y[0])
        force = float(run.y[0, -1])
    return np.concatenate(found)


def test_berg_friction_against_its_rate_form() -> None:
    # B4: dF/dx = (f / x2) ((f - s F) / (f - s F_s))^2; 1e-8 of f_max
    friction = BergFriction(81.73, 0.766e-3)
    corners = np.concatenate([[0.0], np.random.default_rng(4).normal(0, 1e-3, 30)])
    corners = corners[np.concatenate([[True], np.diff(np.sign(np.diff(corners, prepend=corners[0] - 1))) != 0])]
    turning = [corners[0]]
    for value in corners[1:]:
        if len(turning) > 1 and (value - turning[-1]) * (turning[-1] - turning[-2]) > 0:
            turning[-1] = value
        else:
            turning.append(value)
    oracle = berg_ode(friction, np.array(turning), 40)
    x = np.concatenate([np.linspace(a, b, 40) for a, b in itertools.pairwise(turning)])
    force = friction.response(np.arange(x.size) * 1e-3, x)
    assert np.max(np.abs(force - oracle)) <= 1e-8 * 81.73


def test_berg_slope_after_every_reversal() -> None:
    # B4: f_max / x2 after each of 30 reversals, from the first 1e-5 of x2 of the way back
    friction = BergFriction(81.73, 0.766e-3)
    s = friction.initial()
    for target in np.random.default_rng(5).normal(0, 2e-3, 30):
        s = friction.commit(s, float(target), 0.0)
        step = -np.sign(target - s[3]) * 1e-5 * friction.half_stroke
        slope = (friction.force(s, float(target + step), 0.0) - friction.force(s, float(target), 0.0)) / step
        assert slope == pytest.approx(81.73 / 0.766e-3, rel=1e-4)


def test_berg_state_is_kept_only_at_reversals() -> None:
    # updating the turning point at every sample is another law (77 % off): a stroke in one step and in many is the same
    friction = BergFriction(60.0, 0.25e-3)
    one = friction.commit(friction.initial(), 1e-3, 0.0)
    many = friction.initial()
    for x in np.linspace(0, 1e-3, 50)[1:]:
        many = friction.commit(many, float(x), 0.0)
    assert friction.force(one, 1e-3, 0.0) == pytest.approx(friction.force(many, 1e-3, 0.0), rel=1e-12)
    # half of f_max after x2 from rest, 2/3 after 2 x2
    assert friction.force(friction.initial(), 0.25e-3, 0.0) == pytest.approx(30.0, rel=1e-12)
    assert friction.force(friction.initial(), -0.5e-3, 0.0) == pytest.approx(-40.0, rel=1e-12)


def steady_friction(f: float, x2: float, amplitude: float) -> tuple[float, complex]:
    """Return the force ratio at the turning points and F1/A of steady friction: numerical root, then quadrature."""

    def after_stroke(end: float) -> float:
        """Return the force at the end of a stroke of 2 A that starts at -end."""
        room = 1.0 + end / f
        return -end + 2 * amplitude / (x2 * room + 2 * amplitude) * f * room

    # alternate strokes of a steady cycle are mirror images
    end = brentq(lambda e: after_stroke(e) - e, 0.0, f, xtol=1e-15 * f, rtol=1e-15)
    room = 1.0 + end / f

    def rising(theta: float) -> float:
        d = amplitude * (1 - math.cos(theta))
        return -end + d / (x2 * room + d) * f * room

    # x = -A cos(theta), theta 0..pi rising; the falling half is its mirror image
    storage = -2 / math.pi * quad(lambda a: rising(a) * math.cos(a), 0, math.pi, epsabs=1e-14 * f, epsrel=1e-12, limit=400)[0]
    loss = 2 / math.pi * quad(lambda a: rising(a) * math.sin(a), 0, math.pi, epsabs=1e-14 * f, epsrel=1e-12, limit=400)[0]
    return end / f, complex(storage, loss) / amplitude


@functools.cache
def unit_maxwell(stiffness: float, damping: float, omega: float) -> complex:
    """Return F1/A of a Maxwell cell from its differential equation: periodic solution by shooting, harmonics as states."""
    corner = stiffness / damping

    def run(m0: float) -> Array:
        def rates(phase: float, y: Array) -> list[float]:
            m = y[0]
            return [
                (-corner * m + stiffness * omega * math.cos(phase)) / omega, m * math.sin(phase), m * math.cos(phase),
            ]

        found = solve_ivp(rates, (0, 2 * math.pi), [m0, 0, 0], method="DOP853", rtol=1e-12, atol=1e-12 * stiffness)
        return np.array(found.y[:, -1])

    zero, one = run(0.0), run(stiffness)
    start = zero[0] / (1.0 - (one[0] - zero[0]) / stiffness)
    _, a, b = run(start)
    return complex(a, b) / math.pi


@pytest.mark.parametrize("bushing", [TABLE_1_BERG, TABLE_1_MODIFIED, TABLE_3_MODIFIED], ids=["berg", "modified", "table 3"])
def test_stiffness_and_loss_at_110_points(bushing: Berg | ModifiedBerg) -> None:
    # B8: closed forms against brute force at 10 amplitudes x 11 frequencies, each within 1e-9
    friction = {a: steady_friction(bushing.friction, bushing.half_stroke, a)[1] for a in AMPLITUDES}
    if isinstance(bushing, Berg):
        cells, cubic = [(bushing.cell_stiffness, bushing.cell_damping)], 0.0
    else:
        cells = [(bushing.cell_1_stiffness, bushing.cell_1_damping), (bushing.cell_2_stiffness, bushing.cell_2_damping)]
        cubic = bushing.cubic
    phase = 2 * np.pi * np.arange(64) / 64
    for frequency in FREQUENCIES:
        w = 2 * np.pi * frequency
        viscous = sum(unit_maxwell(k, c, w) for k, c in cells)
        for a in AMPLITUDES:
            x = a * np.sin(phase)
            elastic = 2 / 64 * np.sum((bushing.stiffness * x + cubic * x**3) * np.sin(phase)) / a
            brute = elastic + viscous + friction[a]
            closed, loss = bushing.dynamic_stiffness(w, a), bushing.loss_energy(w, a)
            assert closed is not None
            assert loss is not None
            assert abs(closed) == pytest.approx(abs(brute), rel=1e-9)
            assert loss == pytest.approx(np.pi * a**2 * brute.imag, rel=1e-9)


def test_friction_closed_forms_over_nine_decades_of_amplitude() -> None:
    # B7: alpha and W_fr; small strokes must not lose digits to cancellation: W -> (8/3) f A^3 / x2^2
    friction = BergFriction(60.0, 0.25e-3)
    for ratio in (1e-3, 1e-2, 0.024, 0.026, 0.1, 1.0, 10.0, 1e3):
        a = ratio * friction.half_stroke
        alpha, brute = steady_friction(60.0, friction.half_stroke, a)
        assert friction.turning_ratio(a) == pytest.approx(alpha, rel=1e-9)
        assert friction.loss_energy(1.0, a) == pytest.approx(np.pi * a**2 * brute.imag, rel=1e-7)
        assert friction.dynamic_stiffness(1.0, a).real == pytest.approx(brute.real, rel=1e-9)
    for ratio in (1e-4, 1e-5, 1e-6):
        a = ratio * friction.half_stroke
        assert friction.loss_energy(1.0, a) == pytest.approx(8 / 3 * 60.0 * a**3 / friction.half_stroke**2, rel=10 * ratio)


def test_printed_formulas_are_not_used() -> None:
    # (12) with the root over everything depends on the unit of length; in mm it is more than half off
    printed_alpha = math.sqrt(0.25**2 + 1.0 + 6 * 0.25 * 1.0 - 0.25 - 1.0) / (2 * 0.25)
    assert abs(printed_alpha / BergFriction(60.0, 0.25e-3).turning_ratio(1e-3) - 1) > 0.5
    # (13) gives a lone Maxwell cell the same stiffness at every frequency; a cell has none at rest and k when fast
    cell = Maxwell(60e3, 2387.0)
    for w in (0.05, 2500.0):
        lam = math.hypot(w, cell.corner)
        assert math.hypot(60e3 * w / lam, 60e3 * cell.corner / lam) == pytest.approx(60e3, rel=1e-12)
    assert abs(cell.dynamic_stiffness(0.05, 1e-3)) < 0.002 * 60e3
    assert abs(cell.dynamic_stiffness(2500.0, 1e-3)) == pytest.approx(60e3, rel=1e-4)
    # (19) takes the secant k_e3 A^2 of the cubic; the first harmonic has 3/4 of it
    lifted = TABLE_1_MODIFIED.dynamic_stiffness(1.0, 2e-3), TABLE_1_MODIFIED.replace(cubic=0.0).dynamic_stiffness(1.0, 2e-3)
    assert lifted[0] is not None
    assert lifted[1] is not None
    assert (lifted[0] - lifted[1]).real == pytest.approx(0.75 * -0.15e9 * 4e-6, rel=1e-9)


def test_corner_frequencies_and_loss_peaks_of_table_1() -> None:
    # B9: 2.0 and 20.0 Hz for the printed dampings, not 4 and 40 Hz; the loss peaks lie at 2.60 and 15.4 Hz
    corners = [
        TABLE_1_MODIFIED.cell_1_stiffness / TABLE_1_MODIFIED.cell_1_damping / (2 * np.pi),
        TABLE_1_MODIFIED.cell_2_stiffness / TABLE_1_MODIFIED.cell_2_damping / (2 * np.pi),
    ]
    assert corners == pytest.approx([2.000, 20.00], rel=1e-3)
    assert TABLE_1_BERG.cell_stiffness / TABLE_1_BERG.cell_damping / (2 * np.pi) == pytest.approx(4.0005, rel=1e-4)
    frequencies = np.geomspace(0.3, 100.0, 4000)
    losses = np.array([TABLE_1_MODIFIED.loss_energy(2 * np.pi * f, 1e-3) for f in frequencies])
    inner = np.flatnonzero((losses[1:-1] > losses[:-2]) & (losses[1:-1] > losses[2:])) + 1
    assert frequencies[inner] == pytest.approx([2.60, 15.4], rel=5e-3)


def test_stiffness_falls_with_amplitude_and_rises_with_frequency() -> None:
    # Payne effect of friction, S-shaped rise of the viscous cells (Fig. 5)
    by_amplitude = [abs(TABLE_1_BERG.dynamic_stiffness(20.0, a)) for a in AMPLITUDES]  # type: ignore[arg-type]
    by_frequency = [abs(TABLE_1_BERG.dynamic_stiffness(2 * np.pi * f, 1e-3)) for f in FREQUENCIES]  # type: ignore[arg-type]
    assert np.all(np.diff(by_amplitude) < 0)
    assert np.all(np.diff(by_frequency) > 0)


def test_one_level_memory_lets_small_loops_creep() -> None:
    # twenty 0.2 mm loops at the end of a 3 mm stroke move the force by -31 % of f_max, one loop by -3 %; with return points no
    # number of loops moves it at all
    drift = {}
    for law in (BergFriction(81.73, 0.766e-3), ReturnPointFriction(81.73, 0.766e-3)):
        for loops in (1, 20):
            s = law.commit(law.commit(law.initial(), -1.5e-3, 0.0), 1.5e-3, 0.0)
            start = law.force(s, 1.5e-3, 0.0)
            for _ in range(loops):
                s = law.commit(law.commit(s, 1.3e-3, 0.0), 1.5e-3, 0.0)
            drift[law.KIND, loops] = (law.force(s, 1.5e-3, 0.0) - start) / 81.73
    assert drift["berg_friction", 1] == pytest.approx(-0.03, abs=0.005)
    assert drift["berg_friction", 20] == pytest.approx(-0.31, abs=0.005)
    assert drift["return_point_friction", 1] == 0.0
    assert drift["return_point_friction", 20] == 0.0
