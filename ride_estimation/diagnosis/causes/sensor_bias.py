# Copyright 2026 ride_estimation contributors
"""An accelerometer with an offset beyond its tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from ride_estimation.diagnosis.baseline import mean_table
from ride_estimation.diagnosis.effect import Column, Effect, Where
from ride_estimation.diagnosis.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.scene import Scene
from ride_estimation.diagnosis.sensor_column import axis_name
from ride_estimation.diagnosis.sensor_extension import offset_sensor
from ride_estimation.frames import AXES
from ride_estimation.vehicles.vehicle import Vehicle


@final
class SensorBias(Cause):
    """A constant added to one axis of one accelerometer."""

    ID = "sensor_bias"
    QUESTION = "Does one axis of an accelerometer carry an offset that the others do not share?"
    NEEDS = "two or more DC accelerometers on a body, or a body that stands level on average"
    RIVALS = ("sensor_misalignment",)
    WOULD_REFUTE = "moving parts that are turned by the angle the offset would mean"
    MEASURE_NEXT = "turn the sensor over: half the sum of the two readings is the offset"

    def hypotheses(self, scene: Scene) -> Sequence[Hypothesis]:
        """Return one hypothesis per channel that sees gravity."""
        out: list[Hypothesis] = []
        for row, signal in enumerate(mean_table(scene).signals):

            def columns(scene: Scene, shape: Shapes, r: int = row) -> list[Column]:
                return [(Effect(Where.MEAN, r, np.array([1.0])),)]

            out.append(Hypothesis(self.ID, signal.sensor, axis_name(signal.component), columns, shows_in_means=True))
        return out

    def parameters(self, scene: Scene, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the offset [m/s^2]."""
        return (Reported("offset", float(fitted.coefficients[0]), fitted.std(0), "m/s^2"),)

    def extend(self, vehicle: Vehicle, scene: Scene, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write the offset into the correction of the sensor."""
        h = fitted.hypothesis
        return offset_sensor(vehicle, scene, h.location, (AXES.index(h.axis),), float(fitted.coefficients[0]))
