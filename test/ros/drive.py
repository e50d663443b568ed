# Copyright 2026 ride_estimation contributors
"""Serialized sensor messages of a made-up drive: what drivers would publish, with faults where a test wants them."""

from __future__ import annotations

import cmath
import functools
import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import AccelStamped, Vector3Stamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu

from ride_estimation.nodes.conversions import header
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.vehicle import Vehicle

START_NS = 1_700_000_000_000_000_000
IMU = "sensor_msgs/msg/Imu"


@dataclass(frozen=True)
class Message:
    """One message as it comes from the wire."""

    topic: str
    type_name: str
    payload: bytes
    stamp_ns: int


def imu(stamp_ns: int, accel: np.ndarray, frame_id: str = "sensor", covariance0: float = 0.0) -> Imu:
    """Return an accelerometer message; zeros say that the covariance is unknown."""
    message = Imu(header=header(stamp_ns, frame_id))
    message.orientation_covariance[0] = -1.0
    message.angular_velocity_covariance[0] = -1.0
    vector = message.linear_acceleration
    vector.x, vector.y, vector.z = (float(v) for v in accel)
    message.linear_acceleration_covariance[0] = covariance0
    return message


def accel_stamped(stamp_ns: int, accel: np.ndarray) -> AccelStamped:
    message = AccelStamped(header=header(stamp_ns, "sensor"))
    vector = message.accel.linear
    vector.x, vector.y, vector.z = (float(v) for v in accel)
    return message


def vector3_stamped(stamp_ns: int, accel: np.ndarray) -> Vector3Stamped:
    message = Vector3Stamped(header=header(stamp_ns, "sensor"))
    message.vector.x, message.vector.y, message.vector.z = (float(v) for v in accel)
    return message


def wire(message: object) -> bytes:
    return bytes(serialize_message(message))


#: frequencies [Hz] and amplitudes [m/s^2] at which the chassis shakes, all brackets alike
SHAKE = ((1.3, 0.6), (3.1, 1.0), (7.0, 1.5))
#: natural frequency of the cab on its mounts [rad/s] and damping ratio
NATURAL, RATIO = 2.0 * math.pi * 2.0, 0.25
#: of every channel, standard deviation [m/s^2]
NOISE = 0.01
#: values after which it begins again, one per millisecond
NOISE_LENGTH = 10_007


@functools.cache
def _noise(name: str) -> np.ndarray:
    return NOISE * np.random.default_rng(zlib.crc32(name.encode())).standard_normal((NOISE_LENGTH, 3))


def reading(sensor: Sensor, time_s: float) -> np.ndarray:
    """Return the specific force of a cab that heaves on linear mounts over a chassis that shakes."""
    vertical = 9.80665
    for frequency, amplitude in SHAKE:
        omega = 2.0 * math.pi * frequency
        passed = complex(NATURAL**2, 2.0 * RATIO * NATURAL * omega)
        response = passed / (passed - omega**2) if sensor.body == "cab" else 1.0
        vertical += amplitude * (response * cmath.exp(1j * omega * time_s)).imag
    # slow enough for the stiff horizontal mounts to pass it on
    along, across = (0.3 * math.sin(2.0 * math.pi * frequency * time_s) for frequency in (0.7, 0.9))
    return np.array([along, across, vertical]) + _noise(sensor.name)[round(1e3 * time_s) % NOISE_LENGTH]


def drive(vehicle: Vehicle, seconds: float, rate_hz: float = 100.0, start_ns: int = START_NS) -> Iterator[Message]:
    """Yield what all accelerometers of a vehicle publish, in order of their stamps."""
    sensors = [s for s in vehicle.sensors.values() if s.kind == "accelerometer"]
    for k in range(round(seconds * rate_hz)):
        stamp = start_ns + round(k * 1e9 / rate_hz)
        for sensor in sensors:
            accel = reading(sensor, k / rate_hz)
            yield Message(sensor.topic, IMU, wire(imu(stamp, accel, f"{sensor.name}_frame")), stamp)
