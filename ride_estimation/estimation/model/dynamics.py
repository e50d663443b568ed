# Copyright 2026 ride_estimation contributors
"""Equations of motion: Newton-Euler of the body on its mounts, coloured motion of the base; continuous and discrete.

``D = P q + U z`` deflections of the mounts (q rigid relative motion, z deformation of the base), force on the body in its axes
``F = F0 - K D - C D' + F0 x turn(D)`` (mount axes follow the brackets), specific force at the CG ``f = M^-1 P^T (F - F0)``.
A point of the body and its bracket share gravity up to the rotation between them, ``Gamma D`` = g (turn_y, -turn_x, 0), so
``q'' = f + P^+ Gamma D - r`` with r the rigid specific force of the base.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy.linalg as sl
from numpy.typing import NDArray

from ride_estimation.estimation.model.plant import Constants, Plant
from ride_estimation.frames import skew

Array = NDArray[np.float64]

#: damping ratio of the shaping filters: flat to their corner
ZETA = 0.7
#: corners of the coloured accelerations of deformation and rigid base [Hz]; readings carry little above
_DEFORMATION_CORNER, _BASE_CORNER = 25.0, 15.0
#: below these the rigid base does not accelerate [Hz], x y z roll pitch yaw; into x and y gravity leaks with a slope
_REST = np.array([0.02, 0.02, 0.1, 0.1, 0.1, 0.1])


@dataclasses.dataclass(frozen=True)
class Dynamics:
    """Continuous-time model ``x' = A x + w`` and rows that follow from it.

    Attributes
    ----------
    A
        Shape (N, N).
    deflection
        Deflections of the mounts, shape (3 M, N) [m].
    force
        Moving force of the mounts on the body, shape (3 M, N) [N].
    accel
        Specific force and angular acceleration at the CG without the static part, shape (6, N).
    base
        Specific force of the brackets at the mounts, bracket axes, without the static part, shape (3 M, N).
    spin
        Angular acceleration of the brackets, shape (3 M, N) [rad/s^2].
    """

    A: Array
    deflection: Array
    force: Array
    accel: Array
    base: Array
    spin: Array


def dynamics(plant: Plant, m: Constants) -> Dynamics:
    """Return the continuous-time model of a plant with given constants."""
    s, patterns, g = plant.states, plant.patterns, plant.gravity
    size, count, n = s.size, patterns.shape[0], patterns.shape[1]
    one, ones = np.eye(6), np.eye(n)
    deflection, rate = np.zeros((2, count, size))
    deflection[:, s.relative], deflection[:, s.deformation] = m.points, patterns
    rate[:, s.relative_rate], rate[:, s.deformation_rate] = m.points, patterns
    turned = np.vstack([skew(m.static[i]) @ m.tilt[3 * i : 3 * i + 3] for i in range(count // 3)])
    force = (turned - np.diag(m.stiffness)) @ deflection - m.damping[:, None] * rate
    accel = m.mobility @ m.points.T @ force
    gamma = np.zeros((count, count))
    gamma[0::3], gamma[1::3] = g * m.tilt[1::3], -g * m.tilt[0::3]
    rigid = np.linalg.pinv(m.points)

    A = np.zeros((size, size))
    A[s.relative, s.relative_rate] = one
    A[s.relative_rate] = accel + rigid @ gamma @ deflection
    A[s.relative_rate, s.base_accel] -= one
    corner = 2.0 * np.pi * np.where(plant.vertical, m.corners[1], m.corners[0])
    square, damp = np.diag(corner**2), np.diag(2.0 * ZETA * corner)
    for row in (s.deformation_rate, s.shaping_rate):
        A[row, s.deformation_drive], A[row, s.shaping_rate], A[row, s.shaping] = ones, -damp, -square
        A[row, s.base_accel] = m.coupling
    A[s.deformation_rate, s.deformation_rate], A[s.deformation_rate, s.deformation] = -damp, -square
    A[s.deformation, s.deformation_rate] = A[s.shaping, s.shaping_rate] = ones
    A[s.deformation_drive, s.deformation_drive_rate] = ones
    wide = 2.0 * np.pi * _DEFORMATION_CORNER
    A[s.deformation_drive_rate, s.deformation_drive] = -(wide**2) * ones
    A[s.deformation_drive_rate, s.deformation_drive_rate] = -2.0 * ZETA * wide * ones
    # (p + rest) (p^2 + 2 zeta high p + high^2) base_velocity = white noise; its rate is the acceleration of the base
    high, rest = 2.0 * np.pi * _BASE_CORNER, 2.0 * np.pi * _REST
    A[s.base_velocity, s.base_accel] = A[s.base_accel, s.base_accel_rate] = one
    A[s.base_accel_rate, s.base_accel_rate] = -np.diag(rest + 2.0 * ZETA * high)
    A[s.base_accel_rate, s.base_accel] = -np.diag(high**2 + 2.0 * ZETA * high * rest)
    A[s.base_accel_rate, s.base_velocity] = -np.diag(rest * high**2)

    relative = m.points @ A[s.relative_rate] + patterns @ A[s.deformation_rate]
    base = patterns @ (patterns.T @ gamma @ deflection - A[s.deformation_rate])
    base[:, s.base_accel] += m.points
    spin = np.tile(accel[3:], (count // 3, 1)) - m.tilt @ relative
    return Dynamics(A, deflection, force, accel, base, spin)


def diffusion(plant: Plant, m: Constants) -> Array:
    """Return the density of the white noise that drives base and deformation, shape (N, N)."""
    s = plant.states
    wide, high = 2.0 * np.pi * _DEFORMATION_CORNER, 2.0 * np.pi * _BASE_CORNER
    density = np.zeros(s.size)
    # variance of a second-order low-pass driven by white noise of density d: d / (4 zeta w^3)
    density[s.deformation_drive_rate] = 4.0 * ZETA * wide**3 * m.deforming**2
    density[s.base_accel_rate] = 4.0 * ZETA * high**3 * m.rigid**2
    return np.diag(density)


def transition(A: Array, dt: float) -> Array:
    """Return ``exp(A dt)``."""
    return np.asarray(sl.expm(A * dt))


def discretise(A: Array, density: Array, dt: float) -> tuple[Array, Array]:
    """Return transition and covariance of the process noise over one sample (van Loan, IEEE Trans. Autom. Control 23, 1978)."""
    n = len(A)
    e = sl.expm(np.block([[-A, density], [np.zeros((n, n)), A.T]]) * dt)
    f = e[n:, n:].T
    q = f @ e[:n, n:]
    return np.asarray(f), 0.5 * (q + q.T)
