# Copyright 2026 ride_estimation contributors
"""How long nothing came, on the steady clock: what stops all at once has nobody beside it to be compared with."""

from __future__ import annotations

import dataclasses

#: time between two looks [s]
LOOK_PERIOD_S = 0.1
#: what one look counts at most [s]: a node that was busy for longer was not able to hear, and what came meanwhile still waits
LONGEST_LOOK_S = 2.0 * LOOK_PERIOD_S
#: silence in usual intervals that is too long for what comes slowly or in bursts: one lost message is no silence
INTERVALS = 3.0
#: share of the newest interval in the usual one, and what is usual until something else is seen [s]
_NEWEST, _FIRST_S = 0.2, 1.0


@dataclasses.dataclass
class Silence:
    """Time for which a count has not risen; begins when it rises for the first time.

    Attributes
    ----------
    seconds
        Length of the present silence [s].
    too_long
        Whether it was beyond the limit at the last look.
    """

    seconds: float = 0.0
    too_long: bool = False
    _count: int = 0
    _interval: float = _FIRST_S

    def look(self, count: int, passed_s: float, limit_s: float) -> bool:
        """Return whether silence began or ended.

        Parameters
        ----------
        count
            What rises while all is well.
        passed_s
            Time since the last look [s].
        limit_s
            Longest silence that is nothing unusual [s]; at least :data:`INTERVALS` usual intervals are none.
        """
        before = self.too_long
        if count:
            self.seconds += min(passed_s, LONGEST_LOOK_S)
        if count != self._count:
            self._interval += _NEWEST * (self.seconds - self._interval) if self._count else 0.0
            self.seconds, self._count = 0.0, count
        self.too_long = self.seconds > max(limit_s, INTERVALS * self._interval)
        return self.too_long != before

    def forgive(self) -> None:
        """Begin again: nobody listened until now."""
        self.seconds, self.too_long = 0.0, False
