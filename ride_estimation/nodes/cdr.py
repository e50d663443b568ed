# Copyright 2026 ride_estimation contributors
"""Read serialized messages without building message objects, several times cheaper than rclpy's deserialization.

All numbers of these messages lie at fixed offsets behind the frame name. A reader returns a view with the attributes that
:mod:`ride_estimation.io.messages` looks at; the view is filled again by the next message. What is not plain
little-endian CDR of the right length goes through rclpy's own deserialization.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from rclpy.serialization import deserialize_message

from ride_estimation.nodes.inputs import MESSAGE_CLASSES

Reader = Callable[[bytes], Any]

_HEAD = struct.Struct("<iII")  # stamp.sec, stamp.nanosec, length of frame_id with its terminating zero
_ENCAPSULATION = 4
_LITTLE_ENDIAN_CDR = b"\x00\x01"


def _body_offset(payload: bytes, view: SimpleNamespace) -> int:
    """Fill the stamp and return where the numbers start."""
    view.header.stamp.sec, view.header.stamp.nanosec, length = _HEAD.unpack_from(payload, _ENCAPSULATION)
    return _ENCAPSULATION + ((_HEAD.size + length + 7) & ~7)


def _vector() -> SimpleNamespace:
    return SimpleNamespace(x=0.0, y=0.0, z=0.0)


def _view(**parts: Any) -> SimpleNamespace:
    return SimpleNamespace(header=SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0)), **parts)


def _imu_filler() -> tuple[SimpleNamespace, Callable[[bytes], None], int]:
    numbers = struct.Struct("<24d")  # behind the orientation: rate 3, covariance 9, acceleration 3, covariance 9
    rate, acceleration = _vector(), _vector()
    view = _view(
        angular_velocity=rate, linear_acceleration=acceleration, angular_velocity_covariance=(), linear_acceleration_covariance=()
    )

    def fill(payload: bytes) -> None:
        n = numbers.unpack_from(payload, _body_offset(payload, view) + 13 * 8)
        rate.x, rate.y, rate.z = n[0:3]
        view.angular_velocity_covariance = n[3:12]
        acceleration.x, acceleration.y, acceleration.z = n[12:15]
        view.linear_acceleration_covariance = n[15:24]

    return view, fill, 37


def _vector_filler(wrap: Callable[[SimpleNamespace], SimpleNamespace], doubles: int) -> Any:
    numbers = struct.Struct("<3d")
    vector = _vector()
    view = wrap(vector)

    def fill(payload: bytes) -> None:
        vector.x, vector.y, vector.z = numbers.unpack_from(payload, _body_offset(payload, view))

    return view, fill, doubles


_FILLERS: dict[str, Callable[[], tuple[SimpleNamespace, Callable[[bytes], None], int]]] = {
    "sensor_msgs/msg/Imu": _imu_filler,
    "geometry_msgs/msg/AccelStamped": lambda: _vector_filler(lambda v: _view(accel=SimpleNamespace(linear=v)), 6),
    "geometry_msgs/msg/Vector3Stamped": lambda: _vector_filler(lambda v: _view(vector=v), 3),
    "geometry_msgs/msg/TwistStamped": lambda: _vector_filler(lambda v: _view(twist=SimpleNamespace(linear=v)), 6),
    "geometry_msgs/msg/WrenchStamped": lambda: _vector_filler(lambda v: _view(wrench=SimpleNamespace(force=v)), 6),
}


def stamp_of_payload(payload: bytes) -> int | None:
    """Return the header stamp of a serialized message [ns], None where it is not little-endian CDR."""
    if payload[:2] != _LITTLE_ENDIAN_CDR or len(payload) < _ENCAPSULATION + _HEAD.size:
        return None
    seconds, rest, _ = _HEAD.unpack_from(payload, _ENCAPSULATION)
    return int(seconds) * 1_000_000_000 + int(rest)


def make_reader(type_name: str) -> Reader:
    """Return the function from serialized bytes to a message or a view of it.

    Parameters
    ----------
    type_name
        One of :data:`~ride_estimation.nodes.inputs.MESSAGE_CLASSES`.
    """
    message_class = MESSAGE_CLASSES[type_name]

    def read_any(payload: bytes) -> Any:
        return deserialize_message(payload, message_class)

    if type_name not in _FILLERS:
        return read_any
    view, fill, doubles = _FILLERS[type_name]()

    def read(payload: bytes) -> Any:
        if payload[:2] == _LITTLE_ENDIAN_CDR and len(payload) >= 24:
            (length,) = struct.unpack_from("<I", payload, 12)
            if len(payload) >= _ENCAPSULATION + ((_HEAD.size + length + 7) & ~7) + 8 * doubles:
                fill(payload)
                return view
        return read_any(payload)

    return read
