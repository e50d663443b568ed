# Copyright 2026 ride_estimation contributors
"""Compiled steps of hysteresis with many reversals in memory (Masing rules) and of the Bouc-Wen law.

Both are rate-independent: the force after a straight stroke does not depend on how it was divided. Trials change nothing.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.kernels_memory import friction_accept
from ride_estimation.jit import compile_lean_kernel

Array = NDArray[np.float64]

# memory of Bouc-Wen friction, laid out as that of Dahl friction
_EXTREME_X = 5
_EXTREME_F = 6

# memory of friction with return points; slots 3 and 5 hold deflections as in all friction
_DIRECTION = 2
_REST_X = 3
_DEPTH = 4
_TIP_X = 5
_TIP_F = 6
FIRST_TURN = 7
#: turning points kept, pairs of deflection and force
DEPTH = 32
#: floats of memory of friction with return points
RETURN_POINT_STATE = FIRST_TURN + 2 * DEPTH


@compile_lean_kernel
def bouc_wen_branch(
    start_x: float, start_f: float, x: float, limit: float, stiffness: float, exponent: float, share: float
) -> float:
    """Return the Bouc-Wen force after a monotone stroke from (start_x, start_f).

    With ``w = s F / f``, s the direction, and ``tau = k |dx| / f``: ``dw/dtau = 1 - w^n`` for w >= 0 and
    ``1 + (2 b - 1) |w|^n`` for w < 0, by classical Runge-Kutta with steps of at most a tenth of the fastest rate (1e-7 of the
    limit); the search ends where the limit is reached to rounding.
    """
    d = x - start_x
    if d == 0.0 or limit <= 0.0:
        return start_f
    s = 1.0 if d > 0.0 else -1.0
    w = min(max(s * start_f / limit, -1.0), 1.0)
    back = 2.0 * share - 1.0
    left = stiffness * abs(d) / limit
    longest = 0.1 / (exponent * max(1.0, back))
    while left > 0.0 and 1.0 - w > 1e-15:
        h = min(left, longest)
        k1 = _bouc_wen_slope(w, exponent, back)
        k2 = _bouc_wen_slope(w + 0.5 * h * k1, exponent, back)
        k3 = _bouc_wen_slope(w + 0.5 * h * k2, exponent, back)
        k4 = _bouc_wen_slope(w + h * k3, exponent, back)
        w = min(w + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4), 1.0)
        left -= h
    return s * limit * w


@compile_lean_kernel
def _bouc_wen_slope(w: float, exponent: float, back: float) -> float:
    return 1.0 - math.pow(w, exponent) if w >= 0.0 else 1.0 + back * math.pow(-w, exponent)


@compile_lean_kernel
def bouc_wen_trial(s: Array, i: int, x: float, limit: float, stiffness: float, exponent: float, share: float) -> float:
    """Return the Bouc-Wen force at x, continued from the extreme of the running stroke."""
    return bouc_wen_branch(s[i, _EXTREME_X], s[i, _EXTREME_F], x, limit, stiffness, exponent, share)


@compile_lean_kernel
def bouc_wen_commit(
    s: Array, i: int, x: float, v: float, limit: float, stiffness: float, exponent: float, share: float, dead_band: float
) -> float:
    """Accept a point of Bouc-Wen friction and return its force."""
    force = bouc_wen_trial(s, i, x, limit, stiffness, exponent, share)
    friction_accept(s, i, x, v, force, dead_band)
    return force


@compile_lean_kernel
def backbone(u: float, limit: float, half_stroke: float) -> float:
    """Return the force of the first loading, ``f u / (x_2 + |u|)``."""
    return limit * u / (half_stroke + abs(u))


@compile_lean_kernel
def _open_turns(s: Array, i: int, depth: int, direction: float, x: float) -> int:
    """Return how many of the first ``depth`` turning points still count at x, reached in a direction.

    A loop closes where the motion comes back to the turning point before the last; both are then forgotten. A lone turning
    point is forgotten where the motion goes farther from rest than it lies: that is new ground.
    """
    while depth > 0:
        if depth == 1:
            farthest = abs(s[i, FIRST_TURN] - s[i, _REST_X])
            if direction * (x - s[i, _REST_X]) < farthest:
                return 1
            depth = 0
        else:
            if direction * (x - s[i, FIRST_TURN + 2 * (depth - 2)]) < 0.0:
                return depth
            depth -= 2
    return 0


@compile_lean_kernel
def _turn_force(s: Array, i: int, depth: int, x: float, limit: float, half_stroke: float) -> float:
    """Return the force on the branch of the last of ``depth`` turning points: the backbone at twice its size (Masing)."""
    if depth == 0:
        return backbone(x - s[i, _REST_X], limit, half_stroke)
    k = FIRST_TURN + 2 * (depth - 1)
    return float(s[i, k + 1] + 2.0 * backbone(0.5 * (x - s[i, k]), limit, half_stroke))


@compile_lean_kernel
def return_point_trial(s: Array, i: int, x: float, limit: float, half_stroke: float) -> float:
    """Return the force at x of friction with return points.

    Ahead of the tip of the running stroke: on the branch that is still open there. Behind it: on a branch that starts at the
    tip, or, past the last turning point, as if that small loop had closed.
    """
    if limit <= 0.0:
        return 0.0
    direction, depth = s[i, _DIRECTION], int(s[i, _DEPTH])
    if direction == 0.0:
        return backbone(x - s[i, _REST_X], limit, half_stroke)
    if direction * (x - s[i, _TIP_X]) >= 0.0:
        return _turn_force(s, i, _open_turns(s, i, depth, direction, x), x, limit, half_stroke)
    if depth > 0 and direction * (x - s[i, FIRST_TURN + 2 * (depth - 1)]) <= 0.0:
        # back past the turning point this stroke began at: its loop is closed
        return _turn_force(s, i, _open_turns(s, i, depth - 1, -direction, x), x, limit, half_stroke)
    if depth == 0 and direction * (x - s[i, _REST_X]) <= -abs(s[i, _TIP_X] - s[i, _REST_X]):
        return backbone(x - s[i, _REST_X], limit, half_stroke)
    return float(s[i, _TIP_F] + 2.0 * backbone(0.5 * (x - s[i, _TIP_X]), limit, half_stroke))


@compile_lean_kernel
def _forget_loop(s: Array, i: int, depth: int) -> None:
    """Remove from a full memory the two turning points in a row whose forces differ least from their neighbours'."""
    best, least = 1, np.inf
    for j in range(1, depth - 2):
        k = FIRST_TURN + 2 * j + 1
        change = abs(s[i, k] - s[i, k + 4]) + abs(s[i, k - 2] - s[i, k + 2])
        if change < least:
            best, least = j, change
    for k in range(FIRST_TURN + 2 * best, FIRST_TURN + 2 * (depth - 2)):
        s[i, k] = s[i, k + 4]


