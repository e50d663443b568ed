# Copyright 2026 ride_estimation contributors
"""Measured data as it arrived (Recording) and on a common time base (UniformRun)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.signals.correction import NO_CORRECTION, Correction

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


@dataclasses.dataclass(frozen=True)
class Channel:
    """Samples of one sensor in order of arrival.

    Attributes
    ----------
    name
        Sensor name of the vehicle file.
    stamp_ns
        Header stamps, shape (N,), int64 [ns].
    values
        Shape (N, C), SI, sensor axes.
    variance
        Per value, shape (N, C) [unit^2], NaN in rows of messages that do not state it; None where none does.
    arrival_ns
        Bag receive times, shape (N,), int64 [ns].
    order
        Place of every sample in the order of arrival of the whole run, shape (N,), or None: by ``arrival_ns``.
    correction
        Known errors of the sensor, still in stamps and values here; alignment puts them right.
    """

    name: str
    stamp_ns: IntArray
    values: Array
    arrival_ns: IntArray
    variance: Array | None = None
    frame_id: str = ""
    order: IntArray | None = None
    correction: Correction = NO_CORRECTION

    def picked(self, kept: BoolArray) -> Channel:
        """Return the channel with some of its samples, shape (N,)."""
        return dataclasses.replace(
            self,
            stamp_ns=self.stamp_ns[kept],
            values=self.values[kept],
            arrival_ns=self.arrival_ns[kept],
            variance=None if self.variance is None else self.variance[kept],
            order=None if self.order is None else self.order[kept],
        )


@dataclasses.dataclass(frozen=True)
class Recording:
    """One recorded run.

    Attributes
    ----------
    name
        Path name of the run.
    checksum
        SHA-256 of its files.
    channels
        By sensor name.
    ignored
        Samples or topics that were not used: reason -> count.
    events
        Markers of a logger file: stamp [ns], name.
    """

    name: str
    channels: Mapping[str, Channel]
    checksum: str = ""
    ignored: Mapping[str, int] = dataclasses.field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    events: tuple[tuple[int, str], ...] = ()

    @property
    def start_ns(self) -> int:
        """Return the first stamp of all sensors [ns]."""
        return min((int(c.stamp_ns.min()) for c in self.channels.values() if len(c.stamp_ns)), default=0)

    @property
    def duration_s(self) -> float:
        """Return the time from the first to the last stamp of all sensors [s]."""
        last = max((int(c.stamp_ns.max()) for c in self.channels.values() if len(c.stamp_ns)), default=0)
        return (last - self.start_ns) * 1e-9

    def in_order(self) -> Iterator[tuple[int, int, tuple[float, ...], tuple[float, ...] | None]]:
        """Yield (channel index, stamp [ns], values, variance or None) of every sample in order of arrival."""
        channels = list(self.channels.values())
        if not channels:
            return
        owner = np.concatenate([np.full(len(c.stamp_ns), i) for i, c in enumerate(channels)])
        key = np.concatenate([c.arrival_ns if c.order is None else c.order for c in channels])
        position = np.concatenate([np.arange(len(c.stamp_ns)) for c in channels])
        by_arrival = np.argsort(key, kind="stable")
        columns = [(c.stamp_ns.tolist(), _rows(c.values), None if c.variance is None else _rows(c.variance)) for c in channels]
        for index, k in zip(owner[by_arrival].tolist(), position[by_arrival].tolist()):
            stamps, values, variance = columns[index]
            stated = None if variance is None or math.isnan(variance[k][0]) else variance[k]
            yield index, stamps[k], values[k], stated


def part_of(recording: Recording, start_s: float | None, end_s: float | None) -> Recording:
    """Return the samples whose stamps are within a part of a recording, the recording itself where no limit is given.

    Parameters
    ----------
    recording
        The whole run.
    start_s, end_s
        Seconds since its first stamp, the limits included; None is the begin or the end of the run.

    Raises
    ------
    InputDataError
        Limits in the wrong order or outside of the run, or a sensor that has no sample between them.
    """
    if start_s is None and end_s is None:
        return recording
    whole = recording.duration_s
    begin, end = 0.0 if start_s is None else start_s, whole if end_s is None else end_s
    if not 0.0 <= begin < end or begin >= whole:
        raise InputDataError(
            f"{recording.name}: the part from {begin:g} s to {end:g} s; allowed are 0 <= from < to, from before {whole:.6g} s"
        )
    first, last = (recording.start_ns + round(limit * 1e9) for limit in (begin, min(end, whole)))
    channels = {n: c.picked((c.stamp_ns >= first) & (c.stamp_ns <= last)) for n, c in recording.channels.items()}
    silent = [name for name, c in channels.items() if not len(c.stamp_ns)]
    if silent:
        raise InputDataError(f"{recording.name}: no sample of {', '.join(silent)} from {begin:g} s to {end:g} s")
    return dataclasses.replace(recording, name=f"{recording.name} ({begin:g} s to {min(end, whole):g} s)", channels=channels)


def run_title(path: str) -> str:
    """Return the name of a recording as a heading: a folder called ``bag`` says nothing without the one above it.

    What follows the path in brackets stays.
    """
    place, bracket, rest = path.rpartition(" (") if path.endswith(")") else (path, "", "")
    parts = PurePath(place).parts
    return ("/".join(parts[-2:]) if parts[-1:] == ("bag",) else "/".join(parts[-1:])) + bracket + rest


def _rows(values: Array) -> list[tuple[float, ...]]:
    """Return the rows as tuples; lists would keep the garbage collector busy."""
    return list(zip(*(values[:, i].tolist() for i in range(values.shape[1]))))


@dataclasses.dataclass(frozen=True)
class UniformRun:
    """A run on one uniform time base, sensor axes, gravity still in it.

    Attributes
    ----------
    rate_hz
        Sample rate [Hz].
    start_ns
        Stamp of sample 0 [ns].
    data
        Sensor name -> values, shape (N, C).
    valid
        Sensor name -> shape (N,) bool, False inside gaps.
    corrections
        Sensor name -> known errors of the sensor that were put right when the run was aligned.
    clipped_at
        Sensor name -> values at which its readings are cut, corrected as the data are, shape (2, C): see
        :func:`~ride_estimation.signals.clipping.clipping_levels`. Sensors that are not cut are left out.
    """

    name: str
    rate_hz: float
    start_ns: int
    data: Mapping[str, Array]
    valid: Mapping[str, NDArray[np.bool_]]
    corrections: Mapping[str, Correction] = dataclasses.field(default_factory=dict)
    clipped_at: Mapping[str, Array] = dataclasses.field(default_factory=dict)

    @property
    def samples(self) -> int:
        """Return N."""
        return len(next(iter(self.data.values())))

    @property
    def time_s(self) -> Array:
        """Return seconds since the start, shape (N,)."""
        return np.arange(self.samples) / self.rate_hz
