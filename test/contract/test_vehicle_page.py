# Copyright 2026 ride_estimation contributors
"""docs/vehicle_file.md and config/vehicles/every_key.yaml say what the loader of vehicle files asks for."""

from __future__ import annotations

import re
from typing import Any

import pytest

from ride_estimation.errors import ConfigurationError
from ride_estimation.io.document import read_yaml, recorded_fields
from ride_estimation.io.vehicle_file import load_vehicle, vehicle_from_mapping
from ride_estimation.io.vehicle_page import PAGE, groups, loader_fields, page
from ride_estimation.io.vehicle_sensors import REFERENCE_KINDS
from ride_estimation.resources import shared_path
from ride_estimation.sensors.sensor import SENSOR_KINDS
from ride_estimation.units import si_unit, split_suffix, suffixes_of

EVERY_KEY = shared_path("config", "vehicles", "every_key.yaml")


def si_key(key: str) -> str:
    base, unit, _ = split_suffix(key)
    return base + suffixes_of(si_unit(unit))[0] if unit else key


def mappings(value: Any, path: str = "") -> list[tuple[str, dict[str, Any]]]:
    """Return every mapping of a document with its path, keys as the loader names paths."""
    if isinstance(value, dict):
        inner = [m for key, v in value.items() for m in mappings(v, f"{path}.{key}" if path else str(key))]
        return [(path, value), *inner]
    if isinstance(value, list):
        return [m for i, v in enumerate(value) for m in mappings(v, f"{path}[{i}]")]
    return []


def test_the_page_is_written_from_the_loader() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "python -m ride_estimation.io.vehicle_page --write"


def test_the_file_with_every_key_loads_and_has_every_kind() -> None:
    vehicle = load_vehicle(EVERY_KEY)
    assert {s.kind for s in vehicle.sensors.values()} == set(SENSOR_KINDS)
    assert {r.kind for r in vehicle.force_references} == set(REFERENCE_KINDS)
    assert vehicle.bodies["seat"].coordinates == ("z",) and "roll" in vehicle.mounts["front_left"].elements


def test_every_key_the_loader_asks_for_stands_in_the_file() -> None:
    document = read_yaml(EVERY_KEY)
    used: dict[str, set[str]] = {}
    for path, mapping in mappings(document):
        used[path] = {si_key(key) for key in mapping}
    missing = []
    for title, _, keys in groups(document, loader_fields(document)):
        places = [path for path in used if set(keys) & used[path] and belongs(path, title, document)]
        missing += [f"{title}: {key}" for key in keys if not any(key in used[path] for path in places)]
    assert missing == []


def belongs(path: str, title: str, document: dict[str, Any]) -> bool:
    """Return whether a mapping is one of those that a heading of the page speaks of."""
    if title == "### `installation` of a sensor":
        return path.endswith(".installation")
    kind = re.search(r"of kind `(\w+)`", title)
    entry: Any = {"sensors": document["sensors"], "force_references": dict(enumerate(document["force_references"]))}
    if kind and "sensors" in title:
        return path.startswith("sensors.") and entry["sensors"][path.split(".")[1]]["kind"] == kind.group(1)
    if kind:
        found = re.fullmatch(r"force_references\[(\d+)\]", path)
        return found is not None and entry["force_references"][int(found.group(1))]["kind"] == kind.group(1)
    forms = {
        "## The file": "", "## Quantities": r"bodies\.\w+\.mass_kg", "## `bodies`": r"bodies\.\w+", "## `mounts`": r"mounts\.\w+",
        "### `seen_in_data`": r"mounts\.\w+\.axes\.\w+\.seen_in_data",
        "### `cg_m` with its uncertainty": r"bodies\.\w+\.cg_m", "### `inertia_kg_m2`": r"bodies\.\w+\.inertia_kg_m2",
    }  # fmt: skip
    return re.fullmatch(forms[title], path) is not None


@pytest.mark.parametrize("group", groups(read_yaml(EVERY_KEY), loader_fields(read_yaml(EVERY_KEY))), ids=lambda g: g[0])
def test_every_key_says_what_it_means(group: tuple[str, str, dict[str, Any]]) -> None:
    title, text, keys = group
    assert text and keys, title
    for key, field in keys.items():
        assert field.choices or len(field.meaning) > 5, f"{title}: {key}"


def test_bounds_of_the_page_are_those_of_the_loader() -> None:
    document = read_yaml(EVERY_KEY)
    document["gravity_m_per_s2"] = 30.1
    document["sensors"]["cab_front_left"]["noise_m_per_s2"] = 2e6
    with pytest.raises(ConfigurationError) as caught:
        vehicle_from_mapping(document)
    text, said = page(), str(caught.value)
    assert "| `gravity_m_per_s2` | m/s^2; `gravity_g` | number | 0 to 30 | `9.80665` |" in text and "0 to 30 m/s^2" in said
    assert "| number | 1e-12 to 1e+06 | `0.02` |" in text and "1e-12 to 1e+06 m/s^2" in said


def test_nothing_is_recorded_outside_of_the_block() -> None:
    with recorded_fields() as fields:
        pass
    load_vehicle("truck_cab")
    assert fields == {}
