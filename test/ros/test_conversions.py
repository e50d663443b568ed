# Copyright 2026 ride_estimation contributors
"""Outgoing messages: every field survives the wire, with the types rclpy does not check by itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import AccelWithCovarianceStamped, InertiaStamped, WrenchStamped
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu, JointState

from ride_estimation.estimation.common.estimate import Estimate, Status
from ride_estimation.io import estimate_messages
from ride_estimation.io.message_form import serialized
from ride_estimation.nodes import conversions

STAMP = 1_700_000_000_123_456_789


CLASSES = (AccelWithCovarianceStamped, DiagnosticArray, Imu, InertiaStamped, JointState, WrenchStamped)


def over_the_wire(message: object) -> object:
    """Return what the middleware reads from the bytes that are published."""
    kind = next(c for c in CLASSES if c.__name__ == message.__msgtype__.rpartition("/")[2])
    return deserialize_message(serialized(message), kind)


def numbers(count: int, kind: type) -> np.ndarray:
    """Return distinct numbers of a type that rclpy's converter would turn into garbage unchecked."""
    return np.arange(1, count + 1).astype(kind)


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int64])
def test_vectors_of_any_number_type_arrive_as_they_are(kind: type) -> None:
    message = over_the_wire(estimate_messages.wrench(STAMP, "mount_a", numbers(3, kind), numbers(3, kind)))
    assert isinstance(message, WrenchStamped)
    force, torque = message.wrench.force, message.wrench.torque
    assert (force.x, force.y, force.z, torque.x, torque.y, torque.z) == (1.0, 2.0, 3.0, 1.0, 2.0, 3.0)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1_700_000_000, 123_456_789)
    assert message.header.frame_id == "mount_a"


def test_stamp_before_the_epoch_keeps_its_nanoseconds_positive() -> None:
    stamp = conversions.time_message(-1)
    assert (stamp.sec, stamp.nanosec) == (-1, 999_999_999)


def test_cg_acceleration_is_row_major() -> None:
    covariance = np.arange(36.0).reshape(6, 6)
    message = over_the_wire(estimate_messages.cg_acceleration(STAMP, "cab_cg", np.arange(6.0), covariance))
    assert isinstance(message, AccelWithCovarianceStamped)
    assert message.accel.accel.linear.y == 1.0
    assert message.accel.accel.angular.z == 5.0
    assert np.array_equal(np.asarray(message.accel.covariance).reshape(6, 6), covariance)


def test_covariance_that_is_not_contiguous_is_not_scrambled() -> None:
    covariance = np.asfortranarray(np.arange(36.0).reshape(6, 6))
    message = over_the_wire(estimate_messages.cg_acceleration(STAMP, "", np.zeros(6), covariance))
    assert np.array_equal(np.asarray(message.accel.covariance), np.arange(36.0))


@pytest.mark.parametrize(("std", "first"), [([0.0, 0.0, 0.0], -1.0), ([0.1, 0.2, 0.0], 0.1**2)])
def test_virtual_accelerometer_marks_what_it_does_not_provide(std: list[float], first: float) -> None:
    rate, spread = np.array([0.1, 0.2, 0.3]), estimate_messages.rate_covariance(np.array(std))
    message = over_the_wire(estimate_messages.cg_imu(STAMP, "cab_cg", np.array([0.0, 0.0, 9.81]), np.eye(3) * 4e-4, rate, spread))
    assert isinstance(message, Imu)
    assert message.orientation_covariance[0] == -1.0
    assert message.angular_velocity_covariance[0] == pytest.approx(first)
    assert message.angular_velocity_covariance[4] == pytest.approx(std[1] ** 2)
    assert message.angular_velocity.z == 0.3
    assert message.linear_acceleration.z == 9.81
    assert message.linear_acceleration_covariance[8] == 4e-4


def test_joint_state_keeps_names_with_their_numbers() -> None:
    names = ["a_x", "a_y", "a_z"]
    position, effort = numbers(3, np.float32), numbers(3, np.int64)
    message = over_the_wire(estimate_messages.joint_state(STAMP, "cab_cg", names, position, np.zeros(0), effort))
    assert isinstance(message, JointState)
    assert list(message.name) == names
    assert list(message.position) == [1.0, 2.0, 3.0]
    assert list(message.velocity) == []
    assert list(message.effort) == [1.0, 2.0, 3.0]


def test_inertia_entries_are_in_their_places() -> None:
    tensor = np.array([[11.0, 12.0, 13.0], [12.0, 22.0, 23.0], [13.0, 23.0, 33.0]])
    message = over_the_wire(estimate_messages.inertia(STAMP, "cab_link", np.float32(1200), np.array([1, 2, 3]), tensor))
    assert isinstance(message, InertiaStamped)
    body = message.inertia
    assert (body.m, body.com.z) == (1200.0, 3.0)
    assert (body.ixx, body.ixy, body.ixz, body.iyy, body.iyz, body.izz) == (11.0, 12.0, 13.0, 22.0, 23.0, 33.0)


def estimate(**changes: object) -> Estimate:
    fields = {
        "name": "front_left.z.stiffness", "value": 52000.0, "std": 260.0, "unit": "N/m", "prior": 50000.0,
        "status": Status.VALID, "reason": "", "stamp_ns": STAMP,
    }  # fmt: skip
    return Estimate(**{**fields, **changes})


def test_parameter_has_one_number_per_value() -> None:
    message = over_the_wire(estimate_messages.parameters(STAMP, "cab", [estimate()]))
    assert isinstance(message, DiagnosticArray)
    (status,) = message.status
    pairs = {pair.key: pair.value for pair in status.values}
    assert (status.name, status.hardware_id, status.level) == ("front_left.z.stiffness", "cab", DiagnosticStatus.OK)
    assert pairs == {"value": "52000", "std": "260", "prior": "50000", "unit": "N/m", "status": "valid"}


@pytest.mark.parametrize(
    ("status", "level"),
    [
        (Status.NOT_IDENTIFIABLE, DiagnosticStatus.WARN),
        (Status.SUSPECT, DiagnosticStatus.WARN),
        (Status.INVALID, DiagnosticStatus.ERROR),
    ],
)
def test_status_without_a_sure_number_is_visible(status: Status, level: bytes) -> None:
    message = over_the_wire(estimate_messages.parameters(STAMP, "cab", [estimate(status=status, reason="needs a weighed cab")]))
    assert message.status[0].level == level
    assert message.status[0].message == "needs a weighed cab"


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_number_that_is_none_is_left_out(bad: float) -> None:
    message = estimate_messages.parameters(STAMP, "cab", [estimate(value=bad, std=bad, status=Status.INVALID)])
    keys = {pair.key for pair in message.status[0].values}
    assert keys == {"prior", "unit", "status"}


def test_every_status_has_a_level() -> None:
    assert set(estimate_messages.LEVELS) == set(Status)
