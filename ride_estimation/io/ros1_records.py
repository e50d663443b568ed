# Copyright 2026 ride_estimation contributors
"""Messages of ROS 1 bags, read from the front: an index can lead anywhere.

Source: ROS wiki, Bags/Format/2.0 (records 0x02 message data, 0x03 bag header, 0x05 chunk, 0x07 connection).
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from rosbags.typesys.msg import normalize_msgtype

from ride_estimation.io.bounded import allowance, unpack

_MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _BAG_HEADER, _CHUNK, _CONNECTION = b"\x02", b"\x03", b"\x05", b"\x07"


class Ros1Message(NamedTuple):
    """A message with the topic and type of its connection."""

    topic: str
    message_type: str
    arrival_ns: int
    raw: bytes


def ros1_messages(path: Path) -> Iterator[Ros1Message]:
    """Yield the messages of a bag in the order of the file.

    Raises
    ------
    ValueError, KeyError, struct.error
        Damaged or cut off: where it is met.
    """
    size = path.stat().st_size
    limit = allowance(size)
    connections: dict[bytes, tuple[str, str]] = {}
    chunks, stated = 0, 0
    with path.open("rb") as stream:
        if stream.read(len(_MAGIC)) != _MAGIC:
            raise ValueError("does not begin as a ROS 1 bag of version 2.0")
        for fields, data in _records(stream, size):
            kind = fields["op"]
            if kind == _BAG_HEADER:
                if not any(fields["index_pos"]):
                    raise ValueError("the recorder did not finish it: it has no index; 'rosbag reindex' makes one")
                if fields.get("encryptor"):
                    raise ValueError("it is encrypted")
                (stated,) = struct.unpack("<I", fields["chunk_count"])
            elif kind == _CHUNK:
                chunks += 1
                compression = fields["compression"].decode()
                inner = data if compression == "none" else unpack(data, compression, limit)
                limit -= len(inner)
                if len(inner) != struct.unpack("<I", fields["size"])[0]:
                    raise ValueError("a chunk is not of the size it states")
                for part, content in _records(io.BytesIO(inner), len(inner)):
                    yield from _message(part, content, connections)
            else:
                yield from _message(fields, data, connections)
    if chunks != stated:
        raise ValueError(f"{stated} chunks were written and {chunks} are there")


def _message(fields: dict[str, bytes], data: bytes, connections: dict[bytes, tuple[str, str]]) -> Iterator[Ros1Message]:
    """Yield the message of a record, or take note of its connection."""
    if fields["op"] == _CONNECTION:
        topic = "/".join(part for part in fields["topic"].decode().split("/") if part)
        absolute = "/" if fields["topic"].startswith(b"/") else ""
        connections[fields["conn"]] = absolute + topic, normalize_msgtype(dict(_fields(data))["type"].decode())
    elif fields["op"] == _MESSAGE:
        seconds, nanoseconds = struct.unpack("<II", fields["time"])
        yield Ros1Message(*connections[fields["conn"]], seconds * 1_000_000_000 + nanoseconds, data)


def _records(stream: BinaryIO, size: int) -> Iterator[tuple[dict[str, bytes], bytes]]:
    """Yield header fields and data of the records up to the end of a stream of so many bytes."""
    while head := stream.read(4):
        fields = dict(_fields(_sized(stream, head, size)))
        yield fields, _sized(stream, stream.read(4), size)


def _sized(stream: BinaryIO, length: bytes, size: int) -> bytes:
    (count,) = struct.unpack("<I", length)
    data = stream.read(count) if count <= size else b""
    if len(data) != count:
        raise ValueError(f"{count} bytes are cut off after {len(data)}")
    return data


def _fields(header: bytes) -> Iterator[tuple[str, bytes]]:
    at = 0
    while at < len(header):
        length = int.from_bytes(header[at : at + 4], "little")
        name, equals, value = header[at + 4 : at + 4 + length].partition(b"=")
        if not equals or at + 4 + length > len(header):
            raise ValueError("a field of a record's header is damaged")
        yield name.decode(), value
        at += 4 + length
