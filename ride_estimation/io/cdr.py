# Copyright 2026 ride_estimation contributors
"""All messages of a topic decoded at once from their little-endian CDR bytes.

Layout: 4 bytes encapsulation, ``int32 sec``, ``uint32 nanosec``, the ``frame_id`` string, then doubles aligned to 8 bytes
counted from the end of the encapsulation. Messages whose bytes are laid out differently are left to the caller.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
        Header stamps, shape (N,) [ns]; zero where not decoded.
    fields
        Doubles after the header, shape (N, K).
    frame_id
        Of the first message.
    """

    decoded: NDArray[np.bool_]
    stamp_ns: NDArray[np.int64]
    fields: Array
    frame_id: str


def decode_topic(message_type: str, raw: Sequence[bytes]) -> DecodedTopic | None:
    """Decode messages of fixed layout, None where the type has none.

    Parameters
    ----------
    message_type
        As in ``sensor_msgs/msg/Imu``.
    raw
        Serialised messages.
    """
    doubles = _DOUBLES.get(message_type)
    if doubles is None or not raw:
        return None
    count = len(raw)
    decoded = np.zeros(count, dtype=np.bool_)
    stamps = np.zeros(count, dtype=np.int64)
    fields = np.zeros((count, doubles))
    frame = ""
    lengths = np.fromiter((len(r) for r in raw), dtype=np.int64, count=count)
    for length in np.unique(lengths):
        members = np.flatnonzero(lengths == length)
        table = np.frombuffer(b"".join([raw[int(i)] for i in members]), dtype=np.uint8).reshape(len(members), length)
        if length < 16:
            continue
        text_lengths = np.ascontiguousarray(table[:, 12:16]).view("<u4")[:, 0]
        for text_length in np.unique(text_lengths):
            start = 4 + ((12 + int(text_length) + 7) & ~7)
            if start + 8 * doubles > length:
                continue
            fit = (text_lengths == text_length) & (table[:, 0] == 0) & (table[:, 1] == 1)
            rows = table[fit]
            if not len(rows):
                continue
            at = members[fit]
            seconds = np.ascontiguousarray(rows[:, 4:8]).view("<i4")[:, 0].astype(np.int64)
            rest = np.ascontiguousarray(rows[:, 8:12]).view("<u4")[:, 0].astype(np.int64)
            stamps[at] = seconds * 1_000_000_000 + rest
            fields[at] = np.ascontiguousarray(rows[:, start : start + 8 * doubles]).view("<f8")
            decoded[at] = True
            if at[0] == 0:
                frame = rows[0, 16 : 16 + int(text_length)].tobytes().rstrip(b"\0").decode("utf-8", "replace")
    return DecodedTopic(decoded, stamps, fields, frame)
