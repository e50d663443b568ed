# Copyright 2026 ride_estimation contributors
"""Which channel of a measurement file is which component of which sensor, and in what unit.

A map is a YAML file::

    schema: ride_estimation/channels/1
    time: {channel: Time_1, unit: ms}          # where the file does not say it; {rate_hz: 500}: a file without time
    channels:
      cab_front_left.x: AccFL_X                # unit as the file states it
      cab_front_left.y: {channel: AccFL_Y, unit: g, factor: -1.0}
      front_left_travel: {channel: Pot1, unit: mm, offset: -41.5}

Without a map channels are expected under the names ``<sensor>.<component>`` that an export writes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ride_estimation.errors import ConfigurationError
from ride_estimation.frames import AXES
from ride_estimation.io.document import Section, read_yaml, shown
from ride_estimation.io.files.channels import TIME_UNITS, TimeSource, unit_factor
from ride_estimation.sensors.sensor import Sensor

SCHEMA = "ride_estimation/channels/1"
_COMPONENTS = {
    "accelerometer": AXES, "imu": (*AXES, "gyro_x", "gyro_y", "gyro_z"), "force": AXES, "displacement": ("",), "speed": ("",),
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Source:
    """Where one component comes from: ``factor * value + offset`` in ``unit``.

    Attributes
    ----------
    channel
        Name in the file.
    unit
        Overrules the unit of the file; empty takes that.
    factor
        Sign or sensitivity.
    offset
        Added after the factor, in the same unit.
    """

    channel: str
    unit: str = ""
    factor: float = 1.0
    offset: float = 0.0


@dataclasses.dataclass(frozen=True)
class ChannelMap:
    """Sources by component name, and the time of files that do not know theirs."""

    sources: Mapping[str, Source]
    time: TimeSource = dataclasses.field(default_factory=TimeSource)


def components(sensor: Sensor) -> tuple[tuple[str, str], ...]:
    """Return (component name, SI unit) of every value that a sensor measures, in the order of its samples."""
    units = {"accelerometer": "m/s^2", "imu": "m/s^2", "force": "N", "displacement": "m", "speed": "m/s"}
    return tuple(
        (f"{sensor.name}.{part}" if part else sensor.name, "rad/s" if part.startswith("gyro") else units[sensor.kind])
        for part, measured in zip(_COMPONENTS[sensor.kind], sensor.measured.tolist()) if measured
    )  # fmt: skip


def default_map(sensors: Mapping[str, Sensor]) -> ChannelMap:
    """Return the map of a file whose channels have the names an export writes."""
    return ChannelMap({name: Source(name) for sensor in sensors.values() for name, _ in components(sensor)})


def load_channel_map(path: Path, sensors: Mapping[str, Sensor]) -> ChannelMap:
    """Load and check a channel map.

    Parameters
    ----------
    path
        YAML file.
    sensors
        Of the vehicle.

    Raises
    ------
    ConfigurationError
        All mistakes at once: unknown components with what is allowed, unknown units, a sensor with some components only.
    """
    problems: list[str] = []
    top = Section(read_yaml(path), "", problems)
    top.text("schema", None, allowed=(SCHEMA,), meaning=f"must be {SCHEMA}")
    time = Section(top.raw("time") or {}, "time", problems)
    unit = time.text("unit", "", allowed=TIME_UNITS) or ""
    source_of_time = TimeSource(time.text("channel", "") or "", unit, time.plain("rate_hz", lower=1e-3, upper=1e6) or 0.0)
    time.finish()
    entries = top.raw("channels")
    top.finish()
    if not isinstance(entries, dict) or not entries:
        problems.append("channels: a mapping of <sensor>.<component> to channels of the file is needed")
        entries = {}
    known = {name: unit for sensor in sensors.values() for name, unit in components(sensor)}
    sources = {}
    for name, entry in entries.items():
        if name not in known:
            problems.append(f"channels.{name}: no component of the vehicle's sensors; allowed: {', '.join(known)}")
            continue
        source = _source(str(name), entry, known[name], problems)
        if source is not None:
            sources[str(name)] = source
    for sensor in sensors.values():
        wanted = [name for name, _ in components(sensor)]
        missing = [name for name in wanted if name not in entries]
        if missing and len(missing) < len(wanted):
            problems.append(f"channels: {', '.join(missing)} missing; sensor {sensor.name!r} needs all of its components")
    if problems:
        raise ConfigurationError(problems, where=str(path))
    return ChannelMap(sources, source_of_time)


def _source(name: str, entry: Any, unit: str, problems: list[str]) -> Source | None:
    if isinstance(entry, str):
        return Source(entry)
    before = len(problems)
    section = Section(entry, f"channels.{name}", problems)
    channel = section.text("channel", None, meaning="the channel of the file")
    given = section.text("unit", "") or ""
    factor, offset = section.plain("factor"), section.plain("offset")
    section.finish()
    if given:
        found = unit_factor(given)
        if found is None or found[0] != unit:
            problems.append(f"channels.{name}.unit: {shown(given)} is not a valid unit for {unit}")
    if len(problems) > before or channel is None:
        return None
    return Source(channel, given, 1.0 if factor is None else factor, 0.0 if offset is None else offset)
