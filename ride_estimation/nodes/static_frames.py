# Copyright 2026 ride_estimation contributors
"""The fixed frames of a vehicle on ``/tf_static``: centre of gravity, mounts, sensors below the frame of the vehicle file."""

from __future__ import annotations

import importlib

from rclpy.node import Node
from rclpy.publisher import Publisher

from ride_estimation.nodes import qos


def publish_static_frames(node: Node, transforms: bytes) -> Publisher | None:
    """Publish transforms for whoever is there and whoever comes later; None where tf2_msgs is not installed.

    Parameters
    ----------
    node
        Whose publisher it is.
    transforms
        A serialized ``tf2_msgs/msg/TFMessage``.
    """
    try:
        messages = importlib.import_module("tf2_msgs.msg")
    except ImportError:  # an environment from pip has no tf2
        node.get_logger().info("no frames on /tf_static: tf2_msgs is not installed")
        return None
    publisher = node.create_publisher(messages.TFMessage, "/tf_static", qos.latched())
    publisher.publish(transforms)
    return publisher
