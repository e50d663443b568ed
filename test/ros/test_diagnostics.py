# Copyright 2026 ride_estimation contributors
"""/diagnostics and the log: names that tell nodes apart, stamps of one clock, one line per change of level."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu
from std_srvs.srv import Trigger

from ride_estimation.errors import ConfigurationError
from ride_estimation.estimation.numerical_guard import NUMERICAL_FAULT
from ride_estimation.nodes import conversions, qos
from ride_estimation.nodes.estimator_node import EstimatorNode
from ride_estimation.nodes.level_log import QUIET_S, LevelLog
from ride_estimation.resources import shared_path
from ros.conftest import Ros
from ros.drive import drive

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
VICTIM = "/cab/front_left/accel"


def estimator(ros: Ros, *arguments: str, **parameters: object) -> EstimatorNode:
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    cli = ["--ros-args", *arguments] if arguments else None
    node = EstimatorNode(context=ros.context, parameter_overrides=overrides, use_global_arguments=False, cli_args=cli)
    ros.add(node)
    return node


class Listener:
    """Keeps the messages of /diagnostics."""

    def __init__(self, ros: Ros) -> None:
        self.node = ros.add(Node("listener", context=ros.context, use_global_arguments=False))
        self.arrays: list[DiagnosticArray] = []
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self.arrays.append, qos.output(100))


class ReadLog:
    """Reads the log of this process: rclpy gives only the first context of a process a /rosout."""

    def __init__(self, capfd: pytest.CaptureFixture[str]) -> None:
        self._capfd, self._text = capfd, ""

    def has(self, level: str, pattern: str) -> bool:
        self._text += self._capfd.readouterr().err
        return any(re.search(rf"\[{level}\].*{pattern}", line) for line in self._text.splitlines())


# ---- names and stamps ----


def test_two_nodes_are_distinguished_by_name_and_hardware_id(ros_single: Ros) -> None:
    listener = Listener(ros_single)
    nodes = [estimator(ros_single, "-r", f"__ns:=/truck{n}/ride") for n in (1, 2)]
    ros_single.until(lambda: all(node.count_subscribers("/diagnostics") for node in nodes))
    for node in nodes:
        node.watch()
    ros_single.until(lambda: len(listener.arrays) >= 2)
    found = {(s.name, s.hardware_id) for array in listener.arrays for s in array.status}
    for n in (1, 2):
        assert (f"/truck{n}/ride/estimator: load", f"truck{n}/ride/ride_estimation") in found
        assert (f"/truck{n}/ride/estimator: sensor cab_front_left", f"truck{n}/ride/cab_front_left") in found
    assert len(found) == 2 * len({name.partition(": ")[2] for name, _ in found})


def test_the_aggregator_puts_every_status_into_one_group(ros_single: Ros) -> None:
    groups = yaml.safe_load(shared_path("config", "nodes", "diagnostic_aggregator.yaml").read_text(encoding="utf-8"))
    analyzers = [group for group in groups["analyzers"]["ros__parameters"].values() if isinstance(group, dict)]
    node = estimator(ros_single)
    found = list(node._statuses())
    node.trigger_deactivate()
    node._saver.problem = "not saved: no space left"
    for status in [*found, *node._statuses()]:
        name = f"/ride/estimator: {status.name}"
        assert sum(any(words in name for words in group["contains"]) for group in analyzers) == 1, name


def test_stamps_are_of_the_clock_of_the_node_before_and_while_data_come(ros_single: Ros) -> None:
    listener = Listener(ros_single)
    node = estimator(ros_single)
    ros_single.until(lambda: node.count_subscribers("/diagnostics") > 0)
    began = node.get_clock().now().nanoseconds
    node.watch()
    for message in drive(node.session.vehicle, 2.5):  # its stamps are of 2023
        node.receive(message.topic, message.type_name, message.payload)
    ros_single.until(lambda: len(listener.arrays) >= 3)
    stamps = [a.header.stamp.sec * 10**9 + a.header.stamp.nanosec for a in listener.arrays]
    assert stamps == sorted(stamps)
    assert began <= stamps[0]
    assert stamps[-1] <= node.get_clock().now().nanoseconds


# ---- lines of the log ----


class Written:
    """A level log and what it wrote."""

    def __init__(self) -> None:
        self.lines: list[tuple[bytes, str]] = []
        self.log = LevelLog(lambda level, line: self.lines.append((level, line)))

    def note(self, now_s: float, **levels: tuple[bytes, str]) -> list[tuple[bytes, str]]:
        """Return what one look added; names with an underscore for the space."""
        before = len(self.lines)
        statuses = [conversions.status(of, name.replace("_", " "), words, "", {}) for name, (of, words) in levels.items()]
        self.log.note(statuses, now_s)
        return self.lines[before:]


def test_a_status_that_stays_is_said_once_and_its_end_too() -> None:
    log = Written()
    assert log.note(0.0, load=(OK, "keeps up")) == []
    assert log.note(1.0, load=(WARN, "cannot keep up: 0.3 s behind")) == [(WARN, "load: cannot keep up: 0.3 s behind")]
    assert log.note(20.0, load=(WARN, "cannot keep up: 0.9 s behind")) == []
    assert log.note(40.0, load=(OK, "keeps up")) == [(OK, "load: keeps up")]


def test_what_becomes_worse_is_said_at_once() -> None:
    log = Written()
    assert len(log.note(0.0, sensor_a=(WARN, "3 gaps"))) == 1
    assert log.note(0.5, sensor_a=(ERROR, "has stopped")) == [(ERROR, "sensor a: has stopped")]
    assert log.note(1.0, sensor_a=(WARN, "4 gaps")) == []
    assert log.note(6.0, sensor_a=(WARN, "4 gaps")) == [(WARN, "sensor a: 4 gaps")]


def test_what_changes_alike_is_one_line() -> None:
    (line,) = Written().note(0.0, topic_a=(ERROR, "has stopped"), topic_b=(ERROR, "has stopped"), topic_c=(OK, "receiving"))
    assert line == (ERROR, "topic a, b: has stopped")
    (line,) = Written().note(0.0, topic_a=(WARN, "3 messages were lost"), topic_b=(WARN, "5 messages were lost"))
    assert line == (WARN, "topic a, b: 3 messages were lost (the others alike)")


def test_an_error_that_becomes_another_error_is_said_but_not_its_numbers() -> None:
    log = Written()
    assert len(log.note(0.0, topic_a=(ERROR, "nothing received"))) == 1
    assert len(log.note(10.0, topic_a=(ERROR, "nothing for 1.5 s"))) == 1
    assert log.note(20.0, topic_a=(ERROR, "nothing for 2.75 s")) == []


def test_a_status_that_flickers_is_throttled_and_the_last_word_is_right() -> None:
    log = Written()
    for n in range(100):
        log.note(0.1 * n, sensor_a=(ERROR, "has stopped") if n % 2 == 0 else (OK, "contributing"))
    assert len(log.lines) <= 2.0 * 10.0 / QUIET_S + 1
    log.note(100.0, sensor_a=(OK, "contributing"))
    assert log.lines[-1] == (OK, "sensor a: contributing")


def test_what_happens_to_the_node_is_in_its_log(
    ros_single: Ros, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    log = ReadLog(capfd)
    override = {"qos_overrides./cab/front_left/accel.subscription.reliability": "reliable"}
    node = estimator(ros_single, save_directory=str(tmp_path), **override)
    node.watch()
    ros_single.until(lambda: log.has("ERROR", r"topic /cab/.*: configured, but nothing has been received"))
    driver = ros_single.add(Node("driver", context=ros_single.context, use_global_arguments=False))
    driver.create_publisher(Imu, VICTIM, QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT))
    ros_single.until(lambda: log.has("ERROR", "a publisher does not match: incompatible RELIABILITY"))
    node.set_parameters([Parameter("noise_scale", value=2.0)])
    ros_single.until(lambda: log.has("INFO", "changed: noise_scale is 2.0"))
    assert ros_single.call("/ride/estimator/reset", Trigger).success
    ros_single.until(lambda: log.has("WARN", "estimates start again: requested by the service reset"))
    assert ros_single.call("/ride/estimator/save_parameters", Trigger).success
    ros_single.until(lambda: log.has("INFO", "saved .*_identified.yaml"))
    original, calls = node.session.pipeline.observe, iter(range(10**9))

    def fail_once(*arguments: object) -> object:
        if next(calls) == 200:
            raise ValueError("singular")
        return original(*arguments)

    monkeypatch.setattr(node.session.pipeline, "observe", fail_once)
    for message in drive(node.session.vehicle, 1.5):
        node.receive(message.topic, message.type_name, message.payload)
    ros_single.until(lambda: log.has("WARN", f"estimates start again: {NUMERICAL_FAULT}"))


# ---- start values ----


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("executor", "multi", "executor: 'multi' is not allowed; allowed: events, single"),
        ("rate_hz", 5.0, "rate_hz: 5.0 is not allowed; allowed: 0 or 20 to 20000 Hz"),
        ("noise_scale", 2, "noise_scale: a whole number to ROS; write it with a point"),
        ("publish_every", 0, "publish_every: 0 is not allowed; allowed: 1 to 1000 ticks"),
        ("autostart", "maybe", "autostart: 'maybe' is not true or false"),
    ],
)
def test_start_value_that_is_refused_is_one_sentence(ros_single: Ros, name: str, value: object, said: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        estimator(ros_single, **{name: value})
    assert str(error.value) == f"parameters of /ride/estimator: {said}"


def test_parameters_and_inertia_reach_who_joins_after_the_run(ros_single: Ros) -> None:
    node = estimator(ros_single)
    for message in drive(node.session.vehicle, 1.5):
        node.receive(message.topic, message.type_name, message.payload)
    late = ros_single.add(Node("late", context=ros_single.context, use_global_arguments=False))
    got: list[DiagnosticArray] = []
    late.create_subscription(DiagnosticArray, "/ride/estimator/parameters", got.append, qos.latched())
    ros_single.until(lambda: bool(got))
    assert got[0].status
    assert {p.qos_profile.durability for p in late.get_publishers_info_by_topic("/ride/estimator/inertia")} == {
        qos.latched().durability
    }


def test_durability_is_among_the_qos_overrides(ros_single: Ros) -> None:
    topic = "/ride/estimator/parameters"
    node = estimator(ros_single, **{f"qos_overrides.{topic}.publisher.durability": "volatile"})
    (info,) = node.get_publishers_info_by_topic(topic)
    assert info.qos_profile.durability == qos.output().durability
