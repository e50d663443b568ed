# Copyright 2026 ride_estimation contributors
"""Scenario files of simulated field runs; all mistakes of a file are reported at once."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.registry import element_from_mapping
from ride_estimation.errors import ConfigurationError
from ride_estimation.excitation.road import CLASS_ROUGHNESS, COHERENCE_LENGTH
from ride_estimation.frames import AXES
from ride_estimation.io.document import Section, as_number, read_yaml, shown
from ride_estimation.sensors.measurement import FAULT_KINDS, Fault, SensorErrors
from ride_estimation.simulation.rotation import Payload
from ride_estimation.simulation.scenario import (
    OBSTACLE_KINDS,
    SIDES,
    Disturbance,
    Engine,
    LaneChange,
    Obstacle,
    Pave,
    RoadSpec,
    Scenario,
)
from ride_estimation.vehicles.two_axle_truck import TruckData

Array = NDArray[np.float64]
T = TypeVar("T")

SCHEMA = "ride_estimation/scenario/1"

#: units of the truck's numbers
_TRUCK_UNITS = {
    "front_axle_x": "m", "rear_axle_x": "m", "frame_z": "m", "wheel_z": "m", "frame_mass": "kg", "axle_mass": "kg",
    "track": "m", "spring_half_width": "m", "spring_stiffness": "N/m", "spring_damping": "N s/m",
    "roll_bar": "N m/rad", "tyre_stiffness": "N/m", "tyre_damping": "N s/m", "tyre_side_stiffness": "N/m",
    "tyre_side_damping": "N s/m", "torsion_stiffness": "N m/rad", "torsion_damping": "N m s/rad",
    "bending_stiffness": "N m/rad", "bending_damping": "N m s/rad", "contact_length": "m", "wheel_radius": "m",
}
_HUGE = 1e12


def load_scenario(path: str | Path) -> Scenario:
    """Load a scenario file.

    Raises
    ------
    ConfigurationError
        All mistakes at once: field, value, what is allowed.
    """
    path = Path(path)
    problems: list[str] = []
    top = Section(read_yaml(path), "", problems)
    top.text("schema", None, allowed=(SCHEMA,), meaning=f"must be {SCHEMA}")
    values: dict[str, Any] = {
        "name": top.text("name", None, meaning="a short name of the run"),
        "description": top.text("description", ""),
        "vehicle_file": top.text("vehicle", None, meaning="path of the vehicle file"),
        "seed": _integer(top, "seed", required=True),
        "duration": top.number("duration", "s", required=True, lower=1.0, upper=86400.0, meaning="length of the run"),
        "simulation_rate": top.number("simulation_rate", "Hz", lower=200.0, upper=20000.0),
        "truth_rate": top.number("truth_rate", "Hz", lower=1.0, upper=20000.0),
        "start_ns": _integer(top, "start_stamp_ns"),
    }
    values["speed"] = _points(top, "speed", "m/s")
    values["road"] = _road(top.section("road"))
    values["pave"] = _each(top, "pave", _pave)
    values["obstacles"] = _each(top, "obstacles", _obstacle)
    values["lane_changes"] = _each(top, "lane_changes", _lane_change)
    values["payloads"] = _each(top, "payloads", _payload)
    values["disturbances"] = _each(top, "disturbances", _disturbance)
    values["engine"] = _engine(top.section("engine"))
    values["true_elements"], values["true_factors"] = _true_mounts(top.sections("true_mounts"))
    values["true_bodies"] = _true_bodies(top.sections("true_bodies"))
    _sensors(top.section("sensors"), values)
    values["faults"] = _each(top, "faults", _fault)
    values["truck"] = _truck(top.section("truck"))
    top.finish()
    if problems:
        raise ConfigurationError(problems, where=str(path))
    return _build(Scenario, {k: v for k, v in values.items() if v is not None}, str(path))


def _build(kind: Callable[..., T], values: dict[str, Any], where: str) -> T:
    try:
        return kind(**values)
    except ConfigurationError as error:
        raise ConfigurationError(error.problems, where=where) from None


def _try(section: Section, kind: Callable[..., T], values: dict[str, Any]) -> T | None:
    """Build an object and note what it refuses; None where a needed value was missing or wrong."""
    try:
        return kind(**values)
    except ConfigurationError as error:
        for problem in error.problems:
            section.note("", problem)
    except TypeError:
        return None  # a required value is missing and has been noted by the getter
    return None


def _present(values: dict[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in values.items() if v is not None}


def _integer(section: Section, key: str, *, required: bool = False) -> int | None:
    value = section.raw(key, required=required, meaning="a whole number")
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        section.note(key, f"{shown(value)} is not a whole number of 0 or more")
        return None
    return value


def _list(section: Section, key: str) -> Iterator[Section]:
    value = section.raw(key)
    if value is None:
        return
    if not isinstance(value, list):
        section.note(key, f"{shown(value)} is not a list")
        return
    for number, item in enumerate(value):
        yield Section(item, section.where(f"{key}[{number}]"), section.problems)


def _each(section: Section, key: str, read: Callable[[Section], T | None]) -> tuple[T, ...]:
    found = []
    for item in _list(section, key):
        value = read(item)
        item.finish()
        if value is not None:
            found.append(value)
    return tuple(found)


def _points(section: Section, name: str, unit: str, required: bool = False) -> tuple[tuple[float, float], ...] | None:
    """Return (time, value) points from ``[[time_s, value], ...]`` or one constant value."""
    located = section.unit_key(name, unit, required=required)
    if located is None:
        return None
    key, factor = located
    value = section.raw(key)
    constant = as_number(value)
    if constant is not None:
        if constant < 0.0:
            section.note(key, f"{constant:g} is negative")
        return ((0.0, abs(constant) * factor),)
    rows = value if isinstance(value, list) else []
    points = [tuple(as_number(v) for v in row) for row in rows if isinstance(row, list) and len(row) == 2]
    flat = [v for row in points for v in row]
    if not rows or len(points) != len(rows) or any(v is None for v in flat):
        section.note(key, f"{shown(value)} is neither a number nor a list of [time_s, value]")
        return None
    numbers = [(float(t or 0.0), float(v or 0.0)) for t, v in points]
    if any(b[0] <= a[0] for a, b in itertools.pairwise(numbers)) or any(v < 0.0 for _, v in numbers):
        section.note(key, "times must increase and values be 0 or more")
        return None
    return tuple((t, v * factor) for t, v in numbers)


def _road(section: Section | None) -> RoadSpec | None:
    if section is None:
        return None
    name = section.text("iso_class", "", allowed=tuple(CLASS_ROUGHNESS))
    roughness = section.number("roughness", "m^3", lower=0.0, upper=1.0)
    waviness = section.plain("waviness", lower=0.5, upper=4.0)
    length = section.number("coherence_length", "m", lower=0.0, upper=1000.0)
    section.finish()
    if name and roughness is not None:
        section.note("", "iso_class and roughness_m3 are both given; one is allowed")
    if name:
        roughness = CLASS_ROUGHNESS[name]
    return RoadSpec(
        roughness or 0.0, 2.0 if waviness is None else waviness, COHERENCE_LENGTH if length is None else length
    )


def _pave(s: Section) -> Pave | None:
    return _try(s, Pave, _present({
        "begin": s.number("from", "m", required=True), "end": s.number("to", "m", required=True),
        "stone": s.number("stone", "m", lower=0.03, upper=1.0), "height_std": s.number("height_std", "m", lower=0.0, upper=0.1),
    }))


def _obstacle(s: Section) -> Obstacle | None:
    return _try(s, Obstacle, _present({
        "kind": s.text("kind", None, allowed=OBSTACLE_KINDS), "at": s.number("at", "m", required=True),
        "length": s.number("length", "m", required=True, lower=0.01, upper=1000.0),
        "height": s.number("height", "m", required=True, lower=-0.4, upper=0.4),
        "side": s.text("side", "both", allowed=SIDES),
    }))


def _lane_change(s: Section) -> LaneChange | None:
    return _try(s, LaneChange, _present({
        "begin": s.number("from", "s", required=True),
        "duration": s.number("duration", "s", required=True, lower=0.5, upper=60.0),
        "peak": s.number("peak", "m/s^2", required=True, lower=-8.0, upper=8.0),
    }))


def _payload(s: Section) -> Payload | None:
    return _try(s, Payload, _present({
        "body": s.text("body", None), "mass": s.number("mass", "kg", required=True, lower=-_HUGE, upper=_HUGE),
        "position": s.vector("position", "m", required=True, limit=50.0), "begin": s.number("from", "s", required=True),
        "duration": s.number("duration", "s", lower=0.0, upper=86400.0),
    }))


def _disturbance(s: Section) -> Disturbance | None:
    return _try(s, Disturbance, _present({
        "body": s.text("body", None), "position": s.vector("position", "m", required=True, limit=50.0),
        "axis": s.text("axis", None, allowed=AXES),
        "frequency": s.number("frequency", "Hz", required=True, lower=0.01, upper=500.0),
        "amplitude": s.number("amplitude", "N", required=True, lower=0.0, upper=1e6),
        "phase": s.number("phase", "rad"), "begin": s.number("from", "s"),
    }))


def _fault(s: Section) -> Fault | None:
    return _try(s, Fault, _present({
        "sensor": s.text("sensor", None), "kind": s.text("kind", None, allowed=tuple(FAULT_KINDS)),
        "begin": s.number("from", "s"), "end": s.number("to", "s"), "size": s.plain("size"),
        "axis": s.text("axis", "z", allowed=AXES), "other_axis": s.text("other_axis", "y", allowed=AXES),
    }))


def _engine(s: Section | None) -> Engine | None:
    if s is None:
        return None
    orders: dict[float, float] = {}
    given = s.raw("orders_m_per_s2", required=True, meaning="mapping of engine order to amplitude")
    for order, amplitude in (given.items() if isinstance(given, dict) else ()):
        k, value = as_number(order), as_number(amplitude)
        if k is None or value is None or k <= 0.0 or value < 0.0:
            s.note("orders_m_per_s2", f"{shown(order)}: {shown(amplitude)}; allowed: order > 0, amplitude of 0 or more [m/s^2]")
        else:
            orders[k] = value
    if given is not None and not isinstance(given, dict):
        s.note("orders_m_per_s2", f"{shown(given)} is not a mapping of order to amplitude")
    speed = _points(s, "speed", "Hz", required=True)
    lateral, fore_aft = s.plain("lateral_share", lower=0.0, upper=10.0), s.plain("fore_aft_share", lower=0.0, upper=10.0)
    s.finish()
    return _try(s, Engine, _present({"speed": speed, "orders": orders, "lateral_share": lateral, "fore_aft_share": fore_aft}))


def _true_mounts(
    sections: dict[str, Section],
) -> tuple[dict[tuple[str, str], ForceElement], dict[tuple[str, str, str], float]]:
    elements: dict[tuple[str, str], ForceElement] = {}
    factors: dict[tuple[str, str, str], float] = {}
    for mount, axes in sections.items():
        for axis in axes.keys:
            item = Section(axes.raw(axis), axes.where(axis), axes.problems)
            mapping = item.raw("element")
            if mapping is not None:
                try:
                    elements[mount, axis] = element_from_mapping(_with_numbers(mapping) if isinstance(mapping, dict) else {})
                except ConfigurationError as error:
                    for problem in error.problems:
                        item.note("element", problem)
            given = item.section("factors")
            for parameter in given.keys if given is not None else ():
                factor = given.plain(parameter, positive=True) if given is not None else None
                if factor is not None:
                    factors[mount, axis, parameter] = factor
            item.finish()
    return elements, factors


def _with_numbers(value: Any) -> Any:
    """Return the mapping with texts such as ``4e5``, which YAML 1.1 does not call numbers, as numbers."""
    if isinstance(value, dict):
        return {k: v if k == "kind" else _with_numbers(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_with_numbers(v) for v in value]
    number = as_number(value) if isinstance(value, str) else None
    return value if number is None else number


def _true_bodies(sections: dict[str, Section]) -> dict[str, dict[str, Any]]:
    bodies = {}
    for name, section in sections.items():
        bodies[name] = _present({
            "mass": section.number("mass", "kg", lower=1e-3, upper=1e6), "cg": section.vector("cg", "m", limit=50.0),
        })
        section.finish()
    return bodies


def _sensors(section: Section | None, values: dict[str, Any]) -> None:
    if section is None:
        return
    own = section.sections("own")
    common = _sensor_errors(section, SensorErrors())
    section.finish()
    values["sensor_errors"] = common
    values["own_errors"] = {}
    for name, each in own.items():
        values["own_errors"][name] = _sensor_errors(each, common)
        each.finish()


def _sensor_errors(s: Section, common: SensorErrors) -> SensorErrors:
    given = _present({
        "rate": s.number("rate", "Hz", lower=0.1, upper=20000.0), "noise_scale": s.plain("noise_scale", lower=0.0, upper=1e4),
        "bias_std": s.number("bias_std", "m/s^2", lower=0.0, upper=10.0), "gain_std": s.plain("gain_std", lower=0.0, upper=0.5),
        "misalignment_std": s.number("misalignment_std", "rad", lower=0.0, upper=0.5),
        "quantisation": s.number("quantisation", "m/s^2", lower=0.0, upper=10.0),
        "anti_alias": s.number("anti_alias", "Hz", lower=0.0, upper=20000.0),
        "jitter_std": s.number("jitter_std", "s", lower=0.0, upper=1.0),
        "stamp_error_std": s.number("stamp_error_std", "s", lower=0.0, upper=1.0),
        "drop_share": s.plain("drop_share", lower=0.0, upper=0.99), "latency": s.number("latency", "s", lower=0.0, upper=10.0),
        "synchronous": s.flag("synchronous", common.synchronous),
    })
    return dataclasses.replace(common, **given)


def _truck(section: Section | None) -> TruckData | None:
    if section is None:
        return None
    values: dict[str, Any] = {}
    for field in dataclasses.fields(TruckData):
        located = section.unit_key(field.name, _TRUCK_UNITS[field.name])
        if located is None:
            continue
        key, factor = located
        raw = section.raw(key)
        numbers = [as_number(v) for v in (raw if isinstance(raw, list) else [raw])]
        pair = isinstance(field.default, tuple)
        if any(n is None for n in numbers) or len(numbers) != (2 if pair else 1):
            section.note(key, f"{shown(raw)}; allowed: " + ("[front, rear]" if pair else "one number"))
            continue
        scaled = tuple(float(n or 0.0) * factor for n in numbers)
        values[field.name] = scaled if pair else scaled[0]
    section.finish()
    return _try(section, TruckData, values)
