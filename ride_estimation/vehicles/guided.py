# Copyright 2026 ride_estimation contributors
"""Motion of bodies that have fewer coordinates than a rigid body: what they lack they share with the body that carries them.

A seat that only moves up and down on its cab still goes sideways and turns with it, and its mass with it. A body that stands
on anything else than one other body stays at rest along the coordinates that it lacks.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.frames import COORDINATES, point_motion_matrix
from ride_estimation.vehicles.vehicle import Body, Vehicle

Array = NDArray[np.float64]

#: (body, coordinate) of every entry of q
Coordinates = tuple[tuple[str, str], ...]


def carrier_of(vehicle: Vehicle, body: str) -> str:
    """Return the one body that all mounts of a body stand on, empty where they stand on several or on something measured."""
    bases = {m.base for m in vehicle.mounts.values() if m.body == body}
    carrier = bases.pop() if len(bases) == 1 else ""
    return carrier if carrier in vehicle.bodies else ""


def body_rows(vehicle: Vehicle, coordinates: Coordinates, body: str) -> Array:
    """Return the map from q to the small motion (translation, rotation) of the CG of a body, shape (6, Q)."""
    return _rows(vehicle, coordinates, body, frozenset())


def _rows(vehicle: Vehicle, coordinates: Coordinates, body: str, below: frozenset[str]) -> Array:
    carrier = carrier_of(vehicle, body)
    if carrier and carrier not in below | {body}:
        arm = vehicle.bodies[body].cg - vehicle.bodies[carrier].cg
        rows = six_from_point(arm) @ _rows(vehicle, coordinates, carrier, below | {body})
    else:
        rows = np.zeros((6, len(coordinates)))
    for column, (name, coordinate) in enumerate(coordinates):
        if name == body:
            rows[COORDINATES.index(coordinate)] = np.eye(len(coordinates))[column]
    return rows


def six_from_point(arm: Array) -> Array:
    """Return the map from the motion of a CG to that (translation, rotation) of a point ``arm`` away, shape (6, 6)."""
    return np.vstack([point_motion_matrix(arm), np.eye(6)[3:]])


def point_rows(vehicle: Vehicle, coordinates: Coordinates, body: str, position: Array) -> Array:
    """Return the map from q to the small motion (translation, rotation) of a point of a body, shape (6, Q)."""
    arm = np.asarray(position, dtype=float) - vehicle.bodies[body].cg
    return np.asarray(six_from_point(arm) @ body_rows(vehicle, coordinates, body))


def own_mass_matrix(body: Body) -> Array:
    """Return mass and inertia of a body about its CG, shape (6, 6); a point mass about axes it cannot turn about by itself."""
    full = np.zeros((6, 6))
    full[:3, :3] = body.mass.value * np.eye(3)
    turns = np.array([c in body.coordinates for c in COORDINATES[3:]], dtype=float)
    full[3:, 3:] = turns[:, None] * body.inertia * turns
    return full


def mass_matrix(vehicle: Vehicle, coordinates: Coordinates) -> Array:
    """Return the mass matrix of the coordinates, shape (Q, Q), of all bodies that have some."""
    total = np.zeros((len(coordinates), len(coordinates)))
    for name in dict.fromkeys(b for b, _ in coordinates):
        rows = body_rows(vehicle, coordinates, name)
        total += rows.T @ own_mass_matrix(vehicle.bodies[name]) @ rows
    return total
