# Copyright 2026 ride_estimation contributors
"""A load that is on the vehicle from the start and not in its file: found by static travel, by where the CG lies, or said."""

from __future__ import annotations

import dataclasses
import functools
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from judging import run_pipeline, scored_forces, true_parameters
from worlds.adapters import believed_vehicle
from worlds.cab import CabVehicle, Measurement, drive, measure, random_sensors, random_vehicle
from worlds.roads import Road
from worlds.vehicle_text import Belief

from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.forces.mount_forces import share_by_stiffness
from ride_estimation.estimation.parameters.static_travel import StaticTravel
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.vehicles.vehicle import Vehicle

#: share of the load in the mass and its place from the CG of the loaded body [m]
SHARE, PLACE = 0.1, np.array([0.15, 0.45, 0.1])
#: from when on forces are judged [s]
SETTLED = 10.0


@functools.cache
def measured(seed: int, travel: bool) -> Measurement:
    """A cab that carries the load, 17 s at 100 Hz; transducers read zero at rest without it."""
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "any")
    pairs = tuple((name, "z") for name in cab.mount_names) if travel else ()
    run = drive(cab, Road.random(rng), 17.0, seed, step=1e-3)
    found = measure(run, random_sensors(cab, rng, displacement=pairs), 100.0, seed, noise_share=0.01)
    truth = {**found.truth, "mount_force": found.truth["mount_force"] + sideways(cab)}
    return dataclasses.replace(found, truth=truth, data={n: v + sag(cab).get(n, 0.0) for n, v in found.data.items()})


def strained(cab: CabVehicle, stiffness: np.ndarray) -> np.ndarray:
    """Forces of mounts of this stiffness (M, 3) that carry the load, shape (M, 3)."""
    push = SHARE * cab.mass * 9.80665 * np.array([0.0, 0.0, 1.0, PLACE[1], -PLACE[0], 0.0])
    wrench = np.hstack([np.vstack([np.eye(3), np.cross(arm, np.eye(3)).T]) for arm in cab.mounts - cab.cg])
    return (share_by_stiffness(wrench, stiffness.ravel()) @ push).reshape(stiffness.shape)


def sag(cab: CabVehicle) -> dict[str, float]:
    """How far the load compresses the mounts."""
    heights = -(strained(cab, cab.stiffness) / cab.stiffness)[:, 2]
    return {f"displacement_{n}_z": float(h) for n, h in zip(cab.mount_names, heights)}


def sideways(cab: CabVehicle) -> np.ndarray:
    """How the forces at rest differ from those of the drive, in which vertical forces alone carry the load, shape (M, 3)."""
    return strained(cab, cab.stiffness) - strained(cab, cab.stiffness * [1e-9, 1e-9, 1.0])


def unloaded(data: Measurement, seed: int, std: float) -> Vehicle:
    """The file of the cab without the load."""
    cab = data.run.vehicle
    off = -PLACE * SHARE / (1.0 - SHARE)
    arm, reduced = PLACE - off, cab.mass * SHARE * (1.0 - SHARE)
    belief = Belief(mass_off=-SHARE, mass_std=0.005, cg_off=tuple(off), cg_std=std, stiffness_std=0.1, stiffness_off=0.05)
    vehicle = believed_vehicle(data, belief, seed)
    inertia = cab.inertia - reduced * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return dataclasses.replace(vehicle, bodies={"cab": dataclasses.replace(vehicle.bodies["cab"], inertia=inertia)})


@functools.cache
def estimated(seed: int, travel: bool, std: float = 0.0075):
    """Forces, last estimates and sentences of a run with the file of the unloaded cab."""
    data = measured(seed, travel)
    out, snapshots, _, pipeline = run_pipeline(data, unloaded(data, seed, std))
    return out, {e.name: e for e in snapshots[-1][1]}, pipeline.health().messages


@pytest.mark.slow
def test_a_load_that_hardly_shows_leaves_nothing_valid_that_is_wrong():
    # soft mounts on a smooth road: too little motion to learn anything from
    assert np.all(np.abs(valid_scores(8111, False)[1:]) <= 2.5)


def valid_scores(seed: int, travel: bool, std: float = 0.0075) -> np.ndarray:
    true, found = true_parameters(measured(seed, travel).run.vehicle), estimated(seed, travel, std)[1]
    return np.array([(e.value - true[n]) / e.std for n, e in found.items() if e.status is Status.VALID and n in true])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [8101, 8102])
