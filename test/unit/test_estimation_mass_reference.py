# Copyright 2026 ride_estimation contributors
"""Mass from what anchors forces in absolute terms, through the whole pipeline; the file's mass is 15 % high."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from worlds.adapters import START_NS, arrivals, believed_vehicle
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.roads import Road
from worlds.vehicle_text import Belief

from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.forces.free_parameters import find_free_parameters
from ride_estimation.estimation.parameters.mass_reference import MassReference
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.vehicle import ForceReference

OFF = 0.15


@functools.cache
def world(seed: int):
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air")
    run = drive(cab, Road.random(rng), 13.0, seed, step=1e-3)
    return cab, measure(run, random_sensors(cab, rng), 250.0, seed, noise_share=0.01)


def reference(cab, kind):
    if kind == "known_stiffness":
        return "{kind: known_stiffness, mount: front_left, axis: z, relative_std: 0.01}"
    static = cab.static_force() if callable(cab.static_force) else cab.static_force
    return (
        f"{{kind: air_spring_pressure, mount: front_left, axis: z, pressure_pa: {static[0][2] / 0.01:.9g}, area_m2: 0.01, "
        "force_std_n: 20}"
    )


def listened(vehicle, samples):
    pipeline = Pipeline(vehicle)
    for stamp, name, values in samples:
        pipeline.observe(name, stamp, values.tolist())
    pipeline.finish()
    return pipeline


def mass_of(seed, kind, inertia_off):
    """Return the estimate of the mass and the true mass."""
    cab, data = world(seed)
    belief = Belief(mass_off=OFF, mass_std=0.2, inertia_std=0.2, force_references=(reference(cab, kind),))
    vehicle = believed_vehicle(data, belief, seed=seed)
    if kind == "known_stiffness":
        element = vehicle.mounts["front_left"].elements["z"].replace(stiffness=float(cab.stiffness[0, 2]))
        vehicle = vehicle.replace_elements({("front_left", "z"): element})
    body = dataclasses.replace(vehicle.bodies["cab"], inertia=cab.inertia * (1.0 + inertia_off))
    return listened(dataclasses.replace(vehicle, bodies={"cab": body}), arrivals(data)).parameters()[0], cab.mass


def near(mass, true):
    """Within 3 % and within three of its standard deviations, which are no wider than that."""
    assert mass.status is Status.VALID
    assert abs(mass.value / true - 1.0) < 0.03
    assert abs(mass.value - true) < 3.0 * mass.std
    assert mass.std < 0.04 * true


@pytest.mark.parametrize(
    ("kind", "inertia_off"),
    [
        ("known_stiffness", 0.0), ("air_spring_pressure", 0.0),
        *(pytest.param(k, i, marks=pytest.mark.slow) for k in ("known_stiffness", "air_spring_pressure") for i in (OFF, -0.1)),
    ],
)  # fmt: skip
def test_mass_is_found_whether_or_not_the_inertia_is_off_with_it(kind, inertia_off):
    """13 s of road; inertia off with the mass, right, and off the other way."""
    near(*mass_of(63 if kind == "known_stiffness" else 64, kind, inertia_off))


def test_inertia_over_mass_is_found_and_reaches_the_loads():
    """A file whose inertia alone is 20 % high: moment about the CG within 5 % of the truth instead of 20 %."""
    cab, data = world(63)
    vehicle = believed_vehicle(data, Belief(inertia_std=0.2), seed=63)
    body = dataclasses.replace(vehicle.bodies["cab"], inertia=cab.inertia * 1.2)
    pipeline = Pipeline(dataclasses.replace(vehicle, bodies={"cab": body}))
    blocks = []
    for stamp, name, values in arrivals(data):
        blocks += pipeline.observe(name, stamp, values.tolist())
    blocks += pipeline.finish()
    row = np.round((np.concatenate([b.stamp_ns for b in blocks]) - START_NS) * 1e-9 * data.rate_hz).astype(int)
    late = (row > 8 * data.rate_hz) & (row < len(data.time))
    found = np.concatenate([b.support_load for b in blocks])[late, 3:]
    true = data.truth["inertial_load"][row[late], 3:]
    slope = np.sum(found * true, axis=0) / np.sum(true**2, axis=0)
    assert np.all(np.abs(slope - 1.0) < 0.05)


def test_load_cell_under_one_mount():
    """A cell with 1 % noise of the moving force and an unknown zero, the file's mass 15 % high."""
    cab, data = world(64)
    belief = Belief(mass_off=OFF, mass_std=0.2, inertia_std=0.2, force_references=())
    vehicle = believed_vehicle(data, belief, seed=64)
    sensor = Sensor(name="cell", kind="force", topic="/cell", body="chassis", mount="front_left", noise_std=5.0)
    anchor = ForceReference("load_cell", mount="front_left", sensor="cell", details={"relative_std": 0.01})
    vehicle = dataclasses.replace(vehicle, sensors={**vehicle.sensors, "cell": sensor}, force_references=(anchor,))
    force = data.truth["mount_force"][:, 0]
    cell = force + 150.0 + np.random.default_rng(1).normal(0.0, 0.01 * force[:, 2].std(), force.shape)
    stamps = START_NS + np.round(data.time * 1e9).astype(np.int64)
    samples = sorted([*arrivals(data), *((int(t), "cell", v) for t, v in zip(stamps, cell))], key=lambda s: (s[0], s[1]))
    near(listened(vehicle, samples).parameters()[0], cab.mass)


