# Copyright 2026 ride_estimation contributors
"""Inertial loads at the CG: force, moment with full inertia tensor and gyroscopic term, covariance."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.block_math import cross
from ride_estimation.frames import skew
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
    """

    mass: float
    mass_std: float
    inertia: Array
    inertia_relative_std: float = 0.0

    @classmethod
    def of(cls, body: Body) -> InertialLoads:
        """Return the loads of a body of the vehicle file."""
        return cls(body.mass.value, body.mass.std or 0.0, np.asarray(body.inertia, dtype=float), body.inertia_relative_std or 0.0)

    def load(self, accel: Array, rate: Array) -> Array:
        """Return force and moment at the CG.

        ``F = m a``, ``M = J alpha + omega x J omega`` (document 000 eq. (5) with the term it omits).

        Parameters
        ----------
        accel
            Linear and angular acceleration, shape (K, 6); with specific force instead of acceleration the force is the
            one the supports carry, weight included.
        rate
            Angular rate [rad/s], shape (K, 3).
        """
        load = np.empty_like(accel)
        load[:, :3] = self.mass * accel[:, :3]
        load[:, 3:] = accel[:, 3:] @ self.inertia.T + cross(rate, rate @ self.inertia.T)
        return load

    def covariance(self, accel_covariance: Array, accel: Array, rate: Array, rate_variance: float = 0.0) -> Array:
        """Return the covariance of the load, shape (6, 6), at one tick.

        Parameters
        ----------
        accel_covariance
            Shape (6, 6).
        accel, rate
            Motion at the tick, shapes (6,) and (3,): mass and inertia errors scale with it.
        rate_variance
            Variance of each component of the angular rate [(rad/s)^2].
        """
        mass_matrix = np.zeros((6, 6))
        mass_matrix[:3, :3] = self.mass * np.eye(3)
        mass_matrix[3:, 3:] = self.inertia
        result = mass_matrix @ accel_covariance @ mass_matrix.T
        result[:3, :3] += self.mass_std**2 * np.outer(accel[:3], accel[:3])
        moment = self.inertia @ accel[3:]
        result[3:, 3:] += self.inertia_relative_std**2 * np.outer(moment, moment)
        if rate_variance > 0.0:
            jacobian = skew(rate) @ self.inertia - skew(self.inertia @ rate)
            result[3:, 3:] += rate_variance * jacobian @ jacobian.T
        return np.asarray(0.5 * (result + result.T))
