# Copyright 2026 ride_estimation contributors
"""Every kind of force element works where elements are used: vehicle file, simulation, online estimator, diagnosis."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from diagnosis_runs import quarter_car

from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.model.response import respond
from ride_estimation.elements import terms as kernel
from ride_estimation.elements.base import Array, ForceElement
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.registry import kinds
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.estimation.forces.mount_law import scaled
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.vehicle_file import load_vehicle, save_vehicle
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.simulation.response import Response
from ride_estimation.simulation.simulate import simulate
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.vehicle import Prior, Vehicle

KINDS = sorted(kinds())
RATE = 500.0


def element_of(kind: str) -> ForceElement:
    """Return the example of a kind beside the spring and damper that carry the body."""
    return SumOfElements((KelvinVoigt(40e3, 2.5e3), kinds()[kind].example()))


@functools.cache
def vehicle_with(kind: str) -> Vehicle:
    plain = quarter_car()
    mass = dataclasses.replace(plain.bodies["body_mass"], mass=Prior(400.0, 4.0))
    return dataclasses.replace(plain, bodies={"body_mass": mass}).replace_elements({("strut", "z"): element_of(kind)})


@functools.cache
def ride(kind: str) -> Response:
    """Return 1.2 s over a hump of 18 mm and small waves: friction turns, softening springs do not buckle."""
    t = np.arange(600) / RATE
    height = 0.018 * np.exp(-(((t - 0.4) / 0.12) ** 2)) + 0.003 * np.sin(2 * np.pi * 6.0 * t) * np.clip(4 * (t - 0.7), 0, 1)
    base = np.zeros((t.size, 1, 3))
    base[:, 0, 2] = height
    return simulate(assemble(vehicle_with(kind)), BaseMotion.from_displacement(base, RATE), substeps=8)


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("kind", KINDS)
def test_sits_in_a_vehicle_file(kind, tmp_path):
    # in a sum and alone
    vehicle = vehicle_with(kind)
    for element in (element_of(kind), kinds()[kind].example()):
        save_vehicle(vehicle.replace_elements({("strut", "z"): element}), tmp_path / "vehicle.yaml")
        assert load_vehicle(tmp_path / "vehicle.yaml").mounts["strut"].elements["z"] == element


@pytest.mark.parametrize("kind", KINDS)
def test_runs_in_the_vehicle_simulation(kind):
    response = ride(kind)
    x, v, tension = (getattr(response, n)[:, 0] for n in ("deflection", "rate", "tension"))
    assert np.all(np.isfinite(tension))
    assert np.max(np.abs(x)) > 0.001
    # the element alone on the motion of the simulation gives its force; eight steps per sample against one: 2 % covers the
    # strokes cut off between samples
    codes, params = kernel.pack_terms(element_of(kind).terms())
    alone = kernel.response(codes, params, x, v, 1.0 / RATE)
    assert rms(alone - tension) < 0.02 * rms(tension)
    # and the body obeys Newton: mass times acceleration is minus the tension
    np.testing.assert_allclose(400.0 * response.accelerations[:, 0], -tension, atol=1e-6 * rms(tension))


@pytest.mark.parametrize("kind", KINDS)
def test_runs_in_the_online_estimator(kind):
    response = ride(kind)
    pipeline = Pipeline(vehicle_with(kind))
    body = response.specific_force("body")
    base = np.zeros_like(body)
    base[:, 2] = response.base_motion.acceleration[:, 0, 2] + 9.80665
    blocks = []
    for k in range(0, body.shape[0], 2):
        stamp = round(k * 1e9 / RATE)
        for name, values in (("body", body), ("base", base)):
            blocks += pipeline.observe(name, stamp, values[k].tolist())
    blocks += pipeline.finish()
    force = np.concatenate([b.mount_force[:, 0, 2] for b in blocks])
    std = np.concatenate([b.mount_force_std[:, 0, 2] for b in blocks])
    assert force.size > 200
    assert np.all(np.isfinite(force)) and np.all(std > 0.0)
    # with the mass known the force follows from the acceleration whatever the element: static share and 10 % of the rest
    stamps = np.concatenate([b.stamp_ns for b in blocks])
    true = 400.0 * 9.80665 - np.interp(stamps * 1e-9, response.time_s, response.tension[:, 0])
    late = slice(50, None)
    assert rms((force - true)[late]) < 0.1 * rms(true[late])
    for estimate in pipeline.parameters():
        assert np.isfinite(estimate.value)


@pytest.mark.parametrize("kind", KINDS)
def test_multipliers_of_the_estimator_reach_every_number_of_the_element(kind):
    element = element_of(kind)
    twice = scaled(element, 2.0, 3.0)
    for address, (p, value) in element.addressed().items():
        factor = {"stiffness": 2.0, "damping": 3.0}.get(p.role, 1.0)
        assert twice.addressed()[address][1] == pytest.approx(min(max(factor * value, p.lower), p.upper))


@pytest.mark.parametrize("kind", KINDS)
def test_is_part_of_the_plant_of_the_diagnosis(kind):
    plant = build_plant(vehicle_with(kind), {"body": 3, "base": 3})
    port = plant.ports[0]
    # the plain spring and damper are what is calibrated; the rest of the element is kept
    own = kinds()[kind].example() if kind == "kelvin_voigt" else KelvinVoigt(0.0, 0.0)
    assert (port.stiffness, port.damping) == (40e3 + own.stiffness, 2.5e3 + own.damping)
    omega = 2 * np.pi * np.array([0.5, 2.0, 10.0])
    found = respond(plant, np.array([port.stiffness]), np.array([port.damping]), omega)
    assert np.all(np.isfinite(found.output_from_input))
