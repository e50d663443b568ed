# Copyright 2026 ride_estimation contributors
"""A verdict must not depend on when, in which order, in which axes or in which units a run is told."""

from __future__ import annotations

import functools

import pytest
from relations import Relation, relations
from verdicts import Answer, as_recording, diagnosed
from worlds.adapters import plane_inputs
from worlds.plane_scenario import quarter_car_case

from ride_estimation.signals.recording import Recording
from ride_estimation.vehicles.vehicle import Vehicle

#: cause that is hidden and seed of the case
CASES = (("coulomb_friction", 3), ("none", 4))


@functools.cache
def case(cause: str, seed: int) -> tuple[Vehicle, tuple[Recording, ...]]:
    vehicle, run, others = plane_inputs(quarter_car_case(cause, seed, duration=40.0))
    return vehicle, tuple(as_recording(r) for r in (run, *others))


@functools.cache
def unchanged(cause: str, seed: int) -> Answer:
    return diagnosed(*case(cause, seed), Relation("none", True))


@pytest.mark.slow
@pytest.mark.parametrize(("cause", "seed"), CASES)
@pytest.mark.parametrize("name", [r.name for r in relations()])
def test_verdict_and_causes_stay_where_the_same_run_is_described_in_another_way(name, cause, seed):
    vehicle, runs = case(cause, seed)
    relation = next(r for r in relations() if r.name == name)
    assert diagnosed(vehicle, runs, relation) == unchanged(cause, seed)
