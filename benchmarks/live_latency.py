# Copyright 2026 ride_estimation contributors
"""Eight triaxial accelerometers at 500 Hz through real rclpy: lost samples, CPU share, latency of the newest force.

This process is sensors and logger, the estimator node is a second process. Every period all sensors send one message with
the time of sending as stamp. Latency is counted per published force:

* ``release``: arrival of the newest force of a block minus the sending of the last sensor message before it, the one that
  completed the block (target: 99th percentile below 10 ms);
* ``age``: arrival minus the stamp of the force, alignment and block length included.

CPU share is user and system time of the estimator process over wall time. Lost are messages that were sent and neither
received by the node nor still on their way at the end.

    python benchmarks/live_latency.py [--rate 500] [--seconds 15] [--executor events|single] [--vehicle FILE]
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
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
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu

from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.nodes import qos
from ride_estimation.nodes.estimator_node import vehicle_path
from ride_estimation.nodes.executors import make_executor

DOMAIN = 42
STAMP = slice(4, 12)
SETTLE_S = 2.0
MATCH_S = 0.5


class Logger(Node):
    """Publishes the sensors and records the forces that come back."""

    def __init__(self, topics: list[str], mount: str) -> None:
        super().__init__("live_latency", enable_rosout=False, start_parameter_services=False)
        profile = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.sensors: list[Publisher] = [self.create_publisher(Imu, topic, profile) for topic in topics]
        self.last_sent_ns = 0
        self.received_counts: dict[str, int] = {}
        self.forces: list[tuple[int, int, int]] = []
        self.create_subscription(WrenchStamped, f"/ride/estimator/mounts/{mount}/force", self.take_force, qos.output(2000))
        self.create_subscription(DiagnosticArray, "/diagnostics", self.take_diagnostics, qos.output(50))

    def take_force(self, message: WrenchStamped) -> None:
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        self.forces.append((stamp, time.time_ns(), self.last_sent_ns))

    def take_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.startswith("topic "):
                self.received_counts[status.name[6:]] = int(next(p.value for p in status.values if p.key == "received"))


def payloads(count: int, rng: np.random.Generator) -> list[bytes]:
    """Return serialized messages of a cab that moves about; the stamp is written over when they are sent."""
    result = []
    for _ in range(count):
        message = Imu()
        message.header.frame_id = "sensor"
        message.orientation_covariance[0] = -1.0
        a = rng.normal(size=3)
        vector = message.linear_acceleration
        vector.x, vector.y, vector.z = float(a[0]), float(a[1]), float(9.81 + a[2])
        result.append(bytes(serialize_message(message)))
    return result


def cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def stamped(payload: bytes, now_ns: int) -> bytes:
    seconds, nanoseconds = divmod(now_ns, 1_000_000_000)
    return payload[: STAMP.start] + seconds.to_bytes(4, "little") + nanoseconds.to_bytes(4, "little") + payload[STAMP.stop :]


def run(options: argparse.Namespace) -> dict[str, float]:
    """Run one measurement and return its figures."""
    vehicle = load_vehicle(vehicle_path(options.vehicle))
    topics = list({sensor.topic: None for sensor in vehicle.sensors.values()})
    environment = {k: v for k, v in os.environ.items() if k not in ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH")}
    environment |= {"ROS_DOMAIN_ID": str(DOMAIN), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "ride_estimation.nodes.estimator_node", "--ros-args", "-p", f"executor:={options.executor}"]
    command += ["-p", f"vehicle:={options.vehicle}", "--log-level", "warn"]
    estimator = subprocess.Popen(command, env=environment)
    rclpy.init(domain_id=DOMAIN)
    logger = Logger(topics, next(iter(vehicle.mounts)))
    executor = make_executor("events")
    executor.add_node(logger)
    try:
        while any(p.get_subscription_count() == 0 for p in logger.sensors):
            executor.spin_once(timeout_sec=0.05)
        matched = time.monotonic()  # the other side needs a moment more; a sensor that starts earlier loses its first samples
        while time.monotonic() - matched < MATCH_S:
            executor.spin_once(timeout_sec=0.05)
        messages = payloads(997, np.random.default_rng(1))
        period_ns = round(1e9 / options.rate)
        start = time.time_ns()
        ticks = round((options.seconds + SETTLE_S) * options.rate)
        settled = round(SETTLE_S * options.rate)
        cpu0 = wall0 = 0.0
        for tick in range(ticks):
            due = start + tick * period_ns
            while (rest := due - time.time_ns()) > 0:
                executor.spin_once(timeout_sec=rest * 1e-9)
            if tick == settled:
                logger.forces.clear()
                cpu0, wall0 = cpu_seconds(estimator.pid), time.monotonic()
            now = time.time_ns()
            for number, publisher in enumerate(logger.sensors):
                publisher.publish(stamped(messages[(tick * len(topics) + number) % 997], now))
            logger.last_sent_ns = time.time_ns()
            executor.spin_once(timeout_sec=1e-6)
        share = (cpu_seconds(estimator.pid) - cpu0) / (time.monotonic() - wall0)
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
    # the forces of one block arrive after the same sensor message; the newest of them is the last
    last = np.append(np.diff(forces[:, 2]) > 0, True)
    newest = forces[last]
    release = (newest[:, 1] - newest[:, 2]) * 1e-6
    age = (newest[:, 1] - newest[:, 0]) * 1e-6
    return {
        "sensors": len(topics), "rate_hz": options.rate, "sent": ticks * len(topics),
        "lost": sum(ticks - logger.received_counts.get(t, 0) for t in topics), "forces": len(forces), "cpu_percent": 100 * share,
        "release_p50_ms": float(np.percentile(release, 50)), "release_p99_ms": float(np.percentile(release, 99)),
        "age_p50_ms": float(np.percentile(age, 50)), "age_p99_ms": float(np.percentile(age, 99)), "exit_code": code,
    }  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rate", type=float, default=500.0, help="messages per second and sensor")
    parser.add_argument("--seconds", type=float, default=15.0, help="length of the measurement")
    parser.add_argument("--executor", default="events", choices=("events", "single"))
    parser.add_argument("--vehicle", default="truck_cab")
    figures = run(parser.parse_args())
    print(json.dumps({k: round(v, 3) if isinstance(v, float) else v for k, v in figures.items()}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
