# Copyright 2026 ride_estimation contributors
"""A sensor axis that reads too much or too little."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.baseline import MeanTable, mean_table, sensor_error_means
from ride_estimation.diagnosis.common.effect import Column, Where
from ride_estimation.diagnosis.hypotheses.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes
from ride_estimation.diagnosis.hypotheses.sensor_column import (
    axis_name,
    fault_std,
    is_accelerometer,
    is_input,
    sensor_axes,
    sensor_column,
)
from ride_estimation.diagnosis.hypotheses.sensor_extension import scale_sensor
from ride_estimation.diagnosis.model.plant import CHANNELS
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.frames import AXES
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]
_Columns = Callable[[RunView, Shapes], list[Column]]

#: smallest factor of a reading, largest is its inverse: what a wrong sensitivity or amplifier setting makes
_LEAST = 0.05
_UNTRIMMED = "gravity too"
#: of an angular rate, or of all of them
_RATES = "angular rates"


@final
class SensorGain(Cause):
    """One axis of one sensor, or all of its axes, multiplied by a factor."""

    ID = "sensor_gain"
    QUESTION = "Does one sensor axis read the motion multiplied by a factor?"
    NEEDS = "more channels than rigid-body motion needs, or a base motion seen by the model"
    RIVALS = ("sensor_misalignment", "wrong_sensor_position", "sensor_clipping")
    WOULD_REFUTE = "a factor that changes with amplitude (clipping) or with frequency (filter, delay)"
    MEASURE_NEXT = "turn the sensor over: a factor of one shows 2 g between the two positions"

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per axis and one per accelerometer, with and without gravity at rest, and likewise per gyro.

        What a factor adds at rest is trimmed away where a sensor was zeroed with it, and an offset where it came later.
        """
        out: list[Hypothesis] = []
        table = mean_table(view)
        for sensor in view.plant.sensors:
            axes, rates = _kinds(sensor_axes(view, sensor))
            groups = [(a,) for a in axes] + ([axes] if len(axes) > 1 else [])
            groups += [(a,) for a in rates] + ([rates] if len(rates) > 1 else [])
            for group in groups:

                def whole(view: RunView, shape: Shapes, s: str = sensor, g: tuple[int, ...] = group) -> list[Column]:
                    return [tuple(e for a in g for e in sensor_column(view, s, "gain", a))]

                def trimmed(view: RunView, shape: Shapes, of: _Columns = whole) -> list[Column]:
                    return [tuple(e for e in column if e.where is not Where.MEAN) for column in of(view, shape)]

                def fault(coefficients: Array, s: str = sensor, g: tuple[int, ...] = group) -> Array:
                    scale = np.ones(len(CHANNELS))
                    scale[list(g)] += _gain_error(view, s, float(coefficients[0]))
                    return np.diag(scale)

                def possible(coefficients: Array, shape: Shapes, s: str = sensor) -> bool:
                    share = float(coefficients[0])
                    return not (is_input(view, s) and share >= 1.0) and _LEAST < 1.0 + _gain_error(view, s, share) < 1.0 / _LEAST

                axis = axis_name(group[0]) if len(group) == 1 else ""
                variant = "" if group[0] < len(AXES) else _RATES
                kinds: list[tuple[_Columns, str]] = [(trimmed, variant)]
                if is_accelerometer(view, sensor) and any(_shows_at_rest(table, sensor, a) for a in group):
                    kinds.append((whole, _UNTRIMMED))
                out += [
                    Hypothesis(
                        self.ID, sensor, axis, columns, variant=kind, plausible=possible, fault=fault,
                        absorbed=is_input(view, sensor),
                    )
                    for columns, kind in kinds
                ]
        return out

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the factor minus one."""
        sensor, rates = fitted.hypothesis.location, fitted.hypothesis.variant == _RATES
        error = _gain_error(view, sensor, float(fitted.coefficients[0]))
        slope = (1.0 + error) ** 2 if is_input(view, sensor) else 1.0
        std = fault_std(view, sensor, "gyro_gain" if rates else "gain", slope * fitted.std(0))
        return (Reported("gain error of the angular rate" if rates else "gain error", error, std, "-"),)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write the factor into the correction of the sensor; the value at rest stays where it was trimmed.

        A vehicle file has no key for the gain of an angular rate.
        """
        h = fitted.hypothesis
        error = _gain_error(view, h.location, float(fitted.coefficients[0]))
        if h.variant == _RATES:
            name = f"{h.axis or 'angular rates'} of sensor {h.location}"
            return vehicle, (f"{name}: {1.0 + error:.3g} times the true one; a vehicle file has no gain of angular rates",)
        axes = (CHANNELS.index(h.axis),) if h.axis else _kinds(sensor_axes(view, h.location))[0]
        return scale_sensor(vehicle, view, h.location, axes, error, trimmed=h.variant != _UNTRIMMED)


def _kinds(components: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the components of accelerations (or of a transducer) and those of angular rates."""
    return tuple(c for c in components if c < len(AXES)), tuple(c for c in components if c >= len(AXES))


def _shows_at_rest(table: MeanTable, sensor: str, component: int) -> bool:
    """Return whether a factor of two would show in a mean reading."""
    return any(abs(v) > table.std[row] for row, v in sensor_error_means(table, sensor, "gain", component).items())


def _gain_error(view: RunView, sensor: str, coefficient: float) -> float:
    """Return the factor minus one: of a base sensor the share of the reading that is too much was found."""
    return coefficient / (1.0 - coefficient) if is_input(view, sensor) else coefficient

