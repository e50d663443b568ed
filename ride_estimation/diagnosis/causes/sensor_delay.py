# Copyright 2026 ride_estimation contributors
"""A sensor whose stamps are late or early."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from ride_estimation.diagnosis.common.effect import Column, Effect, Shape, Where
from ride_estimation.diagnosis.hypotheses.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.hypotheses.sensor_column import fault_std, sensor_column
from ride_estimation.diagnosis.hypotheses.sensor_extension import delay_sensors
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.vehicles.vehicle import Vehicle

_LONGEST = 0.06  # reference of the search [s]
#: references of the screening: a delay that is long against a period is no derivative [s]
_STARTS = (1e-4, 4e-3, 0.015, 0.035, -0.015)


@final
class SensorDelay(Cause):
    """One sensor, or all sensors of a body, late by a constant time."""

    ID = "sensor_delay"
    QUESTION = "Is a sensor late or early by a constant time?"
    NEEDS = "motion above about 2 Hz"
    RIVALS = ("viscoelasticity", "sensor_gain", "wrong_sensor_position")
    WOULD_REFUTE = "a phase error that does not grow in proportion to frequency"
    MEASURE_NEXT = "tap the frame beside both sensors and compare the stamps of the first sample"

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per sensor, and one for all accelerometers of the measured bodies together."""
        outputs = tuple(dict.fromkeys(s.sensor for s in view.plant.outputs))
        groups = [(s,) for s in view.plant.sensors] + ([outputs] if len(outputs) > 1 else [])
        out: list[Hypothesis] = []
        for group in groups:

            def columns(view: RunView, shape: Shapes, g: tuple[str, ...] = group) -> list[Column]:
                return [tuple(e for s in g for e in _delayed(view, s, float(shape["delay"])))]

            location = group[0] if len(group) == 1 else "all"
            grid = tuple({"delay": d} for d in _STARTS)
            # the coefficient is the delay; the reference only says at which delay its column is exact and costs nothing
            shapes = (Shape("delay", 4e-3, -_LONGEST, _LONGEST, step=2e-3),)
            out.append(Hypothesis(self.ID, location, "", columns, grid, shapes, complexity=-1.0))
        return out

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return how late the sensor is [s]."""
        location = fitted.hypothesis.location
        std = fitted.std(0) if location == "all" else fault_std(view, location, "delay", fitted.std(0))
        return (Reported("delay", float(fitted.coefficients[0]), std, "s"),)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write the delay into the correction of the sensors."""
        location = fitted.hypothesis.location
        outputs = tuple(dict.fromkeys(s.sensor for s in view.plant.outputs))
        return delay_sensors(vehicle, outputs if location == "all" else (location,), float(fitted.coefficients[0]))


def _delayed(view: RunView, sensor: str, reference: float) -> Column:
    """Return the change of a reading per second of delay, exact at a reference delay [s]."""
    iw = 1j * view.grid.omega
    factor = -np.expm1(-iw * reference) / (iw * reference) if abs(reference) > 1e-7 else np.ones_like(iw)
    out = []
    for effect in sensor_column(view, sensor, "delay", 0):
        if effect.where is not Where.MEAN:
            signal = view.grid.signal(factor * view.grid.spectrum(effect.signal))
            out.append(Effect(effect.where, effect.index, signal))
    return tuple(out)
