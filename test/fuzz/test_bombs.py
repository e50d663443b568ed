# Copyright 2026 ride_estimation contributors
"""Small files that claim or unpack to gigabytes: refused with one message, within one budget of memory per file."""

from __future__ import annotations

import bz2
import resource
import sqlite3
import struct
import threading
import time
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from fuzz.measurements import channels
from fuzz.recordings import START, STORE, VEHICLE, mcap_files, packed, ros1_files
from ride_estimation.errors import RideEstimationError
from ride_estimation.io.bags import read_recording
from ride_estimation.io.files.channels import UNKNOWN_START_NS
from ride_estimation.io.files.formats import read_measurement_file, write_measurement_file

#: what reading any of these files may add to the memory; the limit for the largest of them is 100 MiB [bytes]
MOST = 500 << 20
ZEROS = 60 << 20


@pytest.fixture(autouse=True)
def bounded() -> Iterator[None]:
    """No test of this file may need more memory than :data:`MOST`, or more than ten seconds of processor time."""
    before, start = resident(), time.process_time()
    seen, done = [before], threading.Event()

    def watch() -> None:
        while not done.wait(0.005):
            seen.append(resident())

    watcher = threading.Thread(target=watch)
    watcher.start()
    yield
    done.set()
    watcher.join()
    assert max(seen) - before < MOST
    assert time.process_time() - start < 10.0


