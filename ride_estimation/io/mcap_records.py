# Copyright 2026 ride_estimation contributors
"""Records of MCAP files: what the end of a file says, and its data from the front, every size and checksum compared.

The data are always read from the front, never through the index: an index can lead anywhere, and files without one are as valid.

Source: MCAP specification (records 0x02 footer, 0x03 schema, 0x04 channel, 0x05 message, 0x06 chunk, 0x0B statistics, 0x0F end of
data). Bytes behind the fields of a record are ignored, as it asks.
"""

from __future__ import annotations

import dataclasses
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from ride_estimation.io.bounded import SPARE_BYTES, TooLargeError, allowance, unpack, unpack_what_is_there

#: how a file begins and ends
MAGIC = b"\x89MCAP0\r\n"
_FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, _STATISTICS, _DATA_END = 0x02, 0x03, 0x04, 0x05, 0x06, 0x0B, 0x0F
RECORD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<HIQQ")
#: start of the summary, start of its offsets, checksum
_FOOTER_FIELDS = struct.Struct("<QQI")
_FOOTER_SIZE = RECORD.size + _FOOTER_FIELDS.size + len(MAGIC)
#: first and last receive time, size and checksum of the records unpacked
_CHUNK_HEAD = struct.Struct("<QQQI")
#: numbers of messages, schemas, channels, attachments, metadata and chunks, first and last receive time
_STATISTICS_HEAD = struct.Struct("<QHIIIIQQ")
#: largest receive time [ns]: times are signed everywhere else
LATEST = 2**63 - 1
#: records outside chunks that are handed out together, and what is skipped at once [bytes]
_LOOSE = 1 << 20

_WANTED = (SCHEMA, CHANNEL, MESSAGE, CHUNK)

#: what damaged records raise
DAMAGE = (struct.error, UnicodeDecodeError, KeyError, ValueError, EOFError, RuntimeError)


class Channel(NamedTuple):
    """A channel record: topic, number of the schema, encoding of the messages."""

    topic: str
    schema: int
    encoding: str


@dataclasses.dataclass
class Contents:
    """What a file holds.

    Attributes
    ----------
    schemas
        Name of the message type by number.
    channels
        By number.
    counts
        Messages by number of the channel.
    """

    schemas: dict[int, str] = dataclasses.field(default_factory=dict)
    channels: dict[int, Channel] = dataclasses.field(default_factory=dict)
    counts: dict[int, int] = dataclasses.field(default_factory=dict)

    def take(self, code: int, body: memoryview) -> None:
        """Take a schema or channel record; raises one of :data:`DAMAGE` where it is none."""
        (number,) = struct.unpack_from("<H", body)
        if code == SCHEMA:
            self.schemas[number] = _text(body, 2)[0]
        else:
            (schema,) = struct.unpack_from("<H", body, 2)
            topic, after = _text(body, 4)
            self.channels[number] = Channel(topic, schema, _text(body, after)[0])


@dataclasses.dataclass(frozen=True)
class Ending:
    """What the end of a whole file says.

    Attributes
    ----------
    data_end
        Where the data section ends [bytes from the beginning].
    has_summary
        Whether a summary begins there.
    messages
        Number of messages the statistics state, None where there are none.
    contents
        From the summary, None where it does not state all of it.
    """

    data_end: int
    has_summary: bool
    messages: int | None
    contents: Contents | None


def read_ending(stream: BinaryIO) -> Ending:
    """Check beginning, footer and summary of a file.

    Raises
    ------
    ValueError, struct.error
        It is damaged or cut off.
    """
    _read_magic(stream)
    place = stream.seek(0, 2) - _FOOTER_SIZE
    if place < len(MAGIC):
        raise ValueError("its end is missing")
    stream.seek(place)
    footer = stream.read(_FOOTER_SIZE)
    if not footer.endswith(MAGIC) or not footer.startswith(RECORD.pack(_FOOTER, _FOOTER_FIELDS.size)):
        raise ValueError("its end is missing")
    start, _, checksum = _FOOTER_FIELDS.unpack_from(footer, RECORD.size)
    if start and not len(MAGIC) <= start <= place:
        raise ValueError(f"its summary is said to begin at byte {start}, which is not inside the file")
    stream.seek(start or place)
    summary = stream.read(place - (start or place))
    if checksum and zlib.crc32(footer[: RECORD.size + _FOOTER_FIELDS.size - 4], zlib.crc32(summary)) != checksum:
        raise ValueError("the checksum of its summary is wrong")
    messages, contents = _summarised(summary)
    return Ending(start or place, start > 0, messages, contents)


def _read_magic(stream: BinaryIO) -> None:
    if stream.read(len(MAGIC)) != MAGIC:
        raise ValueError("does not begin as an MCAP file: it is no recording, or its beginning is lost")


