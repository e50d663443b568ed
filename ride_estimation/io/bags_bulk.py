# Copyright 2026 ride_estimation contributors
"""Messages of a run topic by topic, decoded where they lie, without an object per message where that is possible.

A recording of an hour holds ten million messages of a few hundred bytes. Of an MCAP file the records of each chunk are found
in one pass and the fields that count are taken out of it together; the messages of other containers come one by one and are
taken together in batches.
"""

from __future__ import annotations

import dataclasses
import operator
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ride_estimation.io.bounded import TooLargeError, allowance
from ride_estimation.io.cdr import DecodedTopic, decode_at, rows_at
from ride_estimation.io.mcap_records import (
    CHANNEL,
    LATEST,
    MESSAGE,
    MESSAGE_HEAD,
    RECORD,
    SCHEMA,
    Contents,
    Ending,
    record_runs,
)

IntArray = NDArray[np.int64]
RawMessage = tuple[str, int, bytes]

#: from the beginning of a message record to its data [bytes]
_BEFORE_DATA = RECORD.size + MESSAGE_HEAD.size
#: messages that came one by one and are taken together, and what a message needs beside its own bytes [bytes]
_BATCH, _PER_MESSAGE = 1 << 20, 200


@dataclasses.dataclass(frozen=True)
class Layout:
    """How the messages of a topic can be decoded in bulk: their type, and the first of its doubles that is wanted."""

    message_type: str
    first: int


@dataclasses.dataclass(frozen=True)
class RawMessages:
    """Serialised messages where they lie in longer pieces: an object for each of many small ones would fill the memory.

    Attributes
    ----------
    numbers
        Of each among the messages of its topic, rising, shape (M,).
    piece, at, lengths
        In which piece each lies, from which byte on, and how long it is, shape (M,).
    pieces
        The bytes.
    """

    numbers: IntArray
    piece: IntArray
    at: IntArray
    lengths: IntArray
    pieces: tuple[bytes, ...]

    def __len__(self) -> int:
        return len(self.numbers)

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        """Yield number and bytes of each."""
        for i, number in enumerate(self.numbers):
            yield int(number), self[i]

    def __getitem__(self, i: int) -> bytes:
        """Return the bytes of the i-th of them."""
        at = int(self.at[i])
        return self.pieces[int(self.piece[i])][at : at + int(self.lengths[i])]


@dataclasses.dataclass(frozen=True)
class TopicMessages:
    """Messages of one topic in order of arrival.

    Attributes
    ----------
    order
        Place of each among the messages of all topics wanted, shape (N,).
    arrival
        Receive times, shape (N,) [ns].
    decoded
        What could be decoded in bulk, None where nothing could be.
    raw
        The messages that were not decoded.
    """

    order: IntArray
    arrival: IntArray
    decoded: DecodedTopic | None
    raw: RawMessages


def in_order(topics: Mapping[str, TopicMessages]) -> Iterator[RawMessage]:
    """Yield (topic, receive time [ns], bytes) in order of arrival; nothing of the topics is decoded."""
    names, found = list(topics), list(topics.values())
    order = _joined(t.order for t in found)
    owner = np.repeat(np.arange(len(found)), [len(t.order) for t in found])
    within = _joined(np.arange(len(t.order)) for t in found)
    for i in np.argsort(order):
        messages, number = found[owner[i]], int(within[i])
        yield names[owner[i]], int(messages.arrival[number]), messages.raw[number]


@dataclasses.dataclass(frozen=True)
class _Part:
    """Messages of one topic in one run of records: places in the run, receive times, what was decoded, and the rest.

    ``left`` are the messages that were not decoded, ``at`` and ``lengths`` say where in ``data`` they lie.
    """

    place: IntArray
    arrival: IntArray
    decoded: DecodedTopic | None
    left: IntArray
    at: IntArray
    lengths: IntArray
    data: bytes


