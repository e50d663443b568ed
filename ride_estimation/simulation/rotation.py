# Copyright 2026 ride_estimation contributors
"""Simulation with exact rigid-body kinematics and, where given, a payload that comes aboard during the run."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.terms import initial_states, pack_terms
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.frames import AXES, COORDINATES, skew
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.simulation.response import Response
from ride_estimation.simulation.rotation_kernel import (
    OMEGA,
    PLACE,
    QUATERNION,
    ROWS,
    SCALAR,
    VELOCITY,
    RotationModel,
    integrate_rotation,
)
from ride_estimation.simulation.substeps import choose_substeps
from ride_estimation.vehicles.assembly import Assembly, sensor_offset
from ride_estimation.vehicles.guided import carrier_of
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: steps in which a payload that comes aboard gradually is made heavier
_RAMP_LEVELS = 100


@dataclasses.dataclass(frozen=True)
class Payload:
    """A point mass that comes aboard a body.

    Attributes
    ----------
    body
        Name.
    mass
        [kg]; negative where load is taken off.
    position
        Vehicle-file axes [m], shape (3,).
    begin, duration
        From when and over which time it comes aboard, linearly [s].
    """

    body: str
    mass: float
    position: Array
    begin: float
    duration: float = 0.0


@dataclasses.dataclass(frozen=True)
class RotationResponse(Response):
    """Response with finite rotations. B bodies.

    ``coordinates`` are the displacement (world) and roll, pitch, yaw of each body; ``rates`` its velocity (world) and
    angular velocity (body axes); ``accelerations`` acceleration of the reference point and angular acceleration, both in
    body axes, gravity not included.

    Attributes
    ----------
    rotation
        Body to world, shape (N, B, 3, 3).
    force_world
        Force on the body by each mount, world axes, shape (N, M, 3).
    mass, offset, inertia
        Actual mass (N, B), CG from the reference point in body axes (N, B, 3), inertia about the reference (N, B, 3, 3).
    """

    rotation: Array
    force_world: Array
    mass: Array
    offset: Array
    inertia: Array

    def _body(self, body: str) -> int:
        names = tuple(self.assembly.vehicle.bodies)
        if body not in names:
            raise ConfigurationError(f"body: {body!r}; allowed: {', '.join(names)}")
        return names.index(body)

    def body_motion(self, body: str, kind: str = "accelerations") -> Array:
        """Return (x y z roll pitch yaw) of a body's reference point, of a guided one also what it shares, shape (N, 6)."""
        number = self._body(body)
        return np.asarray(getattr(self, kind)[:, 6 * number : 6 * number + 6], dtype=float)

    def mount_force(self) -> Array:
        """Return the force on the body by each mount in the axes of that body, static share included, shape (N, M, 3)."""
        bodies = [self._body(m.body) for m in self.assembly.vehicle.mounts.values()]
        return np.asarray(np.einsum("nmji,nmj->nmi", self.rotation[:, bodies], self.force_world), dtype=float)

    def cg_motion(self, body: str) -> Array:
        """Return acceleration of the actual CG (payload included) and angular acceleration, body axes, shape (N, 6)."""
        number = self._body(body)
        motion = self.body_motion(body)
        omega = self.body_motion(body, "rates")[:, 3:]
        offset = self.offset[:, number]
        centre = motion[:, :3] + np.cross(motion[:, 3:], offset) + np.cross(omega, np.cross(omega, offset))
        return np.hstack([centre, motion[:, 3:]])

    def inertial_load(self, body: str) -> Array:
        """Return ``(M a_cg, J alpha + w x J w)`` of body and payload about the actual CG, body axes, shape (N, 6)."""
        number = self._body(body)
        motion = self.cg_motion(body)
        omega = self.body_motion(body, "rates")[:, 3:]
        mass, s = self.mass[:, number], self.offset[:, number]
        about_cg = self.inertia[:, number] + mass[:, None, None] * np.array([skew(v) @ skew(v) for v in s])
        spin = np.einsum("nij,nj->ni", about_cg, omega)
        moment = np.einsum("nij,nj->ni", about_cg, motion[:, 3:]) + np.cross(omega, spin)
        return np.hstack([mass[:, None] * motion[:, :3], moment])

    def _on_body(self, sensor: Sensor) -> tuple[Array, Array]:
        """Return specific force and angular rate where a sensor sits on a body, body axes, shape (N, 3) each."""
        number = self._body(sensor.body)
        motion = self.body_motion(sensor.body)
        omega = self.body_motion(sensor.body, "rates")[:, 3:]
        arm = sensor_offset(self.assembly.vehicle, sensor)
        up = self.assembly.vehicle.gravity * self.rotation[:, number, 2, :]
        turning = np.cross(motion[:, 3:], arm) + np.cross(omega, np.cross(omega, arm))
        return motion[:, :3] + up + turning, omega


