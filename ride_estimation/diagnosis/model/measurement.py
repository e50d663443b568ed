# Copyright 2026 ride_estimation contributors
"""The measured run as arrays of the channels of a plant."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.model.plant import Plant, Signal
from ride_estimation.signals.corrected_run import corrected_run
from ride_estimation.signals.recording import UniformRun

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclasses.dataclass(frozen=True)
class Measurement:
    """The measured run as arrays of the plant's channels.

    Attributes
    ----------
    outputs, inputs
        Gravity and offset still in them, shapes (N, ny) and (N, nu).
    valid
        False inside gaps of any used channel, shape (N,).
    output_limits, input_limits
        Values at which raw readings are cut, lower and upper ones, infinite where none are, shapes (2, ny) and (2, nu).
    speed
        Of the vehicle, shape (N,) [m/s], None where it is not measured.
    """

    name: str
    rate_hz: float
    outputs: Array
    inputs: Array
    valid: BoolArray
    output_limits: Array
    input_limits: Array
    speed: Array | None = None

    def at(self, samples: NDArray[np.int64] | slice) -> Measurement:
        """Return the run at some of its samples."""
        speed = None if self.speed is None else self.speed[samples]
        parts = {name: getattr(self, name)[samples] for name in ("outputs", "inputs", "valid")}
        return dataclasses.replace(self, **parts, speed=speed)


def _between_changes(values: Array) -> Array:
    """Return a signal whose last value is held, shape (N,), on straight lines between its changes: held, it is late."""
    changes = np.append(0, np.flatnonzero(np.diff(values)) + 1)
    return np.asarray(np.interp(np.arange(len(values)), changes, values[changes]))


def measurement(plant: Plant, run: UniformRun) -> Measurement:
    """Collect the plant's channels of a run, corrections of the sensors applied; gaps are bridged linearly and marked invalid.

    Raises
    ------
    KeyError
        A sensor, or the angular rates of one, that the run does not have.
    """
    run = corrected_run(run, {s: plant.vehicle.sensors[s].correction for s in plant.sensors})
    valid = np.ones(run.samples, dtype=bool)
    for sensor in plant.sensors:
        valid &= run.valid[sensor]

    def column(sensor: str, component: int) -> Array:
        data = np.asarray(run.data[sensor], dtype=float)
        if component >= data.shape[1] > 1:
            raise KeyError(f"{sensor} (angular rates)")
        values = data[:, component if data.shape[1] > 1 else 0].copy()
        good = np.isfinite(values) & run.valid[sensor]
        if not np.all(good) and np.any(good):
            index = np.arange(len(values))
            values = np.interp(index, index[good], values[good])
        return values

    outputs = np.stack([column(s.sensor, s.component) for s in plant.outputs], axis=1)
    inputs = np.stack([column(s.sensor, s.component) for s in plant.inputs], axis=1)

    def limits(signals: Sequence[Signal]) -> Array:
        free = np.array([[-np.inf], [np.inf]])
        found = [run.clipped_at.get(s.sensor) for s in signals]
        rows = [free if f is None else f[:, [s.component if f.shape[1] > 1 else 0]] for s, f in zip(signals, found)]
        return np.hstack(rows)

    sensors = [s.name for s in plant.vehicle.sensors.values() if s.kind == "speed" and s.name in run.data]
    heard = [s for s in sensors if np.any(run.valid[s] & np.isfinite(np.ravel(run.data[s])))]
    speed = _between_changes(column(heard[0], 0)) if heard else None
    return Measurement(run.name, run.rate_hz, outputs, inputs, valid, limits(plant.outputs), limits(plant.inputs), speed)
