# Copyright 2026 ride_estimation contributors
"""Messages that differ in stamp and numbers only, written in serialized form, several times cheaper than by message objects.

Where stamp and numbers lie is asked of the middleware itself: a message with known ones is serialized once, and they are looked
for in it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import serialize_message

from ride_estimation.nodes.conversions import time_message

Array = NDArray[np.float64]

#: no two bytes alike, and found nowhere else in a message
_STAMP_NS = 0x12345678 * 1_000_000_000 + 0x2BCDEF09
_NUMBER = np.pi


class MessageForm:
    """The serialized form of the messages of one topic.

    Parameters
    ----------
    make
        Returns the message of a stamp [ns] and of numbers, shape (N,).
    count
        How many numbers, N.

    Raises
    ------
    ValueError
        The middleware does not keep stamp and numbers as they are in memory.
    """

    def __init__(self, make: Callable[[int, Array], Any], count: int) -> None:
        numbers = _NUMBER * np.arange(1.0, count + 1.0)
        self._form = np.frombuffer(serialize_message(make(_STAMP_NS, numbers)), dtype=np.uint8)
        stamp = time_message(_STAMP_NS)
        wanted = [(stamp.sec, "=i"), (stamp.nanosec, "=I"), *((number, "=d") for number in numbers.tolist())]
        whole = self._form.tobytes()
        found = [(whole.index(packed), len(packed)) for packed in (struct.pack(code, value) for value, code in wanted)]
        self._places = np.concatenate([np.arange(first, first + length) for first, length in found])

    def fill(self, stamps_ns: NDArray[np.int64], numbers: Array) -> list[bytes]:
        """Return the serialized messages of K stamps, shape (K,), and their numbers, shape (K, N)."""
        seconds, nanoseconds = np.divmod(stamps_ns, 1_000_000_000)
        # the bits of both 32-bit numbers, whatever the sign
        head = np.stack([seconds, nanoseconds], axis=1).astype(np.uint32).view(np.uint8)
        rows = np.tile(self._form, (len(stamps_ns), 1))
        rows[:, self._places] = np.hstack([head, np.ascontiguousarray(numbers, dtype=np.float64).view(np.uint8)])
        return [row.tobytes() for row in rows]
