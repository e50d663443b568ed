# Copyright 2026 ride_estimation contributors
"""Inertia tensors from CAD: units, rotation, parallel axes, sum of parts (document 001 row 1-10)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ride_estimation.errors import ConfigurationError
from ride_estimation.units import SUFFIXES

Array = NDArray[np.float64]

#: radius of gyration of a seat, cab, machine or truck body lies between these [m]
GYRATION_RANGE = (0.01, 20.0)


def inertia_to_si(tensor: ArrayLike, unit: str, mass: float) -> Array:
    """Return a tensor in kg m^2 and refuse one whose radius of gyration no vehicle has.

    Document 000 prints 7.3e8 "kg m^2" for a cab of 1200 kg: a radius of gyration of 780 m; it means kg mm^2.

    Parameters
    ----------
    tensor
        Shape (3, 3).
    unit
        ``kg m^2`` or ``kg mm^2``.
    mass
        [kg].

    Raises
    ------
    ConfigurationError
        Unknown unit, or a radius of gyration outside 0.01 to 20 m, with the unit that would fit.
    """
    factors = {u: f for u, f in SUFFIXES.values() if u in ("kg m^2", "kg mm^2")}
    if unit not in factors:
        raise ConfigurationError(f"unit {unit!r} of an inertia is unknown; allowed: {', '.join(factors)}")
    given = np.asarray(tensor, dtype=float)
    for axis, entry in zip("xyz", np.diag(given)):
        radius = math.sqrt(abs(float(entry)) * factors[unit] / mass)
        if not _plausible(radius):
            fitting = [u for u, f in factors.items() if _plausible(math.sqrt(abs(float(entry)) * f / mass))]
            hint = f"; in {fitting[0]} it would be plausible" if fitting else ""
            raise ConfigurationError(
                f"inertia i{axis}{axis} = {entry:g} {unit} with {mass:g} kg is a radius of gyration of {radius:.3g} m, "
                f"possible are {GYRATION_RANGE[0]} to {GYRATION_RANGE[1]} m{hint}"
            )
    return np.asarray(given * factors[unit])


def _plausible(radius: float) -> bool:
    return GYRATION_RANGE[0] <= radius <= GYRATION_RANGE[1]


def rotated(tensor: ArrayLike, rotation: ArrayLike) -> Array:
    """Return ``R J R^T``: the tensor in parent axes when R takes body components to parent components."""
    r = np.asarray(rotation, dtype=float)
    return np.asarray(r @ np.asarray(tensor, dtype=float) @ r.T)


def shifted(tensor: ArrayLike, mass: float, offset: ArrayLike) -> Array:
    """Return the tensor about a point at ``offset`` [m] from the CG: ``J + m (|d|^2 I - d d^T)`` (parallel axes)."""
    d = np.asarray(offset, dtype=float)
    return np.asarray(np.asarray(tensor, dtype=float) + mass * (float(d @ d) * np.eye(3) - np.outer(d, d)))


def combined(parts: Sequence[tuple[float, ArrayLike, ArrayLike]]) -> tuple[float, Array, Array]:
    """Return (mass, CG, tensor about the CG) of parts given as (mass [kg], CG [m], tensor about its own CG [kg m^2])."""
    if not parts or any(m <= 0.0 for m, _, _ in parts):
        raise ConfigurationError("at least one part with positive mass is needed")
    mass = sum(m for m, _, _ in parts)
    cg = sum((m * np.asarray(c, dtype=float) for m, c, _ in parts), np.zeros(3)) / mass
    tensor = sum((shifted(j, m, np.asarray(c, dtype=float) - cg) for m, c, j in parts), np.zeros((3, 3)))
    return mass, np.asarray(cg), np.asarray(tensor)