def _summarised(summary: bytes) -> tuple[int | None, Contents | None]:
    """Return number of messages and contents as a summary states them."""
    found, messages, channels = Contents(), None, 0
    for code, body in _records(summary):
        if code in (SCHEMA, CHANNEL):
            found.take(code, body)
        elif code == _STATISTICS:
            messages, _, channels, *_ = _STATISTICS_HEAD.unpack_from(body)
            (size,) = struct.unpack_from("<I", body, _STATISTICS_HEAD.size)
            pairs = body[_STATISTICS_HEAD.size + 4 : _STATISTICS_HEAD.size + 4 + size]
            found.counts = dict(struct.iter_unpack("<HQ", pairs[: len(pairs) - len(pairs) % 10]))
    # channels and schemas need not be repeated here
    complete = (
        messages and channels == len(found.channels) and sum(found.counts.values()) == messages
        and found.counts.keys() <= found.channels.keys()
        and {c.schema for c in found.channels.values()} <= {0, *found.schemas}
    )  # fmt: skip
    return messages, found if complete else None


def _records(data: bytes) -> Iterator[tuple[int, memoryview]]:
    """Yield code and content of the records in a range of bytes, which are whole."""
    at, view = 0, memoryview(data)
    while at < len(data):
        code, length = RECORD.unpack_from(data, at)
        at += RECORD.size + length
        if at > len(data):
            raise ValueError(f"a record of {length} bytes leaves its section")
        yield code, view[at - length : at]


def record_runs(path: Path, ending: Ending | None) -> Iterator[bytes]:
    """Yield the records of the data section of a file, many whole ones at a time, chunks unpacked and checked.

    Only schemas, channels and messages, and what else stands in chunks.

    Parameters
    ----------
    path
        An MCAP file.
    ending
        Its end; None: it is cut off, and of a chunk that is cut off the beginning is given.

    Raises
    ------
    ValueError, struct.error
        Where damage is met, after what stands before it.
    """
    whole = path.stat().st_size
    limit = allowance(whole)
    loose: list[bytes] = []
    size = 0
    with path.open("rb") as stream:
        try:
            for code, head, body in _data_records(stream, whole, ending):
                if loose and (code == CHUNK or size > _LOOSE):
                    yield b"".join(loose)
                    loose, size = [], 0
                if code == CHUNK:
                    records = unpacked(body, limit) if len(body) == RECORD.unpack(head)[1] else _beginning(body, limit)
                    limit -= len(records)
                    yield records
                else:
                    loose += [head, body]
                    size += len(body)
        except DAMAGE:
            if loose:
                yield b"".join(loose)
            raise
    if loose:
        yield b"".join(loose)


def _data_records(stream: BinaryIO, whole: int, ending: Ending | None) -> Iterator[tuple[int, bytes, bytes]]:
    """Yield code, head and content of the schemas, channels, messages and chunks of a data section."""
    end = whole if ending is None else ending.data_end
    _read_magic(stream)
    at, checksum = len(MAGIC), zlib.crc32(MAGIC)
    while at < end:
        head = stream.read(RECORD.size)
        code, length = RECORD.unpack(head)
        if code == _DATA_END:
            stated = int.from_bytes(stream.read(length)[:4], "little")
            if stated and stated != checksum:
                raise ValueError("the checksum of its data is wrong")
            at += RECORD.size + length
            break
        left = end - at - RECORD.size
        if code == 0 or (length > left and not (code == CHUNK and ending is None)):
            raise ValueError(f"a record of kind {code} and {length} bytes at byte {at}, {left} bytes before the end")
        checksum = zlib.crc32(head, checksum)
        for start in range(0, length, _LOOSE) if code not in _WANTED else ():
            checksum = zlib.crc32(stream.read(min(_LOOSE, length - start)), checksum)
        if code in _WANTED:
            body = stream.read(min(length, left))
            checksum = zlib.crc32(body, checksum)
            yield code, head, body
        at += RECORD.size + length
    if at != end and (ending is None or ending.has_summary):
        raise ValueError("its end is missing" if ending is None else f"its data end at byte {at}, its summary begins at {end}")


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
        Of an unknown compression, larger than the limit, or not of the size and checksum it states.
    """
    _, _, size, checksum = _CHUNK_HEAD.unpack_from(body)
    compression, packed = _packed(body)
    if size > limit:
        raise TooLargeError(limit)
    records = unpack(packed, compression, limit) if compression else packed
    if len(records) != size:
        raise ValueError(f"a chunk is said to hold {size} bytes and holds {len(records)}")
    if checksum and zlib.crc32(records) != checksum:
        raise ValueError("the checksum of a chunk is wrong")
    return records


def _packed(body: bytes) -> tuple[str, bytes]:
    """Return compression and compressed bytes of a chunk, as far as they are there."""
    compression, at = _text(memoryview(body), _CHUNK_HEAD.size)
    (length,) = struct.unpack_from("<Q", body, at)
    return compression, body[at + 8 : at + 8 + length]


def _beginning(body: bytes, limit: int) -> bytes:
    """Return the whole records at the beginning of a chunk that is cut off; its checksum cannot be compared."""
    compression, packed = _packed(body)
    data = unpack_what_is_there(packed, compression, limit) if compression else packed
    end = 0
    while end + RECORD.size <= len(data):
        after = end + RECORD.size + RECORD.unpack_from(data, end)[1]
        if after > len(data):
            break
        end = after
    return data[:end]


def _text(body: memoryview, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", body, at)
    if at + 4 + length > len(body):
        raise ValueError(f"a text of {length} bytes leaves its record")
    return bytes(body[at + 4 : at + 4 + length]).decode("utf-8"), at + 4 + length
