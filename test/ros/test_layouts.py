# Copyright 2026 ride_estimation contributors
"""Every series of the PlotJuggler and Foxglove layouts is one the node publishes."""

from __future__ import annotations

import array
import json
import re
import xml.etree.ElementTree as element_tree
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from ride_estimation.io.run_layout import run_layout
from ride_estimation.nodes.estimator_node import EstimatorNode
from ros.conftest import Ros
from ros.drive import drive

CONFIG = Path(__file__).resolve().parents[2] / "config"


@pytest.fixture
def published(ros_single: Ros, monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """Return the last message the node published per topic during a short drive."""
    from rclpy.publisher import Publisher

    messages: dict[str, object] = {}
    original = Publisher.publish

    def keep(self: Publisher, message: object) -> None:
        messages[self.topic_name] = deserialize_message(message, self.msg_type) if isinstance(message, bytes) else message
        original(self, message)

    monkeypatch.setattr(Publisher, "publish", keep)
    node = EstimatorNode(context=ros_single.context, use_global_arguments=False)
    ros_single.add(node)
    assert node.session is not None
    for m in drive(node.session.vehicle, 1.0):
        node.receive(m.topic, m.type_name, m.payload)
    return messages


def plain_fields(message: object, prefix: str) -> set[str]:
    """Return the paths of the numbers of a message, parts joined by slashes."""
    found = set()
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        path = f"{prefix}/{name}"
        if isinstance(value, (int, float)):
            found.add(path)
        elif hasattr(value, "get_fields_and_field_types"):
            found |= plain_fields(value, path)
    return found


def plotjuggler_series(topic: str, message: object) -> set[str]:
    """Return the series PlotJuggler makes of a message (its ROS parser: joint states by name, diagnostics by key)."""
    if isinstance(message, JointState):
        parts = {"position": message.position, "velocity": message.velocity, "effort": message.effort}
        return {f"{topic}/{n}/{p}" for p, values in parts.items() if len(values) == len(message.name) for n in message.name}
    if isinstance(message, DiagnosticArray):
        return {
            f"{topic}/{s.hardware_id}/{s.name}/{pair.key}"
            for s in message.status
            for pair in s.values
            if re.fullmatch(r"[-+.\deE]+", pair.value)
        }
    return plain_fields(message, topic)


def test_plotjuggler_layout(published: dict[str, object]) -> None:
    root = element_tree.parse(CONFIG / "plotjuggler" / "ride.xml").getroot()
    curves = [curve.get("name") for curve in root.iter("curve")]
    available = set().union(*(plotjuggler_series(topic, message) for topic, message in published.items()))
    assert len(curves) > 30
    assert not set(curves) - available


def value_at(message: object, path: str) -> object:
    """Follow a Foxglove message path: fields joined by dots, numbers in brackets."""
    value = message
    for name, index in re.findall(r"\.([a-z_]+)|\[(\d+)\]", path):
        value = getattr(value, name) if name else value[int(index)]
    return value


def test_foxglove_layout(published: dict[str, object]) -> None:
    layout = json.loads((CONFIG / "foxglove" / "ride.json").read_text(encoding="utf-8"))
    panels = layout["configById"]
    paths = [p["value"] for panel in panels.values() for p in panel.get("paths", [])]
    assert len(paths) > 10
    for path in paths:
        topic, _, rest = path.partition(".")
        value = value_at(published[topic], f".{rest}")
        assert isinstance(value, (float, np.floating)), path
        assert not isinstance(value, (array.array, str))
    for panel in panels.values():
        if "topicToRender" in panel:
            assert panel["topicToRender"] in published


def test_a_layout_is_one_that_lichtblick_takes_and_shows_its_titles() -> None:
    """What Lichtblick asks of a layout (validateLayoutData), and the keys under which both viewers keep the title of a panel."""
    for layout in (json.loads((CONFIG / "foxglove" / "ride.json").read_text(encoding="utf-8")), run_layout(("front", "rear"))):
        assert all(isinstance(layout[key], dict) for key in ("configById", "globalVariables", "userNodes", "layout"))
        assert isinstance(layout["playbackConfig"]["speed"], (int, float))
        plots = [panel for name, panel in layout["configById"].items() if name.startswith("Plot!")]
        assert plots and all("[" in panel["lichtblickPanelTitle"] == panel["foxglovePanelTitle"] for panel in plots)
        assert {name.split("!")[0] for name in layout["configById"]} <= {"Plot", "3D", "DiagnosticSummary"}


def test_foxglove_joint_labels_belong_to_their_index(published: dict[str, object]) -> None:
    layout = json.loads((CONFIG / "foxglove" / "ride.json").read_text(encoding="utf-8"))
    states = published["/ride/estimator/mounts/states"]
    labelled = [p for panel in layout["configById"].values() for p in panel.get("paths", []) if "position[" in p["value"]]
    assert labelled
    for path in labelled:
        index = int(re.search(r"\[(\d+)\]", path["value"]).group(1))
        assert states.name[index] == path["label"]


def test_every_panel_of_the_foxglove_layout_is_placed() -> None:
    layout = json.loads((CONFIG / "foxglove" / "ride.json").read_text(encoding="utf-8"))

    def leaves(node: object) -> set[str]:
        return {node} if isinstance(node, str) else leaves(node["first"]) | leaves(node["second"])

    assert leaves(layout["layout"]) == set(layout["configById"])
