# Copyright 2026 ride_estimation contributors
"""The output topics of the estimator node: one block of estimates in, messages out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelWithCovarianceStamped, InertiaStamped, WrenchStamped
from numpy.typing import NDArray
from rclpy.lifecycle import LifecyclePublisher
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Imu, JointState
from visualization_msgs.msg import MarkerArray

from ride_estimation.estimation.common.estimate import Estimate
from ride_estimation.estimation.output import Ticks
from ride_estimation.io.estimate_messages import INERTIA_TOPIC, PARAMETERS_TOPIC, EstimateMessages, Frames
from ride_estimation.io.force_arrows import ARROWS_TOPIC, ForceArrows
from ride_estimation.nodes import qos
from ride_estimation.vehicles.vehicle import Body

#: creates a lifecycle publisher: (message class, topic, QoS, overriding options)
CreatePublisher = Callable[[type, str, QoSProfile, QoSOverridingOptions], LifecyclePublisher]

_CLASSES: dict[str, type] = {
    "geometry_msgs/msg/AccelWithCovarianceStamped": AccelWithCovarianceStamped,
    "geometry_msgs/msg/WrenchStamped": WrenchStamped,
    "sensor_msgs/msg/Imu": Imu,
    "sensor_msgs/msg/JointState": JointState,
}


class EstimatePublishers:
    """All output topics; the messages are those of :mod:`ride_estimation.io.estimate_messages`, published in serialized form.

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
    arrows
        Of the mount forces, for 3D viewers; None for no such topic.
    """

    def __init__(
        self, create: CreatePublisher, mount_names: Sequence[str], frames: Frames, profile: QoSProfile,
        arrows: ForceArrows | None = None,
    ) -> None:  # fmt: skip
        def topic(message: type, name: str, profile: QoSProfile = profile) -> LifecyclePublisher:
            return create(message, f"~/{name}", profile, qos.overridable())

        self._messages = EstimateMessages(mount_names, frames)
        self._at_ticks = tuple(topic(_CLASSES[kind], name) for name, kind in self._messages.topics.items())
        self._inertia = topic(InertiaStamped, INERTIA_TOPIC, qos.latched())
        self._parameters = topic(DiagnosticArray, PARAMETERS_TOPIC, qos.latched())
        self._arrows = arrows
        shown = () if arrows is None else (topic(MarkerArray, ARROWS_TOPIC),)
        self._shown: LifecyclePublisher | None = shown[0] if shown else None
        self.all: tuple[LifecyclePublisher, ...] = (*self._at_ticks, self._inertia, self._parameters, *shown)

    def publish_ticks(self, block: Ticks, ticks: Sequence[int]) -> None:
        """Publish the estimates of some ticks of a block, one tick after the other, and now and then the arrows of the last."""
        for of_tick in zip(*self._messages.ticks(block, ticks), strict=True):
            for publisher, message in zip(self._at_ticks, of_tick, strict=True):
                publisher.publish(message)
        if self._arrows is not None and self._shown is not None:
            drawn = self._arrows.message(block, ticks)
            if drawn is not None:
                self._shown.publish(drawn)

    def publish_parameters(self, stamp_ns: int, body: Body, inertia: NDArray[Any], estimates: Iterable[Estimate]) -> None:
        """Publish the parameters and the mass, CG and estimated inertia (3, 3) [kg m^2] of the body they belong to."""
        estimates = tuple(estimates)
        self._parameters.publish(self._messages.parameters(stamp_ns, body, estimates))
        self._inertia.publish(self._messages.inertia(stamp_ns, body, inertia, estimates))