def resident() -> int:
    """Return the memory in use [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def refused(path: Path, words: str, *, salvage: bool = False) -> None:
    with pytest.raises(RideEstimationError, match=words):
        read_recording(path, VEHICLE, salvage=salvage)


def packed_messages(path: Path, plugin: StoragePlugin) -> Path:
    """Write a bag of 40 messages of 60 MiB of zeros, compressed one by one, a few kilobytes each."""
    zeros = packed(bytes(ZEROS), "zstd")
    writer = Writer(path, version=9, storage_plugin=plugin)
    writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/accel", "sensor_msgs/msg/Imu", typestore=STORE)
    if plugin is StoragePlugin.SQLITE3:
        with sqlite3.connect(path / f"{path.name}.db3") as database:
            database.executemany("INSERT INTO messages VALUES (NULL, ?, ?, ?)", [(connection.id, START, zeros)] * 40)
    return path


def test_messages_compressed_one_by_one_share_one_budget(tmp_path: Path) -> None:
    refused(packed_messages(tmp_path / "run", StoragePlugin.SQLITE3), "unpacks to more than")


@pytest.mark.parametrize("key", ['"compression_mode"', "'compression_mode'", "? compression_mode\n  "])
def test_the_key_of_the_compression_may_be_written_in_any_way_yaml_knows(key: str, tmp_path: Path) -> None:
    folder = packed_messages(tmp_path / "run", StoragePlugin.SQLITE3)
    metadata = folder / "metadata.yaml"
    text = metadata.read_text()
    metadata.write_text(text.replace("compression_mode", key))
    assert metadata.read_text() != text
    refused(folder, "unpacks to more than")
    metadata.write_text(text.replace("compression_mode", key).replace("message\n", "FILE\n"))
    refused(folder, "unpack them first")


def test_a_forged_index_is_not_followed(tmp_path: Path) -> None:
    """Two files, so that no summary of one of them tells the whole; the first chunk is damaged, the others unpack to 2 GB."""
    (tmp_path / "seed").mkdir()
    good = mcap_files(tmp_path / "seed")[0]
    start = 17 + struct.unpack_from("<Q", good, 9)[0]
    zeros = packed(bytes(ZEROS), "zstd")

    def chunk(size: int, data: bytes) -> bytes:
        body = struct.pack("<QQQII", START, START, size, 0, 4) + b"zstd" + struct.pack("<Q", len(data)) + data
        return struct.pack("<BQ", 6, len(body)) + body

    data = good[:start] + chunk(100, b"garbage") + chunk(ZEROS, zeros) * 35
    end = bytearray(good[good.rindex(b"\x0f" + struct.pack("<Q", 4)) :])
    end[-28:-20] = struct.pack("<Q", len(data) + 13)  # where the summary begins, in the footer
    bomb = data + bytes(end)
    folder = tmp_path / "run"
    folder.mkdir()
    text = (tmp_path / "seed" / "plain" / "metadata.yaml").read_text()
    for name in ("a.mcap", "b.mcap"):
        (folder / name).write_bytes(bomb)
    (folder / "metadata.yaml").write_text(text.replace("- plain.mcap", "- a.mcap\n  - b.mcap"))
    refused(folder, "no message could be recovered")
    refused(folder, "no message could be recovered", salvage=True)


def test_messages_without_content_are_counted_by_what_they_need_in_memory(tmp_path: Path) -> None:
    """Two million of 31 bytes each, in 7 kB."""
    words = (b"sensor_msgs/msg/Imu", b"ros2msg", b"", b"/accel", b"cdr", b"", b"zstd")
    text = [struct.pack("<I", len(word)) + word for word in words]
    empty = struct.pack("<BQHIQQ", 5, 22, 1, 0, START, START) * (1 << 18)
    body = packed(empty, "zstd")
    chunk = struct.pack("<QQQI", START, START, len(empty), 0) + text[6] + struct.pack("<Q", len(body)) + body
    parts = [(3, struct.pack("<H", 1) + b"".join(text[:3])), (4, struct.pack("<HH", 1, 1) + b"".join(text[3:6]))]
    parts += [(6, chunk)] * 8 + [(15, bytes(4)), (2, bytes(20))]
    magic = b"\x89MCAP0\r\n"
    data = magic + b"".join(struct.pack("<BQ", code, len(part)) + part for code, part in parts) + magic
    (tmp_path / "run.mcap").write_bytes(data)
    refused(tmp_path / "run.mcap", "unpacks to more than")


def test_a_ros1_bag_is_not_read_beyond_a_damaged_record(tmp_path: Path) -> None:
    (tmp_path / "seed").mkdir()
    data = ros1_files(tmp_path / "seed")[0]
    bogus = struct.pack("<I", 3) + b"abc" + struct.pack("<I", 0)
    fields = (b"op=\x05", b"compression=bz2", b"size=" + struct.pack("<I", ZEROS))
    header = b"".join(struct.pack("<I", len(field)) + field for field in fields)
    # one record of a kind that is passed over
    body = bz2.compress(struct.pack("<II", 8, 4) + b"op=\4" + struct.pack("<I", ZEROS - 16) + bytes(ZEROS - 16))
    chunk = struct.pack("<I", len(header)) + header + struct.pack("<I", len(body)) + body
    begin = 13
    for _ in range(2):  # header and padding of the first record
        begin += 4 + struct.unpack_from("<I", data, begin)[0]
    head, rest = data[:begin], data[begin:]
    for name, content, words in (
        ("bogus.bag", bogus + chunk * 40, "field of a record's header is damaged"),
        # 60 MiB of zeros in 45 bytes each
        ("many.bag", chunk * 40, "unpacks to more than"),
    ):
        (tmp_path / name).write_bytes(head + content + rest)
        refused(tmp_path / name, words)


COLUMNS = "topic_id INTEGER, timestamp INTEGER"
TOPICS = "CREATE TABLE topics(id INTEGER, name TEXT, type TEXT, serialization_format TEXT)"


def db3(path: Path, messages: str, topics: str = TOPICS) -> Path:
    with sqlite3.connect(path) as database:
        database.executescript(f"{topics}; {messages}")
        if topics.startswith("CREATE TABLE"):
            database.execute("INSERT INTO topics VALUES (1, '/accel', 'sensor_msgs/msg/Imu', 'cdr')")
    return path


@pytest.mark.parametrize(
    "messages",
    [
        f"CREATE TABLE messages(id INTEGER PRIMARY KEY, {COLUMNS}, data BLOB AS (zeroblob(60000000 + id)))",
        f"CREATE TABLE messages(id INTEGER PRIMARY KEY, {COLUMNS}, data BLOB AS (zeroblob(60000000 + id)) STORED)",
        f"CREATE TABLE other(id INTEGER PRIMARY KEY, {COLUMNS}); "
        "CREATE VIEW messages AS SELECT *, zeroblob(60000000 + id) AS data FROM other",
        "CREATE VIEW messages AS WITH RECURSIVE c(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM c) "
        "SELECT 1 AS topic_id, id AS timestamp, zeroblob(1000) AS data FROM c",
    ],
    ids=["generated", "stored", "view", "endless"],
)
def test_only_plain_columns_of_a_database_are_read(messages: str, tmp_path: Path) -> None:
    file = db3(tmp_path / "run.db3", messages)
    if "PRIMARY KEY" in messages and "STORED" not in messages:
        table = "other" if "VIEW" in messages else "messages"
        with sqlite3.connect(file) as database:
            database.executemany(f"INSERT INTO {table}(topic_id, timestamp) VALUES (1, ?)", [(START + k,) for k in range(500)])
    refused(file, "no plain")


def test_an_endless_view_of_topics_is_refused(tmp_path: Path) -> None:
    file = db3(
        tmp_path / "run.db3",
        f"CREATE TABLE messages(id INTEGER PRIMARY KEY, {COLUMNS}, data BLOB)",
        "CREATE VIEW topics AS WITH RECURSIVE c(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM c) "
        "SELECT id, 'a' AS name, 'b' AS type, 'cdr' AS serialization_format FROM c",
    )
    refused(file, "no plain")


def test_a_parquet_file_of_many_equal_rows_is_refused(tmp_path: Path) -> None:
    arrow = pytest.importorskip("pyarrow", reason="needs pyarrow (extra 'files')")
    parquet = pytest.importorskip("pyarrow.parquet")
    zeros = arrow.table({"time": np.zeros(1 << 20), "a [g]": np.zeros(1 << 20)})
    with parquet.ParquetWriter(tmp_path / "run.parquet", zeros.schema) as writer:
        for _ in range(60):
            writer.write_table(zeros)
    with pytest.raises(RideEstimationError, match="which is refused"):
        read_measurement_file(tmp_path / "run.parquet")


@pytest.mark.parametrize(("stated", "times"), [(1000, 1), (ZEROS, 40)])
def test_compressed_blocks_of_an_mdf_file_share_one_budget(stated: int, times: int, tmp_path: Path) -> None:
    """A block that states less than it unpacks to, and many that state it."""
    pytest.importorskip("asammdf", reason="needs asammdf (extra 'files')")
    file = tmp_path / "run.mf4"
    write_measurement_file(file, [channels()], UNKNOWN_START_NS)
    body = zlib.compress(bytes(ZEROS))
    block = struct.pack("<4s4xQQ2sBxIQQ", b"##DZ", 48 + len(body), 0, b"DT", 0, 0, stated, len(body)) + body
    file.write_bytes(file.read_bytes() + block * times)
    with pytest.raises(RideEstimationError, match="unpacks to more than"):
        read_measurement_file(file)


def test_a_group_of_an_mdf_file_cannot_claim_more_samples_than_the_file_can_hold(tmp_path: Path) -> None:
    pytest.importorskip("asammdf", reason="needs asammdf (extra 'files')")
    file = tmp_path / "run.mf4"
    write_measurement_file(file, [channels()], UNKNOWN_START_NS)
    data = bytearray(file.read_bytes())
    group = data.index(b"##CG")
    links = struct.unpack_from("<Q", data, group + 16)[0]
    place = group + 24 + 8 * links + 8  # behind the number of the record: the number of cycles
    assert struct.unpack_from("<Q", data, place)[0] == len(channels()[0].values)
    data[place : place + 8] = struct.pack("<Q", 10**9)
    file.write_bytes(bytes(data))
    with pytest.raises(RideEstimationError, match="unpacks to more than"):
        read_measurement_file(file)
