# Copyright 2026 ride_estimation contributors
"""Which topics a vehicle's sensors speak on, and which message types each accepts."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from geometry_msgs.msg import AccelStamped, TwistStamped, Vector3Stamped, WrenchStamped
from sensor_msgs.msg import Imu, JointState

from ride_estimation.sensors.sensor import Sensor

#: message classes by their ROS type name
MESSAGE_CLASSES: dict[str, type] = {
    "sensor_msgs/msg/Imu": Imu,
    "geometry_msgs/msg/AccelStamped": AccelStamped,
    "geometry_msgs/msg/Vector3Stamped": Vector3Stamped,
    "sensor_msgs/msg/JointState": JointState,
    "geometry_msgs/msg/TwistStamped": TwistStamped,
    "geometry_msgs/msg/WrenchStamped": WrenchStamped,
}

#: kind of sensor -> accepted types, the first is assumed until a publisher says otherwise
ACCEPTED_TYPES: dict[str, tuple[str, ...]] = {
    "accelerometer": ("sensor_msgs/msg/Imu", "geometry_msgs/msg/AccelStamped", "geometry_msgs/msg/Vector3Stamped"),
    "imu": ("sensor_msgs/msg/Imu",),
    "displacement": ("sensor_msgs/msg/JointState",),
    "speed": ("geometry_msgs/msg/TwistStamped",),
    "force": ("geometry_msgs/msg/WrenchStamped",),
}


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

    def choose(self, offered: list[str]) -> str | None:
        """Return the type to subscribe with, given the types publishers offer; None where none is accepted."""
        if not offered:
            return self.accepted[0]
        return next((name for name in self.accepted if name in offered), None)


def input_topics(sensors: Mapping[str, Sensor]) -> dict[str, InputTopic]:
    """Group the sensors of a vehicle by topic, in file order."""
    groups: dict[str, list[Sensor]] = {}
    for sensor in sensors.values():
        groups.setdefault(sensor.topic, []).append(sensor)
    return {
        topic: InputTopic(topic, tuple(group), ACCEPTED_TYPES[group[0].kind]) for topic, group in groups.items()
    }
