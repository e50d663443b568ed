# Copyright 2026 ride_estimation contributors
"""Time from starting the estimator node to its first estimate, with and without compiled code on disk.

The node is a process of its own in a DDS domain of its own; all accelerometers of the bundled truck cab send at 100 Hz from
the beginning. Counted are seconds from the start of the process to the first message of `cg_accel`, and the processor time the
node used until then, which is what an idle machine would need. The first estimate needs 0.5 s of data by itself (the time base
looks at the rates first).

    python benchmarks/node_start.py            # compiled code as it is on this machine
    python benchmarks/node_start.py --cold     # an empty folder for compiled code: the first start after an installation
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import numpy as np
import rclpy
from geometry_msgs.msg import AccelWithCovarianceStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu

from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.nodes import qos
from ride_estimation.nodes.executors import make_executor
from ride_estimation.resources import shared_path

DOMAIN, RATE, LONGEST_S = 100, 100.0, 300.0


def cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def first_estimate_s(cache: str) -> tuple[float, float]:
    """Return the seconds from start to first estimate, infinity where there is none, and the processor time of the node."""
    environment = {k: v for k, v in os.environ.items() if k not in ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH")}
    environment |= {"ROS_DOMAIN_ID": str(DOMAIN), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    if cache:
        environment["RIDE_ESTIMATION_CACHE"] = cache
    vehicle = load_vehicle(shared_path("config", "vehicles", "truck_cab.yaml"))
    rclpy.init(domain_id=DOMAIN)
    node = Node("node_start", enable_rosout=False, start_parameter_services=False)
    profile = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
    sensors = [node.create_publisher(Imu, s.topic, profile) for s in vehicle.sensors.values()]
    arrived: list[float] = []
    node.create_subscription(
        AccelWithCovarianceStamped, "/ride/estimator/cg_accel", lambda m: arrived.append(time.monotonic()), qos.output(50)
    )
    executor = make_executor("single")
    executor.add_node(node)
    rng = np.random.default_rng(0)
    began = time.monotonic()
    command = [sys.executable, "-m", "ride_estimation.nodes.estimator_node", "--ros-args", "--log-level", "warn"]
    process = subprocess.Popen(command, env=environment)
    try:
        while not arrived and time.monotonic() - began < LONGEST_S and process.poll() is None:
            due = time.monotonic() + 1.0 / RATE
            now = time.time_ns()
            for publisher in sensors:
                message = Imu()
                message.header.stamp.sec, message.header.stamp.nanosec = divmod(now, 1_000_000_000)
                message.linear_acceleration.z = 9.81 + float(rng.normal())
                publisher.publish(message)
            while (rest := due - time.monotonic()) > 0.0:
                executor.spin_once(timeout_sec=rest)
        used = cpu_seconds(process.pid)
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(timeout=30)
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    return arrived[0] - began if arrived else float("inf"), used


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cold", action="store_true", help="without compiled code")
    with tempfile.TemporaryDirectory() as folder:
        cold = parser.parse_args().cold
        seconds, used = first_estimate_s(folder if cold else "")
    figures = {"first estimate after [s]": round(seconds, 2), "processor time [s]": round(used, 2)}
    print(json.dumps({"compiled code": "none" if cold else "on disk", **figures}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
