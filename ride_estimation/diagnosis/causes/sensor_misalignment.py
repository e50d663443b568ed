# Copyright 2026 ride_estimation contributors
"""A sensor that is turned against what the vehicle file says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from ride_estimation.diagnosis.effect import Column
from ride_estimation.diagnosis.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.scene import Scene
from ride_estimation.diagnosis.sensor_column import axis_name, is_accelerometer, sensor_column
from ride_estimation.diagnosis.sensor_extension import turn_sensor
from ride_estimation.vehicles.vehicle import Vehicle


@final
class SensorMisalignment(Cause):
    """One sensor turned about one of its axes."""

    ID = "sensor_misalignment"
    QUESTION = "Is a sensor turned against the vehicle file?"
    NEEDS = "motion along two axes of the sensor, or gravity in its signal"
    RIVALS = ("sensor_bias", "sensor_gain", "wrong_sensor_position")
    WOULD_REFUTE = "a mean reading that does not lean while the moving part does"
    MEASURE_NEXT = "measure the angle of the sensor housing against the body with a level"

    def hypotheses(self, scene: Scene) -> Sequence[Hypothesis]:
        """Return one hypothesis per sensor and axis of rotation."""
        out: list[Hypothesis] = []
        for sensor in scene.plant.sensors:
            if not is_accelerometer(scene, sensor):
                continue
            for component in range(3):

                def columns(scene: Scene, shape: Shapes, s: str = sensor, c: int = component) -> list[Column]:
                    column = sensor_column(scene, s, "misalignment", c)
                    return [column] if column else []

                out.append(Hypothesis(self.ID, sensor, axis_name(component, rotation=True), columns))
        return out

    def parameters(self, scene: Scene, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the angle [deg]."""
        value, std = np.degrees(float(fitted.coefficients[0])), np.degrees(fitted.std(0))
        return (Reported("angle", float(value), float(std), "deg"),)

    def extend(self, vehicle: Vehicle, scene: Scene, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write the found rotation of the sensor."""
        return turn_sensor(vehicle, fitted)
