# Copyright 2026 ride_estimation contributors
"""The node saves what it learned by itself and continues from it."""

from __future__ import annotations

from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.parameter import Parameter

from ride_estimation.io.state_file import load_state
from ride_estimation.nodes.estimator_node import EstimatorNode
from ros.conftest import Ros
from ros.drive import drive


def node_with(ros: Ros, **parameters: object) -> EstimatorNode:
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    node = EstimatorNode(context=ros.context, parameter_overrides=overrides, use_global_arguments=False)
    ros.add(node)
    return node


def test_the_state_is_saved_at_every_interval_and_when_the_node_leaves(ros_single: Ros, tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    node = node_with(ros_single, state_file=str(path), save_interval=1e-6)
    assert node.session is not None
    for message in drive(node.session.vehicle, 2.0):
        node.receive(message.topic, message.type_name, message.payload)
    node.watch()  # the first look starts the interval
    assert not path.exists()
    node.watch()
    early = load_state(path)["state"]
    for message in drive(node.session.vehicle, 4.0):
        node.receive(message.topic, message.type_name, message.payload)
    learned = {e.name: (e.value, e.std) for e in node.session.pipeline.parameters()}
    node.trigger_deactivate()
    assert load_state(path)["state"] != early
    again = node_with(ros_single, state_file=str(path))
    assert again.session is not None
    assert {e.name: (e.value, e.std) for e in again.session.pipeline.parameters()} == learned


def test_a_state_that_cannot_be_saved_is_a_warning_and_the_node_goes_on(ros_single: Ros, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    node = node_with(ros_single, state_file=str(tmp_path / "file" / "state.json"), save_interval=1e-6)
    node.watch()
    node.watch()
    said = {s.name: s for s in node._statuses()}
    assert said["saved state"].level == DiagnosticStatus.WARN
    assert "not saved" in said["saved state"].message


def test_an_interval_of_zero_never_saves(ros_single: Ros, tmp_path: Path) -> None:
    node = node_with(ros_single, state_file=str(tmp_path / "state.json"), save_interval=0.0)
    node.watch()
    node.watch()
    node.trigger_deactivate()
    assert not list(tmp_path.iterdir())
