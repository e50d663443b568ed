# Copyright 2026 ride_estimation contributors
"""Vehicle files: YAML to :class:`~ride_estimation.vehicles.vehicle.Vehicle` and back, all mistakes reported at once.

Schema: ``docs/vehicle_file.md`` lists every key, ``config/vehicles/every_key.yaml`` shows every key in use.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ride_estimation.elements.registry import SEEN
from ride_estimation.errors import ConfigurationError
from ride_estimation.frames import COORDINATES
from ride_estimation.io.atomic import write_atomically
from ride_estimation.io.document import Section, read_yaml
from ride_estimation.io.vehicle_mechanics import read_bodies, read_mounts, seen_to_mapping, stiffness_unit_problems
from ride_estimation.io.vehicle_sensors import Names, read_force_references, read_sensors, topic_problems
from ride_estimation.resources import shared_path
from ride_estimation.sensors.layout import LayoutCheck, check_layout
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.units import key_about_an_axis
from ride_estimation.vehicles.vehicle import STANDARD_GRAVITY, Body, ForceReference, Mount, Prior, Vehicle

SCHEMA = "ride_estimation/vehicle/1"


def load_vehicle(path: str | Path) -> Vehicle:
    """Load and check a vehicle file.

    Parameters
    ----------
    path
        YAML file of schema ``ride_estimation/vehicle/1``, or the name of a bundled one (:func:`find_vehicle_file`).

    Raises
    ------
    ConfigurationError
        All mistakes at once: field, value given, what is allowed.
    """
    path = find_vehicle_file(path)
    document = read_yaml(path)
    vehicle = vehicle_from_mapping(document, where=str(path))
    return dataclasses.replace(vehicle, checksum=hashlib.sha256(path.read_bytes()).hexdigest())


def find_vehicle_file(given: str | Path) -> Path:
    """Return the path of a vehicle file that is named by its path or, in one word without ``.yaml``, as a bundled one.

    Parameters
    ----------
    given
        ``my/truck.yaml`` or ``truck_cab``.

    Raises
    ------
    ConfigurationError
        One word that is neither a file nor a bundled vehicle; the message lists these.
    """
    path = Path(given)
    with contextlib.suppress(RuntimeError):  # "~nobody": a file may be called so
        path = path.expanduser()
    if path.exists() or path.suffix or len(path.parts) != 1:
        return path
    bundled = {file.stem: file for file in sorted(shared_path("config", "vehicles").glob("*.yaml"))}
    if path.name not in bundled:
        names = ", ".join(bundled)
        raise ConfigurationError(f"no such file, and no bundled vehicle of that name; there are {names}", where=str(given))
    return bundled[path.name]


def vehicle_from_mapping(document: Any, where: str = "vehicle") -> Vehicle:
    """Build a vehicle from the mapping of a vehicle file.

    Parameters
    ----------
    document
        Mapping as YAML gives it.
    where
        Name for messages.

    Raises
    ------
    ConfigurationError
        All mistakes at once.
    """
    problems: list[str] = []
    top = Section(document, "", problems)
    top.text("schema", None, allowed=(SCHEMA,), meaning=f"must be {SCHEMA}")
    name = top.text("name", None, meaning="a short name of the vehicle")
    description = top.text("description", "", meaning="what the vehicle is and where its numbers come from")
    gravity = top.number_or("gravity", "m/s^2", STANDARD_GRAVITY, lower=0.0, upper=30.0, meaning="local acceleration of gravity")
    body_sections = top.sections("bodies", required=True, meaning="at least one rigid body")
    mount_sections = top.sections("mounts", required=True, meaning="at least one mount")
    sensor_sections = top.sections("sensors", meaning="sensors by name; none for a vehicle that is only simulated")
    bodies = read_bodies(body_sections, problems)
    mounts = read_mounts(mount_sections, tuple(body_sections), problems)
    names = Names(tuple(body_sections), tuple(mount_sections), tuple(sensor_sections), mounts)
    sensors = read_sensors(sensor_sections, names, problems)
    references = read_force_references(top, names, sensors)
    top.finish()
    problems += topic_problems(sensors)
    if not problems:
        problems += stiffness_unit_problems(bodies, mounts)
    if problems:
        raise ConfigurationError(problems, where=where)
    return Vehicle(
        name=name or "",
        bodies=bodies,
        mounts=mounts,
        sensors=sensors,
        force_references=references,
        gravity=gravity,
        description=description or "",
    )


def body_layout(vehicle: Vehicle, body: str) -> LayoutCheck:
    """Judge the accelerometer layout on one body of a vehicle.

    Parameters
    ----------
    vehicle
        The vehicle.
    body
        Name of one of its bodies.
    """
    sensors = [s for s in vehicle.sensors.values() if s.body == body]
    return check_layout(sensors, vehicle.bodies[body].cg, vehicle.bodies[body].coordinates)


def save_vehicle(vehicle: Vehicle, path: str | Path) -> None:
    """Write a vehicle file that loads again to an equal vehicle.

    Parameters
    ----------
    vehicle
        The vehicle.
    path
        File to write.
    """
    text = yaml.safe_dump(vehicle_to_mapping(vehicle), sort_keys=False, allow_unicode=True, width=120)
    write_atomically(Path(path), text)


def vehicle_to_mapping(vehicle: Vehicle) -> dict[str, Any]:
    """Return the YAML form of a vehicle, SI units."""
    document: dict[str, Any] = {"schema": SCHEMA, "name": vehicle.name}
    if vehicle.description:
        document["description"] = vehicle.description
    document["gravity_m_per_s2"] = float(vehicle.gravity)
    document["bodies"] = {name: _body_mapping(body) for name, body in vehicle.bodies.items()}
    document["mounts"] = {name: _mount_mapping(mount) for name, mount in vehicle.mounts.items()}
    document["sensors"] = {name: _sensor_mapping(sensor) for name, sensor in vehicle.sensors.items()}
    if vehicle.force_references:
        document["force_references"] = [_reference_mapping(reference) for reference in vehicle.force_references]
    return document


def _quantity(prior: Prior) -> Any:
    extra: dict[str, Any] = {}
    if prior.std is not None:
        extra["std"] = float(prior.std)
    if np.isfinite(prior.lower) and np.isfinite(prior.upper):
        extra["range"] = [float(prior.lower), float(prior.upper)]
    if prior.source:
        extra["source"] = prior.source
    return {"value": float(prior.value), **extra} if extra else float(prior.value)


def _body_mapping(body: Body) -> dict[str, Any]:
    mapping: dict[str, Any] = {"mass_kg": _quantity(body.mass)}
    cg = [float(v) for v in body.cg]
    mapping["cg_m"] = cg if body.cg_std is None else {"value": cg, "std": [float(v) for v in body.cg_std]}
    i = body.inertia
    mapping["inertia_kg_m2"] = {
        "ixx": float(i[0, 0]), "iyy": float(i[1, 1]), "izz": float(i[2, 2]),
        "ixy": float(i[0, 1]), "ixz": float(i[0, 2]), "iyz": float(i[1, 2]),
    }
    if body.inertia_relative_std is not None:
        mapping["inertia_kg_m2"]["relative_std"] = float(body.inertia_relative_std)
    mapping["degrees_of_freedom"] = list(body.coordinates)
    if body.source:
        mapping["source"] = body.source
    return mapping


def _mount_mapping(mount: Mount) -> dict[str, Any]:
    axes: dict[str, Any] = {}
    for axis, element in mount.elements.items():
        mapping = element.to_mapping()
        priors = {address: prior for (on, address), prior in mount.priors.items() if on == axis}
        for address, (p, value) in element.addressed().items():
            if address in priors:
                _put(mapping, address, p.key, _quantity(dataclasses.replace(priors[address], value=value)))
        axes[axis] = _turned(mapping) if axis in COORDINATES[3:] else mapping
        if axis in mount.seen:
            axes[axis][SEEN] = seen_to_mapping(mount.seen[axis], axis)
    mapping = {"position_m": [float(v) for v in mount.position], "body": mount.body, "base": mount.base, "axes": axes}
    if mount.static_load is not None:
        mapping["static_load_n"] = _quantity(mount.static_load)
    return mapping


def _turned(mapping: Any) -> Any:
    """Return the YAML form of an element with the keys of a roll, pitch or yaw axis."""
    if isinstance(mapping, list):
        return [_turned(entry) for entry in mapping]
    if isinstance(mapping, dict):
        return {key_about_an_axis(key): _turned(value) for key, value in mapping.items()}
    return mapping


def _put(mapping: dict[str, Any], address: str, key: str, quantity: Any) -> None:
    """Put a quantity at the place an element address (``elements[1].stiffnesses[0]``) has in the YAML form."""
    place: Any = mapping
    for step in address.split(".")[:-1]:
        name, _, index = step.partition("[")
        place = place[name][int(index[:-1])] if index else place[name]
    _, _, index = address.rsplit(".", maxsplit=1)[-1].partition("[")
    if index:
        place[key][int(index[:-1])] = quantity
    else:
        place[key] = quantity


def _sensor_mapping(sensor: Sensor) -> dict[str, Any]:
    unit = {"displacement": "m", "speed": "m_per_s", "force": "n"}.get(sensor.kind, "m_per_s2")
    mapping: dict[str, Any] = {"kind": sensor.kind, "topic": sensor.topic, "body": sensor.body}
    for key in ("mount", "axis", "element"):
        if getattr(sensor, key):
            mapping[key] = getattr(sensor, key)
    mapping["position_m"] = [float(v) for v in sensor.position]
    if not np.array_equal(sensor.rotation, np.eye(3)):
        mapping["rotation_matrix"] = [[float(v) for v in row] for row in sensor.rotation]
    if not sensor.triaxial:
        mapping["axes"] = list(sensor.axes)
    mapping[f"noise_{unit}"] = float(sensor.noise_std)
    if sensor.kind == "imu":
        mapping["gyro_noise_rad_per_s"] = float(sensor.gyro_noise_std)
    if np.isfinite(sensor.full_scale):
        mapping[f"full_scale_{unit}"] = float(sensor.full_scale)
    mapping["coupling"] = sensor.coupling
    if sensor.trust_despite_minus_one:
        mapping["trust_despite_minus_one"] = True
    correction = sensor.correction
    if correction.delay:
        mapping["delay_s"] = float(correction.delay)
    for key, values, neutral in (("gain", correction.gain, 1.0), (f"bias_{unit}", correction.bias, 0.0)):
        if any(v != neutral for v in values):
            mapping[key] = [float(v) for v in values] if len(values) > 1 else float(values[0])
    left = sensor.installation
    if left is not None:
        own = {"zero_m": left.travel_zero} if sensor.kind == "displacement" else {
            "bias_m_per_s2": left.bias, "misalignment_rad": left.misalignment, "position_m": left.position,
        }  # fmt: skip
        mapping["installation"] = {key: float(v) for key, v in (own | {"gain": left.gain, "delay_s": left.delay}).items()}
    return mapping


def _reference_mapping(reference: ForceReference) -> dict[str, Any]:
    mapping: dict[str, Any] = {"kind": reference.kind}
    for key in ("body", "mount", "axis", "sensor"):
        if getattr(reference, key):
            mapping[key] = getattr(reference, key)
    suffix = {
        "mass": "mass_kg", "position": "position_m", "pressure": "pressure_pa", "area": "area_m2", "force_std": "force_std_n",
    }
    for key, value in reference.details.items():
        mapping[suffix.get(key, key)] = [float(v) for v in value] if key == "position" else float(value)
    return mapping
