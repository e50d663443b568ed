# Copyright 2026 ride_estimation contributors
"""Dynamic stiffness and loss energy of steady harmonic loops, with the definition of the stiffness by name.

Definitions of K differ by several percent on the same loop of a nonlinear element, so a number without its definition
means little (document 003 mixes the first two).
"""

from __future__ import annotations

import math

import numpy as np

from ride_estimation.elements import terms as kernel
from ride_estimation.elements.base import Array, ForceElement
from ride_estimation.errors import InputDataError

#: best-fitting harmonics: modulus of the first harmonic of force over that of deflection
FIRST_HARMONIC = "first_harmonic"
#: force at the largest deflection over it
SECANT_AT_MAX = "secant_at_max"
#: largest force over largest deflection, half the peak-to-peak values
PEAK_TO_PEAK = "peak_to_peak"
#: slope of the major principal axis of the loop, force scaled by its range over that of the deflection
PRINCIPAL_AXIS = "principal_axis"
DEFINITIONS = (FIRST_HARMONIC, SECANT_AT_MAX, PEAK_TO_PEAK, PRINCIPAL_AXIS)


def first_harmonic(signal: Array) -> complex:
    """Return the complex amplitude of the first harmonic of one period, shape (N,), without its end point."""
    n = signal.size
    return complex(2.0 / n * np.sum(signal * np.exp(-2j * np.pi * np.arange(n) / n)))


def loop_stiffness(x: Array, force: Array, definition: str = FIRST_HARMONIC) -> float:
    """Return the dynamic stiffness K [N/m] of one period of a loop.

    Parameters
    ----------
    x, force
        Deflection [m] and force [N] of exactly one period at equal steps, without the end point, shape (N,).
    definition
        One of :data:`DEFINITIONS`.

    Raises
    ------
    InputDataError
        Unknown definition, or a deflection that does not move.
    """
    if definition not in DEFINITIONS:
        raise InputDataError(f"definition {definition!r} is unknown; allowed: {', '.join(DEFINITIONS)}")
    span = float(np.ptp(x))
    if not span > 0.0:
        raise InputDataError("the deflection does not move over the period")
    if definition == FIRST_HARMONIC:
        return abs(first_harmonic(force)) / abs(first_harmonic(x))
    if definition == SECANT_AT_MAX:
        middle = 0.5 * (float(np.max(x)) + float(np.min(x)))
        return float(force[np.argmax(x)] - force[np.argmin(x)]) / (2.0 * (float(np.max(x)) - middle))
    if definition == PEAK_TO_PEAK:
        return float(np.ptp(force)) / span
    scale = float(np.ptp(force)) / span
    if scale == 0.0:
        return 0.0
    _, vectors = np.linalg.eigh(np.cov(np.vstack([x, force / scale])))
    return float(scale * vectors[1, -1] / vectors[0, -1])


def loop_loss(x: Array, force: Array) -> float:
    """Return the area of one period of a loop [J], the energy lost per cycle (document 003 eq. (2)), with spectral accuracy."""
    n = x.size
    orders = np.fft.rfftfreq(n, 1.0 / n)
    a, b = np.fft.rfft(x), np.fft.rfft(force)
    # closed integral of F dx = 2 pi sum_k k Im(conj(X_k) F_k) * 2, amplitudes X_k = a / n
    return float(4.0 * math.pi / n**2 * np.sum(orders * np.imag(np.conj(a) * b)))


def steady_loop(
    element: ForceElement, omega: float, amplitude: float, *, points: int = 2048, cycles: int = 200, tolerance: float = 1e-9
) -> tuple[Array, Array]:
    """Return deflection and force of one steady period under ``x = A sin(omega t)`` from the element's terms.

    Parameters
    ----------
    element
        Any element, also one without closed forms.
    omega
        [rad/s].
    amplitude
        [m].
    points
        Samples per period.
    cycles
        Most periods to wait until two in a row agree.
    tolerance
        Agreement of two periods, relative to the largest force.

    Raises
    ------
    InputDataError
        The element does not settle: no period repeats the one before.
    """
    codes, params = kernel.pack_terms(element.terms())
    phase = 2.0 * np.pi * np.arange(1, points + 1) / points
    x, v = amplitude * np.sin(phase), amplitude * omega * np.cos(phase)
    h = 2.0 * np.pi / (omega * points)
    states = kernel.initial_states(codes, params, 0.0)
    kernel.terms_commit(codes, params, states, 0.0, amplitude * omega, 0.0)
    before = np.zeros(points)
    for _ in range(cycles):
        force = kernel.continued(codes, params, states, x, v, h)
        if float(np.max(np.abs(force - before))) <= tolerance * max(float(np.max(np.abs(force))), 1e-300):
            return x, force
        before = force
    raise InputDataError(
        f"{element.KIND}: no steady loop within {cycles} periods at {omega:g} rad/s and {amplitude:g} m"
    )


def complex_stiffness(element: ForceElement, omega: float, amplitude: float) -> complex:
    """Return the first-harmonic complex stiffness [N/m]: the closed form, or that of the steady loop where there is none."""
    closed = element.dynamic_stiffness(omega, amplitude)
    if closed is not None:
        return closed
    x, force = steady_loop(element, omega, amplitude)
    return first_harmonic(force) / first_harmonic(x)
