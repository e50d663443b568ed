# Copyright 2026 ride_estimation contributors
"""Reading a recorded run, or a part of it."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np

from ride_estimation.api.tables import dataframe, html_table
from ride_estimation.errors import ConfigurationError
from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.io.recorded_run import read_recorded_run
from ride_estimation.io.run_events import moment, run_events
from ride_estimation.io.vehicle_file import body_layout, load_vehicle
from ride_estimation.signals.recording import Recording, part_of
from ride_estimation.vehicles.vehicle import Vehicle


@dataclasses.dataclass(frozen=True, repr=False)
class Run:
    """A recorded run of a vehicle.

    Attributes
    ----------
    recording
        Samples as they arrived, by sensor.
    vehicle
        The vehicle whose sensors were read.
    """

    recording: Recording
    vehicle: Vehicle

    @property
    def duration_s(self) -> float:
        """Return the time from the first to the last stamp [s]."""
        return self.recording.duration_s

    def to_dataframe(self, sensor: str) -> Any:
        """Return the samples of one sensor: SI, sensor axes, index seconds since the first stamp of the run.

        Raises
        ------
        ConfigurationError
            The run has no such sensor, or pandas is not installed.
        """
        channel = self.recording.channels.get(sensor)
        if channel is None:
            raise ConfigurationError(f"{sensor!r} is not a sensor of the run; there are {', '.join(self.recording.channels)}")
        names = ("x", "y", "z", "rate_x", "rate_y", "rate_z") if channel.values.shape[1] > 1 else ("value",)
        columns = {name: channel.values[:, i] for i, name in enumerate(names[: channel.values.shape[1]])}
        return dataframe({"time_s": (channel.stamp_ns - self.recording.start_ns) * 1e-9, **columns}, "time_s")

    def __repr__(self) -> str:
        samples = sum(len(c.stamp_ns) for c in self.recording.channels.values())
        return (
            f"Run({self.recording.name}: {self.duration_s:.1f} s, {len(self.recording.channels)} sensors, {samples} samples, "
            f"vehicle {self.vehicle.name})"
        )

    def _repr_html_(self) -> str:
        rows = [
            [name, self.vehicle.sensors[name].kind, str(len(c.stamp_ns)), f"{_rate(c.stamp_ns):.4g}"]
            for name, c in self.recording.channels.items()
        ]
        return html_table(("sensor", "kind", "samples", "rate [Hz]"), rows, repr(self))


def _rate(stamp_ns: np.ndarray[Any, np.dtype[np.int64]]) -> float:
    span = float(np.ptp(stamp_ns)) * 1e-9 if len(stamp_ns) else 0.0
    return (len(stamp_ns) - 1) / span if span > 0.0 else 0.0


def read_run(
    path: str | Path,
    vehicle: Vehicle | str | Path,
    *,
    start_s: float | str | None = None,
    end_s: float | str | None = None,
    salvage: bool = False,
    channels: str | Path = "",
    events: str | Path = "",
) -> Run:
    """Read the sensors of a vehicle from a recorded run.

    Parameters
    ----------
    path
        rosbag2 folder, ``.mcap``, ``.db3``, ROS 1 ``.bag``, or a measurement file (MDF4, TDMS, RPC III, LabVIEW, CSV, Parquet).
    vehicle
        A loaded vehicle, a vehicle file, or the name of a bundled one.
    start_s, end_s
        Part of the run that is used: seconds since its first stamp, or the name of a marker; the whole run by default.
    salvage
        Use what is readable of a damaged file.
    channels
        Channel map of a measurement file; without it its channels must have the names an export writes.
    events
        Table of markers; without it those of the file or bag itself, and of ``RUN.events.csv`` beside it.

    Raises
    ------
    RideEstimationError
        Unreadable file, a sensor without samples, a part outside of the run.

    Examples
    --------
    >>> import ride_estimation as re
    >>> run = re.read_run("bags/standing", "truck_cab", start_s=2.0, end_s=5.0)
    >>> round(run.duration_s, 1)
    3.0
    """
    known = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
    recording = read_recorded_run(path, known, channels=channels, salvage=salvage)
    return Run(part_between(recording, path, start_s, end_s, events), known)


def part_between(
    recording: Recording, path: str | Path, start_s: float | str | None, end_s: float | str | None, events: str | Path = ""
) -> Recording:
    """Return the part of a recording between two times or markers, as in :func:`read_run`.

    Parameters
    ----------
    recording
        All of the run.
    path
        Where it was read from: markers are in it or beside it.
    start_s, end_s, events
        As in :func:`read_run`.

    Raises
    ------
    RideEstimationError
        A part outside of the run, a marker that there is not.
    """
    named = isinstance(start_s, str) or isinstance(end_s, str)
    markers = run_events(path, recording.start_ns, recording.events, events) if named else ()
    begin = moment(start_s, markers)
    end = moment(end_s, markers, -math.inf if begin is None else begin)
    return part_of(recording, begin, end)


def require_layout(vehicle: Vehicle) -> None:
    """Refuse a layout of sensors that cannot tell the motion of the body.

    Raises
    ------
    ConfigurationError
        Names what is not determined.
    """
    body = geometry_of(vehicle).body.name
    check = body_layout(vehicle, body)
    if not check.complete:
        raise ConfigurationError(check.sentence(body), where=f"sensor layout of {vehicle.name}")
