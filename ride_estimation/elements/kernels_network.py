# Copyright 2026 ride_estimation contributors
"""Compiled network of continuous local linear models (document 004 (15)-(26)).

Model j: ``w_j' = -alpha_j w_j + c_1j u_1 + c_2j u_2``, ``y_j = g_j + w_j + d_1j u_1 + d_2j u_2`` with the travel ``u_1`` and the
static force ``u_2 = f(u_1)``; output ``sum_j Phi_j(z) y_j`` with normalised Gaussians of travel and rate.

Parameter row: side, offset, lowest and highest travel, lowest and highest rate, number of models, points of the static
curve, then ten numbers per model, then the curve.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.kernels_curve import curve_value
from ride_estimation.jit import compile_lean_kernel

Array = NDArray[np.float64]

SIDE = 0
OFFSET = 1
LOW_TRAVEL = 2
HIGH_TRAVEL = 3
LOW_RATE = 4
HIGH_RATE = 5
MODELS = 6
POINTS = 7
FIRST_MODEL = 8
#: numbers per model: centre and width of travel and rate, alpha, g, d_1, c_1, d_2, c_2
MODEL_SIZE = 10
#: memory columns before the states of the models
FIRST_STATE = 2


@compile_lean_kernel
def _static_force(p: Array, i: int, u: float) -> float:
    start = FIRST_MODEL + MODEL_SIZE * int(p[i, MODELS])
    return curve_value(p, i, start, int(p[i, POINTS]), u)


@compile_lean_kernel
def _normalised(value: float, low: float, high: float) -> float:
    """Return the position in the trained range, clipped to it (document 004, discussion of extrapolation)."""
    return min(max((value - low) / (high - low), 0.0), 1.0)


@compile_lean_kernel
def _distance(p: Array, i: int, m: int, travel: float, rate: float) -> float:
    """Return half the squared distance to the centre of the model whose numbers start at column m."""
    a = (travel - p[i, m]) / p[i, m + 2]
    b = (rate - p[i, m + 1]) / p[i, m + 3]
    return float(0.5 * (a * a + b * b))


@compile_lean_kernel
def _advanced(p: Array, s: Array, i: int, j: int, m: int, inputs: tuple[float, float, float, float], h: float) -> float:
    """Return the state of model j after a step h over which its inputs run straight; exact."""
    alpha = p[i, m + 4]
    old_u, old_f, u, f = inputs
    old = p[i, m + 7] * old_u + p[i, m + 9] * old_f
    new = p[i, m + 7] * u + p[i, m + 9] * f
    z = alpha * h
    if z < 1e-4:
        first = 1.0 - 0.5 * z + z * z / 6.0
        second = 0.5 - z / 6.0 + z * z / 24.0
    else:
        first = -math.expm1(-z) / z
        second = (1.0 - first) / z
    return float(math.exp(-z) * s[i, FIRST_STATE + j] + h * ((first - second) * old + second * new))


@compile_lean_kernel
def network_trial(p: Array, s: Array, i: int, x: float, v: float, h: float) -> float:
    """Return the tension [N] at (x, v) a time h after the memory."""
    reached = p[i, SIDE] * x - p[i, OFFSET]
    u = max(reached, 0.0)
    f = _static_force(p, i, u)
    old_u = max(p[i, SIDE] * s[i, 0] - p[i, OFFSET], 0.0)
    inputs = (old_u, _static_force(p, i, old_u), u, f)
    travel = _normalised(u, p[i, LOW_TRAVEL], p[i, HIGH_TRAVEL])
    rate = _normalised(p[i, SIDE] * v, p[i, LOW_RATE], p[i, HIGH_RATE])
    models = int(p[i, MODELS])
    nearest = np.inf
    for j in range(models):
        nearest = min(nearest, _distance(p, i, FIRST_MODEL + MODEL_SIZE * j, travel, rate))
    weights = 0.0
    total = 0.0
    for j in range(models):
        m = FIRST_MODEL + MODEL_SIZE * j
        # relative to the nearest model: far outside all of them every Gaussian alone would be zero
        weight = math.exp(nearest - _distance(p, i, m, travel, rate))
        weights += weight
        state = _advanced(p, s, i, j, m, inputs, h)
        total += weight * (p[i, m + 5] + state + p[i, m + 6] * u + p[i, m + 8] * f)
    # out of contact the states relax, but nothing pushes
    return float(p[i, SIDE] * total / weights) if reached > 0.0 else 0.0


@compile_lean_kernel
def network_commit(p: Array, s: Array, i: int, x: float, v: float, h: float) -> float:
    """Accept a point of the network and return its tension [N]."""
    force = network_trial(p, s, i, x, v, h)
    u = max(p[i, SIDE] * x - p[i, OFFSET], 0.0)
    old_u = max(p[i, SIDE] * s[i, 0] - p[i, OFFSET], 0.0)
    inputs = (old_u, _static_force(p, i, old_u), u, _static_force(p, i, u))
    for j in range(int(p[i, MODELS])):
        s[i, FIRST_STATE + j] = _advanced(p, s, i, j, FIRST_MODEL + MODEL_SIZE * j, inputs, h)
    s[i, 0] = x
    s[i, 1] = v
    return force


@compile_lean_kernel
def network_rest(p: Array, s: Array, i: int, x0: float) -> None:
    """Set the memory to the steady state at the deflection x0."""
    u = max(p[i, SIDE] * x0 - p[i, OFFSET], 0.0)
    f = _static_force(p, i, u)
    for j in range(int(p[i, MODELS])):
        m = FIRST_MODEL + MODEL_SIZE * j
        s[i, FIRST_STATE + j] = (p[i, m + 7] * u + p[i, m + 9] * f) / p[i, m + 4]
    s[i, 0] = x0
