# Copyright 2026 ride_estimation contributors
"""A sensor that is turned against what the vehicle file says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.baseline import mean_table, sensor_error_means
from ride_estimation.diagnosis.common.effect import Column, Shape
from ride_estimation.diagnosis.hypotheses.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.hypotheses.sensor_column import axis_name, fault_std, is_accelerometer, sensor_axes, turned_column
from ride_estimation.diagnosis.hypotheses.sensor_extension import turn_sensor
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.frames import AXES, rotation_matrices
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

_LARGEST = 0.8  # reference of the search; what is turned further is mounted on another side [rad]
#: references of the screening: a rotation that is no small one shortens the axes it turns [rad]
_STARTS = (1e-3, 0.2, -0.2)


@final
class SensorMisalignment(Cause):
    """One sensor turned about one of its axes; accelerations and angular rates of an IMU turn together."""

    ID = "sensor_misalignment"
    QUESTION = "Is the orientation of a sensor different from the vehicle file?"
    NEEDS = "motion along two axes of the sensor, or gravity in its signal"
    RIVALS = ("sensor_bias", "sensor_gain", "wrong_sensor_position")
    WOULD_REFUTE = "a mean reading that does not lean while the moving part does"
    MEASURE_NEXT = "measure the angle of the sensor housing against the body with a level"

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per sensor and axis of rotation; one that can only shorten a reading is a gain."""
        out: list[Hypothesis] = []
        table = mean_table(view)
        for sensor in view.plant.sensors:
            if not is_accelerometer(view, sensor):
                continue
            axes = sensor_axes(view, sensor)
            for component in range(3):
                if not (_mixes(axes, component) or sensor_error_means(table, sensor, "misalignment", component)):
                    continue

                def columns(view: RunView, shape: Shapes, s: str = sensor, c: int = component) -> list[Column]:
                    column = turned_column(view, s, c, float(shape["angle"]))
                    return [column] if column else []

                # the coefficient is the angle; the reference only says at which angle its column is exact and costs nothing
                grid = tuple({"angle": a} for a in _STARTS)
                shapes = (Shape("angle", 0.0, -_LARGEST, _LARGEST, step=0.1),)
                def fault(coefficients: Array, c: int = component) -> Array:
                    turn = rotation_matrices(float(coefficients[0]) * np.eye(3)[c][None])[0]
                    return np.kron(np.eye(2), turn.T)

                axis = axis_name(component, rotation=True)
                out.append(Hypothesis(self.ID, sensor, axis, columns, grid, shapes, complexity=-1.0, fault=fault))
        return out

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the angle [deg]."""
        std = fault_std(view, fitted.hypothesis.location, "misalignment", fitted.std(0))
        return (Reported("angle", float(np.degrees(fitted.coefficients[0])), float(np.degrees(std)), "deg"),)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write the found rotation of the sensor."""
        return turn_sensor(vehicle, fitted)


def _mixes(measured: tuple[int, ...], component: int) -> bool:
    """Return whether a sensor measures both axes, of acceleration or of angular rate, that a rotation mixes."""
    first, second = ((component + i) % 3 for i in (1, 2))
    return any({first + k, second + k} <= set(measured) for k in (0, len(AXES)))
