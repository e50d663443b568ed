# Copyright 2026 ride_estimation contributors
"""Eight triaxial accelerometers at 500 Hz through real rclpy: lost samples, CPU share, latency of the newest force.

This process is sensors and logger, the estimator node is a second process. The data are a simulated drive (the bundled
nominal scenario at the wanted rate). Every period all sensors send one message, stamped with the time it is due. Latency is
counted per block of published forces, over the whole drive and without its first seconds, in which the parameters start and
the last seconds are reviewed as a whole a few times:

* ``release``: arrival of the newest force of a block minus the sending of the last sensor message it needs, the second one at
  or after its stamp (target: 99th percentile below 10 ms);
* ``age``: arrival minus the stamp of the force, alignment included.

CPU share is user and system time of the estimator process over wall time. Lost are messages that were sent and neither
received by the node nor still on their way at the end.

    python benchmarks/live_latency.py [--rate 500] [--seconds 40] [--executor events|single]
"""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu

from ride_estimation.cli.main import main as command
from ride_estimation.io.playback import playable_topics, recorded_messages
from ride_estimation.nodes import qos
from ride_estimation.nodes.executors import make_executor
from ride_estimation.resources import shared_path

DOMAIN = 99
STAMP = slice(4, 12)
START_S = 20.0
MATCH_S = 0.5


class Logger(Node):
    """Publishes the sensors and records the forces that come back."""

    def __init__(self, topics: list[str], mount: str) -> None:
        super().__init__("live_latency", enable_rosout=False, start_parameter_services=False)
        profile = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.sensors: list[Publisher] = [self.create_publisher(Imu, topic, profile) for topic in topics]
        self.sent_ns: list[int] = []
        self.received_counts: dict[str, int] = {}
        self.forces: list[tuple[int, int]] = []
        self.create_subscription(WrenchStamped, f"/ride/estimator/mounts/{mount}/force", self.take_force, qos.output(2000))
        self.create_subscription(DiagnosticArray, "/diagnostics", self.take_diagnostics, qos.output(50))

    def take_force(self, message: WrenchStamped) -> None:
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        self.forces.append((stamp, time.time_ns()))

    def take_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            _, _, topic = status.name.partition(": topic ")
            if topic:
                self.received_counts[topic] = int(next(p.value for p in status.values if p.key == "received"))


def simulated(rate_hz: float, seconds: float) -> dict[str, list[bytes]]:
    """Return the serialized messages of every topic of a drive at some rate."""
    recipe = shared_path("bags", "nominal", "recipe.yaml").read_text(encoding="utf-8")
    changes = {"rate_hz": rate_hz, "duration_s": seconds + 1.0, "anti_alias_hz": 0.4 * rate_hz}
    for key, value in changes.items():
        recipe, count = re.subn(rf"\b{key}: [0-9.]+", f"{key}: {value}", recipe)
        if count != 1:
            raise RuntimeError(f"{key} is {count} times in the recipe")
    with tempfile.TemporaryDirectory() as folder:
        scenario = Path(folder) / "recipe.yaml"
        scenario.write_text(recipe, encoding="utf-8")
        vehicle = shared_path("config", "vehicles", "truck_cab.yaml")
        if command(["simulate", str(scenario), "--vehicle", str(vehicle), "--out", str(Path(folder) / "run")]):
            raise RuntimeError("the drive could not be simulated")
        bag = Path(folder) / "run" / "bag"
        found: dict[str, list[bytes]] = {topic: [] for topic in playable_topics(bag)}
        for message in recorded_messages(bag, found):
            found[message.topic].append(bytes(message.payload))
    return found


def cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def stamped(payload: bytes, now_ns: int) -> bytes:
    seconds, nanoseconds = divmod(now_ns, 1_000_000_000)
    return payload[: STAMP.start] + seconds.to_bytes(4, "little") + nanoseconds.to_bytes(4, "little") + payload[STAMP.stop :]


