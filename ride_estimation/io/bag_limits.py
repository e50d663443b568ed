# Copyright 2026 ride_estimation contributors
"""Refuse recordings that unpack to more than their size allows, before a general reader unpacks them without a limit."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from ride_estimation.errors import InputDataError
from ride_estimation.io.bounded import allowance, unpack
from ride_estimation.io.mcap_records import CHUNK, MAGIC, RECORD, unpacked

#: what damaged records raise here; the general reader says what is wrong with them
_DAMAGE = (struct.error, ValueError, KeyError, EOFError, RuntimeError, OSError)
_ROS1_CHUNK = b"\x05"


def check_unpacked_size(path: Path) -> None:
    """Unpack every chunk of an MCAP or ROS 1 file once, one at a time, and count.

    Raises
    ------
    InputDataError
        All chunks together are larger than :func:`ride_estimation.io.bounded.allowance` of the file.
    """
    limit = allowance(path.stat().st_size)
    left = limit
    with path.open("rb") as stream:
        try:
            for size in _ros1_sizes(stream, limit) if path.suffix == ".bag" else _mcap_sizes(stream, limit):
                left -= size
                if left < 0:
                    break
        except _DAMAGE as error:
            if "which is refused" in str(error):
                left = -1
    if left < 0:
        raise InputDataError(f"{path}: unpacks to more than {limit} bytes, which is refused for a file of this size")


def _mcap_sizes(stream: BinaryIO, limit: int) -> Iterator[int]:
    if stream.read(len(MAGIC)) != MAGIC:
        return
    while len(head := stream.read(RECORD.size)) == RECORD.size:
        code, length = RECORD.unpack(head)
        if code == CHUNK:
            yield len(unpacked(stream.read(min(length, limit)), limit))
        else:
            stream.seek(min(length, 1 << 62), 1)


def _ros1_sizes(stream: BinaryIO, limit: int) -> Iterator[int]:
    stream.readline(64)
    while len(head := stream.read(4)) == 4:
        fields = dict(_ros1_fields(stream.read(min(struct.unpack("<I", head)[0], limit))))
        (length,) = struct.unpack("<I", stream.read(4))
        compression = fields.get("compression", b"none").decode("utf-8", "replace")
        if fields.get("op") == _ROS1_CHUNK and compression != "none":
            yield len(unpack(stream.read(length), compression, limit))
        else:
            stream.seek(length, 1)


def _ros1_fields(header: bytes) -> Iterator[tuple[str, bytes]]:
    at = 0
    while at + 4 <= len(header):
        (length,) = struct.unpack_from("<I", header, at)
        name, _, value = header[at + 4 : at + 4 + length].partition(b"=")
        yield name.decode("utf-8", "replace"), value
        at += 4 + length
