# Copyright 2026 ride_estimation contributors
"""Which stage a long job is in, a line each; on a terminal a bar for the stage that can be counted."""

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


class Stages:
    """The stages of one job, one after the other, on stderr."""

    def __init__(self) -> None:
        self._bar: Progress | None = None
        self._name = ""

    def begin(self, name: str) -> None:
        """Say that a stage begins, in a line of its own."""
        self.close()
        self._name = name
        print(f"{name} ...", file=sys.stderr, flush=True)

    def advance(self, done: float, total: float) -> None:
        """Add finished work of the present stage."""
        self._bar = self._bar or Progress(total, self._name)
        self._bar.update(done)

    def close(self) -> None:
        """End the present stage."""
        if self._bar is not None:
            self._bar.close()
        self._bar = None
