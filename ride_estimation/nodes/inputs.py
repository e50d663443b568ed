# Copyright 2026 ride_estimation contributors
"""Which topics a vehicle's sensors speak on, and which message types each accepts."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from geometry_msgs.msg import AccelStamped, TwistStamped, Vector3Stamped, WrenchStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState

from ride_estimation.io.messages import accepted_types, sensors_by_topic
from ride_estimation.sensors.sensor import Sensor

#: message classes by their ROS type name
MESSAGE_CLASSES: dict[str, type] = {
    "sensor_msgs/msg/Imu": Imu,
    "geometry_msgs/msg/AccelStamped": AccelStamped,
    "geometry_msgs/msg/Vector3Stamped": Vector3Stamped,
    "sensor_msgs/msg/JointState": JointState,
    "geometry_msgs/msg/TwistStamped": TwistStamped,
    "geometry_msgs/msg/WrenchStamped": WrenchStamped,
    "nav_msgs/msg/Odometry": Odometry,
}

#: type that is assumed until a publisher says otherwise, where it is not the first accepted one
_USUAL = {"force": "geometry_msgs/msg/WrenchStamped"}


@dataclasses.dataclass(frozen=True)
class InputTopic:
    """One topic the node listens to.

    Attributes
    ----------
    name
        Topic name.
    sensors
        The sensors it carries: one, or all displacement transducers of one JointState.
    accepted
        Message types in order of preference.
    """

    name: str
    sensors: tuple[Sensor, ...]
    accepted: tuple[str, ...]

    def choose(self, offered: tuple[str, ...], present: str = "") -> str:
        """Return the type to subscribe with; empty where none is accepted.

        Parameters
        ----------
        offered
            Types of the publishers there are.
        present
            Type of the subscription there is: kept while it is offered, or nothing is.
        """
        if not offered:
            return present or self.accepted[0]
        return next((name for name in (present, *self.accepted) if name in offered), "")


def input_topics(sensors: Mapping[str, Sensor]) -> dict[str, InputTopic]:
    """Return the topics of a vehicle's sensors by name, in file order."""
    topics = {}
    for name, group in sensors_by_topic(sensors.values()).items():
        accepted = accepted_types(group[0].kind)
        usual = _USUAL.get(group[0].kind, accepted[0])
        topics[name] = InputTopic(name, group, (usual, *(t for t in accepted if t != usual)))
    return topics
