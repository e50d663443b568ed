# Copyright 2026 ride_estimation contributors
"""Readings of a recorded run on one time base, as the model takes them: corrected, without gaps, band-limited."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, signal

from ride_estimation.errors import InputDataError
from ride_estimation.estimation.model.plant import Plant
from ride_estimation.estimation.model.states import reading_width
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: shortest part without a gap that is used [s]
SHORTEST_SEGMENT_S = 5.0
#: how far what bridges a gap reaches beyond it [s]: ends of a part are worth little
_AROUND_GAP_S = 8.0
#: highest rate of the model [Hz]: mounts and cabs move below 40 Hz
_RATE = 125.0
#: time before a sensor is found to be wrong, and after it is found to be right, in which it may be wrong [s]
_SPOILED_S = 2.0
#: degree of the interpolating splines, longest step that is interpolated [periods]
_SPLINE, _GAP_PERIODS = 7, 3.5


@dataclasses.dataclass(frozen=True)
class Bridge:
    """Part of a run in which one sensor has a gap.

    Attributes
    ----------
    sensor
        Its name.
    start_ns, readings
        As in :class:`RunReadings`.
    silent
        Which readings are its, shape (C,).
    """

    sensor: str
    start_ns: int
    readings: Array
    silent: NDArray[np.bool_]


@dataclasses.dataclass(frozen=True)
class RunReadings:
    """A run as the model takes it.

    Attributes
    ----------
    plant
        Vehicle; its sensors with the noise that is left in the readings.
    segments
        Parts without a gap, readings of shape (T, C) in the order of the plant's sensors.
    start_ns
        Stamp of the first sample of every part [ns].
    bridges
        Parts around gaps of one sensor, with all the others.
    dt
        Sample [s].
    """

    plant: Plant
    segments: tuple[Array, ...]
    start_ns: tuple[int, ...]
    bridges: tuple[Bridge, ...]
    dt: float


def run_readings(recording: Recording, vehicle: Vehicle) -> RunReadings:
    """Return the readings of a run.

    Parameters
    ----------
    recording
        The run.
    vehicle
        Its corrections are taken off the readings.

    Raises
    ------
    ConfigurationError
        The vehicle is none the model describes.
    InputDataError
        A sensor of the model is missing.
    """
    plant = Plant(vehicle)
    missing = [s.name for s in plant.sensors if s.name not in recording.channels or not len(recording.channels[s.name].stamp_ns)]
    if missing:
        raise InputDataError(f"{recording.name}: no samples of {', '.join(missing)}; every sensor of the model is needed")
    tracks = {s.name: _track(recording.name, recording.channels[s.name], s) for s in plant.sensors}
    rate = min(_RATE, *(track.rate for track in tracks.values()))
    # white noise that is left below the new rate
    quiet = {
        n: dataclasses.replace(s, noise_std=s.noise_std * math.sqrt(rate / tracks[n].rate)) if n in tracks else s
        for n, s in vehicle.sensors.items()
    }
    starts, segments, bridges = _segments(tracks, rate)
    return RunReadings(Plant(dataclasses.replace(vehicle, sensors=quiet)), segments, starts, bridges, 1.0 / rate)


def without_readings(recording: Recording, times: Mapping[str, Sequence[tuple[int, int]]]) -> Recording:
    """Return a recording without the readings of some sensors at some times, name -> first and last stamp [ns] of every time."""
    channels, margin = dict(recording.channels), round(1e9 * _SPOILED_S)
    for name, parts in times.items():
        stamps = channels[name].stamp_ns
        kept = np.ones(len(stamps), dtype=bool)
        for first, last in parts:
            kept &= (stamps < first - margin) | (stamps > last + margin)
        channels[name] = channels[name].picked(kept)
    return dataclasses.replace(recording, channels=channels)


@dataclasses.dataclass(frozen=True)
class _Track:
    """Good samples of one sensor: time [s], corrected values (N, C), mean rate [Hz], parts without a gap as index pairs."""

    time: Array
    values: Array
    rate: float
    parts: tuple[tuple[int, int], ...]


def _track(name: str, channel: Channel, sensor: Sensor) -> _Track:
    values = sensor.correction.apply(channel.values)[:, : reading_width(sensor)]
    stamps = channel.stamp_ns - sensor.correction.delay_ns
    good = np.all(np.isfinite(values), axis=1) & np.all(np.abs(values) < sensor.reach, axis=1) & (channel.stamp_ns > 0)
    stamps, first = np.unique(stamps[good], return_index=True)
    values = values[good][first]
    if len(stamps) < _SPLINE + 1:
        raise InputDataError(f"{name}: {sensor.name} has {len(stamps)} good samples; others are not finite or cut off")
    time = np.asarray(stamps * 1e-9, dtype=np.float64)
    period = float(np.median(np.diff(time)))
    edges = np.r_[0, np.flatnonzero(np.diff(time) > _GAP_PERIODS * period) + 1, len(time)].tolist()
    return _Track(time, values, 1.0 / period, tuple(itertools.pairwise(edges)))


def _segments(tracks: Mapping[str, _Track], rate: float) -> tuple[tuple[int, ...], tuple[Array, ...], tuple[Bridge, ...]]:
    """Return first stamps [ns] and readings of all sensors on one time base, where none has a gap, and where one has.

    Splines of high degree through the samples: a cubic through four takes 0.4 % of a signal at a tenth of the sample rate, more
    than the gains that are looked for. They are taken at a multiple of the rate that no sensor exceeds, so that no noise is
    aliased, and low-passed.
    """
    fine = max(2, *(math.ceil(t.rate / rate - 1e-3) for t in tracks.values()))
    # where all sensors are, or all but one: the clock of a single one may be years away
    begin = sorted(t.time[0] for t in tracks.values())[-2]
    count = int((sorted(t.time[-1] for t in tracks.values())[1] - begin) * fine * rate)
    if count < 2:
        return (), (), ()
    grid = begin + np.arange(count) / (fine * rate)
    columns, present = [], np.zeros((len(tracks), count), dtype=bool)
    for n, track in enumerate(tracks.values()):
        out = np.zeros((count, track.values.shape[1]))
        for first, stop in track.parts:
            if stop - first > _SPLINE:
                inside = (grid >= track.time[first]) & (grid <= track.time[stop - 1])
                start = track.time[first]
                spline = interpolate.make_interp_spline(track.time[first:stop] - start, track.values[first:stop], k=_SPLINE)
                out[inside] = spline(grid[inside] - start)
                present[n] |= inside
        columns.append(out)
    values = np.hstack(columns)
    fir = signal.firwin(20 * fine + 1, 1.0 / fine, window=("kaiser", 8.0))
    least = round(SHORTEST_SEGMENT_S * fine * rate)

    def part(first: int, stop: int) -> tuple[int, Array]:
        found = signal.resample_poly(values[first:stop], 1, fine, axis=0, padtype="line", window=fir)
        return round(1e9 * float(grid[first])), np.asarray(found)

    good = np.asarray(present.all(axis=0))
    whole = [part(a, b) for a, b in _stretches(good) if b - a >= least]
    edges = np.cumsum([0, *(c.shape[1] for c in columns)])
    bridges = []
    around = round(_AROUND_GAP_S * fine * rate)
    for n, name in enumerate(tracks):
        others = np.delete(present, n, axis=0).all(axis=0)
        silent = (np.arange(edges[-1]) >= edges[n]) & (np.arange(edges[-1]) < edges[n + 1])
        for a, b in _stretches(_near(others & ~present[n], around) & others):
            if b - a >= least and np.any(~present[n, a + around // 4 : b - around // 4]):
                start, readings = part(a, b)
                bridges.append(Bridge(name, start, np.where(silent, 0.0, readings), silent))
    return tuple(s for s, _ in whole), tuple(r for _, r in whole), tuple(bridges)


def _near(there: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Return what is at most so many samples from a true value."""
    change = np.zeros(len(there) + 1, dtype=np.int64)
    for first, stop in _stretches(there):
        change[max(first - reach, 0)] += 1
        change[min(stop + reach, len(there))] -= 1
    return np.asarray(np.cumsum(change)[:-1] > 0)


def _stretches(good: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return begin and end of every run of true values."""
    edges = np.flatnonzero(np.diff(np.r_[False, good, False].astype(np.int8))).tolist()
    return list(zip(edges[::2], edges[1::2]))