@pytest.mark.slow
def test_known_mass_added_while_driving():
    """150 kg come on at 14 s, near the CG: the present mass, load included, from the fall of all k/m and c/m."""
    rng = np.random.default_rng(65)
    cab = random_vehicle(rng, "air")
    after = (14.0, cab.mass + 150.0, cab.cg, cab.inertia * (1.0 + 150.0 / cab.mass))
    changed = dataclasses.replace(cab, hidden=dataclasses.replace(cab.hidden, mass_after=after))
    data = measure(drive(changed, Road.random(rng), 32.0, 65, step=1e-3), random_sensors(cab, rng), 250.0, 65, noise_share=0.01)
    added = "{kind: known_added_mass, body: cab, mass_kg: 150, from_s: 14}"
    belief = Belief(mass_off=OFF, mass_std=0.2, inertia_std=0.2, force_references=(added,))
    near(listened(believed_vehicle(data, belief, seed=65), arrivals(data)).parameters()[0], cab.mass + 150.0)


def test_without_a_scale_reference_the_mass_is_not_identifiable():
    _, data = world(63)
    vehicle = believed_vehicle(data, Belief(mass_off=OFF, mass_std=0.2, force_references=()), seed=63)
    mass = listened(vehicle, arrivals(data)).parameters()[0]
    assert mass.status is Status.NOT_IDENTIFIABLE
    assert mass.value == vehicle.bodies["cab"].mass.value


@pytest.mark.parametrize("apart", [0.0, 0.2])
def test_references_that_contradict_each_other_leave_the_mass_as_uncertain_as_they_are_apart(apart: float):
    """Two stiffnesses known to 1 %, found a tenth higher and lower than one mass explains."""
    plain = load_vehicle("truck_cab")
    known = tuple(
        ForceReference("known_stiffness", mount=m, axis="z", details={"relative_std": 0.01})
        for m in ("front_left", "rear_right")
    )  # fmt: skip
    geometry = geometry_of(dataclasses.replace(plain, force_references=known))
    free = find_free_parameters(geometry, PipelineSettings())
    theta = np.zeros(len(free))
    for n, p in enumerate(free):
        if p.role == 0 and p.axis == 2:
            theta[n] = 0.5 * apart * {"front_left": 1.0, "rear_right": -1.0}.get(geometry.mount_names[p.mount], 0.0)
    mass = MassReference(geometry, free)
    mass.update(theta, np.full(len(free), 1e-4), np.zeros((4, 3)), 0.0, 100.0)
    factor, std = mass.factor()
    assert factor == pytest.approx(1.0, abs=1e-3)
    assert std == pytest.approx(np.hypot(0.01 / np.sqrt(2.0), 0.5 * apart), rel=0.1)
