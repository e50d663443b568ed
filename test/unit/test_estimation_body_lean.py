# Copyright 2026 ride_estimation contributors
"""A load that makes a body lean on its mounts, and what leans without one."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
from worlds.adapters import START_NS, arrivals, believed_vehicle
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.drawn import drawn_belief
from worlds.roads import Road

from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.common.geometry import Geometry, geometry_of
from ride_estimation.estimation.forces.mount_law import MountLaw
from ride_estimation.estimation.model.load import moved_by_load
from ride_estimation.estimation.offline import OfflineRun, run_offline
from ride_estimation.estimation.output import OutputBlock
from ride_estimation.estimation.parameters.body_lean import BodyLean, Leaning
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.estimation.sensor_errors.lean import LeanOfBases
from ride_estimation.io.vehicle_file import load_vehicle

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from effect_intervals import BELIEF, recording_of, world

GEOMETRY = geometry_of(load_vehicle("truck_cab"))
STIFFNESS = MountLaw(GEOMETRY).stiffness
OFFSET = np.array([-0.02, 0.05, 0.0])


STD = LeanOfBases(GEOMETRY).of(np.zeros((4, 2)), np.zeros((4, 2))).common_std
LEVEL = np.array([0.0, 0.0, 9.80665])


def turned_by_load(offset: np.ndarray, stiffness: np.ndarray = STIFFNESS) -> np.ndarray:
    """Rotation about x and y of the body at rest by a load that moves its CG."""
    weight = GEOMETRY.body.mass.value * 9.80665
    return moved_by_load(GEOMETRY.wrench.T, stiffness.ravel(), offset, weight)[3:5, 1]


def bases(turned: np.ndarray, force: np.ndarray = LEVEL) -> np.ndarray:
    """Readings of the bases (4, 3) under a body that is turned about x and y and reads a specific force."""
    return np.tile(force + 9.80665 * np.array([turned[1], -turned[0], 0.0]), (4, 1))


def stood(turned: np.ndarray, seconds: float = 30.0, geometry: Geometry = GEOMETRY, force: np.ndarray = LEVEL) -> BodyLean:
    """A body that stood turned."""
    found = BodyLean(geometry)
    for _ in range(round(seconds)):
        found.observe(bases(turned, force), force, 1.0)
    return found


def test_a_load_on_soft_mounts_shows_where_it_moves_the_cg():
    soft = STIFFNESS / 5.0
    found = stood(turned_by_load(OFFSET, soft)).found(soft, STD)
    assert found is not None
    assert np.allclose(found.offset, OFFSET, atol=1e-9)
    # drawn errors of eight sensors, each with a bias of 0.02 m/s^2 and an angle of 0.004 rad
    rng = np.random.default_rng(1)
    errors = np.sqrt(0.5) * np.hypot(0.004, 0.02 / 9.80665) * rng.standard_normal((2000, 2))
    each = np.array([turned_by_load(unit, soft) for unit in np.eye(3)[:2]]).T
    assert np.allclose(np.std(errors @ np.linalg.inv(each).T, axis=0), found.std[:2], rtol=0.1)
    assert "payload" in found.in_words() and "y +50 +- " in found.in_words()


def test_what_its_sensors_may_err_by_is_no_load():
    std = STD[0]
    assert stood(np.array([2.8 * std, 0.0])).found(STIFFNESS, STD) is None
    assert stood(np.array([3.6 * std, 0.0])).found(STIFFNESS, STD) is not None
    # too short
    assert stood(np.array([9.0 * std, 0.0]), 9.0).found(STIFFNESS, STD) is None


def test_a_load_does_not_flicker():
    std = STD[0]
    more, less = stood(np.array([3.6 * std, 0.0])), stood(np.array([3.2 * std, 0.0]))
    assert less.found(STIFFNESS, STD) is None and more.found(STIFFNESS, STD) is not None
    less.load({**less.save(), "leans": more.save()["leans"]})
    assert less.found(STIFFNESS, STD) is not None


def test_a_slope_or_a_bend_is_no_load_and_hides_none():
    """A cab on soft mounts across a slope of 8 %, or as long in a bend of 0.8 m/s^2, without and with a load."""
    soft = STIFFNESS / 5.0
    stiffness = GEOMETRY.wrench @ (soft.ravel()[:, None] * GEOMETRY.wrench.T)
    force = 9.80665 * np.array([0.0, np.sin(0.08), np.cos(0.08)])
    sloped = np.linalg.solve(stiffness, np.append(-GEOMETRY.body.mass.value * (force - LEVEL), np.zeros(3)))[3:5]
    assert np.linalg.norm(sloped) > np.radians(0.6)
    assert stood(sloped, force=force).found(soft, STD) is None and stood(sloped).found(soft, STD) is not None
    both = stood(sloped + turned_by_load(OFFSET, soft), force=force).found(soft, STD)
    assert both is not None and np.allclose(both.offset, OFFSET, atol=1e-6)


def test_a_saved_state_continues_alike_and_a_restart_forgets():
    first = stood(turned_by_load(4.0 * OFFSET))
    first.found(STIFFNESS, STD)
    second = BodyLean(GEOMETRY)
    second.load(first.save())
    for body in (first, second):
        body.observe(bases(turned_by_load(4.4 * OFFSET)), LEVEL, 1.0)
    ours, theirs = (body.found(STIFFNESS, STD) for body in (first, second))
    assert ours is not None and theirs is not None and np.array_equal(ours.offset, theirs.offset)
    first.reset()
    assert first.found(STIFFNESS, STD) is None


def test_a_body_on_bases_without_sensors_shows_no_lean():
    vehicle = load_vehicle("truck_cab")
    sensors = {n: s for n, s in vehicle.sensors.items() if n != "chassis_front_left"}
    three = geometry_of(dataclasses.replace(vehicle, sensors=sensors))
    assert stood(np.array([0.1, 0.0]), geometry=three).found(STIFFNESS, STD) is None
    free = geometry_of(dataclasses.replace(vehicle, mounts={}))
    body = BodyLean(free)
    body.observe(np.zeros((0, 3)), LEVEL, 30.0)
    assert body.found(np.zeros((0, 3)), STD) is None


def driven(monkeypatch: pytest.MonkeyPatch, leaning: Leaning | None, even_odds: bool = True) -> tuple[Pipeline, OutputBlock]:
    """A cab after twelve seconds of road, whatever its bases say of a lean, and its last block."""
    rng = np.random.default_rng(0)
    cab = random_vehicle(rng, "air")
    run = drive(cab, Road.random(rng), 12.0, 0, step=1e-3)
    data = measure(run, random_sensors(cab, rng), 100.0, 0, noise_share=0.01)
    monkeypatch.setattr(BodyLean, "found", lambda self, stiffness, std: leaning)
    pipeline = Pipeline(believed_vehicle(data, seed=0))
    if not even_odds:
        never = property(lambda self: False, lambda self, value: None)
        monkeypatch.setattr(type(pipeline._forces), "even_odds", never, raising=False)
    blocks = [block for stamp, name, values in arrivals(data) for block in pipeline.observe(name, stamp, values.tolist())]
    pipeline.parameters()  # settles what is due, with this lean
    return pipeline, blocks[-1]


def test_forces_are_stated_for_a_load_and_for_none(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        before, plain = driven(patch, None)
    off = np.array([0.0, 0.06, 0.0])
    with monkeypatch.context() as patch:
        after, block = driven(patch, Leaning(np.array([-0.03, 0.0]), off, np.array([0.004, 0.004, 0.0])))
    with monkeypatch.context() as patch:
        _, sure = driven(patch, Leaning(np.array([-0.03, 0.0]), off, np.array([0.004, 0.004, 0.0])), even_odds=False)
    weight, arms = after.loads.mass * 9.80665, after.geometry.arms
    moved = np.mean(block.mount_force - plain.mount_force, axis=0)
    # half of the moment of the load, and what a load halfway weighs
    assert np.isclose(moved[:, 2] @ arms[:, 1], 0.03 * weight, rtol=0.15)
    assert np.isclose(moved[:, 2].sum(), weight - before.loads.mass * 9.80665, rtol=0.15)
    std, plain_std = block.mount_force_std[-1], plain.mount_force_std[-1]
    # either end is within about one standard deviation
    assert np.all(std[:, 2] > 0.7 * np.abs(moved[:, 2])) and np.all(std[:, 2] > 2.0 * plain_std[:, 2])
    sideways = slice(0, 2)
    assert np.all((std**2 - sure.mount_force_std[-1] ** 2)[:, sideways] > 0.6 * moved[:, sideways] ** 2)
    assert any(e.status is Status.VALID for e in before.parameters())
    assert not any(e.status is Status.VALID for e in after.parameters())
    assert any("leans against its mount bases" in m for m in after.health().messages)
    assert not any("leans" in m for m in before.health().messages)


def test_a_state_with_a_lean_goes_on_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    pipeline, _ = driven(monkeypatch, Leaning(np.array([-0.03, 0.0]), np.array([0.0, 0.06, 0.0]), np.array([0.004, 0.004, 0.0])))
    again = Pipeline(pipeline.vehicle)
    again.load_state(pipeline.save_state())
    assert [e.status for e in again.parameters()] == [e.status for e in pipeline.parameters()]
    assert again.loads.mass == pipeline.loads.mass


def replayed(case: str, seed: int) -> tuple[OfflineRun, float]:
    """Replay of a drawn cab of benchmarks/effect_intervals.py and the share of its vertical forces inside two deviations."""
    data = world(case, seed)
    vehicle = believed_vehicle(data, drawn_belief(BELIEF, seed), seed)
    run = run_offline(recording_of(data, vehicle), Pipeline(vehicle), smoothing=False)
    seconds = (run.stamp_ns - START_NS) * 1e-9
    judged = run.valid & (seconds > 12.0)
    error = np.stack(
        [run.signals["mount_force"][judged, i, 2] - np.interp(seconds[judged], data.time, true)
         for i, true in enumerate(data.truth["mount_force"][:, :, 2].T)], axis=1,
    )  # fmt: skip
    return run, float(np.mean(np.abs(error) < 2.0 * run.signals["mount_force_std"][judged, :, 2]))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [9400, 9530])
def test_live_forces_hold_a_load_that_innovations_hardly_show(seed: int) -> None:
    """Nothing learned is valid and forces hold the load (31 and 0 % without the lean). Without the load all is as usual."""
    loaded, inside = replayed("load", seed)
    assert inside > 0.85 and not any(e.status is Status.VALID for e in loaded.parameters)
    assert any("leans against its mount bases" in m for m in loaded.health.messages)
    healthy, _ = replayed("none", seed)
    assert any(e.status is Status.VALID for e in healthy.parameters)
    assert not any("leans" in m for m in healthy.health.messages)
