# Copyright 2026 ride_estimation contributors
"""Measured data as it arrived (Recording) and on a common time base (UniformRun)."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


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
        Per value, shape (N, C) [unit^2], or None where the messages do not state it.
    arrival_ns
        Bag receive times, shape (N,), int64 [ns].
    """

    name: str
    stamp_ns: IntArray
    values: Array
    arrival_ns: IntArray
    variance: Array | None = None
    frame_id: str = ""


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
    """

    name: str
    channels: Mapping[str, Channel]
    checksum: str = ""
    ignored: Mapping[str, int] = dataclasses.field(default_factory=dict)
    warnings: tuple[str, ...] = ()


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
    """

    name: str
    rate_hz: float
    start_ns: int
    data: Mapping[str, Array]
    valid: Mapping[str, NDArray[np.bool_]]

    @property
    def samples(self) -> int:
        """Return N."""
        return len(next(iter(self.data.values())))

    @property
    def time_s(self) -> Array:
        """Return seconds since the start, shape (N,)."""
        return np.arange(self.samples) / self.rate_hz
