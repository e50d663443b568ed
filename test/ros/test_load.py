# Copyright 2026 ride_estimation contributors
"""The node that falls behind leaves messages out, counts them and says so; faults are kept in bounded number."""

from __future__ import annotations

import math

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu

from ride_estimation.estimation.numerical_guard import MOST_FAULTS, OTHER_FAULTS
from ride_estimation.nodes import backpressure
from ride_estimation.nodes.backpressure import DROP_S
from ride_estimation.nodes.estimator_node import EstimatorNode
from ros.conftest import Ros
from ros.drive import drive


@pytest.fixture
def node(ros_single: Ros) -> EstimatorNode:
    made = EstimatorNode(context=ros_single.context, use_global_arguments=False)
    ros_single.add(made)
    return made


def status(node: EstimatorNode) -> DiagnosticStatus:
    return next(s for s in node._statuses() if s.name == "load")


def test_messages_far_behind_are_left_out_and_counted(node: EstimatorNode, monkeypatch: pytest.MonkeyPatch) -> None:
    assert node.session is not None
    assert (status(node).level, status(node).message) == (DiagnosticStatus.OK, "keeps up")
    clock = [0.0]
    monkeypatch.setattr(node._intake, "_clock", lambda: clock[0])
    sent = 0
    node._follow_topics()
    for message in drive(node.session.vehicle, 4.0):
        clock[0] += 0.5 / 100.0  # 8 messages at 100 Hz take four times as long as they may
        node._arrived(message.topic, node.session.states[message.topic], message.payload)
        node._load.handled(clock[0] - 0.5 / 100.0, clock[0])
        sent += 1
    received = sum(s.received for s in node.session.states.values())
    left_out = node._load.left_out.total()
    assert received + left_out == sent
    assert left_out > 0
    found = status(node)
    assert found.level == DiagnosticStatus.ERROR
    assert "cannot keep up" in found.message
    assert float(next(v.value for v in found.values if v.key == "largest behind_s")) > DROP_S


def test_a_node_that_is_behind_takes_its_inputs_from_the_executor_and_gives_them_back(
    node: EstimatorNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An executor that keeps an entry per message must not be told of messages that nobody can use in time."""
    assert node.session is not None
    clock = [0.0]
    monkeypatch.setattr(node._intake, "_clock", lambda: clock[0])
    monkeypatch.setattr(node._intake, "_looked", 0.0)
    monkeypatch.setattr(node._intake, "_caught_up", -1.0)  # nothing was found waiting, but long ago
    served = set(node.subscriptions)
    inputs = {s for s in served if s.topic_name in node.session.topics}
    assert len(inputs) == 8
    message = next(iter(drive(node.session.vehicle, 0.1)))
    clock[0] = 0.019
    node._intake._put(message.topic, node._intake._sources[message.topic], message.payload)
    monkeypatch.setattr(node._intake, "_hand_on", lambda *_: clock.__setitem__(0, clock[0] + 0.2) or True)
    node.look()
    assert node._intake.behind
    assert set(node.subscriptions) == served - inputs
    node.look()
    assert not node._intake.behind
    assert set(node.subscriptions) == served


def test_messages_that_the_middleware_overwrote_are_counted_and_said_to_be_no_fault_of_the_sensors(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The node does not run for three seconds of messages; its queues hold two. However slow the machine is."""
    overrides = [Parameter("input_depth", value=200)]
    node = EstimatorNode(context=ros.context, parameter_overrides=overrides, use_global_arguments=False)
    ros.add(node)
    assert node.session is not None
    monkeypatch.setattr(backpressure, "DROP_S", math.inf)
    sender = Node("sender", context=ros.context, use_global_arguments=False)
    ros.add(sender)
    profile = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
    publishers = {name: sender.create_publisher(Imu, name, profile) for name in node.session.topics}
    ros.until(lambda: all(p.get_subscription_count() for p in publishers.values()))
    messages = list(drive(node.session.vehicle, 3.2))
    states = node.session.states.values()

    def taken() -> int:
        return sum(s.received for s in states) + node._load.lost.total() + node._load.left_out.total()

    for before, after in ((0, 160), (160, len(messages))):
        for message in messages[before:after]:
            publishers[message.topic].publish(message.payload)
        ros.until(lambda after=after: taken() == after)
    assert node._load.lost.total() == 8 * 100
    assert node._load.left_out.total() == 0
    found = status(node)
    assert found.level == DiagnosticStatus.ERROR
    assert "by no fault of the sensors" in found.message
    told = {s.name: s for s in node._statuses()}
    assert "100 messages were lost before they came to this node" in told["topic /cab/front_left/accel"].message


def test_different_faults_are_kept_in_bounded_number(node: EstimatorNode, monkeypatch: pytest.MonkeyPatch) -> None:
    assert node.session is not None
    number = [0]

    def fail(*_: object) -> None:
        number[0] += 1
        raise ValueError(f"number {number[0]}")

    monkeypatch.setattr(node.session.pipeline, "observe", fail)
    for message in drive(node.session.vehicle, 1.0):
        node.receive(message.topic, message.type_name, message.payload)
    faults = node.session.pipeline.health().faults
    assert len(faults) == MOST_FAULTS + 1
    assert sum(faults.values()) == number[0] == 800
    assert faults[OTHER_FAULTS] == 800 - MOST_FAULTS