def run(options: argparse.Namespace) -> dict[str, float]:
    """Run one measurement and return its figures."""
    drive = simulated(options.rate, options.seconds)
    topics = list(drive)
    environment = {k: v for k, v in os.environ.items() if k not in ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH")}
    environment |= {"ROS_DOMAIN_ID": str(DOMAIN), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    command_line = [sys.executable, "-m", "ride_estimation.nodes.estimator_node", "--ros-args", "--log-level", "warn"]
    estimator = subprocess.Popen([*command_line, "-p", f"executor:={options.executor}"], env=environment)
    rclpy.init(domain_id=DOMAIN)
    logger = Logger(topics, "front_left")
    executor = make_executor("events")
    executor.add_node(logger)
    try:
        while any(p.get_subscription_count() == 0 for p in logger.sensors):
            executor.spin_once(timeout_sec=0.05)
        matched = time.monotonic()  # the other side needs a moment more; a sensor that starts earlier loses its first samples
        while time.monotonic() - matched < MATCH_S:
            executor.spin_once(timeout_sec=0.05)
        period_ns = round(1e9 / options.rate)
        ticks = round(options.seconds * options.rate)
        cpu, wall = cpu_seconds(estimator.pid), time.monotonic()
        start = time.time_ns()
        for tick in range(ticks):
            due = start + tick * period_ns
            while (rest := due - time.time_ns()) > 0:
                executor.spin_once(timeout_sec=rest * 1e-9)
            now = time.time_ns()
            for publisher, messages in zip(logger.sensors, drive.values(), strict=True):
                publisher.publish(stamped(messages[tick], due))
            logger.sent_ns.append(now)
            executor.spin_once(timeout_sec=1e-6)
        share = (cpu_seconds(estimator.pid) - cpu) / (time.monotonic() - wall)
        forces = np.array(logger.forces, dtype=np.int64)
        end = time.monotonic() + 3.0
        while time.monotonic() < end and any(logger.received_counts.get(t, 0) < ticks for t in topics):
            executor.spin_once(timeout_sec=0.1)
    finally:
        estimator.send_signal(signal.SIGINT)
        code = estimator.wait(timeout=10)
        executor.shutdown()
        logger.destroy_node()
        rclpy.try_shutdown()
    # the forces of a block arrive together, so within it age falls; the newest is the last before age rises again
    newest = forces[np.append(np.diff(forces[:, 1] - forces[:, 0]) > 0, True)]
    needed = np.minimum(-(-(newest[:, 0] - start) // period_ns) + 1, ticks - 1)
    release = (newest[:, 1] - np.array(logger.sent_ns)[needed]) * 1e-6
    age = (newest[:, 1] - newest[:, 0]) * 1e-6
    settled = newest[:, 0] - start > START_S * 1e9
    figures = {
        "sensors": len(topics), "rate_hz": options.rate, "sent": ticks * len(topics),
        "lost": sum(ticks - logger.received_counts.get(t, 0) for t in topics), "forces": len(forces), "cpu_percent": 100 * share,
        "exit_code": code,
    }  # fmt: skip
    for name, values in (("release", release), ("age", age)):
        figures |= {f"{name}_p50_ms": float(np.percentile(values, 50)), f"{name}_p99_ms": float(np.percentile(values, 99))}
        if settled.any():
            figures[f"{name}_p99_after_{START_S:g}_s_ms"] = float(np.percentile(values[settled], 99))
        figures[f"{name}_max_ms"] = float(values.max())
    return figures


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rate", type=float, default=500.0, help="messages per second and sensor")
    parser.add_argument("--seconds", type=float, default=40.0, help="length of the drive")
    parser.add_argument("--executor", default="events", choices=("events", "single"))
    figures = run(parser.parse_args())
    print(json.dumps({k: round(v, 3) if isinstance(v, float) else v for k, v in figures.items()}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
