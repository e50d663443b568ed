# Copyright 2026 ride_estimation contributors
"""Small operations on short blocks, where the general functions of numpy cost more than the work."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]


def cross(a: Array, b: Array) -> Array:
    """Return the cross product along the last axis (``numpy.cross`` costs several times as much for short blocks)."""
    result = np.empty(np.broadcast(a, b).shape)
    result[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    result[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    result[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return result


@compile_kernel
def low_pass(signals: Array, share: float, state: Array) -> Array:
    """Return the columns of ``signals`` (K, N) through one pole, ``y += share (x - y)``; ``state`` (N,) in place."""
    out = np.empty_like(signals)
    for k in range(signals.shape[0]):
        for n in range(signals.shape[1]):
            state[n] += share * (signals[k, n] - state[n])
            out[k, n] = state[n]
    return out
