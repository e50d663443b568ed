# Copyright 2026 ride_estimation contributors
"""What small rotations leave out, to second order and beyond: rotation of sensors, levers, brackets, gyroscopic terms.

The linear plant gives the trajectory; the difference between the full and the linear expression along that trajectory is
a known force, output or base acceleration. The pilots measured 0.9 % of the response on a class C road and 2-3 % on bumps.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.model.body_trajectories import BodyMotion, Trajectories, Trajectory
from ride_estimation.diagnosis.model.plant import Plant, vertical_row
from ride_estimation.frames import AXES, rotation_matrices, skew

Array = NDArray[np.float64]

_UP = np.array([0.0, 0.0, 1.0])


@dataclasses.dataclass(frozen=True)
class Brackets:
    """How the bases of mounts turn along a run.

    Attributes
    ----------
    slope, rate
        Rotation [rad] and angular rate [rad/s] of every mount base, shape (N, 3 M) each.
    """

    slope: Array
    rate: Array

    @functools.cached_property
    def rotation(self) -> tuple[Array, ...]:
        """Return the rotation matrices of every mount base, shape (N, 3, 3) each; every pass over a model asks for them."""
        return tuple(rotation_matrices(self.slope[:, i : i + 3]) for i in range(0, self.slope.shape[1], 3))


def base_correction(plant: Plant, specific_force: Array, brackets: Brackets) -> Array:
    """Return base acceleration that the linear tilt correction leaves out, shape (N, nb).

    Parameters
    ----------
    specific_force
        At every mount base in base axes, gravity included where it was measured, shape (N, nb).
    brackets
        How the mount bases turn.
    """
    out = np.zeros_like(specific_force)
    gravity = skew(plant.vehicle.gravity * _UP)
    for j in range(len(plant.mounts)):
        rows = slice(3 * j, 3 * j + 3)
        f = specific_force[:, rows]
        rotated = np.einsum("nij,nj->ni", brackets.rotation[j], f)
        out[:, rows] = rotated - f - brackets.slope[:, rows] @ gravity
    return out


def output_correction(plant: Plant, bodies: Mapping[str, Trajectory]) -> Array:
    """Return what accelerometers and gyros show beyond small rotation, shape (N, ny); zero for transducers.

    A gyro reads along its own axes, ``R^T omega = theta' - theta x theta' / 2`` to second order. Left out is
    ``theta x (theta x theta') / 6``: at 4 degrees a thousandth of the rate, less than any gyro is right to.
    """
    out = np.zeros((len(next(iter(bodies.values())).theta), len(plant.outputs)))
    gravity = plant.vehicle.gravity * _UP
    columns: dict[str, list[int]] = {}
    for i, signal in enumerate(plant.outputs):
        if signal.kind != "displacement":
            columns.setdefault(signal.sensor, []).append(i)
    for name, rows in columns.items():
        sensor = plant.vehicle.sensors[name]
        body = bodies[sensor.body]
        offset = sensor.position - plant.vehicle.bodies[sensor.body].cg
        full = np.einsum("nji,nj->ni", body.rotation, body.point_acceleration(offset) + gravity) - gravity
        linear = body.linear[2] + body.theta_ddot @ skew(offset) - body.theta @ skew(gravity)
        difference = (full - linear) @ sensor.rotation
        for i in rows:
            signal = plant.outputs[i]
            if signal.kind == "acceleration":
                out[:, i] = difference[:, signal.component]
            else:
                out[:, i] = (-0.5 * np.cross(body.theta, body.theta_dot) @ sensor.rotation)[:, signal.component - len(AXES)]
    return out


def transducer_correction(
    plant: Plant, bodies: Mapping[str, Trajectory], deflection: Array, brackets: Brackets
) -> Array:
    """Return what displacement transducers show beyond small rotation, shape (N, ny); zero for other kinds.

    A transducer measures along an axis that turns with the base of its mount.

    Parameters
    ----------
    bodies
        Their motion.
    deflection
        Of every mount along the linear trajectory [m], body minus base, shape (N, 3 M).
    brackets
        How the mount bases turn.
    """
    out = np.zeros((len(deflection), len(plant.outputs)))
    vehicle = plant.vehicle
    for i, signal in enumerate(plant.outputs):
        if signal.kind != "displacement":
            continue
        mount = vehicle.mounts[vehicle.sensors[signal.sensor].mount]
        number = plant.mounts.index(mount.name)
        full = linear = deflection[:, 3 * number : 3 * number + 3]
        for b, s in ((mount.body, 1.0), (mount.base, -1.0)):
            if b in bodies:
                full = full + s * bodies[b].beyond(mount.position - vehicle.bodies[b].cg)[0]
        turn = bodies[mount.base].rotation if mount.base in bodies else brackets.rotation[number]
        turned = np.einsum("nji,nj->ni", turn, full)
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
    brackets: Brackets,
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
    brackets
        How the mount bases turn.
    modulus
        Stiffness and damping of every mount axis, shape (3 M,) each.
    axes
        What the axes of the mounts turn with: ``base``, ``body`` or ``world`` (nothing).
    """
    vehicle = plant.vehicle
    trajectories = Trajectories(plant, motion)
    bodies = trajectories.bodies
    force, moment = ({b: np.zeros((len(motion.position), 3)) for b in bodies} for _ in range(2))
    for j, name in enumerate(plant.mounts):
        mount = vehicle.mounts[name]
        rows = slice(3 * j, 3 * j + 3)
        ends = [(b, s) for b, s in ((mount.body, 1.0), (mount.base, -1.0)) if b in bodies]
        offsets = {b: mount.position - vehicle.bodies[b].cg for b, _ in ends}
        beyond = [(s, *bodies[b].beyond(offsets[b])) for b, s in ends]
        full = (
            relative[0][:, rows] + sum(s * dx for s, dx, _ in beyond), relative[1][:, rows] + sum(s * dv for s, _, dv in beyond)
        )
        with_body = mount.body if axes == "body" else mount.base
        if with_body in bodies:
            turn, spin = bodies[with_body].rotation, bodies[with_body].omega
        else:
            turn, spin = brackets.rotation[j], brackets.rate[:, rows]
        own = modulus[0][rows], modulus[1][rows]
        total = _mount_force(plant.static_force[j] * _UP, own, full, None if axes == "world" else turn, spin)
        # both ends act at the body side
        point = bodies[mount.body].displacement + bodies[mount.body].arm(offsets[mount.body])
        for b, s in ends:
            cg = vehicle.bodies[mount.body].cg - vehicle.bodies[b].cg - bodies[b].displacement
            force[b] += s * total
            moment[b] += np.cross(point + cg, s * total)
    linear = motion.acceleration @ plant.mass.T + motion.position @ plant.gravity_stiffness.T
    for port, row in zip(plant.ports, plant.port_map):
        if port.axis in AXES:
            i = 3 * plant.mounts.index(port.mount) + AXES.index(port.axis)
            linear += np.outer(modulus[0][i] * relative[0][:, i] + modulus[1][i] * relative[1][:, i], row)
    return trajectories.generalised(force, moment) + linear - _at_rest(plant)


def _at_rest(plant: Plant) -> Array:
    """Return the generalised force of weights and static mount loads at rest, shape (n,): zero where they balance."""
    vehicle, total = plant.vehicle, np.zeros(len(plant.coordinates))
    for load, name in zip(plant.static_force, plant.mounts):
        total += load * vertical_row(vehicle, plant.coordinates, vehicle.mounts[name])
    for b in dict.fromkeys(b for b, _ in plant.coordinates):
        total -= vehicle.bodies[b].mass.value * vehicle.gravity * plant.body_map(b)[2]
    return total
