# Copyright 2026 ride_estimation contributors
"""Decoding in bulk gives what message objects give: ordinary messages, damaged ones, any order, any container structure.

The oracle is the deserialiser of rosbags, message by message; in hand-made MCAP files it is ``struct``.
"""

from __future__ import annotations

import dataclasses
import struct
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from ride_estimation.io import bags
from ride_estimation.io.bag_source import BagSource
from ride_estimation.io.bags_bulk import Collector, Layout, TopicMessages, in_order
from ride_estimation.io.cdr import DecodedTopic, decode_at
from ride_estimation.io.mcap_records import DAMAGE, MAGIC, read_ending, record_runs
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import Recording
from ride_estimation.vehicles.vehicle import Vehicle

START = 1_700_000_000_123_456_789
STORE = get_typestore(Stores.ROS2_JAZZY)
KINDS = {
    "accel": ("accelerometer", "sensor_msgs/msg/Imu"),
    "imu": ("imu", "sensor_msgs/msg/Imu"),
    "stamped": ("accelerometer", "geometry_msgs/msg/AccelStamped"),
    "vector": ("accelerometer", "geometry_msgs/msg/Vector3Stamped"),
    "speed": ("speed", "geometry_msgs/msg/TwistStamped"),
    "cell": ("force", "geometry_msgs/msg/WrenchStamped"),
}
SENSORS = {n: Sensor(n, kind, f"/{n}", "cab", noise_std=0.02, gyro_noise_std=0.001) for n, (kind, _) in KINDS.items()}
VEHICLE = Vehicle("v", {}, {}, SENSORS)
DOUBLES = {"sensor_msgs/msg/Imu": 37, "geometry_msgs/msg/Vector3Stamped": 3}
COVARIANCES = (
    [0.0] * 9, [-1.0] + [0.0] * 8, [float("nan")] * 9, [0.01, 0, 0, 0, 0.02, 0, 0, 0, 0.03], [1.0, 0, 0, 0, -4.0, 0, 0, 0, 1.0],
)


