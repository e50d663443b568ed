# Copyright 2026 ride_estimation contributors
"""The estimated body, its mounts and the sensors around it, as arrays: everything that does not change during a run."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError
from ride_estimation.frames import COORDINATES, skew
from ride_estimation.sensors.installation import pooled
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.modes import unheld_motions
from ride_estimation.vehicles.prior import TWIST_SHARE
from ride_estimation.vehicles.vehicle import Body, Mount, Vehicle
from ride_estimation.vehicles.weighed_loads import contradiction

Array = NDArray[np.float64]

ACCELEROMETERS = ("accelerometer", "imu")
#: distance of a base sensor from its mount that matters [m]
AWAY = 0.02
#: extent across their longest line that base sensors need to determine the rotation of the frame [m]
LEAST_SPREAD = 0.2
#: largest cosine of a body axis and a sensor axis that is not measured
_ASKEW = 0.1
#: how brackets follow the twist of their frame until it is known, alike in roll and pitch, see :func:`relative_tilt_maps`
USUAL_SHARES = np.array([TWIST_SHARE, 0.0, TWIST_SHARE, 0.0])


@dataclasses.dataclass(frozen=True)
class Geometry:
    """One rigid body on M mounts.

    Attributes
    ----------
    body
        The body whose motion and mount forces are estimated.
    mounts
        Its mounts to a prescribed base, in the order of the vehicle file; the order of every (.., M, 3) array.
    body_sensors
        Accelerometers and IMUs on the body.
    base_sensors
        Per mount the accelerometer on its base, None where there is none.
    transducers
        Displacement sensors of the mounts.
    arms
        Mount minus CG, shape (M, 3) [m].
    wrench
        G, shape (6, 3 M): from the stacked mount forces (cab axes) to force and moment about the CG.
    carried
        The bodies that hang on the body and on nothing else, with their mounts, None where there are none.
    weight
        Force and moment about the CG that carry the body at rest and what it carries, shape (6,) [N, N m].
    ignored
        Why other bodies on mounts of the body take no part, one sentence each.
    """

    vehicle: Vehicle
    body: Body
    mounts: tuple[Mount, ...]
    body_sensors: tuple[Sensor, ...]
    base_sensors: tuple[Sensor | None, ...]
    transducers: tuple[Sensor, ...]
    arms: Array
    wrench: Array
    carried: Vehicle | None
    weight: Array
    ignored: tuple[str, ...]

    @property
    def free(self) -> NDArray[np.bool_]:
        """Return which of the six coordinates the body may move in, shape (6,) bool."""
        return np.array([c in self.body.coordinates for c in COORDINATES])

    @property
    def file_mass(self) -> float:
        """Return the mass the mounts carry by the vehicle file: the body and what hangs on it [kg]."""
        return sum(b.mass.value for b in _with_carried(self.body, self.carried))

    @property
    def carried_mass_std(self) -> float:
        """Return the standard deviation of the mass of what hangs on the body [kg]."""
        return float(np.sqrt(sum((b.mass.std or 0.0) ** 2 for b in _with_carried(self.body, self.carried)[1:])))

    @property
    def has_base_motion(self) -> bool:
        """Return whether every mount has a triaxial accelerometer on its base."""
        return bool(self.mounts) and all(s is not None and s.triaxial for s in self.base_sensors)

    def least_load_share(self, offset: Array) -> float:
        """Return the share of the mass that a load between the mounts has at least where the CG is off by (3,) [m]."""
        distance, arms = float(np.linalg.norm(offset[:2])), self.arms[:, :2]
        if distance == 0.0:
            return 0.0
        return distance / max(float(np.max(arms @ offset[:2])) / distance, distance)

    @property
    def speed_sensor(self) -> Sensor | None:
        """Return the first sensor of the speed of the body or of what it stands on, None where there is none."""
        carriers = {self.body.name, *(m.base for m in self.mounts)}
        return next((s for s in self.vehicle.sensors.values() if s.kind == "speed" and s.body in carriers), None)

    @property
    def base_seen(self) -> NDArray[np.bool_]:
        """Return along which axes of the body the base of every mount is measured, shape (M, 3)."""
        seen = np.zeros((len(self.mounts), 3), dtype=bool)
        for i, sensor in enumerate(self.base_sensors):
            if sensor is not None:
                # what a nearly upright sensor adds of an axis that it does not measure is small against what is unknown there
                seen[i] = np.all(np.abs(sensor.rotation[:, ~sensor.measured[:3]]) < _ASKEW, axis=1)
        return seen

    @functools.cached_property
    def tolerated_cross_sensitivity(self) -> float:
        """Return the share of an acceleration that sensors in good order read wrongly, body and base of a mount together."""
        sides = [s for s in self.base_sensors if s is not None], self.body_sensors
        return math.hypot(*(pooled([s.tolerated_installation for s in side]).cross_sensitivity for side in sides))

    @property
    def base_observable(self) -> NDArray[np.bool_]:
        """Return along which axes base sensors determine the deflection of a mount well enough for its law, shape (M, 3).

        Sideways only where every base is measured in all axes: mounts are stiff there, hundredths of a millimetre are forces, and
        gravity comes in with every error of the tilt.
        """
        seen = self.base_seen
        return seen if seen.all() else np.logical_and(seen, [False, False, True])

    @property
    def mount_names(self) -> tuple[str, ...]:
        """Return the names of the mounts."""
        return tuple(m.name for m in self.mounts)


def geometry_of(vehicle: Vehicle) -> Geometry:
    """Pick the body that the accelerometers watch and describe it.

    The body is ``cab`` where there is one with accelerometers, else the body with most accelerometers.

    Raises
    ------
    ConfigurationError
        No accelerometer sits on any body of the vehicle file.
    """
    counts = {
        name: sum(1 for s in vehicle.sensors.values() if s.body == name and s.kind in ACCELEROMETERS) for name in vehicle.bodies
    }
    watched = [name for name, count in counts.items() if count]
    if not watched:
        raise ConfigurationError(
            f"sensors: no accelerometer or imu sits on a body; bodies: {', '.join(vehicle.bodies) or 'none'}. "
            "Without one nothing can be estimated", where=vehicle.name or "vehicle",
        )  # fmt: skip
    name = "cab" if "cab" in watched else max(watched, key=lambda n: counts[n])
    body = vehicle.bodies[name]
    mounts = tuple(m for m in vehicle.mounts.values() if m.body == name and m.base not in vehicle.bodies)
    arms = np.array([m.position - body.cg for m in mounts]).reshape(len(mounts), 3)
    wrench = np.zeros((6, 3 * len(mounts)))
    for i, arm in enumerate(arms):
        wrench[:, 3 * i : 3 * i + 3] = np.vstack([np.eye(3), skew(arm)])
    carried, ignored = _hung_on(vehicle, name)
    if words := contradiction(vehicle, name):
        ignored = (*ignored, f"{words}: mass and CG of the vehicle file are used")
    return Geometry(
        vehicle=vehicle,
        body=body,
        mounts=mounts,
        body_sensors=tuple(s for s in vehicle.sensors.values() if s.body == name and s.kind in ACCELEROMETERS),
        base_sensors=tuple(_base_sensor(vehicle, m) for m in mounts),
        transducers=tuple(
            s for s in vehicle.sensors.values() if s.kind == "displacement" and s.mount in {m.name for m in mounts}
        ),
        arms=arms,
        wrench=wrench,
        carried=carried,
        weight=_weight(vehicle, body, carried),
        ignored=ignored,
    )


def _hung_on(vehicle: Vehicle, name: str) -> tuple[Vehicle | None, tuple[str, ...]]:
    """Return the bodies that hang on one body only, with their mounts (the body as prescribed base), and why others do not count.

    Bodies are taken in groups that mounts link without the body itself: a seat, a driver on the seat.
    """
    carried: dict[str, Body] = {}
    held: dict[str, Mount] = {}
    ignored = []
    for group in _groups(vehicle, name):
        links = [m for m in vehicle.mounts.values() if m.body in group or m.base in group]
        if not any(name in (m.body, m.base) for m in links):
            continue
        who = ", ".join(b for b in vehicle.bodies if b in group)
        grounded = sorted({m.base for m in links if m.base not in vehicle.bodies})
        if grounded:
            ignored.append(f"{who} is fastened to {name} and to {', '.join(grounded)}: its force on {name} is left out")
            continue
        mounts = {m.name: dataclasses.replace(m, body=m.base, base=m.body) if m.body == name else m for m in links}
        part = dataclasses.replace(
            vehicle, bodies={b: vehicle.bodies[b] for b in vehicle.bodies if b in group}, mounts=mounts, sensors={},
            force_references=(),
        )  # fmt: skip
        reason = _unsteady(part)
        if reason:
            ignored.append(f"{who} on {name} does not stand by the vehicle file ({reason}): its force on {name} is left out")
            continue
        carried |= part.bodies
        held |= mounts
    if not carried:
        return None, tuple(ignored)
    return dataclasses.replace(vehicle, bodies=carried, mounts=held, sensors={}, force_references=()), tuple(ignored)


def _groups(vehicle: Vehicle, name: str) -> list[set[str]]:
    """Return the sets of bodies that mounts link to each other when one body is taken away."""
    left = [b for b in vehicle.bodies if b != name]
    groups: list[set[str]] = []
    while left:
        group = {left.pop(0)}
        grown = True
        while grown:
            near = {e for m in vehicle.mounts.values() if {m.body, m.base} & group for e in (m.body, m.base)}
            new = near & set(left)
            group |= new
            left = [b for b in left if b not in new]
            grown = bool(new)
        groups.append(group)
    return groups


def _unsteady(vehicle: Vehicle) -> str:
    """Return why bodies on prescribed bases do not stay where they are, empty where they do."""
    try:
        motions = unheld_motions(assemble(vehicle))
    except ConfigurationError as error:
        return str(error)
    return "; ".join(motions)


def _with_carried(body: Body, carried: Vehicle | None) -> tuple[Body, ...]:
    return (body, *carried.bodies.values()) if carried is not None else (body,)


def _weight(vehicle: Vehicle, body: Body, carried: Vehicle | None) -> Array:
    weight = np.zeros(6)
    for other in _with_carried(body, carried):
        force = np.array([0.0, 0.0, other.mass.value * vehicle.gravity])
        weight += np.concatenate([force, np.cross(other.cg - body.cg, force)])
    return weight


def _base_sensor(vehicle: Vehicle, mount: Mount) -> Sensor | None:
    for sensor in vehicle.sensors.values():
        if sensor.kind in ACCELEROMETERS and sensor.body not in vehicle.bodies and sensor.mount == mount.name:
            return sensor
    return None


def channel_geometry(sensors: Sequence[Sensor], cg: Array) -> tuple[Array, Array]:
    """Return directions e in body axes and points r from the CG of accelerometer channels, shapes (C, 3).

    Their rows of B are :func:`ride_estimation.sensors.layout.motion_rows`; channels that are not measured have no direction.
    """
    directions = np.vstack([s.measured[:3, None] * s.rotation.T for s in sensors])
    points = np.vstack([np.tile(s.position - cg, (3, 1)) for s in sensors])
    return directions, points


def weight_at(geometry: Geometry, offset: Array) -> Array:
    """Return the wrench about the CG of the file that carries the body with its CG elsewhere, shape (6,) [N, N m].

    Parameters
    ----------
    geometry
        Body and what it carries.
    offset
        Of the CG from its place in the file, shape (3,) [m].
    """
    weight = np.array([0.0, 0.0, geometry.body.mass.value * geometry.vehicle.gravity])
    return np.asarray(geometry.weight + np.concatenate([np.zeros(3), np.cross(offset, weight)]))


def base_transport(mounts: Sequence[Mount], sensors: Sequence[Sensor | None]) -> Array | None:
    """Return T, shape (3 M, 3 M): from the stacked readings of base sensors, body axes, to the motion of the mount bases.

    ``a_mount = a_sensor + alpha x (r_mount - r_sensor)`` with the angular acceleration of the frame at that mount from the base
    sensors themselves (rigid frame, with four or more also its twist). Centripetal terms, ``|omega|^2`` times the distance, are
    left out. None where no sensor is away from its mount, or where the sensors do not determine the rotation of the frame: fewer
    than three, or nearly on one line.

    Parameters
    ----------
    mounts
        M of them.
    sensors
        On their bases, None where there is none.
    """
    there = [s for s in sensors if s is not None]
    if len(there) < max(3, len(mounts)) or all(d <= AWAY for d in base_distances(mounts, sensors)):
        return None
    places = np.array([s.position for s in there])
    spread = np.linalg.svd((places - places.mean(axis=0))[:, :2], compute_uv=False)
    if spread[1] < LEAST_SPREAD:
        return None
    spins = relative_tilt_maps([dataclasses.replace(m, position=s.position) for m, s in zip(mounts, there)])
    transport = np.eye(3 * len(mounts))
    for i, (mount, sensor) in enumerate(zip(mounts, there)):
        transport[3 * i : 3 * i + 3] -= skew(mount.position - sensor.position) @ spins[i]
    return transport


def base_distances(mounts: Sequence[Mount], sensors: Sequence[Sensor | None]) -> list[float]:
    """Return how far each base sensor is from its mount [m], 0 where there is none."""
    return [0.0 if s is None else float(np.linalg.norm(m.position - s.position)) for m, s in zip(mounts, sensors)]


def plate_fit(mounts: Sequence[Mount]) -> tuple[Array, Array]:
    """Return the horizontal places of the mounts from their middle, (M, 2), and the fit of a plate to heights at them.

    Rows of the fit give height, slope along x, slope along y and, with four or more mounts that show one, twist
    (``z = ... + W x y``); shape (4, M), or (3, M) without twist.
    """
    place = np.array([m.position[:2] for m in mounts]).reshape(len(mounts), 2)
    place = place - place.mean(axis=0) if len(mounts) else place
    x, y = place.T
    plane = np.column_stack([np.ones(len(mounts)), x, y])
    twisted = np.column_stack([plane, x * y])
    shows = len(mounts) >= 4 and np.linalg.matrix_rank(twisted, tol=1e-6) == 4
    return place, np.asarray(np.linalg.pinv(twisted if shows else plane, rcond=1e-6))


def relative_tilt_maps(mounts: Sequence[Mount], shares: Array = USUAL_SHARES) -> Array:
    """Return T, shape (M, 3, 3 M): from the stacked deflections to the rotation of the body relative to each bracket.

    Roll and pitch come from a plane through the vertical deflections, with four or more mounts plus a twist ``W x y``, which
    the brackets follow by shares (s_r, c_r, s_p, c_p): ``roll = W (s_r x + c_r)``, ``pitch = -W (s_p y + c_p)``. Yaw comes from
    the horizontal deflections. Rows are zero where the mounts lie on one line.
    """
    count = len(mounts)
    maps = np.zeros((count, 3, 3 * count))
    if count < 2:
        return maps
    place, fit = plate_fit(mounts)
    span = float(np.sum(place**2))
    twist = fit[3] if len(fit) == 4 else np.zeros(count)
    for i, (x, y) in enumerate(place):
        maps[i, 0, 2::3] = fit[2] + twist * (shares[0] * x + shares[1])
        maps[i, 1, 2::3] = -fit[1] - twist * (shares[2] * y + shares[3])
        if span > 0.0:
            maps[i, 2, 0::3] = -place[:, 1] / span
            maps[i, 2, 1::3] = place[:, 0] / span
    return maps
