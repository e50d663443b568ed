# Copyright 2026 ride_estimation contributors
"""Columns of the jounce-bumper white box: what is linear in it, given its few nonlinear parameters.

Travel ``u >= 0`` and force P are positive in compression. With the unit friction state z of the modified Dahl model
(document 004 eq. (3)-(5), ``F_Dahl = z w(u) / 2``) and Maxwell cells behind contact points (eq. (7), (8)) the force is ::

    P = sum_j f_j S_j(u) + sum_j (w_j / 2) S_j(u) z + sum_i k_i max(m_i, 0)

with cubic splines S_j: linear in static curve, hysteresis height and cell stiffnesses.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.identification.bench.reversals import Motion
from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class TravelBasis:
    """Cubic B-splines over 0 to the largest travel that vanish at zero travel.

    Attributes
    ----------
    knots
        Distinct knots [m], shape (K,).
    """

    knots: Array

    @property
    def size(self) -> int:
        """Return the number of functions."""
        return self.knots.size + 1

    def __call__(self, travel: Array) -> Array:
        """Return the functions at travels, zero below contact, shape (N, size)."""
        full = np.concatenate([[self.knots[0]] * 3, self.knots, [self.knots[-1]] * 3])
        inside = np.clip(travel, self.knots[0], self.knots[-1])
        values = scipy.interpolate.BSpline.design_matrix(inside, full, 3).toarray()[:, 1:]
        values[travel <= 0.0] = 0.0
        return np.asarray(values, dtype=float)

    def curve(self, coefficients: Array) -> tuple[Array, Array, Array]:
        """Return travels, values and slopes at the knots (a cubic Hermite curve that is this spline), shapes (K,)."""
        full = np.concatenate([[self.knots[0]] * 3, self.knots, [self.knots[-1]] * 3])
        spline = scipy.interpolate.BSpline(full, np.concatenate([[0.0], coefficients]), 3)
        return self.knots.copy(), np.asarray(spline(self.knots)), np.asarray(spline.derivative()(self.knots))

    def roughness(self) -> Array:
        """Return second differences of the coefficients (rows) for a smoothness penalty, shape (size - 2, size)."""
        return np.diff(np.eye(self.size), n=2, axis=0)


def make_basis(largest_travel: float, count: int = 14) -> TravelBasis:
    """Return a basis whose knots lie denser towards large travel, where static curves bend."""
    share = np.linspace(0.0, 1.0, count)
    return TravelBasis(largest_travel * share**0.8)


@compile_kernel
def _friction_state(travel: Array, reach: Array) -> Array:
    """Return unit friction, exact for the rate 1/reach frozen over each step; stable for any step."""
    z = np.zeros(travel.size)
    for k in range(1, travel.size):
        step = travel[k] - travel[k - 1]
        if step == 0.0:
            z[k] = z[k - 1]
            continue
        sign = 1.0 if step > 0.0 else -1.0
        decay = np.exp(-abs(step) * 0.5 * (reach[k] + reach[k - 1]))
        z[k] = sign + (z[k - 1] - sign) * decay
    return z


@compile_kernel
def play(x: Array, width: float) -> Array:
    """Return the travel behind a dead band of half width ``width``: small back-and-forth motion does not pass."""
    out = np.empty(x.size)
    centre = x[0]
    for k in range(x.size):
        if x[k] > centre + width:
            centre = x[k] - width
        elif x[k] < centre - width:
            centre = x[k] + width
        out[k] = centre
    return out


def friction_travel(motion: Motion, side: float) -> Array:
    """Return the travel that drives friction: compression, behind the dead band of the noisy sensor [m], shape (N,)."""
    travel = np.maximum(side * motion.x, 0.0)
    return play(travel, 0.5 * motion.dead_band) if motion.dead_band > 0.0 else travel


def friction_state(travel: Array, height: Array, reference: float, slopes: Array) -> Array:
    """Return unit friction z of the modified Dahl model, shape (N,).

    ``dz/du = (2 sigma(u) / w_ref) (1 - z sign)``, ``sigma = s_min + (w / w_ref)^n (s_max - s_min)``.

    Parameters
    ----------
    travel
        Travel [m], shape (N,).
    height
        Hysteresis height w at the travel [N], shape (N,).
    reference
        w at the reference travel [N].
    slopes
        s_min [N/m], s_max [N/m], exponent n.
    """
    share = np.clip(height / reference, 0.0, None)
    sigma = slopes[0] + share ** slopes[2] * (slopes[1] - slopes[0])
    state: Array = _friction_state(travel, 2.0 * np.maximum(sigma, 0.0) / reference)
    return state


@compile_kernel
def contact_cell(travel: Array, h: float, contact: float, smooth: float, rate: float) -> Array:
    """Return unit force of a Maxwell cell behind a contact point: pushes only, forgets when it leaves contact, shape (N,).

    A record that begins in contact begins with a relaxed cell.

    Input: penetration, ``(u - cp + p)^2 / (4 p)`` inside the entry of half width p (document 004, free-travel smoothing).
    """
    a = rate * h
    decay = np.exp(-a)
    gain = -np.expm1(-a) / a
    out = np.zeros(travel.size)
    m = 0.0
    before = 0.0
    for k in range(travel.size):
        d = travel[k] - contact
        if d <= -smooth:
            m = 0.0
            before = 0.0
            continue
        depth = (d + smooth) ** 2 / (4.0 * smooth) if d < smooth and smooth > 0.0 else max(d, 0.0)
        if k == 0:
            before = depth  # a record that begins loaded begins at rest, as the element does
        m = decay * m + gain * (depth - before)
        before = depth
        out[k] = max(m, 0.0)
    return out
