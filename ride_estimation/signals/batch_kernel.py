# Copyright 2026 ride_estimation contributors
"""Compiled part of the feed of a recording: which samples the coming blocks rest on, and their values at the ticks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_kernel
from ride_estimation.signals.interpolation import interpolate_ticks

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: columns of the state of a stream: first and one past the last sample in its buffer, first sample at or after the end of the
#: block, period [ns], places per tick, largest normal distance of samples [ns]
FIRST, STOP, BOUND, PERIOD, POINTS, WIDEST = 0, 1, 2, 3, 4, 5
#: columns of the plan of a block and stream: window in the buffer, largest distance that is joined [ns], period after the block
PLAN_FIRST, PLAN_STOP, PLAN_WIDEST, PLAN_PERIOD = 0, 1, 2, 3


@compile_kernel
def plan_blocks(
    stamps: IntArray, ranks: IntArray, unusual: IntArray, starts: IntArray, state: IntArray, base: IntArray, gap_periods: float,
    plan: IntArray, last: IntArray,
) -> int:  # fmt: skip
    """Find the samples of as many coming blocks as are plain; return how many.

    Plain is a block that only waits for samples which lengthen the buffers of their streams without a hole: the very cases in
    which :meth:`StampAligner.push` does nothing but append, trim and follow the period.

    Parameters
    ----------
    stamps, ranks
        Stamps [ns] and places in the order of arrival of all streams, one stream after the other.
    unusual
        Samples before each one that are not normal; one entry more per stream than samples.
    starts
        First sample of every stream and the number of all, shape (S + 1,).
    state
        Columns as named above, shape (S, 6), in place.
    base
        First tick, step [ns], ticks per block, samples that complete a block, samples kept before it, longest wait [ns], newest
        tick emitted, last place in the order of arrival that was taken.
    gap_periods
        Periods without a sample that make a gap.
    plan
        Output, columns as named above, shape (B, S, 4).
    last
        Output, place in the order of arrival with which a block is complete, shape (B,).
    """
    streams = state.shape[0]
    stops = np.empty(streams, dtype=np.int64)
    tick, step, ticks, least, keep, wait, floor, done = base[0], base[1], base[2], base[3], base[4], base[5], base[6], base[7]
    for b in range(plan.shape[0]):
        end = tick + (ticks - 1) * step
        for s in range(streams):
            count, start = starts[s + 1] - starts[s], starts[s]
            bound, stop = state[s, BOUND], end + (step // 2 if state[s, POINTS] > 1 else 0)
            while bound < count and stamps[start + bound] < stop:
                bound += 1
            state[s, BOUND] = bound
            completing = bound + least - 1
            if completing >= count:
                return b
            done = max(done, ranks[start + completing])
        for s in range(streams):
            count, start, place = starts[s + 1] - starts[s], starts[s], state[s, STOP]
            stop = place
            while stop < count and ranks[start + stop] <= done:
                stop += 1
            period, widest = state[s, PERIOD], state[s, WIDEST]
            if 2 * widest > 3 * period or unusual[start + s + stop] != unusual[start + s + state[s, FIRST] + 1]:
                return b
            if stop > place and (
                widest > min(int(gap_periods * period), wait)
                or stamps[start + place] <= floor
                or stamps[start + stop - 1] > end + wait
            ):
                return b
            stops[s] = stop
        tick += ticks * step
        for s in range(streams):
            start, first, stop, period = starts[s], state[s, FIRST], stops[s], state[s, PERIOD]
            plan[b, s, PLAN_FIRST], plan[b, s, PLAN_STOP], plan[b, s, PLAN_WIDEST] = first, stop, int(gap_periods * period)
            if stop - first >= 3:
                mean = (stamps[start + stop - 1] - stamps[start + first]) // (stop - first - 1)
                period = period + (min(mean, 2 * period) - period) // 16 if period else mean
            plan[b, s, PLAN_PERIOD] = period
            needed = first
            while needed < stop and stamps[start + needed] < tick:
                needed += 1
            state[s, FIRST], state[s, STOP], state[s, PERIOD] = max(first, needed - keep), stop, period
        last[b], floor = done, end
    return int(plan.shape[0])


@compile_kernel
def fill_blocks(
    stamps: IntArray, samples: Array, starts: IntArray, layout: IntArray, plan: IntArray, first_tick: int, step: int, ticks: int,
    values: Array, valid: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Interpolate the planned blocks.

    Parameters
    ----------
    stamps, samples, starts
        As for :func:`plan_blocks`; samples flat, one stream after the other.
    layout
        Values per sample, first column in ``values``, places per tick and place of the first value in ``samples``, shape (S, 4).
    plan
        Of B blocks.
    first_tick, step, ticks
        Of the first block [ns], of the time base [ns], of every block.
    values, valid
        Outputs, shapes (B ticks, columns) and (B ticks, S).
    """
    for s in range(layout.shape[0]):
        width, column, start, place = layout[s, 0], layout[s, 1], starts[s], layout[s, 3]
        count = starts[s + 1] - start
        own = samples[place : place + count * width].reshape((count, width))
        for b in range(plan.shape[0]):
            first, stop, row = plan[b, s, PLAN_FIRST], plan[b, s, PLAN_STOP], b * ticks
            interpolate_ticks(
                stamps[start + first : start + stop], own[first:stop], first_tick + row * step, step, plan[b, s, PLAN_WIDEST],
                layout[s, 2], False, values[row : row + ticks, column : column + width], valid[row : row + ticks, s],
            )  # fmt: skip
