# Copyright 2026 ride_estimation contributors
"""A part of the body that moves on its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import final

import numpy as np

from ride_estimation.diagnosis.baseline import body_spectra
from ride_estimation.diagnosis.body_wrench import wrench_column
from ride_estimation.diagnosis.effect import Column, Shape
from ride_estimation.diagnosis.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes, Sign
from ride_estimation.diagnosis.operators import resonant
from ride_estimation.diagnosis.scene import Scene
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.frames import AXES
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle


@final
class MissingDegreeOfFreedom(Cause):
    """A sprung seat with its driver, liquid, a hanging aggregate."""

    ID = "missing_degree_of_freedom"
    QUESTION = "Does a mass on the body move on a spring of its own?"
    NEEDS = "excitation around its natural frequency"
    RIVALS = ("viscoelasticity", "flexible_mode", "harmonic_disturbance")
    WOULD_REFUTE = "no resonance left when the suspect (seat, tank) is blocked or removed"
    MEASURE_NEXT = "an accelerometer on the suspected mass"

    def hypotheses(self, scene: Scene) -> Sequence[Hypothesis]:
        """Return one hypothesis per body and direction."""
        grid = tuple(
            {"frequency": float(f), "damping": z} for f in np.geomspace(0.9, 16.0, 9) for z in (0.07, 0.25)
        )
        bounds = (Shape("frequency", 4.0, 0.5, 25.0), Shape("damping", 0.15, 0.02, 0.8))
        out: list[Hypothesis] = []
        for body in dict.fromkeys(b for b, _ in scene.plant.coordinates):
            free = [c for b, c in scene.plant.coordinates if b == body]
            for axis in (a for a in AXES if a in free):

                def columns(scene: Scene, shape: Shapes, b: str = body, a: str = axis) -> list[Column]:
                    return _columns(scene, b, AXES.index(a), float(shape["frequency"]), float(shape["damping"]))

                signs = (Sign.POSITIVE, Sign.ANY, Sign.ANY)
                out.append(Hypothesis(self.ID, body, axis, columns, grid, bounds, signs, essential=(0,)))
        return out

    def parameters(self, scene: Scene, fitted: Fitted) -> tuple[Reported, ...]:
        """Return mass [kg], natural frequency [Hz] and damping ratio."""
        f, z = float(fitted.shape["frequency"]), float(fitted.shape["damping"])
        return (
            Reported("moving mass", float(fitted.coefficients[0]), fitted.std(0), "kg"),
            Reported("natural frequency", f, 0.1 * f, "Hz"),
            Reported("damping ratio", z, 0.3 * z, "-"),
        )

    def extend(self, vehicle: Vehicle, scene: Scene, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Add the mass as a body on a mount of its own."""
        return add_sprung_mass(vehicle, fitted)


def _columns(scene: Scene, body: str, axis: int, frequency_hz: float, ratio: float) -> list[Column]:
    """Return the reaction of a unit sprung mass at the CG and its two lever arms across the axis."""
    _, a = body_spectra(scene, body)
    response = scene.grid.signal(resonant(scene.grid.omega, a, frequency_hz, ratio))
    along = np.eye(3)[axis]
    zero = np.zeros((scene.grid.samples, 3))
    linear = response[:, axis]
    out = [wrench_column(scene, body, -linear[:, None] * along, zero)]
    for other in (i for i in range(3) if i != axis):
        arm = np.eye(3)[other]
        lift = np.cross(response[:, 3:], arm) @ along
        moment = -linear[:, None] * np.cross(arm, along)
        out.append(wrench_column(scene, body, -lift[:, None] * along, moment))
    return [column for column in out if column]


def add_sprung_mass(vehicle: Vehicle, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
    """Return the vehicle with a one-coordinate body on a spring at the place the fit found."""
    h = fitted.hypothesis
    mass = max(float(fitted.coefficients[0]), 1e-3)
    arms = np.zeros(3)
    others = [i for i in range(3) if AXES[i] != h.axis]
    values = fitted.coefficients[1:3]
    arms[others[: len(values)]] = values / mass
    carrier = vehicle.bodies[h.location]
    place = np.asarray(carrier.cg) + np.clip(arms, -3.0, 3.0)
    w0 = 2.0 * np.pi * float(fitted.shape["frequency"])
    name = f"{h.location}_sprung_mass"
    body = Body(name, Prior(mass, std=fitted.std(0)), place, 1e-3 * mass * np.eye(3), coordinates=(h.axis,))
    spring = KelvinVoigt(stiffness=mass * w0**2, damping=2.0 * float(fitted.shape["damping"]) * w0 * mass)
    mount = Mount(f"{name}_spring", place, name, h.location, {h.axis: spring})
    extended = dataclasses.replace(
        vehicle, bodies={**vehicle.bodies, name: body}, mounts={**vehicle.mounts, mount.name: mount}
    )
    return extended, (f"the sprung mass of {mass:.3g} kg is in addition to the stated mass of {h.location}",)
