# Copyright 2026 ride_estimation contributors
"""A sensor that cannot follow large readings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.effect import Column, Effect, Where
from ride_estimation.diagnosis.hypotheses.declipping import missing_readings
from ride_estimation.diagnosis.hypotheses.hypothesis import Cause, Fitted, Hypothesis, Reported, Shapes, Sign
from ride_estimation.diagnosis.hypotheses.sensor_column import axis_name
from ride_estimation.diagnosis.hypotheses.sensor_extension import limit_sensor
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: distance from a level within which a reading counts as cut, share of the standard deviation of its channel: a filter follows
NEAR_LIMIT = 0.02


def flat_tops(values: np.ndarray, limits: np.ndarray) -> list[tuple[float, float]]:
    """Return (side, level) where readings are cut.

    At a level that the raw samples show, or where many samples lie near an extreme value as those of a signal do that was cut
    before it was filtered: one with a Gaussian tail has few samples within a few noise widths of its extreme.

    Parameters
    ----------
    values
        Samples of one channel, shape (N,).
    limits
        Lower and upper level of the raw samples, infinite where there is none, shape (2,).
    """
    out = []
    spread = float(np.std(values))
    for side, limit in ((1.0, float(limits[1])), (-1.0, float(limits[0]))):
        if np.isfinite(limit):
            out.append((side, side * limit))
            continue
        level = float(np.max(side * values))
        width = max(NEAR_LIMIT * spread, 1e-9)
        near = int(np.count_nonzero(side * values > level - width))
        below = int(np.count_nonzero((side * values > level - 3.0 * width) & (side * values <= level - width)))
        if near >= 8 and near > 2 * below:
            out.append((side, level))
    return out


def _channels(view: RunView, sensor: str) -> list[tuple[bool, int, Array, Array]]:
    """Return (whether input, row, samples, limits) of the acceleration channels of a sensor."""
    plant, data = view.plant, view.data.measured
    groups = ((False, plant.outputs, data.outputs, data.output_limits), (True, plant.inputs, data.inputs, data.input_limits))
    return [
        (from_input, i, values[:, i], limits[:, i])
        for from_input, signals, values, limits in groups
        for i, s in enumerate(signals) if s.sensor == sensor and s.kind == "acceleration"
    ]


@final
class SensorClipping(Cause):
    """Readings beyond a level are cut."""

    ID = "sensor_clipping"
    QUESTION = "Are the peaks of a channel cut off?"
    NEEDS = "a channel that reached its limit"
    RIVALS = ("sensor_gain", "bump_stop", "stiffness_nonlinearity")
    WOULD_REFUTE = "single samples beyond the level"
    MEASURE_NEXT = "repeat with a larger measuring range"

    def hypotheses(self, view: RunView) -> Sequence[Hypothesis]:
        """Return one hypothesis per sensor with a channel that has a heap of samples at an extreme."""
        out: list[Hypothesis] = []
        plant = view.plant
        for sensor in plant.sensors:
            hits = _hits(view, sensor)
            if not hits:
                continue

            def columns(view: RunView, shape: Shapes, sensor: str = sensor) -> list[Column]:
                return [tuple(_cut(view, *hit) for hit in _hits(view, sensor))]

            largest = max(hits, key=lambda hit: abs(hit[3]))
            component = (plant.inputs if largest[0] else plant.outputs)[largest[1]].component
            axis = axis_name(component) if len({hit[1] for hit in hits}) == 1 else ""
            out.append(Hypothesis(self.ID, sensor, axis, columns, signs=(Sign.POSITIVE,), seen_in_readings=True))
        return out

    def parameters(self, view: RunView, fitted: Fitted) -> tuple[Reported, ...]:
        """Return the level at which readings are cut [m/s^2] and the share of the predicted excess that is missing."""
        location = fitted.hypothesis.location
        levels = [abs(level) for *_, level in _hits(view, location)]
        level = float(max(levels, default=float("nan")))
        out = [Reported("missing share of the peaks", float(fitted.coefficients[0]), fitted.std(0), "-")]
        return (Reported("clipping level", level, 0.01 * level, "m/s^2"), *out) if levels else tuple(out)

    def extend(self, vehicle: Vehicle, view: RunView, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
        """Write the level as the range of the sensor: the estimator ignores samples there."""
        level = self.parameters(view, fitted)[0]
        return limit_sensor(vehicle, fitted.hypothesis.location, level.value)


def _hits(view: RunView, sensor: str) -> list[tuple[bool, int, float, float]]:
    """Return (whether input, row, side, level) of the channels of a sensor that are cut."""
    return [
        (from_input, i, side, level)
        for from_input, i, values, limits in _channels(view, sensor) for side, level in flat_tops(values, limits)
    ]


def _cut(view: RunView, from_input: bool, index: int, side: float, level: float) -> Effect:
    """Return what clipping takes from a channel: of the body by the model, of the bases by the channels beside it."""
    if not from_input:
        total = view.grid.signal(view.model.ideal_spectrum[:, [index]])[:, 0] + view.data.output_mean[index]
        return Effect(Where.OUTPUT, index, -side * np.maximum(side * total - level, 0.0))
    readings = view.data.measured.inputs
    cut = side * readings[:, index] > level - NEAR_LIMIT * float(np.std(readings[:, index]))
    return Effect(Where.INPUT, index, missing_readings(readings, index, cut, side, view.data.measured.rate_hz))
