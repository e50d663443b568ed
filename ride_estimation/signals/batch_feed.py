# Copyright 2026 ride_estimation contributors
"""A recording into an aligner, many samples at a time: the very blocks that pushing every sample in order of arrival gives.

Between two blocks the normal sample, one step further in time, only lengthens the buffer of its stream, so the order of such
samples does not matter; what matters is with which sample the block is complete. While all streams go on normally, a hundred
blocks are planned and interpolated in one pass of a kernel and handed out one by one. Where that is not plain, the sample that
completes the next block is found alone and everything up to it is appended at once; whatever is not normal goes through
:meth:`StampAligner.push` one by one.
"""

from __future__ import annotations

import bisect
import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.signals.alignment import StampAligner
from ride_estimation.signals.batch_kernel import PLAN_FIRST, PLAN_PERIOD, PLAN_STOP, fill_blocks, plan_blocks
from ride_estimation.signals.recording import Channel
from ride_estimation.signals.streams import KEEP, LEAST, Block, Stream

IntArray = NDArray[np.int64]

#: distance of two samples that is normal, in units of the median
_NORMAL = 1.25
#: samples pushed one by one before many are tried again
_SINGLES = 200
#: blocks planned together, and blocks made alone after a plan that failed before another one is tried
_PLANNED, _ALONE = 100, 16


@dataclasses.dataclass
class _Source:
    """Samples of one stream: where it stands and what was found out about all of them beforehand.

    Attributes
    ----------
    stamps, ranks
        Stamps with the delay of the sensor taken off, place in the order of arrival of the whole run.
    unusual
        Number of samples before each one that are not normal, one entry more than samples.
    stated
        Newest sample up to each one whose message states a variance, -1 before the first.
    widest
        Largest normal distance [ns].
    """

    stamps: list[int]
    ranks: list[int]
    stamp_bytes: bytes
    value_bytes: bytes
    values: NDArray[np.float64]
    variance: NDArray[np.float64] | None
    raw_stamps: NDArray[np.int64]
    unusual: list[int]
    stated: list[int]
    widest: int
    place: int = 0

    @classmethod
    def of(cls, channel: Channel, stream: Stream, ranks: NDArray[np.int64]) -> _Source:
        """Return the samples of a channel that goes to a stream."""
        raw = np.asarray(channel.stamp_ns, dtype=np.int64)
        stamps = _late(raw, stream.delay)
        values = np.ascontiguousarray(channel.values, dtype=np.float64)
        steps = np.diff(stamps)
        forward = steps[steps > 0]
        widest = int(_NORMAL * float(np.median(forward))) if forward.size else 0
        unusual = ~(np.abs(values).sum(axis=1) < stream.lowest) | (values.shape[1] != stream.width)
        unusual[0] = True
        unusual[1:] |= (steps <= 0) | (steps > widest)
        stated = np.full(len(stamps), -1)
        if channel.variance is not None:
            given = ~np.isnan(channel.variance[:, 0])
            stated = np.maximum.accumulate(np.where(given, np.arange(len(stamps)), -1))
        return cls(
            stamps.tolist(), ranks.tolist(), stamps.tobytes(), values.tobytes(), values, channel.variance, raw,
            [0, *np.cumsum(unusual).tolist()], stated.tolist(), widest,
        )  # fmt: skip

    def delayed(self, delay_ns: int) -> None:
        """Take the readings as so much late."""
        stamps = _late(self.raw_stamps, delay_ns)
        self.stamps, self.stamp_bytes = stamps.tolist(), stamps.tobytes()


class _Flat:
    """The samples of all streams, one stream after the other, as the kernels take them."""

    def __init__(self, sources: Sequence[_Source], columns: Sequence[slice]) -> None:
        self.sources = sources
        self.stamps = np.concatenate([np.array(s.stamps, dtype=np.int64) for s in sources])
        self.ranks = np.concatenate([np.array(s.ranks, dtype=np.int64) for s in sources])
        self.unusual = np.concatenate([np.array(s.unusual, dtype=np.int64) for s in sources])
        self.samples = np.concatenate([s.values.ravel() for s in sources])
        self.starts = np.cumsum([0, *(len(s.stamps) for s in sources)])
        widths = [s.values.shape[1] for s in sources]
        places = np.cumsum([0, *(s.values.size for s in sources)])[:-1]
        self.layout = np.array([[w, c.start, 1, p] for w, c, p in zip(widths, columns, places)], dtype=np.int64)


