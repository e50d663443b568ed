# Copyright 2026 ride_estimation contributors
"""Many messages of a topic decoded at once from their little-endian CDR bytes.

Layout: 4 bytes encapsulation, ``int32 sec``, ``uint32 nanosec``, the ``frame_id`` string, then doubles aligned to 8 bytes
counted from the end of the encapsulation. Messages whose bytes are laid out differently, or that a general reader might refuse,
are left to the caller.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: encapsulation, stamp and length of the frame_id; what a message may be longer than its fields [bytes]
_HEAD, _PADDING = 16, 3
#: different names of frames that are looked at; messages with more are left to the caller
_NAMES = 8

#: doubles after the header
_DOUBLES: Mapping[str, int] = {
    "sensor_msgs/msg/Imu": 37,
    "geometry_msgs/msg/AccelStamped": 6,
    "geometry_msgs/msg/Vector3Stamped": 3,
    "geometry_msgs/msg/TwistStamped": 6,
    "geometry_msgs/msg/WrenchStamped": 6,
}


@dataclasses.dataclass(frozen=True)
class DecodedTopic:
    """Messages that could be decoded in bulk.

    Attributes
    ----------
    decoded
        Which of the messages, shape (N,) bool.
    stamp_ns
        Header stamps of those that were, shape (D,) [ns].
    fields
        Their doubles after the header from the first one wanted on, shape (D, K).
    frame_id
        The first that is not empty.
    """

    decoded: NDArray[np.bool_]
    stamp_ns: NDArray[np.int64]
    fields: Array
    frame_id: str


def has_fixed_layout(message_type: str) -> bool:
    """Return whether messages of a type can be decoded in bulk."""
    return message_type in _DOUBLES


def decode_at(message_type: str, data: bytes, at: IntArray, lengths: IntArray, first: int = 0) -> DecodedTopic:
    """Decode messages of fixed layout where they lie.

    Parameters
    ----------
    message_type
        One that :func:`has_fixed_layout`.
    data
        Holds all messages.
    at, lengths
        Where each begins and how long it is, within ``data``, shape (N,), at least one [bytes].
    first
        First of the doubles after the header that is wanted.
    """
    doubles, decoded = _DOUBLES[message_type], np.zeros(len(at), dtype=np.bool_)
    whole = np.flatnonzero(lengths >= _HEAD)
    head = rows_at(data, at[whole], _HEAD)
    text = head[:, 12:16].copy().view("<u4")[:, 0].astype(np.int64)
    start = 4 + ((12 + text + 7) & ~7)
    spare = lengths[whole] - start - 8 * doubles
    fit = (head[:, 0] == 0) & (head[:, 1] == 1) & (text > 0) & (spare >= 0) & (spare <= _PADDING)
    readable, frame = _readable(data, at[whole[fit]] + _HEAD, text[fit])
    chosen = np.flatnonzero(fit)[readable]
    members, head = whole[chosen], head[chosen]
    seconds = head[:, 4:8].copy().view("<i4")[:, 0].astype(np.int64)
    stamps = seconds * 1_000_000_000 + head[:, 8:12].copy().view("<u4")[:, 0]
    fields = rows_at(data, at[members] + start[chosen] + 8 * first, 8 * (doubles - first)).view("<f8")
    decoded[members] = True
    return DecodedTopic(decoded, stamps, fields, frame)


def _readable(data: bytes, at: IntArray, lengths: IntArray) -> tuple[NDArray[np.bool_], str]:
    """Return which texts, with the zero at their end, can be read, shape (N,), and the first that is not empty."""
    good, left, first = np.zeros(len(at), dtype=np.bool_), np.ones(len(at), dtype=np.bool_), ""
    for _ in range(_NAMES):
        if not left.any():
            break
        place = int(np.argmax(left))
        start, length = int(at[place]), int(lengths[place])
        same = np.flatnonzero(left & (lengths == length))
        rows = rows_at(data, at[same], length)
        same = same[(rows == rows[0]).all(axis=1)]
        left[same] = False
        text = data[start : start + length]
        if text[-1] != 0:
            continue
        try:
            name = text[:-1].decode()
        except UnicodeDecodeError:
            continue
        good[same] = True
        first = first or name
    return good, first


def rows_at(data: bytes, at: IntArray, width: int) -> NDArray[np.uint8]:
    """Return so many bytes from each place on, shape (N, width)."""
    if not len(at):
        return np.zeros((0, width), dtype=np.uint8)
    overlapping: NDArray[Any] = np.ndarray((len(data) - width + 1, width), np.uint8, data, strides=(1, 1))
    return np.asarray(overlapping[at])