def payload(kind: str, stamp: int, frame: bytes, rng: np.random.Generator) -> bytes:
    """Return a message as little-endian CDR, laid out here by hand."""
    count = {**DOUBLES, "geometry_msgs/msg/AccelStamped": 6, "geometry_msgs/msg/TwistStamped": 6}.get(kind, 6)
    values = rng.normal(size=count)
    if kind == "sensor_msgs/msg/Imu":
        for start in (4, 16, 28):
            values[start : start + 9] = COVARIANCES[int(rng.choice(len(COVARIANCES), p=(0.3, 0.1, 0.05, 0.5, 0.05)))]
    head = struct.pack("<iI", stamp // 10**9, stamp % 10**9) + struct.pack("<I", len(frame) + 1) + frame + b"\0"
    head += b"\0" * (-len(head) % 8)
    return b"\0\1\0\0" + head + values.astype("<f8").tobytes()


def damaged(raw: bytes, rng: np.random.Generator) -> bytes:
    """Return the message with one kind of damage, or longer than its fields as some middleware leaves it."""
    which = int(rng.integers(9))
    if which == 0:
        return raw[: int(rng.integers(0, len(raw)))]
    if which == 1:
        return raw + b"\0" * int(rng.integers(1, 20))
    if which == 2:
        return raw[:12] + struct.pack("<I", int(rng.choice([0, 1, 2, 3, 400, 2**31, 2**32 - 1]))) + raw[16:]
    if which == 3:
        return raw[:16] + b"\xff" + raw[17:]
    if which == 4:
        return bytes(rng.integers(0, 256, 2, dtype=np.uint8)) + raw[2:]
    if which == 5:
        return raw[:4] + bytes(rng.integers(0, 256, 8, dtype=np.uint8)) + raw[12:]
    if which == 6:
        place = 16 + struct.unpack_from("<I", raw, 12)[0] - 1
        return raw[:place] + b"x" + raw[place + 1 :]
    place = int(rng.integers(len(raw)))
    return raw[:place] + bytes([int(rng.integers(256))]) + raw[place + 1 :]


def write(path: Path, seed: int, *, share: float, frames: int, count: int = 400) -> Path:
    """Write a bag of all kinds of messages that arrive in any order, often at the same time, a share of them damaged."""
    rng = np.random.default_rng(seed)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {n: writer.add_connection(f"/{n}", kind, typestore=STORE) for n, (_, kind) in KINDS.items()}
        for k in range(count):
            for connection in connections.values():
                frame = b"frame" * int(rng.integers(frames)) if k >= 10 else b"first"
                raw = payload(connection.msgtype, START + k * 2_000_000, frame, rng)
                if k >= 10 and rng.random() < share:
                    raw = damaged(raw, rng)
                writer.write(connection, START + 1_000_000 * int(k + rng.integers(-3, 4)), raw)
    return path


def general(path: Path, monkeypatch: pytest.MonkeyPatch) -> Recording:
    """Read with message objects only."""
    opened = bags.open_bag

    def plain(place: Path, *, salvage: bool = False) -> BagSource:
        return dataclasses.replace(opened(place, salvage=salvage), little_endian_cdr=False)

    with monkeypatch.context() as patched:
        patched.setattr(bags, "open_bag", plain)
        return bags.read_recording(path, VEHICLE)


def same(first: Recording, second: Recording) -> None:
    assert dict(first.ignored) == dict(second.ignored)
    assert list(first.channels) == list(second.channels)
    for name, one in first.channels.items():
        other = second.channels[name]
        assert one.frame_id == other.frame_id, name
        for field in ("stamp_ns", "values", "arrival_ns", "order", "variance"):
            a, b = getattr(one, field), getattr(other, field)
            assert (a is None) == (b is None), (name, field)
            assert a is None or (a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()), (name, field)


@pytest.mark.parametrize(("seed", "share", "frames"), [(0, 0.0, 1), (1, 0.0, 4), (2, 0.3, 1), (3, 0.6, 20)])
def test_bulk_and_message_objects_give_the_same_bytes(
    seed: int, share: float, frames: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path / "run", seed, share=share, frames=frames)
    found = bags.read_recording(path, VEHICLE)
    same(found, general(path, monkeypatch))
    lost = sum(n for reason, n in found.ignored.items() if "not_decodable" in reason)
    assert (lost > 0) == (share > 0.0)


def test_several_chunks_and_messages_that_overtake_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run"
    rng = np.random.default_rng(5)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {n: writer.add_connection(f"/{n}", kind, typestore=STORE) for n, (_, kind) in KINDS.items()}
        for k in rng.permutation(1500):
            for connection in connections.values():
                raw = payload(connection.msgtype, START + int(k) * 2_000_000, b"f", rng)
                writer.write(connection, START + 1_000_000 * int(k), raw)
    with (path / "run.mcap").open("rb") as stream:
        assert len(list(record_runs(path / "run.mcap", read_ending(stream)))) > 1
    found = bags.read_recording(path, VEHICLE)
    same(found, general(path, monkeypatch))
    assert np.all(np.diff(found.channels["vector"].stamp_ns) > 0)


def record(code: int, body: bytes) -> bytes:
    return struct.pack("<BQ", code, len(body)) + body


def channel(number: int, topic: str) -> bytes:
    text = topic.encode()
    encoding = struct.pack("<I", 3) + b"cdr"
    return record(4, struct.pack("<HHI", number, 1, len(text)) + text + encoding + b"\0" * 4)


def message(number: int, arrival: int, raw: bytes) -> bytes:
    return record(5, struct.pack("<HIQQ", number, 0, arrival, arrival) + raw)


END = record(0x0F, b"\0" * 4) + record(2, b"\0" * 20) + MAGIC
VECTOR = Layout("geometry_msgs/msg/Vector3Stamped", 0)


def collected(file: Path, topics: dict[str, Layout | None]) -> dict[str, TopicMessages]:
    found = Collector(topics)
    with file.open("rb") as stream:
        found.take_mcap(file, read_ending(stream))
    return found.finished()


def test_records_outside_chunks_and_numbers_that_change_their_topic(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    kind = VECTOR.message_type
    parts, written = [MAGIC, channel(1, "/a"), channel(2, "/other")], []
    for k in range(60):
        if k == 30:
            parts.append(channel(1, "/b"))
        raw = payload(kind, START + k, b"f", rng)
        written.append(("/a" if k < 30 else "/b", START - k, raw))
        parts += [message(1, START - k, raw), message(2, START, b"anything")]
    file = tmp_path / "hand.mcap"
    file.write_bytes(b"".join([*parts, END]))
    written.sort(key=lambda entry: entry[1])
    listed = list(in_order(collected(file, dict.fromkeys(("/a", "/b", "/c")))))
    assert listed == written
    found = collected(file, {"/a": VECTOR, "/b": VECTOR, "/c": None})
    assert len(found["/c"].order) == 0
    for topic in ("/a", "/b"):
        numbers = [i for i, entry in enumerate(listed) if entry[0] == topic]
        assert found[topic].order.tolist() == numbers and len(numbers) == 30
        assert found[topic].arrival.tolist() == [listed[i][1] for i in numbers]
        decoded = found[topic].decoded
        assert decoded is not None and decoded.decoded.all() and not len(found[topic].raw)
        rows = [struct.unpack("<3d", listed[i][2][-24:]) for i in numbers]
        assert np.array_equal(decoded.fields, np.array(rows))
        stamps = [struct.unpack_from("<iI", listed[i][2], 4) for i in numbers]
        assert decoded.stamp_ns.tolist() == [s * 10**9 + n for s, n in stamps]
        assert decoded.frame_id == "f"


@pytest.mark.parametrize("what", ["short_head", "leaves_the_file", "no_clock", "channel", "frame", "length", "no_channel"])
def test_what_is_not_understood_is_damage_and_what_stands_before_it_is_kept(what: str, tmp_path: Path) -> None:
    good = message(1, START, payload(VECTOR.message_type, START, b"f", np.random.default_rng(7)))
    odd = {
        "short_head": record(5, b"\1\0" + b"\0" * 10),
        "leaves_the_file": good[:-8],
        "no_clock": message(1, 2**63 + 5, b""),
        "channel": record(4, b"\1\0\1\0\xff\xff\xff\xff/x\xff"),
        "frame": record(6, struct.pack("<QQQII", 0, 0, 80, 0, 4) + b"zstd" + struct.pack("<Q", 20) + b"\x28\xb5\x2f\xfd" * 5),
        "length": struct.pack("<BQ", 5, 2**62),
        "no_channel": message(7, START, b""),
    }[what]
    file = tmp_path / "hand.mcap"
    file.write_bytes(MAGIC + channel(1, "/a") + good + odd + good + END)
    with pytest.raises(DAMAGE):
        collected(file, {"/a": VECTOR})
    file.write_bytes(MAGIC + channel(1, "/a") + good + good + END)
    assert collected(file, {"/a": VECTOR})["/a"].order.tolist() == [0, 1]


def decoded(raw: list[bytes], first: int = 0) -> DecodedTopic:
    lengths = np.array([len(r) for r in raw])
    return decode_at("sensor_msgs/msg/Imu", b"".join(raw), np.cumsum(lengths) - lengths, lengths, first)


def test_only_the_wanted_doubles_are_taken() -> None:
    rng = np.random.default_rng(8)
    raw = [payload("sensor_msgs/msg/Imu", START + k, b"abc", rng) for k in range(5)]
    whole, part = decoded(raw), decoded(raw, 25)
    assert whole.fields.shape == (5, 37) and part.fields.tobytes() == np.ascontiguousarray(whole.fields[:, 25:]).tobytes()


@pytest.mark.parametrize("arrival", [None, b"\x17\x97", "1", 1 << 63])
def test_a_time_of_arrival_that_is_none_is_damage(arrival: object) -> None:
    with pytest.raises((TypeError, ValueError)):
        Collector({"/a": None}).add("/a", arrival, b"")  # type: ignore[arg-type]
