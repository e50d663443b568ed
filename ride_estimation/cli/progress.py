# Copyright 2026 ride_estimation contributors
"""A plain progress line on a terminal; silent where stderr is not one."""

from __future__ import annotations

import sys
import time


class Progress:
    """Show how far a long job is.

    Parameters
    ----------
    total
        Amount of work in any unit.
    label
        What is being done.
    """

    def __init__(self, total: float, label: str) -> None:
        self._total = max(float(total), 1e-12)
        self._label = label
        self._done = 0.0
        self._started = self._shown = time.monotonic()
        self._terminal = sys.stderr.isatty()

    def update(self, amount: float) -> None:
        """Add finished work and redraw at most ten times a second."""
        self._done += amount
        now = time.monotonic()
        if self._terminal and now - self._shown > 0.1:
            self._shown = now
            share = min(self._done / self._total, 1.0)
            bar = "#" * round(30 * share)
            print(f"\r{self._label} [{bar:<30}] {100 * share:3.0f} % {now - self._started:5.1f} s", end="", file=sys.stderr)

    def close(self) -> None:
        """Finish the line."""
        if self._terminal:
            print(f"\r{self._label} [{'#' * 30}] 100 % {time.monotonic() - self._started:5.1f} s", file=sys.stderr)
