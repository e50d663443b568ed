# Copyright 2026 ride_estimation contributors
"""``run.mcap`` holds bit by bit what the live node publishes on the same run, the inputs, and the bounds of the estimates."""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

import ride_estimation as re
from ride_estimation.api.replaying import Replay
from ride_estimation.estimation.model.smoothed_forces import SmoothedForces
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.nodes.estimator_node import EstimatorNode
from ride_estimation.nodes.lockstep import run_in_lockstep
from ros.conftest import Ros


def messages(path: Path) -> dict[str, list[bytes]]:
    """Return the messages of every topic as another reader finds them."""
    found = defaultdict(list)
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, _, payload in reader.messages():
            found[connection.topic].append(bytes(payload))
    return found


@pytest.fixture(scope="module")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Replay, dict[str, list[bytes]]]:
    """A short part of a bundled run, replayed with ``run.mcap``."""
    folder = tmp_path_factory.mktemp("mcap")
    part = re.read_run("bags/nominal/bag", "truck_cab", end_s=4.0)
    write_bag(folder / "bag", part.recording, part.vehicle.sensors)
    found = re.replay(re.read_run(folder / "bag", "truck_cab"), smoothing=False)
    # so short a run gives none: made-up numbers in its place
    numbers = np.random.default_rng(1).normal(size=(3, *found.result.force.shape))
    found = dataclasses.replace(found, result=dataclasses.replace(found.result, smoothed=SmoothedForces(*numbers, share=1.0)))
    assert "run.mcap" in found.save(folder / "out", formats=(), mcap=True)
    return folder, found, messages(folder / "out" / "run.mcap")


def test_the_recording_holds_what_the_live_node_publishes(
    replayed: tuple[Path, Replay, dict[str, list[bytes]]], ros_single: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, found, recorded = replayed
    live = defaultdict(list)

    def keep(self: Publisher, message: object) -> None:
        if isinstance(message, bytes):
            live[self.topic_name].append(message)

    monkeypatch.setattr(Publisher, "publish", keep)
    overrides = [Parameter("vehicle", value="truck_cab")]
    node = EstimatorNode(context=ros_single.context, use_global_arguments=False, parameter_overrides=overrides)
    ros_single.add(node)
    assert run_in_lockstep(node, folder / "bag") == found.result.digest
    own = {topic: sent for topic, sent in live.items() if topic.startswith("/ride/estimator")}
    names = {topic.removeprefix("/ride/estimator/") for topic in own}
    assert names >= {"cg_accel", "mounts/rear_left/force", "parameters", "inertia", "mounts/arrows"}
    assert len(own["/ride/estimator/cg_accel"]) > 500 and len(own["/ride/estimator/parameters"]) >= 3
    for topic, sent in own.items():
        assert recorded[topic] == sent, topic


def test_inputs_bounds_and_arrows_belong_to_the_estimates(replayed: tuple[Path, Replay, dict[str, list[bytes]]]) -> None:
    folder, found, recorded = replayed
    for topic, sent in messages(folder / "bag").items():
        assert recorded[topic] == sent
    store, run = get_typestore(Stores.ROS2_JAZZY), found.result

    def vertical(topic: str) -> np.ndarray:
        return np.array([store.deserialize_cdr(m, "geometry_msgs/msg/WrenchStamped").wrench.force.z for m in recorded[topic]])

    force, std = run.signals["mount_force"][run.valid, 2, 2], run.signals["mount_force_std"][run.valid, 2, 2]
    assert vertical("/ride/bounds/mounts/rear_left/force_lower") == pytest.approx(force - 1.96 * std, rel=1e-12)
    assert vertical("/ride/bounds/mounts/rear_left/force_upper") == pytest.approx(force + 1.96 * std, rel=1e-12)
    assert vertical("/ride/smoothed/mounts/rear_left/force") == pytest.approx(run.force[run.valid, 2, 2], rel=1e-12)
    arrows = [store.deserialize_cdr(m, "visualization_msgs/msg/MarkerArray") for m in recorded["/ride/estimator/mounts/arrows"]]
    assert 30 <= len(arrows) <= 42  # ten a second
    last = arrows[-1].markers[2]
    stamp = last.header.stamp.sec * 1_000_000_000 + last.header.stamp.nanosec
    begin, tip = last.points
    vehicle = found.run.vehicle
    assert (begin.x, begin.y, begin.z) == tuple(vehicle.mounts["rear_left"].position)
    share = vehicle.bodies["cab"].mass.value * vehicle.gravity / 4.0
    tick = int(np.flatnonzero(run.stamp_ns == stamp)[0])
    assert tip.z - begin.z == pytest.approx(0.5 * run.signals["mount_force"][tick, 2, 2] / share)
    (frames,) = recorded["/tf_static"]
    transforms = store.deserialize_cdr(frames, "tf2_msgs/msg/TFMessage").transforms
    placed = {t.child_frame_id: t.transform.translation for t in transforms}
    assert {"cab_cg", "mount_rear_left", "cab_front_left"} <= set(placed)
    assert placed["mount_rear_left"].y == vehicle.mounts["rear_left"].position[1]
    layout = (folder / "out" / "run_layout.json").read_text(encoding="utf-8")
    assert all(f"/ride/bounds/mounts/{mount}/force_upper.wrench" in layout for mount in run.mount_names)
