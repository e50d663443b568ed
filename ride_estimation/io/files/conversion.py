# Copyright 2026 ride_estimation contributors
"""Measurement files to recordings, and recordings and replays to the channels of measurement files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.frames import AXES, COORDINATES
from ride_estimation.io.files.channel_map import ChannelMap, components
from ride_estimation.io.files.channels import (
    LATEST_START_NS,
    UNKNOWN_START_NS,
    FileChannel,
    MeasurementFile,
    no_time,
    unit_factor,
)
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.alignment import align
from ride_estimation.signals.recording import Channel, Recording

Array = NDArray[np.float64]

#: arrays of ``signals.npz`` that are exported -> units of their components
_SIX = ("m/s^2", "m/s^2", "m/s^2", "rad/s^2", "rad/s^2", "rad/s^2")
_LOAD = ("N", "N", "N", "N m", "N m", "N m")
_TIMED = {
    "cg_accel": _SIX, "cg_accel_std": _SIX, "cg_specific_force": _SIX, "inertial_load": _LOAD, "inertial_load_std": _LOAD,
    "angular_rate": ("rad/s",) * 3, "tilt": ("rad",) * 3,
}  # fmt: skip
#: array of names -> arrays of three axes for each of them, with their unit
_PER_NAME = {
    "mount_names": {
        "mount_force": "N", "mount_force_std": "N", "mount_deflection": "m", "mount_force_smoothed": "N",
        "mount_force_smoothed_std": "N", "mount_deflection_smoothed": "m",
    },
    "carried_names": {"carried_specific_force": "m/s^2", "carried_specific_force_std": "m/s^2"},
}  # fmt: skip


def recording_from_file(file: MeasurementFile, sensors: Mapping[str, Sensor], channels: ChannelMap) -> Recording:
    """Return a recording of those sensors the file has channels for.

    Parameters
    ----------
    file
        From :func:`~ride_estimation.io.files.formats.read_measurement_file`.
    sensors
        Of the vehicle.
    channels
        Which channel is what.

    Raises
    ------
    InputDataError
        A channel that is missing, ambiguous or in an unknown unit, components on different time bases, or no sensor at all.
    """
    by_name: dict[str, list[FileChannel]] = {}
    for channel in file.channels:
        by_name.setdefault(channel.name, []).append(channel)
    start_ns = file.start_ns if 0 < file.start_ns < LATEST_START_NS else UNKNOWN_START_NS
    problems: list[str] = []
    ignored: Counter[str] = Counter()
    found: dict[str, Channel] = {}
    used: set[str] = set()
    for sensor in sensors.values():
        wanted = [(name, unit) for name, unit in components(sensor) if name in channels.sources]
        if not wanted:
            continue
        names = [channels.sources[name].channel for name, _ in wanted]
        problems += [f"{sensor.name}: column {name}, {file.unreadable[name]}" for name in names if name in file.unreadable]
        if any(name in file.unreadable for name in names):
            continue
        if not any(name in by_name for name in names):
            problems.append(f"{sensor.name}: the file has no channel {', '.join(repr(n) for n in names)}")
            continue
        missing = [name for name, _ in components(sensor) if name not in channels.sources]
        if missing:
            problems.append(f"{sensor.name}: the channel map has no {', '.join(missing)}")
            continue
        parts = [_component(name, unit, channels, by_name, problems) for name, unit in wanted]
        used.update(names)
        if all(part is not None for part in parts):
            channel_ = _sensor_channel(sensor, [p for p in parts if p is not None], start_ns, ignored, problems)
            if channel_ is not None:
                found[sensor.name] = channel_
    there = ", ".join(f"{c.name} [{c.unit or 'no unit'}]" for c in file.channels)
    if problems:
        raise InputDataError(f"{file.name}:\n  - " + "\n  - ".join(problems) + f"\n  channels of the file: {there}")
    if not found:
        raise InputDataError(
            f"{file.name}: no channel belongs to a sensor of the vehicle; a channel map is needed. Channels: {there}"
        )
    ignored.update({f"channel {name}: belongs to no sensor": len(c[0].values) for name, c in by_name.items() if name not in used})
    ignored.update({f"column {name}: holds text ({why})": 1 for name, why in file.unreadable.items()})
    events = tuple((start_ns + round(seconds * 1e9), text) for seconds, text in file.events if np.isfinite(seconds))
    return Recording(file.name, found, ignored=dict(ignored), events=events)


def _component(
    name: str, unit: str, channels: ChannelMap, by_name: Mapping[str, list[FileChannel]], problems: list[str]
) -> FileChannel | None:
    """Return one component in SI units."""
    source = channels.sources[name]
    there = by_name.get(source.channel, [])
    if len(there) != 1:
        problems.append(f"{name}: the file has {len(there) or 'no'} channel{'s' if len(there) > 1 else ''} {source.channel!r}")
        return None
    given = source.unit or there[0].unit
    known = unit_factor(given) if given else None
    if known is None or known[0] != unit:
        what = f"unit {given!r} of channel {source.channel!r} is not for {unit}" if given else f"{source.channel!r} has no unit"
        problems.append(f"{name}: {what}; say it in the channel map (unit: ...)")
        return None
    with np.errstate(over="ignore", invalid="ignore"):  # a damaged value; what is not finite is left out and counted
        values = known[1] * (source.factor * there[0].values + source.offset)
    return FileChannel(name, unit, there[0].time_s, values)


def _sensor_channel(
    sensor: Sensor, parts: list[FileChannel], start_ns: int, ignored: Counter[str], problems: list[str]
) -> Channel | None:
    first = parts[0].time_s
    if any(not np.array_equal(part.time_s, first) for part in parts[1:]):
        problems.append(f"{sensor.name}: its components are on different time bases")
        return None
    reason = no_time(first)
    if reason:
        problems.append(f"{sensor.name}: {reason}")
        return None
    values = np.zeros((len(first), sensor.channels))
    values[:, sensor.measured] = np.column_stack([part.values for part in parts])
    good = np.all(np.isfinite(values), axis=1)
    if not np.all(good):
        ignored[f"{sensor.name}: no value in the file"] += int(np.sum(~good))
    stamps = start_ns + np.round(first[good] * 1e9).astype(np.int64)
    if len(stamps) < 2:
        problems.append(f"{sensor.name}: {len(stamps)} samples; at least two are needed")
        return None
    return Channel(sensor.name, stamps, np.ascontiguousarray(values[good]), stamps)


def recording_groups(
    recording: Recording, sensors: Mapping[str, Sensor], one_time_base: bool
) -> tuple[list[list[FileChannel]], int]:
    """Return the channels of a recording by time base, and its start [ns].

    Parameters
    ----------
    recording
        The run.
    sensors
        Of the vehicle.
    one_time_base
        Interpolate all sensors to the rate of the fastest, for tables; otherwise every sensor keeps its stamps, sorted.
    """
    if one_time_base:
        run = align(recording)
        table = [
            FileChannel(name, unit, run.time_s, np.where(run.valid[sensor.name], run.data[sensor.name][:, i], np.nan))
            for sensor in sensors.values() if sensor.name in run.data
            for i, (name, unit) in zip(np.flatnonzero(sensor.measured).tolist(), components(sensor))
        ]  # fmt: skip
        return [table], run.start_ns
    start = min(int(channel.stamp_ns.min()) for channel in recording.channels.values())
    groups = []
    for name, channel in recording.channels.items():
        stamps, places = np.unique(channel.stamp_ns, return_index=True)
        time = np.asarray((stamps - start) * 1e-9, dtype=np.float64)
        parts = zip(np.flatnonzero(sensors[name].measured).tolist(), components(sensors[name]))
        groups.append([FileChannel(part, unit, time, channel.values[places, i]) for i, (part, unit) in parts])
    return groups, start


def replay_groups(signals: Mapping[str, NDArray[np.generic]]) -> tuple[list[list[FileChannel]], int]:
    """Return the estimates of a replay as channels, and the stamp of its first tick [ns].

    Parameters
    ----------
    signals
        Arrays of ``signals.npz``.

    Raises
    ------
    InputDataError
        Arrays that a replay writes are missing or of another shape or type.
    """
    missing = [name for name in ("time_s", "stamp_ns", "mount_names", "valid", "cg_accel") if name not in signals]
    if missing:
        raise InputDataError(f"signals.npz: no {', '.join(missing)}: not the results of a replay")
    ticks = signals["time_s"].size
    shapes: dict[str, tuple[int, ...]] = {"time_s": (ticks,), "stamp_ns": (ticks,), "valid": (ticks,)}
    shapes |= {name: (ticks, len(units)) for name, units in _TIMED.items()}
    for names, tables in _PER_NAME.items():
        places = signals[names].size if names in signals else 0
        shapes |= {names: (places,)} | {name: (ticks, places, 3) for name in tables}
    kinds = {**dict.fromkeys(_PER_NAME, "U"), "stamp_ns": "iu"}
    wrong = [
        f"{name} has shape {signals[name].shape} and type {signals[name].dtype}"
        for name, shape in shapes.items()
        if name in signals and (signals[name].shape != shape or signals[name].dtype.kind not in kinds.get(name, "fiub"))
    ]
    if wrong or not ticks:
        raise InputDataError(f"signals.npz: {'; '.join(wrong[:5]) or 'no ticks'}: not the results of a replay")
    time = np.asarray(signals["time_s"], dtype=float)
    found = [FileChannel("valid", "-", time, np.asarray(signals["valid"], dtype=float))]
    for name, units in _TIMED.items():
        if name in signals:
            table = np.asarray(signals[name], dtype=float)
            found += [FileChannel(f"{name}.{COORDINATES[i]}", unit, time, table[:, i]) for i, unit in enumerate(units)]
    for names, tables in _PER_NAME.items():
        for name, unit in tables.items():
            if name in signals:
                table = np.asarray(signals[name], dtype=float)
                for m, place in enumerate(signals[names]):
                    found += [FileChannel(f"{name}.{place}.{axis}", unit, time, table[:, m, i]) for i, axis in enumerate(AXES)]
    return [found], int(np.asarray(signals["stamp_ns"])[0])
