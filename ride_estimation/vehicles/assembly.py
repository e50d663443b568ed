# Copyright 2026 ride_estimation contributors
"""Equations of motion of any set of rigid bodies on mounts, assembled from the vehicle file; no hand-derived matrices.

``M qdd = -G^T t(x, v) - K_g q + T theta_b + f``, ``x = G q - u``

q are small motions of the bodies' CGs about static equilibrium, x the deflections and t the tensions of the mount
components, u the prescribed base motion, K_g the stiffness gravity causes through the static loads, ``T theta_b`` what
a tilted base makes of them, f external loads.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.errors import ConfigurationError
from ride_estimation.frames import AXES, COORDINATES, skew
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.guided import body_rows, mass_matrix, point_rows
from ride_estimation.vehicles.tangent import tangent
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: largest part of the weight that may remain unsupported before the vehicle is refused
_UNSUPPORTED = 1e-6


@dataclasses.dataclass(frozen=True)
class Assembly:
    """The assembled vehicle. Q coordinates, C mount components, M mounts.

    Attributes
    ----------
    vehicle
        What it was assembled from.
    coordinates
        (body, coordinate) of each entry of q.
    components
        (mount, axis) of each entry of x, mounts in file order, axes in the order ``x y z roll pitch yaw``.
    elements
        The force element of each component.
    mass_matrix
        Shape (Q, Q) [kg, kg m, kg m^2].
    deflection_map
        G, shape (C, Q).
    prescribed
        Shape (C,) bool: the base of this component moves as prescribed (it is no body).
    geometric_stiffness
        K_g, shape (Q, Q): moment of the static loads under rotation (``-m g h`` of a CG h above its mounts).
    tilt_map
        T, shape (Q, M, 3): generalised force per small rotation of a prescribed base.
    static_tension
        Tension of each component at static equilibrium, shape (C,) [N, N m].
    static_force
        Force on the body by each mount at static equilibrium, shape (M, 3) [N].
    """

    vehicle: Vehicle
    coordinates: tuple[tuple[str, str], ...]
    components: tuple[tuple[str, str], ...]
    elements: tuple[ForceElement, ...]
    mass_matrix: Array
    deflection_map: Array
    prescribed: NDArray[np.bool_]
    geometric_stiffness: Array
    tilt_map: Array
    static_tension: Array
    static_force: Array

    @property
    def mount_names(self) -> tuple[str, ...]:
        """Return the mount names, the order of every (.., M, 3) array."""
        return self.vehicle.mount_names

    def component_index(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return (mount number, axis number 0 to 5) of each component, two arrays of shape (C,)."""
        names = self.mount_names
        return (
            np.array([names.index(m) for m, _ in self.components], dtype=np.int64),
            np.array([COORDINATES.index(a) for _, a in self.components], dtype=np.int64),
        )

    def point_map(self, body: str, position: Array) -> Array:
        """Return the (6, Q) map from q to the small motion (translation, rotation) of a point of a body.

        Parameters
        ----------
        position
            The point at static equilibrium, vehicle-file axes [m], shape (3,).
        """
        return point_rows(self.vehicle, self.coordinates, body, np.asarray(position, dtype=float))

    def with_elements(self, changes: dict[tuple[str, str], ForceElement]) -> Assembly:
        """Return the assembly with elements replaced, equilibrium positions kept and static loads shared anew."""
        return assemble(self.vehicle.replace_elements(changes))


def body_columns(coordinates: tuple[tuple[str, str], ...], body: str) -> dict[str, int]:
    """Return coordinate name -> index in q of one body."""
    return {c: i for i, (b, c) in enumerate(coordinates) if b == body}


def assemble(vehicle: Vehicle) -> Assembly:
    """Assemble the equations of motion of a vehicle.

    Raises
    ------
    ConfigurationError
        A body that no mount holds against its weight, unknown coordinates, a mount without body, a mass matrix that is
        not positive definite.
    """
    _check(vehicle)
    coordinates = tuple((b.name, c) for b in vehicle.bodies.values() for c in COORDINATES if c in b.coordinates)
    components = tuple(
        (m.name, axis) for m in vehicle.mounts.values() for axis in COORDINATES if axis in m.elements
    )
    elements = tuple(vehicle.mounts[m].elements[a] for m, a in components)
    mass_matrix = _mass_matrix(vehicle, coordinates)
    deflection_map = np.array([_deflection_row(vehicle, coordinates, m, a) for m, a in components])
    deflection_map = deflection_map.reshape(len(components), len(coordinates))
    static_tension = _static_tension(vehicle, coordinates, elements, mass_matrix, deflection_map)
    static_force = np.zeros((len(vehicle.mounts), 3))
    for tension, (mount, axis) in zip(static_tension, components):
        if axis in AXES:
            static_force[vehicle.mount_names.index(mount), AXES.index(axis)] = -tension
    stiffness, tilt = gravity_terms(vehicle, coordinates, static_force)
    return Assembly(
        vehicle=vehicle,
        coordinates=coordinates,
        components=components,
        elements=elements,
        mass_matrix=mass_matrix,
        deflection_map=deflection_map,
        prescribed=np.array([vehicle.mounts[m].base not in vehicle.bodies for m, _ in components], dtype=bool),
        geometric_stiffness=stiffness,
        tilt_map=tilt,
        static_tension=static_tension,
        static_force=static_force,
    )


