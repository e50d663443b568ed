# Copyright 2026 ride_estimation contributors
"""A vehicle with a load on it: mass, centre of gravity and inertia of the body that carries it."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError
from ride_estimation.vehicles.vehicle import Vehicle
from ride_estimation.vehicles.weighed_loads import carried

Array = NDArray[np.float64]


def with_payload(vehicle: Vehicle, body: str, mass: float, position: Array | None = None) -> Vehicle:
    """Return a vehicle whose body carries a point mass ``m`` at ``p``.

    With the body's own mass ``M``, CG ``c`` and inertia ``I``: ``M' = M + m``, ``c' = (M c + m p) / M'``,
    ``I' = I + (M m / M') (|r|^2 1 - r r^T)`` with ``r = p - c`` (parallel axes; the two terms of body and load together).
    Static loads of the mounts below were weighed without it and are left out.

    Parameters
    ----------
    vehicle
        As its file says.
    body
        Body that carries the load.
    mass
        Of the load [kg]; negative for something that was taken off.
    position
        Of the load [m], shape (3,), vehicle-file axes; the CG of the body by default.

    Raises
    ------
    ConfigurationError
        Nothing or less than a tenth of the body would be left.
    """
    old = vehicle.bodies[body]
    own, total = old.mass.value, old.mass.value + mass
    if not total > 0.1 * own:
        raise ConfigurationError(f"payload of {mass:g} kg: {body} has {own:g} kg, so that {total:g} kg would be left")
    arm = np.zeros(3) if position is None else np.asarray(position) - old.cg
    about_cg = own * mass / total * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    moved = dataclasses.replace(
        old, cg=old.cg + mass / total * arm, inertia=old.inertia + about_cg,
        mass=dataclasses.replace(old.mass, value=total, lower=old.mass.lower + mass, upper=old.mass.upper + mass),
    )  # fmt: skip
    mounts = {
        name: dataclasses.replace(m, static_load=None) if body in carried(vehicle, m.body) else m
        for name, m in vehicle.mounts.items()
    }
    return dataclasses.replace(vehicle, bodies={**vehicle.bodies, body: moved}, mounts=mounts)
