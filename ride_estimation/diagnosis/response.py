# Copyright 2026 ride_estimation contributors
"""Frequency response of the linear plant: from measured inputs and from forces at the ports to the outputs."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.plant import Plant

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
    output_from_coordinate
        Shape (F, ny, n).
    output_from_wrench
        Shape (F, ny, n).
    """

    plant: Plant
    omega: Array
    coordinate_from_wrench: ComplexArray
    coordinate_from_base: ComplexArray
    output_from_coordinate: Array
    output_from_wrench: ComplexArray

    @property
    def _displacement_from_acceleration(self) -> Array:
        """Return ``-1 / w^2``, shape (F, 1, 1)."""
        return np.asarray(-1.0 / (self.omega**2)[:, None, None])

    @property
    def base_from_input(self) -> Array:
        """Return the base accelerations from the measured inputs, shape (F, nb, nu)."""
        plant = self.plant
        tilt = plant.gravity_tilt(plant.slope) * self._displacement_from_acceleration
        return np.asarray(plant.base_direct + plant.lever_motion(plant.slope) + tilt)

    @property
    def output_from_base(self) -> ComplexArray:
        """Return the outputs from base acceleration, shape (F, ny, nb)."""
        direct = self.plant.out_base * self._displacement_from_acceleration
        return np.asarray(self.output_from_coordinate @ self.coordinate_from_base + direct)

    @functools.cached_property
    def output_from_input(self) -> ComplexArray:
        """Return the outputs from the measured inputs, shape (F, ny, nu); every error of a base sensor asks for them."""
        return np.asarray(self.output_from_base @ self.base_from_input)

    @property
    def output_from_port(self) -> ComplexArray:
        """Return the outputs from a tension in a port, shape (F, ny, P)."""
        return np.asarray(-self.output_from_wrench @ self.plant.port_map.T)

    @property
    def deflection_from_port(self) -> ComplexArray:
        """Return the deflections from a tension in a port, shape (F, P, P)."""
        return np.asarray(-self.deflection_from_wrench @ self.plant.port_map.T)

    @property
    def deflection_from_base(self) -> ComplexArray:
        """Return the deflections of the ports from base acceleration, shape (F, P, nb)."""
        direct = self.plant.port_base * self._displacement_from_acceleration
        return np.asarray(self.plant.port_map @ self.coordinate_from_base - direct)

    @property
    def deflection_from_wrench(self) -> ComplexArray:
        """Return the deflections of the ports from a wrench on the coordinates, shape (F, P, n)."""
        return np.asarray(self.plant.port_map @ self.coordinate_from_wrench)


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
    y_q: Array = -w2 * plant.out_acceleration + plant.out_displacement
    return LinearResponse(
        plant=plant,
        omega=omega,
        coordinate_from_wrench=compliance,
        coordinate_from_base=compliance @ (loaded @ plant.port_base) * (-1.0 / w2),
        output_from_coordinate=y_q,
        output_from_wrench=y_q @ compliance,
    )
