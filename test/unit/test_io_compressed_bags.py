# Copyright 2026 ride_estimation contributors
"""Bags whose messages are compressed one by one, and bags of several files, are read as what was written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fuzz.recordings import SENSORS, START, STORE, _imu, small_recording
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from ride_estimation.errors import InputDataError
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.bags import read_recording
from ride_estimation.vehicles.vehicle import Vehicle

VEHICLE = Vehicle("v", {}, {}, {"accel": SENSORS["accel"]})


def write(path: Path, plugin: StoragePlugin, mode: CompressionMode | None) -> Path:
    writer = Writer(path, version=9, storage_plugin=plugin)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/accel", "sensor_msgs/msg/Imu", typestore=STORE)
        for k in range(30):
            writer.write(connection, START + k * 2_000_000, STORE.serialize_cdr(_imu(START + k * 2_000_000), connection.msgtype))
    return path


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_messages_compressed_one_by_one_are_read(plugin: StoragePlugin, tmp_path: Path) -> None:
    plain = read_recording(write(tmp_path / "plain", plugin, None), VEHICLE).channels["accel"]
    packed = read_recording(write(tmp_path / "packed", plugin, CompressionMode.MESSAGE), VEHICLE).channels["accel"]
    assert np.array_equal(packed.stamp_ns, plain.stamp_ns) and len(plain.stamp_ns) == 30
    assert np.array_equal(packed.values, plain.values)
    assert np.array_equal(packed.arrival_ns, plain.arrival_ns)


def test_files_compressed_as_a_whole_are_refused_with_what_to_do(tmp_path: Path) -> None:
    write_bag(tmp_path / "b", small_recording(), SENSORS)
    metadata = tmp_path / "b" / "metadata.yaml"
    text = metadata.read_text()
    metadata.write_text(text.replace("compression_mode: ''", "compression_mode: file"))
    assert metadata.read_text() != text
    with pytest.raises(InputDataError, match="unpack them first"):
        read_recording(tmp_path / "b", Vehicle("v", {}, {}, SENSORS))
