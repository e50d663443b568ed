# Copyright 2026 ride_estimation contributors
"""Messages of a run topic by topic, decoded where they lie, without an object per message where that is possible.

A recording of an hour holds ten million messages of a few hundred bytes. Of a whole MCAP file the records of each chunk are found
in one pass and the fields that count are taken out of it together; anything unexpected there leaves the file to the general
reader, which gives the same arrays message by message, or the error.
"""

from __future__ import annotations

import dataclasses
import operator
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ride_estimation.io.cdr import DecodedTopic, decode_at, decode_topic, rows_at
from ride_estimation.io.mcap_records import CHANNEL, DAMAGE, LATEST, MESSAGE, MESSAGE_HEAD, RECORD, channel_of, record_runs

IntArray = NDArray[np.int64]

#: from the beginning of a message record to its data [bytes]
_BEFORE_DATA = RECORD.size + MESSAGE_HEAD.size


@dataclasses.dataclass(frozen=True)
class Layout:
    """How the messages of a topic can be decoded in bulk: their type, and the first of its doubles that is wanted."""

    message_type: str
    first: int


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
        Serialised messages that were not decoded, by their number in the topic.
    """

    order: IntArray
    arrival: IntArray
    decoded: DecodedTopic | None
    raw: Mapping[int, bytes]


class MessageList:
    """Messages of one topic that a reader handed out one by one."""

    def __init__(self) -> None:
        self._order: list[int] = []
        self._arrival: list[int] = []
        self._raw: list[bytes] = []

    def add(self, order: int, arrival: int, raw: bytes) -> None:
        """Add a message.

        Raises
        ------
        TypeError, ValueError
            A time of arrival that is none: a damaged table may hold anything.
        """
        if not -(1 << 63) <= operator.index(arrival) < 1 << 63:
            raise ValueError(f"a time of arrival of {arrival}")
        self._order.append(order)
        self._arrival.append(arrival)
        self._raw.append(raw)

    def finished(self, layout: Layout | None) -> TopicMessages:
        """Return the messages, decoded as far as the layout allows."""
        decoded = None if layout is None else decode_topic(layout.message_type, self._raw, layout.first)
        left = range(len(self._raw)) if decoded is None else np.flatnonzero(~decoded.decoded).tolist()
        order, arrival = np.array(self._order, dtype=np.int64), np.array(self._arrival, dtype=np.int64)
        return TopicMessages(order, arrival, decoded, {i: self._raw[i] for i in left})


def read_whole_mcap(path: Path, topics: Mapping[str, Layout | None]) -> dict[str, TopicMessages] | None:
    """Return the messages of some topics of a whole file, None where the general reader has to judge it.

    Parameters
    ----------
    path
        A complete MCAP file (its end has been checked).
    topics
        Topics wanted and, where their messages can be decoded in bulk, how.
    """
    reader = _Reader(topics)
    try:
        for records in record_runs(path):
            reader.take(records)
    except DAMAGE:
        return None
    return reader.finished()


@dataclasses.dataclass(frozen=True)
class _Part:
    """Messages of one topic in one run of records: places in the file, receive times, what was decoded, the rest by place."""

    place: IntArray
    arrival: IntArray
    decoded: DecodedTopic | None
    raw: Mapping[int, bytes]


class _Reader:
    """Collects the messages of the wanted topics, one run of records after the other."""

    def __init__(self, topics: Mapping[str, Layout | None]) -> None:
        self._layouts = topics
        self._channels: dict[int, str] = {}
        self._parts: dict[str, list[_Part]] = {topic: [] for topic in topics}
        self._count = 0

    def take(self, data: bytes) -> None:
        """Take whole records; raises one of :data:`DAMAGE` where they are none."""
        at, end, record = 0, len(data), RECORD.unpack_from
        found: list[int] = []
        while at < end:
            code, length = record(data, at)
            last = at + RECORD.size + length
            if last > end:
                raise ValueError(f"a record of {length} bytes leaves its chunk")
            if code == MESSAGE:
                found.append(at)
            elif code == CHANNEL:
                key, topic = channel_of(memoryview(data)[at + RECORD.size : last])
                if topic in self._layouts and self._channels.get(key) != topic:
                    # messages before it belong to what the number meant until now
                    self._add(data, found)
                    found = []
                    self._channels[key] = topic
            at = last
        self._add(data, found)

    def _add(self, data: bytes, found: list[int]) -> None:
        if not found:
            return
        at = np.array(found, dtype=np.int64)
        lengths = _numbers(data, "<u8", at + 1).astype(np.int64) - MESSAGE_HEAD.size
        if lengths.min() < 0:
            raise ValueError("a message record is shorter than its head")
        keys, arrival = _numbers(data, "<u2", at + RECORD.size), _numbers(data, "<u8", at + RECORD.size + 6)
        place = self._count + np.arange(len(at))
        self._count += len(at)
        at = at + _BEFORE_DATA
        for key, topic in self._channels.items():
            own = np.flatnonzero(keys == key)
            if not len(own):
                continue
            if int(arrival[own].max()) > LATEST:
                raise ValueError("a message was received at a time which no clock shows")
            self._parts[topic].append(
                self._part(data, topic, place[own], arrival[own].astype(np.int64), at[own], lengths[own])
            )

    def _part(self, data: bytes, topic: str, place: IntArray, arrival: IntArray, at: IntArray, lengths: IntArray) -> _Part:
        layout, decoded, left = self._layouts[topic], None, np.arange(len(at))
        if layout is not None:
            # by arrival: the first name of a frame is the one that arrived first
            by = np.argsort(arrival, kind="stable")
            place, arrival, at, lengths = place[by], arrival[by], at[by], lengths[by]
            decoded = decode_at(layout.message_type, data, at, lengths, layout.first)
            left = np.flatnonzero(~decoded.decoded)
        raw = {int(place[i]): data[at[i] : at[i] + lengths[i]] for i in left}
        return _Part(place, arrival, decoded, raw)

    def finished(self) -> dict[str, TopicMessages]:
        """Return what was collected by topic, in order of arrival."""
        place = _joined(p.place for parts in self._parts.values() for p in parts)
        arrival = _joined(p.arrival for parts in self._parts.values() for p in parts)
        order = np.empty(len(place), dtype=np.int64)
        # messages that arrived at the same time stay in the order of the file
        order[np.lexsort((place, arrival))] = np.arange(len(place))
        found, start = {}, 0
        for topic, parts in self._parts.items():
            stop = start + sum(len(p.place) for p in parts)
            found[topic] = _sorted(parts, order[start:stop], place[start:stop], arrival[start:stop])
            start = stop
        return found


def _sorted(parts: list[_Part], order: IntArray, place: IntArray, arrival: IntArray) -> TopicMessages:
    """Return the parts of a topic as one, in order of arrival."""
    by = np.argsort(order)
    known = [p.decoded for p in parts if p.decoded is not None]
    decoded = None
    left = np.arange(len(by))
    if known:
        done = np.concatenate([d.decoded for d in known])[by]
        named = [(int(p.arrival[0]), d.frame_id) for p, d in zip(parts, known) if d.frame_id]
        frame = min(named, key=lambda entry: entry[0], default=(0, ""))[1]
        stamps, fields = np.concatenate([d.stamp_ns for d in known]), np.concatenate([d.fields for d in known])
        decoded = DecodedTopic(done, stamps[by], fields[by], frame)
        left = np.flatnonzero(~done)
    raw = {number: data for p in parts for number, data in p.raw.items()}
    return TopicMessages(order[by], arrival[by], decoded, {int(i): raw[int(place[by[i]])] for i in left})


def _joined(arrays: Iterable[IntArray]) -> IntArray:
    return np.concatenate([np.zeros(0, dtype=np.int64), *arrays])


def _numbers(data: bytes, kind: str, at: IntArray) -> NDArray[np.unsignedinteger]:
    """Return the numbers of a type that begin at some places of the data."""
    return rows_at(data, at, np.dtype(kind).itemsize).view(kind)[:, 0]
