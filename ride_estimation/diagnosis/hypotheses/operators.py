# Copyright 2026 ride_estimation contributors
"""Signals that laws make of a deflection: hysteresis, dead zone, penetration, relaxation, resonance, time windows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@compile_kernel
def _dahl(x: Array, reach: float, out: Array) -> None:
    z = 0.0
    for i in range(1, len(x)):
        dx = x[i] - x[i - 1]
        decay = np.exp(-abs(dx) / reach)
        target = 1.0 if dx > 0.0 else -1.0
        if dx != 0.0:
            z = target + (z - target) * decay
        out[i] = z


def friction_level(x: Array, reach: float) -> Array:
    """Return the share -1..1 of the friction level reached along a deflection, shape (N,).

    Dahl: ``dz = (1 - z sign(dx)) dx / reach``, exact over a step (Dahl 1968; document 004 eq. (3)).

    Parameters
    ----------
    x
        Deflection [m].
    reach
        Sliding distance to 63 % of the level after rest [m].
    """
    out = np.zeros(len(x))
    _dahl(np.ascontiguousarray(x, dtype=float), max(float(reach), 1e-12), out)
    return out


@compile_kernel
def _taken_up(x: Array, half: float, out: Array) -> None:
    y = 0.0
    for i in range(1, len(x)):
        dx = x[i] - x[i - 1]
        new = min(max(y, x[i] - half), x[i] + half)
        if dx != 0.0:
            out[i] = abs(new - y) / abs(dx)
        y = new


def loose_share(x: Array, half: float) -> Array:
    """Return 1 where a part that hangs on a deflection through a play is left behind, 0 where it is carried along, shape (N,).

    Play operator ``y = min(max(y, x - half), x + half)`` (Krasnoselskii and Pokrovskii 1989): the part stands still from every
    reversal until the play is crossed.

    Parameters
    ----------
    x
        Deflection [m].
    half
        Half of the play [m].
    """
    out = np.zeros(len(x))
    _taken_up(np.ascontiguousarray(x, dtype=float), float(half), out)
    return np.asarray(1.0 - np.minimum(out, 1.0))


@compile_kernel
def _slid_behind(x: Array, half: float, reach: float, out: Array) -> None:
    y, most = 0.0, half + reach
    for i in range(1, len(x)):
        y = min(max(y + x[i] - x[i - 1], -most), most)
        depth = abs(y) - half
        out[i] = 0.0 if depth <= 0.0 else (depth if y > 0.0 else -depth) / reach


def loose_friction(x: Array, half: float, reach: float) -> Array:
    """Return the share -1..1 of the level of dry friction in series with a play and a spring, shape (N,).

    What lies between the part and the slider is ``y``, the stop operator of the deflection between plus and minus
    ``half + reach`` (Krasnoselskii and Pokrovskii 1989); the force is ``max(|y| - half, 0) / reach`` with the sign of y: nothing
    while the play is crossed, then up to the level at which the slider gives way.

    Parameters
    ----------
    x
        Deflection [m].
    half
        Half of the play [m].
    reach
        Stroke from contact to sliding [m].
    """
    out = np.zeros(len(x))
    _slid_behind(np.ascontiguousarray(x, dtype=float), float(half), max(float(reach), 1e-12), out)
    return out


def relaxed(omega: Array, spectrum: ComplexArray, corner_hz: float) -> ComplexArray:
    """Return the spectrum of a unit Maxwell cell, ``i w tau / (1 + i w tau)``."""
    s = 1j * omega / (2.0 * np.pi * corner_hz)
    return np.asarray(spectrum * s / (1.0 + s))


def resonant(omega: Array, spectrum: ComplexArray, frequency_hz: float, damping_ratio: float) -> ComplexArray:
    """Return the acceleration of a sprung mass whose base moves, ``(w0^2 + 2 z w0 s) / (s^2 + 2 z w0 s + w0^2)``."""
    w0, s = 2.0 * np.pi * frequency_hz, 1j * omega
    shape = (slice(None), *([None] * (spectrum.ndim - 1)))
    return np.asarray(spectrum * ((w0**2 + 2 * damping_ratio * w0 * s) / (s**2 + 2 * damping_ratio * w0 * s + w0**2))[shape])


def step_window(time_s: Array, at_s: float, over_s: float) -> Array:
    """Return 0 before and 1 after a change around an instant that takes a while, half a cosine."""
    share = np.clip((time_s - at_s) / over_s + 0.5, 0.0, 1.0)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * share))


def legendre(time_s: Array, degree: int) -> Array:
    """Return the Legendre polynomial over the run, -1..1."""
    u = 2.0 * (time_s - time_s[0]) / max(time_s[-1] - time_s[0], 1e-9) - 1.0
    return np.asarray(np.polynomial.legendre.Legendre.basis(degree)(u))

