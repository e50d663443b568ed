# Copyright 2026 ride_estimation contributors
"""Write a measurement as a rosbag2 (MCAP) through rosbags directly: the way a logging stack would have recorded it."""

from __future__ import annotations

import pathlib

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from worlds.cab import Measurement

START_NS = 1_700_000_000_000_000_000


def write_bag(path: pathlib.Path, measurement: Measurement, *, latency_s: float = 0.003) -> None:
    """Write one ``sensor_msgs/Imu`` topic per accelerometer and one ``sensor_msgs/JointState`` for all transducers.

    Topics are those of ``vehicle_text.sensor_line``; orientation and unused covariances say "not provided" (-1).
    """
    store = get_typestore(Stores.ROS2_JAZZY)
    kinds = {name: store.types[name] for name in ("sensor_msgs/msg/Imu", "sensor_msgs/msg/JointState", "std_msgs/msg/Header")}
    time_type = store.types["builtin_interfaces/msg/Time"]
    vector, quaternion = store.types["geometry_msgs/msg/Vector3"], store.types["geometry_msgs/msg/Quaternion"]
    unknown = np.array([-1.0, *[0.0] * 8])

    def header(stamp: int, frame: str) -> object:
        return kinds["std_msgs/msg/Header"](time_type(stamp // 10**9, stamp % 10**9), frame)

    messages: list[tuple[int, str, str, object]] = []
    joints: dict[int, tuple[list[str], list[float]]] = {}
    for sensor in measurement.sensors:
        stamps = START_NS + np.round(measurement.stamps[sensor.name] * 1e9).astype(np.int64)
        if sensor.kind == "displacement":
            for stamp, value in zip(stamps, measurement.data[sensor.name][:, 0]):
                names, values = joints.setdefault(int(stamp), ([], []))
                names.append(f"{sensor.place}_{sensor.axis}")
                values.append(float(value))
            continue
        spread = np.diag([sensor.noise_std**2] * 3).ravel()
        for stamp, value in zip(stamps, measurement.data[sensor.name]):
            rate = vector(*map(float, value[3:])) if sensor.kind == "imu" else vector(0.0, 0.0, 0.0)
            rate_spread = np.diag([sensor.gyro_noise_std**2] * 3).ravel() if sensor.kind == "imu" else unknown
            message = kinds["sensor_msgs/msg/Imu"](
                header(int(stamp), sensor.name), quaternion(0.0, 0.0, 0.0, 1.0), unknown, rate, rate_spread,
                vector(*map(float, value[:3])), spread,
            )  # fmt: skip
            messages.append((int(stamp), f"/{sensor.name}/accel", "sensor_msgs/msg/Imu", message))
    empty = np.zeros(0)
    for stamp, (names, values) in joints.items():
        message = kinds["sensor_msgs/msg/JointState"](header(stamp, ""), names, np.array(values), empty, empty)
        messages.append((stamp, "/mounts/displacement", "sensor_msgs/msg/JointState", message))
    messages.sort(key=lambda item: (item[0], item[1]))
    with Writer(path, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[str, object] = {}
        for stamp, topic, kind, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], stamp + round(latency_s * 1e9), store.serialize_cdr(message, kind))