def locked_bodies(vehicle: Vehicle) -> list[str]:
    """Return the bodies whose exact kinematics are not known: neither free nor sliding in one that is free."""
    free = [b.name for b in vehicle.bodies.values() if set(b.coordinates) == set(COORDINATES)]
    guided = [b.name for b in vehicle.bodies.values() if set(b.coordinates) <= set(AXES) and carrier_of(vehicle, b.name) in free]
    return [name for name in vehicle.bodies if name not in free and name not in guided]


def simulate_full_rotation(
    assembly: Assembly,
    base_motion: BaseMotion,
    *,
    load: Array | None = None,
    substeps: int | None = None,
    payloads: Sequence[Payload] = (),
) -> RotationResponse:
    """Simulate one run from rest with exact rigid-body kinematics.

    Parameters
    ----------
    assembly, base_motion, substeps
        As :func:`ride_estimation.simulation.simulate.simulate`; no body may be one of :func:`locked_bodies`.
    load
        External force (world axes) and moment (body axes) per body, shape (N, 6 B) or (1, 6 B).
    payloads
        Masses that come aboard.

    Raises
    ------
    ConfigurationError
        A body with locked coordinates, an unknown payload body, a mass that does not stay positive.
    InputDataError
        Shapes that do not fit; a motion that leaves every bound.
    """
    vehicle, samples = assembly.vehicle, base_motion.samples
    locked = locked_bodies(vehicle)
    if locked:
        raise ConfigurationError(
            f"full_rotation: {', '.join(locked)} have locked coordinates; allowed: bodies with all of {', '.join(COORDINATES)}, "
            f"and bodies with some of {', '.join(AXES)} on one such body"
        )
    if base_motion.displacement.shape[1] != len(vehicle.mounts):
        raise InputDataError(f"base motion: {base_motion.displacement.shape[1]} mounts; the vehicle has {len(vehicle.mounts)}")
    size = 6 * len(vehicle.bodies)
    acting = np.zeros((1, size)) if load is None else np.atleast_2d(np.asarray(load, dtype=float))
    if acting.shape not in ((samples, size), (1, size)):
        raise InputDataError(f"load: shape {acting.shape}; allowed: ({samples}, {size}) or (1, {size})")
    levels, level = _mass_levels(vehicle, payloads, base_motion)
    terms = [e.terms() for e in assembly.elements]
    channel = np.repeat(np.arange(len(terms), dtype=np.int64), [len(t) for t in terms])
    codes, parameters = pack_terms(t for group in terms for t in group)
    model = _model(assembly, levels, level, codes, channel)
    value = np.stack([base_motion.displacement, base_motion.angle], axis=2)
    rate = np.stack([base_motion.velocity, base_motion.angular_rate], axis=2)
    bodies, mounts, components = len(vehicle.bodies), len(vehicle.mounts), len(terms)
    state = np.zeros((bodies, ROWS, 3))
    state[:, SCALAR, 0] = 1.0
    out_state, out_slope = np.empty((samples, *state.shape)), np.empty((samples, *state.shape))
    out_force = np.empty((samples, mounts, 3))
    out = [np.empty((samples, components)) for _ in range(3)]
    steps = choose_substeps(assembly, base_motion.rate_hz) if substeps is None else int(substeps)
    reached = integrate_rotation(
        model, parameters, initial_states(codes, parameters), value, rate, np.ascontiguousarray(acting), state,
        1.0 / base_motion.rate_hz, steps, out_state, out_slope, out_force, *out,
    )
    if reached < samples:
        raise InputDataError(
            f"the simulated motion is not finite any more at t = {reached / base_motion.rate_hz:.3f} s; "
            f"take more substeps (now {steps}) or check stiffness and damping of the elements"
        )
    return _response(assembly, base_motion, model, out_state, out_slope, out_force, out)


