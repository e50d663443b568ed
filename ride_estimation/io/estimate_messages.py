# Copyright 2026 ride_estimation contributors
"""Estimates as ROS 2 messages in serialized form, without ROS: what the node publishes and what ``run.mcap`` holds.

One code path for both, so that a recording holds bit by bit what a live node would have published.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores

from ride_estimation.estimation.common.estimate import Estimate, Status
from ride_estimation.estimation.output import Ticks
from ride_estimation.frames import AXES
from ride_estimation.io.bag_source import type_store
from ride_estimation.io.message_form import MessageForm, serialized
from ride_estimation.vehicles.vehicle import Body

Array = NDArray[np.float64]

#: message of an estimate's status as a diagnostic level: OK 0, WARN 1, ERROR 2
LEVELS: Mapping[Status, int] = {
    Status.VALID: 0, Status.ESTIMATING: 0, Status.STARTING: 0, Status.SUSPECT: 1, Status.NOT_IDENTIFIABLE: 1, Status.INVALID: 2,
}  # fmt: skip

PARAMETERS_TOPIC, INERTIA_TOPIC = "parameters", "inertia"


@dataclasses.dataclass(frozen=True)
class Frames:
    """Frame names of the outputs.

    Attributes
    ----------
    cg
        At the centre of gravity, axes of the cab.
    vehicle
        Origin and axes of the vehicle file.
    mount_prefix
        The frame of a mount force is this and the mount's name.
    """

    cg: str = "cab_cg"
    vehicle: str = "cab_link"
    mount_prefix: str = "mount_"


class EstimateMessages:
    """Messages of the estimates.

    Parameters
    ----------
    mount_names
        In the order of the (.., M, 3) arrays.
    frames
        Frame names.

    Attributes
    ----------
    topics
        Name below the node's own -> message type, of the topics that speak at every tick, in order.
    """

    def __init__(self, mount_names: Sequence[str], frames: Frames) -> None:
        self._frames = frames
        self._forms = _forms(frames, mount_names)
        self.topics: dict[str, str] = {name: form.type_name for name, form in self._forms.items()}

    def ticks(self, block: Ticks, ticks: Sequence[int]) -> list[list[bytes]]:
        """Return the messages of some ticks of a block: one list per topic, in the order of :attr:`topics`."""
        count = len(ticks)

        def same(values: Array) -> Array:
            return np.broadcast_to(values.ravel(), (count, values.size))

        force, width = block.mount_force[ticks], block.mount_deflection_std.size
        deflection, rate, force_std = (
            values[ticks].reshape(count, width) for values in (block.mount_deflection, block.mount_rate, block.mount_force_std)
        )
        specific_force, spread = block.cg_specific_force[ticks, :3], block.cg_specific_force_covariance[:3, :3]
        numbers: Sequence[Sequence[Array]] = (
            [block.cg_accel[ticks], same(block.cg_accel_covariance)],
            [specific_force, same(spread), block.angular_rate[ticks], same(rate_covariance(block.angular_rate_std))],
            [block.inertial_load[ticks]],
            *([force[:, mount]] for mount in range(force.shape[1])),
            [deflection, rate, force.reshape(count, width)],
            [same(block.mount_deflection_std), force_std],
        )
        stamps = block.stamp_ns[ticks]
        return [form.fill(stamps, np.hstack(parts)) for form, parts in zip(self._forms.values(), numbers, strict=True)]

    def parameters(self, stamp_ns: int, body: Body, estimates: Iterable[Estimate]) -> bytes:
        """Return the estimated parameters, one status each with ``value std unit prior status``.

        A number that is not finite is left out rather than published; the status says why it is missing.
        """
        return serialized(parameters(stamp_ns, body.name, estimates))

    def inertia(self, stamp_ns: int, body: Body, tensor: Array, estimates: Iterable[Estimate]) -> bytes:
        """Return mass (as estimated), CG and inertia (3, 3) [kg m^2] of a body."""
        mass = next((e.value for e in estimates if e.name == f"{body.name}.mass" and np.isfinite(e.value)), body.mass.value)
        return serialized(inertia(stamp_ns, self._frames.vehicle, mass, body.cg, tensor))


def _forms(frames: Frames, mount_names: Sequence[str]) -> dict[str, MessageForm]:
    """Return the messages of a tick: CG acceleration, virtual accelerometer, load, forces, states and standard deviations."""
    joints = [f"{mount}_{axis}" for mount in mount_names for axis in AXES]
    count, cg = len(joints), frames.cg

    def force(mount: str) -> MessageForm:
        return MessageForm(lambda stamp, n: wrench(stamp, f"{frames.mount_prefix}{mount}", n), 3)

    return {
        "cg_accel": MessageForm(lambda stamp, n: cg_acceleration(stamp, cg, n[:6], n[6:]), 6 + 36),
        "cg_imu": MessageForm(lambda stamp, n: cg_imu(stamp, cg, n[:3], n[3:12], n[12:15], n[15:]), 3 + 9 + 3 + 9),
        "inertial_load": MessageForm(lambda stamp, n: wrench(stamp, cg, n[:3], n[3:]), 6),
        **{f"mounts/{mount}/force": force(mount) for mount in mount_names},
        "mounts/states": MessageForm(lambda stamp, n: joint_state(stamp, cg, joints, *np.split(n, 3)), 3 * count),
        "mounts/stddev": MessageForm(lambda stamp, n: joint_state(stamp, cg, joints, n[:count], n[:0], n[count:]), 2 * count),
    }


def new(kind: str, **fields: Any) -> Any:
    """Return a message of the type store."""
    return type_store(Stores.ROS2_JAZZY).types[kind](**fields)


def header(stamp_ns: int, frame_id: str) -> Any:
    """Return a header; nanoseconds since the epoch."""
    seconds, nanoseconds = divmod(int(stamp_ns), 1_000_000_000)
    time = new("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return new("std_msgs/msg/Header", stamp=time, frame_id=frame_id)


def vector(values: Sequence[float] | Array) -> Any:
    """Return a vector of three numbers."""
    return new("geometry_msgs/msg/Vector3", x=float(values[0]), y=float(values[1]), z=float(values[2]))


def _doubles(values: Array) -> Array:
    return np.ascontiguousarray(values, dtype=np.float64).ravel()


def cg_acceleration(stamp_ns: int, frame_id: str, acceleration: Array, covariance: Array) -> Any:
    """Return the CG acceleration without gravity.

    Parameters
    ----------
    acceleration
        Shape (6,): x y z [m/s^2], roll pitch yaw [rad/s^2].
    covariance
        Shape (6, 6), row-major in the message (REP-103).
    """
    accel = new("geometry_msgs/msg/Accel", linear=vector(acceleration[:3]), angular=vector(acceleration[3:]))
    spread = new("geometry_msgs/msg/AccelWithCovariance", accel=accel, covariance=_doubles(covariance))
    return new("geometry_msgs/msg/AccelWithCovarianceStamped", header=header(stamp_ns, frame_id), accel=spread)


def acceleration(stamp_ns: int, frame_id: str, values: Array) -> Any:
    """Return an acceleration: x y z [m/s^2], roll pitch yaw [rad/s^2], shape (6,)."""
    accel = new("geometry_msgs/msg/Accel", linear=vector(values[:3]), angular=vector(values[3:]))
    return new("geometry_msgs/msg/AccelStamped", header=header(stamp_ns, frame_id), accel=accel)


def rate_covariance(std: Array) -> Array:
    """Return the covariance of angular rates, shape (3, 3), from their standard deviations; -1 in front where there are none."""
    covariance = np.diag(std**2)
    if not covariance.any():
        covariance[0, 0] = -1.0  # REP-145: not provided; zeros would be taken for exact
    return covariance


def cg_imu(stamp_ns: int, frame_id: str, specific_force: Array, force_covariance: Array, rate: Array, spread: Array) -> Any:
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
    absent = np.zeros(9)
    absent[0] = -1.0
    return new(
        "sensor_msgs/msg/Imu",
        header=header(stamp_ns, frame_id),
        orientation=new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=absent,
        angular_velocity=vector(rate),
        angular_velocity_covariance=_doubles(spread),
        linear_acceleration=vector(specific_force),
        linear_acceleration_covariance=_doubles(force_covariance),
    )


def wrench(stamp_ns: int, frame_id: str, force: Array, torque: Array | None = None) -> Any:
    """Return a force [N] and, where given, a moment [N m]."""
    moment = vector((0.0, 0.0, 0.0) if torque is None else torque)
    both = new("geometry_msgs/msg/Wrench", force=vector(force), torque=moment)
    return new("geometry_msgs/msg/WrenchStamped", header=header(stamp_ns, frame_id), wrench=both)


def joint_state(stamp_ns: int, frame_id: str, names: Sequence[str], position: Array, velocity: Array, effort: Array) -> Any:
    """Return named deflections [m], rates [m/s] and forces [N]; arrays of len(names)."""
    return new(
        "sensor_msgs/msg/JointState", header=header(stamp_ns, frame_id), name=list(names), position=_doubles(position),
        velocity=_doubles(velocity), effort=_doubles(effort),
    )  # fmt: skip


def inertia(stamp_ns: int, frame_id: str, mass: float, cg: Array, tensor: Array) -> Any:
    """Return mass [kg], centre of gravity [m] and inertia about it [kg m^2], shape (3, 3)."""
    body = new(
        "geometry_msgs/msg/Inertia", m=float(mass), com=vector(cg),
        ixx=float(tensor[0, 0]), ixy=float(tensor[0, 1]), ixz=float(tensor[0, 2]),
        iyy=float(tensor[1, 1]), iyz=float(tensor[1, 2]), izz=float(tensor[2, 2]),
    )  # fmt: skip
    return new("geometry_msgs/msg/InertiaStamped", header=header(stamp_ns, frame_id), inertia=body)


def text(value: object) -> str:
    """Return a value as diagnostics carry it: numbers with nine digits, everything else as it prints."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (float, np.floating)):
        return f"{float(value):.9g}"
    return str(value)


def parameters(stamp_ns: int, hardware_id: str, estimates: Iterable[Estimate]) -> Any:
    """Return the estimated parameters as a DiagnosticArray; see :meth:`EstimateMessages.parameters`."""
    statuses = [_parameter_status(hardware_id, estimate) for estimate in estimates]
    return new("diagnostic_msgs/msg/DiagnosticArray", header=header(stamp_ns, ""), status=statuses)


def _parameter_status(hardware_id: str, estimate: Estimate) -> Any:
    numbers = {"value": estimate.value, "std": estimate.std, "prior": estimate.prior}
    values: dict[str, object] = {key: value for key, value in numbers.items() if math.isfinite(value)}
    values |= {"unit": estimate.unit, "status": estimate.status.value}
    pairs = [new("diagnostic_msgs/msg/KeyValue", key=key, value=text(value)) for key, value in values.items()]
    return new(
        "diagnostic_msgs/msg/DiagnosticStatus", level=LEVELS[estimate.status], name=estimate.name,
        message=estimate.reason or estimate.status.value, hardware_id=hardware_id, values=pairs,
    )  # fmt: skip
