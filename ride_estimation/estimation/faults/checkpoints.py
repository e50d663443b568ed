# Copyright 2026 ride_estimation contributors
"""Copies of what was learned some time ago: a sensor is found to be faulty later than it became so."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ride_estimation.estimation.common.saved_state import all_finite

#: distance of two copies [s]
_DISTANCE = 1.0
#: how far they go back [s]; the newest that is older than the fault is taken
_DEPTH = 30.0


class Checkpoints:
    """Copies of what was learned and of the deflections, one a second."""

    def __init__(self) -> None:
        #: how often what was learned was taken back
        self.taken = 0
        self._next = 0.0
        self.clear()

    def clear(self) -> None:
        """Forget the copies."""
        #: time, what was learned, deflections
        self._kept: list[tuple[float, dict[str, Any], dict[str, Any]]] = []

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
                raise FloatingPointError("the estimates are not finite")
            self._kept = [*(c for c in self._kept if c[0] > now - _DEPTH), (now, found, deflections())]

    def take(self, now: float, spoiled: float) -> tuple[dict[str, Any], dict[str, Any]] | None:
        """Return what was learned, and the deflections, before a fault; None without a copy of then. Newer ones are dropped.

        Parameters
        ----------
        now
            Time of the run [s].
        spoiled
            How long ago the fault may have begun [s]; the oldest copy serves where that is not known to be more than a second.
        """
        before = now - max(spoiled, _DISTANCE)
        older = [c for c in self._kept if c[0] <= before]
        self._kept = older or (self._kept[:1] if spoiled <= _DISTANCE else [])
        if not self._kept:
            return None
        self._next = now + _DISTANCE
        self.taken += 1
        return self._kept[-1][1:]

    def checkpoint(self) -> dict[str, Any] | None:
        """Return what was learned until a second or more ago, None without a copy of then; the newest copy is dropped."""
        self._kept = self._kept[:-1] or self._kept
        return self._kept[-1][1] if self._kept else None
