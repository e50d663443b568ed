# Copyright 2026 ride_estimation contributors
"""A centre of gravity that is not where the vehicle file says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from ride_estimation.diagnosis.body_wrench import six_of, wrench_column
from ride_estimation.diagnosis.effect import Column, Shape
from ride_estimation.diagnosis.extension import move_cg
from ride_estimation.diagnosis.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.scene import Scene
from ride_estimation.frames import AXES
from ride_estimation.vehicles.vehicle import Vehicle


@final
class CgOffset(Cause):
    """The CG lies off its stated place by more than its tolerance."""

    ID = "cg_offset"
    QUESTION = "Is the centre of gravity not where the vehicle file says?"
    NEEDS = "angular motion of the body"
    RIVALS = ("wrong_sensor_position", "one_soft_mount", "mass_change")
    WOULD_REFUTE = "static mount loads (wheel scales, load cells) that fit the stated CG"
    MEASURE_NEXT = "weigh the body at its mounts, level and tilted"

    def hypotheses(self, scene: Scene) -> Sequence[Hypothesis]:
        """Return one hypothesis per body and axis."""
        out: list[Hypothesis] = []
        bodies = dict.fromkeys(b for b, c in scene.plant.coordinates if c in ("roll", "pitch", "yaw"))
        for body in bodies:
            for i, axis in enumerate(AXES):

                def columns(scene: Scene, shape: Shapes, b: str = body, i: int = i) -> list[Column]:
                    return _columns(scene, b, np.eye(3)[i], float(shape["shift"]))

                grid = tuple({"shift": d} for d in (-0.1, -0.02, 0.02, 0.1))
                bounds = (Shape("shift", 0.02, -0.8, 0.8, 0.03),)
                out.append(Hypothesis(self.ID, body, axis, columns, grid, bounds))
        return out

    def parameters(self, scene: Scene, fitted: Fitted) -> tuple[Reported, ...]:
        """Return true minus stated CG position [m]."""
        return (Reported("CG offset", float(fitted.coefficients[0]), fitted.std(0), "m"),)

    def extend(self, vehicle: Vehicle, scene: Scene, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write the found CG."""
        h = fitted.hypothesis
        shift = float(fitted.coefficients[0]) * np.eye(3)[AXES.index(h.axis)]
        return move_cg(vehicle, h.location, shift), ()


def _columns(scene: Scene, body: str, shift: np.ndarray, amount: float) -> list[Column]:
    """Return the pseudo-wrench of a unit shift of the CG; its parallel-axis part is that of the given amount [m]."""
    mass, gravity = scene.plant.vehicle.bodies[body].mass.value, scene.plant.vehicle.gravity
    q, a = six_of(scene, body)
    up = np.array([0.0, 0.0, 1.0])
    force = -mass * np.cross(a[:, 3:], shift)
    moment = -mass * np.cross(shift, a[:, :3]) - mass * gravity * np.cross(np.cross(q[:, 3:], shift), up)
    inertia = mass * (np.eye(3) - np.outer(shift, shift))
    column = wrench_column(scene, body, force, moment - amount * a[:, 3:] @ inertia)
    return [column] if column else []
