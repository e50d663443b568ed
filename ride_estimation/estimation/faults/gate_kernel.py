# Copyright 2026 ride_estimation contributors
"""Compiled statistics of the sensor gate: one pass over the ticks of a block.

Whether something is to be decided is found here; what is decided then stays in :mod:`sensor_gate`, in words.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

#: rows of the statistics per sensor: largest step, mean square deviation, mean square step, largest value
LARGEST, DEVIATION, STEP_SQUARE, PEAK = 0, 1, 2, 3


@dataclasses.dataclass(frozen=True)
class Scan:
    """What :func:`scan_block` found: repetitions and step sizes per tick (K, A), figures (4, A), mean (A, 3), the longest
    repetition of a sample and of an axis, whether a value is at full scale.
    """

    runs: IntArray
    sizes: Array
    figures: Array
    mean: Array
    longest: int
    longest_axis: int
    full: bool


@compile_kernel
def scan_block(
    values: Array, valid: BoolArray, last: Array, started: bool, mean: Array, limit: Array, run: IntArray, axis_run: IntArray,
    held: Array, runs: IntArray, sizes: Array, figures: Array, block_mean: Array,
) -> tuple[int, int, bool]:  # fmt: skip
    """Gather what the tests of single sensors need; return the longest repetition of a sample, the longest that one
    of its axes makes at the end of the block, and whether a value reaches its limit.

    Parameters
    ----------
    values
        Triaxial samples, shape (K, A, 3).
    valid
        Shape (K, A).
    last
        Samples of the tick before, shape (A, 3); meaningless before ``started``.
    mean
        Followed mean of every sensor, shape (A, 3).
    limit
        Value that counts as full scale, shape (A,).
    run
        Ticks the last value has repeated, shape (A,), in place.
    axis_run
        The same of every axis, shape (A, 3), in place.
    held
        Of every axis the last value that it repeated, the least distance of two such values that follow each other and how
        many values there were; shape (3, A, 3), in place.
    runs
        Output, ticks the whole sample has repeated at every tick, shape (K, A).
    sizes
        Output, largest step of the three channels at every tick, 0 where not valid, shape (K, A).
    figures
        Output, rows as named above, shape (4, A).
    block_mean
        Output, shape (A, 3).
    """
    ticks, count = values.shape[0], values.shape[1]
    longest, longest_axis, full = 0, 0, False
    for a in range(count):
        largest, deviation, square, peak = 0.0, 0.0, 0.0, 0.0
        repeated = run[a]
        for c in range(3):
            block_mean[a, c] = 0.0
        for k in range(ticks):
            step, same = 0.0, valid[k, a]
            for c in range(3):
                value = values[k, a, c]
                before = values[k - 1, a, c] if k > 0 else (last[a, c] if started else value)
                change = abs(value - before)
                step = max(step, change)
                if valid[k, a] and (started or k > 0) and change <= 1e-9 * (1.0 + abs(value)):
                    if axis_run[a, c] == 0 and value != held[0, a, c]:
                        if held[2, a, c] > 0.0:
                            held[1, a, c] = min(held[1, a, c], abs(value - held[0, a, c]))
                        held[0, a, c] = value
                        held[2, a, c] += 1.0
                    axis_run[a, c] += 1
                else:
                    axis_run[a, c], same = 0, False
                peak = max(peak, abs(value))
                block_mean[a, c] += value
                deviation += (value - mean[a, c]) * (value - mean[a, c])
            square += step * step
            repeated = repeated + 1 if same else 0
            runs[k, a] = repeated
            longest = max(longest, repeated)
            sizes[k, a] = step if valid[k, a] else 0.0
            largest = max(largest, sizes[k, a])
        run[a] = repeated
        for c in range(3):
            block_mean[a, c] /= ticks
            longest_axis = max(longest_axis, axis_run[a, c])
        figures[LARGEST, a], figures[DEVIATION, a] = largest, deviation / ticks
        figures[STEP_SQUARE, a], figures[PEAK, a] = square / ticks, peak
        full = full or peak >= limit[a]
    return longest, longest_axis, full


@compile_kernel
def find_jumps(
    figures: Array, others: Array, step_square: Array, noise: Array, shares: Array, fade: float, limits: Array
) -> bool:
    """Return whether a sensor steps farther than its own usual step and the latest steps of all others let expect.

    Parameters
    ----------
    figures
        Of :func:`scan_block`.
    others
        Largest step of every sensor lately, shape (A,), in place.
    step_square
        Usual mean square step, shape (A,).
    noise
        Shape (A,).
    shares
        Weights of the own usual step, of the largest step of the others and of the noise, shape (3,).
    fade
        Factor on ``others`` over the block.
    limits
        Output, largest believable step, shape (A,).
    """
    count = others.shape[0]
    first, second = -1.0, -1.0
    for a in range(count):
        seen = max(figures[LARGEST, a], others[a])
        if seen > first:
            first, second = seen, first
        elif seen > second:
            second = seen
    found = False
    for a in range(count):
        seen = max(figures[LARGEST, a], others[a])
        other = second if seen >= first else first
        limits[a] = shares[0] * np.sqrt(step_square[a]) + shares[1] * other + shares[2] * noise[a]
        found = found or figures[LARGEST, a] > limits[a]
        others[a] = max(figures[LARGEST, a], others[a] * fade)
    return found


@compile_kernel
def median(values: Array, count: int) -> float:
    """Return the median of the first ``count`` values, shape (N,), at least one; sorts them in place by insertion: for a few."""
    for n in range(1, count):
        value, place = values[n], n
        while place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value
    middle = count // 2
    return float(values[middle]) if count % 2 else float(0.5 * (values[middle - 1] + values[middle]))


@compile_kernel
def median_root(square: Array, count: int) -> float:
    """Return the median of the square roots of the first ``count`` values, shape (N,), 0 without any."""
    if count == 0:
        return 0.0
    chosen = np.empty(count)
    for n in range(count):
        chosen[n] = np.sqrt(square[n])
    return median(chosen, count)


@compile_kernel
def residual_ratio(
    values: Array, channels: IntArray, rate: Array, directions: Array, points: Array, matrix: Array, scale: float, ratio: Array
) -> float:
    """Return the mean of ``scale |P (y - c)|^2`` over a block and write it per tick, c the centripetal part.

    Parameters
    ----------
    values
        Samples of all channels, shape (K, C).
    channels
        Those that take part, N of them.
    rate
        Angular rate, shape (3,) [rad/s].
    directions, points
        Of all channels, shape (C, 3).
    matrix
        P, symmetric, shape (N, N).
    ratio
        Output, shape (K,).
    """
    total = 0.0
    count = channels.shape[0]
    y, turning = np.empty(count), np.empty(count)
    w0, w1, w2 = rate[0], rate[1], rate[2]
    ww = w0 * w0 + w1 * w1 + w2 * w2
    for i in range(count):
        e, r = directions[channels[i]], points[channels[i]]
        along = e[0] * r[0] + e[1] * r[1] + e[2] * r[2]
        turning[i] = (e[0] * w0 + e[1] * w1 + e[2] * w2) * (r[0] * w0 + r[1] * w1 + r[2] * w2) - ww * along
    for k in range(values.shape[0]):
        for i in range(count):
            y[i] = values[k, channels[i]] - turning[i]
        square = 0.0
        for i in range(count):
            part = 0.0
            for j in range(count):
                part += matrix[i, j] * y[j]
            square += part * part
        ratio[k] = square * scale
        total += ratio[k]
    return float(total / values.shape[0])


@compile_kernel
def slow_means(block_mean: Array, rotation: Array, takes_part: BoolArray, follows: BoolArray, gain: float, slow: Array) -> float:
    """Advance the two-stage slow mean of every sensor against the median of those that take part; return the largest.

    Parameters
    ----------
    block_mean
        Sensor axes, shape (A, 3).
    rotation
        Sensor to body axes, shape (A, 3, 3).
    takes_part
        Sensors of the body that make the median, shape (B,), B first sensors, at least one.
    follows
        Sensors whose difference is followed; that of the others fades, shape (A,).
    gain
        Of one stage.
    slow
        Shape (2, A, 3), in place.
    """
    count = block_mean.shape[0]
    turned = np.empty((count, 3))
    for a in range(count):
        for i in range(3):
            turned[a, i] = (
                rotation[a, i, 0] * block_mean[a, 0] + rotation[a, i, 1] * block_mean[a, 1] + rotation[a, i, 2] * block_mean[a, 2]
            )
    chosen = np.empty(takes_part.shape[0])
    for i in range(3):
        used = 0
        for a in range(takes_part.shape[0]):
            if takes_part[a]:
                chosen[used] = turned[a, i]
                used += 1
        middle = median(chosen, used)
        for a in range(count):
            away = turned[a, i] - middle if follows[a] else 0.0
            slow[0, a, i] += gain * (away - slow[0, a, i])
            slow[1, a, i] += gain * (slow[0, a, i] - slow[1, a, i])
    largest = 0.0
    for a in range(count):
        largest = max(largest, slow[1, a, 0] ** 2 + slow[1, a, 1] ** 2 + slow[1, a, 2] ** 2)
    return float(np.sqrt(largest))


@compile_kernel
def remember(
    figures: Array, block_mean: Array, whole: BoolArray, gain: float, mean: Array, square: Array, step_square: Array
) -> None:
    """Follow mean, size and step of every sensor whose block is good.

    Parameters
    ----------
    figures, block_mean
        Of :func:`scan_block`.
    whole
        Which sensors, shape (A,).
    gain
        Share of the block.
    mean, square, step_square
        Shapes (A, 3), (A,), (A,), in place.
    """
    for a in range(whole.shape[0]):
        if whole[a]:
            square[a] += gain * (figures[DEVIATION, a] - square[a])
            step_square[a] += gain * (figures[STEP_SQUARE, a] - step_square[a])
            for c in range(3):
                mean[a, c] += gain * (block_mean[a, c] - mean[a, c])
