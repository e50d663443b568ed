# Copyright 2026 ride_estimation contributors
"""MCAP files of the ``mcap`` library and of other programs are read as that library reads them; flipped bits are found."""

from __future__ import annotations

import dataclasses
import itertools
import random
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.errors import InputDataError
from ride_estimation.io.bag_source import open_bag
from ride_estimation.io.bags import iterate_messages, read_recording
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.vehicle import Vehicle

mcap_writer = pytest.importorskip("mcap.writer", reason="needs mcap (extra 'test')")
mcap_reader = pytest.importorskip("mcap.reader")

START = 1_700_000_000_123_456_789
TYPES = {"/accel": "geometry_msgs/msg/AccelStamped", "/vector": "geometry_msgs/msg/Vector3Stamped"}
DOUBLES = {"/accel": 6, "/vector": 3}
SENSORS = {topic[1:]: Sensor(topic[1:], "accelerometer", topic, "cab", noise_std=0.02) for topic in TYPES}
VEHICLE = Vehicle("v", {}, {}, SENSORS)


@dataclasses.dataclass(frozen=True)
class Case:
    """How a file is written."""

    compression: str = "ZSTD"
    chunk_size: int = 1 << 20
    indexes: str = "ALL"
    statistics: bool = True
    repeat_channels: bool = True
    repeat_schemas: bool = True
    summary_offsets: bool = True
    checksums: bool = True
    data_checksum: bool = False
    order: str = "rising"
    profile: str = "ros2"


CHOICES = {
    "compression": ("NONE", "LZ4", "ZSTD"),
    "chunk_size": (0, 150, 2000, 1 << 20),
    "indexes": ("ALL", "NONE", "CHUNK", "MESSAGE", "CHUNK MESSAGE", "ATTACHMENT"),
    **dict.fromkeys(
        ("statistics", "repeat_channels", "repeat_schemas", "summary_offsets", "checksums", "data_checksum"), (True, False)
    ),
    "order": ("rising", "any", "equal", "falling"),
    "profile": ("ros2", "", "other"),
}


def cases(count: int, seed: int) -> list[Case]:
    """Return some of all combinations."""
    everything = list(itertools.product(*CHOICES.values()))
    return [Case(**dict(zip(CHOICES, values))) for values in random.Random(seed).sample(everything, count)]


