# Copyright 2026 ride_estimation contributors
"""Rainflow counting after ASTM E1049-85 section 5.4.4, sample by sample: chunks give exactly what one pass gives.

Ranges are exact, not classed, and every cycle keeps the samples of its two turning points, so that damage can be laid over
time. The libraries that count in a stream sort ranges into at most 1024 classes, those that count exactly need the whole
signal; the tests hold this counter against both kinds.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

# layout of the memory between chunks
_SEEN, _DEPTH, _DIRECTION = 0, 1, 2


@dataclasses.dataclass(frozen=True)
class Cycles:
    """Counted cycles, C of them, in the order in which they closed.

    Attributes
    ----------
    start, end
        Values of the two turning points, shape (C,) [unit of the signal]; the cycle goes from ``start`` to ``end``.
    count
        1 for a full cycle, 0.5 for a half one.
    start_index, end_index
        Samples of the turning points since the first sample, shape (C,).
    """

    start: Array
    end: Array
    count: Array
    start_index: IntArray
    end_index: IntArray

    @property
    def ranges(self) -> Array:
        """Return the range of each cycle, shape (C,)."""
        return np.asarray(np.abs(self.end - self.start))


class RainflowCounter:
    """Counts while the signal arrives.

    What is counted at any moment equals what one pass over the samples so far counts, bit by bit.
    """

    def __init__(self) -> None:
        self._memory = np.zeros(3, dtype=np.int64)
        self._last = np.zeros(1)
        self._values = np.zeros(64)
        self._indices = np.zeros(64, dtype=np.int64)
        self._closed: list[tuple[Array, IntArray]] = []

    @property
    def samples(self) -> int:
        """Return the number of samples fed so far."""
        return int(self._memory[_SEEN])

    def feed(self, values: ArrayLike) -> None:
        """Count the next samples.

        Parameters
        ----------
        values
            Shape (N,), any unit.

        Raises
        ------
        InputDataError
            Values that are not finite; nothing of the chunk is counted then.
        """
        chunk = np.ascontiguousarray(np.asarray(values, dtype=float).ravel())
        if not np.all(np.isfinite(chunk)):
            raise InputDataError("rainflow counting: the signal contains values that are not finite")
        needed = int(self._memory[_DEPTH]) + len(chunk) + 2
        if needed > len(self._values):
            spare = 2 * needed - len(self._values)
            self._values = np.concatenate([self._values, np.zeros(spare)])
            self._indices = np.concatenate([self._indices, np.zeros(spare, dtype=np.int64)])
        rows, places = np.zeros((needed, 3)), np.zeros((needed, 2), dtype=np.int64)
        closed = _count(chunk, self._memory, self._last, self._values, self._indices, rows, places)
        if closed:
            self._closed.append((rows[:closed].copy(), places[:closed].copy()))

    def cycles(self) -> Cycles:
        """Return all cycles so far; the turning points that are still open count as half cycles up to the last sample."""
        rows = [part for part, _ in self._closed]
        places = [part for _, part in self._closed]
        depth = int(self._memory[_DEPTH])
        if self.samples > 1:
            open_rows, open_places = np.zeros((depth + 1, 3)), np.zeros((depth + 1, 2), dtype=np.int64)
            values = np.concatenate([self._values[: depth + 1], np.zeros(1)])
            indices = np.concatenate([self._indices[: depth + 1], np.zeros(1, dtype=np.int64)])
            count = _finish(depth, float(self._last[0]), self.samples - 1, values, indices, open_rows, open_places)
            rows.append(open_rows[:count])
            places.append(open_places[:count])
        table = np.concatenate(rows) if rows else np.zeros((0, 3))
        index = np.concatenate(places) if places else np.zeros((0, 2), dtype=np.int64)
        return Cycles(table[:, 0], table[:, 1], table[:, 2], index[:, 0], index[:, 1])


def count_cycles(values: ArrayLike) -> Cycles:
    """Return the rainflow cycles of a whole signal.

    Parameters
    ----------
    values
        Load signal, shape (N,), any unit, at least two finite samples.

    Raises
    ------
    InputDataError
        Fewer than two samples, or values that are not finite.
    """
    signal = np.asarray(values, dtype=float).ravel()
    if signal.size < 2:
        raise InputDataError(f"rainflow counting needs at least two samples; given {signal.size}")
    counter = RainflowCounter()
    counter.feed(signal)
    return counter.cycles()


def rainflow_matrix(cycles: Cycles, edges: ArrayLike) -> Array:
    """Return the from-to matrix: counts by class of the starting and of the ending turning point, shape (B, B).

    Parameters
    ----------
    cycles
        Counted cycles.
    edges
        Class limits, rising, shape (B + 1,), [unit of the signal]; values outside belong to the outermost classes.
    """
    limits = _edges(edges)
    classes = len(limits) - 1
    rows, columns = (np.clip(np.searchsorted(limits, v, side="right") - 1, 0, classes - 1) for v in (cycles.start, cycles.end))
    matrix = np.zeros((classes, classes))
    np.add.at(matrix, (rows, columns), cycles.count)
    return matrix


def range_pairs(cycles: Cycles) -> tuple[Array, Array]:
    """Return (ranges falling, cumulated count up to and including each): how many cycles are at least that large."""
    order = np.argsort(-cycles.ranges, kind="stable")
    return cycles.ranges[order], np.cumsum(cycles.count[order])


def level_crossings(values: ArrayLike, levels: ArrayLike) -> IntArray:
    """Return how often the signal crosses each level upwards, shape (L,)."""
    y, level = np.asarray(values, dtype=float).ravel(), np.asarray(levels, dtype=float).ravel()
    below = y[:-1, None] < level[None, :]
    above = y[1:, None] >= level[None, :]
    return np.asarray(np.sum(below & above, axis=0), dtype=np.int64)


def _edges(edges: ArrayLike) -> Array:
    limits = np.asarray(edges, dtype=float).ravel()
    if limits.size < 2 or not np.all(np.isfinite(limits)) or np.any(np.diff(limits) <= 0.0):
        raise InputDataError("class limits must be finite and rising, at least two of them")
    return limits


@compile_kernel
def _count(
    chunk: Array, memory: IntArray, last: Array, values: Array, indices: IntArray, rows: Array, places: IntArray
) -> int:
    """Take in samples; write the cycles that closed and return their number.

    ``values`` and ``indices`` are the stack of open turning points, ``last`` the sample before.
    """
    seen, depth, direction = memory[0], memory[1], memory[2]
    before = last[0]
    closed = 0
    for k in range(len(chunk)):
        x = chunk[k]
        if seen == 0:
            values[0], indices[0] = x, 0
            depth = 1
        elif x != before:
            step = 1 if x > before else -1
            if direction == -step:
                values[depth], indices[depth] = before, seen - 1
                depth += 1
                closed, depth = _close(closed, depth, values, indices, rows, places)
            direction = step
        before = x
        seen += 1
    memory[0], memory[1], memory[2] = seen, depth, direction
    last[0] = before
    return closed


@compile_kernel
def _close(
    closed: int, depth: int, values: Array, indices: IntArray, rows: Array, places: IntArray
) -> tuple[int, int]:
    """Count what the newest turning point closes (E1049 5.4.4 steps 3 to 5)."""
    while depth >= 3:
        newest = abs(values[depth - 1] - values[depth - 2])
        previous = abs(values[depth - 2] - values[depth - 3])
        if newest < previous:
            break
        rows[closed, 0], rows[closed, 1] = values[depth - 3], values[depth - 2]
        places[closed, 0], places[closed, 1] = indices[depth - 3], indices[depth - 2]
        if depth == 3:
            # the range holds the starting point: half a cycle, and the next point becomes the start
            rows[closed, 2] = 0.5
            values[0], values[1] = values[1], values[2]
            indices[0], indices[1] = indices[1], indices[2]
            depth = 2
        else:
            rows[closed, 2] = 1.0
            values[depth - 3], indices[depth - 3] = values[depth - 1], indices[depth - 1]
            depth -= 2
        closed += 1
    return closed, depth


@compile_kernel
def _finish(
    depth: int, last: float, index: int, values: Array, indices: IntArray, rows: Array, places: IntArray
) -> int:
    """Count the open turning points and the last sample; ``values`` is a copy that may be changed."""
    values[depth], indices[depth] = last, index
    depth += 1
    closed, depth = _close(0, depth, values, indices, rows, places)
    for k in range(depth - 1):
        if values[k] != values[k + 1]:
            rows[closed, 0], rows[closed, 1], rows[closed, 2] = values[k], values[k + 1], 0.5
            places[closed, 0], places[closed, 1] = indices[k], indices[k + 1]
            closed += 1
    return closed
