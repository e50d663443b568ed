# Copyright 2026 ride_estimation contributors
"""A seat on a cab: what small rotations leave out of it, and diagnoses of cabs that carry one."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ride_estimation.api.diagnosing import diagnose
from ride_estimation.api.runs import Run
from ride_estimation.diagnosis.answer.result import EXPLAINED, NO_DISCREPANCY
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.model.body_trajectories import BodyMotion, Trajectories
from ride_estimation.diagnosis.model.kinematics import Brackets, output_correction, wrench_correction
from ride_estimation.diagnosis.model.plant import build_plant, static_forces
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.registry import element_from_mapping
from ride_estimation.frames import AXES, COORDINATES
from ride_estimation.io.scenario_file import load_scenario
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.simulation.field_run import run_scenario
from ride_estimation.simulation.simulate import simulate
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

TRUCK_CAB = Path(__file__).parents[2] / "config" / "vehicles" / "truck_cab.yaml"
PLACE = np.array([-0.2, 0.3, 0.25])
GUIDES = {"z": ("z",), "y and z": ("y", "z"), "all six": COORDINATES}


def seated(coordinates: tuple[str, ...], mass: float = 118.0, place: np.ndarray = PLACE) -> Vehicle:
    """Return the cab with a seat that has some coordinates of its own."""
    cab = load_vehicle(TRUCK_CAB)
    held = {"x": (4e4, 300.0), "y": (4e4, 300.0), "z": (9.5e3, 700.0)}
    axes = [a for a in AXES if a in coordinates]
    # four springs hold a free seat upright, a guide one that is not
    corners = [(0.0, 0.0, -0.3)] if len(coordinates) < 6 else [(x, y, -0.1) for x in (0.25, -0.25) for y in (0.25, -0.25)]
    mounts = {
        f"seat_{i}": Mount(
            f"seat_{i}", place + np.array(corner), "seat", "cab",
            {a: KelvinVoigt(held[a][0] / len(corners), held[a][1] / len(corners)) for a in axes},
            {(a, "stiffness"): Prior(held[a][0] / len(corners), 0.3 * held[a][0] / len(corners)) for a in axes},
        )
        for i, corner in enumerate(corners)
    }  # fmt: skip
    seat = Body("seat", Prior(mass, 0.01 * mass), place, np.diag([6.0, 6.0, 5.0]), coordinates=tuple(coordinates))
    pad = Sensor("pad", "accelerometer", "/pad", "seat", position=place + np.array([0.0, 0.1, 0.1]), noise_std=0.02)
    return dataclasses.replace(
        cab, bodies={**cab.bodies, "seat": seat}, mounts={**cab.mounts, **mounts}, sensors={**cab.sensors, "pad": pad}
    )


def plant_of(vehicle: Vehicle):
    """Return the plant of a vehicle all of whose sensors spoke, and stiffness and damping of its mounts, shape (3 M,) each."""
    plant = build_plant(vehicle, dict.fromkeys(vehicle.sensors, 3))
    modulus = np.zeros((2, 3 * len(plant.mounts)))
    for port in plant.ports:
        modulus[:, 3 * plant.mounts.index(port.mount) + AXES.index(port.axis)] = port.stiffness, port.damping
    return plant, modulus


def travel(plant, coordinates: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Return the deflections of all mounts with small rotations, shape (N, 3 M); base motion (N, 3 M)."""
    out = np.zeros((len(coordinates), 3 * len(plant.mounts)))
    for port, row, of_base in zip(plant.ports, plant.port_map, plant.port_base):
        i = 3 * plant.mounts.index(port.mount) + AXES.index(port.axis)
        out[:, i] = coordinates @ row - base @ of_base
    return out


@pytest.mark.parametrize("coordinates", GUIDES.values(), ids=GUIDES)
def test_what_small_rotations_leave_out_falls_with_the_square_of_the_motion(coordinates):
    plant, modulus = plant_of(seated(coordinates))
    q = np.random.default_rng(2).standard_normal((3, 1, len(plant.coordinates)))
    still = np.zeros((1, modulus.shape[1]))
    size = {}
    for share in (1e-3, 1e-4):
        motion = BodyMotion(*(share * q))
        relative = travel(plant, motion.position, still), travel(plant, motion.velocity, still)
        force = wrench_correction(plant, motion, relative, Brackets(still, still), tuple(modulus))
        size[share] = np.linalg.norm(force), np.linalg.norm(output_correction(plant, Trajectories(plant, motion).bodies))
    np.testing.assert_allclose(np.divide(*size.values()), 100.0, rtol=0.02)


