# Copyright 2026 ride_estimation contributors
"""Header stamps of many sensors to one time base: a pure function of the sequence of samples pushed.

Use::

    aligner = StampAligner([StreamSpec("cab_front_left", 3), ...], rate_hz=500.0)   # rate_hz=None: from the data
    for block in aligner.push(index, stamp_ns, values, variance):                   # usually ()
        block.values      # (ticks, all channels side by side in stream order), sensor axes, SI, always finite
        block.valid       # (ticks, streams) False inside gaps and where a stream is silent
        block.start_ns, block.step_ns, block.restart   # restart: reason in words where the time base begins anew
    for block in aligner.finish(): ...
    aligner.columns[index]        # slice of block.values of one stream
    aligner.variance(index)       # newest variance the messages of a stream stated, or None
    aligner.health()              # counters per stream by reason, rates, gaps

A block has ``block_ticks`` ticks (fewer only before a restart and at the end). It is ready as soon as every stream that speaks
has two samples at or after its last tick (four where one is missing there, in case it is only late), or when several streams went
``max_wait_s`` beyond it together, or one went ``latency_budget_s`` beyond it: then the streams that lag are marked not valid and
are not waited for until they speak again. So streams that were held back, up to the latency budget, and come one after
the other lose nothing.
Samples in between are interpolated by a cubic through four samples (linear beside a gap); a stream faster than the time base is
averaged over one tick. No clock is read anywhere, so a live run and its recording give the same bytes.
"""

from __future__ import annotations

import bisect
import dataclasses
import itertools
import math
from array import array
from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.signals.clipping import clipped_at
from ride_estimation.signals.interpolation import interpolate_streams
from ride_estimation.signals.passed_time import PassedTime
from ride_estimation.signals.recording import Recording, UniformRun
from ride_estimation.signals.streams import LEAST, NANOSECONDS, Block, Stream, StreamHealth, StreamSpec, mean_period, tidy_step

#: reason a sample is refused for that no sensor of its kind can give
BEYOND = "beyond_any_sensor"
__all__ = ["Block", "StampAligner", "StreamHealth", "StreamSpec", "align"]

Array = NDArray[np.float64]

#: consecutive samples on another clock, and the time they span [ns], before a stream counts as being there
_CONFIRM = 3
_CONFIRM_SPAN = 100_000_000
#: longest the last value of a stream that is not waited for is held [ns]
_HOLD = 2 * NANOSECONDS
#: time without a sample after which a stream is called silent [ns]; shorter than the longest wait, longer than usual bursts
_OVERDUE = 300_000_000
#: samples of a stream that tell its rate at the start, and the time they span [ns]
_WARM_UP = 8
_WARM_UP_SPAN = 400_000_000


