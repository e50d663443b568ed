# Copyright 2026 ride_estimation contributors
"""The reference page of the vehicle file, written from what its loader asks for.

The loader reads ``config/vehicles/every_key.yaml``, which holds every kind of entry once, and tells every key it looks for
(:func:`~ride_estimation.io.document.recorded_fields`). ``python -m ride_estimation.io.vehicle_page --write`` writes
``docs/vehicle_file.md`` of a source tree again.
"""

from __future__ import annotations

import dataclasses
import math
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.parameters.mass_reference import DEFAULT_STD
from ride_estimation.io.document import Field, read_yaml, recorded_fields
from ride_estimation.io.vehicle_file import vehicle_from_mapping
from ride_estimation.resources import shared_path
from ride_estimation.sensors.sensor import SENSOR_KINDS
from ride_estimation.units import split_suffix, suffixes_of
from ride_estimation.vehicles.prior import CG_STD, INERTIA_STD

PAGE = Path(__file__).resolve().parents[2] / "docs" / "vehicle_file.md"
HEAD = """\
# Vehicle file

What a vehicle file may contain. Written from the loader by `python -m ride_estimation.io.vehicle_page --write`.
[config/vehicles/every_key.yaml](../config/vehicles/every_key.yaml) shows every key in use and loads.
`ride-estimation new-vehicle --mounts 4 --sensors 4 --out my_vehicle.yaml` writes a file to start from.

- The end of a key is its unit. The tables list the SI key; the other endings in the column "unit" are converted.
- Positions: metres in the axes of the file, x forward, y left, z up, origin anywhere. All positions are those at rest.
- The loader reports all mistakes at once, each with its line. An unknown key is a mistake.
"""
#: title, text, paths of the mappings of a group; groups in the order of the page
_ENTRY = r"[^.]+"
_SEEN = (
    "Beside `kind` of the element of an axis (about roll, pitch and yaw in rad and N m): what was in the data the element was\n"
    "identified from. Nothing is limited to it; `export-model` writes it beside the parameters and marks what lies outside."
)
_REFERENCES = {
    "known_mass": "The mass of the body in the file was measured. Default of `relative_std`: that of the mass.",
    "known_stiffness": "The stiffness of this axis in the file was measured.",
    "load_cell": "A force sensor measures the force of the mount.",
    "air_spring_pressure": "Pressure times area is the static force of the mount.",
    "known_added_mass": "A known mass was added during the run.",
}
_SENSORS = {
    "accelerometer": "Three axes, specific force: +9.81 m/s^2 on the upward axis at rest.",
    "imu": "Accelerometer whose angular rates are used too.",
    "displacement": "Transducer along one axis of one mount: body side minus base side.",
    "speed": "Speed of the vehicle.",
    "force": "Load cell at a mount: force on the body by the mount.",
}

_INSTALLATION = (
    "How well a sensor is installed: one standard deviation per kind of error. It is the prior of `calibrate --drive`, which\n"
    "writes here what it leaves uncertain; `diagnose` takes larger errors than usual for calibration where it says so.\n"
    "In `replay` and the live node it widens intervals and moves the limits of fault tests and hints; a sensor is no fault for\n"
    "what is usual, also where the file states less.\n"
    "`zero` is for transducers only, which else have `gain` and `delay`."
)


def page() -> str:
    """Return the page: one table per kind of entry, one row per key."""
    document = read_yaml(shared_path("config", "vehicles", "every_key.yaml"))
    fields = loader_fields(document)
    declared = {name for part in ("bodies", "mounts", "sensors") for name in document[part]} | {"chassis"}
    parts = [HEAD]
    for title, text, keys in groups(document, fields):
        head = "| key | unit | value | allowed | default | meaning |\n|---|---|---|---|---|---|"
        rows = [_row(key, field, declared) for key, field in keys.items()]
        parts.append(f"\n{title}\n\n{text}\n\n" + "\n".join([head, *rows]) + "\n")
    return "".join(parts)


def loader_fields(document: Mapping[str, Any]) -> dict[tuple[str, str], Field]:
    """Return every key the loader of vehicle files asks a document for, by the path of its mapping and the key in SI."""
    with recorded_fields() as fields:
        vehicle_from_mapping(document)
    return fields


