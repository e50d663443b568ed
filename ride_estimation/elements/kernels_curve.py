# Copyright 2026 ride_estimation contributors
"""Compiled tables: cubic Hermite curves stored in a parameter row, and Dahl friction weighted by one.

A curve of n points stands in row i of the parameters from column ``start``: n abscissae, n values, n slopes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.kernels_memory import dahl_branch, friction_accept
from ride_estimation.jit import compile_lean_kernel

Array = NDArray[np.float64]

_EXTREME_X = 5
_EXTREME_F = 6

# parameter columns of weighted Dahl friction
SIDE = 0
OFFSET = 1
REFERENCE_HEIGHT = 2
LOWEST_SLOPE = 3
HIGHEST_SLOPE = 4
EXPONENT = 5
DEAD_BAND = 6
POINTS = 7
CURVE = 8


@compile_lean_kernel
def curve_value(p: Array, i: int, start: int, points: int, u: float) -> float:
    """Return the curve at u: cubic Hermite between the points, straight with the end slopes outside."""
    last = points - 1
    if u <= p[i, start]:
        return float(p[i, start + points] + p[i, start + 2 * points] * (u - p[i, start]))
    if u >= p[i, start + last]:
        return float(p[i, start + points + last] + p[i, start + 2 * points + last] * (u - p[i, start + last]))
    low = 0
    high = last
    while high - low > 1:
        middle = (low + high) // 2
        if p[i, start + middle] <= u:
            low = middle
        else:
            high = middle
    width = p[i, start + high] - p[i, start + low]
    t = (u - p[i, start + low]) / width
    r = 1.0 - t
    left = p[i, start + points + low] * (1.0 + 2.0 * t) + p[i, start + 2 * points + low] * width * t
    right = p[i, start + points + high] * (3.0 - 2.0 * t) - p[i, start + 2 * points + high] * width * r
    return float(r * r * left + t * t * right)


@compile_lean_kernel
def weighted_dahl_state(p: Array, s: Array, i: int, u: float) -> float:
    """Return the unweighted force ``F~`` [N] of displacement-weighted Dahl friction at the travel u [m].

    ``dF~/dx = sigma(x) (1 - s F~ / (w_ref / 2))``, ``sigma = s_min + (w / w_ref)^n (s_max - s_min)`` (document 004 (3), (4));
    exact for the slope sigma frozen at the middle of the step, so stable for every step.
    """
    reference = p[i, REFERENCE_HEIGHT]
    middle = 0.5 * (u + s[i, _EXTREME_X])
    share = max(curve_value(p, i, CURVE, int(p[i, POINTS]), middle), 0.0) / reference
    slope = p[i, LOWEST_SLOPE] + share ** p[i, EXPONENT] * (p[i, HIGHEST_SLOPE] - p[i, LOWEST_SLOPE])
    return dahl_branch(s[i, _EXTREME_X], s[i, _EXTREME_F], u, 0.5 * reference, slope, 1.0)


@compile_lean_kernel
def weighted_dahl_trial(p: Array, s: Array, i: int, x: float) -> float:
    """Return the tension [N] ``side F~ w(u) / w_ref``, ``u = side x - offset`` (document 004 (5))."""
    u = p[i, SIDE] * x - p[i, OFFSET]
    height = max(curve_value(p, i, CURVE, int(p[i, POINTS]), u), 0.0)
    return float(p[i, SIDE] * weighted_dahl_state(p, s, i, u) * height / p[i, REFERENCE_HEIGHT])


@compile_lean_kernel
def weighted_dahl_commit(p: Array, s: Array, i: int, x: float, v: float) -> float:
    """Accept a point of displacement-weighted Dahl friction and return its tension [N]."""
    u = p[i, SIDE] * x - p[i, OFFSET]
    inner = weighted_dahl_state(p, s, i, u)
    friction_accept(s, i, u, p[i, SIDE] * v, inner, p[i, DEAD_BAND])
    height = max(curve_value(p, i, CURVE, int(p[i, POINTS]), u), 0.0)
    return float(p[i, SIDE] * inner * height / p[i, REFERENCE_HEIGHT])
