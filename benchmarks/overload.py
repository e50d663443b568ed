# Copyright 2026 ride_estimation contributors
"""The live node with more messages than the machine can handle: when it says so, whether its memory grows, what is not counted.

The estimator is a process of its own; this one sends the messages of eight accelerometers (the bundled nominal run, again and
again, stamped anew). For ten seconds the node has the machine and should keep up; then it may run only a share of the time,
stopped and continued by signals, as the processor quota of a container does it, which costs the machine nothing. Measured:

* ``said_s``: time from the first stop to the first report whose status ``load`` is not OK;
* ``ok_reports``: reports afterwards that call the load OK; ``unsaid_losses``: those of them since whose predecessor messages
  were lost or left out;
* ``memory_growth``: resident memory of the node at the end over that before the overload, minus one;
* ``uncounted``: messages sent that the node neither used nor counted as lost or left out, nor had still waiting at the end;
* ``services_s``: longest answer of a service in between.

    python benchmarks/overload.py [--seconds 600] [--rate 500] [--share 0.1] [--executor events|single]
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu

from ride_estimation.io.playback import playable_topics, recorded_messages
from ride_estimation.nodes import qos
from ride_estimation.nodes.executors import make_executor
from ride_estimation.resources import shared_path

DOMAIN = 100
STAMP = slice(4, 12)
#: time before the overload, and after it for what still waits [s]
QUIET_S, SETTLE_S = 10.0, 6.0
#: the other side sees a new publisher a moment after this side sees the subscriber [s]
MATCH_S = 3.0
#: time between two messages to a service [s]
ASK_S = 5.0
#: as of the processor quotas of Linux control groups [s]
QUOTA_PERIOD_S = 0.1
PAGE = os.sysconf("SC_PAGE_SIZE")


class Sender(Node):
    """Sends the sensors and keeps what the status ``load`` said."""

    def __init__(self, topics: list[str]) -> None:
        super().__init__("overload", enable_rosout=False, start_parameter_services=False)
        profile = QoSProfile(depth=2000, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.sensors = {topic: self.create_publisher(Imu, topic, profile) for topic in topics}
        #: time, level, words, messages lost or left out
        self.reports: list[tuple[float, int, str, int]] = []
        self.received = 0
        self.create_subscription(DiagnosticArray, "/diagnostics", self.take, qos.output(100))
        self.client = self.create_client(GetParameters, "/ride/estimator/get_parameters")
        self.asked, self.answers = 0.0, [0.0]

    def take(self, message: DiagnosticArray) -> None:
        counted = 0
        for status in message.status:
            values = {p.key: p.value for p in status.values}
            if status.name.endswith("load"):
                counted = int(values["messages left out"]) + int(values["messages lost before they came here"])
                load = (ord(status.level) if isinstance(status.level, bytes) else int(status.level), status.message)
        self.received = sum(
            int(p.value) for s in message.status if "topic " in s.name for p in s.values if p.key == "received"
        )
        self.reports.append((time.monotonic(), *load, counted))

    def ask(self) -> None:
        """Ask for a parameter; the time of the answer shows whether services have their turn."""
        began = self.asked = time.monotonic()
        future = self.client.call_async(GetParameters.Request(names=["executor"]))
        future.add_done_callback(lambda _: self.answers.append(time.monotonic() - began))


def resident(pid: int) -> float:
    """Return the resident memory of a process [MB]."""
    return int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]) * PAGE / 1e6


def stamped(payload: bytes, stamp_ns: int) -> bytes:
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    return payload[: STAMP.start] + seconds.to_bytes(4, "little") + nanoseconds.to_bytes(4, "little") + payload[STAMP.stop :]


def estimator(executor: str) -> subprocess.Popen[bytes]:
    """Start the node."""
    environment = {k: v for k, v in os.environ.items() if k not in ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH")}
    environment |= {"ROS_DOMAIN_ID": str(DOMAIN), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "ride_estimation.nodes.estimator_node", "--ros-args", "--log-level", "error"]
    return subprocess.Popen([*command, "-p", f"executor:={executor}"], env=environment)


class Quota(threading.Thread):
    """Lets a process run for a share of the time, until :meth:`end`."""

    def __init__(self, pid: int, share: float) -> None:
        super().__init__(daemon=True)
        self._pid, self._share, self._over = pid, share, threading.Event()

    def run(self) -> None:
        while not self._over.is_set():
            os.kill(self._pid, signal.SIGSTOP)
            time.sleep(QUOTA_PERIOD_S * (1.0 - self._share))
            os.kill(self._pid, signal.SIGCONT)
            time.sleep(QUOTA_PERIOD_S * self._share)

    def end(self) -> None:
        """Return when the process runs as it likes."""
        self._over.set()
        self.join()


def run(options: argparse.Namespace) -> dict[str, object]:
    """Run one measurement and return its figures."""
    bag = shared_path("bags", "nominal", "bag")
    drive: dict[str, list[bytes]] = {topic: [] for topic in playable_topics(bag)}
    for message in recorded_messages(bag, drive):
        drive[message.topic].append(bytes(message.payload))
    process = estimator(options.executor)
    quota = Quota(process.pid, options.share)
    rclpy.init(domain_id=DOMAIN)
    sender = Sender(list(drive))
    executor = make_executor("events")
    executor.add_node(sender)
    memory: list[tuple[float, float]] = []
    sent = 0

    def spin(until: float) -> None:
        while (rest := until - time.monotonic()) > 0:
            executor.spin_once(timeout_sec=rest)

    def send(rate_hz: float, seconds: float, ticks_before: int) -> int:
        """Send at a rate; the sender that comes late sends what is due at once."""
        began, wall, tick = time.monotonic(), time.time_ns(), 0
        while tick < seconds * rate_hz:
            spin(began + tick / rate_hz)
            due = min(round((time.monotonic() - began) * rate_hz), round(seconds * rate_hz))
            while tick <= due:
                for topic, publisher in sender.sensors.items():
                    payload = drive[topic][(ticks_before + tick) % len(drive[topic])]
                    publisher.publish(stamped(payload, wall + round(1e9 * tick / rate_hz)))
                tick += 1
            executor.spin_once(timeout_sec=1e-6)
            if time.monotonic() - sender.asked > ASK_S:
                sender.ask()
                memory.append((time.monotonic(), resident(process.pid)))
        return tick

    try:
        while any(p.get_subscription_count() == 0 for p in sender.sensors.values()):
            spin(time.monotonic() + 0.05)
        spin(time.monotonic() + MATCH_S)
        sent += send(options.rate, QUIET_S, 0)
        quiet = [words for _, level, words, _ in sender.reports if level != 0]
        onset = time.monotonic()
        quota.start()
        sent += send(options.rate, options.seconds, sent)
        ended = time.monotonic()
        quota.end()
        spin(ended + SETTLE_S)
    finally:
        process.send_signal(signal.SIGINT)
        code = process.wait(timeout=30)
        executor.shutdown()
        sender.destroy_node()
        rclpy.try_shutdown()
    return figures(sender, memory, onset, ended, sent * len(drive)) | {
        "executor": options.executor, "rate_hz": options.rate, "seconds": options.seconds, "share": options.share,
        "warnings_before": len(quiet), "exit_code": code,
    }  # fmt: skip


def figures(sender: Sender, memory: list[tuple[float, float]], onset: float, ended: float, sent: int) -> dict[str, object]:
    """Return what is printed."""
    said = next((moment for moment, level, *_ in sender.reports if moment > onset and level != 0), None)
    later = [r for r in sender.reports if said is not None and said < r[0] < ended]
    before = dict(zip(later[1:], later))
    fine = [r for r in later if r[1] == 0]
    quiet_mb = [m for moment, m in memory if moment <= onset][-1]
    counted = sender.reports[-1][3]
    return {
        "sent": sent, "used": sender.received, "counted": counted, "uncounted": sent - sender.received - counted,
        "said_s": None if said is None else said - onset, "ok_reports": len(fine),
        "unsaid_losses": sum(r[3] > before.get(r, r)[3] for r in fine),
        "longest_report_gap_s": max((b[0] - a[0] for a, b in itertools.pairwise(later)), default=0.0),
        "words": later[-1][2] if later else "", "memory_mb": memory[-1][1], "memory_growth": memory[-1][1] / quiet_mb - 1.0,
        "services_s": max(sender.answers), "answers": len(sender.answers) - 1,
    }  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0, help="length of the overload")
    parser.add_argument("--rate", type=float, default=500.0, help="messages per second and sensor")
    parser.add_argument("--share", type=float, default=0.1, help="share of the time the node may run")
    parser.add_argument("--executor", default="events", choices=("events", "single"))
    found = run(parser.parse_args())
    print(json.dumps({k: round(v, 3) if isinstance(v, float) else v for k, v in found.items()}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
