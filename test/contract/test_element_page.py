# Copyright 2026 ride_estimation contributors
"""docs/elements.md says what the elements declare, and what it says can be put into a vehicle file."""

from __future__ import annotations

import re

import pytest
import yaml

from ride_estimation.elements.registry import kinds
from ride_estimation.io.element_page import PAGE, page
from ride_estimation.io.vehicle_file import vehicle_from_mapping
from ride_estimation.resources import shared_path
from ride_estimation.vehicles.vehicle import Vehicle


def loaded(element: dict[str, object]) -> Vehicle:
    """Return the bundled vehicle with another element at one axis."""
    document = yaml.safe_load(shared_path("config", "vehicles", "truck_cab.yaml").read_text(encoding="utf-8"))
    document["mounts"]["front_left"]["axes"]["z"] = element
    return vehicle_from_mapping(document)


def test_the_page_is_written_from_the_declarations() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "python -m ride_estimation.io.element_page --write"


@pytest.mark.parametrize("kind", sorted(set(kinds()) - {"sum"}))
def test_every_key_has_unit_range_and_meaning(kind: str) -> None:
    section = page().partition(f"## `{kind}`")[2].partition("\n## ")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in section.splitlines() if line.startswith("| `")]
    assert rows
    for key, unit, allowed, default, meaning in rows:
        assert re.fullmatch(r"`\w+`", key) and default and len(meaning) > 10
        assert (unit and " to " in allowed) or (not unit and " or " in allowed)


def test_another_unit_and_an_uncertain_number_are_what_the_head_of_the_page_says() -> None:
    element = loaded({
        "kind": "kelvin_voigt", "stiffness_n_per_mm": {"value": 52.0, "relative_std": 0.1}, "damping_n_s_per_m": 1500.0,
    }).mounts["front_left"].elements["z"]  # fmt: skip
    assert element.stiffness == pytest.approx(52000.0)
