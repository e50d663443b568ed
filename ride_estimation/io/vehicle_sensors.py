# Copyright 2026 ride_estimation contributors
"""The measuring half of a vehicle file: sensors and force references."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.frames import AXES, rotation_from_rpy
from ride_estimation.io.document import Section, as_number, shown
from ride_estimation.io.vehicle_mechanics import FARTHEST
from ride_estimation.sensors.installation import USUAL, Installation
from ride_estimation.sensors.sensor import SENSOR_KINDS, Sensor
from ride_estimation.signals.correction import LONGEST_DELAY, Correction
from ride_estimation.vehicles.vehicle import ForceReference, Mount

Array = NDArray[np.float64]

#: unit of noise and full scale, default noise (one sample, standard deviation) by kind
_KIND_DEFAULTS: dict[str, tuple[str, float]] = {
    "accelerometer": ("m/s^2", 0.02),
    "imu": ("m/s^2", 0.02),
    "displacement": ("m", 1e-4),
    "speed": ("m/s", 0.1),
    "force": ("N", 20.0),
}
#: of one angular rate [rad/s], standard deviation where the file states none
_GYRO_NOISE = 0.001
#: range of a gain
GAIN_RANGE = (0.1, 10.0)
_MOUNT = {
    True: "the mount it measures", False: "mount whose base motion it measures; its base end is then taken to move as the sensor",
}
_PLACE = {True: "place of the sensor", False: "place of the sensor; default: that of its mount"}
#: by kind [its unit]
_LARGEST_BIAS = {"accelerometer": 50.0, "imu": 50.0, "displacement": 0.5, "speed": 20.0, "force": 1e5}
REFERENCE_KINDS = ("known_mass", "known_stiffness", "load_cell", "air_spring_pressure", "known_added_mass")


@dataclasses.dataclass(frozen=True)
class Names:
    """What the file declares, so that one broken entry does not make every reference to it a mistake.

    Attributes
    ----------
    bodies, mounts, sensors
        Declared names.
    readable_mounts
        Mounts that could be read.
    """

    bodies: tuple[str, ...]
    mounts: tuple[str, ...]
    sensors: tuple[str, ...]
    readable_mounts: Mapping[str, Mount]

    @property
    def bases(self) -> tuple[str, ...]:
        """Return the names of prescribed bases."""
        return tuple(sorted(({m.base for m in self.readable_mounts.values()} | {"chassis"}) - set(self.bodies)))


def read_sensors(sections: Mapping[str, Section], names: Names, problems: list[str]) -> dict[str, Sensor]:
    """Return the sensors that could be read; mistakes are added to ``problems``."""
    sensors: dict[str, Sensor] = {}
    for name, section in sections.items():
        before = len(problems)
        sensor = _read_sensor(name, section, names)
        section.finish()
        if sensor is not None and len(problems) == before:
            sensors[name] = sensor
    return sensors


def _read_sensor(name: str, section: Section, names: Names) -> Sensor | None:
    kind = section.text("kind", None, allowed=SENSOR_KINDS, meaning=f"one of {', '.join(SENSOR_KINDS)}")
    if kind is None:
        for key in section.keys:
            section.raw(key)
        return None
    unit, default_noise = _KIND_DEFAULTS[kind]
    needs_mount = kind in ("displacement", "force")
    mount_name = section.text("mount", None if needs_mount else "", allowed=names.mounts or None, meaning=_MOUNT[needs_mount])
    mount = names.readable_mounts.get(mount_name or "")
    axis = section.text("axis", None, allowed=AXES, meaning="axis of the mount it measures") if kind == "displacement" else ""
    body = _read_body(section, kind, mount, names)
    default_topic = {
        "displacement": "/mounts/displacement", "speed": "/vehicle/speed", "force": f"/mounts/{mount_name}/force_measured",
    }
    topic = section.text("topic", default_topic.get(kind), meaning="ROS topic of the messages")
    if topic is not None and (not topic.strip("/") or any(c.isspace() for c in topic)):
        section.note("topic", f"{topic!r} is not a topic name")
    motion = kind in ("accelerometer", "imu")
    position = section.vector("position", "m", required=motion, limit=FARTHEST, meaning=_PLACE[motion])
    noise = section.number_or("noise", unit, default_noise, lower=1e-12, upper=1e6, meaning="standard deviation of one sample")
    gyro = _GYRO_NOISE
    if kind == "imu":
        gyro = section.number_or(
            "gyro_noise", "rad/s", _GYRO_NOISE, lower=1e-12, upper=10.0, meaning="standard deviation of one angular rate"
        )
    full_scale = section.number_or(
        "full_scale", unit, float("inf"), lower=1e-9, meaning="largest magnitude of a reading; needed to notice clipping"
    )
    named = "name in the JointState message; default <mount>_<axis>"
    element = (section.text("element", f"{mount_name}_{axis}", meaning=named) if kind == "displacement" else "") or ""
    coupling = section.text(
        "coupling", "dc", allowed=("dc", "ac"), meaning="dc: gravity is in the signal; ac: the mean is removed in the sensor"
    )
    fallback = mount.position if mount is not None else np.zeros(3)
    axes = _read_axes(section) if kind == "accelerometer" else AXES
    return Sensor(
        name=name,
        kind=kind,
        topic=(topic or "") if (topic or "").startswith("/") else f"/{topic}",
        body=body or "",
        mount=mount_name or "",
        axis=axis or "",
        element=element,
        position=fallback.copy() if position is None else position,
        rotation=_read_rotation(section),
        noise_std=noise,
        gyro_noise_std=gyro,
        full_scale=full_scale,
        coupling=coupling or "dc",
        trust_despite_minus_one=section.flag(
            "trust_despite_minus_one", False, meaning="use messages whose covariance[0] is -1, which means: not provided"
        ),
        correction=_read_correction(section, kind, unit).only(axes),
        axes=axes,
        installation=_read_installation(section, kind),
    )


def _read_axes(section: Section) -> tuple[str, ...]:
    """Return the axes that an accelerometer measures, in the order x, y, z."""
    named = section.raw("axes", meaning="sensor axes it measures: a list of x, y, z; default all three")
    if named is None:
        return AXES
    if not isinstance(named, list) or not named or any(a not in AXES for a in named) or len(set(named)) < len(named):
        section.note("axes", f"{shown(named)} is not a list of one to three of x, y, z")
        return AXES
    return tuple(a for a in AXES if a in named)


def _read_installation(section: Section, kind: str) -> Installation | None:
    """Return how well a sensor is installed, None where the file says nothing or the kind has no such errors."""
    if kind not in ("accelerometer", "imu", "displacement"):
        return None
    part = section.section("installation", meaning="one standard deviation of its errors: a mapping, see `installation`")
    if part is None:
        return None
    usual, found = USUAL, {}
    if kind == "displacement":
        found["travel_zero"] = part.number_or("zero", "m", usual.travel_zero, lower=0.0, upper=0.5, meaning="zero at rest")
    else:
        found["bias"] = part.number_or("bias", "m/s^2", usual.bias, lower=0.0, upper=50.0, meaning="zero error of one axis")
        found["misalignment"] = part.number_or(
            "misalignment", "rad", usual.misalignment, lower=0.0, upper=1.0, meaning="angle about one axis"
        )
        found["position"] = part.number_or("position", "m", usual.position, lower=0.0, upper=1.0, meaning="along one axis")
    found["delay"] = part.number_or("delay", "s", usual.delay, lower=0.0, upper=LONGEST_DELAY, meaning="how late it may be")
    gain = part.plain("gain", lower=0.0, upper=1.0, meaning=f"relative error of one axis; default {usual.gain:g}")
    part.finish()
    return Installation(**found, gain=usual.gain if gain is None else gain)


def _read_correction(section: Section, kind: str, unit: str) -> Correction:
    """Return what the file says is wrong with the readings; one number of a sensor with axes holds for all of them."""
    delay = section.number_or(
        "delay", "s", 0.0, lower=-LONGEST_DELAY, upper=LONGEST_DELAY, meaning="how late the values are behind their stamps"
    )
    axes = 3 if SENSOR_KINDS[kind][0] >= 3 else 1
    gain = _per_axis(section, "gain", section.raw("gain", meaning=_gain_meaning(axes)), "", 1.0, axes)
    if any(not GAIN_RANGE[0] <= g <= GAIN_RANGE[1] for g in gain):
        section.note("gain", f"{list(gain)!r} is outside {GAIN_RANGE[0]:g} to {GAIN_RANGE[1]:g} (a turned axis is a rotation)")
        gain = ()
    largest = _LARGEST_BIAS[kind]
    meaning = f"added to the reading: {_numbers(axes)}, -{largest:g} to {largest:g}; default 0"
    located = section.unit_key("bias", unit, meaning=meaning)
    bias = () if located is None else _per_axis(section, located[0], section.raw(located[0]), unit, located[1], axes)
    if located is not None and any(abs(b) > largest for b in bias):
        section.note(located[0], f"{list(bias)!r} {unit} is outside {-largest:g} to {largest:g} {unit}")
        bias = ()
    right = all(g == 1.0 for g in gain) and all(b == 0.0 for b in bias)
    return Correction(delay, () if right else gain or (1.0,) * axes, () if right else bias or (0.0,) * axes)


def _numbers(axes: int) -> str:
    return "one number, or one per axis" if axes > 1 else "one number"


def _gain_meaning(axes: int) -> str:
    return f"reading over truth: {_numbers(axes)}, {GAIN_RANGE[0]:g} to {GAIN_RANGE[1]:g}; default 1"


def _per_axis(section: Section, key: str, value: Any, unit: str, factor: float, axes: int) -> tuple[float, ...]:
    """Return one number per axis from one number or a list, empty where absent or wrong."""
    if value is None:
        return ()
    numbers = [as_number(v) for v in value] if isinstance(value, list) else [as_number(value)] * axes
    if len(numbers) != axes or any(v is None for v in numbers):
        allowed = "a finite number" + (f" or a list of {axes}" if axes > 1 else "")
        section.note(key, f"{shown(value)} is not {allowed}{f' [{unit}]' if unit else ''}")
        return ()
    return tuple(v * factor for v in numbers if v is not None)


def _read_body(section: Section, kind: str, mount: Mount | None, names: Names) -> str | None:
    """Return the body of a sensor and check that it fits its mount."""
    if kind == "speed":
        return section.text("body", "chassis", meaning="what moves at this speed")
    default = mount.body if mount is not None and kind in ("displacement", "force") else None
    allowed = (*names.bodies, *names.bases) if names.bodies else None
    meaning = "body or base it sits on" + ("; default: the body of the mount" if kind in ("displacement", "force") else "")
    body = section.text("body", default, allowed=allowed, meaning=meaning)
    if mount is not None and body and body not in (mount.body, mount.base):
        section.note("body", f"{body!r} is not a side of mount {mount.name!r}, which joins {mount.body!r} and {mount.base!r}")
    return body


def _read_rotation(section: Section) -> Array:
    """Return the rotation from sensor to body axes, from roll-pitch-yaw angles or a matrix; identity by default."""
    turned = "roll, pitch, yaw that take sensor axes to body axes; default none"
    angles = section.vector("rotation", "rad", limit=2.0 * np.pi + 1e-9, meaning=turned)
    matrix = section.raw("rotation_matrix", meaning="the same as three rows of three numbers, instead of the angles")
    if matrix is None:
        return np.eye(3) if angles is None else rotation_from_rpy(*angles)
    if angles is not None:
        section.note("rotation_matrix", "given beside rotation angles; one of them is allowed")
    rows = matrix if isinstance(matrix, list) else []
    numbers = [[as_number(v) for v in row] if isinstance(row, list) else [] for row in rows]
    if [len(row) for row in numbers] != [3, 3, 3] or any(v is None for row in numbers for v in row):
        section.note("rotation_matrix", f"{shown(matrix)} is not three rows of three finite numbers")
        return np.eye(3)
    rotation = np.array(numbers, dtype=float)
    if np.max(np.abs(rotation @ rotation.T - np.eye(3))) > 1e-3:
        section.note("rotation_matrix", "rows are not orthogonal unit vectors (sensor axes to body axes)")
        return np.eye(3)
    if np.linalg.det(rotation) < 0.0:
        section.note("rotation_matrix", "left-handed (determinant -1): one axis has the wrong sign")
        return np.eye(3)
    return rotation


def topic_problems(sensors: Mapping[str, Sensor]) -> list[str]:
    """Return one problem per pair of sensors that would read the same data."""
    problems = []
    owner: dict[tuple[str, str], Sensor] = {}
    for sensor in sensors.values():
        key = (sensor.topic, sensor.element)
        other = owner.setdefault(key, sensor)
        if other is not sensor:
            what = f"element {sensor.element!r} of topic" if sensor.element else "topic"
            problems.append(f"sensors.{sensor.name}.topic: {what} {sensor.topic!r} is already used by sensor {other.name!r}")
        elif any(s.kind != sensor.kind and s.topic == sensor.topic for s in owner.values()):
            problems.append(f"sensors.{sensor.name}.topic: {sensor.topic!r} is used by sensors of different kinds")
    return problems


def read_force_references(top: Section, names: Names, sensors: Mapping[str, Sensor]) -> tuple[ForceReference, ...]:
    """Return what anchors forces in absolute terms; mistakes are noted in ``top``."""
    entries = top.raw("force_references", meaning="list of what fixes the absolute scale of forces; see below")
    if entries is None:
        return ()
    if not isinstance(entries, list):
        top.note("force_references", f"{shown(entries)} is not a list")
        return ()
    references = []
    for index, entry in enumerate(entries):
        section = Section(entry, f"force_references[{index}]", top.problems)
        before = len(top.problems)
        reference = _read_reference(section, names, sensors)
        section.finish()
        if reference is not None and len(top.problems) == before:
            references.append(reference)
    return tuple(references)


def _read_reference(section: Section, names: Names, sensors: Mapping[str, Sensor]) -> ForceReference | None:
    kind = section.text("kind", None, allowed=REFERENCE_KINDS, meaning=f"one of {', '.join(REFERENCE_KINDS)}")
    if kind is None:
        for key in section.keys:
            section.raw(key)
        return None
    body = mount = axis = sensor = ""
    details: dict[str, Any] = {}
    if kind in ("known_mass", "known_added_mass"):
        body = section.text("body", None, allowed=names.bodies or None, meaning="the body") or ""
    else:
        mount = section.text("mount", None, allowed=names.mounts or None, meaning="the mount") or ""
    if kind in ("known_stiffness", "air_spring_pressure"):
        usual = "z" if kind == "air_spring_pressure" else None
        axis = section.text("axis", usual, allowed=AXES, meaning="axis of the mount") or ""
        elements = names.readable_mounts[mount].elements if mount in names.readable_mounts else None
        if elements is not None and axis and axis not in elements:
            section.note("axis", f"mount {shown(mount)} has no force element on axis {axis!r}")
    if kind == "load_cell":
        cells = [s.name for s in sensors.values() if s.kind == "force"]
        sensor = section.text("sensor", None, allowed=cells, meaning="a sensor of kind force") or ""
    if kind == "known_added_mass":
        details["mass"] = section.number("mass", "kg", required=True, lower=-1e6, upper=1e6, meaning="mass added")
        details["position"] = section.vector("position", "m", limit=FARTHEST, meaning="place of the mass; default: the CG")
        details["from_s"] = section.number("from", "s", required=True, lower=0.0, meaning="when, since the start of the run")
        details["to_s"] = section.number("to", "s", lower=0.0, meaning="until when; default: the end of the run")
    if kind == "air_spring_pressure":
        details["pressure"] = section.number("pressure", "Pa", required=True, lower=0.0, upper=1e8, meaning="gauge, at rest")
        details["area"] = section.number("area", "m^2", required=True, lower=1e-6, upper=10.0, meaning="effective area")
        details["force_std"] = section.number("force_std", "N", lower=1e-9, meaning="standard deviation of pressure times area")
    meaning = "standard deviation as a share of the reference"
    details["relative_std"] = section.plain("relative_std", lower=1e-9, upper=10.0, meaning=meaning)
    return ForceReference(kind, body, mount, axis, sensor, {k: v for k, v in details.items() if v is not None})
