# Copyright 2026 ride_estimation contributors
"""A centre of gravity that is not where the vehicle file says."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import final

import numpy as np

from ride_estimation.diagnosis.calibration.baseline import cg_means, mean_table
from ride_estimation.diagnosis.common.effect import Column, Effect, Where
from ride_estimation.diagnosis.common.extension import move_cg
from ride_estimation.diagnosis.hypotheses.body_wrench import cg_column
from ride_estimation.diagnosis.hypotheses.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.runs.run_view import RunView
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

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per body and axis."""
        out: list[Hypothesis] = []
        bodies = dict.fromkeys(b for b, c in view.plant.coordinates if c in ("roll", "pitch", "yaw"))
        for body in bodies:
            for axis in AXES:

                def columns(view: RunView, shape: Shapes, b: str = body, axis: str = axis) -> list[Column]:
                    column, table = cg_column(view, b, axis), mean_table(view)
                    means = cg_means(view, table, b, AXES.index(axis))
                    return [(*column, *(Effect(Where.MEAN, r, np.array([v])) for r, v in means.items()))] if column else []

                out.append(Hypothesis(self.ID, body, axis, columns, places_cg=True))
        return out

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return true minus stated CG position [m]; a part of it is what the CG of a right file is off, too."""
        h = fitted.hypothesis
        tolerance = view.settings.tolerances.of_cg(view.plant.vehicle.bodies[h.location])[AXES.index(h.axis)]
        std = math.hypot(fitted.std(0), tolerance)
        return (Reported("CG offset", float(fitted.coefficients[0]), std, "m"),)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write the found CG."""
        h = fitted.hypothesis
        shift = float(fitted.coefficients[0]) * np.eye(3)[AXES.index(h.axis)]
        return move_cg(vehicle, h.location, shift), ()

