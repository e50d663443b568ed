# Copyright 2026 ride_estimation contributors
"""Records of MCAP files: messages of whole files quickly, and what is left of files that are truncated or damaged.

Source: MCAP specification (records 0x02 footer, 0x03 schema, 0x04 channel, 0x05 message, 0x06 chunk, 0x0F end of data).
"""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Collection, Iterator
from pathlib import Path

from ride_estimation.errors import InputDataError
from ride_estimation.io.bounded import SPARE_BYTES, allowance, unpack, unpack_what_is_there

#: how a file begins and ends
MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, CHANNEL, MESSAGE, CHUNK, _DATA_END = 0x02, 0x03, 0x04, 0x05, 0x06, 0x0F
_FOOTER_SIZE = 37
RECORD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<HIQQ")
#: largest receive time [ns]: times are signed everywhere else
LATEST = 2**63 - 1
#: records outside chunks that are handed out together [bytes]
_LOOSE = 1 << 20

#: what damaged records raise
DAMAGE = (struct.error, UnicodeDecodeError, KeyError, ValueError, EOFError, RuntimeError)


@dataclasses.dataclass
class Salvaged:
    """Recovered content.

    Attributes
    ----------
    types
        Topic -> message type.
    messages
        (topic, receive time [ns], raw bytes), by receive time.
    """

    types: dict[str, str] = dataclasses.field(default_factory=dict)
    messages: list[tuple[str, int, bytes]] = dataclasses.field(default_factory=list)
    schemas: dict[int, str] = dataclasses.field(default_factory=dict)
    topics: dict[int, str] = dataclasses.field(default_factory=dict)


def read_mcap(path: Path, topics: Collection[str]) -> list[tuple[str, int, bytes]]:
    """Return the messages of some topics of a whole file, by receive time.

    One pass without an object per record: four times as fast as a general reader on small messages.

    Parameters
    ----------
    path
        A complete MCAP file (its end has been checked).
    topics
        Topics wanted.

    Raises
    ------
    ValueError, struct.error
        The file is damaged.
    """
    wanted: dict[int, str] = {}
    messages: list[tuple[str, int, bytes]] = []
    for records in record_runs(path):
        _pick(records, topics, wanted, messages)
    messages.sort(key=lambda message: message[1])
    if messages and messages[-1][1] > LATEST:
        raise ValueError(f"a message was received at {messages[-1][1]} ns, which no clock shows")
    return messages


def record_runs(path: Path) -> Iterator[bytes]:
    """Yield the records of a whole file up to the end of its data, many at a time, chunks unpacked.

    Only channels and messages, and what else stands in chunks.

    Parameters
    ----------
    path
        A complete MCAP file (its end has been checked).

    Raises
    ------
    ValueError, struct.error
        The file is damaged.
    """
    whole = path.stat().st_size
    limit = allowance(whole)
    loose: list[bytes] = []
    size = 0
    with path.open("rb") as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            raise ValueError("does not begin as an MCAP file")
        while True:
            head = stream.read(RECORD.size)
            code, length = RECORD.unpack(head)
            if code in (_DATA_END, _FOOTER):
                break
            if length > whole:
                raise ValueError(f"a record of {length} bytes in a file of {whole}")
            if code not in (CHUNK, CHANNEL, MESSAGE):
                stream.seek(length, 1)
                continue
            body = stream.read(length)
            if len(body) != length:
                raise ValueError(f"a record of {length} bytes is cut off after {len(body)}")
            if code != CHUNK:
                loose.append(head + body)
                size += len(body)
            if loose and (code == CHUNK or size > _LOOSE):
                yield b"".join(loose)
                loose, size = [], 0
            if code == CHUNK:
                records = unpacked(body, limit)
                limit -= len(records)
                yield records
    if loose:
        yield b"".join(loose)


def _pick(data: bytes, topics: Collection[str], wanted: dict[int, str], messages: list[tuple[str, int, bytes]]) -> None:
    """Add the messages of wanted channels in a run of records."""
    at, end = 0, len(data)
    record, head, first = RECORD.unpack_from, MESSAGE_HEAD.unpack_from, RECORD.size + MESSAGE_HEAD.size
    while at < end:
        code, length = record(data, at)
        last = at + 9 + length
        if last > end:
            raise ValueError(f"a record of {length} bytes leaves its chunk")
        if code == MESSAGE:
            key, _, stamp, _ = head(data, at + 9)
            topic = wanted.get(key)
            if topic is not None:
                messages.append((topic, stamp, data[at + first : last]))
        elif code == CHANNEL:
            key, topic = channel_of(memoryview(data)[at + 9 : last])
            if topic in topics:
                wanted[key] = topic
        at = last


