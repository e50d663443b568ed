# Copyright 2026 ride_estimation contributors
"""What must stay when a run is told in another way: at another time, in another order, in other axes, in other units."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from estimates import Estimates, changed_run, continued_run, estimates, movement
from relations import Relation, relations
from worlds.adapters import believed_vehicle, recording
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.roads import Road

from ride_estimation.estimation.offline import run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.signals.recording import Recording
from ride_estimation.vehicles.vehicle import Vehicle

#: where nothing may move: share of the stated standard deviation; rounding alone makes 1e-12
UNMOVED = 1e-6
#: length of the run [s]; time the filters need after a start [s]
SECONDS, SETTLED = 14.0, 4.0


@functools.cache
def run() -> tuple[Vehicle, Recording]:
    """Return a cab of the worlds: every sensor with its own clock phase and jitter, so that the order of sensors matters."""
    rng = np.random.default_rng(0)
    cab = random_vehicle(rng, "air")
    sensors = random_sensors(cab, rng)
    driven = drive(cab, Road.random(rng), SECONDS, 0, step=1e-3)
    data = measure(driven, sensors, 100.0, 0, noise_share=0.01, anti_alias=0.0, jitter_s=2e-4, phases_s=8e-3)
    return believed_vehicle(data, seed=0), recording(data)


@functools.cache
def unchanged() -> Estimates:
    vehicle, recorded = run()
    return estimates(run_offline(recorded, Pipeline(vehicle), smoothing=False), vehicle)


def relation(name: str) -> Relation:
    return next(r for r in relations() if r.name == name)


EXACT = [r.name for r in relations() if r.exact]
NOISY = [r.name for r in relations() if not r.exact]


@pytest.mark.parametrize("name", EXACT)
def test_nothing_moves_where_the_same_run_is_described_in_another_way(name):
    moved = movement(unchanged(), changed_run(*run(), relation(name)))
    assert moved.largest < UNMOVED
    assert moved.parameters < UNMOVED
    assert moved.spread < UNMOVED
    assert moved.statuses == 0


@pytest.mark.parametrize("name", NOISY)
def test_estimates_move_less_than_their_standard_deviation_where_noise_differs(name):
    moved = movement(unchanged(), changed_run(*run(), relation(name)), from_s=SETTLED)
    assert 0.0 < moved.rms < 0.5
    assert moved.parameters < 1.0


def test_a_run_cut_in_two_and_continued_from_a_saved_state_ends_where_the_whole_run_does():
    """Learned values continue (the first come after 7 s); motion starts anew, so forces agree once the filters have settled."""
    moved = movement(unchanged(), continued_run(*run(), share=0.6), from_s=SETTLED)
    assert moved.rms < 1.0
    assert moved.parameters < 1.0
