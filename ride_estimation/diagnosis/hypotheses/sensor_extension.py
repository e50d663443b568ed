# Copyright 2026 ride_estimation contributors
"""Builds found sensor errors into the sensors of a vehicle: corrections of readings, rotation, position, range.

Errors are found on readings that the corrections of the vehicle file had put right already, so raw readings are
``g0 (true + e (true - rest) + offset) + b0`` with what the file said before (``g0``, ``b0``).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.frames import rotation_from_rpy
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.correction import Correction
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]
Extended = tuple[Vehicle, tuple[str, ...]]


def delay_sensors(vehicle: Vehicle, sensors: Sequence[str], delay: float) -> Extended:
    """Return the vehicle with sensors that are later than it said.

    Parameters
    ----------
    delay
        [s].
    """
    changes = {}
    for name in sensors:
        correction = vehicle.sensors[name].correction
        changes[name] = dataclasses.replace(correction, delay=correction.delay + delay)
    return _corrected(vehicle, changes)


def scale_sensor(
    vehicle: Vehicle, view: RunView, sensor: str, axes: Sequence[int], error: float, trimmed: bool = True
) -> Extended:
    """Return the vehicle with a sensor that reads ``1 + error`` times too much, about its value at rest where that was trimmed.

    Parameters
    ----------
    view
        Where the error was found.
    axes
        Components of the sensor.
    """
    old = vehicle.sensors[sensor]
    before = view.plant.vehicle.sensors[sensor].correction
    channels = _channels(old)
    gain, bias = old.correction.gains(channels), old.correction.biases(channels)
    rest = _at_rest(old, vehicle.gravity, channels)
    for i in _places(axes, channels):
        gain[i] *= 1.0 + error
        bias[i] -= before.gains(channels)[i] * error * rest[i] if trimmed else 0.0
    return _corrected(vehicle, {sensor: _with_values(old.correction, gain, bias)})


def offset_sensor(vehicle: Vehicle, view: RunView, sensor: str, axes: Sequence[int], offset: float) -> Extended:
    """Return the vehicle with a sensor whose readings are ``offset`` [unit of the sensor] too large.

    Parameters
    ----------
    view
        Where the error was found.
    axes
        Components of the sensor.
    """
    old = vehicle.sensors[sensor]
    channels = _channels(old)
    gain, bias = old.correction.gains(channels), old.correction.biases(channels)
    for i in _places(axes, channels):
        bias[i] += view.plant.vehicle.sensors[sensor].correction.gains(channels)[i] * offset
    return _corrected(vehicle, {sensor: _with_values(old.correction, gain, bias)})


def limit_sensor(vehicle: Vehicle, sensor: str, level: float) -> Extended:
    """Return the vehicle with a sensor that cannot read beyond a level: the estimator refuses samples there."""
    old = vehicle.sensors[sensor]
    full_scale = level * float(np.max(old.correction.gains(_channels(old))))
    changed = dataclasses.replace(old, full_scale=min(full_scale, old.full_scale))
    note = f"sensor {sensor}: full_scale is the level at which readings are cut; what was cut is lost and no model brings it back"
    return dataclasses.replace(vehicle, sensors={**vehicle.sensors, sensor: changed}), (note,)


def turn_sensor(vehicle: Vehicle, fitted: Fitted) -> Extended:
    """Return the vehicle with the found rotation of a sensor about one of its axes."""
    h = fitted.hypothesis
    angles = [0.0, 0.0, 0.0]
    angles[("roll", "pitch", "yaw").index(h.axis)] = float(fitted.coefficients[0])
    sensors = dict(vehicle.sensors)
    old = sensors[h.location]
    sensors[h.location] = dataclasses.replace(old, rotation=old.rotation @ rotation_from_rpy(*angles))
    return dataclasses.replace(vehicle, sensors=sensors), ()


def move_sensor(vehicle: Vehicle, fitted: Fitted) -> Extended:
    """Return the vehicle with the found position of a sensor."""
    h = fitted.hypothesis
    shift = np.zeros(3)
    shift["xyz".index(h.axis)] = float(fitted.coefficients[0])
    sensors = dict(vehicle.sensors)
    sensors[h.location] = dataclasses.replace(sensors[h.location], position=sensors[h.location].position + shift)
    return dataclasses.replace(vehicle, sensors=sensors), ()


def _channels(sensor: Sensor) -> int:
    """Return how many channels of a sensor a correction names: the angular rates of an IMU are left alone."""
    return min(sensor.channels, 3)


def _places(axes: Sequence[int], channels: int) -> tuple[int, ...]:
    """Return the channels of components; the component of a transducer is its axis, and it has one channel."""
    return tuple(axes) if channels > 1 else (0,)


def _at_rest(sensor: Sensor, gravity: float, channels: int) -> Array:
    if sensor.kind not in ("accelerometer", "imu") or sensor.coupling != "dc":
        return np.zeros(channels)
    return np.asarray(sensor.rotation.T @ np.array([0.0, 0.0, gravity]))


def _with_values(old: Correction, gain: Array, bias: Array) -> Correction:
    return dataclasses.replace(old, gain=tuple(gain.tolist()), bias=tuple(bias.tolist()))


def _corrected(vehicle: Vehicle, changes: dict[str, Correction]) -> Extended:
    sensors = dict(vehicle.sensors)
    for name, correction in changes.items():
        sensors[name] = dataclasses.replace(sensors[name], correction=correction)
    return dataclasses.replace(vehicle, sensors=sensors), ()
