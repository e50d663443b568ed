# Copyright 2026 ride_estimation contributors
"""Copies of what was learned one to two seconds ago: a sensor is found to be faulty later than it became so."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ride_estimation.estimation.common.saved_state import all_finite

#: distance of two copies [s]; the older is taken when a sensor turns out to be faulty
_DISTANCE = 1.0


class LearnedCopies:
    """The last two copies of what was learned and of the deflections."""

    def __init__(self) -> None:
        #: how often what was learned was taken back
        self.taken = 0
        self._next = 0.0
        self.clear()

    def clear(self) -> None:
        """Forget the copies."""
        self._learned: list[dict[str, Any]] = []
        self._calm: list[dict[str, Any]] = []

    def keep(self, now: float, learned: Callable[[], dict[str, Any]], deflections: Callable[[], dict[str, Any]]) -> None:
        """Take new copies where they are due.

        Parameters
        ----------
        now
            Time of the run [s].
        learned, deflections
            Give what is copied.

        Raises
        ------
        FloatingPointError
            What was learned is not finite.
        """
        if now >= self._next:
            self._next, found = now + _DISTANCE, learned()
            if not all_finite(found):
                raise FloatingPointError("what was learned is not finite")
            self._learned = [*self._learned[-1:], found]
            self._calm = [*self._calm[-1:], deflections()]

    def deflections(self) -> dict[str, Any] | None:
        """Return the older copy of the deflections, None without one; the newer is dropped."""
        self._calm = self._calm[:1]
        return self._calm[0] if self._calm else None

    def checkpoint(self, now: float) -> dict[str, Any] | None:
        """Return the older copy of what was learned, None without one; the newer is dropped."""
        self._learned = self._learned[:1]
        if not self._learned:
            return None
        self._next = now + _DISTANCE
        return self._learned[0]

    def take(self, now: float) -> dict[str, Any] | None:
        """Return the :meth:`checkpoint` to go back to for a faulty sensor, and count that."""
        found = self.checkpoint(now)
        self.taken += found is not None
        return found
