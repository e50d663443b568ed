# Copyright 2026 ride_estimation contributors
"""Builds found sensor errors into the sensors of a vehicle, or says what a vehicle file cannot hold."""

from __future__ import annotations

import dataclasses

import numpy as np

from ride_estimation.diagnosis.hypothesis import Fitted
from ride_estimation.frames import rotation_from_rpy
from ride_estimation.vehicles.vehicle import Vehicle


def note_correction(vehicle: Vehicle, fitted: Fitted, key: str, value: float) -> tuple[Vehicle, tuple[str, ...]]:
    """Return the vehicle unchanged and the correction in words."""
    h = fitted.hypothesis
    axis = f" axis {h.axis}" if h.axis else ""
    return vehicle, (f"sensor {h.location}{axis}: correct the readings with {key} = {value:.6g}; vehicle files do not hold it",)


def turn_sensor(vehicle: Vehicle, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
    """Return the vehicle with the found rotation of a sensor about one of its axes."""
    h = fitted.hypothesis
    angles = [0.0, 0.0, 0.0]
    angles[("roll", "pitch", "yaw").index(h.axis)] = float(fitted.coefficients[0])
    sensors = dict(vehicle.sensors)
    old = sensors[h.location]
    sensors[h.location] = dataclasses.replace(old, rotation=old.rotation @ rotation_from_rpy(*angles))
    return dataclasses.replace(vehicle, sensors=sensors), ()


def move_sensor(vehicle: Vehicle, fitted: Fitted) -> tuple[Vehicle, tuple[str, ...]]:
    """Return the vehicle with the found position of a sensor."""
    h = fitted.hypothesis
    shift = np.zeros(3)
    shift["xyz".index(h.axis)] = float(fitted.coefficients[0])
    sensors = dict(vehicle.sensors)
    sensors[h.location] = dataclasses.replace(sensors[h.location], position=sensors[h.location].position + shift)
    return dataclasses.replace(vehicle, sensors=sensors), ()
