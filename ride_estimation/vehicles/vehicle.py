# Copyright 2026 ride_estimation contributors
"""What a vehicle file says, as frozen objects: bodies, mounts, sensors, force references."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.frames import COORDINATES
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.data_range import DataRange

Array = NDArray[np.float64]

STANDARD_GRAVITY = 9.80665  # m/s^2, CGPM 1901


@dataclasses.dataclass(frozen=True)
class Prior:
    """A number and how well it is known: standard deviation and range in the unit of the number."""

    value: float
    std: float | None = None
    lower: float = -np.inf
    upper: float = np.inf
    source: str = ""


@dataclasses.dataclass(frozen=True)
class Body:
    """A rigid body.

    Attributes
    ----------
    mass
        [kg].
    cg
        Centre of gravity [m], shape (3,), vehicle-file axes; the position at static equilibrium.
    inertia
        Full tensor about the CG [kg m^2], shape (3, 3).
    inertia_relative_std
        Relative standard deviation of the inertia, None where not stated.
    cg_std
        Standard deviation of the CG position per axis [m], shape (3,), None where not stated.
    coordinates
        Free coordinates, a subset of ``x y z roll pitch yaw``.
    """

    name: str
    mass: Prior
    cg: Array
    inertia: Array
    inertia_relative_std: float | None = None
    cg_std: Array | None = None
    coordinates: tuple[str, ...] = COORDINATES
    source: str = ""


@dataclasses.dataclass(frozen=True)
class Mount:
    """A connection between a body and a base at one point, one force element per axis.

    Attributes
    ----------
    position
        Attachment point [m], shape (3,), at static equilibrium.
    body
        Body the published force acts on.
    base
        Another body, or a name that is no body (``chassis``, ``road``): then the base motion is prescribed (measured).
    elements
        Force element by axis (``x y z`` and, where given, ``roll pitch yaw``), axes of the vehicle file. Deflection zero
        is static equilibrium under own weight.
    priors
        What is known of each element parameter: (axis, parameter name) -> Prior.
    static_load
        Vertical force on the body at rest [N], None where nobody weighed it.
    seen
        What the data showed that the element of an axis was identified from, by axis.
    """

    name: str
    position: Array
    body: str
    base: str
    elements: Mapping[str, ForceElement]
    priors: Mapping[tuple[str, str], Prior] = dataclasses.field(default_factory=dict)
    static_load: Prior | None = None
    seen: Mapping[str, DataRange] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class ForceReference:
    """What anchors forces and masses in absolute terms.

    Attributes
    ----------
    kind
        ``known_mass``, ``known_stiffness``, ``load_cell``, ``air_spring_pressure`` or ``known_added_mass``.
    body, mount, axis
        What it refers to.
    details
        Numbers of the reference in SI (``std``, ``mass``, ``area``, ``from_s``, ...), checked by the loader.
    """

    kind: str
    body: str = ""
    mount: str = ""
    axis: str = ""
    sensor: str = ""
    details: Mapping[str, Any] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True, repr=False)
class Vehicle:
    """One vehicle file: everything the estimator, the simulation and the diagnosis know beforehand."""

    name: str
    bodies: Mapping[str, Body]
    mounts: Mapping[str, Mount]
    sensors: Mapping[str, Sensor]
    force_references: tuple[ForceReference, ...] = ()
    gravity: float = STANDARD_GRAVITY
    description: str = ""
    checksum: str = ""

    def __repr__(self) -> str:
        bodies = ", ".join(f"{name} {body.mass.value:g} kg" for name, body in self.bodies.items())
        return f"Vehicle({self.name}: {bodies}; {len(self.mounts)} mounts, {len(self.sensors)} sensors)"

    @property
    def mount_names(self) -> tuple[str, ...]:
        """Return the mount names in file order, the order of every (.., M, 3) array."""
        return tuple(self.mounts)

    @property
    def weight(self) -> float:
        """Return the weight of all bodies together [N]."""
        return self.gravity * sum(body.mass.value for body in self.bodies.values())

    def with_noise_scaled(self, factor: float) -> Vehicle:
        """Return a copy whose sensors are noisier by a factor, the vehicle itself for 1."""
        if factor == 1.0:
            return self
        louder = {
            name: dataclasses.replace(s, noise_std=factor * s.noise_std, gyro_noise_std=factor * s.gyro_noise_std)
            for name, s in self.sensors.items()
        }
        return dataclasses.replace(self, sensors=louder)

    def replace_elements(self, changes: Mapping[tuple[str, str], ForceElement]) -> Vehicle:
        """Return a copy with the elements at some (mount, axis) replaced."""
        mounts = dict(self.mounts)
        for (mount, axis), element in changes.items():
            old = mounts[mount]
            mounts[mount] = dataclasses.replace(old, elements={**old.elements, axis: element})
        return dataclasses.replace(self, mounts=mounts)
