# Copyright 2026 ride_estimation contributors
"""Values of an irregularly sampled signal at uniform ticks, the kernel of stamp alignment."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]


@compile_kernel
def interpolate_ticks(
    stamps: NDArray[np.int64],
    samples: Array,
    first_tick: int,
    step: int,
    widest: int,
    points: int,
    hold: bool,
    values: Array,
    valid: NDArray[np.bool_],
) -> None:
    """Fill ``values`` and ``valid`` at ``first_tick + k step``.

    Between two samples a cubic through the four nearest ones (Lagrange on their stamps) is evaluated, a straight line where
    a neighbour is missing or beyond a gap, so that a tick on a stamp gets that very sample. The value is the mean over
    ``points`` places spread evenly and symmetrically over one tick: 1 interpolates, more avoid aliasing of a fast stream
    without shifting it in time.

    Parameters
    ----------
    stamps
        Ascending stamps [ns], shape (N,).
    samples
        Shape (N, C).
    first_tick, step
        First tick and distance of ticks [ns].
    widest
        Largest distance of two samples that are joined [ns]; with ``hold`` the longest a last value is held.
    points
        Places per tick.
    hold
        Whether the newest value is valid after its stamp.
    values
        Output, shape (T, C). Where nothing is valid the newest earlier sample (or the first, or zero) is repeated.
    valid
        Output, shape (T,).
    """
    n, channels = samples.shape
    j = -1  # newest sample at or before the place
    for k in range(values.shape[0]):
        good = True
        for c in range(channels):
            values[k, c] = 0.0
        for i in range(points):
            place = first_tick + k * step + (2 * i + 1 - points) * step // (2 * points)
            while j >= 0 and stamps[j] > place:
                j -= 1
            while j + 1 < n and stamps[j + 1] <= place:
                j += 1
            if j >= 0 and stamps[j] == place:
                for c in range(channels):
                    values[k, c] += samples[j, c]
            elif j < 0 or j + 1 >= n or stamps[j + 1] - stamps[j] > widest:
                good = good and hold and j >= 0 and place - stamps[j] <= widest
                if n > 0:
                    for c in range(channels):
                        values[k, c] += samples[max(j, 0), c]
            else:
                width = float(stamps[j + 1] - stamps[j])
                u = float(place - stamps[j])
                cubic = j >= 1 and j + 2 < n
                if cubic:
                    before = float(stamps[j] - stamps[j - 1])
                    behind = float(stamps[j + 2] - stamps[j + 1])
                    cubic = 0.3 * width < before < 3.0 * width and 0.3 * width < behind < 3.0 * width
                if cubic:
                    a, b, d = -before, width, width + behind
                    wa = u * (u - b) * (u - d) / (a * (a - b) * (a - d))
                    w0 = (u - a) * (u - b) * (u - d) / (-a * b * d)
                    wb = (u - a) * u * (u - d) / ((b - a) * b * (b - d))
                    wd = (u - a) * u * (u - b) / ((d - a) * d * (d - b))
                    for c in range(channels):
                        values[k, c] += (
                            wa * samples[j - 1, c] + w0 * samples[j, c] + wb * samples[j + 1, c] + wd * samples[j + 2, c]
                        )
                else:
                    for c in range(channels):
                        values[k, c] += samples[j, c] + (samples[j + 1, c] - samples[j, c]) * u / width
        if points > 1:
            for c in range(channels):
                values[k, c] /= points
        valid[k] = good


@compile_kernel
def interpolate_streams(
    stamps: NDArray[np.int64], samples: Array, streams: NDArray[np.int64], first_tick: int, step: int, values: Array,
    valid: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Apply :func:`interpolate_ticks` to several streams that stand one after the other.

    Parameters
    ----------
    stamps, samples
        Of all streams, flat.
    streams
        Per stream the number of samples, values per sample, first column in ``values``, ``widest``, ``points`` and ``hold``;
        shape (S, 6).
    first_tick, step
        As there.
    values, valid
        Outputs, shapes (T, columns) and (T, S).
    """
    stamp, sample = 0, 0
    for s in range(streams.shape[0]):
        count, width, column = streams[s, 0], streams[s, 1], streams[s, 2]
        own = samples[sample : sample + count * width].reshape((count, width))
        interpolate_ticks(
            stamps[stamp : stamp + count], own, first_tick, step, streams[s, 3], streams[s, 4], streams[s, 5] == 1,
            values[:, column : column + width], valid[:, s],
        )  # fmt: skip
        stamp += count
        sample += count * width