def channel_of(body: memoryview) -> tuple[int, str]:
    """Return number and topic of a channel record; raises one of :data:`DAMAGE` where it is none."""
    topic, _ = _text(body, 4)
    return int(struct.unpack_from("<H", body)[0]), topic


def unpacked(body: bytes, limit: int = SPARE_BYTES) -> bytes:
    """Return the records of a chunk.

    Parameters
    ----------
    body
        Content of the chunk record.
    limit
        Largest result [bytes].

    Raises
    ------
    ValueError, struct.error
        Damaged, of an unknown compression, or larger than the limit.
    """
    compression, at = _text(memoryview(body), 28)
    packed = body[at + 8 :]
    return unpack(packed, compression, limit) if compression else packed


def has_summary(path: Path) -> bool:
    """Return whether the footer of an MCAP file points to a summary, so that a reader need not unpack the chunks to know them."""
    with path.open("rb") as stream:
        stream.seek(0, 2)
        if stream.tell() < _FOOTER_SIZE:
            return False
        stream.seek(-_FOOTER_SIZE, 2)
        footer = stream.read(_FOOTER_SIZE)
    return footer[0] == _FOOTER and footer.endswith(MAGIC) and int.from_bytes(footer[9:17], "little") > 0


def salvage_mcap(path: Path) -> Salvaged:
    """Read an MCAP file from the front until nothing more can be read.

    Parameters
    ----------
    path
        File that need not have a footer.

    Raises
    ------
    InputDataError
        The file does not begin as an MCAP file.
    """
    data = path.read_bytes()
    if not data.startswith(MAGIC):
        raise InputDataError(f"{path}: does not begin as an MCAP file: it is no recording, or its beginning is lost")
    found = Salvaged()
    _records(memoryview(data)[len(MAGIC) :], found, allowance(len(data)))
    found.messages.sort(key=lambda message: message[1])
    return found


def _records(data: memoryview, found: Salvaged, limit: int) -> None:
    """Add the records of a byte range, unpacked at most ``limit`` bytes; stop at the first that is not whole."""
    at = 0
    while at + 9 <= len(data):
        code, length = struct.unpack_from("<BQ", data, at)
        body = data[at + 9 : at + 9 + length]
        whole = len(body) == length
        try:
            if code == CHUNK:
                inner = _decompressed(body, limit)
                limit -= len(inner)
                _records_of_chunk(inner, found)
            elif not whole:
                return
            else:
                _record(code, body, found)
        except DAMAGE:
            return
        if not whole:
            return
        at += 9 + length


def _records_of_chunk(data: memoryview, found: Salvaged) -> None:
    """Add the records of a chunk, which holds no chunks itself, up to the first that is not whole."""
    at = 0
    while at + 9 <= len(data):
        code, length = struct.unpack_from("<BQ", data, at)
        if at + 9 + length > len(data):
            return
        _record(code, data[at + 9 : at + 9 + length], found)
        at += 9 + length


def _record(code: int, body: memoryview, found: Salvaged) -> None:
    if code == _SCHEMA:
        (key,) = struct.unpack_from("<H", body)
        found.schemas[key] = _text(body, 2)[0]
    elif code == CHANNEL:
        key, schema = struct.unpack_from("<HH", body)
        topic, _ = _text(body, 4)
        found.topics[key] = topic
        found.types[topic] = found.schemas.get(schema, "")
    elif code == MESSAGE:
        key, _, stamp, _ = struct.unpack_from("<HIQQ", body)
        if stamp > LATEST:
            raise ValueError(f"a message was received at {stamp} ns, which no clock shows")
        found.messages.append((found.topics[key], stamp, bytes(body[22:])))


def _text(body: memoryview, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", body, at)
    return bytes(body[at + 4 : at + 4 + length]).decode("utf-8"), at + 4 + length


def _decompressed(body: memoryview, limit: int) -> memoryview:
    """Return the records of a chunk, as far as they can be decompressed."""
    compression, at = _text(body, 28)
    packed = bytes(body[at + 8 :])
    return memoryview(unpack_what_is_there(packed, compression, limit) if compression else packed)
