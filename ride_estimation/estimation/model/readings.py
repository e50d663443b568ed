# Copyright 2026 ride_estimation contributors
"""What sensors read of the state: rows and constants, with bias, gain, misalignment, position and delay of every sensor.

An accelerometer whose axes are turned by phi (sensor axes) at ``r + dr`` reads
``y = (1 + gain) E(phi)^T R^T (a + alpha x dr + g e_z)(t - delay) + bias``, with ``E(phi)`` the rotation by phi. The delay is a
phase and not in these rows.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ride_estimation.estimation.model.dynamics import Dynamics
from ride_estimation.estimation.model.plant import Plant
from ride_estimation.frames import AXES, point_motion_matrix, skew
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]


def reading(plant: Plant, d: Dynamics, sensor: Sensor, theta: Array) -> tuple[Array, Array]:
    """Return rows (C, V) and constant part (C,) of one sensor's reading, without its delay."""
    error = {kind: theta[part] for kind, part in plant.slow.sensors[sensor.name].items()}
    if sensor.kind == "displacement":
        mount = next(i for i, m in enumerate(plant.mounts) if m.name == sensor.mount)
        place = 3 * mount + AXES.index(sensor.axis)
        rows = d.deflection[place][None]
        still = d.constants.deflected[place : place + 1]
    else:
        rows = point_rows(plant, d, sensor, d.constants.cg) - skew(error["position"]) @ _spin(plant, d, sensor)
        still = np.array([0.0, 0.0, plant.gravity]) + theta[plant.slow.mean_accel] + _leaning(plant, d, sensor)
    read = as_read(plant, sensor, theta)
    return read @ rows, read @ still + error["bias"]


def as_read(plant: Plant, sensor: Sensor, theta: Array) -> Array:
    """Return the matrix from what acts on a sensor, in the axes of its body, to its channels: misalignment and gain."""
    parts = plant.slow.sensors[sensor.name]
    turn = np.eye(1) if sensor.kind == "displacement" else axes(sensor, theta[parts["misalignment"]]).T
    return np.asarray((1.0 + theta[parts["gain"]])[:, None] * turn)


def readings(plant: Plant, d: Dynamics, theta: Array) -> tuple[Array, Array]:
    """Return rows (C, V) and constant part (C,) of all readings."""
    parts = [reading(plant, d, s, theta) for s in plant.sensors]
    return np.vstack([p[0] for p in parts]), np.concatenate([p[1] for p in parts])


def point_rows(plant: Plant, d: Dynamics, sensor: Sensor, cg: Array) -> Array:
    """Return the moving specific force where an accelerometer is declared to be, axes of its body, shape (3, V)."""
    i = plant.base_of.get(sensor.name)
    if i is None:
        return np.asarray(point_motion_matrix(sensor.position - cg) @ d.accel)
    part = slice(3 * i, 3 * i + 3)
    return np.asarray(d.base[part] - skew(sensor.position - plant.mounts[i].position) @ d.spin[part])


def axes(sensor: Sensor, misalignment: Array) -> Array:
    """Return the rotation from the axes a sensor really has to those of its body, shape (3, 3)."""
    return np.asarray(sensor.rotation @ _rotation(*misalignment.tolist()))


@functools.lru_cache(maxsize=256)  # most slow states leave it as it is
def _rotation(x: float, y: float, z: float) -> Array:
    return np.asarray(Rotation.from_rotvec([x, y, z]).as_matrix())


def _leaning(plant: Plant, d: Dynamics, sensor: Sensor) -> Array:
    """Return what gravity adds at a bracket, against which the body leans at rest, shape (3,)."""
    i = plant.base_of.get(sensor.name)
    if i is None:
        return np.zeros(3)
    turn = d.constants.tilt[3 * i : 3 * i + 3] @ d.constants.deflected
    return np.asarray(plant.gravity * np.array([turn[1], -turn[0], 0.0]))


def _spin(plant: Plant, d: Dynamics, sensor: Sensor) -> Array:
    i = plant.base_of.get(sensor.name)
    return d.accel[3:] if i is None else d.spin[3 * i : 3 * i + 3]
