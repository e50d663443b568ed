# Copyright 2026 ride_estimation contributors
"""What the body carries on mounts of their own (a seat with its driver), as parts of the equations of motion.

q their motion relative to the body, a specific force and angular acceleration of the body at its CG, T rigid motion there to that
at the carried CGs, J the coordinates they have, B their masses and inertias::

    J^T B J q'' + C q' + K q = -J^T B T a,      wrench on the body = -T^T B (T a + J q'') - m g e_z x q
"""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy.linalg as sl
from numpy.typing import NDArray

from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.forces.carried_bodies import LINEARISED_AT
from ride_estimation.estimation.forces.free_parameters import find_free_parameters_of
from ride_estimation.estimation.forces.mount_law import ROLES
from ride_estimation.frames import AXES, COORDINATES, point_motion_matrix, skew
from ride_estimation.vehicles.assembly import assemble, body_columns
from ride_estimation.vehicles.modes import LinearModel, linearise
from ride_estimation.vehicles.vehicle import Body, Vehicle

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class CarriedParts:
    """The carried bodies at one value of the slow states, Q coordinates.

    Attributes
    ----------
    inertia
        Mass matrix of a and q'' without the body itself, shape (6 + Q, 6 + Q).
    stiffness, damping
        Shape (6 + Q, Q): minus the generalised force per q and q'.
    weight
        Force and moment about the CG of the body that carry them at rest, shape (6,).
    masses, arms, moved
        Per carried body its mass [kg], shape (B,), where its CG is from that of the body, shape (B, 3) [m], and how it moves
        with q, shape (B, 3, Q).
    """

    inertia: Array
    stiffness: Array
    damping: Array
    weight: Array
    masses: Array
    arms: Array
    moved: Array


class Carried:
    """The bodies that hang on the estimated body and on nothing else.

    Parameters
    ----------
    geometry
        With what its body carries.

    Attributes
    ----------
    count
        Coordinates Q, 0 where nothing is carried.
    std
        Prior of the logarithms of masses, stiffness and damping, shape (L,); their means are zero.
    """

    def __init__(self, geometry: Geometry) -> None:
        self._gravity = geometry.vehicle.gravity
        self._bodies: tuple[Body, ...] = ()
        self._laws: list[tuple[Array, Array]] = []
        #: stiffness and damping that no free law makes
        self._fixed = np.zeros((0, 0)), np.zeros((0, 0))
        self._selection = np.zeros((0, 0))
        std: list[float] = []
        if geometry.carried is not None:
            vehicle = geometry.carried
            self._bodies = tuple(vehicle.bodies.values())
            model = linearise(assemble(vehicle), *LINEARISED_AT)
            std = [(b.mass.std or 0.0) / b.mass.value for b in self._bodies]
            self._selection = _selection(model, self._bodies)
            std += self._add_laws(vehicle, model)
            self._fixed = model.stiffness - sum(k for k, _ in self._laws), model.damping - sum(c for _, c in self._laws)
        self.count = len(self._fixed[0])
        self.std = np.array(std)

    def _add_laws(self, vehicle: Vehicle, model: LinearModel) -> list[float]:
        """Keep what every law adds to stiffness and damping; return the prior standard deviations of their logarithms."""
        mounts, found = tuple(vehicle.mounts.values()), []
        for parameter in find_free_parameters_of(mounts, PipelineSettings()):
            mount, axis = mounts[parameter.mount], AXES[parameter.axis]
            twice = vehicle.replace_elements({(mount.name, axis): mount.elements[axis].scaled(ROLES[parameter.role], 2.0)})
            other = linearise(assemble(twice), *LINEARISED_AT)
            self._laws.append((other.stiffness - model.stiffness, other.damping - model.damping))
            found.append(parameter.std)
        return found

    def parts(self, logs: Array, cg: Array) -> CarriedParts:
        """Return the parts of the equations of motion.

        Parameters
        ----------
        logs
            Logarithms of masses and of stiffness and damping over those of the vehicle file, shape (L,).
        cg
            CG of the estimated body, shape (3,) [m].
        """
        q, bodies = self.count, len(self._bodies)
        inertia, stiffness, damping, weight = np.zeros((6 + q, 6 + q)), np.zeros((6 + q, q)), np.zeros((6 + q, q)), np.zeros(6)
        if not q:
            return CarriedParts(inertia, stiffness, damping, weight, np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 0)))
        masses = np.exp(logs[:bodies]) * [b.mass.value for b in self._bodies]
        blocks = []
        for body, mass, rows in zip(self._bodies, masses, np.split(self._selection, bodies)):
            turns = np.any(rows[3:] != 0.0, axis=1).astype(float)
            own = sl.block_diag(mass * np.eye(3), turns[:, None] * body.inertia * turns * mass / body.mass.value)
            blocks.append(own)
            weight += np.concatenate([[0.0, 0.0, 1.0], np.cross(body.cg - cg, [0.0, 0.0, 1.0])]) * mass * self._gravity
            stiffness[3:6] -= skew(np.array([0.0, 0.0, mass * self._gravity])) @ rows[:3]
        turn = np.hstack([np.zeros((3, 3)), np.eye(3)])
        rigid = [np.vstack([point_motion_matrix(b.cg - cg), turn]) for b in self._bodies]
        motion = np.hstack([np.vstack(rigid), self._selection])
        stiffness[6:], damping[6:] = self._fixed
        for log, (of_stiffness, of_damping) in zip(logs[bodies:], self._laws):
            stiffness[6:] += np.exp(log) * of_stiffness
            damping[6:] += np.exp(log) * of_damping
        arms, moved = np.array([b.cg - cg for b in self._bodies]), self._selection.reshape(bodies, 6, q)[:, :3]
        return CarriedParts(motion.T @ sl.block_diag(*blocks) @ motion, stiffness, damping, weight, masses, arms, moved)


def _selection(model: LinearModel, bodies: tuple[Body, ...]) -> Array:
    """Return the map from the coordinates to the motion of every carried CG, shape (6 bodies, Q)."""
    found = np.zeros((6 * len(bodies), len(model.mass)))
    for i, body in enumerate(bodies):
        for coordinate, column in body_columns(model.assembly.coordinates, body.name).items():
            found[6 * i + COORDINATES.index(coordinate), column] = 1.0
    return found
