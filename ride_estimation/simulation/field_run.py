# Copyright 2026 ride_estimation contributors
"""A field run: the truck is driven, the cab shakes, the sensors measure; what is recorded and what is true."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.errors import ConfigurationError
from ride_estimation.frames import AXES, COORDINATES, point_motion_matrix
from ride_estimation.sensors.measurement import SensorErrors, UnitErrors, draw_unit, measure, sample_times
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.simulation.response import Response
from ride_estimation.simulation.rotation import RotationResponse, locked_bodies, simulate_full_rotation
from ride_estimation.simulation.scenario import Scenario
from ride_estimation.simulation.simulate import simulate
from ride_estimation.simulation.truck_drive import Drive, drive
from ride_estimation.vehicles.assembly import Assembly, assemble
from ride_estimation.vehicles.modes import toppling_motions
from ride_estimation.vehicles.vehicle import Prior, Vehicle

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Truth:
    """What really happened, on the truth time base.

    Attributes
    ----------
    parameters
        True parameters, units and all, ready for JSON.
    signals
        Name -> array whose first axis is time (``time_s`` among them), ready for ``truth.npz``.
    """

    parameters: dict[str, Any]
    signals: dict[str, NDArray[Any]]


@dataclasses.dataclass(frozen=True)
class FieldRun:
    """A recorded run and its truth."""

    recording: Recording
    truth: Truth


def true_vehicle(scenario: Scenario, vehicle: Vehicle) -> Vehicle:
    """Return the vehicle as it really is: the vehicle file with the scenario's deviations.

    Raises
    ------
    ConfigurationError
        A mount, axis, parameter or body the vehicle file does not have; all at once.
    """
    problems = _unknown_names(scenario, vehicle)
    if scenario.payloads and not has_full_rotation(vehicle):
        problems.append(
            f"payloads: need a vehicle whose bodies have {', '.join(COORDINATES)} as degrees of freedom, or some of "
            f"{', '.join(AXES)} on such a body; {', '.join(locked_bodies(vehicle))} cannot carry any"
        )
    if problems:
        raise ConfigurationError(problems, where=scenario.name)
    changes: dict[tuple[str, str], ForceElement] = dict(scenario.true_elements)
    for (mount, axis, parameter), factor in scenario.true_factors.items():
        element = changes.get((mount, axis), vehicle.mounts[mount].elements[axis])
        changes[mount, axis] = element.with_values({parameter: element.addressed()[parameter][1] * factor})
    bodies = dict(vehicle.bodies)
    for name, change in scenario.true_bodies.items():
        body = bodies[name]
        mass = float(change.get("mass", body.mass.value))
        cg = np.asarray(change.get("cg", body.cg), dtype=float)
        inertia = body.inertia * (mass / body.mass.value)
        bodies[name] = dataclasses.replace(body, mass=Prior(mass), cg=cg, inertia=inertia)
    return dataclasses.replace(vehicle.replace_elements(changes), bodies=bodies)


def _unknown_names(scenario: Scenario, vehicle: Vehicle) -> list[str]:
    problems = []
    given = {(m, a): vehicle.mounts[m].elements[a] for m in vehicle.mounts for a in vehicle.mounts[m].elements}
    components = ", ".join(f"{m}.{a}" for m, a in given)
    for key in scenario.true_elements:
        if key not in given:
            problems.append(f"true_elements.{key[0]}.{key[1]}: no such mount axis; allowed: {components}")
    for mount, axis, parameter in scenario.true_factors:
        element = scenario.true_elements.get((mount, axis), given.get((mount, axis)))
        names = [] if element is None else list(element.addressed())
        if element is None:
            problems.append(f"true_factors.{mount}.{axis}: no such mount axis; allowed: {components}")
        elif parameter not in names:
            problems.append(f"true_factors.{mount}.{axis}.{parameter}: no such parameter; allowed: {', '.join(names)}")
    bodies = [p.body for p in scenario.payloads] + [d.body for d in scenario.disturbances] + list(scenario.true_bodies)
    known = ", ".join(vehicle.bodies)
    problems += [f"body {b!r}: not in the vehicle file; allowed: {known}" for b in bodies if b not in vehicle.bodies]
    sensors = [f.sensor for f in scenario.faults] + list(scenario.own_errors)
    known = ", ".join(vehicle.sensors)
    problems += [f"sensor {s!r}: not in the vehicle file; allowed: {known}" for s in sensors if s not in vehicle.sensors]
    return problems


def run_scenario(scenario: Scenario, vehicle: Vehicle, progress: Callable[[float], None] = lambda share: None) -> FieldRun:
    """Simulate a field run.

    Parameters
    ----------
    vehicle
        The loaded vehicle file of the scenario.
    progress
        Called with the share of the work just finished.

    Raises
    ------
    ConfigurationError
        Names the vehicle file does not have, bodies without six coordinates, a vehicle that topples at rest.
    """
    real = true_vehicle(scenario, vehicle)
    assembly = assemble(real)
    toppling = toppling_motions(assembly)
    if toppling:
        raise ConfigurationError(
            [f"{t}; check mount positions, height of the CG and vertical stiffness" for t in toppling], where=vehicle.name
        )
    driven = drive(scenario, real)
    progress(0.4)
    lead_s = driven.lead / scenario.simulation_rate
    load = _disturbance_load(scenario, assembly, driven)
    response: Response
    if has_full_rotation(real):
        payloads = [dataclasses.replace(p, begin=p.begin + lead_s) for p in scenario.payloads]
        response = simulate_full_rotation(assembly, driven.base, load=load, payloads=payloads)
    else:
        response = simulate(assembly, driven.base, load=load)
    progress(0.3)
    channels, units = _measure_all(scenario, real, response, driven)
    progress(0.2)
    recording = Recording(name=scenario.name, channels=channels)
    truth = Truth(_true_parameters(scenario, real, units), _true_signals(scenario, real, response, driven))
    progress(0.1)
    return FieldRun(recording, truth)


def has_full_rotation(vehicle: Vehicle) -> bool:
    """Return whether exact rigid-body kinematics apply: no body has locked coordinates."""
    return not locked_bodies(vehicle)


def _disturbance_load(scenario: Scenario, assembly: Assembly, driven: Drive) -> Array | None:
    if not scenario.disturbances:
        return None
    time = (np.arange(driven.base.samples) - driven.lead) / scenario.simulation_rate
    bodies = list(assembly.vehicle.bodies.values())
    full = has_full_rotation(assembly.vehicle)
    load = np.zeros((len(time), len(COORDINATES) * len(bodies) if full else len(assembly.coordinates)))
    for d in scenario.disturbances:
        wave = np.where(time >= d.begin, d.amplitude * np.sin(2.0 * np.pi * d.frequency * time + d.phase), 0.0)
        row = assembly.point_map(d.body, d.position)[AXES.index(d.axis)]
        if full:  # force and moment on the body itself; what its guides make of them is for the simulation to say
            number = [b.name for b in bodies].index(d.body)
            row = np.zeros(load.shape[1])
            row[6 * number : 6 * number + 6] = point_motion_matrix(d.position - bodies[number].cg)[AXES.index(d.axis)]
        load += np.outer(wave, row)
    return load


def _measure_all(
    scenario: Scenario, vehicle: Vehicle, response: Response, driven: Drive
) -> tuple[dict[str, Channel], dict[str, UnitErrors]]:
    duration = scenario.duration
    channels: dict[str, Channel] = {}
    units: dict[str, UnitErrors] = {}
    times: dict[str, Array] = {}
    for number, sensor in enumerate(vehicle.sensors.values()):
        errors = _for_kind(sensor, scenario.own_errors.get(sensor.name, scenario.sensor_errors))
        generator = np.random.default_rng([scenario.seed, 1000 + number])
        units[sensor.name] = draw_unit(sensor, errors, generator)
        if sensor.topic not in times:
            times[sensor.topic] = sample_times(duration, errors, generator)
        ideal = _ideal(sensor, response, driven)[driven.lead :]
        faults = [f for f in scenario.faults if f.sensor == sensor.name]
        channels[sensor.name] = measure(
            sensor, ideal, scenario.simulation_rate, times[sensor.topic], errors, units[sensor.name], faults, generator,
            scenario.start_ns,
        )
    return channels, units


def _for_kind(sensor: Sensor, errors: SensorErrors) -> SensorErrors:
    """Return the errors with those in m/s^2 and rad, which are meant for accelerometers, switched off for other kinds."""
    if sensor.kind in ("accelerometer", "imu"):
        return errors
    return dataclasses.replace(errors, quantisation=0.0, bias_std=0.0, misalignment_std=0.0)


def _ideal(sensor: Sensor, response: Response, driven: Drive) -> Array:
    return driven.speed[:, None] if sensor.kind == "speed" else response.specific_force(sensor.name)


def _true_parameters(scenario: Scenario, vehicle: Vehicle, units: Mapping[str, UnitErrors]) -> dict[str, Any]:
    return {
        "kinematics": "full rotation" if has_full_rotation(vehicle) else "small rotations",
        "bodies": {
            b.name: {"mass_kg": b.mass.value, "cg_m": b.cg.tolist(), "inertia_kg_m2": b.inertia.tolist()}
            for b in vehicle.bodies.values()
        },
        "mounts": {
            m.name: {axis: element.to_mapping() for axis, element in m.elements.items()} for m in vehicle.mounts.values()
        },
        "payloads": [
            {
                "body": p.body, "mass_kg": p.mass, "position_m": np.asarray(p.position).tolist(), "from_s": p.begin,
                "over_s": p.duration,
            }
            for p in scenario.payloads
        ],
        "sensors": {
            name: {"bias": u.bias.tolist(), "gain": u.gain, "rotation": u.rotation.tolist()} for name, u in units.items()
        },
    }


def _true_signals(
    scenario: Scenario, vehicle: Vehicle, response: Response, driven: Drive
) -> dict[str, NDArray[Any]]:
    """Return the truth at its own rate, times on the exact grid of the simulation."""
    step = max(1, round(scenario.simulation_rate / scenario.truth_rate))
    pick = slice(driven.lead, None, step)
    signals: dict[str, NDArray[Any]] = {
        "time_s": (np.arange(response.base_motion.samples) - driven.lead)[pick] / scenario.simulation_rate,
        "mount_names": np.array(vehicle.mount_names),
        "mount_force": response.mount_force()[pick],
        "mount_deflection": response.mount_array("deflection")[pick],
        "mount_rate": response.mount_array("rate")[pick],
        "vehicle_speed": driven.speed[pick],
    }
    for number, body in enumerate(vehicle.bodies):
        suffix = "" if number == 0 else f"_{body}"
        exact = response if isinstance(response, RotationResponse) else None
        signals[f"cg_accel{suffix}"] = (exact.cg_motion(body) if exact else response.body_motion(body))[pick]
        signals[f"reference_accel{suffix}"] = response.body_motion(body)[pick]
        signals[f"inertial_load{suffix}"] = response.inertial_load(body)[pick]
        signals[f"angles{suffix}"] = response.body_motion(body, "coordinates")[pick, 3:]
        signals[f"angular_rate{suffix}"] = response.body_motion(body, "rates")[pick, 3:]
        if exact:
            signals[f"mass{suffix}"] = exact.mass[pick, number]
            signals[f"cg_offset{suffix}"] = exact.offset[pick, number]
    return {k: v if k in ("time_s", "mount_names") else v.astype(np.float32) for k, v in signals.items()}
