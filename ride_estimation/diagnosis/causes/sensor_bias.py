# Copyright 2026 ride_estimation contributors
"""An accelerometer or a transducer with an offset beyond its tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from ride_estimation.diagnosis.calibration.baseline import mean_table
from ride_estimation.diagnosis.common.effect import Column, Effect, Where
from ride_estimation.diagnosis.hypotheses.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.hypotheses.sensor_column import axis_name, is_accelerometer
from ride_estimation.diagnosis.hypotheses.sensor_extension import offset_sensor
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.frames import AXES
from ride_estimation.vehicles.vehicle import Vehicle


@final
class SensorBias(Cause):
    """A constant added to one axis of one accelerometer or to a transducer."""

    ID = "sensor_bias"
    QUESTION = "Does one axis of an accelerometer carry an offset that the others do not share?"
    NEEDS = "two or more DC accelerometers on a body, or a body that stands level on average"
    RIVALS = ("sensor_misalignment", "mass_change")
    WOULD_REFUTE = "moving parts that are tilted by the angle the offset would mean"
    MEASURE_NEXT = "turn the sensor over: half the sum of the two readings is the offset"

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per channel whose mean reading is known: gravity, or a mount at rest."""
        out: list[Hypothesis] = []
        for row, signal in enumerate(mean_table(view).signals):

            def columns(view: RunView, shape: Shapes, r: int = row) -> list[Column]:
                return [(Effect(Where.MEAN, r, np.array([1.0])),)]

            # one transducer alone cannot tell its zero from a load, and loads change more often
            complexity = 1.0 if signal.kind == "displacement" else 0.0
            axis = axis_name(signal.component)
            out.append(Hypothesis(self.ID, signal.sensor, axis, columns, complexity=complexity, shows_in_means=True))
        return out

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the offset [m/s^2], of a transducer [m]."""
        unit = "m/s^2" if is_accelerometer(view, fitted.hypothesis.location) else "m"
        return (Reported("offset", float(fitted.coefficients[0]), fitted.std(0), unit),)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write the offset into the correction of the sensor."""
        h = fitted.hypothesis
        return offset_sensor(vehicle, view, h.location, (AXES.index(h.axis),), float(fitted.coefficients[0]))
