# Copyright 2026 ride_estimation contributors
"""A sensor that is not where the vehicle file says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from ride_estimation.diagnosis.common.effect import Column
from ride_estimation.diagnosis.hypotheses.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.hypotheses.sensor_column import axis_name, fault_std, is_accelerometer, is_input, sensor_column
from ride_estimation.diagnosis.hypotheses.sensor_extension import move_sensor
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.vehicles.vehicle import Vehicle


@final
class WrongSensorPosition(Cause):
    """A sensor on the sprung body shifted along one axis."""

    ID = "wrong_sensor_position"
    QUESTION = "Is a sensor not where the vehicle file says?"
    NEEDS = "angular motion of the body and more channels than its motion needs"
    RIVALS = ("sensor_gain", "sensor_misalignment", "flexible_mode", "cg_offset")
    WOULD_REFUTE = "an error that does not follow the angular acceleration"
    MEASURE_NEXT = "measure the sensor position with a tape"

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per sensor of a sprung body and axis."""
        out: list[Hypothesis] = []
        for sensor in view.plant.sensors:
            if not is_accelerometer(view, sensor) or is_input(view, sensor):
                continue
            for component in range(3):

                def columns(view: RunView, shape: Shapes, s: str = sensor, c: int = component) -> list[Column]:
                    column = sensor_column(view, s, "position", c)
                    return [column] if column and any(np.any(e.signal) for e in column) else []

                out.append(Hypothesis(self.ID, sensor, axis_name(component), columns))
        return out

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return true minus stated position [m]."""
        std = fault_std(view, fitted.hypothesis.location, "position", fitted.std(0))
        return (Reported("position error", float(fitted.coefficients[0]), std, "m"),)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write the found position of the sensor."""
        return move_sensor(vehicle, fitted)
