# Copyright 2026 ride_estimation contributors
"""The output topics of the estimator node: one block of estimates in, messages out."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelWithCovarianceStamped, InertiaStamped, WrenchStamped
from numpy.typing import NDArray
from rclpy.lifecycle import LifecyclePublisher
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Imu, JointState

from ride_estimation.estimation.common.estimate import Estimate
from ride_estimation.estimation.output import OutputBlock
from ride_estimation.nodes import conversions, qos
from ride_estimation.nodes.serialized import MessageForm
from ride_estimation.vehicles.vehicle import Body

#: creates a lifecycle publisher: (message class, topic, QoS, overriding options)
CreatePublisher = Callable[[type, str, QoSProfile, QoSOverridingOptions], LifecyclePublisher]

AXES = ("x", "y", "z")


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

    cg: str
    vehicle: str
    mount_prefix: str


class EstimatePublishers:
    """All output topics.

    Parameters
    ----------
    create
        Creates one publisher on the node.
    mount_names
        In the order of the (.., M, 3) arrays.
    frames
        Frame names.
    profile
        QoS of the topics that speak at every tick; inertia and parameters are kept for whoever joins later.
    """

    def __init__(self, create: CreatePublisher, mount_names: Sequence[str], frames: Frames, profile: QoSProfile) -> None:
        def topic(message: type, name: str, profile: QoSProfile = profile) -> LifecyclePublisher:
            return create(message, name, profile, qos.overridable())

        self._vehicle_frame = frames.vehicle
        self._at_ticks = (
            topic(AccelWithCovarianceStamped, "~/cg_accel"),
            topic(Imu, "~/cg_imu"),
            topic(WrenchStamped, "~/inertial_load"),
            *(topic(WrenchStamped, f"~/mounts/{mount}/force") for mount in mount_names),
            topic(JointState, "~/mounts/states"),
            topic(JointState, "~/mounts/stddev"),
        )
        self._forms = _forms(frames, mount_names)
        self._inertia = topic(InertiaStamped, "~/inertia", qos.latched())
        self._parameters = topic(DiagnosticArray, "~/parameters", qos.latched())
        self.all: tuple[LifecyclePublisher, ...] = (*self._at_ticks, self._inertia, self._parameters)

    def publish_ticks(self, block: OutputBlock, ticks: Sequence[int]) -> None:
        """Publish the estimates of some ticks of a block, one tick after the other."""
        count = len(ticks)

        def same(values: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.broadcast_to(values.ravel(), (count, values.size))

        force, width = block.mount_force[ticks], block.mount_deflection_std.size
        deflection, rate, force_std = (
            values[ticks].reshape(count, width) for values in (block.mount_deflection, block.mount_rate, block.mount_force_std)
        )
        specific_force, spread = block.cg_specific_force[ticks, :3], block.cg_specific_force_covariance[:3, :3]
        numbers: Sequence[Sequence[NDArray[np.float64]]] = (
            [block.cg_accel[ticks], same(block.cg_accel_covariance)],
            [specific_force, same(spread), block.angular_rate[ticks], same(conversions.rate_covariance(block.angular_rate_std))],
            [block.inertial_load[ticks]],
            *([force[:, mount]] for mount in range(force.shape[1])),
            [deflection, rate, force.reshape(count, width)],
            [same(block.mount_deflection_std), force_std],
        )
        stamps = block.stamp_ns[ticks]
        messages = [form.fill(stamps, np.hstack(parts)) for form, parts in zip(self._forms, numbers, strict=True)]
        for of_tick in zip(*messages, strict=True):
            for publisher, message in zip(self._at_ticks, of_tick, strict=True):
                publisher.publish(message)

    def publish_parameters(self, stamp_ns: int, body: Body, inertia: NDArray[np.float64], estimates: Iterable[Estimate]) -> None:
        """Publish the parameters and the mass, CG and estimated inertia (3, 3) [kg m^2] of the body they belong to."""
        estimates = tuple(estimates)
        self._parameters.publish(conversions.parameters(stamp_ns, body.name, estimates))
        mass = next((e.value for e in estimates if e.name == f"{body.name}.mass" and np.isfinite(e.value)), body.mass.value)
        self._inertia.publish(conversions.inertia(stamp_ns, self._vehicle_frame, mass, body.cg, inertia))


def _forms(frames: Frames, mount_names: Sequence[str]) -> tuple[MessageForm, ...]:
    """Return the messages of a tick: CG acceleration, virtual accelerometer, load, forces, states and standard deviations."""
    joints = [f"{mount}_{axis}" for mount in mount_names for axis in AXES]
    count, cg = len(joints), frames.cg

    def force(mount: str) -> MessageForm:
        return MessageForm(lambda stamp, n: conversions.wrench(stamp, f"{frames.mount_prefix}{mount}", n), 3)

    return (
        MessageForm(lambda stamp, n: conversions.cg_acceleration(stamp, cg, n[:6], n[6:]), 6 + 36),
        MessageForm(lambda stamp, n: conversions.cg_imu(stamp, cg, n[:3], n[3:12], n[12:15], n[15:]), 3 + 9 + 3 + 9),
        MessageForm(lambda stamp, n: conversions.wrench(stamp, cg, n[:3], n[3:]), 6),
        *(force(mount) for mount in mount_names),
        MessageForm(lambda stamp, n: conversions.joint_state(stamp, cg, joints, *np.split(n, 3)), 3 * count),
        MessageForm(lambda stamp, n: conversions.joint_state(stamp, cg, joints, n[:count], n[:0], n[count:]), 2 * count),
    )


def finite(block: OutputBlock) -> NDArray[np.bool_]:
    """Return which ticks of a block hold only finite numbers, shape (K,)."""
    parts = (
        block.cg_accel, block.cg_specific_force, block.angular_rate, block.inertial_load,
        block.mount_force, block.mount_force_std, block.mount_deflection, block.mount_rate,
    )  # fmt: skip
    good = np.ones(len(block.stamp_ns), dtype=bool)
    for part in parts:
        good &= np.isfinite(part).all(axis=tuple(range(1, part.ndim)))
    shared = (block.cg_accel_covariance, block.angular_rate_std, block.cg_specific_force_covariance, block.mount_deflection_std)
    return good & all(bool(np.isfinite(part).all()) for part in shared)
