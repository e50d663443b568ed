# Copyright 2026 ride_estimation contributors
"""The mechanical half of a vehicle file: bodies, mounts and their force elements."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.registry import SEEN, element_from_mapping, kinds
from ride_estimation.errors import ConfigurationError
from ride_estimation.frames import AXES, COORDINATES
from ride_estimation.io.document import Section, as_number, quantity_from, shown, suggestion
from ride_estimation.units import ABOUT_AN_AXIS, key_about_an_axis, si_unit, split_suffix
from ride_estimation.vehicles.data_range import DataRange
from ride_estimation.vehicles.inertia import GYRATION_RANGE
from ride_estimation.vehicles.vehicle import Body, Mount, Prior

Array = NDArray[np.float64]

#: farthest a point of a vehicle may be from the origin [m]; beyond it the unit is wrong
FARTHEST = 50.0
#: frequencies on the mounts a vehicle body can have [Hz]
MOUNT_FREQUENCY = (0.03, 1000.0)

_MOMENTS = ("ixx", "iyy", "izz")
_PRODUCTS = ("ixy", "ixz", "iyz")
_AXES = f"force element by axis ({', '.join(COORDINATES)}): `kind` and its keys, see [elements.md](elements.md)"
_SAME_ELEMENT = f"one force element for the axes {', '.join(AXES)}, instead of `axes`; entries of `axes` replace it"


def read_bodies(sections: Mapping[str, Section], problems: list[str]) -> dict[str, Body]:
    """Return the bodies that could be read; mistakes are added to ``problems``."""
    bodies: dict[str, Body] = {}
    for name, section in sections.items():
        mass = section.quantity("mass", "kg", required=True, lower=1e-3, upper=1e6, meaning="mass of the body")
        cg, cg_std = _read_cg(section)
        coordinates = _read_coordinates(section)
        inertia, relative = _read_inertia(section, None if mass is None else mass.value, coordinates)
        source = section.text("source", "", meaning="where the numbers of the body come from")
        section.finish()
        if mass is not None and cg is not None and inertia is not None:
            bodies[name] = Body(name, mass, cg, inertia, relative, cg_std, coordinates, source or "")
    if not sections and not problems:
        problems.append("bodies: at least one body is needed")
    return bodies


def _read_cg(section: Section) -> tuple[Array | None, Array | None]:
    located = section.unit_key("cg", "m", required=True, meaning="CG at rest: three numbers or `{value, std, source}`")
    if located is None:
        return None, None
    key, factor = located
    value = section.raw(key)
    if not isinstance(value, Mapping):
        return section.three(key, value, "m", factor, FARTHEST), None
    inner = Section(value, section.where(key), section.problems)
    cg = inner.three("value", inner.raw("value", required=True, meaning="three numbers"), "m", factor, FARTHEST)
    std = inner.raw("std", meaning="standard deviation, one number or one per axis; at least 0")
    inner.text("source", "", meaning="where the numbers come from")
    inner.finish()
    if std is None:
        return cg, None
    spread = inner.three("std", [std] * 3 if as_number(std) is not None else std, "m", factor, FARTHEST)
    if spread is not None and np.any(spread < 0.0):
        inner.note("std", f"{shown(std)} is negative")
        spread = None
    return cg, spread


def _read_coordinates(section: Section) -> tuple[str, ...]:
    value = section.raw("degrees_of_freedom", meaning=f"list of some of {', '.join(COORDINATES)}; default all six")
    if value is None:
        return COORDINATES
    if not isinstance(value, list) or not value or any(v not in COORDINATES for v in value) or len(set(value)) != len(value):
        section.note("degrees_of_freedom", f"{shown(value)} is not a list of some of {', '.join(COORDINATES)}, each once")
        return COORDINATES
    return tuple(c for c in COORDINATES if c in value)


def _read_inertia(
    section: Section, mass: float | None, coordinates: tuple[str, ...]
) -> tuple[Array | None, float | None]:
    needed = [m for m, c in zip(_MOMENTS, COORDINATES[3:]) if c in coordinates]
    meaning = "inertia tensor about the CG; needed where a rotation is free"
    located = section.unit_key("inertia", "kg m^2", required=bool(needed), meaning=meaning)
    if located is None:
        return (None, None) if needed or mass is None else (_complete(np.zeros((3, 3)), mass), None)
    key, factor = located
    inner = Section(section.raw(key), section.where(key), section.problems)
    axes = dict(zip((*_MOMENTS, *_PRODUCTS), COORDINATES[3:]))
    meanings = {m: f"moment about the {m[-1]} axis; needed where {axes[m]} is free" for m in _MOMENTS}
    meanings |= {m: "entry of the tensor itself, with its sign; default 0" for m in _PRODUCTS}
    values = {m: inner.plain(m, meaning=words) for m, words in meanings.items()}
    relative = inner.plain("relative_std", lower=0.0, upper=10.0, meaning="standard deviation of the tensor as a share of it")
    inner.text("source", "", meaning="where the numbers come from")
    inner.finish()
    for moment in needed:
        if moment not in inner:
            inner.note(moment, "missing (moment of inertia about the CG) [kg m^2]")
    if any(values[m] is None for m in needed) or any(m in inner and values[m] is None for m in values):
        return None, relative
    ixx, iyy, izz, ixy, ixz, iyz = (factor * (values[m] or 0.0) for m in (*_MOMENTS, *_PRODUCTS))
    tensor = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    if any(values[m] is not None and tensor[i, i] <= 0.0 for i, m in enumerate(_MOMENTS)):
        inner.note("", f"moments of inertia must be positive; given {ixx:g}, {iyy:g}, {izz:g} kg m^2")
        return None, relative
    if mass is not None:
        tensor = _complete(tensor, mass)
        _check_inertia(inner, tensor, mass)
    return tensor, relative


def _complete(tensor: Array, mass: float) -> Array:
    """Return the tensor with moments that no free coordinate uses filled so that it stays physical."""
    filled = tensor.copy()
    given = [float(v) for v in np.diag(tensor) if v > 0.0]
    for i in range(3):
        if filled[i, i] == 0.0:
            filled[i, i] = math.hypot(*given) if given else mass
    return filled


def _check_inertia(section: Section, tensor: Array, mass: float) -> None:
    principal = np.linalg.eigvalsh(tensor)
    if principal[0] <= 0.0:
        moments = ", ".join(f"{v:.4g}" for v in principal)
        section.note("", f"not positive definite: principal moments {moments} kg m^2 (products of inertia too large?)")
        return
    if principal[2] > (principal[0] + principal[1]) * (1.0 + 1e-6):
        section.note(
            "",
            f"no body can have it: the largest principal moment {principal[2]:.4g} kg m^2 exceeds the sum of the other two "
            f"{principal[0] + principal[1]:.4g} kg m^2",
        )
    radii = np.sqrt(principal / mass)
    if radii[2] > GYRATION_RANGE[1] or radii[0] < GYRATION_RANGE[0]:
        worst = radii[2] if radii[2] > GYRATION_RANGE[1] else radii[0]
        hint = "kg mm^2 given as kg m^2" if worst > GYRATION_RANGE[1] else "wrong unit of mass or inertia"
        allowed = f"{GYRATION_RANGE[0]:g} to {GYRATION_RANGE[1]:g} m"
        section.note("", f"a radius of gyration of {worst:.3g} m is impossible for {mass:g} kg; allowed: {allowed} ({hint}?)")


def read_mounts(sections: Mapping[str, Section], bodies: Collection[str], problems: list[str]) -> dict[str, Mount]:
    """Return the mounts that could be read; mistakes are added to ``problems``; ``bodies`` are the names declared."""
    mounts: dict[str, Mount] = {}
    for name, section in sections.items():
        position = section.vector("position", "m", required=True, limit=FARTHEST, meaning="attachment point")
        body = section.text("body", None, allowed=bodies or None, meaning="the body it carries")
        base = section.text("base", None, meaning="another body, or a name such as chassis or road")
        if body and body == base:
            section.note("base", f"{shown(base)} is the body itself; a mount joins two different bodies")
            base = None
        elements, priors, seen = _read_axes(section)
        load = section.quantity("static_load", "N", lower=-1e7, upper=1e7, meaning="vertical force on the body at rest, weighed")
        section.finish()
        if position is not None and body and base:
            mounts[name] = Mount(name, position, body, base, elements, priors, load, seen)
    if not sections and not problems:
        problems.append("mounts: at least one mount is needed")
    return mounts


def _read_axes(
    section: Section,
) -> tuple[dict[str, ForceElement], dict[tuple[str, str], Prior], dict[str, DataRange]]:
    entries: dict[str, Any] = {}
    if "element" in section:
        entries = {axis: section.raw("element", meaning=_SAME_ELEMENT) for axis in AXES}
    axes = section.raw("axes", required=not entries, meaning=_AXES)
    if axes is not None and not isinstance(axes, Mapping):
        section.note("axes", f"{shown(axes)} is not a mapping of axis to force element")
        axes = None
    if axes is not None:
        for axis in axes:
            if axis not in COORDINATES:
                section.note(f"axes.{axis}", f"unknown axis; allowed: {', '.join(COORDINATES)}")
        entries.update({axis: axes[axis] for axis in COORDINATES if axis in axes})
        if not entries:
            section.note("axes", "at least one axis is needed")
    elements: dict[str, ForceElement] = {}
    priors: dict[tuple[str, str], Prior] = {}
    seen: dict[str, DataRange] = {}
    for axis, entry in entries.items():
        found: dict[str, Prior] = {}
        element = read_element(entry, section.where(f"axes.{axis}"), section.problems, found, axis)
        if element is not None:
            elements[axis] = element
            priors.update({(axis, name): prior for name, prior in found.items()})
        shown_by_data = read_seen(entry, section.where(f"axes.{axis}"), section.problems, axis)
        if shown_by_data is not None:
            seen[axis] = shown_by_data
    return elements, priors, seen


def read_seen(entry: Any, where: str, problems: list[str], axis: str = "z") -> DataRange | None:
    """Return what the data showed that a force element was identified from, None where it says nothing of that.

    Parameters
    ----------
    entry
        The mapping of :func:`read_element`.
    where
        Path for messages.
    problems
        List the mistakes are added to.
    axis
        Axis of the element.
    """
    if not isinstance(entry, Mapping) or SEEN not in entry:
        return None
    section = Section(entry[SEEN], f"{where}.{SEEN}", problems)
    length, force = ("rad", "N m") if axis in COORDINATES[3:] else ("m", "N")
    largest = section.number("largest_deflection", length, required=True, lower=1e-9, upper=10.0, meaning="from the mean")
    frequency = [
        section.number(f"{which}_frequency", "Hz", required=True, lower=0.0, upper=1e5, meaning=f"{which} frequency of it")
        for which in ("lowest", "highest")
    ]
    preload = [
        section.number(f"{which}_preload", force, lower=-1e8, upper=1e8, meaning=f"{which} mean force; left out where unknown")
        for which in ("lowest", "highest")
    ]
    section.finish()
    for name, (low, high) in (("frequency", frequency), ("preload", preload)):
        if low is not None and high is not None and low > high:
            section.note(f"lowest_{name}", f"{low:g} is above the highest, {high:g}")
            return None
    if largest is None or frequency[0] is None or frequency[1] is None:
        return None
    both = None if preload[0] is None or preload[1] is None else (preload[0], preload[1])
    return DataRange(largest, (frequency[0], frequency[1]), both)


def seen_to_mapping(seen: DataRange, axis: str = "z") -> dict[str, float]:
    """Return the YAML form of what the data showed, as :func:`read_seen` reads it."""
    turned = axis in COORDINATES[3:]
    mapping = {
        "largest_deflection_rad" if turned else "largest_deflection_m": float(seen.deflection),
        "lowest_frequency_hz": float(seen.frequency[0]),
        "highest_frequency_hz": float(seen.frequency[1]),
    }
    if seen.preload is not None:
        unit = "n_m" if turned else "n"
        mapping |= {f"lowest_preload_{unit}": float(seen.preload[0]), f"highest_preload_{unit}": float(seen.preload[1])}
    return mapping


def read_element(entry: Any, where: str, problems: list[str], priors: dict[str, Prior], axis: str = "z") -> ForceElement | None:
    """Return one force element whose numbers may be quantities in any unit.

    Parameters
    ----------
    entry
        Mapping ``{kind, <parameter>: quantity}``, or the document ``element.yaml`` of an identification.
    where
        Path for messages.
    problems
        List the mistakes are added to.
    priors
        Filled with parameter name -> what is known of it.
    axis
        Axis of the element: about roll, pitch and yaw its keys carry units of moments and angles.
    """
    turned = axis in COORDINATES[3:]
    before = len(problems)
    if isinstance(entry, Mapping) and "kind" not in entry and isinstance(entry.get("element"), Mapping):
        entry = entry["element"]
    plain = _plain_numbers(entry, where, problems, priors, turned)
    if plain is None:
        return None
    try:
        element = element_from_mapping(plain)
    except ConfigurationError as error:
        problems.extend(f"{where}.{_as_turned(problem) if turned else problem}" for problem in error.problems)
        return None
    return element if len(problems) == before else None


def _as_turned(problem: str) -> str:
    """Return the words of a mistake with the keys and units a roll, pitch or yaw axis has."""
    words = re.sub(r"\w+", lambda found: key_about_an_axis(found.group()), problem)
    return re.sub(r"\[([^\]]+)\]", lambda found: f"[{ABOUT_AN_AXIS.get(found.group(1), found.group(1))}]", words)


def _plain_numbers(
    entry: Any, where: str, problems: list[str], priors: dict[str, Prior], turned: bool, prefix: str = ""
) -> dict[str, Any] | None:
    """Return the element mapping with every quantity replaced by its number in SI under the declared key."""
    if not isinstance(entry, Mapping):
        problems.append(f"{where}: {shown(entry)} is not a force element; a mapping with kind and its parameters is needed")
        return None
    kind = entry.get("kind")
    if not isinstance(kind, str) or kind not in kinds():
        problems.append(
            f"{where}.kind: {shown(kind)} is not a force element; allowed: {', '.join(kinds())}{suggestion(str(kind), kinds())}"
        )
        return None
    declared = {p.key: p for p in kinds()[kind].parameters()}
    series = {p.key: p for p in kinds()[kind].series_parameters()}
    by_base = {(split_suffix(key)[0], si_unit(split_suffix(key)[1])): key for key in (*declared, *series)}
    if turned:
        by_base |= {(base, ABOUT_AN_AXIS[unit]): key for (base, unit), key in by_base.items() if unit in ABOUT_AN_AXIS}
    result: dict[str, Any] = {}
    for key, value in entry.items():
        base, printed, factor = split_suffix(str(key))
        target = key if key in declared else by_base.get((base, si_unit(printed)), key)
        path = f"{where}.{key}"
        if target in declared:
            p = declared[target]
            unit = ABOUT_AN_AXIS.get(p.unit, p.unit) if turned else p.unit
            prior = quantity_from(value, path, unit, 1.0 if target == key else factor, problems)
            if target in result:
                problems.append(f"{path}: given more than once")
            # a stand-in within bounds lets the element report its other mistakes in the same pass
            result[target] = p.lower if prior is None else prior.value
            if prior is not None:
                priors[prefix + p.name] = prior
        elif target in series and isinstance(value, list):
            p = series[target]
            scale = 1.0 if target == key else factor
            entries = [quantity_from(v, f"{path}[{i}]", p.unit, scale, problems) for i, v in enumerate(value)]
            result[target] = [p.lower if prior is None else prior.value for prior in entries]
            priors.update({f"{prefix}{p.name}[{i}]": prior for i, prior in enumerate(entries) if prior is not None})
        elif isinstance(value, Mapping) and "kind" in value:
            result[key] = _plain_numbers(value, path, problems, priors, turned, f"{prefix}{key}.")
        elif isinstance(value, list) and value and all(isinstance(v, Mapping) and "kind" in v for v in value):
            result[key] = [
                _plain_numbers(v, f"{path}[{i}]", problems, priors, turned, f"{prefix}{key}[{i}].") for i, v in enumerate(value)
            ]
        else:
            result[key] = value
    return result


def stiffness_unit_problems(bodies: Mapping[str, Body], mounts: Mapping[str, Mount]) -> list[str]:
    """Return problems with stiffness that no vehicle can have for the mass it carries (N/mm given as N/m and the like).

    The vertical stiffness at rest of all mounts of a body over its mass gives a frequency; it must be within
    :data:`MOUNT_FREQUENCY`.
    """
    problems = []
    for body in bodies.values():
        if "z" not in body.coordinates:
            continue
        attached = [m for m in mounts.values() if body.name in (m.body, m.base) and "z" in m.elements]
        stiffness = sum(_stiffness_at_rest(m.elements["z"]) for m in attached)
        if not attached or stiffness <= 0.0:
            continue
        frequency = math.sqrt(stiffness / body.mass.value) / (2.0 * math.pi)
        if not MOUNT_FREQUENCY[0] <= frequency <= MOUNT_FREQUENCY[1]:
            problems.append(
                f"mounts of {body.name}: vertical stiffness {stiffness:.4g} N/m in all under {body.mass.value:g} kg is "
                f"{frequency:.3g} Hz; possible: {MOUNT_FREQUENCY[0]:g} to {MOUNT_FREQUENCY[1]:g} Hz "
                "(N/mm given as N/m, or the mass in t?)"
            )
    return problems


def _stiffness_at_rest(element: ForceElement) -> float:
    step = 1e-4
    memory = element.initial()
    return (element.force(memory, step, 0.0) - element.force(memory, -step, 0.0)) / (2.0 * step)