def _check(vehicle: Vehicle) -> None:
    problems = []
    for body in vehicle.bodies.values():
        wrong = [c for c in body.coordinates if c not in COORDINATES]
        if wrong:
            problems.append(f"bodies.{body.name}.degrees_of_freedom: {wrong}; allowed: {', '.join(COORDINATES)}")
        if not body.mass.value > 0.0:
            problems.append(f"bodies.{body.name}.mass_kg: {body.mass.value:g}; allowed: greater than zero")
    for mount in vehicle.mounts.values():
        if mount.body not in vehicle.bodies:
            problems.append(f"mounts.{mount.name}.body: {mount.body!r}; allowed: {', '.join(vehicle.bodies)}")
        if mount.base == mount.body:
            problems.append(f"mounts.{mount.name}.base: {mount.base!r} is the body itself")
    if not any(b.coordinates for b in vehicle.bodies.values()):
        problems.append("bodies: no body has a free coordinate")
    if problems:
        raise ConfigurationError(problems, where=vehicle.name)


def _mass_matrix(vehicle: Vehicle, coordinates: tuple[tuple[str, str], ...]) -> Array:
    matrix = mass_matrix(vehicle, coordinates)
    if np.linalg.eigvalsh(matrix).min() <= 0.0:
        raise ConfigurationError("bodies: the mass matrix is not positive definite; check inertia_kg_m2", where=vehicle.name)
    return matrix


def _deflection_row(
    vehicle: Vehicle, coordinates: tuple[tuple[str, str], ...], mount_name: str, axis: str
) -> Array:
    """Return one row of G: motion of the body side minus motion of the base side along one axis."""
    mount = vehicle.mounts[mount_name]
    number = COORDINATES.index(axis)
    row = np.zeros(len(coordinates))
    for name, sign in ((mount.body, 1.0), (mount.base, -1.0)):
        if name in vehicle.bodies:
            row += sign * point_rows(vehicle, coordinates, name, mount.position)[number]
    return row


def _static_tension(
    vehicle: Vehicle,
    coordinates: tuple[tuple[str, str], ...],
    elements: tuple[ForceElement, ...],
    mass_matrix: Array,
    deflection_map: Array,
) -> Array:
    """Share the weight among the components by their stiffness at rest, equally where there is none."""
    weight = np.zeros(len(coordinates))
    for b in dict.fromkeys(b for b, _ in coordinates):  # on what it can move along, itself or with its carrier
        weight -= vehicle.bodies[b].mass.value * vehicle.gravity * body_rows(vehicle, coordinates, b)[2]
    if not np.any(weight) or not len(elements):
        return np.zeros(len(elements))
    stiffness = np.array([max(tangent(e)[0], 0.0) for e in elements])
    # an element without stiffness at rest (a damper) carries weight only where nothing else can
    weights = stiffness + 1e-9 * (stiffness.max() if stiffness.max() > 0.0 else 1.0)
    # in mass-weighted coordinates the least-squares solution is well scaled; tension from the factor, not from K
    root = np.sqrt(weights)
    scaled = root[:, None] * deflection_map
    scale = np.sqrt(np.diag(mass_matrix))
    solution, *_ = np.linalg.lstsq((scaled / scale).T, weight / scale, rcond=1e-11)
    tension: Array = root * solution
    residual = deflection_map.T @ tension - weight
    bad = np.abs(residual / scale) > _UNSUPPORTED * np.abs(weight / scale).max()
    if np.any(bad):
        names = ", ".join(sorted({coordinates[i][0] for i in np.flatnonzero(bad)}))
        raise ConfigurationError(
            f"mounts: nothing holds {names} against the weight; add mounts with a z element or free fewer coordinates",
            where=vehicle.name,
        )
    return tension


def _moment_of_turned_arm(arm: Array, force: Array) -> Array:
    """Return D with ``(theta x arm) x force = D theta``, shape (3, 3)."""
    return np.outer(arm, force) - float(arm @ force) * np.eye(3)


def gravity_terms(
    vehicle: Vehicle, coordinates: tuple[tuple[str, str], ...], static_force: Array
) -> tuple[Array, Array]:
    """Return (K_g, T): what the static loads do when bodies and bases turn.

    The static force F0 turns with the base and acts on both sides at the body-side point p: on the body
    ``M = (p - c) x R_b F0``, on the base the opposite about its own CG, so that no net moment is created.
    """
    size = len(coordinates)
    stiffness = np.zeros((size, size))
    tilt = np.zeros((size, len(vehicle.mounts), 3))
    for number, mount in enumerate(vehicle.mounts.values()):
        force = static_force[number]
        if not np.any(force):
            continue
        on_body = point_rows(vehicle, coordinates, mount.body, mount.position)
        turn_body = on_body[3:]
        turned_force = -skew(force)  # theta x F0 = -skew(F0) theta
        if mount.base in vehicle.bodies:
            on_base = point_rows(vehicle, coordinates, mount.base, mount.position)
            stiffness -= (on_body - on_base)[:3].T @ turned_force @ on_base[3:]
            # the point of action moves with the body, seen from the CG of the base
            base_cg = point_rows(vehicle, coordinates, mount.base, vehicle.bodies[mount.base].cg)
            moved = on_body[:3] - base_cg[:3]
            stiffness += on_base[3:].T @ (-skew(force)) @ moved
        else:
            tilt[:, number, :] = on_body[:3].T @ turned_force
        arm = mount.position - vehicle.bodies[mount.body].cg
        stiffness -= turn_body.T @ _moment_of_turned_arm(arm, force) @ turn_body
    return stiffness, tilt


def sensor_offset(vehicle: Vehicle, sensor: Sensor) -> Array:
    """Return the sensor position relative to what carries it: the body's CG, or the mount of a prescribed base [m]."""
    if sensor.body in vehicle.bodies:
        return np.asarray(sensor.position - vehicle.bodies[sensor.body].cg, dtype=float)
    return np.asarray(sensor.position - vehicle.mounts[sensor.mount].position, dtype=float)
