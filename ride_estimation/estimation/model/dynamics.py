# Copyright 2026 ride_estimation contributors
"""Equations of motion: Newton-Euler of the body on its mounts, driven by the acceleration of the base.

``D = P q + U z`` deflections of the mounts (q rigid relative motion, z deformation of the base), force on the body in its axes
``F = F0 - K D - C D' + F0 x turn(D) + m e`` (mount axes follow the brackets; e free forces), specific
force at the CG ``f = M^-1 P^T (F - F0)``, with carried bodies (:mod:`carried`) solved for together with theirs.
A point of the body and its bracket share gravity up to the rotation between them, ``Gamma D`` = g (turn_y, -turn_x, 0), so
``q'' = f + P^+ Gamma D - r`` with r the rigid specific force of the base, and ``z'' = u``. Nothing is assumed of r, u and e.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.model.plant import Constants, Plant
from ride_estimation.frames import skew

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Dynamics:
    """Continuous-time model ``x' = A v`` of the states x, v = states and inputs, and rows that follow from it.

    Attributes
    ----------
    constants
        What it was made of.
    A
        Shape (X, V).
    deflection
        Deflections of the mounts, shape (3 M, V) [m].
    force
        Moving force of the mounts on the body, shape (3 M, V) [N].
    accel
        Specific force and angular acceleration at the CG without the static part, shape (6, V).
    base
        Specific force of the brackets at the mounts, bracket axes, without the static part, shape (3 M, V).
    spin
        Angular acceleration of the brackets, shape (3 M, V) [rad/s^2].
    """

    constants: Constants
    A: Array
    deflection: Array
    force: Array
    accel: Array
    base: Array
    spin: Array

    @property
    def parts(self) -> Array:
        """Return what sensors read combinations of: ``accel``, ``base``, ``spin``, ``deflection``, shape (6 + 9 M, V)."""
        return np.vstack([self.accel, self.base, self.spin, self.deflection])


def dynamics(plant: Plant, m: Constants) -> Dynamics:
    """Return the continuous-time model of a plant with given constants."""
    s, patterns, g = plant.states, plant.patterns, plant.gravity
    count, n = patterns.shape
    deflection, rate = np.zeros((2, count, s.size))
    deflection[:, s.relative], deflection[:, s.deformation] = m.points, patterns
    rate[:, s.relative_rate], rate[:, s.deformation_rate] = m.points, patterns
    turned = np.vstack([skew(m.static[i]) @ m.tilt[3 * i : 3 * i + 3] for i in range(count // 3)])
    force = (turned - np.diag(m.stiffness)) @ deflection - m.damping[:, None] * rate
    force[list(plant.freed), range(s.free_force.start, s.free_force.stop)] = m.mass
    parts, bodies = m.carried, 6 + plant.carried.count
    wrench = np.zeros((bodies, s.size))
    wrench[:6] = m.points.T @ force
    wrench[:, s.carried] -= parts.stiffness
    wrench[:, s.carried_rate] -= parts.damping
    accelerated = m.mobility @ wrench
    accel = accelerated[:6]
    gamma = np.zeros((count, count))
    gamma[0::3], gamma[1::3] = g * m.tilt[1::3], -g * m.tilt[0::3]
    lean = gamma @ deflection

    A = np.zeros((s.motion.stop, s.size))
    A[s.relative, s.relative_rate] = np.eye(6)
    A[s.carried, s.carried_rate] = np.eye(plant.carried.count)
    A[s.carried_rate] = accelerated[6:]
    A[s.relative_rate] = accel + np.linalg.solve(m.points.T @ m.points, m.points.T @ lean)
    A[s.relative_rate, s.base_accel] -= np.eye(6)
    A[s.deformation, s.deformation_rate] = A[s.deformation_rate, s.deformation_accel] = np.eye(n)

    relative = m.points @ A[s.relative_rate] + patterns @ A[s.deformation_rate]
    base = patterns @ (patterns.T @ lean - A[s.deformation_rate])
    base[:, s.base_accel] += m.points
    spin = np.tile(accel[3:], (count // 3, 1)) - m.tilt @ relative
    return Dynamics(m, A, deflection, force, accel, base, spin)
