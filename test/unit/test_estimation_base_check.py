# Copyright 2026 ride_estimation contributors
"""Base sensors that become faulty while driving are named; bumps, cobbles and a vehicle that stops are no fault."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from worlds.adapters import believed_vehicle
from worlds.cab import CabRun, CabSensor, drive, measure, random_sensors, random_vehicle
from worlds.roads import Road

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.faults.base_check import BaseCheck
from ride_estimation.estimation.faults.left_out import DISAGREES
from ride_estimation.estimation.faults.sensor_gate import GateVerdict
from ride_estimation.signals.alignment import Block

RATE, BLOCK = 100.0, 10
BEGIN, END, LENGTH = 12.0, 15.0, 20.0


@functools.cache
def run(kind: str, seed: int) -> tuple[CabRun, tuple[CabSensor, ...]]:
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air")
    road = dataclasses.replace(Road.random(rng, kind), stop_s=17.0 if kind == "smooth" else np.inf)
    return drive(cab, road, LENGTH, seed, step=1e-3), random_sensors(cab, rng)


def judged(
    kind: str, seed: int, victim: str = "", laps: int = 1, **changes: object
) -> tuple[BaseCheck, np.ndarray, list[GateVerdict]]:
    """Feed the base sensors of a run, one changed from BEGIN to END, again in every lap; return check, times, verdicts."""
    motion, sensors = run(kind, seed)
    wrong = tuple(dataclasses.replace(s, **changes) if s.name == victim else s for s in sensors)  # type: ignore[arg-type]
    clean, faulty = (measure(motion, s, RATE, seed, noise_share=0.01) for s in (sensors, wrong))
    base = [s for s in geometry_of(believed_vehicle(clean, seed=seed)).base_sensors if s is not None]
    late = (clean.time >= BEGIN) & (clean.time < END)
    values = np.hstack([np.where(late[:, None], faulty.data[s.name], clean.data[s.name]) for s in base])
    check = BaseCheck(base, range(len(base)), range(0, 3 * len(base), 3))
    valid = np.ones((BLOCK, len(base)), dtype=bool)
    nothing = GateVerdict(valid, False, (), (), False, 1.0)
    times = np.arange(0, len(values) - BLOCK, BLOCK)
    fault = times[(times >= BEGIN * RATE) & (times < END * RATE - BLOCK)]
    times = np.concatenate([times[times < fault[0]], np.tile(fault, laps), times[times > fault[-1]]])
    step_ns = round(1e9 / RATE)
    verdicts = []
    for k in times:
        block = Block(int(k) * step_ns, step_ns, values[k : k + BLOCK], valid, "")
        verdicts.append(check.judged(block, nothing, 1.0 / RATE))
    return check, times / RATE, verdicts


@pytest.mark.parametrize("changes", [{"delay_s": 0.02}, {"gain": -1.0}], ids=["20 ms late", "inverted"])
def test_fault_of_one_sensor_is_named_while_it_lasts(changes: dict[str, object]) -> None:
    victim = "chassis_rear_left"
    check, times, verdicts = judged("any", 9, victim, **changes)
    place = next(n for n, s in enumerate(check._sensors) if s.name == victim)
    out = np.array([not v.valid[:, place].all() for v in verdicts])
    others = np.array([not np.delete(v.valid, place, axis=1).all() or v.unusual for v in verdicts])
    first, last = times[out][0], times[out][-1]
    assert BEGIN <= first <= BEGIN + 0.5
    assert END - 0.2 <= last <= END + 3.0
    assert out[(times >= first) & (times <= last)].all()
    assert not others.any()
    began = [v.newly_refused for v in verdicts if v.began]
    assert began == [(place,)]
    assert check.messages() == [f"{victim} was not used: {BLOCK * int(out.sum())} ticks {DISAGREES}"]


def test_sensor_that_stays_faulty_stays_out() -> None:
    """Ninety seconds inverted: not taken for a property of the vehicle."""
    check, _, verdicts = judged("any", 9, "chassis_rear_left", laps=30, gain=-1.0)
    place = next(n for n, s in enumerate(check._sensors) if s.name == "chassis_rear_left")
    out = np.array([not v.valid[:, place].all() for v in verdicts])
    begun = int(np.flatnonzero(out)[0])
    assert out[begun : begun + int(85.0 * RATE / BLOCK)].all()
    assert not any(v.unusual for v in verdicts[begun:])


@pytest.mark.parametrize("kind", ["any", "bumps", "cobbles", "smooth"])
@pytest.mark.parametrize("seed", [21, 22])
def test_no_road_is_a_fault(kind: str, seed: int) -> None:
    check, _, verdicts = judged(kind, seed)
    assert check.possible
    assert all(v.valid.all() and not v.unusual and not v.began for v in verdicts)
    assert not check.messages()


def test_two_bases_have_nothing_to_spare() -> None:
    motion, sensors = run("any", 8)
    base = [s for s in geometry_of(believed_vehicle(measure(motion, sensors, RATE, 8), seed=8)).base_sensors if s is not None]
    for count in (0, 1, 2):
        assert not BaseCheck(base[:count], range(count), range(0, 3 * count, 3)).possible
