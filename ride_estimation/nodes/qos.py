# Copyright 2026 ride_estimation contributors
"""Quality of service of every topic, in one place (docs: interface of the node)."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy


def sensor_input(depth: int) -> QoSProfile:
    """Return the profile of inputs: best effort matches every publisher; the depth outlasts a stall.

    Parameters
    ----------
    depth
        Messages kept per topic; rate times the longest stall to survive (500 Hz x 0.4 s = 200).
    """
    return QoSProfile(
        reliability=ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.VOLATILE,
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
    )


def output(depth: int = 50) -> QoSProfile:
    """Return the profile of outputs: reliable, so that every subscriber matches."""
    return QoSProfile(
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
    )
