# Copyright 2026 ride_estimation contributors
"""Frequency response of the linear plant: from measured inputs and from forces at the ports to the outputs."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.model.plant import Plant

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclasses.dataclass(frozen=True)
class LinearResponse:
    """Transfer functions at F frequencies; those that few numbers make are made when asked for.

    A search holds some ten models at once.

    Attributes
    ----------
    plant
        Matrices.
    omega
        Angular frequencies [rad/s], shape (F,), without zero.
    coordinate_from_wrench
        Shape (F, n, n).
    coordinate_from_base
        From base acceleration, shape (F, n, nb).
    """

    plant: Plant
    omega: Array
    coordinate_from_wrench: ComplexArray
    coordinate_from_base: ComplexArray

    @property
    def twice_integrated(self) -> Array:
        """Return ``-1 / w^2``, shape (F, 1, 1)."""
        return np.asarray(-1.0 / (self.omega**2)[:, None, None])

    def coordinates(self, base: NDArray[Any], wrench: NDArray[Any]) -> ComplexArray:
        """Return the coordinates under base accelerations (F, nb, q) and wrenches (F, n, q), shape (F, n, q)."""
        return np.asarray(self.coordinate_from_base @ base + self.coordinate_from_wrench @ wrench)

    def outputs(self, coordinates: NDArray[Any], base: NDArray[Any] | None = None) -> NDArray[Any]:
        """Return the outputs of coordinates (F, n, q) and base accelerations (F, nb, q), none where None, shape (F, ny, q)."""
        plant = self.plant
        out = plant.out_acceleration @ (coordinates / self.twice_integrated)
        if np.any(plant.out_rate):
            out = out + plant.out_rate @ (1j * self.omega[:, None, None] * coordinates)
        if np.any(plant.out_displacement):
            out += plant.out_displacement @ coordinates
        if base is not None and np.any(plant.out_base):
            out += plant.out_base @ (base * self.twice_integrated)
        return np.asarray(out)

    def deflections(self, coordinates: NDArray[Any], base: NDArray[Any]) -> NDArray[Any]:
        """Return the deflections of the ports, shape (F, P, q), from what :meth:`outputs` takes."""
        return np.asarray(self.plant.port_map @ coordinates - self.plant.port_base @ (base * self.twice_integrated))

    @property
    def output_from_coordinate(self) -> NDArray[Any]:
        """Return the outputs from the coordinates, shape (F, ny, n)."""
        return self.outputs(np.broadcast_to(np.eye(len(self.plant.coordinates)), self.coordinate_from_wrench.shape))

    @functools.cached_property
    def output_from_wrench(self) -> ComplexArray:
        """Return the outputs from a wrench on the coordinates, shape (F, ny, n)."""
        return self.outputs(self.coordinate_from_wrench)

    @property
    def base_from_input(self) -> Array:
        """Return the base accelerations from the measured inputs, shape (F, nb, nu)."""
        plant = self.plant
        tilt = plant.gravity_tilt(plant.slope) * self.twice_integrated
        return np.asarray(plant.base_direct + plant.lever_motion(plant.slope) + tilt)

    @functools.cached_property
    def output_from_input(self) -> ComplexArray:
        """Return the outputs from the measured inputs, shape (F, ny, nu); every error of a base sensor asks for them.

        Static loads turn with their brackets, whose tilt the inputs show.
        """
        base = self.base_from_input
        return self.outputs(self.coordinates(base, self.plant.static_tilt() * self.twice_integrated), base)

    @property
    def output_from_port(self) -> ComplexArray:
        """Return the outputs from a tension in a port, shape (F, ny, P)."""
        return np.asarray(-self.output_from_wrench @ self.plant.port_map.T)

    @property
    def deflection_from_port(self) -> ComplexArray:
        """Return the deflections from a tension in a port, shape (F, P, P)."""
        return np.asarray(-self.plant.port_map @ self.coordinate_from_wrench @ self.plant.port_map.T)


def respond(plant: Plant, stiffness: Array, damping: Array, omega: Array) -> LinearResponse:
    """Return the transfer functions of the plant.

    ``(-w^2 M + K_g + D^T (k + i w c) D) q = D^T (k + i w c) E w_base + wrench``.

    Parameters
    ----------
    plant
        Matrices.
    stiffness, damping
        Of every port, shape (P,).
    omega
        Angular frequencies [rad/s], shape (F,), without zero.
    """
    w2 = (omega**2)[:, None, None]
    modulus = stiffness + 1j * omega[:, None] * damping
    loaded = plant.port_map.T[None] * modulus[:, None, :]
    dynamic = -w2 * plant.mass + plant.gravity_stiffness + loaded @ plant.port_map
    compliance: ComplexArray = np.linalg.inv(dynamic.astype(complex))
    return LinearResponse(plant, omega, compliance, compliance @ (loaded @ plant.port_base) * (-1.0 / w2))