def payload(topic: str, stamp: int, values: np.ndarray) -> bytes:
    head = struct.pack("<iII", stamp // 10**9, stamp % 10**9, 2) + b"f\0"
    head += b"\0" * (-len(head) % 8)
    return b"\0\1\0\0" + head + values[: DOUBLES[topic]].astype("<f8").tobytes()


def write(file: Path, case: Case, count: int = 40, encoding: str = "cdr") -> None:
    index = mcap_writer.IndexType.NONE
    for name in case.indexes.split():
        index = getattr(mcap_writer.IndexType, name) if name in ("ALL", "NONE") else index | mcap_writer.IndexType[name]
    with file.open("wb") as stream:
        writer = mcap_writer.Writer(
            stream, chunk_size=case.chunk_size, compression=mcap_writer.CompressionType[case.compression], index_types=index,
            repeat_channels=case.repeat_channels, repeat_schemas=case.repeat_schemas, use_chunking=case.chunk_size > 0,
            use_statistics=case.statistics, use_summary_offsets=case.summary_offsets, enable_crcs=case.checksums,
            enable_data_crcs=case.data_checksum,
        )  # fmt: skip
        writer.start(case.profile, "another program")
        writer.add_attachment(START, START, "photo", "image/png", b"\x06\x05" * 50)
        schemas = {topic: writer.register_schema(kind, "ros2msg", b"float64 x") for topic, kind in TYPES.items()}
        # two channels on one topic are legal
        channels = [(topic, writer.register_channel(topic, encoding, schemas[topic])) for topic in (*TYPES, "/accel")]
        rng = np.random.default_rng(count)
        offsets = {
            "rising": np.arange(count), "falling": -np.arange(count), "equal": np.zeros(count), "any": rng.permutation(count)
        }[case.order]  # fmt: skip
        for k, offset in enumerate(offsets.tolist()):
            for topic, channel in channels:
                stamp = START + k * 2_000_000 + channel
                writer.add_message(channel, START + int(offset) * 1_000_000, payload(topic, stamp, rng.normal(size=6)), stamp)
        writer.add_metadata("about", {"a": "b"})
        writer.finish()


def as_the_library_reads(file: Path) -> list[tuple[str, int, bytes]]:
    with file.open("rb") as stream:
        messages = mcap_reader.NonSeekingReader(stream).iter_messages()
        return [(channel.topic, message.log_time, message.data) for _, channel, message in messages]


def check(file: Path) -> None:
    """Bytes, arrival and order as the library gives them; values and stamps as ``struct`` unpacks them."""
    expected = as_the_library_reads(file)
    source = open_bag(file)
    assert list(source.messages(list(TYPES))) == expected and expected
    assert dict(source.types) == TYPES
    assert {topic: sum(m[0] == topic for m in expected) for topic in TYPES} == dict(source.counts)
    recording = read_recording(file, VEHICLE)
    for topic, doubles in DOUBLES.items():
        channel, own = recording.channels[topic[1:]], [(i, m) for i, m in enumerate(expected) if m[0] == topic]
        rows = [struct.unpack_from("<3d", raw, len(raw) - 8 * doubles) for _, (_, _, raw) in own]
        stamps = [struct.unpack_from("<iI", raw, 4) for _, (_, _, raw) in own]
        assert np.array_equal(channel.values, rows)
        assert channel.stamp_ns.tolist() == [s * 10**9 + n for s, n in stamps]
        assert channel.arrival_ns.tolist() == [m[1] for _, m in own]
        assert channel.order is not None and channel.order.tolist() == [i for i, _ in own]


@pytest.mark.parametrize("case", cases(40, 1), ids=str)
def test_files_of_the_library_are_read_as_it_reads_them(case: Case, tmp_path: Path) -> None:
    write(tmp_path / "run.mcap", case)
    check(tmp_path / "run.mcap")


@pytest.mark.slow
def test_two_thousand_files_of_the_library_are_read_as_it_reads_them(tmp_path: Path) -> None:
    for case in cases(2000, 2):
        write(tmp_path / "run.mcap", case)
        check(tmp_path / "run.mcap")


# -- what only other programs write ---------------------------------------------------------------------------------------


def records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield code and content of the records of a file without summary."""
    at = 8
    while at < len(data) - 8:
        code, length = struct.unpack_from("<BQ", data, at)
        yield code, data[at + 9 : at + 9 + length]
        at += 9 + length


def file_of(parts: list[tuple[int, bytes]]) -> bytes:
    magic = b"\x89MCAP0\r\n"
    return magic + b"".join(struct.pack("<BQ", code, len(body)) + body for code, body in parts) + magic


def padded(parts: list[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
    """Every record whose length is not its content's carries bytes of a later version of the format."""
    return [(code, body if code in (0x02, 0x05) else body + b"\xff\6\5") for code, body in parts]


def with_unknown_records(parts: list[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
    return [part for known in parts for part in ((0x7E, b"new"), known, (0x91, bytes(3_000_000 if known[0] == 6 else 3)))][:-1]


def with_empty_chunks(parts: list[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
    empty = (0x06, struct.pack("<QQQIIQ", 0, 0, 0, 0, 0, 0))
    return [part for known in parts for part in ((empty, known) if known[0] in (0x05, 0x06) else (known,))]


def without_data_end(parts: list[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
    return [part for part in parts if part[0] != 0x0F]


@pytest.mark.parametrize("change", [padded, with_unknown_records, with_empty_chunks, without_data_end])
@pytest.mark.parametrize("chunk_size", [0, 2000])
def test_structures_that_only_other_programs_write_are_read(change: object, chunk_size: int, tmp_path: Path) -> None:
    bare = Case(
        chunk_size=chunk_size, indexes="NONE", statistics=False, repeat_channels=False, repeat_schemas=False,
        summary_offsets=False, checksums=False,
    )  # fmt: skip
    write(tmp_path / "run.mcap", bare)
    expected = as_the_library_reads(tmp_path / "run.mcap")
    parts = list(records((tmp_path / "run.mcap").read_bytes()))
    (tmp_path / "run.mcap").write_bytes(file_of(change(parts)))  # type: ignore[operator]
    assert list(open_bag(tmp_path / "run.mcap").messages(list(TYPES))) == expected
    assert not read_recording(tmp_path / "run.mcap", VEHICLE).warnings


def test_messages_of_another_encoding_are_refused_with_its_name(tmp_path: Path) -> None:
    write(tmp_path / "run.mcap", Case(), encoding="json")
    with pytest.raises(InputDataError, match=r"topic /accel: its messages are encoded as 'json'; only 'cdr' can be read"):
        read_recording(tmp_path / "run.mcap", VEHICLE)
    assert list(iterate_messages(tmp_path / "run.mcap")) == []


# -- damage ---------------------------------------------------------------------------------------------------------------


def flips(case: Case, count: int, seed: int, tmp_path: Path) -> int:
    """Flip single bits anywhere in a file; return how many were told. Nothing else than what was written may be read."""
    file = tmp_path / "run.mcap"
    write(file, case)
    good, rng, told = file.read_bytes(), random.Random(seed), 0
    expected = list(open_bag(file).messages(list(TYPES)))
    for _ in range(count):
        place = rng.randrange(8 * len(good))
        bad = bytearray(good)
        bad[place // 8] ^= 1 << place % 8
        file.write_bytes(bytes(bad))
        try:
            found = list(open_bag(file).messages(list(TYPES)))
        except InputDataError:
            told += 1
        else:
            assert found == expected, place
    return told


@pytest.mark.parametrize("compression", CHOICES["compression"])
def test_a_flipped_bit_is_never_read_as_other_data(compression: str, tmp_path: Path) -> None:
    assert flips(Case(compression=compression, chunk_size=2000), 60, 3, tmp_path) > 40


@pytest.mark.slow
@pytest.mark.parametrize("data_checksum", [False, True])
@pytest.mark.parametrize("compression", CHOICES["compression"])
def test_a_thousand_flipped_bits_are_never_read_as_other_data(compression: str, data_checksum: bool, tmp_path: Path) -> None:
    flips(Case(compression=compression, chunk_size=2000, data_checksum=data_checksum), 1000, 4, tmp_path)


def test_a_wrong_checksum_is_named_and_what_stands_before_it_can_be_salvaged(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    write(file, Case(compression="NONE", chunk_size=2000))
    data = bytearray(file.read_bytes())
    expected = as_the_library_reads(file)
    data[data.index(expected[60][2]) + 20] ^= 4
    file.write_bytes(bytes(data))
    with pytest.raises(InputDataError, match=r"checksum of a chunk is wrong\); \d+ messages .* with --salvage"):
        read_recording(file, VEHICLE)
    saved = read_recording(file, VEHICLE, salvage=True)
    assert "checksum" in saved.warnings[0]
    source = open_bag(file, salvage=True)
    found = list(source.messages(list(TYPES)))
    assert found == expected[: len(found)] and 10 < len(found) < len(expected)


def test_messages_that_are_missing_in_the_middle_are_missed(tmp_path: Path) -> None:
    """A chunk that reads as a record of an unknown kind is skipped; the statistics tell that it is gone."""
    file = tmp_path / "run.mcap"
    write(file, Case(chunk_size=2000, indexes="NONE", checksums=False))
    data = bytearray(file.read_bytes())
    at = 8
    for _ in range(4):
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    assert data[at] == 0x06
    data[at] = 0x86
    file.write_bytes(bytes(data))
    with pytest.raises(InputDataError, match="120 messages were written and"):
        read_recording(file, VEHICLE)