def test_static_travel_finds_mass_and_place_of_a_load(seed):
    cab, (out, found, said) = measured(seed, True).run.vehicle, estimated(seed, True)
    mass = found["cab.mass"]
    assert mass.status is Status.VALID and abs(mass.value - cab.mass) < 2.5 * mass.std < 0.15 * cab.mass
    assert any(found[f"{n}.z.stiffness"].status is Status.VALID for n in cab.mount_names)
    coverage = scored_forces(out, measured(seed, True), SETTLED).coverage
    assert np.median(coverage[:, 2]) >= 0.9 and coverage[:, 2].min() > 0.7
    # the load strains the mounts sideways too
    assert np.median(coverage[:, :2]) >= 0.9 and coverage[:, :2].min() > 0.7
    (words,) = [m for m in said if "carries a load" in m]
    assert abs(float(words.split("not know: ")[1].split()[0]) / (SHARE * cab.mass) - 1.0) < 0.25
    for told, true in zip(words.split("mounts, at ")[1].split(";")[0].split(", "), cab.cg + PLACE):
        _, value, _, std, _ = told.split()
        assert abs(float(value) - true) < 2.5 * float(std) + 0.03 and float(std) < 0.2


@pytest.mark.slow
def test_what_is_valid_beside_a_load_found_by_static_travel_is_within_its_interval():
    scores = np.concatenate([valid_scores(seed, True) for seed in (8101, 8102)])
    assert len(scores) >= 10 and np.mean(np.abs(scores) <= 2.0) >= 0.9


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "std"), [(8112, 0.0075), (8113, 0.0)])
def test_without_transducers_the_place_of_the_cg_makes_mass_and_parameters_suspect(seed, std):
    check_suspect(seed, False, std)


@pytest.mark.slow
def test_a_load_too_small_for_the_zeros_of_transducers_at_stiff_mounts_is_found_by_the_place_of_the_cg():
    check_suspect(8103, True, 0.0075)


def check_suspect(seed: int, travel: bool, std: float) -> None:
    """Mass suspect and wide, parameters not valid or right, forces wide enough, the CG in the sentence where it is."""
    cab, (out, found, said) = measured(seed, travel).run.vehicle, estimated(seed, travel, std)
    mass = found["cab.mass"]
    assert mass.status is Status.SUSPECT and abs(mass.value - cab.mass) < 2.5 * mass.std < 0.4 * cab.mass
    # what springs and place let expect of the load is in the mass
    assert abs(mass.value - cab.mass) < 0.8 * SHARE * cab.mass
    assert np.all(np.abs(valid_scores(seed, travel, std)) <= 2.5)
    coverage = scored_forces(out, measured(seed, travel), SETTLED).coverage[:, 2]
    assert np.median(coverage) >= 0.88 and coverage.min() > 0.7
    (words,) = [m for m in said if "differs from the vehicle file" in m]
    off = 1e3 * PLACE * SHARE / (1.0 - SHARE)
    numbers = words.split("vehicle file: ")[1].split(". Cause")[0].split(", ")
    for number, true in zip(numbers[:2], off):
        value, spread = float(number.split()[1]), float(number.split()[3])
        assert abs(value - true) < 3.0 * spread + 4.0


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "travel"), [(8121, False), (8122, True), (8123, False)])
def test_a_file_that_is_right_has_no_load(seed, travel):
    data = dataclasses.replace(measured(seed, travel))
    level = {n: v - sag(data.run.vehicle).get(n, 0.0) for n, v in data.data.items()}
    data = dataclasses.replace(data, data=level)
    _, snapshots, _, pipeline = run_pipeline(data, believed_vehicle(data, Belief(cg_std=0.0075), seed))
    assert not [m for m in pipeline.health().messages if "load" in m]
    assert snapshots[-1][1][0].status is Status.VALID


