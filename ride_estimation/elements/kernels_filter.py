# Copyright 2026 ride_estimation contributors
"""Compiled second-order filter from rate to force, ``(c_1 s + c_0) / (s^2 + a_1 s + a_0) + d``, exact for straight deflection."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_lean_kernel

Array = NDArray[np.float64]

# parameter columns
A1 = 0
A0 = 1
C1 = 2
C0 = 3
D = 4

# memory: the two states, then the transition of the last step length
_Z1 = 2
_Z2 = 3
_STEP = 4
_KEY_A1 = 5
_KEY_A0 = 6
_CROSS = 7
_LOWER = 8


@compile_lean_kernel
def transition(a1: float, a0: float, h: float) -> tuple[float, float]:
    """Return the entries (1, 2) and (2, 2) of ``exp(A h)``, ``A = [[0, 1], [-a_0, -a_1]]``; they determine the others."""
    half = 0.5 * a1
    square = a0 - half * half
    decay = math.exp(-half * h)
    angle = math.sqrt(abs(square)) * h
    if angle < 1e-6:
        sine = h
        cosine = 1.0
    elif square > 0.0:
        sine = math.sin(angle) * h / angle
        cosine = math.cos(angle)
    else:
        # written with decaying exponentials: sinh alone overflows for long steps
        fast = math.exp(-half * h - angle)
        slow = math.exp(-half * h + angle)
        return 0.5 * (slow - fast) * h / angle, 0.5 * (slow + fast) - half * 0.5 * (slow - fast) * h / angle
    return decay * sine, decay * (cosine - half * sine)


@compile_lean_kernel
def filter_trial(p: Array, s: Array, i: int, x: float, v: float, h: float) -> float:
    """Return the force [N] at (x, v) a time h after the memory."""
    cross, lower = s[i, _CROSS], s[i, _LOWER]
    if h != s[i, _STEP] or p[i, A1] != s[i, _KEY_A1] or p[i, A0] != s[i, _KEY_A0]:
        cross, lower = transition(p[i, A1], p[i, A0], h)
    speed = (x - s[i, 0]) / h if h > 0.0 else 0.0
    upper = lower + p[i, A1] * cross
    z1 = upper * s[i, _Z1] + cross * s[i, _Z2] + (1.0 - upper) / p[i, A0] * speed
    z2 = -p[i, A0] * cross * s[i, _Z1] + lower * s[i, _Z2] + cross * speed
    return float(p[i, C0] * z1 + p[i, C1] * z2 + p[i, D] * v)


@compile_lean_kernel
def filter_commit(p: Array, s: Array, i: int, x: float, v: float, h: float) -> float:
    """Accept a point of the filter and return its force [N]."""
    if h != s[i, _STEP] or p[i, A1] != s[i, _KEY_A1] or p[i, A0] != s[i, _KEY_A0]:
        s[i, _STEP] = h
        s[i, _KEY_A1] = p[i, A1]
        s[i, _KEY_A0] = p[i, A0]
        s[i, _CROSS], s[i, _LOWER] = transition(p[i, A1], p[i, A0], h)
    cross, lower = s[i, _CROSS], s[i, _LOWER]
    speed = (x - s[i, 0]) / h if h > 0.0 else 0.0
    upper = lower + p[i, A1] * cross
    z1 = upper * s[i, _Z1] + cross * s[i, _Z2] + (1.0 - upper) / p[i, A0] * speed
    s[i, _Z2] = -p[i, A0] * cross * s[i, _Z1] + lower * s[i, _Z2] + cross * speed
    s[i, _Z1] = z1
    s[i, 0] = x
    s[i, 1] = v
    return float(p[i, C0] * z1 + p[i, C1] * s[i, _Z2] + p[i, D] * v)
