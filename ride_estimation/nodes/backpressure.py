# Copyright 2026 ride_estimation contributors
"""What the node does when the machine cannot keep up: it says so, publishes less, and at last leaves messages out.

Messages wait in the queues of the middleware when handling them takes longer than they take to come. How far behind the node is
shows in the age of a message, its time of handling minus its stamp, above the least age of its topic. A node that is idle part of
the time has nothing waiting, whatever clocks and playback rates do, so ages count only while it is busy.

Policy: more than :data:`THIN_S` behind, only every :data:`THIN`-th due estimate is published (all are computed); more than
:data:`DROP_S` behind, the messages of all sensors are left out, counted, until the node has caught up. The time base then has
a gap like any other. Live subscriptions only: a replay in lockstep never drops.
"""

from __future__ import annotations

import dataclasses

#: how far behind [s]: publishing less begins, messages are left out, caught up
THIN_S, DROP_S, CAUGHT_UP_S = 0.25, 1.0, 0.05
#: share of the estimates published while behind: every n-th
THIN = 10
#: share of the time spent on messages below which nothing can be waiting, and the time over which it is taken [s], less than
#: :data:`THIN_S` so that a slow playback is never taken for a delay
BUSY, WINDOW_S = 0.8, 0.2
#: a stamp farther back than this is another clock [s]
_CLOCK_STEP_S = 0.5


@dataclasses.dataclass
class Load:
    """Keeps account of the time messages take; all times are seconds of one steady clock.

    Attributes
    ----------
    behind_s
        How far behind the node is.
    busy
        Share of the last window spent on messages.
    left_out
        Messages left out since the start.
    thinned
        Whether fewer estimates are published now.
    dropping
        Whether messages are left out now.
    worst_s
        Largest ``behind_s`` so far.
    """

    behind_s: float = 0.0
    busy: float = 0.0
    left_out: int = 0
    thinned: bool = False
    dropping: bool = False
    worst_s: float = 0.0
    _window: float | None = None
    _spent: float = 0.0
    _least: dict[str, float] = dataclasses.field(default_factory=dict)
    _stamps: dict[str, float] = dataclasses.field(default_factory=dict)

    def admit(self, topic: str, stamp_s: float, now_s: float) -> bool:
        """Return whether a message is to be used.

        Parameters
        ----------
        topic
            Where it came from; each has its own usual age.
        stamp_s
            Its stamp.
        now_s
            Steady time.
        """
        if self._window is None:
            self._window = now_s
        if now_s - self._window >= WINDOW_S:
            self.busy = self._spent / (now_s - self._window)
            self._window, self._spent = now_s, 0.0
            if self.busy < BUSY and not self.dropping:
                self._least.clear()
        age = now_s - stamp_s
        if stamp_s < self._stamps.get(topic, stamp_s) - _CLOCK_STEP_S:
            self._least.clear()
        self._stamps[topic] = stamp_s
        least = min(self._least.get(topic, age), age)
        self._least[topic] = least
        self.behind_s = age - least
        self.worst_s = max(self.worst_s, self.behind_s)
        self.thinned = self.behind_s > (CAUGHT_UP_S if self.thinned else THIN_S)
        self.dropping = self.behind_s > (CAUGHT_UP_S if self.dropping else DROP_S)
        self.left_out += self.dropping
        return not self.dropping

    def handled(self, began_s: float, ended_s: float) -> None:
        """Add the time one message took; a long one is a window of its own, whatever idle time was before it."""
        if ended_s - began_s > WINDOW_S:
            self._window, self._spent = began_s, 0.0
        self._spent += ended_s - began_s

    def words(self) -> str:
        """Return what the person in the field should know, empty where the node keeps up."""
        if self.dropping:
            return f"cannot keep up: {self.behind_s:.2g} s behind, messages are left out until it has caught up"
        if self.thinned:
            return f"cannot keep up: {self.behind_s:.2g} s behind, only every {THIN}th estimate is published"
        return ""
