# Copyright 2026 ride_estimation contributors
"""What bodies that the estimated body carries (a seat with its driver) do to it, computed tick by tick from its motion.

A carried body hangs on the estimated body and on nothing else. In axes fixed to the estimated body, q its small motion relative
to them about static equilibrium::

    M q'' + C q' + K q = -M a_0,   a_0 = [f + alpha x r + omega x (omega x r) - g e_z, alpha]
    F = sum m (f + alpha x r + omega x (omega x r) + q''),   M_cg = sum (r + q) x F_b + J (alpha + q''_rot) + omega x J omega

with f the specific force of the estimated body at its CG (gravity in it: the reaction holds the weight, slow tilt included) and r
from there to the CG of the carried body. Mounts are taken at their linear equivalent for ride motion. Coordinates the carried
body does not have are those of the estimated body: it is then a mass fastened to it, a point mass where it cannot turn (vehicle
files need no inertia there). Coriolis terms of the relative motion are left out. The step is exact for inputs that run straight
between ticks, so it is stable for every stiffness.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from ride_estimation.estimation.common.block_math import cross
from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.forces.free_parameters import find_free_parameters_of
from ride_estimation.estimation.forces.mount_law import ROLES
from ride_estimation.estimation.motion.motion_kernel import motion_at
from ride_estimation.frames import AXES, COORDINATES
from ride_estimation.jit import compile_kernel
from ride_estimation.vehicles.assembly import assemble, body_columns
from ride_estimation.vehicles.modes import linearise
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: harmonic motion at which the mounts of carried bodies are linearised: seat on a rough road [Hz], [m]
LINEARISED_AT = (2.0, 5e-3)
#: memory of the mean square of what uncertain numbers change [s]
_MEMORY = 5.0


class CarriedBodies:
    """Reaction of the carried bodies of a geometry, and how uncertain the vehicle file makes it.

    Every number that the file states with a standard deviation (for stiffness and damping of a mount also without one) is moved
    by it in a copy of the model that runs beside; variances of the differences add up to the covariance. Their constant part, a
    mass that is off, is that of the static load: it moves all forces alike and is no evidence against equilibrium.

    Parameters
    ----------
    geometry
        With what its body carries.
    settings
        Prior standard deviations where the vehicle file states none.
    """

    def __init__(self, geometry: Geometry, settings: PipelineSettings) -> None:
        self._copies: tuple[_Copy, ...] = ()
        if geometry.carried is not None:
            cg, gravity = geometry.body.cg, geometry.vehicle.gravity
            varied = (geometry.carried, *_varied(geometry.carried, settings))
            self._copies = tuple(_Copy(vehicle, cg, gravity) for vehicle in varied)
        self.reset()

    def reset(self) -> None:
        """Start from static equilibrium."""
        for copy in self._copies:
            copy.reset()
        #: covariance of the moving part of the reaction, shape (6, 6) [N, N m]
        self.covariance = np.zeros((6, 6))
        self._mean = np.zeros((max(len(self._copies) - 1, 0), 6))
        self._time = 0.0

    def added_to(self, load: Array, motion: Array, rate: Array, factor: float, dt: float) -> Array:
        """Return the wrench the mounts of the estimated body carry: its own load and the reaction of what it carries.

        Parameters
        ----------
        load
            ``m f``, ``J alpha + omega x J omega`` of the body alone, shape (K, 6) [N, N m].
        motion
            Specific force at the CG and angular acceleration, shape (K, 6).
        rate
            Angular rate, shape (K, 3) [rad/s].
        factor
            On all masses of the vehicle file.
        dt
            Tick [s].
        """
        if not self._copies:
            return load
        found = [copy.reaction(motion, rate, dt) for copy in self._copies]
        if len(found) > 1:
            self._watch(np.array(found[1:]) - found[0], len(load) * dt)
        return np.asarray(load + factor * found[0])

    def _watch(self, change: Array, duration: float) -> None:
        """Follow mean and covariance of what the copies say otherwise, shape (copies, K, 6)."""
        if self._time == 0.0:
            self._mean = change[:, 0].copy()
        self._time += duration
        share = 1.0 - math.exp(-duration / min(_MEMORY, self._time))
        moving = (change - self._mean[:, None]).reshape(-1, 6)
        self._mean += share * (change.mean(axis=1) - self._mean)
        self.covariance += share * (moving.T @ moving / change.shape[1] - self.covariance)

    def motions(self, motion: Array, rate: Array, dt: float) -> dict[str, tuple[Array, Array]]:
        """Return how every carried body moves over a whole run, from static equilibrium at its first tick.

        Parameters
        ----------
        motion, rate, dt
            As for :meth:`added_to`.

        Returns
        -------
        dict
            Body -> specific force at its CG and angular acceleration, axes of the estimated body, and their standard
            deviation by the numbers of the file, shapes (K, 6).
        """
        self.reset()
        found = [copy.motions(motion, rate, dt) for copy in self._copies]
        self.reset()
        if not found:
            return {}
        return {
            name: (own, np.sqrt(np.sum([(other[name] - own) ** 2 for other in found], axis=0))) for name, own in found[0].items()
        }

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        return {
            "states": [c.state.tolist() for c in self._copies], "last": [c.last.tolist() for c in self._copies],
            **fields_of(self, ("covariance", "_mean", "_time")),
        }  # fmt: skip

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        for copy, state, last in zip(self._copies, saved["states"], saved["last"]):
            copy.state = np.array(state, dtype=float).reshape(copy.state.shape)
            copy.last = np.array(last, dtype=float).reshape(copy.last.shape)
        take_fields(self, ("covariance", "_mean", "_time"), saved)


def _varied(vehicle: Vehicle, settings: PipelineSettings) -> list[Vehicle]:
    """Return one copy of the vehicle per uncertain number, moved by its standard deviation."""
    found = []
    for body in vehicle.bodies.values():
        if body.mass.std:
            moved = dataclasses.replace(body, mass=dataclasses.replace(body.mass, value=body.mass.value + body.mass.std))
            found.append(dataclasses.replace(vehicle, bodies={**vehicle.bodies, body.name: moved}))
    mounts = tuple(vehicle.mounts.values())
    for parameter in find_free_parameters_of(mounts, settings):
        mount, axis = mounts[parameter.mount], AXES[parameter.axis]
        found.append(vehicle.replace_elements({
            (mount.name, axis): mount.elements[axis].scaled(ROLES[parameter.role], math.exp(min(parameter.std, parameter.upper)))
        }))
    return found


class _Copy:
    """The carried bodies with one set of numbers: state [q, q'] and what follows from it."""

    def __init__(self, vehicle: Vehicle, cg: Array, gravity: float) -> None:
        model = linearise(assemble(vehicle), *LINEARISED_AT)
        self._gravity = gravity
        self._bodies = tuple(vehicle.bodies.values())
        self._arms = tuple(b.cg - cg for b in self._bodies)
        self._columns = tuple(body_columns(model.assembly.coordinates, b.name) for b in self._bodies)
        turns = [np.array([c in b.coordinates for c in COORDINATES[3:]], dtype=float) for b in self._bodies]
        self._inertia = tuple(t[:, None] * b.inertia * t for b, t in zip(self._bodies, turns))
        inverse = np.linalg.inv(model.mass)
        self._count = len(model.mass)
        self._feedback: Array = np.asarray(-inverse @ np.hstack([model.stiffness, model.damping]), dtype=np.float64)
        self._inverse = inverse
        self._step = 0.0
        self.reset()

    def reset(self) -> None:
        """Begin at rest."""
        self.state, self.last = np.zeros(2 * self._count), np.zeros(self._count)

    def _discretise(self, dt: float) -> None:
        q = self._count
        system = np.zeros((4 * q, 4 * q))
        system[:q, q : 2 * q] = np.eye(q)
        system[q : 2 * q, : 2 * q] = self._feedback
        system[q : 2 * q, 2 * q : 3 * q] = np.eye(q)
        system[2 * q : 3 * q, 3 * q :] = np.eye(q) / dt
        exact = linalg.expm(system * dt)
        self._transition = np.ascontiguousarray(exact[: 2 * q, : 2 * q])
        self._hold_new = np.ascontiguousarray(exact[: 2 * q, 3 * q :])
        self._hold_old = np.ascontiguousarray(exact[: 2 * q, 2 * q : 3 * q] - exact[: 2 * q, 3 * q :])
        self._step = dt

    def reaction(self, motion: Array, rate: Array, dt: float) -> Array:
        """Return what the mounts of the estimated body carry for these bodies, about its CG, shape (K, 6) [N, N m].

        Parameters
        ----------
        motion
            Specific force and angular acceleration of the estimated body at its CG, shape (K, 6) [m/s^2, rad/s^2].
        rate
            Its angular rate, shape (K, 3) [rad/s].
        dt
            Tick [s].
        """
        frames, value, accel = self._answer(motion, rate, dt)
        return self._gathered(frames, rate, value, accel)

    def motions(self, motion: Array, rate: Array, dt: float) -> dict[str, Array]:
        """Return body -> specific force at its CG and angular acceleration, shape (K, 6); arguments of :meth:`reaction`."""
        frames, _, accel = self._answer(motion, rate, dt)
        parts = zip(self._bodies, self._columns, frames, strict=True)
        return {body.name: _second(frame, columns, accel) for body, columns, frame in parts}

    def _answer(self, motion: Array, rate: Array, dt: float) -> tuple[list[Array], Array, Array]:
        """Return motion of the estimated body at every carried CG, (K, 6) each, and q and q'' of the coordinates, (K, Q)."""
        if dt != self._step:
            self._discretise(dt)
        frames = [self._frame(motion, rate, arm) for arm in self._arms]
        force = np.zeros((len(motion), self._count))
        for body, inertia, columns, frame in zip(self._bodies, self._inertia, self._columns, frames):
            moment = frame[:, 3:] @ inertia + cross(rate, rate @ inertia)
            wanted = np.hstack([body.mass.value * (frame[:, :3] - self._gravity * np.eye(3)[2]), moment])
            for coordinate, column in columns.items():
                force[:, column] = -wanted[:, COORDINATES.index(coordinate)]
        value, accel = np.empty_like(force), np.empty_like(force)
        _respond(
            force @ self._inverse.T, self._transition, self._hold_old, self._hold_new, self._feedback, self.state, self.last,
            value, accel,
        )  # fmt: skip
        return frames, value, accel

    def _gathered(self, frames: list[Array], rate: Array, value: Array, accel: Array) -> Array:
        total = np.zeros((len(rate), 6))
        parts = zip(self._bodies, self._inertia, self._columns, self._arms, frames, strict=True)
        for body, inertia, columns, arm, frame in parts:
            q, second = np.zeros((len(rate), 6)), _second(frame, columns, accel)
            for coordinate, column in columns.items():
                q[:, COORDINATES.index(coordinate)] = value[:, column]
            force = body.mass.value * second[:, :3]
            total[:, :3] += force
            total[:, 3:] += cross(arm + q[:, :3], force) + second[:, 3:] @ inertia + cross(rate, rate @ inertia)
        return total

    @staticmethod
    def _frame(motion: Array, rate: Array, arm: Array) -> Array:
        """Return specific force and angular acceleration of the estimated body at a point, shape (K, 6)."""
        place = np.empty((len(rate), 1, 3))
        motion_at(motion, rate, np.ascontiguousarray(arm)[None], place)
        return np.hstack([place[:, 0], motion[:, 3:]])


def _second(frame: Array, columns: Mapping[str, int], accel: Array) -> Array:
    """Return the motion of a carried CG: that of the estimated body there and its own relative to it, (K, 6)."""
    second = frame.copy()
    for coordinate, column in columns.items():
        second[:, COORDINATES.index(coordinate)] += accel[:, column]
    return second


@compile_kernel
def _respond(
    push: Array, transition: Array, hold_old: Array, hold_new: Array, feedback: Array, state: Array, last: Array,
    value: Array, accel: Array,
) -> None:  # fmt: skip
    """Advance ``q'' = u + S [q, q']`` over the ticks of a block, exact for u straight between ticks.

    Parameters
    ----------
    push
        u, shape (K, Q).
    transition, hold_old, hold_new
        Exact discrete response, (2 Q, 2 Q), (2 Q, Q), (2 Q, Q).
    feedback
        S, shape (Q, 2 Q).
    state, last
        [q, q'] and the last u, in place, shapes (2 Q,) and (Q,).
    value, accel
        Outputs q and q'', shape (K, Q).
    """
    size = last.shape[0]
    new = np.empty(2 * size)
    for k in range(push.shape[0]):
        for i in range(2 * size):
            total = 0.0
            for j in range(2 * size):
                total += transition[i, j] * state[j]
            for j in range(size):
                total += hold_old[i, j] * last[j] + hold_new[i, j] * push[k, j]
            new[i] = total
        for i in range(2 * size):
            state[i] = new[i]
        for i in range(size):
            last[i] = push[k, i]
            total = push[k, i]
            for j in range(2 * size):
                total += feedback[i, j] * state[j]
            value[k, i], accel[k, i] = state[i], total