class Collector:
    """Collects the messages of the wanted topics, from records of MCAP files or one by one.

    Parameters
    ----------
    topics
        Topics wanted and, where their messages can be decoded in bulk, how.
    """

    def __init__(self, topics: Mapping[str, Layout | None]) -> None:
        self.contents, self.topics = Contents(), topics
        self._parts: dict[str, list[_Part]] = {topic: [] for topic in topics}
        self._waiting: dict[str, list[tuple[int, int, bytes]]] = {topic: [] for topic in topics}
        self._waiting_bytes = 0
        self._count, self._first, self._last = 0, LATEST, 0
        self.allow(0)

    def allow(self, size: int) -> None:
        """Say how large the file is that is taken next [bytes]: what is kept of it may need no more than its allowance."""
        self.flush()
        self._allowed = self._left = allowance(size)

    @property
    def extent(self) -> tuple[int, float]:
        """Number of messages seen and the time between the first and the last [s]."""
        return self._count, max(self._last - self._first, 0) * 1e-9

    def take_mcap(self, path: Path, ending: Ending | None) -> None:
        """Take an MCAP file.

        Parameters
        ----------
        path
            The file; its schemas and channels become :attr:`contents`.
        ending
            Its end, None where it is cut off.

        Raises
        ------
        One of :data:`ride_estimation.io.mcap_records.DAMAGE`
            Where damage is met; what stands before it is taken.
        """
        self.contents, before = Contents(), self._count
        self.allow(path.stat().st_size)
        for records in record_runs(path, ending):
            self.take(records)
        if ending is not None and ending.messages not in (None, self._count - before):
            raise ValueError(f"{ending.messages} messages were written and {self._count - before} are there")

    def take(self, data: bytes) -> None:
        """Take whole records; raises one of :data:`ride_estimation.io.mcap_records.DAMAGE` where they are none."""
        at, end, record = 0, len(data), RECORD.unpack_from
        found: list[int] = []
        while at < end:
            code, length = record(data, at)
            last = at + RECORD.size + length
            if last > end:
                raise ValueError(f"a record of {length} bytes leaves its chunk")
            if code == MESSAGE:
                found.append(at)
            elif code in (SCHEMA, CHANNEL):
                # messages before it belong to what the number meant until now
                self._add(data, found)
                found = []
                self.contents.take(code, memoryview(data)[at + RECORD.size : last])
            at = last
        self._add(data, found)

    def _add(self, data: bytes, found: list[int]) -> None:
        """Take the message records that begin at some places."""
        if not found:
            return
        at = np.array(found, dtype=np.int64)
        lengths = _numbers(data, "<u8", at + 1).astype(np.int64) - MESSAGE_HEAD.size
        if lengths.min() < 0:
            raise ValueError("a message record is shorter than its head")
        keys, arrival = _numbers(data, "<u2", at + RECORD.size), _numbers(data, "<u8", at + RECORD.size + 6)
        if int(arrival.max()) > LATEST:
            raise ValueError(f"a message was received at {int(arrival.max())} ns, which no clock shows")
        times = arrival.astype(np.int64)
        at = at + _BEFORE_DATA
        counts = np.bincount(keys)
        for key in np.flatnonzero(counts).tolist():
            if key not in self.contents.channels:
                raise ValueError(f"a message of channel {key}, which is not described before it")
            self.contents.counts[key] = self.contents.counts.get(key, 0) + int(counts[key])
            topic = self.contents.channels[key].topic
            if topic in self.topics:
                own = np.flatnonzero(keys == key)
                self._parts[topic].append(self._part(data, topic, self._count + own, times[own], at[own], lengths[own]))
        self._saw(len(at), int(times.min()), int(times.max()))

    def pass_over(self, arrival: int) -> None:
        """Count a message that is not wanted.

        Raises
        ------
        TypeError, ValueError
            A time of arrival that is none: a damaged table may hold anything.
        """
        if not -(1 << 63) <= operator.index(arrival) < 1 << 63:
            raise ValueError(f"a time of arrival of {arrival}")
        self._saw(1, arrival, arrival)

    def add(self, topic: str, arrival: int, raw: bytes) -> None:
        """Take one message of a topic wanted; raises as :meth:`pass_over`."""
        self.pass_over(arrival)
        self._waiting_bytes += _PER_MESSAGE + len(memoryview(raw))
        self._waiting[topic].append((self._count, arrival, raw))
        if self._waiting_bytes > _BATCH:
            self.flush()

    def flush(self) -> None:
        """Take the messages that came one by one together; the last of a file before the next is allowed."""
        for topic, messages in self._waiting.items():
            if messages:
                place, arrival = np.array([m[:2] for m in messages], dtype=np.int64).T
                lengths = np.array([len(m[2]) for m in messages], dtype=np.int64)
                data = b"".join(m[2] for m in messages)
                self._parts[topic].append(self._part(data, topic, place, arrival, np.cumsum(lengths) - lengths, lengths))
                messages.clear()
        self._waiting_bytes = 0

    def _saw(self, count: int, first: int, last: int) -> None:
        self._count += count
        self._first, self._last = min(self._first, first), max(self._last, last)

    def _part(self, data: bytes, topic: str, place: IntArray, arrival: IntArray, at: IntArray, lengths: IntArray) -> _Part:
        self._left -= int(lengths.sum()) + _PER_MESSAGE * len(at)
        if self._left < 0:
            raise TooLargeError(self._allowed)
        layout, decoded, left = self.topics[topic], None, np.arange(len(at))
        # by arrival: the first name of a frame is the one that arrived first
        by = np.argsort(arrival, kind="stable")
        place, arrival, at, lengths = place[by], arrival[by], at[by], lengths[by]
        if layout is not None:
            decoded = decode_at(layout.message_type, data, at, lengths, layout.first)
            left = np.flatnonzero(~decoded.decoded)
        at, lengths = at[left], lengths[left]
        # only these bytes: a piece of them would keep the whole chunk
        kept = b"".join(data[a : a + n] for a, n in zip(at.tolist(), lengths.tolist(), strict=True))
        return _Part(place, arrival, decoded, left, np.cumsum(lengths) - lengths, lengths, kept)

    def finished(self) -> dict[str, TopicMessages]:
        """Return what was collected by topic, in order of arrival."""
        self.flush()
        place = _joined(p.place for parts in self._parts.values() for p in parts)
        arrival = _joined(p.arrival for parts in self._parts.values() for p in parts)
        order = np.empty(len(place), dtype=np.int64)
        # messages that arrived at the same time stay in the order of the file
        order[np.lexsort((place, arrival))] = np.arange(len(place))
        found, start = {}, 0
        for topic, parts in self._parts.items():
            stop = start + sum(len(p.place) for p in parts)
            found[topic] = _sorted(parts, order[start:stop], arrival[start:stop])
            start = stop
        return found


