# Copyright 2026 ride_estimation contributors
"""How far a long job is, on stderr: which stage, percent of the whole, seconds; never silent for more than five seconds.

Whatever the stage, it says when kernels are being compiled, which happens once on a machine and is no part of any usual share.
On a terminal one line per stage is drawn anew as it goes on; in a log, a notebook or a pipe a line is written when a stage begins
and every four seconds.
"""

from __future__ import annotations

import shutil
import sys
import threading
import time
from collections.abc import Mapping
from types import TracebackType

from ride_estimation.jit import compiling

#: time between two looks at the clock [s]: a terminal is drawn anew, a log gets a line
_REDRAW_S, _LINE_S = 0.2, 4.0
#: characters of the bar, and the fewest where words need the place
_WIDTH, _LEAST_WIDTH = 30, 8


class Progress:
    """Show how far a job is, while the block runs.

    Parameters
    ----------
    label
        What is being done.
    total
        Amount of work in any unit.
    shares
        For jobs of several stages the usual share of the time by stage, in order; a stage that is not listed counts nothing.
    """

    def __init__(self, label: str, total: float = 1.0, shares: Mapping[str, float] | None = None) -> None:
        self._label, self._total, self._shares = label, total, dict(shares or {"": 1.0})
        self._stage, self._before, self._done = "", 0.0, 0.0
        self._stream = sys.stderr
        self._terminal = self._stream.isatty()
        self._drawn = 0
        self._started = time.monotonic()
        self._ended, self._lock = threading.Event(), threading.Lock()
        self._clock = threading.Thread(target=self._tick, daemon=True)

    def __enter__(self) -> Progress:
        self._clock.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._ended.set()
        self._clock.join()
        if self._terminal:
            if kind is None:
                self._before, self._done = 1.0, 0.0
                self._show()
            self._end_line()

    def begin(self, stage: str) -> None:
        """Say that a stage begins."""
        with self._lock:
            self._before += self._shares.get(self._stage, 0.0)
            self._stage, self._done = stage, 0.0
            self._end_line()
            self._show()

    def update(self, amount: float) -> None:
        """Add finished work."""
        self._done += amount

    def reach(self, share: float) -> None:
        """Say which share of the present stage is done."""
        self._done = share * self._total

    def advance(self, done: float, total: float) -> None:
        """Add finished work of a stage whose amount of work is known by now."""
        self._total = total
        self._done += done

    def _tick(self) -> None:
        while not self._ended.wait(_REDRAW_S if self._terminal else _LINE_S):
            with self._lock:
                self._show()

    def _show(self) -> None:
        within = min(self._done / max(self._total, 1e-12), 1.0)
        share = min(self._before + self._shares.get(self._stage, 0.0) * within, 1.0)
        words = f"{100 * share:3.0f} %  {time.monotonic() - self._started:4.0f} s  {self._stage}".rstrip()
        if compiling():
            words += " (compiling for this machine, once)"
        if not self._terminal:
            print(f"{self._label}: {words}", file=self._stream, flush=True)
            return
        # a line that goes on below is not drawn anew by a carriage return
        columns = shutil.get_terminal_size().columns - 1
        bar = min(_WIDTH, max(columns - len(self._label) - len(words) - 4, _LEAST_WIDTH))
        line = f"{self._label} [{'#' * round(bar * share):<{bar}}] {words}"[:columns]
        print(f"\r{line:<{self._drawn}}", end="", file=self._stream, flush=True)
        self._drawn = len(line)

    def _end_line(self) -> None:
        if self._drawn:
            print(file=self._stream)
        self._drawn = 0