def groups(
    document: Mapping[str, Any], fields: Mapping[tuple[str, str], Field]
) -> list[tuple[str, str, dict[str, Field]]]:
    """Return (title, text, field by key) of every kind of entry, in the order of the page."""
    settings = PipelineSettings()
    priors = (
        "A quantity is a number or a mapping with these keys, one of `std` and `relative_std`: the prior of a parameter. Where\n"
        f"a stiffness states none, the standard deviation of its logarithm is {settings.prior_stiffness_std:g}, of a damping\n"
        f"{settings.prior_damping_std:g} (parameters `prior_stiffness_std`, `prior_damping_std` of the node).\n"
        "A replay's model of the whole run and `diagnose` take a CG without `std` as known to "
        f"{1e3 * CG_STD:g} mm along each axis,\n"
        f"moments of inertia without `relative_std` to {100 * INERTIA_STD:g} %; the node takes both as exact."
    )
    found = [
        ("## The file", "Keys of the outermost mapping.", _of(fields, "")),
        ("## Quantities", priors, _of(fields, r"bodies\.[^.]+\.mass_kg")),
        ("## `bodies`", "Rigid bodies by name.", _of(fields, rf"bodies\.{_ENTRY}")),
        ("### `cg_m` with its uncertainty", "In place of three numbers.", _of(fields, rf"bodies\.{_ENTRY}\.cg_m")),
        ("### `inertia_kg_m2`", "In the unit of the key.", _of(fields, rf"bodies\.{_ENTRY}\.inertia_kg_m2")),
        ("## `mounts`", "Mounts by name. At rest all deflections are zero.", _of(fields, rf"mounts\.{_ENTRY}")),
        ("### `seen_in_data`", _SEEN, _of(fields, rf"mounts\.{_ENTRY}\.axes\.[xyz]\.seen_in_data")),
    ]
    for kind in SENSOR_KINDS:
        names = "|".join(name for name, entry in document["sensors"].items() if entry["kind"] == kind)
        found.append((f"## `sensors` of kind `{kind}`", _SENSORS[kind], _of(fields, rf"sensors\.({names})")))
    found.append(("### `installation` of a sensor", _INSTALLATION, _of(fields, rf"sensors\.{_ENTRY}\.installation")))
    for index, entry in enumerate(document["force_references"]):
        kind = entry["kind"]
        text = _REFERENCES[kind] + (f" Default of `relative_std`: {DEFAULT_STD[kind]:g}." if kind in DEFAULT_STD else "")
        found.append((f"## `force_references` of kind `{kind}`", text, _of(fields, rf"force_references\[{index}\]")))
    return found


def _of(fields: Mapping[tuple[str, str], Field], path: str) -> dict[str, Field]:
    """Return the fields of all mappings at paths of a form; needed is what every one of them needs."""
    found: dict[str, Field] = {}
    for (where, key), field in fields.items():
        if re.fullmatch(path, where) is None:
            continue
        known = found.get(key)
        if known is None or (field.form and not known.form):
            found[key] = field
        elif known.required != field.required:
            found[key] = dataclasses.replace(known, required=False)
    return found


def _row(key: str, field: Field, declared: set[str]) -> str:
    base, _, _ = split_suffix(key)
    unit = ""
    if field.unit:
        others = [f"`{base}{suffix}`" for suffix in suffixes_of(field.unit)[1:]]
        unit = field.unit + (f"; {', '.join(others)}" if others else "")
    allowed = ""
    if field.choices:
        own = set(field.choices) <= declared
        allowed = "a name that is declared" if own else ", ".join(f"`{word}`" for word in field.choices)
    elif field.form in ("number", "quantity", "three numbers") and (math.isfinite(field.lower) or math.isfinite(field.upper)):
        low = f"{field.lower:g} to " if math.isfinite(field.lower) else "at most "
        allowed = low + f"{field.upper:g}" if math.isfinite(field.upper) else f"at least {field.lower:g}"
    meaning = "" if field.choices and all(word in field.meaning for word in field.choices) else field.meaning
    return f"| `{key}` | {unit} | {field.form or 'see meaning'} | {allowed} | {_default(field, declared)} | {meaning} |"


def _default(field: Field, declared: set[str]) -> str:
    if field.required:
        return "needed"
    if isinstance(field.default, bool):
        return f"`{str(field.default).lower()}`"
    if isinstance(field.default, float):
        return f"`{field.default:g}`" if math.isfinite(field.default) else "none"
    # a default that was made of the names of the file says nothing about another one
    own = str(field.default or "")
    return f"`{own}`" if own and not any(name in own for name in declared - {"chassis"}) else ""


def main(arguments: Sequence[str]) -> int:
    """Print the page, or write it with ``--write``."""
    if list(arguments) == ["--write"]:
        PAGE.write_text(page(), encoding="utf-8")
        print(f"written: {PAGE}")
        return 0
    print(page())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