class StampAligner:
    """Put streams with header stamps on one uniform time base, block by block.

    Parameters
    ----------
    specs
        One per stream, in the order of indices and columns.
    rate_hz
        Rate of the time base [Hz]; None takes that of the fastest reference stream, at most ``max_rate_hz``.
    block_ticks
        Ticks per block.
    max_wait_s
        Longest a block waits for a stream that lags, in stamps [s]. Stamps farther ahead of all others are another clock.
    latency_budget_s
        Longest stretch [s] that one stream may run ahead of the others, which were held back as long and are still to come.
    gap_periods
        Periods without a sample after which ticks are not valid.
    max_rate_hz
        Highest automatic rate [Hz].

    Attributes
    ----------
    columns
        Slice of ``Block.values`` by stream index.
    index
        Stream index by name.
    restarts
        Reason -> how often the time base began anew.

    Raises
    ------
    InputDataError
        No streams, two with one name, or settings that are not positive.
    """

    def __init__(
        self,
        specs: Sequence[StreamSpec],
        rate_hz: float | None = None,
        *,
        block_ticks: int = 10,
        max_wait_s: float = 0.5,
        latency_budget_s: float = 3.0,
        gap_periods: float = 3.5,
        max_rate_hz: float = 1000.0,
    ) -> None:
        if not specs or len({s.name for s in specs}) != len(specs):
            raise InputDataError("an aligner needs at least one stream and a different name for each")
        settings = {
            "rate_hz": rate_hz, "block_ticks": block_ticks, "max_wait_s": max_wait_s, "gap_periods": gap_periods,
            "max_rate_hz": max_rate_hz, "latency_budget_s": latency_budget_s,
        }
        for name, value in settings.items():
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise InputDataError(f"{name}: {value!r} is not a positive number")
        edges = np.cumsum([0, *(s.channels for s in specs)])
        self.columns: tuple[slice, ...] = tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(edges))
        self.index: dict[str, int] = {s.name: i for i, s in enumerate(specs)}
        self.restarts: Counter[str] = Counter()
        self._streams = [Stream(spec) for spec in specs]
        self._width = int(edges[-1])
        self._fixed_step = 0 if rate_hz is None else round(NANOSECONDS / rate_hz)
        self._least_step = round(NANOSECONDS / max_rate_hz)
        self._ticks = int(block_ticks)
        self._wait = round(max_wait_s * NANOSECONDS)
        self._budget = max(self._wait, round(latency_budget_s * NANOSECONDS))
        self._time = PassedTime()
        self._other_time = PassedTime()
        self._gap_periods = gap_periods
        self._last_step = 0
        self._ready: list[Block] = []
        #: stream index -> delay that its readings have from the next sample on [ns]
        self._delays: dict[int, int] = {}
        self._restart = "start of the run"
        self._clear()

    def _clear(self) -> None:
        self._step = 0  # [ns], 0 during warm-up
        self._next = 0  # first tick of the block in work
        self._end = 0  # its last tick
        self._floor = 0  # newest emitted tick; older samples are late
        self._missing = 0  # streams the block still waits for
        self._newest = 0
        self._deadline = 0  # newest stamp up to which the block waits whoever lags
        self._time.begin()
        self._snapshot: tuple[int, ...] = ()
        self._other_newest = 0  # newest stamp on another clock
        for stream in self._streams:
            stream.clear()

    @property
    def rate_hz(self) -> float:
        """Return the rate of the time base [Hz], 0 before it is known."""
        step = self._step or self._fixed_step or self._last_step
        return NANOSECONDS / step if step else 0.0

    def variance(self, index: int) -> Sequence[float] | None:
        """Return the newest variance the messages of a stream stated, of corrected values [unit^2], or None."""
        stated, spec = self._streams[index].variance, self._streams[index].spec
        if stated is None or not spec.correction.changes_values:
            return stated
        return [v / g**2 for v, g in zip(stated, spec.correction.gains(len(stated)).tolist())]

    def health(self) -> dict[str, StreamHealth]:
        """Return the counters of every stream by name; silent is also one that is overdue but still waited for."""
        found = {}
        for s in self._streams:
            overdue = bool(s.last) and self._newest - s.last > max(_OVERDUE, round(self._gap_periods * s.period))
            health = s.health()
            found[s.spec.name] = dataclasses.replace(health, silent=True) if overdue and not health.silent else health
        return found

    def reject(self, index: int, reason: str) -> None:
        """Count a sample that was refused before it came here.

        Parameters
        ----------
        index
            Stream index.
        reason
            Name of the counter.
        """
        self._streams[index].rejected[reason] += 1

    def push(
        self, index: int, stamp_ns: int, values: Sequence[float], variance: Sequence[float] | None = None
    ) -> Sequence[Block]:
        """Take one sample and return the blocks that became ready, mostly none.

        Parameters
        ----------
        index
            Stream index.
        stamp_ns
            Header stamp [ns].
        values
            One sample, sensor axes, SI, as the sensor shows it: known errors of the stream are put right here.
        variance
            Its variance per value [unit^2] where the message states one.
        """
        if self._delays:
            self.take_delays()
        s = self._streams[index]
        if s.delay and stamp_ns > 0:
            stamp_ns -= s.delay
        if (
            0 < stamp_ns - s.last <= s.limit
            and stamp_ns > self._floor
            and len(values) == s.width
            and sum(map(abs, values)) < s.lowest
        ):
            s.candidates = 0
        elif not self._admit(s, stamp_ns, values):
            return self._take() if self._ready else ()
        if self._newest > self._end:
            step = s.period or (stamp_ns - s.last if s.last else 0)
            self._time.sample(index, max(0, stamp_ns - self._newest), step)
        if stamp_ns > s.last:
            s.last = stamp_ns
            s.stamps.append(stamp_ns)
            s.values.extend(values)
        s.accepted += 1
        if variance is not None:
            s.variance = variance
        if stamp_ns > self._newest:  # noqa: PLR1730 - max() costs three times as much on the path of every sample
            self._newest = stamp_ns
        if self._step == 0:
            self._warm_up()
        elif stamp_ns >= s.end:
            s.after += 1
            if s.after == s.need and s.spec.waited_for and s.complete():
                self._missing -= 1
        if self._step and (self._missing == 0 or (self._newest > self._deadline and self._waited())):
            self._advance()
        return self._take() if self._ready else ()

    def delay(self, index: int, seconds: float) -> None:
        """Count the readings of a stream as so much late behind their stamps, from the next sample on that comes.

        Blocks that are ready stay as they are; samples that wait for the next one move along.

        Parameters
        ----------
        index
            Stream index.
        seconds
            The whole delay, that of its :class:`StreamSpec` included [s].
        """
        self._delays[index] = round(seconds * NANOSECONDS)

    @property
    def waits_to_delay(self) -> bool:
        """Return whether a delay waits for the next sample."""
        return bool(self._delays)

    def take_delays(self) -> None:
        """Apply what :meth:`delay` asked for."""
        for index, delay_ns in self._delays.items():
            s = self._streams[index]
            s.take_delay(delay_ns)
            self._newest = max(self._newest, s.last)
        self._delays = {}
        if self._step:
            self._begin_block(self._next)

    def filled(self, newest: int) -> Sequence[Block]:
        """Return the blocks that are ready after every stream got the samples it waited for, the newest at a stamp [ns]."""
        self._newest, self._missing = max(self._newest, newest), 0
        self._advance()
        return self._take()

    def finish(self) -> Sequence[Block]:
        """Return what is left at the end of a run; the next sample begins a new one."""
        self._drain()
        self._restart = "start of the run"
        self._clear()
        return self._take()

    def restart(self, reason: str) -> Sequence[Block]:
        """Return what is left and begin a new time base with the next sample.

        Parameters
        ----------
        reason
            Why, in words; the next block carries it.
        """
        self._begin_anew(reason)
        return self._take()

    def _begin_anew(self, reason: str) -> None:
        """Emit what can be emitted, count the samples that then remain as not used, and wait for a new time base."""
        self._drain()
        for s in self._streams:
            s.discard(self._floor)
        self.restarts[reason] += 1
        self._restart = reason
        self._clear()

    # -- admission of one sample ------------------------------------------------------------------------------------------

    def _admit(self, s: Stream, stamp: int, values: Sequence[float]) -> bool:
        """Return whether a sample that is not the normal case is taken (an older one is put in its place here)."""
        reason = self._objection(s, stamp, values)
        if reason:
            s.rejected[reason] += 1
            if reason in ("clock_ahead", "clock_behind"):
                self._other_clock(s, stamp, reason)
            return False
        s.candidates = 0
        if self._newest == 0:
            self._floor = stamp - self._wait  # what was held back began with the others
        if s.last == 0 or stamp > s.last:
            step = stamp - s.last
            if s.last and s.period and step > self._gap_periods * s.period:
                s.gaps += 1
                s.longest_gap = max(s.longest_gap, step)
        else:
            place = bisect.bisect_left(s.stamps, stamp)
            s.stamps.insert(place, stamp)
            s.values[place * s.width : place * s.width] = array("d", values)
            s.reordered += 1
        if s.silent:
            s.silent = False
            if s.spec.waited_for and s.after < s.need:
                self._missing += 1
        self._set_limit(s)
        return True

    def _objection(self, s: Stream, stamp: int, values: Sequence[float]) -> str:
        """Return why a sample cannot be taken, empty if it can."""
        if len(values) != s.width:
            return "wrong_length"
        if not all(map(math.isfinite, values)):
            return "not_finite"
        if any(abs(v) > most for v, most in zip(values, s.largest)):
            return BEYOND
        if stamp <= 0:
            return "stamp_not_positive"
        if self._newest == 0:
            return ""
        reach = max(self._wait, 3 * s.period)
        if stamp - self._newest > reach:
            return "clock_ahead"
        if s.last and stamp == s.last:
            return "duplicate"
        if self._newest - stamp > (reach if stamp <= self._floor else self._budget):
            return "clock_behind"
        if stamp <= self._floor:
            return "late"
        if s.last and stamp < s.last:
            place = bisect.bisect_left(s.stamps, stamp)
            if s.stamps[place] == stamp:
                return "duplicate"
            hole = s.stamps[place] - (s.stamps[place - 1] if place else stamp - s.period)
            if hole < 1.5 * s.period:
                return "out_of_order"
        return ""

    def _other_clock(self, s: Stream, stamp: int, reason: str) -> None:
        """Look at a refused sample on another clock; when most streams that speak are there together, follow them.

        Streams that come there one by one were held back for longer than the latency budget.
        """
        if not any(other.candidates for other in self._streams):
            self._snapshot = tuple(other.accepted for other in self._streams)
            self._other_newest = stamp
            self._other_time.begin()
        step, advance = s.period or (stamp - s.candidate if s.candidates else 0), max(0, stamp - self._other_newest)
        self._other_time.sample(self.index[s.spec.name], advance, step)
        self._other_newest += advance
        alone = all(other is s or other.silent or not other.last for other in self._streams)
        together = alone or self._other_time.passed >= _CONFIRM_SPAN
        if s.candidates and 0 < stamp - s.candidate <= max(self._wait, 3 * s.period):
            s.candidates += 1
        else:
            s.candidates, s.candidate_from = 1, stamp
        s.candidate = stamp
        there = sum(
            other.candidates >= _CONFIRM and other.candidate - other.candidate_from >= _CONFIRM_SPAN for other in self._streams
        )
        here = sum(
            other.candidates == 0 and other.accepted > before for other, before in zip(self._streams, self._snapshot)
        )
        if there > here and together:
            self._begin_anew("stamps jumped ahead" if reason == "clock_ahead" else "stamps jumped back")

    def _set_limit(self, s: Stream) -> None:
        s.limit = min(int(self._gap_periods * s.period), self._wait) if self._step else 0

    # -- the time base ----------------------------------------------------------------------------------------------------

    def _warm_up(self, force: bool = False) -> None:
        """Find rate and phase of the time base once every stream has spoken enough, or after the longest wait."""
        spoken = [s for s in self._streams if s.stamps]
        awaited = [s for s in self._streams if s.spec.waited_for]
        first = min(s.stamps[0] for s in spoken)
        enough = all(len(s.stamps) >= _WARM_UP and s.last - s.stamps[0] >= _WARM_UP_SPAN for s in awaited)
        if not enough and not force and self._time.passed <= self._wait and self._newest - first <= self._budget:
            return
        for s in spoken:
            if len(s.stamps) >= 2:
                s.period = mean_period(np.array(s.stamps, dtype=np.int64))
        references = [s for s in spoken if s.spec.reference and len(s.stamps) >= 2] or [s for s in spoken if len(s.stamps) >= 2]
        if not references:
            return
        fastest = min(references, key=lambda s: s.period)
        fast = sorted(s.stamps[0] for s in references if s.period <= 1.02 * fastest.period)
        self._step = self._fixed_step or max(tidy_step(fastest.period), self._least_step)
        self._last_step = self._step
        for s in self._streams:
            s.points = max(1, round(self._step / s.period)) if s.period else 1
            s.silent = not s.stamps
        # whatever the order of the streams: where all have begun that begin together; one that starts much later does not decide
        together = fast[(len(fast) - 1) // 2] + self._step
        self._begin_block(max(stamp for stamp in fast if stamp <= together))

    def _begin_block(self, first_tick: int) -> None:
        self._next = first_tick
        self._end = first_tick + (self._ticks - 1) * self._step
        self._deadline = self._end + self._wait
        self._missing = 0
        self._time.begin()
        for s in self._streams:
            s.end = self._end + (self._step // 2 if s.points > 1 else 0)
            s.after = len(s.stamps) - bisect.bisect_left(s.stamps, s.end)
            s.need = LEAST
            if s.spec.waited_for and not s.silent and (s.after < s.need or not s.complete()):
                self._missing += 1
            if not s.silent:
                self._set_limit(s)

    def _waited(self) -> bool:
        """Return whether the block has waited long enough for streams that lag."""
        return self._time.passed > self._wait or self._newest > self._end + self._budget

    def _advance(self) -> None:
        """Emit every block that is ready."""
        while self._missing == 0 or self._waited():
            if self._newest <= self._end:  # nobody is waited for and nothing new is there
                return
            # where the next block waits for a stream that came until now, time begins anew
            passed = self._time.passed - self._ticks * self._step if self._missing else 0
            for s in self._streams:
                if s.spec.waited_for and s.after < s.need and not s.silent:
                    s.silent, s.limit = True, 0
            self._emit(self._ticks)
            self._time.begin(passed)

    def _emit(self, ticks: int) -> None:
        values = np.empty((ticks, self._width))
        valid = np.empty((ticks, len(self._streams)), dtype=np.bool_)
        streams = []
        for s, columns in zip(self._streams, self.columns):
            held = not s.spec.waited_for
            widest = max(_HOLD, 3 * s.period) if held else int(self._gap_periods * s.period)
            streams.append((len(s.stamps), s.width, columns.start, widest, s.points, held))
        # a bytearray, as arrays of bytes are read-only
        stamps = bytearray().join([s.stamps for s in self._streams])
        samples = bytearray().join([s.values for s in self._streams])
        interpolate_streams(
            np.frombuffer(stamps, dtype=np.int64), np.frombuffer(samples), np.array(streams, dtype=np.int64),
            self._next, self._step, values, valid,
        )  # fmt: skip
        after = self._next + ticks * self._step
        for i, s in enumerate(self._streams):
            if s.spec.correction.changes_values:
                values[:, self.columns[i]] = s.spec.correction.apply(values[:, self.columns[i]])
            s.update_period()
            s.trim(after)
        self._ready.append(Block(self._next, self._step, values, valid, self._restart))
        self._restart = ""
        self._floor = self._next + (ticks - 1) * self._step
        self._begin_block(self._next + ticks * self._step)

    def _drain(self) -> None:
        """Emit the ticks up to the last stamp that all streams that still speak have reached."""
        if self._step == 0 and any(s.stamps for s in self._streams):
            self._warm_up(force=True)
        if self._step == 0:
            return
        speaking = [s.last for s in self._streams if s.spec.waited_for and not s.silent and s.last]
        last = min(speaking) if speaking else 0
        while last >= self._next:
            self._emit(min(self._ticks, (last - self._next) // self._step + 1))

    def _take(self) -> Sequence[Block]:
        blocks, self._ready = self._ready, []
        return blocks


def align(recording: Recording, rate_hz: float | None = None, *, max_wait_s: float = 2.0) -> UniformRun:
    """Put a whole recording on one time base with the code the live estimator uses.

    Parameters
    ----------
    recording
        The run, samples in order of arrival.
    rate_hz
        Rate of the time base [Hz]; None takes that of the fastest sensor.
    max_wait_s
        See :class:`StampAligner`.

    Returns
    -------
    UniformRun
        The longest part without a jump of the clocks.

    Raises
    ------
    InputDataError
        Less than two ticks of data.
    """
    names = list(recording.channels)
    channels = [recording.channels[name] for name in names]
    specs = [StreamSpec(name, channel.values.shape[1], correction=channel.correction) for name, channel in zip(names, channels)]
    aligner = StampAligner(specs, rate_hz, block_ticks=1000, max_wait_s=max_wait_s)
    blocks: list[Block] = []
    for index, stamp, values, _ in recording.in_order():
        blocks.extend(aligner.push(index, stamp, values))
    blocks.extend(aligner.finish())
    starts = [i for i, block in enumerate(blocks) if block.restart] + [len(blocks)]
    parts = [blocks[a:b] for a, b in itertools.pairwise(starts)]
    longest = max(parts, key=lambda part: sum(len(block.values) for block in part), default=[])
    if sum(len(block.values) for block in longest) < 2:
        raise InputDataError(f"{recording.name}: less than two common samples of {', '.join(names) or 'no sensor'}")
    values_all = np.vstack([block.values for block in longest])
    valid = np.vstack([block.valid for block in longest])
    return UniformRun(
        name=recording.name,
        rate_hz=NANOSECONDS / longest[0].step_ns,
        start_ns=longest[0].start_ns,
        data={name: values_all[:, columns] for name, columns in zip(names, aligner.columns)},
        valid={name: valid[:, i] for i, name in enumerate(names)},
        corrections={name: c.correction for name, c in zip(names, channels) if not c.correction.empty},
        clipped_at=clipped_at(channels),
    )
