# Copyright 2026 ride_estimation contributors
"""Exact motion of the bodies along a small-rotation trajectory, and the generalised force of what acts on them.

A body that lacks coordinates is guided by the body that carries it: along the directions of its own translations, which turn
with the carrier as the rails of a seat do. ``r = r_c + R_c (arm + s)``, ``s`` along its own axes such that ``r`` has its own
coordinates; what the guide pushes sideways acts on the carrier (principle of virtual power).
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.model.plant import Plant
from ride_estimation.frames import AXES, rotation_matrices, skew
from ride_estimation.vehicles.guided import carrier_of, own_mass_matrix

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class BodyMotion:
    """Small-rotation trajectory of all coordinates: q, its rate and acceleration, each (N, n)."""

    position: Array
    velocity: Array
    acceleration: Array


class Trajectory:
    """Rotation, rates and accelerations of one body.

    Attributes
    ----------
    linear
        Displacement, velocity and acceleration of the CG with small rotations, shape (N, 3) each.
    theta, theta_dot, theta_ddot
        Rotation vector and its derivatives, shape (N, 3).
    rotation, omega, alpha
        Body to world (N, 3, 3), angular velocity and acceleration in world axes (N, 3).
    displacement, velocity, acceleration
        Of the CG, shape (N, 3).
    """

    def __init__(self, plant: Plant, name: str, motion: BodyMotion) -> None:
        rows = plant.body_map(name).T
        q, v, a = motion.position @ rows, motion.velocity @ rows, motion.acceleration @ rows
        self.linear = q[:, :3], v[:, :3], a[:, :3]
        self.theta, self.theta_dot, self.theta_ddot = q[:, 3:], v[:, 3:], a[:, 3:]
        self.rotation = rotation_matrices(self.theta)
        self.omega = self.theta_dot + 0.5 * np.cross(self.theta, self.theta_dot)
        self.alpha = self.theta_ddot + 0.5 * np.cross(self.theta, self.theta_ddot)
        self.displacement, self.velocity, self.acceleration = self.linear

    def arm(self, offset: Array) -> Array:
        """Return the rotated lever arm, (N, 3)."""
        return np.asarray(self.rotation.reshape(-1, 3) @ offset).reshape(-1, 3)

    def beyond(self, offset: Array) -> tuple[Array, Array]:
        """Return displacement and velocity of a point beyond small rotation, (N, 3) each."""
        arm = self.arm(offset)
        moved = self.displacement - self.linear[0] + arm - offset - self.theta @ skew(offset)
        return moved, self.velocity - self.linear[1] + np.cross(self.omega, arm) - self.theta_dot @ skew(offset)

    def turned(self, tensor: Array, vectors: Array) -> Array:
        """Return the products of a tensor of the body (3, 3) with vectors, both in world axes, shape (N, 3)."""
        own = np.einsum("nji,nj->ni", self.rotation, vectors) @ tensor.T
        return np.asarray(np.einsum("nij,nj->ni", self.rotation, own))

    def point_acceleration(self, offset: Array) -> Array:
        """Return the acceleration of a point, (N, 3)."""
        arm = self.arm(offset)
        return np.asarray(self.acceleration + np.cross(self.alpha, arm) + np.cross(self.omega, np.cross(self.omega, arm)))


def _carriers_first(plant: Plant) -> list[str]:
    """Return the bodies, every one after the one that carries it."""
    names = dict.fromkeys(b for b, _ in plant.coordinates)
    order: list[str] = []
    while len(order) < len(names):
        left = [b for b in names if b not in order]
        # bodies that carry each other in a ring have no first one
        order += [b for b in left if carrier_of(plant.vehicle, b) not in left] or left
    return order


@dataclasses.dataclass(frozen=True)
class _Guide:
    """How a body follows its carrier: ``v = across (v_c + omega_c x lever) + along v_own``; O own translations.

    Attributes
    ----------
    carrier, own
        Name, and axes of the own translations.
    lever
        From the CG of the carrier, shape (N, 3).
    along, across
        Shapes (N, 3, O) and (N, 3, 3).
    """

    carrier: str
    own: list[int]
    lever: Array
    along: Array
    across: Array


class Trajectories:
    """Motion of all bodies of a plant along a small-rotation trajectory.

    Parameters
    ----------
    plant, motion
        Matrices and trajectory.
    """

    def __init__(self, plant: Plant, motion: BodyMotion) -> None:
        self._plant = plant
        self.bodies: dict[str, Trajectory] = {}
        self._guides: dict[str, _Guide] = {}
        for name in _carriers_first(plant):
            body = self.bodies[name] = Trajectory(plant, name, motion)
            own = [column for _, column in plant.coordinate_rows(name) if column < len(AXES)]
            carrier = carrier_of(plant.vehicle, name)
            if carrier in self.bodies and len(own) < len(AXES):
                self._guides[name] = self._guided(body, carrier, own, plant.vehicle.bodies[name].cg)

    def _guided(self, body: Trajectory, carrier: str, own: list[int], cg: Array) -> _Guide:
        """Put the motion of a body onto the guide that its carrier is to it."""
        base = self.bodies[carrier]
        turn, arm = base.rotation, cg - self._plant.vehicle.bodies[carrier].cg
        along = turn[:, :, own] @ np.linalg.inv(turn[:, own][:, :, own])
        across = np.tile(np.eye(len(AXES)), (len(turn), 1, 1))
        across[:, :, own] -= along

        def on_guide(shared: Array, free: Array) -> Array:
            return np.asarray(np.einsum("nij,nj->ni", across, shared) + np.einsum("nio,no->ni", along, free[:, own]))

        place, velocity, acceleration = body.linear
        body.displacement = on_guide(base.displacement + base.arm(arm) - arm, place)
        lever = body.displacement - base.displacement + arm
        spin = np.cross(base.omega, lever)
        body.velocity = on_guide(base.velocity + spin, velocity)
        sliding = body.velocity - base.velocity - spin
        shared = base.acceleration + np.cross(base.alpha, lever) + np.cross(base.omega, spin + 2.0 * sliding)
        body.acceleration = on_guide(shared, acceleration)
        return _Guide(carrier, own, lever, along, across)

    def generalised(self, force: dict[str, Array], moment: dict[str, Array]) -> Array:
        """Return the generalised force of forces and moments, of weight, and of what acceleration takes, shape (N, n).

        Parameters
        ----------
        force, moment
            On every body, about its CG, world axes, shape (N, 3) each.
        """
        plant, vehicle = self._plant, self._plant.vehicle
        size = len(next(iter(self.bodies.values())).theta)
        out = np.zeros((size, len(plant.coordinates)))
        left, turning = ({b: np.array(part[b]) for b in self.bodies} for part in (force, moment))
        weight = np.array([0.0, 0.0, vehicle.gravity])
        for name, body in self.bodies.items():
            given = own_mass_matrix(vehicle.bodies[name])
            left[name] -= vehicle.bodies[name].mass.value * (body.acceleration + weight)
            momentum = body.turned(given[3:, 3:], body.omega)
            turning[name] -= body.turned(given[3:, 3:], body.alpha) + np.cross(body.omega, momentum)
        for name in reversed(self.bodies):
            guide, rows = self._guides.get(name), plant.coordinate_rows(name)
            push, own = left[name], [column for _, column in rows]
            if guide is not None:
                along = np.einsum("nio,ni->no", guide.along, push)
                sideways = np.einsum("nij,ni->nj", guide.across, push)
                left[guide.carrier] += sideways
                turning[guide.carrier] += np.cross(guide.lever, sideways)
                push = np.zeros_like(push)
                push[:, guide.own] = along
            carrier = carrier_of(vehicle, name)
            if carrier in self.bodies:
                shared = [axis for axis in range(3) if 3 + axis not in own]
                turning[carrier][:, shared] += turning[name][:, shared]
            both = np.hstack([push, turning[name]])
            for row, column in rows:
                out[:, row] = both[:, column]
        return out

