# Copyright 2026 ride_estimation contributors
"""Small sound recordings in every container, to be damaged."""

from __future__ import annotations

import contextlib
import struct
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.typesys import Stores, get_typestore

from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.bounded import zstd_module
from ride_estimation.io.mcap_records import unpacked
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.vehicles.vehicle import Vehicle

START = 1_700_000_000_123_456_789
STORE = get_typestore(Stores.ROS2_JAZZY)
SENSORS = {
    s.name: s
    for s in (
        Sensor("accel", "accelerometer", "/accel", "cab", noise_std=0.02),
        Sensor("imu", "imu", "/imu", "cab", noise_std=0.03, gyro_noise_std=0.001),
        Sensor("fl_z", "displacement", "/mounts/displacement", "cab", mount="fl", axis="z", element="fl_z"),
        Sensor("cell", "force", "/mounts/fl/force_measured", "cab", mount="fl"),
    )
}
VEHICLE = Vehicle("v", {}, {}, SENSORS)


def small_recording(count: int = 20) -> Recording:
    rng = np.random.default_rng(0)
    channels = {}
    for sensor in SENSORS.values():
        stamps = START + np.arange(count) * 2_000_000
        variance = np.full((count, sensor.channels), 4e-4) if sensor.kind == "imu" else None
        values = rng.normal(size=(count, sensor.channels))
        channels[sensor.name] = Channel(sensor.name, stamps, values, stamps + 300_000, variance)
    return Recording("r", channels)


def _imu(stamp: int, store: object = STORE) -> object:
    t = store.types  # type: ignore[attr-defined]
    extra = {} if store is STORE else {"seq": 0}
    header = t["std_msgs/msg/Header"](
        stamp=t["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="f", **extra
    )
    vector, covariance = t["geometry_msgs/msg/Vector3"], np.array([0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01])
    return t["sensor_msgs/msg/Imu"](
        header=header,
        orientation=t["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=np.array([-1.0] + [0.0] * 8),
        angular_velocity=vector(x=0.1, y=0.2, z=0.3),
        angular_velocity_covariance=covariance,
        linear_acceleration=vector(x=1.0, y=2.0, z=9.8),
        linear_acceleration_covariance=covariance,
    )


def mcap_files(folder: Path) -> list[bytes]:
    """Return a file as this package writes it, and two with compressed chunks."""
    write_bag(folder / "plain", small_recording(), SENSORS)
    found = [(folder / "plain" / "plain.mcap").read_bytes()]
    for name in ("zstd", "lz4"):
        found.append(rechunked(found[0], name))
    return found


def rechunked(data: bytes, compression: str) -> bytes:
    """Return an MCAP file whose records lie in one compressed chunk, without summary (MCAP specification, record 0x06)."""
    magic = data[:8]
    header_end = 8 + 9 + struct.unpack_from("<Q", data, 9)[0]
    records, at = [], header_end
    while True:
        code, length = struct.unpack_from("<BQ", data, at)
        if code in (0x0F, 0x02):
            break
        if code in (0x03, 0x04, 0x05):
            records.append(data[at : at + 9 + length])
        elif code == 0x06:
            body = data[at + 9 : at + 9 + length]
            (words,) = struct.unpack_from("<I", body, 28)
            records.append(unpacked(body) if words else body[40:])
        at += 9 + length
    raw = b"".join(records)
    body = packed(raw, compression)
    name = compression.encode()
    chunk = struct.pack("<QQQII", START, START, len(raw), 0, len(name)) + name + struct.pack("<Q", len(body)) + body
    end = b"\x0f" + struct.pack("<QI", 4, 0) + b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0)
    return data[:header_end] + b"\x06" + struct.pack("<Q", len(chunk)) + chunk + end + magic


def packed(raw: bytes, compression: str) -> bytes:
    if not compression:
        return raw
    if compression == "lz4":
        import lz4.frame

        return bytes(lz4.frame.compress(raw))
    return bytes(zstd_module().compress(raw))


def bench_files(folder: Path) -> list[bytes]:
    write_bag(folder / "plain", small_recording(), SENSORS, message_types={"cell": "geometry_msgs/msg/WrenchStamped"})
    plain = (folder / "plain" / "plain.mcap").read_bytes()
    return [plain, rechunked(plain, "zstd"), rechunked(plain, "lz4")]


def db3_files(folder: Path) -> list[bytes]:
    write_bag(folder / "sql", small_recording(), SENSORS, storage="sqlite3")
    return [(folder / "sql" / "sql.db3").read_bytes()]


def ros1_files(folder: Path) -> list[bytes]:
    store = get_typestore(Stores.ROS1_NOETIC)
    found = []
    for name, compression in (("plain", None), ("lz4", Ros1Writer.CompressionFormat.LZ4)):
        with contextlib.ExitStack() as stack:
            writer = Ros1Writer(folder / f"{name}.bag")
            if compression is not None:
                writer.set_compression(compression)
            stack.enter_context(writer)
            connection = writer.add_connection("/accel", "sensor_msgs/msg/Imu", typestore=store)
            for k in range(10):
                stamp = START + k * 2_000_000
                writer.write(connection, stamp, store.serialize_ros1(_imu(stamp, store), connection.msgtype))
        found.append((folder / f"{name}.bag").read_bytes())
    return found
