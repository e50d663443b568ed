# Copyright 2026 ride_estimation contributors
"""ROS messages to samples, the same for live messages (rclpy) and recorded ones (rosbags): only attributes are used.

Covariance as in ``sensor_msgs/Imu`` and REP-145: ``[0] == -1`` or NaN says the quantity is not provided (the sample is
refused unless the sensor says ``trust_despite_minus_one``), all zeros say unknown (the noise of the vehicle file counts),
anything else is used.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from ride_estimation.sensors.sensor import Sensor

#: why a message gives no sample
NOT_PROVIDED = "covariance_says_not_provided"
GYRO_NOT_PROVIDED = "angular_velocity_says_not_provided"
INVALID_COVARIANCE = "covariance_invalid"
ELEMENT_MISSING = "element_not_in_message"
#: variances a message may state [unit^2]: standard deviations of 1e-9 to 1e6, beyond any sensor; others are a mistake
SMALLEST_VARIANCE, LARGEST_VARIANCE = 1e-18, 1e12


class Sample(NamedTuple):
    """One sample of one sensor, or why there is none.

    Attributes
    ----------
    sensor
        Sensor name of the vehicle file.
    stamp_ns
        Header stamp [ns].
    values
        Sensor axes, SI; empty where refused.
    variance
        Per value [unit^2], None where the message does not state it.
    rejection
        Empty, or the reason under which the sample is counted as refused.
    """

    sensor: str
    stamp_ns: int
    values: tuple[float, ...]
    variance: tuple[float, ...] | None
    rejection: str


Converter = Callable[[Any], Sequence[Sample]]


def stamp_of(message: Any) -> int:
    """Return the header stamp of a message [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def judge_covariance(covariance: Any, trusted: bool, noise_variance: float) -> tuple[tuple[float, float, float] | None, str]:
    """Return (variance of the three axes or None, reason for refusal or empty).

    Parameters
    ----------
    covariance
        Nine numbers, row-major 3 by 3.
    trusted
        Whether the data count although the message says they are not provided.
    noise_variance
        Stands in for an axis whose variance is zero while others are not [unit^2].
    """
    first, second, third = float(covariance[0]), float(covariance[4]), float(covariance[8])
    if first == 0.0 and second == 0.0 and third == 0.0:
        return None, ""
    if first == -1.0 or math.isnan(first):
        return None, "" if trusted else NOT_PROVIDED
    if not all(v == 0.0 or SMALLEST_VARIANCE <= v <= LARGEST_VARIANCE for v in (first, second, third)):
        return None, "" if trusted else INVALID_COVARIANCE
    return (first or noise_variance, second or noise_variance, third or noise_variance), ""


def _measured(sensor: Sensor) -> Callable[[tuple[float, float, float]], tuple[float, ...]]:
    """Return what puts zero for the axes that a sensor does not measure, see :attr:`Sensor.axes`."""
    if sensor.triaxial:
        return lambda values: values
    x, y, z = sensor.measured[:3].tolist()
    return lambda values: (values[0] if x else 0.0, values[1] if y else 0.0, values[2] if z else 0.0)


def _imu(sensor: Sensor) -> Converter:
    name, trusted, noise, gyro_noise = sensor.name, sensor.trust_despite_minus_one, sensor.noise_std**2, sensor.gyro_noise_std**2
    with_gyro, measured = sensor.kind == "imu", _measured(sensor)

    def convert(message: Any) -> Sequence[Sample]:
        stamp = stamp_of(message)
        variance, reason = judge_covariance(message.linear_acceleration_covariance, trusted, noise)
        if reason:
            return (Sample(name, stamp, (), None, reason),)
        a = message.linear_acceleration
        if not with_gyro:
            return (Sample(name, stamp, measured((float(a.x), float(a.y), float(a.z))), variance, ""),)
        spread, reason = judge_covariance(message.angular_velocity_covariance, trusted, gyro_noise)
        if reason:
            return (Sample(name, stamp, (), None, GYRO_NOT_PROVIDED if reason == NOT_PROVIDED else reason),)
        w = message.angular_velocity
        values = (float(a.x), float(a.y), float(a.z), float(w.x), float(w.y), float(w.z))
        both = None
        if variance is not None or spread is not None:
            both = (*(variance or (noise,) * 3), *(spread or (gyro_noise,) * 3))
        return (Sample(name, stamp, values, both, ""),)

    return convert


def _three(sensor: Sensor, pick: Callable[[Any], Any]) -> Converter:
    name, measured = sensor.name, _measured(sensor)

    def convert(message: Any) -> Sequence[Sample]:
        v = pick(message)
        return (Sample(name, stamp_of(message), measured((float(v.x), float(v.y), float(v.z))), None, ""),)

    return convert


def _along(sensor: Sensor, pick: Callable[[Any], Any]) -> Converter:
    name = sensor.name

    def convert(message: Any) -> Sequence[Sample]:
        return (Sample(name, stamp_of(message), (float(pick(message).linear.x),), None, ""),)

    return convert


def _joint_state(sensors: Sequence[Sensor]) -> Converter:
    def convert(message: Any) -> Sequence[Sample]:
        stamp = stamp_of(message)
        position = dict(zip(message.name, message.position))
        # transducers may come in one message or each in its own, so only a message with none of them is odd
        found = [Sample(s.name, stamp, (float(position[s.element]),), None, "") for s in sensors if s.element in position]
        return found or (Sample(sensors[0].name, stamp, (), None, ELEMENT_MISSING),)

    return convert


#: message type -> (kinds of sensor it can feed, how to make the converter)
_MAKERS: Mapping[str, tuple[tuple[str, ...], Callable[[Sequence[Sensor]], Converter]]] = {
    "sensor_msgs/msg/Imu": (("accelerometer", "imu"), lambda sensors: _imu(sensors[0])),
    "geometry_msgs/msg/AccelStamped": (("accelerometer",), lambda sensors: _three(sensors[0], lambda m: m.accel.linear)),
    "geometry_msgs/msg/Vector3Stamped": (
        ("accelerometer", "force"), lambda sensors: _three(sensors[0], lambda m: m.vector),
    ),
    "sensor_msgs/msg/JointState": (("displacement",), _joint_state),
    "geometry_msgs/msg/TwistStamped": (("speed",), lambda sensors: _along(sensors[0], lambda m: m.twist)),
    "nav_msgs/msg/Odometry": (("speed",), lambda sensors: _along(sensors[0], lambda m: m.twist.twist)),
    "geometry_msgs/msg/WrenchStamped": (("force",), lambda sensors: _three(sensors[0], lambda m: m.wrench.force)),
}


def accepted_types(kind: str) -> tuple[str, ...]:
    """Return the message types a kind of sensor can come in, the usual one first."""
    return tuple(name for name, (kinds, _) in _MAKERS.items() if kind in kinds)


def sensors_by_topic(sensors: Iterable[Sensor]) -> dict[str, tuple[Sensor, ...]]:
    """Return the sensors of every topic."""
    found: dict[str, tuple[Sensor, ...]] = {}
    for sensor in sensors:
        found[sensor.topic] = (*found.get(sensor.topic, ()), sensor)
    return found


def make_converter(message_type: str, sensors: Sequence[Sensor]) -> Converter | None:
    """Return the function from a message to samples, None where the type cannot feed these sensors.

    Parameters
    ----------
    message_type
        As in ``sensor_msgs/msg/Imu``.
    sensors
        The sensors of one topic.
    """
    entry = _MAKERS.get(message_type)
    if entry is None or any(s.kind not in entry[0] for s in sensors):
        return None
    return entry[1](sensors)
