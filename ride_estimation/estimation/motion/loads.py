# Copyright 2026 ride_estimation contributors
"""Inertial loads at the CG: force, moment with full inertia tensor and gyroscopic term, covariance."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.block_math import cross
from ride_estimation.frames import skew
from ride_estimation.jit import compile_kernel
from ride_estimation.vehicles.vehicle import Body

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class InertialLoads:
    """Mass properties that turn motion into loads.

    Attributes
    ----------
    mass, mass_std
        [kg].
    inertia
        About the CG, shape (3, 3) [kg m^2].
    inertia_relative_std
        Relative standard deviation of the inertia, 0 where not stated.
    cg_std
        Standard deviation of the CG position, shape (3,) [m], zero where not stated.
    cg_offset
        Of the CG from its place in the file, which motion and loads refer to, shape (3,) [m].
    """

    mass: float
    mass_std: float
    inertia: Array
    inertia_relative_std: float = 0.0
    cg_std: Array = dataclasses.field(default_factory=lambda: np.zeros(3))
    cg_offset: Array = dataclasses.field(default_factory=lambda: np.zeros(3))

    @classmethod
    def of(cls, body: Body) -> InertialLoads:
        """Return the loads of a body of the vehicle file."""
        std = np.zeros(3) if body.cg_std is None else np.asarray(body.cg_std, dtype=float)
        inertia = np.asarray(body.inertia, dtype=float)
        return cls(body.mass.value, body.mass.std or 0.0, inertia, body.inertia_relative_std or 0.0, std)

    def moments(self, body: Body) -> dict[str, dict[str, float]]:
        """Return the moments of inertia in use and those of the file, by name [kg m^2].

        The standard deviation holds that of the mass and the largest of the three moments, as the loads do.
        """
        std = float(np.hypot(self.inertia_relative_std, self.mass_std / self.mass))
        pairs = zip(("ixx", "iyy", "izz"), np.diag(self.inertia), np.diag(body.inertia), strict=True)
        return {name: {"value": float(v), "std": float(std * v), "file": float(file)} for name, v, file in pairs}

    def load(self, accel: Array, rate: Array) -> Array:
        """Return force and moment at the place of the CG in the file.

        ``F = m a``, ``M = J alpha + omega x J omega`` (document 000 eq. (5) with the term it omits); a CG at an offset d adds
        ``m (alpha x d + omega x (omega x d))`` to the force and ``d x F`` to the moment.

        Parameters
        ----------
        accel
            Linear and angular acceleration, shape (K, 6); with specific force instead of acceleration the force is the
            one the supports carry, weight included.
        rate
            Angular rate [rad/s], shape (K, 3).
        """
        load = np.empty((len(accel), 6))
        _load(accel, rate, self.mass, self.inertia, load)
        if self.cg_offset.any():
            load[:, :3] += self.mass * (cross(accel[:, 3:], self.cg_offset) + cross(rate, cross(rate, self.cg_offset)))
            load[:, 3:] += cross(self.cg_offset, load[:, :3])
        return load

    def covariance_of_cg(self, motion: Array, gravity: float) -> tuple[Array, Array]:
        """Return the covariance of the wrench the mounts carry from an uncertain CG: by the weight, by what moves, (6, 6) each.

        An offset d of the CG adds ``m alpha x d`` to the force and ``d x F`` to the moment about the CG of the file.

        Parameters
        ----------
        motion
            Specific force and angular acceleration, shape (6,).
        gravity
            [m/s^2].
        """
        weight = np.array([0.0, 0.0, self.mass * gravity])
        jacobians = np.zeros((2, 6, 3))
        jacobians[0, 3:] = -skew(weight)
        jacobians[1, :3], jacobians[1, 3:] = self.mass * skew(motion[3:]), -skew(self.mass * motion[:3] - weight)
        variance = self.cg_std**2
        still, moving = ((j * variance) @ j.T for j in jacobians)
        return still, moving

    def covariance(self, accel_covariance: Array, accel: Array) -> Array:
        """Return the covariance of the load, shape (6, 6), at one tick.

        Parameters
        ----------
        accel_covariance
            Shape (6, 6).
        accel
            Motion at the tick, shape (6,): mass and inertia errors scale with it.
        """
        result = np.empty((6, 6))
        spread = np.array([self.mass_std**2, self.inertia_relative_std**2])
        _load_covariance(accel_covariance, accel, self.mass, self.inertia, spread, result)
        return result


@compile_kernel
def _load(accel: Array, rate: Array, mass: float, inertia: Array, load: Array) -> None:
    """Write force and moment (K, 6) of a motion; see :meth:`InertialLoads.load`."""
    momentum = np.empty(3)
    for k in range(accel.shape[0]):
        for i in range(3):
            load[k, i] = mass * accel[k, i]
            momentum[i] = inertia[i, 0] * rate[k, 0] + inertia[i, 1] * rate[k, 1] + inertia[i, 2] * rate[k, 2]
            load[k, 3 + i] = inertia[i, 0] * accel[k, 3] + inertia[i, 1] * accel[k, 4] + inertia[i, 2] * accel[k, 5]
        for i in range(3):
            j, n = (i + 1) % 3, (i + 2) % 3
            load[k, 3 + i] += rate[k, j] * momentum[n] - rate[k, n] * momentum[j]


@compile_kernel
def _load_covariance(
    covariance: Array, accel: Array, mass: float, inertia: Array, spread: Array, result: Array
) -> None:
    """Write the covariance (6, 6) of a load.

    Parameters
    ----------
    covariance, accel, mass, inertia
        As for :meth:`InertialLoads.covariance`.
    spread
        Variance of the mass, relative variance of the inertia.
    result
        Output.
    """
    matrix = np.zeros((6, 6))
    moment = np.zeros(3)
    for i in range(3):
        matrix[i, i] = mass
        for j in range(3):
            matrix[3 + i, 3 + j] = inertia[i, j]
            moment[i] += inertia[i, j] * accel[3 + j]
    half = np.zeros((6, 6))
    for i in range(6):
        for j in range(6):
            for n in range(6):
                half[i, j] += matrix[i, n] * covariance[n, j]
    for i in range(6):
        for j in range(i, 6):
            total = 0.0
            for n in range(6):
                total += 0.5 * (half[i, n] * matrix[j, n] + half[j, n] * matrix[i, n])
            if j < 3:
                total += spread[0] * accel[i] * accel[j]
            elif i >= 3:
                total += spread[1] * moment[i - 3] * moment[j - 3]
            result[i, j] = total
            result[j, i] = total
