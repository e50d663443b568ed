# Copyright 2026 ride_estimation contributors
"""Play a recorded run onto its topics with ``/clock``, as raw bytes, and end; the stamps stay those of the recording.

For a replay that must equal the offline one bit by bit use ``ride-estimation replay`` or :mod:`ride_estimation.nodes.lockstep`.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from typing import Unpack

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock as ClockMessage

from ride_estimation.errors import RideEstimationError
from ride_estimation.io.playback import RecordedMessage, playable_topics, recorded_messages
from ride_estimation.nodes import qos
from ride_estimation.nodes.conversions import time_message
from ride_estimation.nodes.executors import run_node
from ride_estimation.nodes.inputs import MESSAGE_CLASSES
from ride_estimation.nodes.parameters import NodeOptions, NodeParameter, declare, values

TABLE: tuple[NodeParameter, ...] = (
    NodeParameter("bag", "", "", "run to play: rosbag2 folder, .mcap, .db3 or ROS 1 .bag", read_only=True),
    NodeParameter("rate", 1.0, "-", "speed, 1 is real time", 0.01, 100.0, read_only=True),
    NodeParameter("wait_for_subscribers", 10.0, "s", "longest wait for a subscriber on every topic", 0.0, 600.0, read_only=True),
)

#: how often due messages are published [s]
STEP_S = 0.001
#: data time between two /clock messages [ns]
CLOCK_STEP_NS = 5_000_000
#: a subscriber sees a new publisher a moment after the publisher sees it [s]
MATCH_S = 0.5
QUEUE = 2000


class ReplayNode(Node):
    """Publishes the messages of a run at their times of arrival.

    Parameters
    ----------
    options
        See :class:`NodeOptions`.
    """

    def __init__(self, **options: Unpack[NodeOptions]) -> None:
        super().__init__("replay", namespace="ride", **options)
        declare(self, TABLE)
        given = values(self, TABLE)
        self.finished = False
        self.exit_code = 0
        self.played = 0
        self._rate = float(given["rate"])
        self._clock_publisher = self.create_publisher(ClockMessage, "/clock", qos.output(10))
        self._topics: dict[str, Publisher] = {}
        self._messages: Iterator[RecordedMessage] = iter(())
        self._next: RecordedMessage | None = None
        self._started: tuple[float, int] | None = None
        self._clock_ns: int | None = None
        self._give_up = time.monotonic() + float(given["wait_for_subscribers"])
        self._matched: float | None = None
        try:
            types = playable_topics(str(given["bag"]))
            for topic, kind in types.items():
                self._topics[topic] = self.create_publisher(MESSAGE_CLASSES[kind], topic, qos.output(QUEUE))
            self._messages = recorded_messages(str(given["bag"]), types)
            self._advance()
        except RideEstimationError as error:
            self._fail(error)
        self._timer = self.create_timer(STEP_S, self.step, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _fail(self, error: RideEstimationError) -> None:
        self.get_logger().error(str(error))
        self.finished, self.exit_code = True, 2

    def _advance(self) -> None:
        self._next = next(self._messages, None)
        if self._next is None:
            self.finished = True
            self.get_logger().info(f"played {self.played} messages")

    def _ready(self, now: float) -> bool:
        """Return whether to play: everybody listens, or the wait is over."""
        if self._started is None:
            if now < self._give_up and not all(p.get_subscription_count() for p in self._topics.values()):
                return False
            self._matched = self._matched or now
            if now < min(self._matched + MATCH_S, max(self._give_up, self._matched)):
                return False
            self._started = (now, self._next.arrival_ns if self._next else 0)
        return True

    def step(self) -> None:
        """Publish everything that is due."""
        now = time.monotonic()
        if self.finished or not self._ready(now) or self._started is None:
            return
        began, first_ns = self._started
        data_ns = first_ns + round((now - began) * self._rate * 1e9)
        try:
            while self._next is not None and self._next.arrival_ns <= data_ns:
                self._tell_time(self._next.arrival_ns)
                self._topics[self._next.topic].publish(self._next.payload)
                self.played += 1
                self._advance()
        except RideEstimationError as error:
            self._fail(error)

    def _tell_time(self, now_ns: int) -> None:
        if self._clock_ns is None or not 0 <= now_ns - self._clock_ns < CLOCK_STEP_NS:
            self._clock_ns = now_ns
            self._clock_publisher.publish(ClockMessage(clock=time_message(now_ns)))


def main(args: Sequence[str] | None = None) -> int:
    """Play one run and end; return 2 where it cannot be read."""
    return run_node(ReplayNode, lambda node: "single", args)


if __name__ == "__main__":
    sys.exit(main())
