# Copyright 2026 ride_estimation contributors
"""Messages written in serialized form are those of the serializer, and the middleware reads them."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import AccelWithCovarianceStamped, WrenchStamped
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu, JointState

from ride_estimation.estimation.output import OutputBlock
from ride_estimation.io import estimate_messages
from ride_estimation.io.estimate_messages import Frames
from ride_estimation.io.message_form import MessageForm, serialized
from ride_estimation.nodes import qos
from ride_estimation.nodes.publishers import EstimatePublishers

STAMPS = np.array([-1, 0, 1_700_000_000_123_456_789, 2**31 * 1_000_000_000 - 1], dtype=np.int64)
MOUNTS = ("a", "bcd")
FRAMES = Frames("cab_cg", "cab_link", "mount_")


@pytest.mark.parametrize("frame", ["", "c", "cab_cg", "a frame of 23 characters"])
def test_filled_form_is_what_rclpy_serializes(frame: str) -> None:
    def make(stamp: int, n: np.ndarray) -> object:
        return estimate_messages.joint_state(stamp, frame, ["one", "three"], n[:2], n[:0], n[2:])

    numbers = np.random.default_rng(1).normal(size=(len(STAMPS), 4)) * 10.0 ** np.arange(-300, 300, 150)
    filled = MessageForm(make, 4).fill(STAMPS, numbers)
    assert filled == [serialized(make(int(s), row)) for s, row in zip(STAMPS, numbers, strict=True)]
    assert all(deserialize_message(m, JointState).header.frame_id == frame for m in filled)


def test_message_without_numbers() -> None:
    def make(stamp: int, n: np.ndarray) -> object:
        return estimate_messages.joint_state(stamp, "cab_cg", [], n, n, n)

    filled = MessageForm(make, 0).fill(STAMPS[:2], np.zeros((2, 0)))
    assert filled == [serialized(make(int(s), np.zeros(0))) for s in STAMPS[:2]]


def block(ticks: int) -> OutputBlock:
    """Return a block in which every number differs; as many ticks as a covariance has rows must not be taken for one."""
    rng = np.random.default_rng(2)
    shapes: dict[str, tuple[int, ...]] = {
        "cg_accel": (ticks, 6), "cg_accel_covariance": (6, 6), "cg_specific_force": (ticks, 6),
        "cg_specific_force_covariance": (6, 6), "angular_rate": (ticks, 3), "angular_rate_std": (3,), "inertial_load": (ticks, 6),
        "mount_force": (ticks, 2, 3), "mount_force_std": (ticks, 2, 3), "mount_deflection": (ticks, 2, 3),
        "mount_rate": (ticks, 2, 3), "mount_deflection_std": (2, 3),
    }  # fmt: skip
    values: dict[str, Any] = {f.name: None for f in dataclasses.fields(OutputBlock)}
    values |= {name: rng.normal(size=shape) for name, shape in shapes.items()}
    return OutputBlock(**{**values, "stamp_ns": 10**18 + 2_000_000 * np.arange(ticks)})


def published(of: OutputBlock, ticks: list[int]) -> list[tuple[str, Any]]:
    """Return topic and message in order of publication."""
    found: list[tuple[str, Any]] = []

    def create(kind: type, topic: str, profile: QoSProfile, options: object) -> Any:
        return SimpleNamespace(publish=lambda payload: found.append((topic, deserialize_message(payload, kind))))

    EstimatePublishers(create, MOUNTS, FRAMES, qos.output()).publish_ticks(of, ticks)
    return found


def three(vector: Any) -> list[float]:
    return [vector.x, vector.y, vector.z]


def test_no_tick_is_no_message() -> None:
    assert published(block(3), []) == []


@pytest.mark.parametrize("ticks", [[0], [1, 4], [0, 1, 2, 3, 4, 5]])
def test_every_number_of_a_tick_is_in_its_place(ticks: list[int]) -> None:
    of = block(6)
    messages = published(of, ticks)
    topics = ["~/cg_accel", "~/cg_imu", "~/inertial_load", *(f"~/mounts/{m}/force" for m in MOUNTS), "~/mounts/states"]
    topics.append("~/mounts/stddev")
    assert [topic for topic, _ in messages] == topics * len(ticks)
    names = ["a_x", "a_y", "a_z", "bcd_x", "bcd_y", "bcd_z"]
    for k, tick in enumerate(ticks):
        accel, imu, load, *forces, states, stddev = (m for _, m in messages[k * len(topics) : (k + 1) * len(topics)])
        for message in (accel, imu, load, *forces, states, stddev):
            stamp = message.header.stamp
            assert stamp.sec * 1_000_000_000 + stamp.nanosec == of.stamp_ns[tick]
        assert isinstance(accel, AccelWithCovarianceStamped)
        assert three(accel.accel.accel.linear) + three(accel.accel.accel.angular) == of.cg_accel[tick].tolist()
        assert list(accel.accel.covariance) == of.cg_accel_covariance.ravel().tolist()
        assert isinstance(imu, Imu)
        assert three(imu.linear_acceleration) == of.cg_specific_force[tick, :3].tolist()
        assert three(imu.angular_velocity) == of.angular_rate[tick].tolist()
        assert list(imu.linear_acceleration_covariance) == of.cg_specific_force_covariance[:3, :3].ravel().tolist()
        assert list(imu.angular_velocity_covariance) == np.diag(of.angular_rate_std**2).ravel().tolist()
        assert imu.orientation_covariance[0] == -1.0
        assert three(load.wrench.force) + three(load.wrench.torque) == of.inertial_load[tick].tolist()
        for number, force in enumerate(forces):
            assert isinstance(force, WrenchStamped)
            assert force.header.frame_id == f"mount_{MOUNTS[number]}"
            assert three(force.wrench.force) == of.mount_force[tick, number].tolist()
            assert three(force.wrench.torque) == [0.0, 0.0, 0.0]
        assert isinstance(states, JointState)
        assert [list(states.name), list(stddev.name)] == [names, names]
        assert list(states.position) == of.mount_deflection[tick].ravel().tolist()
        assert list(states.velocity) == of.mount_rate[tick].ravel().tolist()
        assert list(states.effort) == of.mount_force[tick].ravel().tolist()
        assert list(stddev.position) == of.mount_deflection_std.ravel().tolist()
        assert list(stddev.velocity) == []
        assert list(stddev.effort) == of.mount_force_std[tick].ravel().tolist()
