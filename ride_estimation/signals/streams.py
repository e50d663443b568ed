# Copyright 2026 ride_estimation contributors
"""One stream of stamped samples: what is declared of it, its ring buffer, its counters, and the blocks it ends up in."""

from __future__ import annotations

import bisect
import dataclasses
import itertools
from array import array
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.signals.correction import NO_CORRECTION, Correction

Array = NDArray[np.float64]

NANOSECONDS = 1_000_000_000
#: largest magnitude of a sample of unknown quantity [SI]: no sensor of a vehicle gives more, and its square is a number
LARGEST = 1e9
#: samples of a stream kept before the newest emitted tick, the support of the next interpolation
KEEP = 4
#: samples at or after the last tick of a block that complete it; more where one of them seems to be still on its way
LEAST, MOST = 2, 4


@dataclasses.dataclass(frozen=True)
class StreamSpec:
    """What the aligner needs to know of one sensor.

    Attributes
    ----------
    name
        Sensor name.
    channels
        Values per sample.
    waited_for
        Whether a block waits for this stream. A slow auxiliary stream (vehicle speed) is not waited for: its last value
        is held.
    reference
        Whether it may define rate and phase of the time base (accelerometers).
    correction
        Known errors of the sensor, put right on the way to the time base.
    largest
        Largest magnitude any such sensor can give, per channel; empty: :data:`LARGEST` for all.
    """

    name: str
    channels: int
    waited_for: bool = True
    reference: bool = True
    correction: Correction = NO_CORRECTION
    largest: tuple[float, ...] = ()


@dataclasses.dataclass(frozen=True)
class Block:
    """Some ticks of the common time base.

    Attributes
    ----------
    start_ns, step_ns
        Stamp of the first tick and distance of ticks [ns].
    values
        Shape (T, sum of channels), finite everywhere (the last value is held where nothing is valid).
    valid
        Shape (T, streams).
    restart
        Not empty where the time base begins anew with this block: the reason in words.
    """

    start_ns: int
    step_ns: int
    values: Array
    valid: NDArray[np.bool_]
    restart: str = ""

    @property
    def stamps_ns(self) -> NDArray[np.int64]:
        """Return the stamp of every tick, shape (T,) [ns]."""
        return self.start_ns + self.step_ns * np.arange(len(self.values), dtype=np.int64)


@dataclasses.dataclass(frozen=True)
class StreamHealth:
    """Counters of one stream since construction.

    Attributes
    ----------
    accepted
        Samples that entered the time base.
    rejected
        Reason -> samples that did not.
    reordered
        Accepted samples that came after a newer one.
    gaps, longest_gap_s
        Holes longer than the allowed number of periods, and the longest [s].
    rate_hz
        Rate of the accepted samples [Hz], 0 where unknown.
    silent
        Whether the stream is not waited for at present.
    last_ns
        Newest accepted stamp [ns].
    """

    accepted: int
    rejected: Mapping[str, int]
    reordered: int
    gaps: int
    longest_gap_s: float
    rate_hz: float
    silent: bool
    last_ns: int


class Stream:
    """Ring buffer and clock state of one stream."""

    __slots__ = (
        "accepted", "after", "candidate", "candidate_from", "candidates", "delay", "end", "gaps", "largest", "last", "limit",
        "longest_gap", "lowest",
        "need", "newest", "period", "points", "rejected", "reordered", "silent", "spec", "stamps", "values", "variance",
        "was_silent", "width",
    )

    def __init__(self, spec: StreamSpec) -> None:
        self.spec = spec
        self.width = spec.channels
        self.delay = spec.correction.delay_ns
        self.largest = spec.largest or (LARGEST,) * spec.channels
        self.lowest = min(self.largest, default=LARGEST)  # a sample whose magnitudes add up to less needs no second look
        self.rejected: Counter[str] = Counter()
        self.accepted = 0
        self.reordered = 0
        self.gaps = 0
        self.longest_gap = 0
        self.variance: Sequence[float] | None = None
        self.period = 0
        self.last = 0
        self.newest = 0  # newest accepted stamp of the run, for reports
        self.silent = False
        self.was_silent = True  # at the end of the time base before this one
        self.clear()

    def clear(self) -> None:
        """Forget samples and clock; counters stay."""
        self.newest = self.last or self.newest
        self.was_silent = self.silent if self.last else self.was_silent
        self.stamps = array("q")
        self.values = array("d")
        self.last = 0  # newest accepted stamp, 0 before the first
        self.limit = 0  # largest step from it that needs no second look
        self.end = 0  # two samples at or after this stamp make a block ready
        self.after = 0  # how many there are
        self.need = LEAST  # how many there must be
        self.points = 1
        self.silent = False
        self.candidate = 0  # newest stamp on another clock
        self.candidate_from = 0
        self.candidates = 0  # consecutive samples there

    def complete(self) -> bool:
        """Return whether the samples around the end of the block have no hole that a late sample may still fill."""
        if self.after >= MOST or not self.period:
            return True
        around = self.stamps[-self.after - 2 :]
        if all(2 * (b - a) <= 3 * self.period for a, b in itertools.pairwise(around)):
            return True
        self.need = MOST
        return False

    def take_delay(self, delay_ns: int) -> None:
        """Count the readings as so much late; those at hand move along."""
        change = self.delay - delay_ns
        self.delay = delay_ns
        self.stamps = array("q", [stamp + change for stamp in self.stamps])
        if self.last:
            self.last += change

    def trim(self, before: int) -> None:
        """Drop what no later tick can need: all but the last samples before a stamp."""
        cut = bisect.bisect_left(self.stamps, before) - KEEP
        if cut > 0:
            del self.stamps[:cut]
            del self.values[: cut * self.width]

    def discard(self, after: int) -> None:
        """Count the samples after a stamp as rejected by a restart of the time base, no longer as accepted."""
        unused = len(self.stamps) - bisect.bisect_right(self.stamps, after)
        if unused:
            self.accepted -= unused
            self.rejected["restart"] += unused

    def update_period(self) -> None:
        """Follow the rate slowly, by the mean distance of the samples that are kept."""
        n = len(self.stamps)
        if n >= 3:
            period = (self.stamps[-1] - self.stamps[0]) // (n - 1)
            self.period = self.period + (min(period, 2 * self.period) - self.period) // 16 if self.period else period

    def health(self) -> StreamHealth:
        """Return the counters."""
        return StreamHealth(
            self.accepted, dict(self.rejected), self.reordered, self.gaps, self.longest_gap / NANOSECONDS,
            NANOSECONDS / self.period if self.period else 0.0, self.silent if self.last else self.was_silent,
            self.last or self.newest,
        )


def mean_period(stamps: NDArray[np.int64]) -> int:
    """Return the mean distance of stamps [ns] without gaps."""
    steps = np.diff(stamps)
    steps = steps[steps <= 1.5 * np.median(steps)]
    return max(int(np.mean(steps)), 1)


def tidy_step(period: int) -> int:
    """Return the tick [ns] of a stream: that of a multiple of 10 Hz within 0.5 % of its rate, of a whole hertz within 0.1 %."""
    rate = NANOSECONDS / period
    for unit, tolerance in ((10, 0.005), (1, 0.001)):
        whole = unit * round(rate / unit)
        if whole > 0 and abs(rate - whole) <= tolerance * whole:
            return round(NANOSECONDS / whole)
    return period
