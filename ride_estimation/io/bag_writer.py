# Copyright 2026 ride_estimation contributors
"""Recordings to rosbag2 bags (MCAP, zstd chunks, version 9)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores

from ride_estimation.errors import InputDataError
from ride_estimation.io.atomic import replacing
from ride_estimation.io.bag_source import type_store
from ride_estimation.io.message_form import serialized
from ride_estimation.io.messages import accepted_types, sensors_by_topic
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import Channel, Recording

Array = NDArray[np.float64]
NANOSECONDS = 1_000_000_000


def write_bag(
    path: str | Path,
    recording: Recording,
    sensors: Mapping[str, Sensor],
    *,
    message_types: Mapping[str, str] | None = None,
    storage: str = "mcap",
) -> None:
    """Write a recording as a rosbag2 folder that :func:`ride_estimation.io.bags.read_recording` reads again.

    Messages are in order of ``arrival_ns``. Displacement sensors of one topic with the same stamp share a JointState. An
    accelerometer without variance is written with an all-zero covariance (unknown); orientation and, for a plain
    accelerometer, angular velocity are marked as not provided.

    Parameters
    ----------
    path
        Folder to create.
    recording
        The samples.
    sensors
        Sensors of the vehicle file, by the names of the channels.
    message_types
        Sensor name -> message type, where it is not the usual one of its kind.
    storage
        ``mcap`` or ``sqlite3``.

    Raises
    ------
    InputDataError
        The folder exists, a channel has no sensor, or a type cannot carry a sensor.
    """
    path = Path(path)
    if path.exists():
        raise InputDataError(f"{path}: exists already; a bag is never overwritten")
    unknown = [name for name in recording.channels if name not in sensors]
    if unknown:
        raise InputDataError(f"channels without a sensor in the vehicle: {', '.join(unknown)}")
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as new:
        _write_messages(new, recording, sensors, dict(message_types or {}), storage)


def _write_messages(
    path: Path, recording: Recording, sensors: Mapping[str, Sensor], chosen: Mapping[str, str], storage: str
) -> None:
    """Write the folder of a bag."""
    store = type_store(Stores.ROS2_JAZZY)
    writer = Writer(path, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin[storage.upper()])
    if storage == "mcap":
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        jobs = [
            (writer.add_connection(topic, kind, typestore=store), arrival, messages)
            for topic, kind, arrival, messages in serialized_inputs(recording, sensors, chosen)
        ]
        for connection, received, message in by_arrival(jobs):
            writer.write(connection, received, message)


def serialized_inputs(
    recording: Recording, sensors: Mapping[str, Sensor], chosen: Mapping[str, str]
) -> Iterator[tuple[str, str, list[int], Iterator[bytes]]]:
    """Yield topic, message type, times of arrival [ns] and serialized messages of every topic of a recording.

    Parameters
    ----------
    recording, sensors
        The samples, and the sensors by the names of the channels.
    chosen
        Sensor name -> message type, where it is not the usual one of its kind.

    Raises
    ------
    InputDataError
        A type cannot carry a sensor.
    """
    store = type_store(Stores.ROS2_JAZZY)
    for topic, group in sensors_by_topic(sensors[name] for name in recording.channels).items():
        kind = chosen.get(group[0].name, accepted_types(group[0].kind)[0])
        if kind not in accepted_types(group[0].kind):
            raise InputDataError(f"{group[0].name}: {kind} cannot carry kind {group[0].kind}")
        arrival, messages = _topic_messages(store, kind, group, [recording.channels[s.name] for s in group])
        yield topic, kind, arrival, map(serialized, messages)


def by_arrival(jobs: Sequence[tuple[Any, Sequence[int], Iterator[bytes]]]) -> Iterator[tuple[Any, int, bytes]]:
    """Yield connection, time and message of all topics in order of time; the messages of a topic stay in their order."""
    owner = np.concatenate([np.full(len(arrival), i) for i, (_, arrival, _) in enumerate(jobs)] or [np.zeros(0, dtype=int)])
    times = np.concatenate([np.array(arrival, dtype=np.int64) for _, arrival, _ in jobs] or [np.zeros(0, dtype=np.int64)])
    # a stable sort keeps the order inside a topic wherever its receive times do not fall
    for place in np.argsort(times, kind="stable"):
        connection, _, messages = jobs[int(owner[place])]
        yield connection, int(times[place]), next(messages)


def _topic_messages(
    store: Any, kind: str, sensors: Sequence[Sensor], channels: Sequence[Channel]
) -> tuple[list[int], Iterator[Any]]:
    if kind == "sensor_msgs/msg/JointState":
        return _joint_states(store, sensors, channels)
    channel, sensor = channels[0], sensors[0]
    arrival = [int(t) for t in channel.arrival_ns]
    in_order = np.argsort(channel.arrival_ns, kind="stable")
    make = {
        "sensor_msgs/msg/Imu": _imu,
        "geometry_msgs/msg/AccelStamped": _accel,
        "geometry_msgs/msg/Vector3Stamped": _vector,
        "geometry_msgs/msg/TwistStamped": _twist,
        "geometry_msgs/msg/WrenchStamped": _wrench,
    }[kind]
    frame = channel.frame_id or sensor.name
    rows = (
        (
            _header(store, int(channel.stamp_ns[i]), frame),
            channel.values[i],
            None if channel.variance is None or np.isnan(channel.variance[i, 0]) else channel.variance[i],
        )
        for i in in_order
    )
    return arrival, (make(store, *row) for row in rows)


def _header(store: Any, stamp: int, frame: str) -> Any:
    time = store.types["builtin_interfaces/msg/Time"](sec=stamp // NANOSECONDS, nanosec=stamp % NANOSECONDS)
    return store.types["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def _xyz(store: Any, values: Sequence[float] | Array) -> Any:
    return store.types["geometry_msgs/msg/Vector3"](x=float(values[0]), y=float(values[1]), z=float(values[2]))


def _diagonal(values: Array | None) -> Array:
    return np.zeros(9) if values is None else np.diag(np.asarray(values, dtype=float)).ravel()


def _absent() -> Array:
    covariance = np.zeros(9)
    covariance[0] = -1.0
    return covariance


def _imu(store: Any, header: Any, values: Array, variance: Array | None) -> Any:
    gyro = len(values) == 6
    return store.types["sensor_msgs/msg/Imu"](
        header=header,
        orientation=store.types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=_absent(),
        angular_velocity=_xyz(store, values[3:6] if gyro else (0.0, 0.0, 0.0)),
        angular_velocity_covariance=_diagonal(None if variance is None else variance[3:6]) if gyro else _absent(),
        linear_acceleration=_xyz(store, values),
        linear_acceleration_covariance=_diagonal(None if variance is None else variance[:3]),
    )


def _accel(store: Any, header: Any, values: Array, _: Array | None) -> Any:
    accel = store.types["geometry_msgs/msg/Accel"](linear=_xyz(store, values), angular=_xyz(store, (0.0, 0.0, 0.0)))
    return store.types["geometry_msgs/msg/AccelStamped"](header=header, accel=accel)


def _vector(store: Any, header: Any, values: Array, _: Array | None) -> Any:
    return store.types["geometry_msgs/msg/Vector3Stamped"](header=header, vector=_xyz(store, values))


def _twist(store: Any, header: Any, values: Array, _: Array | None) -> Any:
    twist = store.types["geometry_msgs/msg/Twist"](
        linear=_xyz(store, (float(values[0]), 0.0, 0.0)), angular=_xyz(store, (0.0, 0.0, 0.0))
    )
    return store.types["geometry_msgs/msg/TwistStamped"](header=header, twist=twist)


def _wrench(store: Any, header: Any, values: Array, _: Array | None) -> Any:
    wrench = store.types["geometry_msgs/msg/Wrench"](force=_xyz(store, values), torque=_xyz(store, (0.0, 0.0, 0.0)))
    return store.types["geometry_msgs/msg/WrenchStamped"](header=header, wrench=wrench)


def _joint_states(store: Any, sensors: Sequence[Sensor], channels: Sequence[Channel]) -> tuple[list[int], Iterator[Any]]:
    together: dict[int, list[tuple[str, float]]] = {}
    arrival: dict[int, int] = {}
    for sensor, channel in zip(sensors, channels):
        for stamp, received, value in zip(channel.stamp_ns.tolist(), channel.arrival_ns.tolist(), channel.values[:, 0].tolist()):
            together.setdefault(stamp, []).append((sensor.element, value))
            arrival.setdefault(stamp, received)
    stamps = sorted(together, key=lambda stamp: arrival[stamp])
    empty = np.zeros(0)

    def messages() -> Iterator[Any]:
        for stamp in stamps:
            names = [name for name, _ in together[stamp]]
            position = np.array([value for _, value in together[stamp]])
            yield store.types["sensor_msgs/msg/JointState"](
                header=_header(store, stamp, "mounts"), name=names, position=position, velocity=empty, effort=empty
            )

    return [arrival[stamp] for stamp in stamps], messages()