@pytest.mark.parametrize("coordinates", GUIDES.values(), ids=GUIDES)
def test_the_equations_with_what_small_rotations_leave_out_hold_along_a_simulated_ride(coordinates):
    vehicle, rate = seated(coordinates), 1000.0
    plant, modulus = plant_of(vehicle)
    t = np.arange(4000) / rate
    fade = np.minimum(t / 2.0, 1.0) ** 3
    shape = np.zeros((len(t), len(vehicle.mounts), 3))
    for number, (hz, size) in enumerate(((0.9, (0.06, 0.12, 0.05)), (1.7, (0.02, 0.03, 0.05)), (3.1, (0.004, 0.002, 0.01)))):
        phase = np.random.default_rng(number).uniform(0.0, 6.0, (len(vehicle.mounts), 3))
        shape += np.array(size) * np.sin(2.0 * np.pi * hz * t[:, None, None] + 0.25 * phase) * fade[:, None, None]
    base = BaseMotion.from_displacement(shape, rate)
    response = simulate(assemble(vehicle), base, full_rotation=True)
    moving = []
    for body in vehicle.bodies:
        angle = Rotation.from_matrix(response.rotation[:, list(vehicle.bodies).index(body)]).as_rotvec()
        moving.append(np.hstack([response.body_motion(body, "coordinates")[:, :3], angle]))
    picked = [6 * list(vehicle.bodies).index(b) + COORDINATES.index(c) for b, c in plant.coordinates]
    q = np.hstack(moving)[:, picked]
    assert np.abs(np.degrees(q[:, 3:5])).max() > 4.0
    v = np.gradient(q, 1.0 / rate, axis=0, edge_order=2)
    a = np.gradient(v, 1.0 / rate, axis=0, edge_order=2)
    order = [list(vehicle.mounts).index(m) for m in plant.mounts]
    place, speed = (x[:, order].reshape(len(t), -1) for x in (base.displacement, base.velocity))
    relative = travel(plant, q, place), travel(plant, v, speed)
    motion, still = BodyMotion(q, v, a), np.zeros_like(place)
    beyond = wrench_correction(plant, motion, relative, Brackets(still, still), tuple(modulus))
    inertial = a @ plant.mass.T
    missed = inertial + q @ plant.gravity_stiffness.T
    for port, row in zip(plant.ports, plant.port_map):
        i = 3 * plant.mounts.index(port.mount) + AXES.index(port.axis)
        missed += np.outer(modulus[0, i] * relative[0][:, i] + modulus[1, i] * relative[1][:, i], row)
    inner = slice(50, -50)
    linear, full = (np.linalg.norm(m[inner], axis=0) / np.linalg.norm(inertial[inner], axis=0) for m in (missed, missed - beyond))
    assert np.median(linear) > 0.03
    assert np.all(full < 0.05 * linear.max())
    for number, (name, body) in enumerate(Trajectories(plant, motion).bodies.items()):
        assert name == list(vehicle.bodies)[number]
        exact = response.body_motion(name, "coordinates")[:, :3]
        np.testing.assert_allclose(body.displacement, exact, atol=1e-3 * np.abs(exact).max())


def test_the_weight_of_a_seat_beside_its_mount_is_carried_at_its_cg():
    vehicle = seated(("z",))
    beside = dataclasses.replace(vehicle.mounts["seat_0"], position=PLACE + np.array([0.4, -0.3, -0.3]))
    shifted = dataclasses.replace(vehicle, mounts={**vehicle.mounts, "seat_0": beside})
    names, bodies = tuple(vehicle.mounts), tuple(vehicle.bodies)
    # the guide, not the spring, holds the seat upright
    np.testing.assert_allclose(static_forces(shifted, names, bodies), static_forces(vehicle, names, bodies), rtol=1e-9)
    np.testing.assert_allclose(static_forces(shifted, names, bodies), assemble(shifted).static_force[:, 2], rtol=1e-6)


