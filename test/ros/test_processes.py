# Copyright 2026 ride_estimation contributors
"""The nodes as processes: start, signals, exit codes, a replay from one to the other."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from sensor_msgs.msg import JointState

from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.jit import COMPILED
from ride_estimation.nodes import qos
from ros.conftest import Ros
from ros.drive import drive
from ros.test_lockstep import TRUCK, write_bag

Start = Callable[..., "subprocess.Popen[str]"]

#: how long the estimator stands still, longer than the transport keeps messages and than is left of the run [s]
STALL_S = 1.6


@pytest.fixture
def start(domain: int) -> Iterator[Start]:
    """Start nodes in processes of their own; the variables of the parent's ROS environment are not passed on."""
    started: list[subprocess.Popen[str]] = []

    def start_one(module: str, *arguments: str) -> subprocess.Popen[str]:
        environment = {k: v for k, v in os.environ.items() if k not in ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH")}
        environment["ROS_DOMAIN_ID"] = str(domain)
        started.append(
            subprocess.Popen(
                [sys.executable, "-m", f"ride_estimation.nodes.{module}", "--ros-args", *arguments],
                env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
            )
        )  # fmt: skip
        return started[-1]

    yield start_one
    for process in started:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def end(process: subprocess.Popen[str], number: signal.Signals | None) -> tuple[int, str]:
    """Send a signal to the process group and return exit code and output."""
    if number is not None:
        os.killpg(process.pid, number)
    try:
        output, _ = process.communicate(timeout=60)
    except subprocess.TimeoutExpired:
        pytest.fail(f"did not end within 60 s of {number}")
    return process.returncode, output


@pytest.mark.parametrize(
    ("executor", "number"), [("events", signal.SIGINT), pytest.param("single", signal.SIGTERM, marks=pytest.mark.slow)]
)
def test_node_ends_cleanly_on_a_signal(ros_single: Ros, start: Start, executor: str, number: signal.Signals) -> None:
    process = start("estimator_node", "-p", f"executor:={executor}")
    watcher = ros_single.add(Node("watcher", context=ros_single.context, use_global_arguments=False))
    ros_single.until(lambda: watcher.count_publishers("/ride/estimator/cg_accel") > 0, deadline_s=60.0)
    code, output = end(process, number)
    assert code == 0, output
    assert "Traceback" not in output


@pytest.mark.slow
@pytest.mark.skipif(not COMPILED, reason="without numba nothing is compiled")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_compiling_ends_cleanly_and_soon(
    start: Start, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, number: signal.Signals
) -> None:
    monkeypatch.setenv("RIDE_ESTIMATION_CACHE", str(tmp_path))
    process = start("estimator_node")
    assert process.stdout is not None
    line = process.stdout.readline()
    assert "compiling for this machine, once" in line
    process.send_signal(number)  # to the node alone, as a supervisor does
    code, output = end(process, None)
    assert code == 0, output
    assert "Traceback" not in output
    assert not list(tmp_path.rglob("all_compiled"))


def test_recorded_run_is_played_into_the_live_estimator(ros_single: Ros, start: Start, tmp_path: Path) -> None:
    """On reliable topics a node that stands still loses no message; each is used or counted as left out because of load."""
    run = write_bag(tmp_path / "run", [(m.topic, m.type_name, m.stamp_ns, m.payload) for m in drive(load_vehicle(TRUCK), 4.0)])
    listener = ros_single.add(Node("listener", context=ros_single.context, use_global_arguments=False))
    got: list[JointState] = []
    accepted: dict[str, int] = {}
    taken: dict[str, int] = {}

    def keep_counts(message: DiagnosticArray) -> None:
        for status in message.status:
            counts = {pair.key: pair.value for pair in status.values}
            if "accepted" in counts:
                accepted[status.name] = int(counts["accepted"])
            if "left out because of load" in counts:
                taken[status.name] = int(counts["received"]) + int(counts["left out because of load"])

    listener.create_subscription(JointState, "/ride/estimator/mounts/states", got.append, qos.output(2000))
    listener.create_subscription(DiagnosticArray, "/diagnostics", keep_counts, qos.output())
    topics = {sensor.topic for sensor in load_vehicle(TRUCK).sensors.values()}
    reliable = [f"qos_overrides.{topic}.subscription.reliability:=reliable" for topic in sorted(topics)]
    estimator = start("estimator_node", *(word for given in ["use_sim_time:=true", *reliable] for word in ("-p", given)))
    ros_single.until(lambda: bool(accepted), deadline_s=60.0)  # active, and its topics are matched
    player = start("replay_node", "-p", f"bag:={run}", "-p", "wait_for_subscribers:=60.0")
    ros_single.until(lambda: bool(got), deadline_s=60.0)
    os.killpg(estimator.pid, signal.SIGSTOP)
    time.sleep(STALL_S)
    os.killpg(estimator.pid, signal.SIGCONT)
    ros_single.until(lambda: player.poll() is not None, deadline_s=60.0)
    code, output = end(player, None)
    assert code == 0, output
    assert "played 3200 messages" in output
    ros_single.until(lambda: min(taken.values()) == 400, deadline_s=60.0)
    assert len(accepted) == len(taken) == 8
    assert min(accepted.values()) > 0
    assert end(estimator, signal.SIGINT)[0] == 0


def test_run_that_cannot_be_played_is_one_message_and_exit_code_two(start: Start, tmp_path: Path) -> None:
    code, output = end(start("replay_node", "-p", f"bag:={tmp_path / 'none'}"), None)
    assert code == 2
    assert "does not exist" in output
    assert "Traceback" not in output
