# Copyright 2026 ride_estimation contributors
"""What small rotations leave out, to second order and beyond: rotation of sensors, levers, brackets, gyroscopic terms.

The linear plant gives the trajectory; the difference between the full and the linear expression along that trajectory is
a known force, output or base acceleration. The pilots measured 0.9 % of the response on a class C road and 2-3 % on bumps.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.plant import Plant
from ride_estimation.frames import COORDINATES

Array = NDArray[np.float64]

_UP = np.array([0.0, 0.0, 1.0])


@dataclasses.dataclass(frozen=True)
class BodyMotion:
    """Small-rotation trajectory of all coordinates: q, its rate and acceleration, each (N, n)."""

    position: Array
    velocity: Array
    acceleration: Array


def rotation_matrices(angle: Array) -> Array:
    """Return exp([angle]x) for rotation vectors, shape (N, 3) -> (N, 3, 3) (Rodrigues)."""
    size = np.linalg.norm(angle, axis=1)
    a = np.where(size > 1e-8, np.sin(size) / np.maximum(size, 1e-8), 1.0)[:, None, None]
    b = np.where(size > 1e-8, (1.0 - np.cos(size)) / np.maximum(size, 1e-8) ** 2, 0.5)[:, None, None]
    x, y, z = angle.T
    zero = np.zeros_like(x)
    s = np.stack([np.stack([zero, -z, y], 1), np.stack([z, zero, -x], 1), np.stack([-y, x, zero], 1)], axis=1)
    return np.asarray(np.eye(3) + a * s + b * (s @ s))


def base_correction(plant: Plant, specific_force: Array, slope: Array) -> Array:
    """Return base acceleration that the linear tilt correction leaves out, shape (N, nb).

    Parameters
    ----------
    specific_force
        At every mount base in base axes, gravity included where it was measured, shape (N, nb).
    slope
        Rotation of every mount base [rad], shape (N, nb).
    """
    out = np.zeros_like(specific_force)
    gravity = plant.vehicle.gravity * _UP
    for j in range(len(plant.mounts)):
        rows = slice(3 * j, 3 * j + 3)
        f, theta = specific_force[:, rows], slope[:, rows]
        rotated = np.einsum("nij,nj->ni", rotation_matrices(theta), f)
        out[:, rows] = rotated - f - np.cross(theta, gravity)
    return out


def _six(plant: Plant, body: str, values: Array) -> Array:
    out = np.zeros((len(values), 6))
    for row, column in plant.coordinate_rows(body):
        out[:, column] = values[:, row]
    return out


class _Body:
    """Rotation, rates and accelerations of one body along the linear trajectory."""

    def __init__(self, plant: Plant, name: str, motion: BodyMotion) -> None:
        q, v, a = (_six(plant, name, part) for part in (motion.position, motion.velocity, motion.acceleration))
        theta, theta_dot, theta_ddot = q[:, 3:], v[:, 3:], a[:, 3:]
        self.theta, self.theta_ddot = theta, theta_ddot
        self.rotation = rotation_matrices(theta)
        self.omega = theta_dot + 0.5 * np.cross(theta, theta_dot)
        self.alpha = theta_ddot + 0.5 * np.cross(theta, theta_ddot)
        self.acceleration = a[:, :3]
        self.theta_dot = theta_dot

    def arm(self, offset: Array) -> Array:
        """Return the rotated lever arm, (N, 3)."""
        return np.asarray(self.rotation @ offset)

    def excess_displacement(self, offset: Array) -> tuple[Array, Array]:
        """Return displacement and velocity of a point beyond small rotation, (N, 3) each."""
        arm = self.arm(offset)
        return arm - offset - np.cross(self.theta, offset), np.cross(self.omega, arm) - np.cross(self.theta_dot, offset)


def output_correction(plant: Plant, motion: BodyMotion) -> Array:
    """Return what the accelerometers show beyond small rotation, shape (N, ny); zero for other kinds."""
    out = np.zeros((len(motion.position), len(plant.outputs)))
    gravity = plant.vehicle.gravity * _UP
    bodies: dict[str, _Body] = {}
    columns: dict[str, list[int]] = {}
    for i, signal in enumerate(plant.outputs):
        if signal.kind == "acceleration":
            columns.setdefault(signal.sensor, []).append(i)
    for name, rows in columns.items():
        sensor = plant.vehicle.sensors[name]
        body = bodies.setdefault(sensor.body, _Body(plant, sensor.body, motion))
        offset = sensor.position - plant.vehicle.bodies[sensor.body].cg
        arm = body.arm(offset)
        world = body.acceleration + np.cross(body.alpha, arm) + np.cross(body.omega, np.cross(body.omega, arm))
        full = np.einsum("nji,nj->ni", body.rotation, world + gravity) - gravity
        linear = body.acceleration + np.cross(body.theta_ddot, offset) - np.cross(body.theta, gravity)
        difference = (full - linear) @ sensor.rotation
        for i in rows:
            out[:, i] = difference[:, plant.outputs[i].component]
    return out


def transducer_correction(plant: Plant, motion: BodyMotion, deflection: Array, bracket: Array) -> Array:
    """Return what displacement transducers show beyond small rotation, shape (N, ny); zero for other kinds.

    A transducer measures along an axis that turns with the base of its mount.

    Parameters
    ----------
    motion
        Linear trajectory.
    deflection
        Of every mount along the linear trajectory [m], body minus base, shape (N, 3 M).
    bracket
        Rotation of every mount base [rad], shape (N, 3 M).
    """
    out = np.zeros((len(motion.position), len(plant.outputs)))
    vehicle = plant.vehicle
    bodies = {b: _Body(plant, b, motion) for b in dict.fromkeys(b for b, _ in plant.coordinates)}
    for i, signal in enumerate(plant.outputs):
        if signal.kind != "displacement":
            continue
        mount = vehicle.mounts[vehicle.sensors[signal.sensor].mount]
        rows = slice(3 * plant.mounts.index(mount.name), 3 * plant.mounts.index(mount.name) + 3)
        linear, angle = deflection[:, rows], bracket[:, rows]
        full = linear
        for b, s in ((mount.body, 1.0), (mount.base, -1.0)):
            if b in bodies:
                full = full + s * bodies[b].excess_displacement(mount.position - vehicle.bodies[b].cg)[0]
        if mount.base in bodies:
            angle = bodies[mount.base].theta
        turned = np.einsum("nji,nj->ni", rotation_matrices(angle), full)
        out[:, i] = turned[:, signal.component] - linear[:, signal.component]
    return out


def _mount_force(
    static: Array, modulus: tuple[Array, Array], relative: tuple[Array, Array], turn: Array | None, spin: Array
) -> Array:
    """Return the world force of a linear mount whose axes are turned, tension positive, static share included, (N, 3)."""
    d, v = relative
    if turn is None:
        return static - modulus[0] * d - modulus[1] * v
    local = np.einsum("nji,nj->ni", turn, d)
    local_rate = np.einsum("nji,nj->ni", turn, v - np.cross(spin, d))
    return np.asarray(np.einsum("nij,nj->ni", turn, static - modulus[0] * local - modulus[1] * local_rate))


def wrench_correction(
    plant: Plant,
    motion: BodyMotion,
    relative: tuple[Array, Array],
    bracket: tuple[Array, Array],
    modulus: tuple[Array, Array],
    axes: str = "base",
) -> Array:
    """Return the generalised force that the small-rotation equations of motion leave out, shape (N, n).

    Parameters
    ----------
    motion
        Linear trajectory.
    relative
        Deflection [m] and rate [m/s] of every mount along the linear trajectory, body minus base, shape (N, 3 M) each.
    bracket
        Rotation [rad] and angular rate [rad/s] of every mount base, shape (N, 3 M) each.
    modulus
        Stiffness and damping of every mount axis, shape (3 M,) each.
    axes
        What the axes of the mounts turn with: ``base``, ``body`` or ``world`` (nothing).
    """
    count = len(motion.position)
    vehicle = plant.vehicle
    names = tuple(dict.fromkeys(b for b, _ in plant.coordinates))
    bodies = {b: _Body(plant, b, motion) for b in names}
    wrench = {b: np.zeros((count, 6)) for b in names}
    for b, body in bodies.items():
        inertia = vehicle.bodies[b].inertia
        world = body.rotation @ inertia @ np.transpose(body.rotation, (0, 2, 1))
        momentum = np.einsum("nij,nj->ni", world, body.omega)
        rate = np.einsum("nij,nj->ni", world, body.alpha) + np.cross(body.omega, momentum)
        wrench[b][:, 3:] -= rate - body.theta_ddot @ inertia.T
    for j, name in enumerate(plant.mounts):
        mount = vehicle.mounts[name]
        rows = slice(3 * j, 3 * j + 3)
        ends = [(b, s) for b, s in ((mount.body, 1.0), (mount.base, -1.0)) if b in bodies]
        offsets = {b: mount.position - vehicle.bodies[b].cg for b, _ in ends}
        k, c = modulus[0][rows], modulus[1][rows]
        d, v = relative[0][:, rows], relative[1][:, rows]
        linear = k * d + c * v
        extra = [(s, *bodies[b].excess_displacement(offsets[b])) for b, s in ends]
        full = (d + sum(s * dx for s, dx, _ in extra), v + sum(s * dv for s, _, dv in extra))
        angle, spin = bracket[0][:, rows], bracket[1][:, rows]
        if mount.base in bodies:
            angle, spin = bodies[mount.base].theta, bodies[mount.base].omega
        if axes == "body":
            angle, spin = bodies[mount.body].theta, bodies[mount.body].omega
        static = plant.static_force[j] * _UP
        total = _mount_force(static, (k, c), full, None if axes == "world" else rotation_matrices(angle), spin)
        for b, s in ends:
            small = np.cross(offsets[b], -s * linear) + np.cross(np.cross(bodies[b].theta, offsets[b]), s * static)
            wrench[b][:, :3] += s * (total - static + linear)
            wrench[b][:, 3:] += np.cross(bodies[b].arm(offsets[b]), s * total) - small - np.cross(offsets[b], s * static)
    out = np.zeros((count, len(plant.coordinates)))
    for i, (name, coordinate) in enumerate(plant.coordinates):
        out[:, i] = wrench[name][:, COORDINATES.index(coordinate)]
    return out
