# Copyright 2026 ride_estimation contributors
"""The player never plays to nobody without a word: it waits, says for whom, and says who does not listen."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu

from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.nodes import qos, replay_node
from ride_estimation.nodes.replay_node import ReplayNode
from ros.conftest import Ros
from ros.drive import drive
from ros.test_lockstep import TRUCK, write_bag

#: messages of the run
COUNT = 80


class Player:
    """A player whose steady clock is set by hand."""

    def __init__(self, ros: Ros, run: Path, clock: list[float], **parameters: object) -> None:
        overrides = [Parameter(name, value=value) for name, value in {"bag": str(run), **parameters}.items()]
        self.ros, self.clock = ros, clock
        self.node = ReplayNode(context=ros.context, parameter_overrides=overrides, use_global_arguments=False)
        ros.nodes.append(self.node)

    def go(self, seconds: float) -> None:
        for _ in range(round(seconds * 10.0)):
            self.clock[0] += 0.1
            self.node.step()

    def listener(self, name: str, topics: list[str]) -> None:
        """Subscribe, and wait until the player knows."""
        node = Node(name, namespace="/truck", context=self.ros.context, use_global_arguments=False)
        self.ros.nodes.append(node)
        for topic in topics:
            node.create_subscription(Imu, topic, lambda _: None, qos.output(100))
        self.ros.until(lambda: all(self.node._topics[topic].get_subscription_count() for topic in topics))
        self.ros.until(lambda: all(self.node.get_subscriptions_info_by_topic(topic) for topic in topics))


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [1000.0]
    monkeypatch.setattr(replay_node, "time", SimpleNamespace(monotonic=lambda: now[0]))
    return now


@pytest.fixture
def run(tmp_path: Path) -> Path:
    messages = drive(load_vehicle(TRUCK), 0.1)
    return write_bag(tmp_path / "run", [(m.topic, m.type_name, m.stamp_ns, m.payload) for m in messages])


def test_a_wait_of_zero_is_for_ever_and_says_so(
    ros_single: Ros, run: Path, clock: list[float], capfd: pytest.CaptureFixture[str]
) -> None:
    player = Player(ros_single, run, clock, wait_for_subscribers=0.0)
    player.go(3600.0 * 0.1)
    assert (player.node.played, player.node.finished) == (0, False)
    lines = [line for line in capfd.readouterr().err.splitlines() if "waiting for anybody to subscribe to 8 of 8 topics" in line]
    assert 30 <= len(lines) <= 40  # one in ten seconds
    player.listener("all", list(player.node._topics))
    player.go(5.0)
    assert (player.node.played, player.node.finished) == (COUNT, True)
    assert "playing anyway" not in capfd.readouterr().err


def test_a_wait_that_ends_plays_and_names_what_nobody_hears(
    ros_single: Ros, run: Path, clock: list[float], capfd: pytest.CaptureFixture[str]
) -> None:
    player = Player(ros_single, run, clock, wait_for_subscribers=5.0)
    player.go(4.5)
    assert player.node.played == 0
    player.go(2.0)
    assert player.node.played == COUNT
    assert "nobody listens to /cab/front_left/accel, " in capfd.readouterr().err


def test_topics_that_nobody_wants_hold_nothing_up_and_are_named(
    ros_single: Ros, run: Path, clock: list[float], capfd: pytest.CaptureFixture[str]
) -> None:
    player = Player(ros_single, run, clock, wait_for_subscribers=0.0)
    topics = list(player.node._topics)
    player.listener("most", topics[1:])
    player.go(10.0)
    assert player.node.played == COUNT
    assert f"nobody listens to {topics[0]}; playing anyway" in capfd.readouterr().err


def test_only_the_node_that_is_waited_for_counts(ros_single: Ros, run: Path, clock: list[float]) -> None:
    player = Player(ros_single, run, clock, wait_for_subscribers=0.0, wait_for_node="/truck/estimator")
    topics = list(player.node._topics)
    player.listener("recorder", topics)
    player.go(60.0)
    assert player.node.played == 0
    player.listener("estimator", topics)
    ros_single.until(lambda: len(player.node.get_subscriptions_info_by_topic(topics[-1])) == 2)
    player.go(5.0)
    assert player.node.played == COUNT


def test_no_run_given_is_said_as_such(ros_single: Ros, capfd: pytest.CaptureFixture[str]) -> None:
    node = ReplayNode(context=ros_single.context, use_global_arguments=False)
    ros_single.nodes.append(node)
    assert (node.finished, node.exit_code) == (True, 2)
    assert "bag: not given" in capfd.readouterr().err


def test_the_player_does_not_wait_for_what_it_does_not_need() -> None:
    code = "import sys, ride_estimation.nodes.replay_node; print({'scipy.signal', 'scipy.stats'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
