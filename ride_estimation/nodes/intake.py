# Copyright 2026 ride_estimation contributors
"""Takes live messages out of the middleware before its queues overflow and hands them on in the order of their stamps.

The executor calls back for one message at a time. When the estimator is slower than its inputs, messages pile up in the queues
of the middleware, which overwrite the oldest without a word, and the events executor keeps an entry for each of them, without
limit and in line with timers and services. Here every call may take all that is waiting, what has to wait waits in one queue
with a limit, and whatever is left out is counted. A node that is behind takes its inputs away from the executor until it has
caught up (:attr:`Intake.behind`): a timer looks for messages then, and nothing is in line before it. The middleware numbers the
messages of a publisher; a number that is missing is a message that was sent and lost on the way, which a sensor that stops
sending is not.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from ride_estimation.nodes.backpressure import Load

#: longest time between two looks whether messages are waiting [s]: far less than any queue of the middleware lasts
LOOK_S = 0.02
#: longest stay in one call, so that services and timers have their turn, and longest time without a look that finds nothing
#: before the node counts as behind [s]
STAY_S = 0.1
#: looks in one call beside those that are due: of messages sent together one is in hand and the others wait, which is no backlog
_LOOKS = 3

#: uses a message: payload
Handle = Callable[[bytes], object]
#: takes the next waiting message of a topic: payload and number of the publication (0 where there is none), None if none waits
Take = Callable[[], "tuple[bytes, int] | None"]
#: stamp of a payload [ns], None where it has none
StampOf = Callable[[bytes], "int | None"]


class _Source:
    """One topic: what waits, and the numbers of its publications."""

    def __init__(self, take: Take, handle: Handle) -> None:
        self.take = take
        self.handle = handle
        self.waiting: deque[tuple[int, bytes]] = deque()
        self.number: int | None = None
        self.without_number = 0
        self.publishers = 1

    def missing(self, number: int) -> int:
        """Return how many messages were lost before the one of this number."""
        before, between = self.number, self.without_number
        # several publishers count each for themselves, and the middleware does not say whose number it is
        self.number, self.without_number = number if number > 0 and self.publishers == 1 else None, 0
        # a publisher that was started again counts from the beginning
        return 0 if before is None or self.number is None else max(0, number - before - 1 - between)


class Intake:
    """The messages between the middleware and the estimator.

    Parameters
    ----------
    load
        Decides which messages are used, and counts the others.
    stamp_of
        Reads the stamp of a payload.
    limit
        Messages per topic that may wait here; the oldest are left out beyond it.
    turned
        Is called when the node falls behind or has caught up, and when it keeps up better or worse than before.
    clock
        Steady time [s].
    """

    def __init__(
        self,
        load: Load,
        stamp_of: StampOf,
        limit: int,
        turned: Callable[[], object] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._load = load
        self._stamp_of = stamp_of
        self._limit = limit
        self._turned = turned
        self._clock = clock
        self._sources: dict[str, _Source] = {}
        self._looked = self._caught_up = clock() - LOOK_S
        self._backlog = False
        self._behind = False
        self._told = False, load.level

    @property
    def behind(self) -> bool:
        """Return whether the node is behind: the executor must not wait for messages then, see :meth:`work`."""
        return self._behind

    def open(self, topic: str, take: Take, handle: Handle) -> None:
        """Begin with a topic whose waiting messages ``take`` returns and ``handle`` uses."""
        self.close(topic)
        self._sources[topic] = _Source(take, handle)

    def close(self, topic: str) -> None:
        """End with a topic; what still waits of it is left out and counted."""
        source = self._sources.pop(topic, None)
        if source is not None:
            self._load.leave_out(topic, len(source.waiting))

    def close_all(self) -> None:
        """End with every topic."""
        for topic in list(self._sources):
            self.close(topic)

    def take_note_of_publishers(self, topic: str, count: int) -> None:
        """Take note of how many publishers a topic has: numbers of others say nothing about those before."""
        source = self._sources.get(topic)
        if source is not None and source.publishers != count:
            source.publishers, source.number = count, None

    def arrived(self, topic: str, payload: bytes) -> None:
        """Take a message from the executor; it and all that waits is handed on, as far as time allows.

        What the executor still has in line when the node falls behind only joins the queue.
        """
        source = self._sources.get(topic)
        if source is None:
            return
        source.without_number += 1
        now = self._clock()
        if self._behind:
            self._put(topic, source, payload)
        elif self._backlog or now - self._looked >= LOOK_S:
            self._put(topic, source, payload)
            self.work()
        else:
            self._hand_on(topic, source, self._stamp_of(payload), payload, now)

    def work(self) -> None:
        """Hand on what waits, oldest stamp first, until nothing does or the time for one call is over.

        Called ten times a second too: nothing waits for a message that does not come, and while the node is behind nobody else
        takes messages.
        """
        self._behind = not self._caught_up_in_time()
        self._tell()

    def _tell(self) -> None:
        state = self._behind, self._load.level
        if state != self._told:
            self._told = state
            self._turned()

    def _caught_up_in_time(self) -> bool:
        """Hand on what waits; return whether nothing waited a short time ago."""
        began = now = self._clock()
        looks = 0
        while now - began < STAY_S:
            if now - self._looked >= LOOK_S or (not self._backlog and looks < _LOOKS):
                self._look(now)
                looks += 1
                if not self._backlog:
                    self._caught_up = now
                    self._load.caught_up(now)
                    return True
            if not self._backlog:
                break
            _, topic = min((s.waiting[0][0], topic) for topic, s in self._sources.items() if s.waiting)
            source = self._sources[topic]
            stamp, payload = source.waiting.popleft()
            self._backlog = any(s.waiting for s in self._sources.values())
            used = self._hand_on(topic, source, stamp, payload, now)
            self._tell()  # before the messages that wait are taken, which may take long
            if not used:
                self._leave_out_all(now)
            now = self._clock()
        return now - self._caught_up <= STAY_S

    def _look(self, now: float) -> None:
        """Take over the messages that wait in the middleware, of every topic as many as may wait here."""
        self._looked = now
        for topic, source in self._sources.items():
            for _ in range(self._limit):
                payload = self._take(topic, source, now)
                if payload is None:
                    break
                self._put(topic, source, payload)

    def _leave_out_all(self, now: float) -> None:
        """Leave out whatever waits here and in the middleware, at the price of taking it: the node has caught up."""
        for topic, source in self._sources.items():
            count = len(source.waiting)
            source.waiting.clear()
            while count < self._limit and self._take(topic, source, now) is not None:
                count += 1
            self._load.leave_out(topic, count)
        self._backlog = False

    def _take(self, topic: str, source: _Source, now: float) -> bytes | None:
        """Return the next payload that waits in the middleware, None where none does; count what is missing before it."""
        taken = source.take()
        if taken is None:
            return None
        payload, number = taken
        lost = source.missing(number)
        if lost:
            self._load.lose(topic, lost, now)
        return payload

    def _put(self, topic: str, source: _Source, payload: bytes) -> None:
        if len(source.waiting) >= self._limit:
            source.waiting.popleft()
            self._load.leave_out(topic)
        stamp = self._stamp_of(payload)
        # what has no stamp is refused at once
        source.waiting.append((0 if stamp is None else stamp, payload))
        self._backlog = True

    def _hand_on(self, topic: str, source: _Source, stamp: int | None, payload: bytes, now: float) -> bool:
        """Use a message; return whether the node is not too far behind for it."""
        if stamp and not self._load.admit(topic, stamp * 1e-9, now):
            return False
        source.handle(payload)
        self._load.handled(now, self._clock())
        return True
