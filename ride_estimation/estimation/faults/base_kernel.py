# Copyright 2026 ride_estimation contributors
"""Compiled statistics of the check of the base sensors: one pass over the ticks of a block."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@compile_kernel
def follow_means(values: Array, force: Array, rotation: Array, gain: float, mean: Array) -> None:
    """Follow what every sensor reads more than a specific force, sensor axes.

    Parameters
    ----------
    values
        Readings at the ticks of a block, shape (K, 3 N) [m/s^2].
    force
        In body axes, shape (3,) [m/s^2].
    rotation
        From sensor to body axes, shape (N, 3, 3).
    gain
        Share of the block.
    mean
        Shape (N, 3), in place.
    """
    for s in range(mean.shape[0]):
        for j in range(3):
            total, expected = 0.0, 0.0
            for k in range(values.shape[0]):
                total += values[k, 3 * s + j]
            for i in range(3):
                expected += rotation[s, i, j] * force[i]
            mean[s, j] += gain * (total / values.shape[0] - expected - mean[s, j])


@compile_kernel
def follow_bases(
    values: Array, columns: IntArray, to_plane: Array, project: Array, b: Array, a: Array, state: Array, before: Array,
    numbers: Array, gain: float, size: float, moments: Array, joint: Array,
) -> tuple[float, float]:  # fmt: skip
    """Advance the fading sums of the horizontal readings of the bases; return their mean square and the relative residual.

    Parameters
    ----------
    values, columns
        Samples of all channels, shape (K, C), and those of the bases, 3 N of them.
    to_plane
        From those to horizontal readings, shape (3 N, 2 N).
    project
        Takes horizontal readings to their residual, symmetric, shape (2 N, 2 N).
    b, a, state
        High-pass of second order, transposed direct form II: coefficients (3,), ``a[0]`` one; state (2, 2 N), in place.
    before
        Last rigid motions, shape (L, 2 N), in place.
    numbers
        Noise variance, square of the share that frames bend anyway, redundant equations; shape (3,).
    gain
        Share of the block in the fading sums.
    size
        Mean square of the motion so far.
    moments
        Of the residual, shape (2 N, 2 N), in place.
    joint
        Products of rigid motion now and earlier and of the residual, weighted by the residual: what was before a fault says
        nothing of how it follows from the motion; shape (6 N, 6 N), in place.
    """
    ticks, n, lag = values.shape[0], project.shape[0], before.shape[0]
    table = np.empty((ticks, 3 * n))
    moving = np.empty(n)
    square, left = 0.0, 0.0
    for k in range(ticks):
        for j in range(n):
            x = 0.0
            for c in range(columns.shape[0]):
                x += values[k, columns[c]] * to_plane[c, j]
            y = b[0] * x + state[0, j]
            state[0, j] = b[1] * x - a[1] * y + state[1, j]
            state[1, j] = b[2] * x - a[2] * y
            moving[j] = y
            square += y * y
        for j in range(n):
            residual = 0.0
            for i in range(n):
                residual += moving[i] * project[i, j]
            left += residual * residual
            table[k, j], table[k, 2 * n + j] = moving[j] - residual, residual
            table[k, n + j] = before[k, j] if k < lag else table[k - lag, j]
    for i in range(lag):
        for j in range(n):
            # the last motions of those kept and the new ones together
            place = i + ticks - lag
            before[i, j] = table[place, j] if place >= 0 else before[i + ticks, j]
    size += gain * (square / (ticks * n) - size)
    usual = numbers[0] + numbers[1] * size
    weight = left / ticks / (numbers[2] * usual)
    for i in range(3 * n):
        for j in range(i + 1):
            total = 0.0
            for k in range(ticks):
                total += table[k, i] * table[k, j]
            joint[i, j] += gain * (weight * total / ticks - joint[i, j])
            joint[j, i] = joint[i, j]
            if j >= 2 * n:
                p, q = i - 2 * n, j - 2 * n
                moments[p, q] += gain * (total / ticks - moments[p, q])
                moments[q, p] = moments[p, q]
    trace = 0.0
    for j in range(n):
        trace += moments[j, j]
    return size, trace / (numbers[2] * usual)
