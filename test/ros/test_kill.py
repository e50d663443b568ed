# Copyright 2026 ride_estimation contributors
"""The estimator node as a process that is ended while it works: by a signal, and by ``kill -9``, also while it saves."""

from __future__ import annotations

import itertools
import os
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import Imu

from ride_estimation.estimation.common.estimate import Estimate
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.state_file import load_state, restore_state
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.nodes import qos
from ros.conftest import Ros
from ros.drive import START_NS, Message, drive
from ros.test_lockstep import TRUCK
from ros.test_processes import Start, end
from ros.test_processes import start as start  # noqa: PLC0414  (a fixture)

pytestmark = pytest.mark.slow

#: data of one loop [s]; the next one follows it in time
LOOP_S = 10.0


class Feeder:
    """Publishes a drive without end, as fast as it is asked to, and hears the parameters."""

    def __init__(self, ros: Ros) -> None:
        self.ros = ros
        self.node = ros.add(Node("feeder", context=ros.context, use_global_arguments=False))
        self.vehicle = load_vehicle(TRUCK)
        topics = {s.topic for s in self.vehicle.sensors.values()}
        self.publishers: dict[str, Publisher] = {t: self.node.create_publisher(Imu, t, qos.output(2000)) for t in topics}
        self.heard: list[DiagnosticArray] = []
        self.node.create_subscription(DiagnosticArray, "/ride/estimator/parameters", self.heard.append, qos.output(2000))
        self._messages: Iterator[Message] = itertools.chain.from_iterable(
            drive(self.vehicle, LOOP_S, start_ns=START_NS + n * round(LOOP_S * 1e9)) for n in itertools.count()
        )

    def connect(self) -> None:
        """Wait until the node listens to every topic."""
        self.ros.until(lambda: all(p.get_subscription_count() for p in self.publishers.values()), deadline_s=60.0)

    def feed(self, seconds: float, pause_s: float = 0.01) -> None:
        """Publish data of so many seconds, after every tenth of one a pause."""
        for _ in range(round(seconds * 10.0)):
            for message in itertools.islice(self._messages, 10 * len(self.publishers)):
                self.publishers[message.topic].publish(message.payload)
            self.ros.executor.spin_once(timeout_sec=pause_s)


@pytest.mark.parametrize(("executor", "number"), [("events", signal.SIGINT), ("single", signal.SIGTERM)])
def test_a_signal_in_the_middle_of_publishing_is_no_error(
    ros_single: Ros, start: Start, executor: str, number: signal.Signals
) -> None:
    """More data than the node can take wait in its queues when the signal arrives: nothing fails, no error is logged."""
    feeder = Feeder(ros_single)
    for _ in range(2):
        process = start("estimator_node", "-p", f"executor:={executor}")
        feeder.connect()
        feeder.heard.clear()
        ros_single.until(lambda: bool(feeder.feed(0.2) or feeder.heard), deadline_s=60.0)
        feeder.feed(5.0, pause_s=0.0)
        code, output = end(process, number)
        assert code == 0, output
        # that messages are left out or late, or that none came for half a second, is true and a status at level ERROR
        states = re.compile(r"\]: (load|estimates|sensor [^:]*|topic [^:]*): ")
        others = [line for line in output.splitlines() if not states.search(line)]
        assert not any(word in line for line in others for word in ("Traceback", "FATAL", "ERROR")), output


def published(message: DiagnosticArray) -> dict[str, float]:
    """Return name -> value of the parameters."""
    return {s.name: float(next(p.value for p in s.values if p.key == "value")) for s in message.status}


def kill_while_saving(process: subprocess.Popen[str], path: Path, feeder: Feeder) -> None:
    """Send SIGKILL at the moment a file that is being written appears beside the state."""
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline:
        feeder.feed(0.1)
        looked = time.monotonic()
        while time.monotonic() < looked + 0.1:
            if any(name.endswith(".tmp") for name in os.listdir(path.parent)):
                os.killpg(process.pid, signal.SIGKILL)
                return
    pytest.fail("the node did not save within 60 s")


def kill_anywhere(process: subprocess.Popen[str], path: Path, feeder: Feeder) -> None:
    """Send SIGKILL while data flow."""
    feeder.feed(0.5)
    os.killpg(process.pid, signal.SIGKILL)


def test_killed_node_continues_from_its_last_save(ros_single: Ros, start: Start, tmp_path: Path) -> None:
    """Whenever it is killed there is a whole state on the disk, and the next process begins with exactly its parameters."""
    path = tmp_path / "state.json"
    arguments = ("-p", f"state_file:={path}", "-p", "save_interval:=0.001")  # saves at every look of the watch, once a second
    feeder = Feeder(ros_single)
    before: tuple[Estimate, ...] = ()
    for kill in (kill_anywhere, kill_while_saving, kill_while_saving):
        process = start("estimator_node", *arguments)
        feeder.connect()
        feeder.heard.clear()
        ros_single.until(lambda: bool(feeder.feed(0.2) or feeder.heard), deadline_s=60.0)
        if before:
            first = published(feeder.heard[0])
            for estimate in before:
                # text with nine digits
                assert first[estimate.name] == pytest.approx(estimate.value, rel=1e-6)
        ros_single.until(lambda: bool(feeder.feed(0.2) or path.exists()), deadline_s=60.0)
        feeder.feed(8.0, pause_s=0.1)
        kill(process, path, feeder)
        killed = time.time()
        code, output = end(process, None)
        assert code == -signal.SIGKILL, output
        load_state(path)  # checksum
        # saved every second; the rest is what a busy machine takes
        assert killed - path.stat().st_mtime < 10.0
        continued = Pipeline(feeder.vehicle)
        restore_state(path, continued)
        before = continued.parameters()
    assert "continuing from" in output
    assert any(e.value != e.prior for e in before), "something was learned that could have been lost"
