# Copyright 2026 ride_estimation contributors
"""What sensors read: combinations of accelerations and deflections, and constants.

Every sensor errs by bias, gain, misalignment, position and delay.

An accelerometer whose axes are turned by phi (sensor axes) at ``r + dr`` reads
``y = (1 + gain) E(phi)^T R^T (a + alpha x dr + g e_z)(t - delay) + bias``, with ``E(phi)`` the rotation by phi. The delay is a
phase and not in these combinations.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ride_estimation.estimation.model.plant import Constants, Plant
from ride_estimation.estimation.model.states import reading_width, slices_of
from ride_estimation.frames import AXES, point_motion_matrix, skew
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]


def combination(plant: Plant, sensor: Sensor, theta: Array, cg: Array) -> Array:
    """Return what a sensor reads as combination of :attr:`Dynamics.parts`, without its delay, shape (C, 6 + 9 M)."""
    count = 3 * len(plant.mounts)
    accel, base, spin, deflection = slices_of([6, count, count, count])
    found = np.zeros((reading_width(sensor), deflection.stop))
    read, i = as_read(plant, sensor, theta), plant.base_of.get(sensor.name)
    if sensor.kind == "displacement":
        found[0, deflection.start + travel_place(plant, sensor)] = read[0, 0]
        return found
    position = sensor.position + theta[plant.slow.sensors[sensor.name]["position"]]
    if i is None:
        found[:, accel] = read @ point_motion_matrix(position - cg)
    else:
        at = 3 * i
        found[:, base.start + at : base.start + at + 3] = read
        found[:, spin.start + at : spin.start + at + 3] = -read @ skew(position - plant.mounts[i].position)
    return found


def combinations_of(plant: Plant, theta: Array, cg: Array) -> Array:
    """Return the combinations of all sensors, shape (C, 6 + 9 M)."""
    return np.vstack([combination(plant, s, theta, cg) for s in plant.sensors])


def constant(plant: Plant, m: Constants, sensor: Sensor, theta: Array) -> Array:
    """Return what a sensor reads of a vehicle that stands, shape (C,): gravity and bias."""
    bias = theta[plant.slow.sensors[sensor.name]["bias"]]
    if sensor.kind == "displacement":
        place = travel_place(plant, sensor)
        still = m.deflected[place : place + 1]
    else:
        still = np.array([0.0, 0.0, plant.gravity]) + m.mean + _leaning(plant, m, sensor)
    return np.asarray(as_read(plant, sensor, theta) @ still + bias)


def as_read(plant: Plant, sensor: Sensor, theta: Array) -> Array:
    """Return the matrix from what acts on a sensor, in the axes of its body, to its channels: misalignment and gain."""
    parts = plant.slow.sensors[sensor.name]
    turn = np.eye(1) if sensor.kind == "displacement" else axes(sensor, theta[parts["misalignment"]]).T
    return np.asarray((1.0 + theta[parts["gain"]])[:, None] * turn)


def axes(sensor: Sensor, misalignment: Array) -> Array:
    """Return the rotation from the axes a sensor really has to those of its body, shape (3, 3)."""
    return np.asarray(sensor.rotation @ _rotation(*misalignment.tolist()))


@functools.lru_cache(maxsize=256)  # most slow states leave it as it is
def _rotation(x: float, y: float, z: float) -> Array:
    return np.asarray(Rotation.from_rotvec([x, y, z]).as_matrix())


def _leaning(plant: Plant, m: Constants, sensor: Sensor) -> Array:
    """Return what gravity adds at a bracket, against which the body leans at rest, shape (3,)."""
    i = plant.base_of.get(sensor.name)
    if i is None:
        return np.zeros(3)
    turn = m.tilt[3 * i : 3 * i + 3] @ m.deflected
    return np.asarray(plant.gravity * np.array([turn[1], -turn[0], 0.0]))


def travel_place(plant: Plant, sensor: Sensor) -> int:
    """Return which of the 3 M deflections a transducer measures."""
    return 3 * next(i for i, m in enumerate(plant.mounts) if m.name == sensor.mount) + AXES.index(sensor.axis)
