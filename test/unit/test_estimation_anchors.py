# Copyright 2026 ride_estimation contributors
"""Mass from what anchors forces in absolute terms, through the whole pipeline; the file's mass is 15 % high."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from worlds.adapters import arrivals, believed_vehicle
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.roads import Road
from worlds.vehicle_text import Belief

from ride_estimation.estimation.estimate import Status
from ride_estimation.estimation.pipeline import Pipeline

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


def mass_of(seed, kind, inertia_off):
    """Return the estimate of the mass and the true mass."""
    cab, data = world(seed)
    belief = Belief(mass_off=OFF, mass_std=0.2, inertia_std=0.2, force_references=(reference(cab, kind),))
    vehicle = believed_vehicle(data, belief, seed=seed)
    if kind == "known_stiffness":
        element = vehicle.mounts["front_left"].elements["z"].replace(stiffness=float(cab.stiffness[0, 2]))
        vehicle = vehicle.replace_elements({("front_left", "z"): element})
    body = dataclasses.replace(vehicle.bodies["cab"], inertia=cab.inertia * (1.0 + inertia_off))
    pipeline = Pipeline(dataclasses.replace(vehicle, bodies={"cab": body}))
    for stamp, name, values in arrivals(data):
        pipeline.observe(name, stamp, values.tolist())
    pipeline.finish()
    return pipeline.parameters()[0], cab.mass


@pytest.mark.parametrize("kind", ["known_stiffness", "air_spring_pressure"])
@pytest.mark.parametrize("seed", [63, 64])
def test_mass_and_inertia_off_together_are_found(seed, kind):
    """13 s of road: mass within 3 %."""
    mass, true = mass_of(seed, kind, OFF)
    assert mass.status is Status.VALID
    assert abs(mass.value / true - 1.0) < 0.03


@pytest.mark.parametrize("seed", [63, 64])
def test_a_mass_that_is_off_alone_is_covered_by_the_uncertainty_and_said(seed):
    """The inertia is right: the mass is inside 3 standard deviations, and its reason names the assumption."""
    mass, true = mass_of(seed, "known_stiffness", 0.0)
    assert abs(mass.value - true) < 3.0 * mass.std
    assert "inertia" in mass.reason or abs(mass.value / mass.prior - 1.0) < 0.03
