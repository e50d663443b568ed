# Copyright 2026 ride_estimation contributors
"""What is left of an MCAP file without end mark or with damage in it: the records in order until the first bad one.

Source: MCAP specification (records 0x03 schema, 0x04 channel, 0x05 message, 0x06 chunk).
"""

from __future__ import annotations

import dataclasses
import importlib
import struct
from pathlib import Path

from ride_estimation.errors import InputDataError

_MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x03, 0x04, 0x05, 0x06


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
        try:
            zstd = importlib.import_module("compression.zstd")
        except ImportError:
            zstd = importlib.import_module("backports.zstd")
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
