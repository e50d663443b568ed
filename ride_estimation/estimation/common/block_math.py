# Copyright 2026 ride_estimation contributors
"""Small operations on short blocks, where the general functions of numpy cost more than the work."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]


def mean_of_ticks(values: Array) -> Array:
    """Return the mean along the first axis, at a third of the time of ``numpy.mean``."""
    return np.asarray(np.add.reduce(values, axis=0) / len(values))


def cross(a: Array, b: Array) -> Array:
    """Return the cross product along the last axis of arrays of up to three dimensions, shapes as for broadcasting.

    ``numpy.cross`` costs many times as much for short blocks.
    """
    # one layout only, or the kernel is compiled for each
    first, second = np.ascontiguousarray(a), np.ascontiguousarray(b)
    first, second = (v if v.ndim == 3 else v.reshape((1,) * (3 - v.ndim) + v.shape) for v in (first, second))
    shape = (max(len(first), len(second)), max(first.shape[1], second.shape[1]), 3)
    result = np.empty(shape)
    _cross(first, second, result)
    return result.reshape(shape[3 - max(a.ndim, b.ndim) :])


@compile_kernel
def _cross(a: Array, b: Array, out: Array) -> None:
    """Write the cross product; an axis of length one of ``a`` or ``b`` is repeated."""
    for k in range(out.shape[0]):
        ka, kb = k if a.shape[0] > 1 else 0, k if b.shape[0] > 1 else 0
        for m in range(out.shape[1]):
            ma, mb = m if a.shape[1] > 1 else 0, m if b.shape[1] > 1 else 0
            out[k, m, 0] = a[ka, ma, 1] * b[kb, mb, 2] - a[ka, ma, 2] * b[kb, mb, 1]
            out[k, m, 1] = a[ka, ma, 2] * b[kb, mb, 0] - a[ka, ma, 0] * b[kb, mb, 2]
            out[k, m, 2] = a[ka, ma, 0] * b[kb, mb, 1] - a[ka, ma, 1] * b[kb, mb, 0]


@compile_kernel
def follow_squares(signals: Array, gain: Array, square: Array) -> None:
    """Let ``square`` (M, 3) follow the mean square of ``signals`` (K, M, 3): ``s + g (<x^2> - s)``, g per row (M,), in place."""
    ticks = signals.shape[0]
    for m in range(square.shape[0]):
        for a in range(3):
            total = 0.0
            for k in range(ticks):
                total += signals[k, m, a] * signals[k, m, a]
            square[m, a] += gain[m] * (total / ticks - square[m, a])


@compile_kernel
def follow_scatter(signals: Array, gain: float, mean: Array, square: Array) -> None:
    """Let ``mean`` and ``square`` (M, 3) follow the mean of ``signals`` (K, M, 3) and the mean square about it, in place."""
    ticks = signals.shape[0]
    for m in range(mean.shape[0]):
        for a in range(3):
            total, scatter = 0.0, 0.0
            for k in range(ticks):
                total += signals[k, m, a]
            mean[m, a] += gain * (total / ticks - mean[m, a])
            for k in range(ticks):
                away = signals[k, m, a] - mean[m, a]
                scatter += away * away
            square[m, a] += gain * (scatter / ticks - square[m, a])


@compile_kernel
def turn_channels(
    values: Array, valid: BoolArray, streams: IntArray, starts: IntArray, places: IntArray, rotations: Array, out: Array,
    there: BoolArray,
) -> None:  # fmt: skip
    """Pick triaxial sensors out of an aligned block and turn them into the axes of the body.

    Parameters
    ----------
    values, valid
        Of the block, shapes (K, C) and (K, S).
    streams, starts, places
        Per sensor its stream, its first column and its row in the result, shape (N,).
    rotations
        Sensor to body, shape (N, 3, 3).
    out, there
        Outputs, shapes (K, M, 3) and (K, M); rows of no sensor stay as they are.
    """
    for n in range(streams.shape[0]):
        stream, start, place = streams[n], starts[n], places[n]
        for k in range(values.shape[0]):
            there[k, place] = valid[k, stream]
            x, y, z = values[k, start], values[k, start + 1], values[k, start + 2]
            for a in range(3):
                out[k, place, a] = rotations[n, a, 0] * x + rotations[n, a, 1] * y + rotations[n, a, 2] * z


@compile_kernel
def count_unfit(
    values: Array, valid: BoolArray, starts: IntArray, stops: IntArray, limits: Array, invalid: IntArray, clipped: IntArray
) -> None:
    """Count per stream the ticks without a sample and those at full scale, in place.

    Parameters
    ----------
    values, valid
        Of a block, shapes (K, C) and (K, S).
    starts, stops
        Columns of every stream that have a full scale, shape (S,).
    limits
        Magnitude that counts as full scale, shape (S,).
    invalid, clipped
        Counters, shape (S,).
    """
    for s in range(starts.shape[0]):
        for k in range(values.shape[0]):
            if not valid[k, s]:
                invalid[s] += 1
                continue
            for c in range(starts[s], stops[s]):
                if abs(values[k, c]) >= limits[s]:
                    clipped[s] += 1
                    break


@compile_kernel
def biquad_block(signals: Array, b: Array, a: Array, state: Array, out: Array) -> None:
    """Pass the columns of ``signals`` (K, N) through a filter of second order.

    Transposed direct form II, as ``scipy.signal.lfilter``, which costs many times as much for short blocks.

    Parameters
    ----------
    signals
        Shape (K, N).
    b, a
        Coefficients, shape (3,), ``a[0]`` one.
    state
        Shape (2, N), in place.
    out
        Output, shape (K, N).
    """
    for k in range(signals.shape[0]):
        for n in range(signals.shape[1]):
            x = signals[k, n]
            y = b[0] * x + state[0, n]
            state[0, n] = b[1] * x - a[1] * y + state[1, n]
            state[1, n] = b[2] * x - a[2] * y
            out[k, n] = y


@compile_kernel
def follow_moments(values: Array, columns: IntArray, keep: float, total: Array, square: Array) -> None:
    """Add the rows of some columns to a fading sum and to a fading sum of products, in place.

    Parameters
    ----------
    values, columns
        Shape (K, C), and N of its columns.
    keep
        Share of what was there that stays.
    total, square
        Shapes (N,) and (N, N).
    """
    size = columns.shape[0]
    row = np.empty(size)
    for n in range(size):
        total[n] *= keep
        for m in range(size):
            square[n, m] *= keep
    for k in range(values.shape[0]):
        for n in range(size):
            row[n] = values[k, columns[n]]
            total[n] += row[n]
        for n in range(size):
            for m in range(size):
                square[n, m] += row[n] * row[m]


def segment_ends(valid: NDArray[np.bool_], longest: int) -> list[int]:
    """Return where segments with the same sensors end, at most ``longest`` ticks each; shape of ``valid`` (K, S)."""
    ticks = len(valid)
    ends = set(range(longest, ticks, longest)) | {ticks}
    if not valid.all():
        ends |= set((np.flatnonzero((valid[1:] != valid[:-1]).any(axis=1)) + 1).tolist())
    return sorted(ends - {0})


@compile_kernel
def average_ticks(
    samples: Array, motion: Array, rate: Array, start: int, length: int, open_row: Array, progress: NDArray[np.int64],
    rows: Array,
) -> int:  # fmt: skip
    """Average consecutive ticks; return the tick to go on with, less than all where there is no room left.

    Parameters
    ----------
    samples, motion, rate
        Channels (K, C), CG motion (K, 6), angular rate (K, 3).
    start
        First tick to take.
    length
        Ticks per average.
    open_row
        Sums of the average in work, shape (C + 27,), in place.
    progress
        Ticks in it, finished rows; in place.
    rows
        Output, shape (N, C + 27): samples, motion, products xx yy zz xy xz yz of the rate, rate, motion at first and last tick.
    """
    channels = samples.shape[1]
    sums = channels + 15
    for k in range(start, samples.shape[0]):
        if progress[1] >= rows.shape[0]:
            return k
        if progress[0] == 0:
            for c in range(sums):
                open_row[c] = 0.0
            for a in range(6):
                open_row[sums + a] = motion[k, a]
        for c in range(channels):
            open_row[c] += samples[k, c]
        for a in range(6):
            open_row[channels + a] += motion[k, a]
        place = channels + 6
        for a in range(3):
            open_row[place + a] += rate[k, a] * rate[k, a]
            open_row[place + 6 + a] += rate[k, a]
        open_row[place + 3] += rate[k, 0] * rate[k, 1]
        open_row[place + 4] += rate[k, 0] * rate[k, 2]
        open_row[place + 5] += rate[k, 1] * rate[k, 2]
        progress[0] += 1
        if progress[0] == length:
            for a in range(6):
                open_row[sums + 6 + a] = motion[k, a]
            row = progress[1]
            for c in range(sums):
                rows[row, c] = open_row[c] / length
            for c in range(sums, sums + 12):
                rows[row, c] = open_row[c]
            progress[0] = 0
            progress[1] += 1
    return len(samples)
