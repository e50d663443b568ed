# Copyright 2026 ride_estimation contributors
"""Each force law against an oracle that shares no code with it; every kind of the registry must have one."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from ride_estimation.elements import terms as kernel
from ride_estimation.elements.base import Array, ForceElement
from ride_estimation.elements.registry import kinds

DURATION = 0.8
H = 2e-4


def deflection(t: Array | float) -> Array:
    """Return a deflection that starts at rest and goes 45 mm into both directions."""
    t = np.asarray(t)
    return np.asarray(0.024 * (np.cos(2 * np.pi * 1.6 * t) - 1) + 0.028 * np.sin(2 * np.pi * 3.7 * t) ** 3)


def rate(t: Array | float) -> Array:
    a, b = 2 * np.pi * 1.6, 2 * np.pi * 3.7
    t = np.asarray(t)
    return np.asarray(-0.024 * a * np.sin(a * t) + 0.084 * b * np.sin(b * t) ** 2 * np.cos(b * t))


T = np.arange(0, DURATION, H)
X, V = deflection(T), rate(T)


def turning_times() -> Array:
    """Return the times at which the rate changes sign, from a fine grid and bisection, with both ends."""
    grid = np.linspace(0, DURATION, 40_001)[1:]
    v = rate(grid)
    found = [0.0]
    for k in np.flatnonzero(v[:-1] * v[1:] < 0):
        low, high = grid[k], grid[k + 1]
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if rate(middle) * rate(low) > 0 else (low, middle)
        found.append(0.5 * (low + high))
    return np.array([*found, DURATION])


def integrated(rates: Callable[[float, Array, float, float], list[float]], size: int = 1) -> Array:
    """Return states over T of an equation dy/dt = rates(t, y, s, y0) solved from turning point to turning point."""
    state, out = np.zeros(size), np.zeros((size, T.size))
    times = turning_times()
    for a, b in itertools.pairwise(times):
        s = float(np.sign(rate(0.5 * (a + b))))
        inside = (a <= T) & (b > T)
        run = solve_ivp(
            rates, (a, b), state, args=(s, state.copy()), method="DOP853", dense_output=True, rtol=1e-9, atol=1e-7, max_step=2e-3
        )
        out[:, inside] = run.sol(T[inside])
        state = run.y[:, -1]
    return out


def maxwell(k: float, c: float) -> Array:
    return integrated(lambda t, m, s, m0: [-k / c * m[0] + k * float(rate(t))])[0]


def berg_friction(f: float, x2: float) -> Array:
    def rates(t: float, y: Array, s: float, y0: Array) -> list[float]:
        room = (f - s * y[0]) / (f - s * y0[0])
        return [f / x2 * room**2 * float(rate(t))]

    return integrated(rates)[0]


def flat_curve(x: tuple[float, ...], y: tuple[float, ...], flat_last: bool) -> Callable[[Array], Array]:
    slopes = PchipInterpolator(x, y).derivative()(np.array(x))
    slopes[0] = 0.0
    slopes[-1] = 0.0 if flat_last else slopes[-1]
    spline = CubicHermiteSpline(x, y, slopes)

    def curve(u: Array) -> Array:
        inside = spline(np.clip(u, x[0], x[-1]))
        return np.asarray(inside + np.where(u > x[-1], (u - x[-1]) * slopes[-1], 0.0))

    return curve


def contact(x: Array, v: Array, side: float, gap: float, p: float, k: float, k3: float, c: float) -> Array:
    e = side * x - gap
    u = np.where(e > p, e, np.where(e > -p, (e + p) ** 2 / (4 * p) if p else 0.0, 0.0))
    slope = np.where(e > p, 1.0, np.where(e > -p, (e + p) / (2 * p) if p else 0.0, 0.0))
    return np.asarray(side * np.where(u > 0, np.maximum(k * u + k3 * u**3 + c * slope * side * v, 0.0), 0.0))


def contact_maxwell(k: float, corner: float, point: float, p: float) -> Array:
    def entered(t: float) -> tuple[float, float]:
        e = -float(deflection(t)) - point
        if e <= -p:
            return 0.0, 0.0
        return (1.0, (e + p) / (2 * p)) if e < p else (1.0, 1.0)

    def rates(t: float, m: Array, s: float, m0: Array) -> list[float]:
        inside, slope = entered(t)
        # out of contact the memory is wiped: a decay much faster than anything else
        return [-corner * m[0] - k * slope * float(rate(t)) if inside else -2e4 * m[0]]

    found = integrated(rates)[0]
    return np.asarray(np.where([entered(t)[0] > 0 for t in T], -np.maximum(found, 0.0), 0.0))


def weighted_dahl(e) -> Array:  # type: ignore[no-untyped-def]
    w = flat_curve(e.travels, e.heights, True)
    reference = float(w(np.array(e.reference_travel)))

    def rates(t: float, y: Array, s: float, y0: Array) -> list[float]:
        share = max(float(w(-deflection(t))), 0.0) / reference
        sigma = e.lowest_slope + share**e.exponent * (e.highest_slope - e.lowest_slope)
        speed = -float(rate(t))
        return [sigma * (1 + s * y[0] / (reference / 2)) * speed]

    return -integrated(rates)[0] * w(-X) / reference


def jounce(e) -> Array:  # type: ignore[no-untyped-def]
    static = -flat_curve(e.travels, e.forces, False)(-X)
    cells = zip(e.cell_stiffnesses, e.cell_corners, e.contact_points, strict=True)
    return np.asarray(static + weighted_dahl(e) + sum(contact_maxwell(k, w, point, e.entry) for k, w, point in cells))


def network(e) -> Array:  # type: ignore[no-untyped-def]
    curve = flat_curve(e.travels, e.forces, False)

    def travel(t: float) -> float:
        return max(-float(deflection(t)), 0.0)

    poles, c1, c2 = (np.array(getattr(e, n)) for n in ("poles", "travel_inputs", "force_inputs"))
    states = integrated(
        lambda t, w, s, w0: list(-poles * w + c1 * travel(t) + c2 * float(curve(np.array(travel(t))))), poles.size
    )
    z1 = np.clip(-X / e.highest_travel, 0, 1)
    z2 = np.clip((-V - e.lowest_rate) / (e.highest_rate - e.lowest_rate), 0, 1)
    top, bottom = np.zeros(T.size), np.zeros(T.size)
    for j in range(poles.size):
        a, b = (z1 - e.travel_centres[j]) / e.travel_widths[j], (z2 - e.rate_centres[j]) / e.rate_widths[j]
        mu = np.exp(-0.5 * (a**2 + b**2))
        top += mu * (e.offsets[j] + states[j] + e.travel_gains[j] * -X + e.force_gains[j] * curve(-X))
        bottom += mu
    return np.where(X < 0, -top / bottom, 0.0)


def band_filter(e) -> Array:  # type: ignore[no-untyped-def]
    # series spring, damper and inerter under one force F: F' = k (v - F / c - w), w' = F / b
    k, c, b = e.gain * e.centre / e.quality, e.gain, e.gain / (e.quality * e.centre)
    return integrated(lambda t, y, s, y0: [k * (float(rate(t)) - y[0] / c - y[1]), y[0] / b], 2)[0]


def bouc_wen(e) -> Array:  # type: ignore[no-untyped-def]
    # in the usual letters: z' = A x' - beta |x'| |z|^(n-1) z - gamma x' |z|^n, F = z
    both = e.slope / e.friction**e.exponent
    beta, gamma = e.share * both, (1.0 - e.share) * both

    def rates(t: float, z: Array, s: float, z0: Array) -> list[float]:
        v, size = float(rate(t)), abs(z[0])
        return [e.slope * v - beta * abs(v) * size ** (e.exponent - 1) * z[0] - gamma * v * size**e.exponent]

    return integrated(rates)[0]


def fractional(e) -> Array:  # type: ignore[no-untyped-def]
    # derivative of order alpha by Gruenwald and Letnikov: at step h it is that of a time alpha h / 2 ago
    h, n = H / 4, 4 * T.size
    weights = np.cumprod(np.concatenate([[1.0], 1.0 - (e.order + 1.0) / np.arange(1, n)]))
    ahead = np.concatenate([[0.0], deflection(np.arange(1, n) * h + 0.5 * e.order * h)])
    size = 1 << (2 * n - 1).bit_length()
    sums = np.fft.irfft(np.fft.rfft(weights, size) * np.fft.rfft(ahead, size), size)[:n:4]
    return np.asarray(e.stiffness * (e.reference * h) ** -e.order * sums)


def return_points(e) -> Array:  # type: ignore[no-untyped-def]
    # many springs with dry sliders in parallel (Prandtl, Ishlinskii) have return points by themselves; their stiffnesses follow
    # from the slope of the first loading, f x_2 / (x_2 + u)^2
    edges = e.half_stroke * np.concatenate([[0.0], np.geomspace(1e-3, 1e4, 3000)])
    slope = e.friction * e.half_stroke / (e.half_stroke + edges) ** 2
    stiffness, strokes = -np.diff(slope), 0.5 * (edges[1:] + edges[:-1])
    stretch, found = np.zeros(strokes.size), np.zeros(T.size)
    for k in range(1, T.size):
        stretch = np.clip(stretch + X[k] - X[k - 1], -strokes, strokes)
        found[k] = stiffness @ stretch
    return found


ORACLES: dict[str, Callable[..., Array]] = {
    "kelvin_voigt": lambda e: e.stiffness * X + e.damping * V,
    "cubic_spring": lambda e: e.stiffness * X + e.cubic * X**3,
    "power_spring": lambda e: e.stiffness * e.reference * np.sign(X) * np.abs(X / e.reference) ** e.exponent,
    "power_damper": lambda e: e.damping * V * (np.hypot(V, e.rounding) / e.reference) ** (e.exponent - 1),
    "asymmetric_damper": lambda e: np.where(V > 0, e.extension, e.compression) * V,
    "stribeck_friction": lambda e: np.tanh(V / e.rounding)
    * (e.friction + (e.breakaway - e.friction) * np.exp(-((V / e.stribeck_speed) ** 2))),
    "curve_spring": lambda e: PchipInterpolator(e.deflections, e.forces)(np.clip(X, -0.04, 0.04))
    + np.where(X < -0.04, (X + 0.04) * PchipInterpolator(e.deflections, e.forces).derivative()(-0.04), 0)
    + np.where(X > 0.04, (X - 0.04) * PchipInterpolator(e.deflections, e.forces).derivative()(0.04), 0),
    "curve_damper": lambda e: np.where(
        V < -1, -900 + (V + 1) * PchipInterpolator(e.rates, e.forces).derivative()(-1.0),
        np.where(V > 1, 2200 + (V - 1) * PchipInterpolator(e.rates, e.forces).derivative()(1.0),
                 PchipInterpolator(e.rates, e.forces)(np.clip(V, -1, 1)))),
    "buffer_curve": lambda e: -flat_curve(e.travels, e.forces, False)(-X),
    "bump_stop": lambda e: contact(X, V, -1.0, e.compression_gap, e.entry, e.stiffness, e.cubic, e.damping),
    "free_play": lambda e: e.stiffness * np.sign(X) * np.maximum(np.abs(X) - e.gap, 0.0),
    "maxwell": lambda e: maxwell(e.stiffness, e.damping),
    "maxwell_chain": lambda e: e.stiffness * X
    + sum(maxwell(k, c) for k, c in zip(e.cell_stiffnesses, e.cell_dampings, strict=True)),
    "berg_friction": lambda e: berg_friction(e.friction, e.half_stroke),
    "berg": lambda e: e.stiffness * X + maxwell(e.cell_stiffness, e.cell_damping) + berg_friction(e.friction, e.half_stroke),
    "modified_berg": lambda e: e.stiffness * X + e.cubic * X**3 + maxwell(e.cell_1_stiffness, e.cell_1_damping)
    + maxwell(e.cell_2_stiffness, e.cell_2_damping) + berg_friction(e.friction, e.half_stroke),
    "dahl": lambda e: integrated(lambda t, y, s, y0: [e.slope * (1 - s * y[0] / e.friction) * float(rate(t))])[0],
    "weighted_dahl": weighted_dahl,
    "contact_maxwell": lambda e: contact_maxwell(e.stiffness, e.corner, e.contact_point, e.entry),
    "jounce_bumper": jounce,
    "local_linear_network": network,
    "damping_filter": band_filter,
    "bouc_wen": bouc_wen,
    "fractional": fractional,
    "return_point_friction": return_points,
    "sum": lambda e: sum(ORACLES[part.KIND](part) for part in e.elements),
}


def test_every_kind_has_an_oracle() -> None:
    assert set(ORACLES) == set(kinds())


@pytest.mark.parametrize("kind", sorted(kinds()))
def test_agrees_with_its_oracle(kind: str) -> None:
    # 0.2 ms steps; 1e-3 of the largest force covers the polygon through the samples where friction turns
    element: ForceElement = kinds()[kind].example()
    codes, params = kernel.pack_terms(element.terms())
    force = kernel.response(codes, params, X, V, H)
    expected = ORACLES[kind](element)
    error = np.abs(force - expected) / np.max(np.abs(expected))
    assert np.max(np.abs(expected)) > 1.0
    assert np.sqrt(np.mean(error**2)) < 2e-4
    assert np.max(error) < 2e-3