def _sorted(parts: list[_Part], order: IntArray, arrival: IntArray) -> TopicMessages:
    """Return the parts of a topic as one, in order of arrival."""
    by = np.argsort(order)
    number = np.empty(len(by), dtype=np.int64)
    number[by] = np.arange(len(by))
    starts = np.cumsum([0, *(len(p.place) for p in parts)])
    decoded = None
    known = [p.decoded for p in parts if p.decoded is not None]
    if known:
        done = np.concatenate([d.decoded for d in known])
        rows = np.argsort(number[done])
        named = [(int(p.arrival[0]), d.frame_id) for p, d in zip(parts, known) if d.frame_id]
        frame = min(named, key=lambda entry: entry[0], default=(0, ""))[1]
        stamps, fields = np.concatenate([d.stamp_ns for d in known]), np.concatenate([d.fields for d in known])
        decoded = DecodedTopic(done[by], stamps[rows], fields[rows], frame)
    left = number[_joined(start + p.left for start, p in zip(starts, parts))]
    piece = np.repeat(np.arange(len(parts)), [len(p.left) for p in parts])
    first = np.argsort(left)
    raw = RawMessages(
        left[first], piece[first], _joined(p.at for p in parts)[first], _joined(p.lengths for p in parts)[first],
        tuple(p.data for p in parts),
    )  # fmt: skip
    return TopicMessages(order[by], arrival[by], decoded, raw)


def _joined(arrays: Iterable[IntArray]) -> IntArray:
    return np.concatenate([np.zeros(0, dtype=np.int64), *arrays])


def _numbers(data: bytes, kind: str, at: IntArray) -> NDArray[np.unsignedinteger]:
    """Return the numbers of a type that begin at some places of the data."""
    return rows_at(data, at, np.dtype(kind).itemsize).view(kind)[:, 0]
