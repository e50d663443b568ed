# Copyright 2026 ride_estimation contributors
"""Numeric columns of MATLAB 5 files, every length checked against the bytes that are there.

Not scipy's reader: its compiled part can crash the process on a damaged file. Source: MathWorks, MAT-File Format (level 5),
chapter 1.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.io.bounded import allowance

#: storage type -> numpy type without byte order
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_MATRIX, _COMPRESSED = 14, 15
#: array classes that are numbers: double, single, and the integers of 8 to 64 bits
_NUMERIC = range(6, 16)
_COMPLEX = 0x0800


class _Element(NamedTuple):
    kind: int
    data: bytes


def read_matlab(path: Path) -> dict[str, NDArray[Any]]:
    """Return the real numeric arrays of a MATLAB 5 file (``save -v6`` or ``-v7``) by name; other variables are passed over.

    Raises
    ------
    InputDataError
        Missing, damaged, of another version, or larger unpacked than :func:`ride_estimation.io.bounded.allowance` says.
    """
    try:
        data = path.read_bytes()
        if data[:10] == b"MATLAB 7.3":
            raise ValueError("version 7.3; save it with -v7")
        if len(data) < 128 or data[126:128] not in (b"IM", b"MI"):
            raise ValueError("no header of version 5; save it with -v7")
        order = "<" if data[126:128] == b"IM" else ">"
        limit = allowance(len(data))
        found: dict[str, NDArray[Any]] = {}
        for element in _elements(data[128:], order):
            body = element
            if element.kind == _COMPRESSED:
                raw = _inflated(element.data, limit)
                limit -= len(raw)
                body = next(_elements(raw, order), _Element(0, b""))
            if body.kind == _MATRIX:
                named = _array(body.data, order)
                if named is not None:
                    found[named[0]] = named[1]
    except (OSError, ValueError, struct.error, zlib.error) as error:
        raise InputDataError(f"{path}: not a readable MATLAB 5 file ({error})") from error
    return found


def _inflated(packed: bytes, limit: int) -> bytes:
    unpacker = zlib.decompressobj()
    raw = unpacker.decompress(packed, limit + 1)
    if len(raw) > limit:
        raise ValueError(f"unpacks to more than {limit} bytes, which is refused")
    if not unpacker.eof:
        raise ValueError("a compressed variable is cut off")
    return raw


def _elements(data: bytes, order: str) -> Iterator[_Element]:
    """Yield the data elements of a byte range; a small one carries its bytes in its tag."""
    at = 0
    while at + 8 <= len(data):
        (first,) = struct.unpack_from(order + "I", data, at)
        if first >> 16:
            size = first >> 16
            if size > 4:
                raise ValueError(f"a small element of {size} bytes")
            yield _Element(first & 0xFFFF, data[at + 4 : at + 4 + size])
            at += 8
            continue
        (size,) = struct.unpack_from(order + "I", data, at + 4)
        if at + 8 + size > len(data):
            raise ValueError(f"an element of {size} bytes is cut off after {len(data) - at - 8}")
        yield _Element(first, data[at + 8 : at + 8 + size])
        at += 8 + (size if first == _COMPRESSED else -(-size // 8) * 8)


def _array(data: bytes, order: str) -> tuple[str, NDArray[Any]] | None:
    """Return name and values of a matrix element, None where it is not real numbers."""
    parts = list(_elements(data, order))
    if len(parts) < 4:
        return None
    flags = int(_numbers(parts[0], order)[0])
    if flags & 0xFF not in _NUMERIC or flags & _COMPLEX:
        return None
    shape = tuple(int(n) for n in _numbers(parts[1], order))
    name = parts[2].data.rstrip(b"\0").decode("utf-8", "replace")
    values = _numbers(parts[3], order)
    if any(n < 0 for n in shape) or math.prod(shape) != values.size:
        raise ValueError(f"variable {name!r} has {values.size} values and the shape {shape}")
    return name, values.reshape(shape, order="F")


def _numbers(element: _Element, order: str) -> NDArray[Any]:
    stored = _STORED.get(element.kind)
    if stored is None or not element.data:
        raise ValueError(f"an element of type {element.kind} and {len(element.data)} bytes where numbers are expected")
    return np.frombuffer(element.data, dtype=np.dtype(order + stored))