def test_seconds_that_show_little_of_the_cg_contradict_no_load(monkeypatch) -> None:
    estimator = Pipeline(load_vehicle("truck_cab"))._parameters

    def seen(offset: float, std: float) -> np.ndarray | None:
        """Where the CG is said to be when the last seconds show it there along y, to a standard deviation."""
        found, covariance = np.array([0.0, offset, 0.0]), std**2 * np.eye(3)
        monkeypatch.setattr(estimator, "_shown_offset", lambda own: (found, covariance, offset**2 / (std**2 + 0.07**2)))
        estimator._filter = SimpleNamespace(memory=SimpleNamespace(length=50))
        return estimator.offset_of_cg()

    assert seen(0.3, 0.3) is None
    where = seen(0.5, 0.02)
    assert where is not None and where[1] == pytest.approx(0.05)
    estimator.take_load(True)
    # it is estimated anew, and meanwhile where it was seen
    assert estimator._filter is None and estimator.seen_offset[1] == pytest.approx(0.05)
    for offset, std in ((0.5, 0.03), (0.45, 0.3), (0.2, 0.3), (0.1, 0.5)):
        assert seen(offset, std) is not None
    saved = estimator._confirmed.copy()
    assert seen(0.02, 0.03) is None
    np.testing.assert_array_equal(estimator._confirmed, saved)


@pytest.mark.parametrize(("free", "there"), [(6, True), (5, False)])
def test_a_guided_body_needs_more_for_a_load(monkeypatch, free, there):
    """What it does along the axes that it does not have looks like an offset of the CG, too."""
    estimator = Pipeline(load_vehicle("truck_cab"))._parameters
    estimator.geometry = SimpleNamespace(free=np.arange(6) < free)
    monkeypatch.setattr(estimator, "_shown_offset", lambda own: (np.array([0.0, 0.4, 0.0]), 0.01 * np.eye(3), 20.0))
    estimator._filter = SimpleNamespace(memory=SimpleNamespace(length=50))
    assert (estimator.offset_of_cg() is not None) is there


def test_a_state_with_a_possible_load_goes_on_with_its_mass():
    pipeline = Pipeline(load_vehicle("truck_cab"))
    pipeline._mass_reference.possible_load = (0.04, 0.02)
    pipeline._apply()
    mass = pipeline.parameters()[0]
    file = pipeline.geometry.body.mass.value
    # 2 % is less than a mass that is declared as known may be off, and it is that of a load
    assert mass.value == pytest.approx(1.04 * file) and mass.std > 0.019 * file
    assert pipeline._mass_reference.known and mass.status is Status.SUSPECT
    again = Pipeline(load_vehicle("truck_cab"))
    again.load_state(pipeline.save_state())
    assert again.parameters()[0] == mass


# -- static travel by itself ------------------------------------------------------------------------------------------------


def lowered(mass: float, place: tuple[float, float]) -> StaticTravel:
    """What the mounts carry beyond rest under a load [kg] at a place from the CG [m], looked at for ten seconds."""
    vehicle = load_vehicle("truck_cab_transducers")
    geometry = geometry_of(vehicle)
    weight = mass * vehicle.gravity
    total = geometry.body.mass.value + mass
    push = np.array([0.0, 0.0, weight, weight * place[1], -weight * place[0], 0.0])
    travel = StaticTravel(geometry)
    # for the file's mass all forces are smaller by the ratio of the masses
    travel.observe(np.tile(-push * geometry.body.mass.value / total, (3, 1)), np.zeros((3, len(geometry.mounts))), 10.0)
    return travel


@pytest.mark.parametrize("mass", [150.0, -150.0])
def test_a_load_by_hand(mass):
    found = lowered(mass, (0.2, -0.4)).found()
    body = load_vehicle("truck_cab_transducers").bodies["cab"].mass.value
    assert found is not None and found.log == pytest.approx(np.log1p(mass / body), rel=1e-6)
    np.testing.assert_allclose(found.offset, mass / (mass + body) * np.array([0.2, -0.4, 0.0]), atol=1e-9)
    assert 0.0 < found.std < 0.3 * abs(found.log)


def test_what_zeros_of_transducers_may_hide_is_no_load_and_a_load_does_not_flicker():
    assert lowered(4.0, (0.2, -0.4)).found() is None
    travel = lowered(150.0, (0.2, -0.4))
    assert travel.found() is not None
    least = next(mass for mass in range(5, 150, 5) if lowered(mass, (0.2, -0.4)).found())
    less = lowered(0.7 * least, (0.2, -0.4))
    assert less.found() is None
    less.load({**less.save(), "loaded": travel.save()["loaded"]})
    assert less.found() is not None
    travel.reset()
    assert not travel.decided
