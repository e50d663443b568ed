# Copyright 2026 ride_estimation contributors
"""Exchanged topics are found on cabs of other formulas than the package's, and nothing else is taken for an exchange."""

from __future__ import annotations

import dataclasses
import functools
import json

import numpy as np
import pytest
from worlds.adapters import believed_vehicle
from worlds.cab import CabRun, CabSensor, drive, measure, random_sensors, random_vehicle
from worlds.roads import Road

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.faults.swapped_topics import SwappedTopics
from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator

RATE = 100.0
BLOCK = 10


@functools.cache
def run(kind: str, seed: int) -> tuple[CabRun, tuple[CabSensor, ...]]:
    """Return a drive of eight seconds on air springs or on stiff rubber, and its sensors."""
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, kind)
    return drive(cab, Road.random(rng), 8.0, seed, step=1e-3), random_sensors(cab, rng)


def search(kind: str, seed: int, exchange: tuple[str, str] | None = None, **changes: object) -> tuple[SwappedTopics, list[str]]:
    """Feed a run, with two sensors exchanged or the first one changed; return the search and what it said."""
    motion, sensors = run(kind, seed)
    wrong = tuple(dataclasses.replace(s, **changes) if s.name == sensors[0].name else s for s in sensors)  # type: ignore[arg-type]
    clean = measure(motion, sensors, RATE, seed, noise_share=0.01)
    data = dict(measure(motion, wrong, RATE, seed, noise_share=0.01).data)
    if exchange:
        data[exchange[0]], data[exchange[1]] = data[exchange[1]], data[exchange[0]]
    a = geometry_of(believed_vehicle(clean, seed=seed))
    base = [s for s in a.base_sensors if s is not None]
    names = [s.name for s in (*a.body_sensors, *base)]
    values = np.hstack([data[n] for n in names])
    rows = CgMotionEstimator(a.body_sensors, a.body.cg, a.free, 9.81).rows
    swaps = SwappedTopics(a.body_sensors, base, range(len(names)), range(0, 3 * len(names), 3), rows)
    valid = np.ones((BLOCK, len(names)), dtype=bool)
    said = []
    for k in range(0, len(values) - BLOCK, BLOCK):
        block, ok = swaps.exchange(values[k : k + BLOCK], valid)
        found = swaps.observe(block, ok, 1.0 / RATE)
        said += [found] if found else []
    return swaps, said


def names_of(kind: str, seed: int) -> tuple[list[str], list[str]]:
    names = [s.name for s in run(kind, seed)[1]]
    return [n for n in names if n.startswith("cab")], [n for n in names if n.startswith("chassis")]


@pytest.mark.parametrize("kind", ["air", "rubber"])
@pytest.mark.parametrize("seed", [3, 4])
def test_every_exchange_is_found_and_put_right(kind: str, seed: int) -> None:
    cab, chassis = names_of(kind, seed)
    pairs = [(cab[0], cab[2]), (cab[1], cab[3]), (cab[1], chassis[0]), (cab[3], chassis[3])]
    for pair in pairs:
        swaps, said = search(kind, seed, pair)
        assert said == [f"the topics of {pair[0]} and {pair[1]} are exchanged"], pair
        assert all(name in swaps.messages()[0] for name in pair)


@pytest.mark.parametrize("kind", ["air", "rubber"])
@pytest.mark.parametrize(
    "changes", [{}, {"gain": 1.3}, {"gain": 0.0}, {"gain": -1.0}, {"delay_s": 0.04}, {"true_position": np.array([2.0, 0.3, 1.0])}]
)
def test_another_fault_is_no_exchange(kind: str, changes: dict[str, object]) -> None:
    swaps, said = search(kind, 5, **changes)
    assert not said
    assert not swaps.messages()


def test_exchange_that_is_put_right_is_noticed_and_kept_in_a_state() -> None:
    cab, _ = names_of("air", 3)
    swaps, _ = search("air", 3, (cab[0], cab[2]))
    kept = json.loads(json.dumps(swaps.save()))
    motion, sensors = run("air", 3)
    other, _ = search("air", 3)
    other.load(kept)
    assert other.pairs == swaps.pairs == [(0, 2)]
    clean = measure(motion, sensors, RATE, 3, noise_share=0.01).data
    values = np.hstack([clean[s.name] for s in other._sensors])
    valid = np.ones((BLOCK, len(other._sensors)), dtype=bool)
    said = [other.observe(*other.exchange(values[k : k + BLOCK], valid), 1.0 / RATE) for k in range(0, 700, BLOCK)]
    assert [s for s in said if s] == [f"the topics of {cab[0]} and {cab[2]} are no longer exchanged"]
    assert not other.pairs


@pytest.mark.parametrize("pairs", [[[0, 99]], [[1, 0]], [[-1, 1]]])
def test_state_with_sensors_that_do_not_exist_is_refused(pairs: list[list[int]]) -> None:
    with pytest.raises(ValueError, match="none of 8 sensors"):
        search("air", 3)[0].load(pairs)
