# Copyright 2026 ride_estimation contributors
"""Load and intake on a simulated machine: publishers, queues of the middleware, an executor of one thread, no real time.

A message costs time in the handler and time in the executor, which the node cannot see. The executor keeps one entry per arrived
message of what it serves, also of those that the middleware has overwritten, as the events executor of rclpy does.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections import deque

import pytest

from ride_estimation.nodes.backpressure import DROP_S, RECENT_S, Load, LoadLevel
from ride_estimation.nodes.intake import Intake

SENSORS, DEPTH = 8, 500
#: an entry of the executor, or a look of the node, that finds nothing [s]
NOTHING_S = 5e-6
#: entry of the timer among those of the sensors
TIMER = -1


@dataclasses.dataclass
class Machine:
    """Eight sensors, one node; ``work()`` runs it to a time.

    Attributes
    ----------
    rate_hz, playback
        Of every sensor in its own time, and how much faster than real time that passes.
    handler_s, executor_s
        What a message costs.
    stalls
        Times at which the machine is taken away, and for how long [s].
    mute
        Sensors and the times between which they send nothing.
    held
        Times between which a gateway keeps all messages, to flush them sensor by sensor.
    step_s
        Jump of all stamps, at ``step_at`` [s].
    block_s
        What the last of ten messages of every sensor costs besides.
    limit
        Of the intake.
    share
        Of the time that this process may run.
    """

    rate_hz: float = 500.0
    handler_s: float = 100e-6
    executor_s: float = 10e-6
    playback: float = 1.0
    stalls: tuple[tuple[float, float], ...] = ()
    mute: tuple[int, float, float] = (-1, 0.0, 0.0)
    held: tuple[float, float] = (0.0, 0.0)
    step_at: float = 1e9
    step_s: float = 0.0
    block_s: float = 0.0
    limit: int = DEPTH
    share: float = 1.0

    def __post_init__(self) -> None:
        self.now, self.load = 0.0, Load()
        self.queues: list[deque[tuple[bytes, int]]] = [deque() for _ in range(SENSORS)]
        self.entries: deque[int] = deque()
        self.due, self.numbers = [0] * SENSORS, [0] * SENSORS
        self.kept: list[list[bytes]] = [[] for _ in range(SENSORS)]
        self.overwritten, self.most_entries = 0, 0
        self.used: list[tuple[str, float, float]] = []
        self.left_stalls = list(self.stalls)
        self.said: float | None = None
        self.lost_at: float | None = None
        self.quiet_while_losing = 0
        self.intake = Intake(self.load, int, self.limit, self.turned, lambda: self.now)
        self.served = True
        for k in range(SENSORS):
            self.intake.open(str(k), functools.partial(self.take, k), functools.partial(self.handle, str(k)))

    def pass_time(self, seconds: float) -> None:
        self.now += seconds / self.share
        if self.left_stalls and self.now >= self.left_stalls[0][0]:
            self.now += self.left_stalls.pop(0)[1]
        for k in range(SENSORS):
            while (at := (self.due[k] + k / SENSORS) / self.rate_hz / self.playback) <= self.now:
                stamp = (self.due[k] + k / SENSORS) / self.rate_hz + 1000.0 + self.step_s * (at >= self.step_at)
                self.due[k] += 1
                if k == self.mute[0] and self.mute[1] <= at < self.mute[2]:
                    continue
                payload = b"%d" % round(1e9 * stamp)
                if self.held[0] <= at < self.held[1]:
                    self.kept[k].append(payload)
                else:
                    self.flush()
                    self.send(k, payload)

    def turned(self) -> None:
        """The executor serves no input of a node that is behind; of what waits when it does again it hears at once."""
        if self.said is None and self.load.words():
            self.said = self.now
        if self.intake.behind == self.served:
            self.served = not self.served
            if self.served:
                self.entries.extend(k for k in range(SENSORS) for _ in self.queues[k])

    def flush(self) -> None:
        for k, payloads in enumerate(self.kept):
            for payload in payloads:
                self.send(k, payload)
            payloads.clear()

    def send(self, k: int, payload: bytes) -> None:
        self.numbers[k] += 1
        if len(self.queues[k]) == DEPTH:
            self.queues[k].popleft()
            self.overwritten += 1
            self.lost_at = self.now if self.lost_at is None else self.lost_at
        self.queues[k].append((payload, self.numbers[k]))
        if self.served:
            self.entries.append(k)
        self.most_entries = max(self.most_entries, len(self.entries))

    def take(self, k: int) -> tuple[bytes, int] | None:
        self.pass_time(NOTHING_S)
        return self.queues[k].popleft() if self.queues[k] else None

    def handle(self, topic: str, payload: bytes) -> None:
        self.pass_time(self.handler_s + self.block_s * (len(self.used) % (10 * SENSORS) == 0))
        self.used.append((topic, int(payload) * 1e-9 - 1000.0, self.now))

    def work(self, until: float) -> None:
        """Run the executor; an entry of a timer calls ``work`` of the intake ten times a second, as in the node."""
        timer = self.now
        while self.now < until:
            if self.now >= timer:
                timer = self.now + 0.1
                self.entries.append(TIMER)
            if self.entries:
                k = self.entries.popleft()
                if k == TIMER:
                    self.intake.work()
                elif self.queues[k]:
                    self.pass_time(self.executor_s)
                    self.intake.arrived(str(k), self.queues[k].popleft()[0])
                else:
                    self.pass_time(NOTHING_S)
            else:
                self.pass_time(1e-4)

    @property
    def unaccounted(self) -> int:
        """Messages that were sent and are neither used, nor counted as left out or lost, nor still waiting."""
        waiting = sum(map(len, self.queues)) + sum(len(s.waiting) for s in self.intake._sources.values())
        return sum(self.numbers) - len(self.used) - self.load.left_out.total() - self.load.lost.total() - waiting


@pytest.mark.parametrize(("handler_s", "executor_s"), [(250e-6, 80e-6), (200e-6, 60e-6), (400e-6, 80e-6)])
def test_a_queue_that_overflows_is_said_by_ages_alone(handler_s: float, executor_s: float) -> None:
    """Without the intake: 4000 messages a second, queues of 500 that overwrite; only ages tell."""
    load, waiting, due = Load(), [deque() for _ in range(SENSORS)], [0] * SENSORS
    now, lost_at, said = 1000.0, None, None
    while now < 1012.0:
        for k in range(SENSORS):
            while 1000.0 + due[k] * 0.002 <= now:
                if len(waiting[k]) == DEPTH:
                    waiting[k].popleft()
                    lost_at = lost_at or now
                waiting[k].append(1000.0 + due[k] * 0.002)
                due[k] += 1
        k = min((k for k in range(SENSORS) if waiting[k]), key=lambda k: waiting[k][0], default=-1)
        if k < 0:
            now += 1e-4
            continue
        now += executor_s
        began, used = now, load.admit(str(k), waiting[k].popleft(), now)
        now += handler_s if used else 2e-6
        load.handled(began, now)
        said = said or (now if load.words() else None)
        if said and now > said + 1.0:
            assert load.words(), now
    assert said is not None
    assert said < 1002.0
    assert lost_at is None or said < lost_at


@pytest.mark.parametrize(("handler_s", "executor_s"), [(250e-6, 80e-6), (200e-6, 60e-6), (400e-6, 80e-6), (2e-3, 80e-6)])
def test_overload_is_said_within_two_seconds_and_every_message_is_counted(handler_s: float, executor_s: float) -> None:
    machine = Machine(handler_s=handler_s, executor_s=executor_s)
    machine.work(10.0)
    late = handler_s + NOTHING_S > 1.0 / 4000.0  # the executor costs nothing any more
    assert late == (machine.said is not None)
    assert machine.overwritten == 0, "what cannot be used is left out by the node, not lost in the middleware"
    assert machine.unaccounted == 0
    assert machine.most_entries < 4000 * 0.3, "the queue of the executor stays short"
    assert max(ended - stamp for _, stamp, ended in machine.used) < DROP_S + 0.2
    if late:
        assert machine.said is not None
        assert machine.said < 2.0
        assert machine.load.level >= LoadLevel.LATE
        assert "cannot keep up" in machine.load.words()


@pytest.mark.parametrize("share", [0.3, 0.1, 0.05])
def test_a_process_that_hardly_runs_keeps_the_line_of_the_executor_short_and_says_so_in_two_seconds(share: float) -> None:
    """Entries that find nothing cost as much as the process may run: they must not be made."""
    machine = Machine(share=share, handler_s=95e-6, block_s=3e-3, executor_s=30e-6)
    machine.work(20.0)
    assert machine.most_entries < 4000 * 0.5
    assert machine.said is not None
    assert machine.said < 2.0
    assert machine.unaccounted == 0


def test_load_is_never_said_to_be_fine_while_messages_are_lost_and_it_is_afterwards() -> None:
    """The process stands still for three seconds, of which the queues hold one."""
    machine = Machine(stalls=((5.0, 3.0),), handler_s=50e-6, block_s=4e-3)
    machine.work(8.1)
    assert machine.overwritten > 7000
    assert machine.load.lost.total() == machine.overwritten
    assert machine.load.level == LoadLevel.LOSES
    assert "by no fault of the sensors" in machine.load.words()
    machine.work(8.1 + RECENT_S + 1.0)
    assert machine.unaccounted == 0
    assert machine.load.level == LoadLevel.KEEPS_UP
    assert machine.load.words() == ""


@pytest.mark.parametrize(
    "machine",
    [
        Machine(),
        Machine(handler_s=200e-6),
        Machine(handler_s=50e-6, block_s=8e-3),
        Machine(rate_hz=100.0, handler_s=300e-6, executor_s=100e-6),
        Machine(stalls=tuple((0.5 + k, 0.3) for k in range(9))),
        Machine(playback=0.25),
        Machine(rate_hz=100.0, playback=4.0),
        Machine(step_at=3.0, step_s=-60.0),
        Machine(step_at=3.0, step_s=5.0),
        Machine(mute=(3, 2.0, 4.0)),
    ],
    ids=["plain", "busy", "blocks", "slow sensors", "stalls", "slow playback", "quick playback", "back", "ahead", "mute"],
)
def test_a_node_that_keeps_up_stays_quiet_and_uses_every_message(machine: Machine) -> None:
    machine.work(10.0)
    assert machine.said is None
    assert machine.load.level == LoadLevel.KEEPS_UP
    assert machine.load.left_out.total() == machine.load.lost.total() == machine.overwritten == machine.unaccounted == 0


def test_a_stall_that_is_caught_up_slowly_is_said_and_loses_nothing() -> None:
    machine = Machine(stalls=((2.0, 0.9),), handler_s=180e-6)
    machine.work(3.5)
    assert machine.load.level == LoadLevel.LATE
    machine.work(10.0)
    assert machine.load.level == LoadLevel.KEEPS_UP
    assert machine.load.left_out.total() == machine.overwritten == machine.unaccounted == 0


def test_what_a_gateway_held_back_and_flushes_sensor_by_sensor_is_used_in_the_order_of_stamps() -> None:
    machine = Machine(rate_hz=100.0, held=(3.0, 5.0))
    machine.work(8.0)
    assert machine.said is None
    assert machine.load.left_out.total() == machine.unaccounted == 0
    stamps = [stamp for _, stamp, _ in machine.used]
    assert max(a - b for a, b in itertools.pairwise(stamps)) < 0.5, "no sensor is handed on as a whole before the next"


def test_a_publisher_that_is_started_again_or_one_of_several_is_no_loss() -> None:
    load, waiting = Load(), deque()
    intake = Intake(load, int, DEPTH, lambda: 0.0)
    intake.open("a", lambda: waiting.popleft() if waiting else None, lambda _: None)
    for numbers, publishers in (((7, 8, 9), 1), ((1, 2), 1), ((10, 500, 11, 501), 2), ((12, 13), 1), ((0, 0), 1), ((20, 21), 1)):
        intake.take_note_of_publishers("a", publishers)
        waiting.extend((b"1", number) for number in numbers)
        intake.work()
    assert not load.lost
    waiting.extend([(b"1", 24), (b"1", 25)])
    intake.work()
    assert load.lost == {"a": 2}


def test_more_than_may_wait_is_left_out_oldest_first_and_counted() -> None:
    machine = Machine(rate_hz=500.0, held=(1.0, 1.8), limit=300, handler_s=50e-6)
    machine.work(4.0)
    assert len(machine.load.left_out) == SENSORS
    assert machine.unaccounted == 0
    assert machine.load.level == LoadLevel.LOSES


def test_what_waits_when_a_topic_is_closed_is_counted() -> None:
    machine = Machine(handler_s=2e-3)
    machine.work(0.3)
    machine.intake.close_all()
    assert machine.load.left_out.total() > 0
    assert machine.unaccounted == 0
