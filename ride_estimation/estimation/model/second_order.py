# Copyright 2026 ride_estimation contributors
"""Second order of the kinematics and what the third adds, from the last estimated states, added as known inputs.

Centripetal terms at sensors and mounts, rotation of the moving forces and of the body's specific force into bracket axes,
Coriolis and Euler terms of the deflection, the arc of a finite rotation as a deflection of the law, the gyroscopic moment, and
what carried bodies do that move in a body that turns.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.model.dynamics import Dynamics
from ride_estimation.estimation.model.plant import Constants, Plant
from ride_estimation.estimation.model.readings import as_read

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class SecondOrder:
    """Known corrections of one segment.

    Attributes
    ----------
    readings
        Added to the readings, shape (T, C).
    accel
        Added to the specific force and angular acceleration of the body and to the acceleration of carried bodies, (T, 6 + Q).
    """

    readings: Array
    accel: Array


def second_order(plant: Plant, m: Constants, d: Dynamics, theta: Array, v: Array, base_rate: Array) -> SecondOrder:
    """Return the corrections that follow from states and inputs v (T, V) and the angular rate of the base (T, 3)."""
    s, count = plant.states, len(plant.mounts)
    relative_rate = v[:, s.relative_rate]
    rate = base_rate + relative_rate[:, 3:]
    speed = relative_rate @ m.points.T + v[:, s.deformation_rate] @ plant.patterns.T
    bracket_rate = rate[:, None] - (speed @ m.tilt.T).reshape(-1, count, 3)
    bracket_accel = (v @ d.spin.T).reshape(-1, count, 3)
    speed = speed.reshape(-1, count, 3)
    deflection = (v @ d.deflection.T).reshape(-1, count, 3)
    turn = (v @ (m.tilt @ d.deflection).T).reshape(-1, count, 3)
    upright = np.array([0.0, 0.0, plant.gravity])

    load = force_of_second_order(plant, m, d, v).reshape(len(v), -1) @ m.points
    load[:, 3:] -= np.cross(rate, rate @ m.inertia)
    accel = np.hstack([load, np.zeros((len(v), plant.carried.count))]) + load_of_carried(plant, m, d, v, rate)
    accel = accel @ m.mobility
    point = ((v @ d.accel.T + accel[:, :6]) @ m.points.T).reshape(-1, count, 3)

    arms, (arc, _) = _arms(plant, m), _arcs(plant, m, v)
    angle, speed_of = v[:, None, s.relative][..., 3:], relative_rate[:, None, 3:]
    accel_of = (v @ d.A[s.relative_rate].T + accel[:, :6])[:, None, 3:]
    arc_accel = 0.5 * (_twice(accel_of, angle, arms) + _twice(angle, accel_of, arms)) + _turned_twice(speed_of, arms)

    parts = []
    for sensor in plant.sensors:
        i = plant.base_of.get(sensor.name)
        if sensor.kind == "displacement":
            mount = next(j for j, p in enumerate(plant.mounts) if p.name == sensor.mount)
            part = arc[:, mount, ["xyz".index(sensor.axis)]]
        elif i is None:
            part = _turned_twice(rate, sensor.position - m.cg)
        else:
            centripetal = _turned_twice(rate, arms[i])
            part = centripetal + np.cross(turn[:, i], point[:, i] + centripetal)
            part += 0.5 * np.cross(turn[:, i], np.cross(turn[:, i], point[:, i] + upright))
            part -= arc_accel[:, i] + 2.0 * np.cross(bracket_rate[:, i], speed[:, i])
            part -= np.cross(bracket_accel[:, i], deflection[:, i])
        parts.append(part @ as_read(plant, sensor, theta).T)
    return SecondOrder(np.hstack(parts), accel)


def load_of_carried(plant: Plant, m: Constants, d: Dynamics, v: Array, rate: Array) -> Array:
    """Return what the second order adds to the wrench of carried bodies and the forces along their coordinates, (T, 6 + Q).

    A body at ``r + d`` that moves by d: ``a x d + w x (w x r) + 2 w x d'`` more acceleration, and what it has acts at d from r.
    """
    s, carried = plant.states, m.carried
    found, accel = np.zeros((len(v), 6 + plant.carried.count)), v @ d.accel.T
    for mass, arm, moved in zip(carried.masses, carried.arms, carried.moved):
        away, speed = v[:, s.carried] @ moved.T, v[:, s.carried_rate] @ moved.T
        first = accel[:, :3] + np.cross(accel[:, 3:], arm) + v @ (moved @ d.A[s.carried_rate]).T
        second = np.cross(accel[:, 3:], away) + _turned_twice(rate, arm) + 2.0 * np.cross(rate, speed)
        found[:, :3] -= mass * second
        found[:, 3:6] -= mass * (np.cross(arm, second) + np.cross(away, first))
        found[:, 6:] -= mass * second @ moved
    return found


def force_of_second_order(plant: Plant, m: Constants, d: Dynamics, v: Array) -> Array:
    """Return what the second order adds to the forces of the mounts, from states and inputs v (T, V), shape (T, M, 3)."""
    count = len(plant.mounts)
    turn = (v @ (m.tilt @ d.deflection).T).reshape(-1, count, 3)
    arc, arc_rate = _arcs(plant, m, v)
    added = -m.stiffness.reshape(-1, 3) * arc - m.damping.reshape(-1, 3) * arc_rate
    # in bracket axes: the first order in body axes contains the turned static force
    force = (v @ d.force.T).reshape(-1, count, 3) + np.cross(turn, m.static) + added
    return np.asarray(added + 0.5 * np.cross(turn, np.cross(turn, m.static + force)) - np.cross(turn, force))


def slopes_of_laws(plant: Plant, m: Constants, d: Dynamics, v: Array) -> Array:
    """Return the derivative of ``SecondOrder.accel`` with ln k and ln c at given states and inputs v (T, V).

    What a stiff mount carries more than its neighbour along a track that turns is told by the second order alone.

    Returns
    -------
    array
        Shape (T, 6 + Q, 6 M): all stiffnesses, then all dampings.
    """
    count, speed = len(plant.mounts), v[:, plant.states.relative_rate] @ m.points.T
    speed = speed + v[:, plant.states.deformation_rate] @ plant.patterns.T
    turn = (v @ (m.tilt @ d.deflection).T).reshape(-1, count, 1, 3)
    turned = np.cross(turn, np.eye(3))
    turned = 0.5 * np.cross(turn, turned) - turned
    to_accel = (m.points @ m.mobility[:6]).reshape(count, 3, -1)
    both = np.matmul(turned, to_accel)
    found = []
    for law, moved, arc in zip((m.stiffness, m.damping), (v @ d.deflection.T, speed), _arcs(plant, m, v)):
        shape = (len(v), count, 3, 1)
        found.append(-law.reshape(count, 3, 1) * ((moved.reshape(shape) + arc[..., None]) * both + arc[..., None] * to_accel))
    return np.concatenate([f.reshape(len(v), 3 * count, -1) for f in found], axis=1).transpose(0, 2, 1)


def _arcs(plant: Plant, m: Constants, v: Array) -> tuple[Array, Array]:
    """Return deflection and rate that a finite rotation adds, the mount moves along an arc: shape (T, M, 3).

    To third order, ``theta x (theta x r) / 2 + theta x (theta x (theta x r)) / 6``: mounts are stiff along the last.
    """
    arms = _arms(plant, m)
    angle, speed = (v[:, None, part][..., 3:] for part in (plant.states.relative, plant.states.relative_rate))
    arc, rate = 0.5 * _turned_twice(angle, arms), 0.5 * (_twice(speed, angle, arms) + _twice(angle, speed, arms))
    return arc + np.cross(angle, arc) / 3.0, rate + (np.cross(speed, arc) + np.cross(angle, rate)) / 3.0


def _arms(plant: Plant, m: Constants) -> Array:
    """Return where the mounts are, from the CG, shape (M, 3)."""
    return np.array([p.position for p in plant.mounts]) - m.cg


def _turned_twice(rate: Array, arm: Array) -> Array:
    """Return ``w x (w x r)``."""
    return _twice(rate, rate, arm)


def _twice(first: Array, second: Array, arm: Array) -> Array:
    """Return ``a x (b x r)``."""
    return np.asarray(np.cross(first, np.cross(second, arm)))