@dataclasses.dataclass
class _Stretch:
    """Blocks that are interpolated already, and what becomes of the streams with each of them.

    Attributes
    ----------
    values, valid
        Of all blocks, shapes (B ticks, C) and (B ticks, S).
    plan, last
        Of :func:`plan_blocks`, as lists.
    first_tick, step, ticks
        Of the first block [ns], of the time base [ns], of every block.
    keep
        First sample that stays in the buffer of every stream at the end.
    """

    values: NDArray[np.float64]
    valid: NDArray[np.bool_]
    plan: list[list[list[int]]]
    last: list[int]
    first_tick: int
    step: int
    ticks: int
    keep: list[int]
    handed: int = 0


class BatchFeed:
    """Feed of one recording.

    Parameters
    ----------
    aligner
        Takes the samples.
    channels
        The recorded samples of every stream of the aligner, None where there are none.
    """

    def __init__(self, aligner: StampAligner, channels: Sequence[Channel | None]) -> None:
        self._aligner = aligner
        used = [(i, c) for i, c in enumerate(channels) if c is not None and len(c.stamp_ns)]
        owner = np.concatenate([np.full(len(c.stamp_ns), i) for i, c in used]) if used else np.zeros(0, dtype=np.int64)
        key = [c.arrival_ns if c.order is None else c.order for _, c in used]
        by_arrival = np.argsort(np.concatenate(key), kind="stable") if used else np.zeros(0, dtype=np.int64)
        self._owner: list[int] = owner[by_arrival].tolist()
        place = np.empty(len(by_arrival), dtype=np.int64)
        place[by_arrival] = np.arange(len(by_arrival))
        self._sources: list[_Source | None] = [None] * len(channels)
        start = 0
        # within a channel the order of arrival is that of the list
        self._sorted = True
        for i, channel in used:
            ranks = place[start : start + len(channel.stamp_ns)]
            self._sorted = self._sorted and bool(np.all(np.diff(ranks) > 0))
            self._sources[i] = _Source.of(channel, aligner._streams[i], ranks)
            start += len(channel.stamp_ns)
        self._position = np.concatenate([np.arange(len(c.stamp_ns)) for _, c in used])[by_arrival].tolist() if used else []
        self._next = 0
        sources = [s for s in self._sources if s is not None]
        whole = len(sources) == len(self._sources) and self._sorted and all(s.spec.waited_for for s in aligner._streams)
        fit = whole and all(s.values.shape[1] == stream.width for s, stream in zip(sources, aligner._streams))
        self._flat = _Flat(sources, aligner.columns) if fit and sources else None
        self._stretch: _Stretch | None = None
        self._alone = 0

    @property
    def more(self) -> bool:
        """Return whether samples are left, or blocks that wait to be handed out."""
        return self._stretch is not None or self._next < len(self._owner)

    def step(self) -> tuple[Sequence[Block], int]:
        """Take samples until a block is complete; return the blocks and how many samples were taken."""
        before = self._next
        if self._aligner.waits_to_delay:
            self._take_delays()
        if self._stretch is None and self._flat is not None:
            self._alone -= 1
            if self._alone < 0:
                self._stretch = self._planned(self._flat)
        if self._stretch is not None and self._flat is not None:
            return self._handed(self._stretch, self._flat), self._next - before
        blocks = self._many() if self._sorted else None
        if blocks is None:
            blocks = self._singly()
        return blocks, self._next - before

    def _take_delays(self) -> None:
        """Apply delays that wait for the next sample where one comes next: of a stretch some blocks may need none any more."""
        stretch = self._stretch
        if stretch is not None:
            if stretch.last[stretch.handed] < self._next:
                return
            self._stretch = None
            self._end(stretch, [planned[PLAN_FIRST] for planned in stretch.plan[stretch.handed]], stretch.handed)
        self._aligner.take_delays()
        for stream, source in zip(self._aligner._streams, self._sources):
            if source is not None:
                source.delayed(stream.delay)
        if self._flat is not None:
            self._flat = _Flat(self._flat.sources, self._aligner.columns)

    def _singly(self) -> Sequence[Block]:
        """Push sample by sample until blocks come out."""
        for _ in range(min(_SINGLES, len(self._owner) - self._next)):
            stream, k = self._owner[self._next], self._position[self._next]
            self._next += 1
            source = self._sources[stream]
            if source is None:
                continue
            source.place = k + 1
            stated = None
            if source.variance is not None and not math.isnan(source.variance[k, 0]):
                stated = tuple(source.variance[k].tolist())
            blocks = self._aligner.push(stream, int(source.raw_stamps[k]), tuple(source.values[k].tolist()), stated)
            if blocks:
                return blocks
        return ()

    def _many(self) -> Sequence[Block] | None:
        """Append all samples up to the one that completes the block; None where that is not plain."""
        aligner = self._aligner
        if aligner._step == 0 or aligner._ready:
            return None
        last = -1
        found: list[tuple[Stream, _Source, int]] = []
        quiet: list[_Source] = []
        for stream, source in zip(aligner._streams, self._sources):
            if stream.silent or source is None:
                if not stream.silent:
                    return None
                if source is not None:
                    quiet.append(source)
                continue
            first = source.place
            if stream.after < stream.need:
                if not stream.after:
                    first = bisect.bisect_left(source.stamps, stream.end, source.place)
                completing = first + stream.need - stream.after - 1
                if completing >= len(source.stamps):
                    return None
                last = max(last, source.ranks[completing])
            found.append((stream, source, first))
        if last < 0 or any(s.place < len(s.ranks) and s.ranks[s.place] <= last for s in quiet):
            return None
        stops = [bisect.bisect_right(source.ranks, last, source.place) for _, source, _ in found]
        if not all(_normal(stream, source, stop, aligner) for (stream, source, _), stop in zip(found, stops)):
            return None
        for (stream, source, first), stop in zip(found, stops):
            _append(stream, source, first, stop)
        self._next = last + 1
        return aligner.filled(max(stream.last for stream, _, _ in found))


    # -- a stretch of many blocks ------------------------------------------------------------------------------------------

    def _planned(self, flat: _Flat) -> _Stretch | None:
        """Interpolate as many coming blocks as are plain, None where there is none; the streams stay as they are."""
        aligner, streams = self._aligner, self._aligner._streams
        if aligner._step == 0 or aligner._ready or aligner._restart or aligner._newest > aligner._deadline:
            return None
        if not all(_contiguous(stream, source) for stream, source in zip(streams, flat.sources)):
            return None
        state = np.array(
            [[source.place - len(s.stamps), source.place, source.place - len(s.stamps), s.period, s.points, source.widest]
             for s, source in zip(streams, flat.sources)], dtype=np.int64,
        )  # fmt: skip
        first, step, ticks = aligner._next, aligner._step, aligner._ticks
        base = np.array([first, step, ticks, LEAST, KEEP, aligner._wait, aligner._floor, self._next - 1], dtype=np.int64)
        plan, last = np.empty((_PLANNED, len(streams), 4), dtype=np.int64), np.empty(_PLANNED, dtype=np.int64)
        arrays = flat.stamps, flat.ranks, flat.unusual, flat.starts
        found = int(plan_blocks(*arrays, state, base, aligner._gap_periods, plan, last))
        if not found:
            self._alone = _ALONE
            return None
        flat.layout[:, 2] = [s.points for s in streams]
        values, valid = np.empty((found * ticks, aligner._width)), np.empty((found * ticks, len(streams)), dtype=np.bool_)
        fill_blocks(flat.stamps, flat.samples, flat.starts, flat.layout, plan[:found], first, step, ticks, values, valid)
        for s, columns in zip(streams, aligner.columns):
            if s.spec.correction.changes_values:
                values[:, columns] = s.spec.correction.apply(values[:, columns])
        return _Stretch(values, valid, plan[:found].tolist(), last[:found].tolist(), first, step, ticks, state[:, 0].tolist())

    def _handed(self, stretch: _Stretch, flat: _Flat) -> Sequence[Block]:
        """Return the next block of a stretch and take its samples; after the last also what needs no further sample."""
        aligner, number = self._aligner, stretch.handed
        stretch.handed += 1
        newest = aligner._newest
        for stream, source, planned in zip(aligner._streams, flat.sources, stretch.plan[number]):
            _take(stream, source, planned[PLAN_STOP])
            stream.period = planned[PLAN_PERIOD]
            newest = max(newest, stream.last)
        aligner._newest = newest
        self._next = stretch.last[number] + 1
        rows = slice(number * stretch.ticks, (number + 1) * stretch.ticks)
        start = stretch.first_tick + rows.start * stretch.step
        block = Block(start, stretch.step, stretch.values[rows], stretch.valid[rows])
        if stretch.handed < len(stretch.plan):
            return (block,)
        self._stretch = None
        self._end(stretch, stretch.keep, stretch.handed)
        aligner._advance()
        return (block, *aligner._take())

    def _end(self, stretch: _Stretch, keep: Sequence[int], handed: int) -> None:
        """Put the streams as they are after so many blocks of a stretch, with the samples from ``keep`` on in their buffers."""
        aligner = self._aligner
        for stream, source, first in zip(aligner._streams, self._sources, keep):
            if source is not None:
                _refill(stream, source, first)
        start = stretch.first_tick + handed * stretch.ticks * stretch.step
        aligner._floor = start - stretch.step
        aligner._begin_block(start)


