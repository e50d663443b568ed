# Copyright 2026 ride_estimation contributors
"""A mass that changes during the run."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import final

import numpy as np

from ride_estimation.diagnosis.body_wrench import six_of, wrench_column
from ride_estimation.diagnosis.effect import Column, Shape
from ride_estimation.diagnosis.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.operators import step_window
from ride_estimation.diagnosis.scene import Scene
from ride_estimation.vehicles.vehicle import Vehicle

_UP = np.array([0.0, 0.0, 1.0])
#: instants on the grid, and distance of two of them over which more are tried around the best
_INSTANTS, _NEIGHBOURS = 20, 1.5


@final
class MassChange(Cause):
    """Payload taken on or off during the run."""

    ID = "mass_change"
    QUESTION = "Does the mass of a body change at some moment of the run?"
    NEEDS = "excitation before and after the change"
    RIVALS = ("parameter_drift", "cg_offset")
    WOULD_REFUTE = "a damping over stiffness ratio that changes at the same moment"
    MEASURE_NEXT = "log payload or air-spring pressure; mark loading in the recording"

    def hypotheses(self, scene: Scene) -> Sequence[Hypothesis]:
        """Return one hypothesis per body, the instant on a grid between the middles of the first and the last block."""
        first, last = (float(t) for t in scene.blocks.time_s[[0, -1]])
        grid = tuple({"at": float(t)} for t in np.linspace(first, last, _INSTANTS))
        # how the body bounces after a sudden load tells the instant to a twentieth of a second, and only there
        apart = (last - first) / (_INSTANTS - 1)
        bounds = (Shape("at", 0.5 * (first + last), first, last, 0.2 * apart, _NEIGHBOURS * apart),)
        out: list[Hypothesis] = []
        for body in dict.fromkeys(b for b, _ in scene.plant.coordinates):

            def columns(scene: Scene, shape: Shapes, b: str = body) -> list[Column]:
                return _columns(scene, b, float(shape["at"]))

            out.append(Hypothesis(self.ID, body, "", columns, grid, bounds))
        return out

    def parameters(self, scene: Scene, fitted: Fitted) -> tuple[Reported, ...]:
        """Return added mass [kg] and the instant [s]."""
        return (
            Reported("added mass", float(fitted.coefficients[0]), fitted.std(0), "kg"),
            Reported("instant", float(fitted.shape["at"]), 0.02 * float(scene.time_s[-1]), "s"),
        )

    def extend(self, vehicle: Vehicle, scene: Scene, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write mass and CG after the change."""
        name = fitted.hypothesis.location
        body = vehicle.bodies[name]
        added = float(fitted.coefficients[0])
        mass = body.mass.value + added
        moments = np.zeros(3)
        used = [i for i in range(3) if len(fitted.coefficients) > 1 + i]
        moments[used] = fitted.coefficients[1 : 1 + len(used)]
        changed = dataclasses.replace(
            body, mass=dataclasses.replace(body.mass, value=mass), cg=np.asarray(body.cg) + moments / mass
        )
        return dataclasses.replace(vehicle, bodies={**vehicle.bodies, name: changed}), (
            "mass and CG are those after the change; the inertia is left as it was",
        )


def _columns(scene: Scene, body: str, at_s: float) -> list[Column]:
    """Return added mass, its three first moments and three inertias, each from an instant on."""
    window = step_window(scene.time_s, at_s)[:, None]
    gravity = scene.plant.vehicle.gravity
    q, a = six_of(scene, body)
    zero = np.zeros_like(a[:, :3])
    load = a[:, :3] + gravity * _UP
    out = [wrench_column(scene, body, -window * load, zero)]
    for i in range(3):
        arm = np.eye(3)[i]
        force = -np.cross(a[:, 3:], arm)
        moment = -np.cross(arm, load) - gravity * np.cross(np.cross(q[:, 3:], arm), _UP)
        out.append(wrench_column(scene, body, window * force, window * moment))
    for i in range(3):
        moment = zero.copy()
        moment[:, i] = -a[:, 3 + i]
        out.append(wrench_column(scene, body, zero, window * moment))
    return [column for column in out if column]