@compile_lean_kernel
def return_point_commit(
    s: Array, i: int, x: float, v: float, limit: float, half_stroke: float, dead_band: float
) -> float:
    """Accept a point of friction with return points and return its force.

    A reversal counts once the way back from the tip is longer than the dead band; the turning point is the tip. Of more than
    ``DEPTH`` nested turning points the two are forgotten that matter least.
    """
    force = return_point_trial(s, i, x, limit, half_stroke)
    direction, depth = s[i, _DIRECTION], int(s[i, _DEPTH])
    moved = False
    if direction == 0.0:
        if abs(x - s[i, _REST_X]) > dead_band:
            s[i, _DIRECTION] = 1.0 if x > s[i, _REST_X] else -1.0
            moved = True
    elif direction * (x - s[i, _TIP_X]) >= 0.0:
        s[i, _DEPTH] = _open_turns(s, i, depth, direction, x)
        moved = True
    elif abs(x - s[i, _TIP_X]) > dead_band:
        if depth == DEPTH:
            _forget_loop(s, i, depth)
            depth -= 2
        s[i, FIRST_TURN + 2 * depth] = s[i, _TIP_X]
        s[i, FIRST_TURN + 2 * depth + 1] = s[i, _TIP_F]
        s[i, _DIRECTION] = -direction
        s[i, _DEPTH] = _open_turns(s, i, depth + 1, -direction, x)
        moved = True
    if moved:
        s[i, _TIP_X] = x
        s[i, _TIP_F] = force
    s[i, 0] = x
    s[i, 1] = v
    return force
