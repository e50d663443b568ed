# Copyright 2026 ride_estimation contributors
"""A recording into an aligner, many samples at a time: the very blocks that pushing every sample in order of arrival gives.

Between two blocks the normal sample, one step further in time, only lengthens the buffer of its stream, so the order of such
samples does not matter; what matters is with which sample the block is complete. That sample is found here, everything up to it
is appended at once, and whatever is not normal goes through :meth:`StampAligner.push` one by one.
"""

from __future__ import annotations

import bisect
import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.signals.alignment import StampAligner
from ride_estimation.signals.recording import Channel
from ride_estimation.signals.streams import LEAST, Block, Stream

#: distance of two samples that is normal, in units of the median
_NORMAL = 1.25
#: samples pushed one by one before many are tried again
_SINGLES = 200


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
        stamps = np.where(raw > 0, raw - stream.delay, raw)
        values = np.ascontiguousarray(channel.values, dtype=np.float64)
        steps = np.diff(stamps)
        forward = steps[steps > 0]
        widest = int(_NORMAL * float(np.median(forward))) if forward.size else 0
        unusual = ~np.isfinite(values.sum(axis=1)) | (values.shape[1] != stream.width)
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

    @property
    def more(self) -> bool:
        """Return whether samples are left."""
        return self._next < len(self._owner)

    def step(self) -> tuple[Sequence[Block], int]:
        """Take samples until a block is complete; return the blocks and how many samples were taken."""
        before = self._next
        blocks = self._many() if self._sorted else None
        if blocks is None:
            blocks = self._singly()
        return blocks, self._next - before

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
    stream.last = source.stamps[stop - 1]
    stream.accepted += stop - place
    stream.after += max(stop - first, 0)
    stream.candidates = 0
    newest = source.stated[stop - 1]
    if newest >= place and source.variance is not None:
        stream.variance = tuple(source.variance[newest].tolist())
    source.place = stop
