# Copyright 2026 ride_estimation contributors
"""What the node does when the machine cannot keep up: it says so, publishes less, at last leaves messages out, and counts them.

Messages wait when handling them takes longer than they take to come. How far behind the node is shows in the age of a message,
its time of handling minus its stamp, above the least age of its topic since nothing was waiting. Clocks, playback rates and
messages that somebody held back change ages too, but not while messages wait here; so every look that finds nothing waiting
makes the present ages the normal ones.

Policy: behind for :data:`SATURATED_S` without a break, only every :data:`THIN`-th due estimate is published (all are computed);
more than :data:`DROP_S` behind, the messages of all sensors are left out until the node has caught up. The time base then has
a gap like any other. Live subscriptions only: a replay in lockstep never leaves anything out.
"""

from __future__ import annotations

import dataclasses
import enum
from collections import Counter

#: how far behind is late [s]; being late for this long without a break is more than a passing stall [s]
LATE_S, SATURATED_S = 0.05, 0.5
#: how far behind messages are left out [s]
DROP_S = 1.0
#: share of the estimates published while saturated: every n-th
THIN = 10
#: a message lost or left out counts as the present state for so long [s], longer than the usual time between two reports
RECENT_S = 5.0
#: a stamp farther back than this is another clock [s]
_CLOCK_STEP_S = 0.5


class LoadLevel(enum.IntEnum):
    """How the node keeps up: well, late, messages are lost."""

    KEEPS_UP = 0
    LATE = 1
    LOSES = 2


@dataclasses.dataclass
class Load:
    """Keeps account of waiting, left out and lost messages; all times are seconds of one steady clock.

    Attributes
    ----------
    behind_s
        How far behind the node is.
    worst_s
        Largest ``behind_s`` so far.
    left_out
        Messages left out because the node was too far behind, by topic.
    lost
        Messages that were sent but lost before the node could take them, by topic.
    thinned
        Whether fewer estimates are published now.
    dropping
        Whether messages are left out now.
    busy, processor
        Shares of the last second or so: time spent on messages, and processor time that the machine gave this process.
    """

    behind_s: float = 0.0
    worst_s: float = 0.0
    left_out: Counter[str] = dataclasses.field(default_factory=Counter)
    lost: Counter[str] = dataclasses.field(default_factory=Counter)
    thinned: bool = False
    dropping: bool = False
    busy: float = 0.0
    processor: float = 0.0
    _spent: float = 0.0
    _measured: tuple[float, float] | None = None
    _now: float = 0.0
    _late_since: float | None = None
    _left_out_at: float | None = None
    _lost_at: float | None = None
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
        self._now = now_s
        age = now_s - stamp_s
        if stamp_s < self._stamps.get(topic, stamp_s) - _CLOCK_STEP_S:
            self._least.clear()
        self._stamps[topic] = stamp_s
        least = min(self._least.get(topic, age), age)
        self._least[topic] = least
        self.behind_s = age - least
        self.worst_s = max(self.worst_s, self.behind_s)
        late = self.behind_s > LATE_S
        if not late:
            self._late_since = None
        elif self._late_since is None:
            self._late_since = now_s
        self.thinned = self._late_since is not None and now_s - self._late_since >= SATURATED_S
        self.dropping = late if self.dropping else self.behind_s > DROP_S
        if self.dropping:
            self.leave_out(topic)
        return not self.dropping

    def leave_out(self, topic: str, count: int = 1) -> None:
        """Count messages that are not used because too many wait."""
        if count:
            self.left_out[topic] += count
            self._left_out_at = self._now

    def lose(self, topic: str, count: int, now_s: float) -> None:
        """Count messages that were sent and never came."""
        self._now = now_s
        self.lost[topic] += count
        self._lost_at = now_s

    def caught_up(self, now_s: float) -> None:
        """Take note that no message is waiting: the present ages are the normal ones."""
        self._now = now_s
        self._least.clear()
        self._late_since = None
        self.behind_s = 0.0
        self.thinned = self.dropping = False

    def handled(self, began_s: float, ended_s: float) -> None:
        """Add the time one message took."""
        self._spent += ended_s - began_s

    def measure(self, now_s: float, processor_s: float) -> None:
        """Take the shares of the time since the last call; ``processor_s`` is the processor time of the process [s]."""
        if self._measured is not None and now_s > self._measured[0]:
            passed = now_s - self._measured[0]
            self.busy, self.processor = self._spent / passed, (processor_s - self._measured[1]) / passed
        self._measured, self._spent = (now_s, processor_s), 0.0

    @property
    def level(self) -> LoadLevel:
        """Return how the node keeps up now."""
        if self._recent(self._left_out_at) or self._recent(self._lost_at):
            return LoadLevel.LOSES
        return LoadLevel.LATE if self.thinned else LoadLevel.KEEPS_UP

    def words(self) -> str:
        """Return what the person in the field should know, empty where the node keeps up."""
        found = []
        if self._recent(self._left_out_at):
            found.append(f"cannot keep up, messages of all sensors are left out ({self.left_out.total()} so far)")
        elif self.thinned:
            found.append("cannot keep up")
        if self._recent(self._lost_at):
            found.append(
                f"messages are lost between the publishers and this node ({self.lost.total()} so far), by no fault of the sensors"
            )
        if self.thinned:
            found.append(f"{self.behind_s:.2g} s behind, only every {THIN}th estimate is published")
        return "; ".join(found)

    def _recent(self, moment: float | None) -> bool:
        return moment is not None and self._now - moment < RECENT_S
