# Copyright 2026 ride_estimation contributors
"""Quality of service of every topic, in one place (docs: interface of the node)."""

from __future__ import annotations

from rclpy.exceptions import ParameterException
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions

#: what a publisher or subscription raises that the middleware or an override does not allow (RCLError is a RuntimeError)
REFUSED = (RuntimeError, ParameterException, InvalidQosOverridesError)


def overridable() -> QoSOverridingOptions:
    """Return which policies of a topic may be set by parameters ``qos_overrides.<topic>.<publisher|subscription>.<policy>``."""
    kinds = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY)
    return QoSOverridingOptions(policy_kinds=kinds)


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


def latched() -> QoSProfile:
    """Return the profile of what changes slowly: whoever subscribes later gets the last message too."""
    return QoSProfile(
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        history=HistoryPolicy.KEEP_LAST,
        depth=1,
    )