def _model(
    assembly: Assembly, levels: tuple[Array, Array, Array], level: NDArray[np.int64],
    codes: NDArray[np.int64], channel: NDArray[np.int64],
) -> RotationModel:
    vehicle = assembly.vehicle
    names = tuple(vehicle.bodies)
    guided = [b.name for b in vehicle.bodies.values() if set(b.coordinates) != set(COORDINATES)]
    mounts = tuple(vehicle.mounts.values())
    mass, offset, inertia = levels
    inverse = np.empty((*mass.shape, 2, 2, 3, 3))
    for i in np.ndindex(mass.shape):
        cross = mass[i] * skew(offset[i])
        full = np.linalg.inv(np.block([[mass[i] * np.eye(3), -cross], [cross, inertia[i]]]))
        inverse[i] = full.reshape(2, 3, 2, 3).transpose(0, 2, 1, 3)
    number, axis = assembly.component_index()
    moment = np.zeros((len(mounts), 3))
    moment[number[axis >= 3], axis[axis >= 3] - 3] = -assembly.static_tension[axis >= 3]
    return RotationModel(
        mount_body=np.array([names.index(m.body) for m in mounts], dtype=np.int64),
        mount_base=np.array([names.index(m.base) if m.base in names else -1 for m in mounts], dtype=np.int64),
        arm_body=np.array([m.position - vehicle.bodies[m.body].cg for m in mounts]),
        arm_base=np.array([m.position - vehicle.bodies[m.base].cg if m.base in names else np.zeros(3) for m in mounts]),
        static_force=np.ascontiguousarray(assembly.static_force),
        static_moment=moment,
        component_mount=number,
        component_axis=axis,
        mass=mass,
        offset=offset,
        inertia=inertia,
        inverse=inverse,
        level=level,
        carrier=np.array([names.index(carrier_of(vehicle, b)) if b in guided else -1 for b in names], dtype=np.int64),
        slides=np.array([[float(a in body.coordinates) for a in AXES] for body in vehicle.bodies.values()]),
        place=np.array([body.cg for body in vehicle.bodies.values()]),
        codes=codes,
        channel=channel,
        gravity=float(vehicle.gravity),
    )


def _mass_levels(
    vehicle: Vehicle, payloads: Sequence[Payload], base_motion: BaseMotion
) -> tuple[tuple[Array, Array, Array], NDArray[np.int64]]:
    """Return mass, offset, inertia per level and body, and the level of each sample."""
    names = tuple(vehicle.bodies)
    unknown = [p.body for p in payloads if p.body not in names]
    if unknown:
        raise ConfigurationError(f"payload body: {', '.join(unknown)}; allowed: {', '.join(names)}")
    share = np.zeros((base_motion.samples, len(payloads)))
    for i, p in enumerate(payloads):
        ramp = np.clip((base_motion.time_s - p.begin) / max(p.duration, 1e-9), 0.0, 1.0)
        share[:, i] = np.round(ramp * _RAMP_LEVELS) / _RAMP_LEVELS
    states, level = np.unique(share, axis=0, return_inverse=True)
    mass = np.empty((len(states), len(names)))
    offset = np.empty((len(states), len(names), 3))
    inertia = np.empty((len(states), len(names), 3, 3))
    for row, shares in enumerate(states):
        for b, body in enumerate(vehicle.bodies.values()):
            arms = [(s * p.mass, p.position - body.cg) for s, p in zip(shares, payloads) if p.body == body.name]
            mass[row, b] = body.mass.value + sum(m for m, _ in arms)
            if mass[row, b] <= 0.0:
                raise ConfigurationError(f"payload: {body.name} would weigh {mass[row, b]:g} kg; allowed: more than zero")
            offset[row, b] = sum((m * r for m, r in arms), np.zeros(3)) / mass[row, b]
            inertia[row, b] = body.inertia - sum((m * skew(r) @ skew(r) for m, r in arms), np.zeros((3, 3)))
    return (mass, offset, inertia), np.asarray(level, dtype=np.int64).reshape(-1)


def _response(
    assembly: Assembly, base_motion: BaseMotion, model: RotationModel, state: Array, slope: Array, force: Array,
    components: list[Array],
) -> RotationResponse:
    samples, bodies = state.shape[:2]
    (x, y, z), w = np.moveaxis(state[:, :, QUATERNION], 2, 0), state[:, :, SCALAR, 0]
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    rotation = np.moveaxis(np.array(rows), (0, 1), (2, 3))
    angles = np.stack(
        [
            np.arctan2(rotation[..., 2, 1], rotation[..., 2, 2]),
            -np.arcsin(np.clip(rotation[..., 2, 0], -1.0, 1.0)),
            np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0]),
        ],
        axis=2,
    )
    local = np.einsum("nbji,nbj->nbi", rotation, slope[:, :, VELOCITY])

    def flat(first: Array, second: Array) -> Array:
        return np.concatenate([first, second], axis=2).reshape(samples, 6 * bodies)

    return RotationResponse(
        assembly, base_motion,
        flat(state[:, :, PLACE], angles), flat(state[:, :, VELOCITY], state[:, :, OMEGA]), flat(local, slope[:, :, OMEGA]),
        components[0], components[1], components[2], rotation, force,
        model.mass[model.level], model.offset[model.level], model.inertia[model.level],
    )