def test_a_seat_that_slides_fore_and_aft_alone_rests_on_the_mounts_of_its_cab():
    vehicle = seated(("x",), place=np.array([0.1, 0.2, 0.3]))
    names = tuple(vehicle.mounts)
    force = static_forces(vehicle, names, tuple(vehicle.bodies))
    np.testing.assert_allclose(force, assemble(vehicle).static_force[:, 2], atol=1e-6)
    held = [i for i, m in enumerate(vehicle.mounts.values()) if m.body == "cab"]
    places = np.array([vehicle.mounts[names[i]].position for i in held])
    assert force[held].sum() == pytest.approx(1318.0 * vehicle.gravity)
    np.testing.assert_allclose(force[held] @ places[:, :2], 118.0 * vehicle.gravity * np.array([0.1, 0.2]), atol=1e-6)


SCENARIO = """
schema: ride_estimation/scenario/1
name: seat
vehicle: {vehicle}
seed: {seed}
duration_s: {seconds}
speed_km_per_h: 30.0
road: {{iso_class: C}}
sensors: {{rate_hz: 200.0}}
"""


def driven(tmp_path: Path, vehicle: Vehicle, seed: int, seconds: float = 40.0, friction: str = "") -> Run:
    """Return a simulated run of a vehicle, with friction in one mount."""
    path = tmp_path / "scenario.yaml"
    path.write_text(SCENARIO.format(vehicle=TRUCK_CAB, seed=seed, seconds=seconds))
    scenario = load_scenario(path)
    if friction:
        before = vehicle.mounts[friction].elements["z"].to_mapping()
        rubs = {"kind": "bouc_wen", "friction_n": 90.0, "slope_n_per_m": 1.5e5, "share": 0.8}
        changed = element_from_mapping({"kind": "sum", "elements": [before, rubs]})
        scenario = dataclasses.replace(scenario, true_elements={(friction, "z"): changed})
    return Run(run_scenario(scenario, vehicle).recording, vehicle)


SEATS = {
    "z only": (("z",), 118.0, PLACE, 71), "z only, light and low": (("z",), 60.0, np.array([0.3, -0.2, -0.1]), 72),
    "z only, heavy and high": (("z",), 180.0, np.array([-0.5, 0.4, 0.8]), 73), "y and z": (("y", "z"), 118.0, PLACE, 74),
    "free": (COORDINATES, 118.0, PLACE, 75),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("coordinates", "mass", "place", "seed"), SEATS.values(), ids=SEATS)
def test_a_healthy_cab_with_a_seat_has_no_discrepancy(tmp_path, coordinates, mass, place, seed):
    found = diagnose(driven(tmp_path, seated(coordinates, mass, place), seed), settings=Settings())
    assert found.verdict == NO_DISCREPANCY, found.answer.sentence


@pytest.mark.slow
@pytest.mark.parametrize("speed", [10, 15])
def test_the_loader_of_document_001_with_its_seat_has_no_discrepancy_on_rough_ground(speed):
    path = TRUCK_CAB.parents[1] / "scenarios" / f"document_001_rough_{speed}_km_per_h.yaml"
    machine, cab = (load_vehicle(TRUCK_CAB.parent / f"{name}.yaml") for name in ("planar_machine_set_b", "backhoe_loader_cab"))
    found = diagnose(Run(run_scenario(load_scenario(path), machine).recording, cab), settings=Settings())
    assert found.verdict == NO_DISCREPANCY, found.answer.sentence


@pytest.mark.slow
@pytest.mark.parametrize("mount", ["seat_0", "rear_left"])
def test_friction_is_named_in_the_seat_and_in_a_mount_of_the_cab_that_carries_it(tmp_path, mount):
    found = diagnose(driven(tmp_path, seated(("z",)), 76, friction=mount), settings=Settings())
    assert found.verdict == EXPLAINED, found.answer.sentence
    assert [(c.id, c.location, c.axis) for c in found.answer.causes] == [("coulomb_friction", mount, "z")]
