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

from ride_estimation.estimation.estimate import Estimate
from ride_estimation.estimation.output import OutputBlock
from ride_estimation.nodes import conversions
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
    qos
        Profile of every topic.
    """

    def __init__(self, create: CreatePublisher, mount_names: Sequence[str], frames: Frames, qos: QoSProfile) -> None:
        def topic(message: type, name: str) -> LifecyclePublisher:
            return create(message, name, qos, QoSOverridingOptions.with_default_policies())

        self._cg_frame = frames.cg
        self._vehicle_frame = frames.vehicle
        self._mount_frames = [f"{frames.mount_prefix}{mount}" for mount in mount_names]
        self._joints = [f"{mount}_{axis}" for mount in mount_names for axis in AXES]
        self._cg_accel = topic(AccelWithCovarianceStamped, "~/cg_accel")
        self._cg_imu = topic(Imu, "~/cg_imu")
        self._load = topic(WrenchStamped, "~/inertial_load")
        self._forces = [topic(WrenchStamped, f"~/mounts/{mount}/force") for mount in mount_names]
        self._states = topic(JointState, "~/mounts/states")
        self._stddev = topic(JointState, "~/mounts/stddev")
        self._inertia = topic(InertiaStamped, "~/inertia")
        self._parameters = topic(DiagnosticArray, "~/parameters")
        self.all: tuple[LifecyclePublisher, ...] = (
            self._cg_accel, self._cg_imu, self._load, *self._forces, self._states, self._stddev, self._inertia, self._parameters,
        )  # fmt: skip

    def publish_tick(self, block: OutputBlock, tick: int) -> None:
        """Publish the estimates of one tick of a block."""
        stamp = int(block.stamp_ns[tick])
        frame = self._cg_frame
        force = block.mount_force[tick]
        self._cg_accel.publish(conversions.cg_acceleration(stamp, frame, block.cg_accel[tick], block.cg_accel_covariance))
        specific_force, spread = block.cg_specific_force[tick, :3], block.cg_specific_force_covariance[:3, :3]
        self._cg_imu.publish(conversions.cg_imu(stamp, frame, specific_force, spread, block.angular_rate[tick]))
        load = block.inertial_load[tick]
        self._load.publish(conversions.wrench(stamp, frame, load[:3], load[3:]))
        for publisher, mount_frame, mount_force in zip(self._forces, self._mount_frames, force, strict=True):
            publisher.publish(conversions.wrench(stamp, mount_frame, mount_force))
        deflection, rate = block.mount_deflection[tick], block.mount_rate[tick]
        self._states.publish(conversions.joint_state(stamp, frame, self._joints, deflection.ravel(), rate.ravel(), force.ravel()))
        deflection_std, force_std = block.mount_deflection_std, block.mount_force_std[tick]
        no_rate = np.zeros(0)
        self._stddev.publish(
            conversions.joint_state(stamp, frame, self._joints, deflection_std.ravel(), no_rate, force_std.ravel())
        )

    def publish_parameters(self, stamp_ns: int, body: Body, inertia: NDArray[np.float64], estimates: Iterable[Estimate]) -> None:
        """Publish the parameters and the mass, CG and estimated inertia (3, 3) [kg m^2] of the body they belong to."""
        estimates = tuple(estimates)
        self._parameters.publish(conversions.parameters(stamp_ns, body.name, estimates))
        mass = next((e.value for e in estimates if e.name == f"{body.name}.mass" and np.isfinite(e.value)), body.mass.value)
        self._inertia.publish(conversions.inertia(stamp_ns, self._vehicle_frame, mass, body.cg, inertia))


def finite(block: OutputBlock) -> NDArray[np.bool_]:
    """Return which ticks of a block hold only finite numbers, shape (K,)."""
    parts = (
        block.cg_accel, block.cg_specific_force, block.angular_rate, block.inertial_load,
        block.mount_force, block.mount_force_std, block.mount_deflection, block.mount_rate,
    )  # fmt: skip
    good = np.ones(len(block.stamp_ns), dtype=bool)
    for part in parts:
        good &= np.isfinite(part).all(axis=tuple(range(1, part.ndim)))
    shared = (block.cg_accel_covariance, block.cg_specific_force_covariance, block.mount_deflection_std)
    return good & all(bool(np.isfinite(part).all()) for part in shared)
