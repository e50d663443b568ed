# Copyright 2026 ride_estimation contributors
"""Compiled exact steps of elements with memory: Maxwell cell, Berg friction, Dahl friction.

A memory is row i of an array, shape (T, STATE_SIZE): ``s[i, 0]`` the committed deflection and ``s[i, 1]`` the committed
rate; rows are indexed, not sliced, because a slice costs more than the force law. A ``trial``
evaluates the force at another point and changes nothing; a ``commit`` accepts the point.

Every step is exact for a deflection that runs straight from the committed point to the trial point, so trial forces are
legitimate inside Runge-Kutta stages and implicit iterations, and no step length is unstable.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_lean_kernel, inline_kernel

Array = NDArray[np.float64]

# memory of a Maxwell cell
_FORCE = 2
_STEP = 3
_RATE = 4
_DECAY = 5
_GAIN = 6
_HALF_DECAY = 7
_HALF_GAIN = 8

# memory of rate-independent friction
_DIRECTION = 2
_TURN_X = 3
_TURN_F = 4
_EXTREME_X = 5
_EXTREME_F = 6


@compile_lean_kernel
def ramp_gain(decay_exponent: float) -> float:
    """Return ``(1 - exp(-z)) / z``, the share of a ramp that is left in a first-order lag."""
    if decay_exponent < 1e-12:
        return 1.0
    return -math.expm1(-decay_exponent) / decay_exponent


@inline_kernel
def maxwell_trial(s: Array, i: int, x: float, h: float, stiffness: float, corner: float) -> float:
    """Return the force of a Maxwell cell, ``m' = -Omega m + k v`` (document 003 eq. (8)), a time h after ``s``.

    Exact for a straight deflection: ``m E + k dx (1 - E) / (Omega h)``, ``E = exp(-Omega h)``. The exponentials of the
    last committed step length and of its half are kept in the memory, so fixed-step integration computes none.
    """
    if corner == s[i, _RATE]:
        if h == s[i, _STEP]:
            return float(s[i, _FORCE] * s[i, _DECAY] + stiffness * (x - s[i, 0]) * s[i, _GAIN])
        if 2.0 * h == s[i, _STEP]:
            return float(s[i, _FORCE] * s[i, _HALF_DECAY] + stiffness * (x - s[i, 0]) * s[i, _HALF_GAIN])
    z = corner * h
    return float(s[i, _FORCE] * math.exp(-z) + stiffness * (x - s[i, 0]) * ramp_gain(z))


@inline_kernel
def maxwell_commit(s: Array, i: int, x: float, v: float, h: float, stiffness: float, corner: float) -> float:
    """Accept the point (x, v) of a Maxwell cell and return its force."""
    if h != s[i, _STEP] or corner != s[i, _RATE]:
        z = corner * h
        s[i, _STEP] = h
        s[i, _RATE] = corner
        s[i, _DECAY] = math.exp(-z)
        s[i, _GAIN] = ramp_gain(z)
        s[i, _HALF_DECAY] = math.exp(-0.5 * z)
        s[i, _HALF_GAIN] = ramp_gain(0.5 * z)
    force = float(s[i, _FORCE] * s[i, _DECAY] + stiffness * (x - s[i, 0]) * s[i, _GAIN])
    s[i, _FORCE] = force
    s[i, 0] = x
    s[i, 1] = v
    return force


@compile_lean_kernel
def berg_branch(turn_x: float, turn_f: float, x: float, limit: float, half_stroke: float) -> float:
    """Return the force on the Berg branch that starts at a turning point (document 003 eq. (9)).

    ``F = F_s + s d / (x_2 (1 - a) + d) f_max (1 - a)`` with ``d = |x - x_s|``, ``s = sign(x - x_s)``, ``a = s F_s / f_max``.
    """
    d = x - turn_x
    if d == 0.0 or limit <= 0.0:
        return turn_f
    if d > 0.0:
        room = 1.0 - turn_f / limit
        if room <= 0.0:
            return turn_f
        return turn_f + d / (half_stroke * room + d) * limit * room
    room = 1.0 + turn_f / limit
    if room <= 0.0:
        return turn_f
    return turn_f + d / (half_stroke * room - d) * limit * room


@compile_lean_kernel
def dahl_branch(start_x: float, start_f: float, x: float, limit: float, stiffness: float, exponent: float) -> float:
    """Return the Dahl force after a monotone stroke, ``dF/dx = sigma (1 - s F / f_c)^n``, s the direction; exact.

    n = 1: ``z = z_0 exp(-sigma |dx| / f_c)`` with ``z = 1 - s F / f_c``; else ``z^(1-n) = z_0^(1-n) + (n - 1) sigma |dx| / f_c``.
    """
    d = x - start_x
    if d == 0.0 or limit <= 0.0:
        return start_f
    s = 1.0 if d > 0.0 else -1.0
    room = 1.0 - s * start_f / limit
    if room <= 0.0:
        return start_f
    stroke = stiffness * s * d / limit
    if exponent == 1.0:
        return start_f - s * limit * room * math.expm1(-stroke)
    base = room ** (1.0 - exponent) + (exponent - 1.0) * stroke
    left = 0.0 if base <= 0.0 else base ** (1.0 / (1.0 - exponent))
    return s * limit * (1.0 - left)


@inline_kernel
def berg_trial(s: Array, i: int, x: float, limit: float, half_stroke: float) -> float:
    """Return the Berg friction force at x.

    Ahead of the extreme of the running stroke the branch continues; behind it a branch that starts at the extreme is
    used, which becomes the running one only once it is longer than the dead band (:func:`berg_commit`).
    """
    if limit <= 0.0:
        return 0.0
    if s[i, _DIRECTION] * (x - s[i, _EXTREME_X]) >= 0.0:
        return berg_branch(s[i, _TURN_X], s[i, _TURN_F], x, limit, half_stroke)
    return berg_branch(s[i, _EXTREME_X], s[i, _EXTREME_F], x, limit, half_stroke)


@inline_kernel
def friction_accept(s: Array, i: int, x: float, v: float, force: float, dead_band: float) -> None:
    """Update turning point and extreme of rate-independent friction after an accepted point (x, force).

    A reversal counts once the way back is longer than the dead band; the turning point is then the extreme itself
    (back-dated). Shorter excursions run along one curve and leave no trace, so sensor noise makes no turning points.
    """
    direction = s[i, _DIRECTION]
    if direction == 0.0:
        if abs(x - s[i, _TURN_X]) > dead_band:
            s[i, _DIRECTION] = 1.0 if x > s[i, _TURN_X] else -1.0
            s[i, _EXTREME_X] = x
            s[i, _EXTREME_F] = force
    elif direction * (x - s[i, _EXTREME_X]) >= 0.0:
        s[i, _EXTREME_X] = x
        s[i, _EXTREME_F] = force
    elif abs(x - s[i, _EXTREME_X]) > dead_band:
        s[i, _TURN_X] = s[i, _EXTREME_X]
        s[i, _TURN_F] = s[i, _EXTREME_F]
        s[i, _DIRECTION] = -direction
        s[i, _EXTREME_X] = x
        s[i, _EXTREME_F] = force
    s[i, 0] = x
    s[i, 1] = v


@inline_kernel
def berg_commit(s: Array, i: int, x: float, v: float, limit: float, half_stroke: float, dead_band: float) -> float:
    """Accept a point of Berg friction and return its force."""
    force = berg_trial(s, i, x, limit, half_stroke)
    friction_accept(s, i, x, v, force, dead_band)
    return force


@inline_kernel
def dahl_trial(s: Array, i: int, x: float, limit: float, stiffness: float, exponent: float) -> float:
    """Return the Dahl friction force at x, continued from the extreme of the running stroke."""
    if limit <= 0.0:
        return 0.0
    return dahl_branch(s[i, _EXTREME_X], s[i, _EXTREME_F], x, limit, stiffness, exponent)


@inline_kernel
def dahl_commit(
    s: Array, i: int, x: float, v: float, limit: float, stiffness: float, exponent: float, dead_band: float
) -> float:
    """Accept a point of Dahl friction and return its force."""
    force = dahl_trial(s, i, x, limit, stiffness, exponent)
    friction_accept(s, i, x, v, force, dead_band)
    return force
