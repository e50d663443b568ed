# Copyright 2026 ride_estimation contributors
"""A part of the body that moves on its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import final

import numpy as np

from ride_estimation.diagnosis.calibration.baseline import body_spectra
from ride_estimation.diagnosis.common.effect import Column, Shape
from ride_estimation.diagnosis.hypotheses.body_wrench import wrench_column
from ride_estimation.diagnosis.hypotheses.hypothesis import FORM, Cause, Fitted, Hypothesis, Reported, Shapes, Sign
from ride_estimation.diagnosis.hypotheses.operators import resonant
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.frames import AXES, COORDINATES
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

_IN_BAND = 2.0  # times the lower edge of the band: below it, a resonance shows on one side only
_LARGEST_SHARE = 0.5  # of the mass of the body: what most of it hangs on is no part of the body but its mount


@final
class MissingDegreeOfFreedom(Cause):
    """A sprung seat with its driver, liquid, a hanging aggregate."""

    ID = "missing_degree_of_freedom"
    QUESTION = "Does a mass on the body move on a spring of its own?"
    NEEDS = "excitation around its natural frequency"
    RIVALS = ("viscoelasticity", "flexible_mode", "harmonic_disturbance")
    WOULD_REFUTE = "no resonance left when the suspect (seat, tank) is blocked or removed"
    MEASURE_NEXT = "an accelerometer on the suspected mass"

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per body and direction; the mass may be part of the stated one or come on top of it."""
        grid = tuple(
            {"frequency": float(f), "damping": z, "included": i}
            for i in (1.0, 0.0) for f in np.geomspace(0.9, 16.0, 9) for z in (0.07, 0.25)
        )
        lowest = _IN_BAND * view.settings.band_hz[0]
        bounds = (Shape("frequency", 4.0, lowest, 25.0), Shape("damping", 0.15, 0.02, 0.8))
        out: list[Hypothesis] = []
        for body in dict.fromkeys(b for b, _ in view.plant.coordinates):
            free = [c for b, c in view.plant.coordinates if b == body]
            for axis in (a for a in AXES if a in free):

                def columns(view: RunView, shape: Shapes, b: str = body, a: str = axis) -> list[Column]:
                    return _columns(view, b, AXES.index(a), shape)

                signs = (Sign.POSITIVE, Sign.ANY, Sign.ANY, Sign.POSITIVE, Sign.POSITIVE, Sign.ANY)
                largest = _LARGEST_SHARE * view.plant.vehicle.bodies[body].mass.value
                out.append(Hypothesis(
                    self.ID, body, axis, columns, grid, bounds, signs, essential=(0,), largest=largest, inner=("frequency",)
                ))
        return out

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return mass [kg], natural frequency [Hz] and damping ratio."""
        f, z = float(fitted.shape["frequency"]), float(fitted.shape["damping"])
        return (
            Reported("moving mass", float(fitted.coefficients[0]), fitted.std(0), "kg"),
            # a force of another form in quadrature shifts the frequency by as much of the width of the resonance
            Reported("natural frequency", f, fitted.spread("frequency", FORM**0.5 * z * f), "Hz"),
            Reported("damping ratio", z, fitted.spread("damping", FORM**0.5 * z), "-"),
        )

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Add the mass as a body on a mount of its own."""
        return add_sprung_mass(vehicle, fitted)


def _columns(view: RunView, body: str, axis: int, shape: Shapes) -> list[Column]:
    """Return the reaction of a unit sprung mass at the CG, its two lever arms across the axis and their products."""
    _, a = body_spectra(view, body)
    own = resonant(view.grid.omega, a, float(shape["frequency"]), float(shape["damping"]))
    response = view.grid.signal(own - float(shape["included"]) * a)
    along = np.eye(3)[axis]
    zero = np.zeros((view.grid.samples, 3))
    linear = response[:, axis]
    out = [wrench_column(view, body, -linear[:, None] * along, zero)]
    others = [i for i in range(3) if i != axis]
    lifts = {i: np.cross(response[:, 3:], np.eye(3)[i]) @ along for i in others}
    turns = {i: np.cross(np.eye(3)[i], along) for i in others}
    for i in others:
        out.append(wrench_column(view, body, -lifts[i][:, None] * along, -linear[:, None] * turns[i]))
    for i, j in ((others[0], others[0]), (others[1], others[1]), (others[0], others[1])):
        moment = lifts[i][:, None] * turns[j]
        if i != j:
            moment = moment + lifts[j][:, None] * turns[i]
        out.append(wrench_column(view, body, zero, -moment))
    return [column for column in out if column]


def add_sprung_mass(vehicle: Vehicle, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
    """Return the vehicle with a one-coordinate body on a spring at the place the fit found."""
    h = fitted.hypothesis
    carrier = vehicle.bodies[h.location]
    included = fitted.shape["included"] > 0.0
    mass = max(float(fitted.coefficients[0]), 1e-3)
    if included:
        mass = min(mass, 0.9 * carrier.mass.value)
    arms = np.zeros(3)
    axis = AXES.index(h.axis)
    # a lever arm along one axis turns the body about the third
    felt = [i for i in range(3) if i != axis and COORDINATES[6 - i - axis] in carrier.coordinates]
    arms[felt] = np.clip(fitted.coefficients[1 : 1 + len(felt)] / mass, -3.0, 3.0)
    place = np.asarray(carrier.cg) + arms
    w0 = 2.0 * np.pi * float(fitted.shape["frequency"])
    name = f"{h.location}_sprung_mass"
    body = Body(name, Prior(mass, std=fitted.std(0)), place, 1e-3 * mass * np.eye(3), coordinates=(h.axis,))
    spring = KelvinVoigt(stiffness=mass * w0**2, damping=2.0 * float(fitted.shape["damping"]) * w0 * mass)
    mount = Mount(f"{name}_spring", place, name, h.location, {h.axis: spring})
    bodies = {**vehicle.bodies, name: body}
    remark = f"the sprung mass of {mass:.3g} kg is in addition to the stated mass of {h.location}"
    if included:
        rest = carrier.mass.value - mass
        bodies[h.location] = dataclasses.replace(
            carrier, mass=dataclasses.replace(carrier.mass, value=rest), cg=np.asarray(carrier.cg) - mass / rest * arms
        )
        remark = (
            f"the sprung mass of {mass:.3g} kg is part of the stated mass of {h.location}, which keeps the rest; its inertia is "
            "left as it was"
        )
    return dataclasses.replace(vehicle, bodies=bodies, mounts={**vehicle.mounts, mount.name: mount}), (remark,)
