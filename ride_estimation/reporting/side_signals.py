# Copyright 2026 ride_estimation contributors
"""What a report needs beside the estimates: motion of the mount bases, load cells, accelerations by place, laws found."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.estimation.carried_points import CarriedPoint
from ride_estimation.estimation.offline import OfflineRun
from ride_estimation.frames import AXES
from ride_estimation.signals.recording import Recording
from ride_estimation.signals.ticks import channel_at
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class SideSignals:
    """Signals at the ticks of a replay.

    Attributes
    ----------
    base
        Mount -> specific force of its base, axes of the vehicle file, shape (N, 3) [m/s^2].
    cells
        Mount -> force a load cell measured, same axes, shape (N, 3) [N].
    accelerations
        Place in words -> specific force there, body axes, shape (N, 3) [m/s^2].
    offsets
        Mount -> attachment point minus CG of the body [m].
    elements
        (mount number, axis number) -> force element with the values found in this run.
    carried
        Points of carried bodies, simulated and measured.
    """

    base: Mapping[str, Array]
    cells: Mapping[str, Array]
    accelerations: Mapping[str, Array]
    offsets: Mapping[str, Array]
    elements: Mapping[tuple[int, int], ForceElement]
    carried: tuple[CarriedPoint, ...] = ()


def side_signals(
    recording: Recording, vehicle: Vehicle, run: OfflineRun, carried: tuple[CarriedPoint, ...] = ()
) -> SideSignals:
    """Return the side signals of a replay.

    Parameters
    ----------
    recording, vehicle, run
        What was read, what was known, what was found.
    carried
        Points of carried bodies; exposure is stated there too, as measured and as simulated.
    """
    base: dict[str, Array] = {}
    cells: dict[str, Array] = {}
    for sensor in vehicle.sensors.values():
        mount = vehicle.mounts.get(sensor.mount)
        channel = recording.channels.get(sensor.name)
        if mount is None or channel is None or sensor.mount not in run.mount_names:
            continue
        # what is drawn is a vector in the axes of the body
        on_base = sensor.kind in ("accelerometer", "imu") and sensor.triaxial and sensor.body == mount.base
        if on_base or sensor.kind == "force":
            values = channel_at(channel, run.stamp_ns)
            if values is not None:
                (base if on_base else cells)[sensor.mount] = values[:, :3] @ sensor.rotation.T
    accelerations = {}
    for name, measured in run.measured.items():
        sensor = vehicle.sensors[name]
        values = measured.astype(float)
        if sensor.triaxial and np.all(np.isfinite(values)):
            accelerations[place_of(name, sensor.body)] = values @ sensor.rotation.T
    for point in carried:
        accelerations[f"{point.body}, simulated from the motion below it"] = point.simulated
        if point.measured is not None:
            accelerations[place_of(point.sensor, point.body)] = point.measured
    offsets, elements = {}, {}
    found = {p.name: p for p in run.best_parameters}
    for m, name in enumerate(run.mount_names):
        mount = vehicle.mounts[name]
        body = vehicle.bodies.get(mount.body)
        offsets[name] = mount.position - (body.cg if body is not None else 0.0)
        for a, axis in enumerate(AXES):
            if axis in mount.elements:
                element = mount.elements[axis]
                for role in ("stiffness", "damping"):
                    estimate = found.get(f"{name}.{axis}.{role}")
                    if estimate is not None and estimate.prior:
                        element = element.scaled(role, estimate.value / estimate.prior)
                elements[m, a] = element
    return SideSignals(base, cells, accelerations, offsets, elements, carried)


def place_of(sensor: str, body: str) -> str:
    """Return where a sensor sits, in words; only names that say so count as the seat."""
    return f"{body}, {sensor}" if "seat" in f"{body} {sensor}".lower() else f"{body} at {sensor}"