def _late(stamps: NDArray[np.int64], delay_ns: int) -> NDArray[np.int64]:
    """Return when the readings with these stamps were true."""
    return np.where(stamps > 0, stamps - delay_ns, stamps)


def _contiguous(stream: Stream, source: _Source) -> bool:
    """Return whether a stream speaks normally and its buffer holds the samples of the recording that stand before its place."""
    first, width = source.place - len(stream.stamps), 8 * stream.width
    return (
        not stream.silent
        and stream.need == LEAST
        and first >= 0
        and len(stream.stamps) >= KEEP
        and stream.last == source.stamps[source.place - 1]
        and stream.stamps.tobytes() == source.stamp_bytes[8 * first : 8 * source.place]
        and stream.values.tobytes() == source.value_bytes[width * first : width * source.place]
    )


def _refill(stream: Stream, source: _Source, first: int) -> None:
    """Put the samples from ``first`` to the place of the source into the buffer of a stream."""
    width = 8 * stream.width
    del stream.stamps[:]
    del stream.values[:]
    stream.stamps.frombytes(source.stamp_bytes[8 * first : 8 * source.place])
    stream.values.frombytes(source.value_bytes[width * first : width * source.place])


def _normal(stream: Stream, source: _Source, stop: int, aligner: StampAligner) -> bool:
    """Return whether the samples up to ``stop`` go to the end of the buffer and leave no hole in it."""
    place = source.place
    if place == stop:
        return True
    return (
        place >= 3
        and stream.spec.waited_for
        and stream.need == LEAST
        and source.unusual[stop] == source.unusual[place - 2]
        and stream.last == source.stamps[place - 1]
        and source.widest <= stream.limit
        and 2 * source.widest <= 3 * stream.period
        and source.stamps[place] > aligner._floor
        and source.stamps[stop - 1] <= aligner._deadline
    )


def _append(stream: Stream, source: _Source, first: int, stop: int) -> None:
    place, width = source.place, 8 * stream.width
    if place == stop:
        return
    stream.stamps.frombytes(source.stamp_bytes[8 * place : 8 * stop])
    stream.values.frombytes(source.value_bytes[width * place : width * stop])
    stream.after += max(stop - first, 0)
    _take(stream, source, stop)


def _take(stream: Stream, source: _Source, stop: int) -> None:
    """Count the samples up to ``stop`` as accepted."""
    place = source.place
    if place == stop:
        return
    stream.last = source.stamps[stop - 1]
    stream.accepted += stop - place
    stream.candidates = 0
    if source.variance is not None:
        newest = source.stated[stop - 1]
        if newest >= place:
            stream.variance = tuple(source.variance[newest].tolist())
    source.place = stop
