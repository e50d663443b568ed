# Copyright 2026 ride_estimation contributors
"""A load that the vehicle file does not contain: its statics against finite rotations, what tells its mass, forces of a run."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy import optimize
from scipy.spatial.transform import Rotation
from test_estimation_run_forces import FOLLOW, KINDS, judged
from worlds.adapters import believed_vehicle, recording, vehicle_of_text
from worlds.cab import CabVehicle, Measurement, drive, measure, random_sensors, random_vehicle
from worlds.installation import installed
from worlds.roads import Road
from worlds.vehicle_text import Belief, vehicle_yaml

from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.forces.mount_forces import static_share, static_split
from ride_estimation.estimation.model.drive_calibration import calibrate_drive
from ride_estimation.estimation.model.joint import JointEstimate
from ride_estimation.estimation.model.load import Load, LoadEvidence, of_delivery
from ride_estimation.estimation.model.plant import Plant
from ride_estimation.estimation.model.run_forces import RunForces, run_forces
from ride_estimation.estimation.model.run_readings import run_readings
from ride_estimation.sensors.installation import USUAL
from ride_estimation.vehicles.vehicle import Vehicle

BELIEF = Belief(stiffness_off=0.05, stiffness_std=0.1, mass_std=0.005, cg_std=0.0075, inertia_std=0.04)
#: share of the mass, arm from the CG [m], edge of the box [m]
SHARE, ARM, EDGE = 0.15, np.array([0.1, -0.45, 0.1]), 0.5


def loaded(cab: CabVehicle, stands: bool, share: float) -> CabVehicle:
    """Return a cab with a load: put on a cab that stood level, or on one that stands level with it (``stands``)."""
    load = share * cab.mass
    mass = cab.mass + load
    apart = cab.mass * load / mass * (ARM @ ARM * np.eye(3) - np.outer(ARM, ARM))
    inertia, cg = cab.inertia + apart + load * EDGE**2 / 6.0 * np.eye(3), cab.cg + load / mass * ARM
    if stands:
        return dataclasses.replace(cab, mass=mass, cg=cg, inertia=inertia)
    return dataclasses.replace(cab, hidden=dataclasses.replace(cab.hidden, mass_after=(0.0, mass, cg, inertia), mass_over_s=0.0))


def world(seed: int, stands: bool, travel: bool, share: float = SHARE) -> tuple[Measurement, Vehicle]:
    """Return a drive of a cab with a load and the vehicle file without it."""
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air" if seed % 2 == 0 else "rubber")
    drawn = random_sensors(cab, rng, displacement=tuple((name, "z") for name in cab.mount_names) if travel else ())
    bad = installed(drawn, seed, **{kind: getattr(USUAL, kind) for kind in KINDS})
    sensors = tuple(exact if exact.kind == "displacement" else s for exact, s in zip(drawn, bad))
    run = drive(loaded(cab, stands, share), dataclasses.replace(Road.random(rng), follow=FOLLOW), 30.0, seed, step=1e-3)
    data = measure(run, sensors, 100.0, seed, noise_share=0.01)
    unloaded = dataclasses.replace(data, run=dataclasses.replace(data.run, vehicle=cab))
    return data, believed_vehicle(unloaded, BELIEF, seed)


SLOW = [pytest.param(kind, marks=pytest.mark.slow) for kind in ((7001, False, True), (7003, True, False))]


@pytest.fixture(scope="module", params=[(7002, False, False), *SLOW], ids=str)
def drive_with_load(request: pytest.FixtureRequest) -> tuple[Measurement, Vehicle, RunForces, bool, bool]:
    seed, stands, travel = request.param
    data, vehicle = world(seed, stands, travel)
    return data, vehicle, run_forces(recording(data), vehicle), stands, travel


def test_forces_with_a_load_are_as_near_as_is_stated(drive_with_load: tuple[Measurement, Vehicle, RunForces, bool, bool]) -> None:
    data, _, found, _, travel = drive_with_load
    error, std, spread = judged(data, found)
    inside = np.mean(np.abs(error) <= 2.0 * std, axis=0)
    assert inside.min() > 0.75 and inside.mean() > 0.9
    relative = np.sqrt(np.mean(error**2, axis=0)) / spread
    assert np.median(relative[:, :2]) < 0.2
    assert np.median(relative[:, 2]) < (0.1 if travel else 0.6)


def test_mass_and_place_of_a_load_are_as_near_as_is_stated(
    drive_with_load: tuple[Measurement, Vehicle, RunForces, bool, bool],
) -> None:
    data, vehicle, found, stands, travel = drive_with_load
    body = vehicle.bodies["cab"]
    known = {e.name: e for e in (*found.parameters, *found.mass_properties)}
    mass = known["cab.mass"]
    assert abs(mass.value - (1.0 + SHARE) * body.mass.value) < 2.0 * mass.std
    assert (mass.status is Status.VALID) is travel and (mass.std < 0.05 * mass.value) is travel
    moved = SHARE / (1.0 + SHARE) * ARM
    for axis, place, own in zip("xyz", np.asarray(body.cg) + moved, body.cg_std):
        assert abs(known[f"cab.cg.{axis}"].value - place) < np.hypot(4.0 * known[f"cab.cg.{axis}"].std, 2.0 * own * 1e-3)
    assert ("the body leans by" in found.load) or stands
    assert f"mass {mass.value - body.mass.value:+.0f} +- " in found.load
    outside = 0
    for e in (e for e in found.parameters if e is not mass):
        place, axis, kind = e.name.split(".")
        true = getattr(data.run.vehicle, kind)[data.run.vehicle.mount_names.index(place), "xyz".index(axis)]
        outside += abs(e.value - true) > 2.0 * e.std
    assert outside <= 3


@pytest.mark.slow
def test_a_wrong_cg_is_told_from_a_load_and_widens_the_mass() -> None:
    data, vehicle = world(7010, stands=True, travel=False, share=0.0)
    body = vehicle.bodies["cab"]
    moved = dataclasses.replace(body, cg=np.asarray(body.cg) + np.array([0.0, 0.06, 0.0]))
    found = run_forces(recording(data), dataclasses.replace(vehicle, bodies={**vehicle.bodies, "cab": moved}))
    assert "or a wrong CG" in found.load and "stands level" in found.load
    error, std, spread = judged(data, found)
    assert np.mean(np.abs(error) <= 2.0 * std) > 0.9
    assert np.median(np.sqrt(np.mean(error[:, :, 2] ** 2, axis=0)) / spread[:, 2]) < 0.35
    straight = run_forces(recording(data), vehicle)
    assert not straight.load and not straight.refused


def cab_plant(seed: int) -> Plant:
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "rubber")
    return Plant(vehicle_of_text(vehicle_yaml(cab, random_sensors(cab, rng))))


@pytest.mark.parametrize("softer", [1.0, 0.3])
def test_static_forces_with_a_load_are_those_of_a_finite_rotation(softer: float) -> None:
    plant = cab_plant(5)
    slow, body = plant.slow, plant.geometry.body
    k = softer * np.exp(slow.mean[slow.log_stiffness])
    weight, cg = body.mass.value * plant.gravity, np.asarray(body.cg)
    points = plant.points(cg)
    wrench = np.array([0.0, 0.0, weight, 0.0, 0.0, 0.0])
    level, _ = static_split(plant.mounts, points.T, static_share(points.T, k, wrench), wrench)
    moved = cg + SHARE / (1.0 + SHARE) * ARM
    arms = np.array([m.position for m in plant.mounts]) - cg

    def force(motion: np.ndarray) -> np.ndarray:
        turned = Rotation.from_rotvec(motion[3:]).apply(arms)
        return level - k.reshape(-1, 3) * (motion[:3] + turned - arms)

    def unbalanced(motion: np.ndarray) -> np.ndarray:
        turn, f = Rotation.from_rotvec(motion[3:]), force(motion)
        down = np.array([0.0, 0.0, -(1.0 + SHARE) * weight])
        moments = np.cross(turn.apply(arms), f).sum(axis=0) + np.cross(turn.apply(moved - cg), down)
        return np.r_[f.sum(axis=0) + down, moments] / weight

    motion = optimize.fsolve(unbalanced, np.zeros(6), xtol=1e-13)
    exact = force(motion)
    centre = np.mean([m.position for m in plant.mounts], axis=0)
    turn = Rotation.from_rotvec(motion[3:])
    load = Load(SHARE, 0.0, 1.0, motion[:3] + turn.apply(centre - cg) - (centre - cg), motion[3:], centre)
    found = plant.with_load(load, moved - cg)
    theta = found.slow.mean.copy()
    theta[slow.cg] = cg + motion[:3] + turn.apply(moved - cg)
    theta[slow.log_stiffness] = np.log(k / (1.0 + SHARE))
    static = (1.0 + SHARE) * found.constants(theta).static
    sideways = np.abs(exact[:, :2]).max()
    np.testing.assert_allclose(static[:, :2], exact[:, :2], atol=0.06 * sideways)
    np.testing.assert_allclose(static[:, 2], exact[:, 2], rtol=5e-3)
    np.testing.assert_allclose(load.own(load.moved(moved)), moved, atol=1e-12)


def evidence(**changed: object) -> LoadEvidence:
    """Return the evidence of a load of a tenth at least, that nothing but the place of the CG tells, unless changed."""
    motion = np.zeros((6, 2))
    motion[2, 0], motion[3, 1] = -0.1, 0.01
    none, nowhere = np.zeros(0), np.zeros(3)
    nothing = LoadEvidence(np.array([0.0, 0.07, 0.0]), 0.1, 0.0, 1e3, motion, nowhere, nowhere, np.zeros((0, 6)), none, none)
    return dataclasses.replace(nothing, **changed)  # type: ignore[arg-type]


def test_without_evidence_a_load_is_anywhere_and_a_wrong_cg_as_likely() -> None:
    load, _ = evidence().load(leans=True)
    assert load.presence == 1.0 and 0.1 < load.share < 0.2 and 0.07 < load.std < 0.2
    level, _ = evidence().load(leans=False)
    assert level.presence == pytest.approx(0.5) and not level.leaning
    assert level.share == pytest.approx(0.5 * load.share, rel=1e-6)


def test_soft_mounts_are_a_heavy_load_and_mounts_as_in_the_file_a_wrong_cg() -> None:
    heavy, unlikely = evidence(log_stiffness=-np.log(1.25), stiffness_std=0.03).load(leans=False)
    assert heavy.share == pytest.approx(0.25, abs=0.04) and heavy.presence > 0.99
    right, likely = evidence(stiffness_std=0.03).load(leans=False)
    assert right.presence < 0.05 and right.share < 0.01 and likely < unlikely
    taken, _ = evidence(log_stiffness=0.2, stiffness_std=0.03).load(leans=True)
    assert taken.share == pytest.approx(np.exp(-0.2) - 1.0, abs=0.04)


def test_static_travel_tells_the_mass_and_that_the_body_leans() -> None:
    seen = {"points": np.eye(6)[2:3], "travel": np.array([-0.1 * 0.2 / 1.2]), "travel_std": np.array([1e-3])}
    load, unlikely = evidence(**seen).load(leans=True)
    assert load.share == pytest.approx(0.2, abs=0.01) and load.std < 0.02
    np.testing.assert_allclose(load.leans, [0.01 / (1.0 + load.share), 0.0, 0.0], atol=1e-9)
    assert evidence(**seen).load(leans=False)[1] > unlikely + 50.0


@pytest.mark.slow
def test_sensors_are_calibrated_from_a_drive_with_a_load() -> None:
    data, vehicle = world(7005, stands=False, travel=True)
    found = calibrate_drive(recording(data), vehicle)
    assert found.usable and any("the body leans by" in words for words in found.findings)
    inside = []
    for sensor in (s for s in data.sensors if s.kind == "accelerometer"):
        errors, stds = found.sensors[sensor.name].errors, found.sensors[sensor.name].stds
        moved = sensor.true_position - sensor.position
        inside += list(np.abs(errors["position"] - moved) < 2.0 * stds["position"])
    assert np.mean(inside) > 0.85


def test_products_of_inertia_that_the_file_lacks_are_found() -> None:
    data, vehicle = world(7021, stands=False, travel=False, share=0.0)
    body, cab = vehicle.bodies["cab"], data.run.vehicle
    size = np.sqrt(np.diag(cab.inertia))
    skewed = np.array([[0.0, 0.05, -0.04], [0.05, 0.0, 0.03], [-0.04, 0.03, 0.0]]) * np.outer(size, size)
    wrong = dataclasses.replace(body, inertia=np.asarray(body.inertia) - skewed)
    found = run_readings(recording(data), dataclasses.replace(vehicle, bodies={**vehicle.bodies, "cab": wrong}))
    joint = JointEstimate(found.plant, [found.segments[0]], found.dt)
    joint.fit()
    products = joint.plant.slow.inertia_products
    error = joint.theta[products] - np.array([0.05, -0.04, 0.03])
    std = np.sqrt(np.diag(joint.covariance)[products])
    assert np.all(np.abs(error) < 3.0 * std) and np.all(std < 0.5 * joint.stated.std[products])


def test_springs_softer_than_the_file_and_travel_tell_a_load_from_a_wrong_cg() -> None:
    offset, least = np.array([0.04, -0.05, 0.0]), 0.1
    # a load of 15 %: springs seem that much softer for the mass of the file
    soft, stiff = ((float(np.log(1.0 / 1.15)) * part, 0.1) for part in (1.0, 0.0))
    loaded, wrong = (LoadEvidence.of_accelerations(offset, least, s).load(leans=False)[0] for s in (soft, stiff))
    assert abs(loaded.share - 0.15) < loaded.std < 0.1 and loaded.presence > 0.6
    assert wrong.share < 0.6 * loaded.share and abs(wrong.share) < 2.0 * wrong.std and wrong.presence < 0.5
    # what static travel says counts by how well it is known
    told = LoadEvidence.of_accelerations(offset, least, stiff, (1.0 / 1.15, 0.01)).load(leans=False)[0]
    assert told.share == pytest.approx(0.15, abs=0.02) and told.std < 0.02
    hardly = LoadEvidence.of_accelerations(offset, least, stiff, (1.0 / 1.15, 10.0)).load(leans=False)[0]
    assert hardly.share == pytest.approx(wrong.share, abs=1e-3)


def test_a_delivery_of_springs_is_soft_as_a_whole() -> None:
    assert of_delivery(np.array([-0.1, -0.2]), np.array([0.1, 0.2])) == pytest.approx((-0.15, np.sqrt(0.025)))
    assert of_delivery(np.array([-0.1]), np.array([0.0]))[1] > 0.0
    assert of_delivery(np.zeros(0), np.zeros(0)) == (0.0, np.inf)
