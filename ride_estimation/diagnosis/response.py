# Copyright 2026 ride_estimation contributors
"""Frequency response of the linear plant: from measured inputs and from forces at the ports to the outputs."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.plant import Plant

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclasses.dataclass(frozen=True)
class LinearResponse:
    """Transfer functions at F frequencies; those that only the noise of a run is told from are made when asked for.

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
    output_from_wrench, output_from_input
        Shapes (F, ny, n), (F, ny, nu).
    output_from_port
        From a tension in a port, shape (F, ny, P).
    deflection_from_port
        Shape (F, P, P).
    base_from_input
        Shape (F, nb, nu).
    """

    plant: Plant
    omega: Array
    coordinate_from_wrench: ComplexArray
    coordinate_from_base: ComplexArray
    output_from_coordinate: ComplexArray
    output_from_wrench: ComplexArray
    output_from_input: ComplexArray
    output_from_port: ComplexArray
    deflection_from_port: ComplexArray
    base_from_input: ComplexArray

    @property
    def output_from_base(self) -> ComplexArray:
        """Return the outputs from base acceleration, shape (F, ny, nb)."""
        direct = self.plant.out_base * (-1.0 / (self.omega**2)[:, None, None])
        return np.asarray(self.output_from_coordinate @ self.coordinate_from_base + direct)

    @property
    def deflection_from_base(self) -> ComplexArray:
        """Return the deflections of the ports from base acceleration, shape (F, P, nb)."""
        direct = self.plant.port_base * (-1.0 / (self.omega**2)[:, None, None])
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
    displacement_from_acceleration = -1.0 / w2
    q_base: ComplexArray = compliance @ (loaded @ plant.port_base) * displacement_from_acceleration
    y_q: Array = -w2 * plant.out_acceleration + plant.out_displacement
    y_wrench: ComplexArray = y_q @ compliance
    y_base: ComplexArray = y_q @ q_base + plant.out_base * displacement_from_acceleration
    slope = plant.slope
    base_input = (
        plant.base_direct + plant.lever_motion(slope) + plant.gravity_tilt(slope) * displacement_from_acceleration
    )
    return LinearResponse(
        plant=plant,
        omega=omega,
        coordinate_from_wrench=compliance,
        coordinate_from_base=q_base,
        output_from_coordinate=y_q.astype(complex),
        output_from_wrench=y_wrench,
        output_from_input=y_base @ base_input,
        output_from_port=-y_wrench @ plant.port_map.T,
        deflection_from_port=-(plant.port_map @ compliance) @ plant.port_map.T,
        base_from_input=base_input.astype(complex),
    )
