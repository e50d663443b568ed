# Copyright 2026 ride_estimation contributors
"""Play a recorded run onto its topics with ``/clock``, as raw bytes, and end; the stamps stay those of the recording.

For a replay that must equal the offline one bit by bit use ``ride-estimation replay`` or :mod:`ride_estimation.nodes.lockstep`.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator, Sequence
from typing import Unpack

from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock as ClockMessage

from ride_estimation.errors import ConfigurationError, RideEstimationError
from ride_estimation.io.playback import RecordedMessage, playable_topics, recorded_messages
from ride_estimation.nodes import qos
from ride_estimation.nodes.conversions import time_message
from ride_estimation.nodes.executors import run_node
from ride_estimation.nodes.inputs import MESSAGE_CLASSES
from ride_estimation.nodes.parameters import NodeOptions, NodeParameter, declare, values

TABLE: tuple[NodeParameter, ...] = (
    NodeParameter("bag", "", "", "run to play: rosbag2 folder, .mcap, .db3 or ROS 1 .bag", read_only=True),
    NodeParameter("rate", 1.0, "-", "speed, 1 is real time", 0.01, 100.0, read_only=True),
    NodeParameter(
        "wait_for_subscribers", 10.0, "s", "longest wait for subscribers; 0 waits for ever", 0.0, 3600.0, read_only=True
    ),
    NodeParameter("wait_for_node", "", "", "full name of the node whose subscriptions count; empty counts all", read_only=True),
)

#: how often due messages are published [s]
STEP_S = 0.001
#: data time between two /clock messages [ns]
CLOCK_STEP_NS = 5_000_000
#: a subscriber sees a new publisher a moment after the publisher sees it [s]
MATCH_S = 0.5
#: time without a further subscriber after which those there are are all that come [s]: a run may hold topics nobody wants
SETTLED_S = 2.0
#: time between two looks at who subscribes, and between two lines about the wait [s]
LOOK_S, REMIND_S = 0.05, 10.0
#: longest wait at the end until reliable subscribers have everything [s]: what is sent again is lost with the player
DELIVERY_S = 10.0
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
        wait = float(given["wait_for_subscribers"])
        self._wanted = str(given["wait_for_node"]).strip("/")
        self._give_up = time.monotonic() + wait if wait else math.inf
        self._audience: frozenset[str] = frozenset()
        self._audience_since = self._looked = -math.inf
        self._reminded = time.monotonic() - REMIND_S + SETTLED_S  # the first line when waiting takes longer than usual
        try:
            self._open(str(given["bag"]))
        except RideEstimationError as error:
            self._fail(error)
        self._timer = self.create_timer(STEP_S, self.step, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _open(self, bag: str) -> None:
        if not bag:
            raise ConfigurationError("bag: not given; wanted is a rosbag2 folder, .mcap, .db3 or ROS 1 .bag: -p bag:=my_run")
        types = playable_topics(bag)
        for topic, kind in types.items():
            self._topics[topic] = self.create_publisher(MESSAGE_CLASSES[kind], topic, qos.output(QUEUE))
        self._messages = recorded_messages(bag, types)
        self._advance()

    def _fail(self, error: RideEstimationError) -> None:
        self.get_logger().error(str(error))
        self.finished, self.exit_code = True, 2

    def _advance(self) -> None:
        self._next = next(self._messages, None)
        if self._next is None:
            self._deliver()
            self.finished = True
            self.get_logger().info(f"played {self.played} messages")

    def _deliver(self) -> None:
        """Wait until every reliable subscriber has what was sent, and say where one has not."""
        end = time.monotonic() + DELIVERY_S
        late = [
            topic
            for topic, publisher in self._topics.items()
            if not publisher.wait_for_all_acked(Duration(seconds=max(end - time.monotonic(), 0.0)))
        ]
        if late:
            self.get_logger().warning(f"a subscriber has not taken all messages of {', '.join(late)}")

    def _ready(self, now: float) -> bool:
        """Return whether to play: whoever is waited for listens, or the wait is over."""
        if self._started is not None:
            return True
        if now - self._looked < LOOK_S:
            return False
        self._looked = now
        audience = frozenset(topic for topic in self._topics if self._heard(topic))
        if audience != self._audience:
            self._audience, self._audience_since = audience, now
        whole = len(audience) == len(self._topics)
        settled = bool(audience) and now - self._audience_since >= (MATCH_S if whole else SETTLED_S)
        if not settled and now < self._give_up:
            self._remind(now)
            return False
        if not whole:
            unheard = ", ".join(topic for topic in self._topics if topic not in audience)
            who = f"{self._who} does not listen" if self._wanted else "nobody listens"
            self.get_logger().warning(f"{who} to {unheard}; playing anyway")
        self._started = (now, self._next.arrival_ns if self._next else 0)
        return True

    @property
    def _who(self) -> str:
        return f"/{self._wanted}" if self._wanted else "anybody"

    def _heard(self, topic: str) -> bool:
        if not self._wanted:
            return self._topics[topic].get_subscription_count() > 0
        names = (f"{s.node_namespace}/{s.node_name}".strip("/") for s in self.get_subscriptions_info_by_topic(topic))
        return self._wanted in names

    def _remind(self, now: float) -> None:
        if now - self._reminded >= REMIND_S:
            self._reminded = now
            count = len(self._topics) - len(self._audience)
            self.get_logger().info(f"waiting for {self._who} to subscribe to {count} of {len(self._topics)} topics")

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
