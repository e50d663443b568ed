# Copyright 2026 ride_estimation contributors
"""Damping filter embedded in the solver and coupled from outside (document 000, row 0-12)."""

import numpy as np
import pytest

from ride_estimation.elements.damping_filter import DampingFilter
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.simulation.co_simulation import ElementStepper
from ride_estimation.simulation.simulate import simulate
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

MASS, STIFFNESS, RATE = 300.0, 47_000.0, 1000.0
BAND = DampingFilter(gain=2700.0, centre=12.6, quality=0.5)
TIME = np.arange(0, 6.0, 1 / RATE)
LINES = ((0.01, 2 * np.pi * 1.3, 0.0), (0.004, 2 * np.pi * 5.1, 0.4))


def base(t):
    """Displacement and velocity of the base: a smooth start into two sines."""
    ramp, slope = 1 - np.exp(-t * t), 2 * t * np.exp(-t * t)
    wave = sum(a * np.sin(w * t + p) for a, w, p in LINES)
    speed = sum(a * w * np.cos(w * t + p) for a, w, p in LINES)
    return ramp * wave, ramp * speed + slope * wave


BASE = base(TIME)[0]


def embedded():
    body = Body("body", Prior(MASS), np.zeros(3), np.eye(3), coordinates=("z",))
    law = SumOfElements((KelvinVoigt(STIFFNESS, 0.0), BAND))
    vehicle = Vehicle("one", {"body": body}, {"m": Mount("m", np.zeros(3), "body", "base", {"z": law})}, {}, gravity=0.0)
    displacement = np.zeros((TIME.size, 1, 3))
    displacement[:, 0, 2] = BASE
    return simulate(assemble(vehicle), BaseMotion.from_displacement(displacement, RATE), substeps=8)


def coupled(every):
    """Velocity Verlet of this test on a fine grid, damping force held between communication steps."""
    stepper = ElementStepper(BAND, every / RATE)
    fine = 4
    h = 1 / RATE / fine
    u, du = base(np.arange(TIME.size * fine + 1) * h)
    x = v = force = dissipated = 0.0
    out = np.zeros(TIME.size)
    for i in range(TIME.size * fine):
        if i % (every * fine) == 0:
            force = stepper.step(x - u[i], v - du[i])
        if i % fine == 0:
            out[i // fine] = x
        dissipated += force * (v - du[i]) * h
        half = v + 0.5 * h * (-STIFFNESS * (x - u[i]) - force) / MASS
        x += h * half
        v = half + 0.5 * h * (-STIFFNESS * (x - u[i + 1]) - force) / MASS
    return out, dissipated


def test_coupled_and_embedded_agree_as_the_communication_step_shrinks():
    reference = embedded().coordinates[:, 0]
    errors = []
    for every in (8, 4, 2, 1):
        errors.append(np.std(coupled(every)[0] - reference) / np.std(reference))
    assert errors[-1] < 0.02
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(ratios > 1.6)  # first order in the communication step: 2, less the error of the test's own solver


def test_the_band_filter_takes_energy_out():
    assert coupled(1)[1] > 0.0


def test_bad_steps_and_motion_are_refused():
    with pytest.raises(ConfigurationError):
        ElementStepper(BAND, 0.0)
    stepper = ElementStepper(BAND, 1e-3)
    before = stepper.step(1e-3, 0.1)
    with pytest.raises(InputDataError):
        stepper.step(float("nan"), 0.0)
    other = ElementStepper(BAND, 1e-3)
    other.step(1e-3, 0.1)
    assert np.isfinite(before)
    assert stepper.step(2e-3, 0.2) == other.step(2e-3, 0.2)
