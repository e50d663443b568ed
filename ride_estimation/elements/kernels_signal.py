# Copyright 2026 ride_estimation contributors
"""Compiled passes over whole signals for the terms that matter for speed; memory in registers, no dispatch per sample.

Each pass gives what as many commits of the term would give, to rounding.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.kernels_memory import berg_commit, maxwell_commit
from ride_estimation.jit import compile_lean_kernel

Array = NDArray[np.float64]

_MAXWELL_FORCE = 2
_MAXWELL_DECAY = 5
_MAXWELL_GAIN = 6
_DIRECTION = 2
_TURN_X = 3
_TURN_F = 4
_EXTREME_X = 5
_EXTREME_F = 6


@compile_lean_kernel
def elastic_signal(s: Array, t: int, x: Array, v: Array, stiffness: float, cubic: float, damping: float, force: Array) -> None:
    """Add ``k x + k3 x^3 + c v`` to ``force``."""
    if damping == 0.0:
        for i in range(x.shape[0]):
            force[i] += x[i] * (stiffness + cubic * x[i] * x[i])
    else:
        for i in range(x.shape[0]):
            force[i] += x[i] * (stiffness + cubic * x[i] * x[i]) + damping * v[i]
    s[t, 0] = x[-1]
    s[t, 1] = v[-1]


@compile_lean_kernel
def maxwell_signal(s: Array, t: int, x: Array, v: Array, h: float, stiffness: float, corner: float, force: Array) -> None:
    """Add the force of a Maxwell cell to ``force``."""
    m = maxwell_commit(s, t, x[0], v[0], h, stiffness, corner)
    force[0] += m
    decay = s[t, _MAXWELL_DECAY]
    gain = stiffness * s[t, _MAXWELL_GAIN]
    for i in range(1, x.shape[0]):
        m = m * decay + gain * (x[i] - x[i - 1])
        force[i] += m
    s[t, _MAXWELL_FORCE] = m
    s[t, 0] = x[-1]
    s[t, 1] = v[-1]


@compile_lean_kernel
def berg_signal(s: Array, t: int, x: Array, v: Array, limit: float, half_stroke: float, dead_band: float, force: Array) -> None:
    """Add the force of Berg friction to ``force``: stroke by stroke, the numbers of the running branch in registers."""
    n = x.shape[0]
    i = 0
    while i < n and (s[t, _DIRECTION] == 0.0 or limit <= 0.0 or dead_band > 0.0):
        force[i] += berg_commit(s, t, x[i], v[i], limit, half_stroke, dead_band)
        i += 1
    while i < n:
        direction = s[t, _DIRECTION]
        if direction * (x[i] - s[t, _EXTREME_X]) < 0.0:
            s[t, _TURN_X] = s[t, _EXTREME_X]
            s[t, _TURN_F] = s[t, _EXTREME_F]
            direction = -direction
            s[t, _DIRECTION] = direction
        start = s[t, _TURN_X]
        base = s[t, _TURN_F]
        room = max(1.0 - direction * base / limit, 0.0)
        reach = half_stroke * room
        scale = direction * limit * room
        last = s[t, _EXTREME_X]
        f = s[t, _EXTREME_F]
        while i < n and direction * (x[i] - last) >= 0.0:
            last = x[i]
            d = direction * (last - start)
            if d > 0.0:
                f = base + scale * d / (reach + d)
            force[i] += f
            i += 1
        s[t, _EXTREME_X] = last
        s[t, _EXTREME_F] = f
    s[t, 0] = x[-1]
    s[t, 1] = v[-1]
