# Copyright 2026 ride_estimation contributors
"""First-harmonic complex stiffness of the overlay models, linear in the same coefficients as the force.

``K*(w, A) = k_e + 3/4 k_3 A^2 + i w c + sum k_i i w/(i w + O_i) + f kappa(A; x2)`` with kappa the first harmonic of unit
friction over a steady loop. This is the corrected form of document 003 eq. (13), (14), (19), (20): the storage term of a
Maxwell cell is ``k w^2/(w^2 + O^2)``, the cubic counts 3/4, and friction enters with its in-phase first harmonic.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.identification.bench.columns import FRICTION_BERG, Layout

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(96)


def friction_state(amplitude: Array, length: float) -> Array:
    """Return alpha, the unit Berg friction at the ends of a steady loop (document 003 eq. (10), root over three terms)."""
    a = amplitude
    alpha: Array = (np.sqrt(length**2 + a**2 + 6.0 * length * a) - length - a) / (2.0 * length)
    return alpha


def berg_harmonic(amplitude: Array, length: float) -> ComplexArray:
    """Return the complex stiffness of unit Berg friction [1/m].

    ``kappa' = 2 (1+alpha) D / A^2 [(D+A)/sqrt(D^2+2 A D) - 1]``, ``kappa'' = W / (pi A^2)``,
    ``W = 2 [2A - x2 (1+alpha)^2 ln(1 + 2A/D)]``, ``D = x2 (1+alpha)``. Differences of nearly equal terms at small
    amplitude are taken from series in A/D.
    """
    a = amplitude
    alpha = friction_state(a, length)
    d = length * (1.0 + alpha)
    ratio = a / d
    # (1+r)/sqrt(1+2r) - 1 without cancellation: 1+2r = (1+r)^2 - r^2
    inner = (1.0 + ratio) / np.sqrt(1.0 + 2.0 * ratio)
    bracket = ratio**2 / ((1.0 + 2.0 * ratio) * (1.0 + inner))
    storage = 2.0 * (1.0 + alpha) * d / a**2 * bracket
    # 2A - x2 (1+alpha)^2 log1p(2r) = x2 [2r(1+alpha) - (1+alpha)^2 log1p(2r)], and alpha (1+alpha) x2 ... = A (1-alpha)
    loss = 2.0 * length * (1.0 + alpha) * (2.0 * ratio - (1.0 + alpha) * np.log1p(2.0 * ratio))
    small = ratio < 1e-4
    loss = np.where(small, 2.0 * length * (4.0 / 3.0) * ratio**3, loss)
    result: ComplexArray = storage + 1j * loss / (np.pi * a**2)
    return result


def dahl_harmonic(amplitude: Array, length: float) -> ComplexArray:
    """Return the complex stiffness of unit Dahl friction [1/m] by quadrature over the steady half loop."""
    angle = 0.5 * np.pi * (_NODES + 1.0)
    a = np.atleast_1d(amplitude)[:, None]
    start = np.tanh(a / length)
    force = 1.0 - (1.0 + start) * np.exp(-a * (1.0 - np.cos(angle)) / length)
    weight = _WEIGHTS * 0.5 * np.pi * 2.0 / np.pi
    value = (force * (-np.cos(angle) + 1j * np.sin(angle))) @ weight / a[:, 0]
    result: ComplexArray = value.reshape(np.shape(amplitude))
    return result


def harmonic_columns(layout: Layout, theta: Array, omega: Array, amplitude: Array) -> ComplexArray:
    """Return complex stiffness columns and their sensitivities by the logarithms theta, shape (P + Q, N).

    Parameters
    ----------
    layout
        Columns of the model.
    theta
        Logarithms of rates [1/s] and friction length [m], shape (Q,).
    omega, amplitude
        Operating points [rad/s], [m], shape (N,).
    """
    values = np.exp(theta)
    out = np.zeros((layout.linear + layout.nonlinear, omega.size), dtype=complex)
    row = 0
    for wanted, column in ((layout.spring, 1.0), (layout.cubic, 0.75 * amplitude**2), (layout.viscous, 1j * omega)):
        if wanted:
            out[row] = column
            row += 1
    for i in range(layout.cells):
        denominator = 1j * omega + values[i]
        out[row + i] = 1j * omega / denominator
        out[layout.linear + i] = -1j * omega * values[i] / denominator**2
    if layout.friction:
        harmonic = berg_harmonic if layout.friction == FRICTION_BERG else dahl_harmonic
        out[layout.linear - 1] = harmonic(amplitude, values[-1])
        step = 1e-4
        out[-1] = (harmonic(amplitude, values[-1] * np.exp(step)) - harmonic(amplitude, values[-1] * np.exp(-step))) / (
            2.0 * step
        )
    return out


def complex_stiffness(layout: Layout, theta: Array, coefficients: Array, omega: Array, amplitude: Array) -> ComplexArray:
    """Return K* [N/m] at operating points, shape (N,)."""
    omega, amplitude = np.broadcast_arrays(np.asarray(omega, dtype=float), np.asarray(amplitude, dtype=float))
    columns = harmonic_columns(layout, theta, omega.ravel(), amplitude.ravel())[: layout.linear]
    result: ComplexArray = (coefficients @ columns).reshape(omega.shape)
    return result
