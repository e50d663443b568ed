# Copyright 2026 ride_estimation contributors
"""The node saves what it learned by itself and continues from it."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

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
    node._saver.wait()
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
    node._saver.wait()
    said = {s.name: s for s in node._statuses()}
    assert said["saved state"].level == DiagnosticStatus.WARN
    assert "not saved" in said["saved state"].message


def test_a_managed_shutdown_saves_what_was_learned(ros_single: Ros, tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    node = node_with(ros_single, state_file=str(path))
    assert node.session is not None
    for message in drive(node.session.vehicle, 2.0):
        node.receive(message.topic, message.type_name, message.payload)
    run_time = node.session.pipeline.save_state()["run_time"]
    node.trigger_shutdown()
    assert load_state(path)["state"]["run_time"] == run_time > 0.0


def test_messages_go_on_while_a_slow_disk_writes_and_the_end_waits_for_the_whole_state(
    ros_single: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, disk = tmp_path / "state.json", threading.Event()
    node = node_with(ros_single, state_file=str(path), save_interval=1e-6)
    assert node.session is not None
    sync = os.fsync
    monkeypatch.setattr(os, "fsync", lambda handle: (disk.wait(30.0), sync(handle)))
    node.watch()
    node.watch()
    for message in drive(node.session.vehicle, 1.0):
        node.receive(message.topic, message.type_name, message.payload)
    assert node._saver.writing
    node.watch()
    assert "still being written" in {s.name: s for s in node._statuses()}["saved state"].message
    disk.set()
    learned = node.session.pipeline.save_state()["run_time"]
    node.trigger_deactivate()
    assert load_state(path)["state"]["run_time"] == learned > 0.0
    assert "saved state" not in {s.name for s in node._statuses()}


def test_a_state_that_is_no_number_is_said_and_the_old_one_stays(ros_single: Ros, tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    node = node_with(ros_single, state_file=str(path), save_directory=str(tmp_path / "results"))
    assert node.session is not None
    node.trigger_deactivate()
    old = path.read_bytes()
    node.session.pipeline._run_time = float("inf")
    node.trigger_activate()
    node.trigger_deactivate()
    assert "not one that can be saved" in {s.name: s for s in node._statuses()}["saved state"].message
    assert path.read_bytes() == old
    answer = node._serve_save(Trigger.Request(), Trigger.Response())
    assert not answer.success
    assert "not one that can be saved" in answer.message


def test_an_interval_of_zero_never_saves(ros_single: Ros, tmp_path: Path) -> None:
    node = node_with(ros_single, state_file=str(tmp_path / "state.json"), save_interval=0.0)
    node.watch()
    node.watch()
    node.trigger_deactivate()
    assert not list(tmp_path.iterdir())
