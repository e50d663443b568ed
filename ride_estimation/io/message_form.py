# Copyright 2026 ride_estimation contributors
"""Messages that differ in stamp and numbers only, written in serialized form, several times cheaper than by message objects.

Where stamp and numbers lie is asked of the serializer itself: a message with known ones is serialized once, and they are looked
for in it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores

from ride_estimation.io.bag_source import type_store

Array = NDArray[np.float64]

#: no two bytes alike, and found nowhere else in a message
_STAMP_NS = 0x12345678 * 1_000_000_000 + 0x2BCDEF09
_NUMBER = np.pi
_DOUBLE = struct.Struct("<d")


def serialized(message: Any) -> bytes:
    """Return the CDR bytes of a message of the type store."""
    return bytes(type_store(Stores.ROS2_JAZZY).serialize_cdr(message, message.__msgtype__))


class MessageForm:
    """The serialized form of the messages of one topic.

    Parameters
    ----------
    make
        Returns the message of a stamp [ns] and of numbers, shape (N,).
    count
        How many numbers, N.
    """

    def __init__(self, make: Callable[[int, Array], Any], count: int) -> None:
        numbers = _NUMBER * np.arange(1.0, count + 1.0)
        message = make(_STAMP_NS, numbers)
        self.type_name: str = message.__msgtype__
        whole = serialized(message)
        self._form = np.frombuffer(whole, dtype=np.uint8)
        seconds, nanoseconds = divmod(_STAMP_NS, 1_000_000_000)
        packed = struct.pack("<iI", seconds, nanoseconds)
        # every header of the message has the stamp
        stamps = [place for place in range(len(whole)) if whole.startswith(packed, place)]
        found = [*((place, len(packed)) for place in stamps), *((whole.index(n), len(n)) for n in map(_DOUBLE.pack, numbers))]
        self._stamps = len(stamps)
        self._places = np.concatenate([np.arange(first, first + length) for first, length in found])

    def fill(self, stamps_ns: NDArray[np.int64], numbers: Array) -> list[bytes]:
        """Return the serialized messages of K stamps, shape (K,), and their numbers, shape (K, N)."""
        seconds, nanoseconds = np.divmod(stamps_ns, 1_000_000_000)
        # the bits of both 32-bit numbers, whatever the sign
        head = np.tile(np.stack([seconds, nanoseconds], axis=1).astype("<u4").view(np.uint8), (1, self._stamps))
        rows = np.tile(self._form, (len(stamps_ns), 1))
        rows[:, self._places] = np.hstack([head, np.ascontiguousarray(numbers, dtype="<f8").view(np.uint8)])
        return [row.tobytes() for row in rows]
