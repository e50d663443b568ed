# Copyright 2026 ride_estimation contributors
"""Which added sensor or known mass would help most: the tool an engineer runs before instrumenting a truck."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from ride_estimation.identification.fisher import Excitation, Identifiability, judge, parameter_names, sensitivities
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.vehicle import Vehicle

_TRANSDUCER_NOISE = 2e-5  # m, a potentiometric or draw-wire transducer of 100 mm range
_LOAD_CELL_NOISE = 20.0  # N, 0.1 % of a 20 kN load cell
_ACCELEROMETER_NOISE = 0.02  # m/s^2


@dataclasses.dataclass(frozen=True)
class Option:
    """One possible addition and what it brings.

    Attributes
    ----------
    name
        What is added.
    identifiable
        Parameters with a finite bound afterwards.
    median_relative_std
        Median bound over the parameters that are finite afterwards.
    gained
        Parameters that become identifiable by it.
    """

    name: str
    identifiable: int
    median_relative_std: float
    gained: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class SensorPlan:
    """Present state, what is known beforehand and the options, best first."""

    present: Identifiability
    known: tuple[str, ...]
    options: tuple[Option, ...]


def known_parameters(vehicle: Vehicle) -> tuple[str, ...]:
    """Return the parameters the vehicle file states as force references (known mass carries the inertia with it)."""
    names = parameter_names(vehicle)
    found = []
    for reference in vehicle.force_references:
        if reference.kind == "known_mass":
            found += [f"{reference.body}.mass", f"{reference.body}.inertia"]
        elif reference.kind == "known_stiffness":
            found.append(f"{reference.mount}.{reference.axis}.stiffness")
    return tuple(n for n in found if n in names)


def plan(vehicle: Vehicle, excitation: Excitation, known: Sequence[str] | None = None) -> SensorPlan:
    """Judge the sensor set of a vehicle file and rank what could be added to it.

    Parameters
    ----------
    known
        Parameters known beforehand; those the vehicle file declares where None.
    """
    declared = known_parameters(vehicle) if known is None else tuple(known)
    sensors = [s for s in vehicle.sensors.values() if s.kind in ("accelerometer", "imu", "displacement", "force")]
    candidates = _candidates(vehicle, sensors, declared)
    readings = sensitivities(vehicle, [*sensors, *(s for _, new, _ in candidates for s in new)], excitation)
    names = [s.name for s in sensors]
    present = judge(readings, names, declared)
    finite = set(_finite(present))
    options = []
    for name, extra_sensors, extra_known in candidates:
        result = judge(readings, [*names, *(s.name for s in extra_sensors)], [*declared, *extra_known])
        now = _finite(result)
        values = [s for s in result.relative_std if math.isfinite(s)]
        median = float(np.median(values)) if values else math.inf
        gained = tuple(n for n in now if n not in finite)
        options.append(Option(name, len(now) + len(extra_known), median, gained))
    ranked = sorted(options, key=lambda o: (-o.identifiable, o.median_relative_std))
    return SensorPlan(present, declared, tuple(ranked))


def _finite(result: Identifiability) -> list[str]:
    return [n for n, s in zip(result.names, result.relative_std) if math.isfinite(s)]


def _candidates(
    vehicle: Vehicle, sensors: Sequence[Sensor], known: Sequence[str]
) -> list[tuple[str, list[Sensor], list[str]]]:
    found: list[tuple[str, list[Sensor], list[str]]] = []
    have_displacement = {(s.mount, s.axis) for s in sensors if s.kind == "displacement"}
    have_force = {s.mount for s in sensors if s.kind == "force"}
    have_base = {s.mount for s in sensors if s.mount and s.kind in ("accelerometer", "imu")}
    prescribed = {m.name: m for m in vehicle.mounts.values() if m.base not in vehicle.bodies}
    missing_base = [
        Sensor(f"new_{m.base}_{m.name}", "accelerometer", "", m.base, m.name, position=m.position, noise_std=_ACCELEROMETER_NOISE)
        for m in prescribed.values()
        if m.name not in have_base
    ]
    if missing_base:
        found.append((f"accelerometers at the {len(missing_base)} mount bases without one", missing_base, []))
    for axis in ("x", "y", "z"):
        new = [
            Sensor(f"new_{m.name}_{axis}", "displacement", "", m.body, m.name, axis, noise_std=_TRANSDUCER_NOISE)
            for m in prescribed.values()
            if axis in m.elements and (m.name, axis) not in have_displacement
        ]
        if new:
            found.append((f"displacement transducers along {axis} at {len(new)} mounts", new, []))
    for m in prescribed.values():
        if m.name not in have_force:
            cell = Sensor(f"new_force_{m.name}", "force", "", m.body, m.name, noise_std=_LOAD_CELL_NOISE)
            found.append((f"load cell at {m.name}", [cell], []))
    for body in vehicle.bodies:
        if f"{body}.mass" not in known:
            names = [n for n in (f"{body}.mass", f"{body}.inertia") if n in parameter_names(vehicle) and n not in known]
            found.append((f"known mass and inertia of {body} (weigh it)", [], names))
    return found
