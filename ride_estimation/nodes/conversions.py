# Copyright 2026 ride_estimation contributors
"""From numbers to messages; the only place where outgoing messages are filled.

Every scalar goes through ``float(...)``: rclpy's C converter does not check types, an ``int`` or ``numpy.float32`` in a
double field arrives as garbage without an error.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import AccelWithCovarianceStamped, InertiaStamped, Vector3, WrenchStamped
from numpy.typing import NDArray
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Header

from ride_estimation.estimation.common.estimate import Estimate, Status

Array = NDArray[np.float64]

#: message of an estimate's status as a diagnostic level
LEVELS: dict[Status, bytes] = {
    Status.VALID: DiagnosticStatus.OK,
    Status.ESTIMATING: DiagnosticStatus.OK,
    Status.STARTING: DiagnosticStatus.OK,
    Status.SUSPECT: DiagnosticStatus.WARN,
    Status.NOT_IDENTIFIABLE: DiagnosticStatus.WARN,
    Status.INVALID: DiagnosticStatus.ERROR,
}


def time_message(stamp_ns: int) -> Time:
    """Return a stamp; nanoseconds since the epoch."""
    seconds, nanoseconds = divmod(int(stamp_ns), 1_000_000_000)
    return Time(sec=seconds, nanosec=nanoseconds)


def header(stamp_ns: int, frame_id: str) -> Header:
    """Return a header."""
    return Header(stamp=time_message(stamp_ns), frame_id=frame_id)


def _fill(vector: Vector3, values: Array) -> None:
    vector.x, vector.y, vector.z = float(values[0]), float(values[1]), float(values[2])


def cg_acceleration(stamp_ns: int, frame_id: str, acceleration: Array, covariance: Array) -> AccelWithCovarianceStamped:
    """Return the CG acceleration without gravity.

    Parameters
    ----------
    acceleration
        Shape (6,): x y z [m/s^2], roll pitch yaw [rad/s^2].
    covariance
        Shape (6, 6), row-major in the message (REP-103).
    """
    message = AccelWithCovarianceStamped(header=header(stamp_ns, frame_id))
    _fill(message.accel.accel.linear, acceleration[:3])
    _fill(message.accel.accel.angular, acceleration[3:])
    message.accel.covariance = np.ascontiguousarray(covariance, dtype=np.float64).ravel()
    return message


def rate_covariance(std: Array) -> Array:
    """Return the covariance of angular rates, shape (3, 3), from their standard deviations; -1 in front where there are none."""
    covariance = np.diag(std**2)
    if not covariance.any():
        covariance[0, 0] = -1.0  # REP-145: not provided; zeros would be taken for exact
    return covariance


def cg_imu(
    stamp_ns: int, frame_id: str, specific_force: Array, force_covariance: Array, rate: Array, spread: Array
) -> Imu:
    """Return the specific force at the CG as a virtual accelerometer (REP-145: +g upwards at rest).

    Parameters
    ----------
    specific_force
        Shape (3,) [m/s^2].
    force_covariance
        Shape (3, 3).
    rate
        Angular velocity, shape (3,) [rad/s]. Orientation is marked as not provided.
    spread
        Of :func:`rate_covariance`.
    """
    message = Imu(header=header(stamp_ns, frame_id))
    message.orientation_covariance[0] = -1.0
    _fill(message.angular_velocity, rate)
    message.angular_velocity_covariance = np.ascontiguousarray(spread, dtype=np.float64).ravel()
    _fill(message.linear_acceleration, specific_force)
    message.linear_acceleration_covariance = np.ascontiguousarray(force_covariance, dtype=np.float64).ravel()
    return message


def wrench(stamp_ns: int, frame_id: str, force: Array, torque: Array | None = None) -> WrenchStamped:
    """Return a force [N] and, where given, a moment [N m]."""
    message = WrenchStamped(header=header(stamp_ns, frame_id))
    _fill(message.wrench.force, force)
    if torque is not None:
        _fill(message.wrench.torque, torque)
    return message


def _doubles(values: Array) -> array[float]:
    return array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


def joint_state(
    stamp_ns: int, frame_id: str, names: Sequence[str], position: Array, velocity: Array, effort: Array
) -> JointState:
    """Return named deflections [m], rates [m/s] and forces [N]; arrays of len(names)."""
    message = JointState(header=header(stamp_ns, frame_id), name=list(names))
    message.position = _doubles(position)
    message.velocity = _doubles(velocity)
    message.effort = _doubles(effort)
    return message


def inertia(stamp_ns: int, frame_id: str, mass: float, cg: Array, tensor: Array) -> InertiaStamped:
    """Return mass [kg], centre of gravity [m] and inertia about it [kg m^2], shape (3, 3)."""
    message = InertiaStamped(header=header(stamp_ns, frame_id))
    body = message.inertia
    body.m = float(mass)
    _fill(body.com, cg)
    body.ixx, body.ixy, body.ixz = float(tensor[0, 0]), float(tensor[0, 1]), float(tensor[0, 2])
    body.iyy, body.iyz, body.izz = float(tensor[1, 1]), float(tensor[1, 2]), float(tensor[2, 2])
    return message


def text(value: object) -> str:
    """Return a value as diagnostics carry it: numbers with nine digits, everything else as it prints."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (float, np.floating)):
        return f"{float(value):.9g}"
    return str(value)


def status(level: bytes, name: str, message: str, hardware_id: str, values: Mapping[str, object]) -> DiagnosticStatus:
    """Return one diagnostic status."""
    pairs = [KeyValue(key=key, value=text(value)) for key, value in values.items()]
    return DiagnosticStatus(level=level, name=name, message=message, hardware_id=hardware_id, values=pairs)


def diagnostics(stamp_ns: int, statuses: Iterable[DiagnosticStatus]) -> DiagnosticArray:
    """Return statuses under one stamp."""
    return DiagnosticArray(header=header(stamp_ns, ""), status=list(statuses))


def parameters(stamp_ns: int, hardware_id: str, estimates: Iterable[Estimate]) -> DiagnosticArray:
    """Return the estimated parameters, one status each with ``value std unit prior status``.

    A number that is not finite is left out rather than published; the status says why it is missing.
    """
    return diagnostics(stamp_ns, (_parameter_status(hardware_id, estimate) for estimate in estimates))


def _parameter_status(hardware_id: str, estimate: Estimate) -> DiagnosticStatus:
    numbers = {"value": estimate.value, "std": estimate.std, "prior": estimate.prior}
    values: dict[str, object] = {key: value for key, value in numbers.items() if math.isfinite(value)}
    values["unit"] = estimate.unit
    values["status"] = estimate.status.value
    return status(LEVELS[estimate.status], estimate.name, estimate.reason or estimate.status.value, hardware_id, values)
