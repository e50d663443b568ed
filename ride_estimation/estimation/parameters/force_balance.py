# Copyright 2026 ride_estimation contributors
"""The force balance of the body as high-passed signals: what was measured, what the mounts explain, one column per parameter."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.estimation.common.block_math import cross
from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.forces.free_parameters import FreeParameter
from ride_estimation.estimation.forces.mount_law import MountLaw
from ride_estimation.estimation.kinematics.bracket_tilt import BracketTilt
from ride_estimation.estimation.parameters.balance_kernel import high_pass_block, integrate_block, low_pass_block
from ride_estimation.estimation.sensor_errors.installed_errors import InstalledErrors, Motion
from ride_estimation.frames import AXES, skew

Array = NDArray[np.float64]

#: rate above which the balance is averaged over neighbouring ticks [Hz]
HIGHEST_RATE = 130.0
#: memory of the size of forces [s]
_MEMORY = 5.0
#: relative step of the derivative with respect to a multiplier of a nonlinear element
_STEP = 1e-3
#: standard deviation of the moving force of a mount over its static one, where the motion of its base is not measured: more than
#: a road brings
_UNSEEN_SHARE = 0.3
#: unit of an offset of the CG among the parameters [m]: as much to the balance as a change of the mounts by a tenth
OFFSET_UNIT = 0.1


@dataclasses.dataclass(frozen=True)
class BalanceInput:
    """What one block contributes, shapes (K, 6) and (K, M, 3): the wrench the mounts carry, relative acceleration, deflection and
    rate, rotation against the brackets and its rate, dynamic part of the mount forces; rotation of the frame that the brackets
    do not make, shape (K, 3); specific force of the brackets, bracket axes.
    """

    support: Array
    relative: Array
    deflection: Array
    rate: Array
    turn: Array
    turn_rate: Array
    dynamic: Array
    frame_turn: Array
    base: Array

    @staticmethod
    def join(parts: list[BalanceInput]) -> BalanceInput:
        """Return several blocks as one."""
        names = [f.name for f in dataclasses.fields(BalanceInput)]
        return BalanceInput(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in names})


@dataclasses.dataclass(frozen=True)
class BalanceChunk:
    """High-passed accelerations at K averaged ticks.

    Attributes
    ----------
    measured
        Acceleration the mounts cause, from the body's motion, shape (K, 6).
    modelled
        The same from the mount law with the present multipliers, shape (K, 6).
    columns
        Derivative of ``modelled`` by the logarithm of every multiplier, then by the follow share, then by the logarithm of every
        inverse principal inertia that is estimated, then by every offset of the CG [``OFFSET_UNIT``], then by the
        second order of the deflection along both horizontal axes of every mount, then by every error of the installed sensors,
        shape (K, 6, N + 1 + R + O + 2 M + E).
    step
        Distance of the ticks [s].
    """

    measured: Array
    modelled: Array
    columns: Array
    step: float


def inverse_mass(geometry: Geometry) -> Array:
    """Return the inverse of the mass matrix about the CG, zero for coordinates the body does not have, shape (6, 6)."""
    free = np.flatnonzero(geometry.free)
    mass_matrix = np.zeros((6, 6))
    mass_matrix[:3, :3] = geometry.body.mass.value * np.eye(3)
    mass_matrix[3:, 3:] = geometry.body.inertia
    inverse = np.zeros((6, 6))
    inverse[np.ix_(free, free)] = np.linalg.inv(mass_matrix[np.ix_(free, free)])
    return inverse


def unseen_acceleration(geometry: Geometry) -> Array:
    """Return the covariance of the body's acceleration by mount forces along axes whose base is not measured, shape (6, 6).

    With forces of standard deviation ``s`` of the static load, ``M^-1 G s^2 G^T M^-1``: so much more than the noise of sensors
    that nothing is learned along what such forces do to the body, however large they are.
    """
    observable = geometry.base_observable
    if observable.all():
        return np.zeros((6, 6))
    load = _UNSEEN_SHARE * geometry.file_mass * geometry.vehicle.gravity / max(len(geometry.mounts), 1)
    push = inverse_mass(geometry) @ geometry.wrench[:, ~observable.ravel()]
    return np.asarray(load**2 * push @ push.T)


def weighed_share(geometry: Geometry) -> float:
    """Return which share of what sets the scale cannot be made up for by unknown forces at mounts without a base sensor.

    Mass and inertia are the scale of all stiffness. Mounts whose line passes by the CG may carry it alone, whatever the others
    do, but no moment about that line: ``max |(1 - W W^+) e|`` with the columns ``[1, y / L, -x / L]`` of those mounts in W
    and e a force or moment that accelerates the body; moments count where the file states how well the inertia is known.
    """
    arms = geometry.arms[~geometry.base_observable[:, 2], :2]
    length = float(np.sqrt(np.mean(np.sum(geometry.arms[:, :2] ** 2, axis=1)))) or 1.0
    free = geometry.free[2:5]
    unseen = np.column_stack([np.ones(len(arms)), arms[:, 1] / length, -arms[:, 0] / length]).T[free]
    rest = np.eye(len(unseen)) - unseen @ np.linalg.pinv(unseen) if len(arms) else np.eye(len(unseen))
    counts = np.array([True, *(2 * [geometry.body.inertia_relative_std is not None])])[free]
    return float(np.linalg.norm(rest[:, counts], axis=0).max(initial=0.0))


class ForceBalance:
    """High-passed force balance, chunk by chunk.

    Parameters
    ----------
    geometry
        Body and mounts.
    tilting
        How the brackets tilt with their frame.
    free_parameters
        Multipliers to be estimated.
    law
        The mount elements with their present multipliers.
    corner_hz
        Corner of the common high-pass [Hz].
    turns
        Axes (0 to 2) about which the inertia is estimated.
    offsets
        Axes (0 to 2) along which the CG may lie off its place in the file.
    errors
        Of the sensors.
    """

    def __init__(
        self, geometry: Geometry, tilting: BracketTilt, free_parameters: tuple[FreeParameter, ...], law: MountLaw,
        corner_hz: float, errors: InstalledErrors, turns: tuple[int, ...] = (), offsets: tuple[int, ...] = (),
    ) -> None:  # fmt: skip
        self.geometry = geometry
        self.free_parameters = free_parameters
        self.law = law
        self.corner = 2.0 * np.pi * corner_hz
        self._count = len(geometry.mounts)
        self._linear = np.ones((self._count, 3), dtype=bool)
        for i, mount in enumerate(geometry.mounts):
            for a, axis in enumerate(AXES):
                element = mount.elements.get(axis)
                self._linear[i, a] = element is None or isinstance(element, KelvinVoigt)
        self._variants = None if self._linear.all() else [MountLaw(geometry) for _ in range(3)]
        self.turns, self.offsets, self._errors = turns, offsets, errors
        #: axes that have a column of the second order, both horizontal ones of every mount, and their number
        self._horizontal = np.arange(3 * self._count).reshape(-1, 3)[:, :2].ravel()
        self.turned_count = len(self._horizontal)
        self._file_inverse = inverse_mass(geometry)
        self._file_mass = np.linalg.pinv(self._file_inverse, hermitian=True)
        self._tilting = tilting
        self._parameter_axis = np.array([3 * s.mount + s.axis for s in free_parameters], dtype=np.int64)
        self._parameter_role = np.array([s.role for s in free_parameters], dtype=np.int64)
        self.scale_inertia(np.zeros(len(turns)))
        self.reset()

    def scale_inertia(self, logs: Array) -> None:
        """Take the inertia as the file's over ``exp(logs)`` about the estimated axes, shape (R,)."""
        root = self._root(logs)
        self.inverse_mass = root[:, None] * self._file_inverse * root
        #: acceleration per unit tension of every mount axis, (6, 3 M)
        self.push = -self.inverse_mass @ self.geometry.wrench
        turn = np.eye(6)[:, [3 + a for a in self.turns]]
        #: acceleration per unit of what every parameter scales, (6, N + 1 + R + O + 2 M + E)
        still = np.zeros((6, len(self.offsets) + self.turned_count + self._errors.count))
        self.direction = np.ascontiguousarray(np.hstack([self.push[:, self._parameter_axis], np.zeros((6, 1)), turn, still]))

    def _root(self, logs: Array) -> Array:
        root = np.ones(6)
        root[[3 + a for a in self.turns]] = np.exp(0.5 * logs)
        return root

    def inertia_map(self, new: Array, old: Array) -> Array:
        """Return what takes accelerations by the mounts from one inertia (logarithms as above) to another, shape (6, 6)."""
        ratio = self._root(new), self._root(old)
        step = ratio[0] / ratio[1]
        moved = (ratio[0][:, None] * self._file_inverse * step) @ (self._file_mass / ratio[1])
        return np.asarray(moved)

    def reset(self) -> None:
        """Start the filters again."""
        n = 3 * self._count
        self._input = np.zeros((3, n))
        self._tilt = np.zeros((3, n))
        self._frame_turn = np.zeros((8, 3))
        self._integrators = np.zeros((9, n))
        self._turned = np.zeros((7, 2 * n))
        self._wrench = np.zeros((7, 12 + 6 * len(self.offsets)))
        self._nonlinear = np.zeros((7, 3 * n))
        self._base, self._base_integrators = np.zeros((8, n)), np.zeros((9, n))
        self._offset: tuple[Array, Array, Array] | None = None
        #: mean squared tension per unit gain of every axis of a base sensor, shape (3 M,)
        self.read_square = np.zeros(n)
        #: high-passed deflections and rates of the last chunk, (K, 3 M) each
        self.moved = np.zeros((0, n)), np.zeros((0, n))
        #: displacement, rate and acceleration of the bases, the same, (K, 3 M) each
        self.moved_bases: Motion = (np.zeros((0, n)),) * 3
        self._left: list[Array] = []

    def stiffness_matrices(self) -> tuple[Array, Array]:
        """Return what displacement and rate of the body add to the deflections' forces, (6, 6) each, as acceleration."""
        p = self.geometry.wrench.T
        k, c = self.law.stiffness.ravel(), self.law.damping.ravel()
        return self.push @ (k[:, None] * p), self.push @ (c[:, None] * p)

    def static_turn(self, static_force: Array, follow: float) -> Array:
        """Return the acceleration that a rotation of the body against its static loads causes, shape (6, 3)."""
        total = np.zeros((6, 3))
        for i, arm in enumerate(self.geometry.arms):
            turned = skew(static_force[i])
            total += np.vstack([turned, skew(arm) @ turned])
        return np.asarray(follow * self.inverse_mass @ total)

    def observe(self, data: BalanceInput, static_force: Array, follow: float, dt: float) -> BalanceChunk:
        """Filter a chunk.

        Parameters
        ----------
        data
            Blocks of the chunk joined.
        static_force
            Static force on the body by each mount, shape (M, 3).
        follow
            Share of the rotation of the brackets that the mount forces follow: 1 axes of the bracket, 0 axes of the body.
        dt
            Tick [s].
        """
        ticks, n = len(data.support), 3 * self._count
        second = cross(data.turn, data.deflection)
        second_rate = cross(data.turn_rate, data.deflection) + cross(data.turn, data.rate)
        x_full, v_full = data.deflection + follow * second, data.rate + follow * second_rate
        # what turns with the brackets: the dynamic force here, the static one after the filters, where the tilt is exact
        turned_wrench = cross(data.turn, data.dynamic).reshape(ticks, n) @ self.geometry.wrench.T
        both = np.hstack([(data.support + follow * turned_wrench) @ self.inverse_mass.T, turned_wrench @ self.inverse_mass.T])
        if self.offsets:
            both = np.hstack([both, self._offset_columns(data.support)])
        relative, base = data.relative.reshape(ticks, n), data.base.reshape(ticks, n)
        if self._offset is None:
            self._offset = (relative.mean(axis=0), both.mean(axis=0), base.mean(axis=0))
        x, v, turn = self._integrate(relative - self._offset[0], data.frame_turn, dt)
        accelerations = np.empty_like(both)
        high_pass_block(both - self._offset[1], self.corner, dt, self._wrench, accelerations)
        static = cross(turn.reshape(ticks, self._count, 3), static_force).reshape(ticks, n) @ self.geometry.wrench.T
        accelerations[:, 6:12] += static @ self.inverse_mass.T
        accelerations[:, :6] += follow * static @ self.inverse_mass.T
        turned = np.empty((ticks, 2 * n))
        high_pass_block(
            np.hstack([second.reshape(ticks, n), second_rate.reshape(ticks, n)]), self.corner, dt, self._turned, turned
        )
        x, v = x + follow * turned[:, :n], v + follow * turned[:, n:]
        self.moved = x, v
        elastic, viscous, rest = self._parts(x, v, x_full, v_full, dt)
        average = max(1, int(np.ceil(1.0 / (dt * HIGHEST_RATE))))
        # the follow share moves the measured side, hence the sign, and the deflections
        held = follow * accelerations[:, [9 + a for a in self.turns]]
        moved = turned[:, :n] * self.law.stiffness.ravel() + turned[:, n:] * self.law.damping.ravel()
        accelerations[:, 6:12] = moved @ self.push.T - accelerations[:, 6:12]
        # where the CG lies moves the measured side too
        accelerations[:, 12:] *= -1.0
        self.moved_bases = base_x, base_v, _ = self._moved_bases(base - self._offset[2], dt)
        read = base_x * self.law.stiffness.ravel() + base_v * self.law.damping.ravel()
        self.read_square += min(ticks * dt / _MEMORY, 1.0) * (np.mean(read**2, axis=0) - self.read_square)
        body = [self._errors.body_motion(own, of_base) for own, of_base in ((x, base_x), (v, base_v))]
        signals = [accelerations, held, *body, *self.moved_bases, moved[:, self._horizontal], elastic, viscous, rest]
        return self._assemble(self._averaged(np.hstack(signals), average), n, dt * average)

    def _offset_columns(self, support: Array) -> Array:
        """Return by how much the measured acceleration rises per unit of every offset of the CG, shape (K, 6 O).

        An offset d adds the force ``m alpha x d`` and the moment ``d x F``.
        """
        angular, mass = (support @ self.inverse_mass.T)[:, 3:], self.geometry.body.mass.value
        added = []
        for axis in self.offsets:
            turn = OFFSET_UNIT * skew(np.eye(3)[axis])
            added.append(np.hstack([mass * (angular @ turn), -support[:, :3] @ turn]) @ self.inverse_mass.T)
        return np.hstack(added)

    def _moved_bases(self, base: Array, dt: float) -> Motion:
        """Return displacement, rate and acceleration of the bases, shape (K, 3 M) each."""
        passed, x, v, a = (np.empty_like(base) for _ in range(4))
        high_pass_block(base, self.corner, dt, self._base[:3], passed)
        integrate_block(passed, self.corner, dt, self._base_integrators, x, v)
        high_pass_block(passed, self.corner, dt, self._base[3:], a)
        return x, v, a

    def _integrate(self, relative: Array, frame_turn: Array, dt: float) -> tuple[Array, Array, Array]:
        """Return high-passed deflection, rate and rotation against the brackets, each (K, 3 M)."""
        ticks, n = relative.shape
        passed, slow = np.empty((ticks, n)), np.empty((ticks, n))
        high_pass_block(relative, self.corner, dt, self._input, passed)
        low_pass_block(relative, self.corner, dt, self._tilt, slow)
        # the trapezoidal rule loses (omega dt)^2 / 6 of a double integral
        tilt_map = self._tilting.maps.reshape(3 * self._count, -1)
        tilt = (slow - dt * dt / 6.0 * passed) @ tilt_map.T
        gravity = self.geometry.vehicle.gravity
        # two sections here, four more after: each as many as the signals it is added to went through
        twice, often = np.empty_like(frame_turn), np.empty_like(frame_turn)
        high_pass_block(frame_turn, self.corner, dt, self._frame_turn[:3], twice)
        high_pass_block(twice, self.corner, dt, self._frame_turn[3:], often)
        passed[:, 0::3] += gravity * (tilt[:, 1::3] + twice[:, 1:2])
        passed[:, 1::3] -= gravity * (tilt[:, 0::3] + twice[:, 0:1])
        x, v = np.empty((ticks, n)), np.empty((ticks, n))
        integrate_block(passed, self.corner, dt, self._integrators, x, v)
        return x, v, x @ tilt_map.T + np.tile(often, self._count)

    def _assemble(self, stacked: Array, n: int, step: float) -> BalanceChunk:
        measured, follow_column = stacked[:, :6], stacked[:, 6:12]
        widths = [6 * len(self.offsets), len(self.turns), 6, 6, n, n, n, self.turned_count]
        placed, held, *moved, turned, forces = np.split(stacked[:, 12:], np.cumsum(widths), axis=1)
        elastic, viscous, rest = forces[:, :n], forces[:, n : 2 * n], forces[:, 2 * n :]
        modelled = (elastic + viscous + rest) @ self.push.T
        chosen = np.where(self._parameter_role == 0, elastic[:, self._parameter_axis], viscous[:, self._parameter_axis])
        count = len(self.free_parameters)
        offset = count + 1 + len(self.turns)
        last = offset + len(self.offsets)
        first = last + self.turned_count
        columns = np.zeros((len(stacked), 6, first + self._errors.count))
        columns[:, :, last:first] = turned[:, None] * self.push[:, self._horizontal]
        body, base = (moved[0], moved[1]), (moved[2], moved[3], moved[4])
        columns[:, :, first:] = self._errors.columns(body, base, measured, self.push, self.law.stiffness, self.law.damping)
        columns[:, :, offset:last] = placed.reshape(len(stacked), len(self.offsets), 6).transpose(0, 2, 1)
        columns[:, :, :count] = chosen[:, None, :] * self.push[:, self._parameter_axis]
        columns[:, :, count] = follow_column
        for r, a in enumerate(self.turns):
            # what the mounts cause about the axis: dynamic forces here, what turns with the brackets on the measured side
            columns[:, 3 + a, count + 1 + r] = modelled[:, 3 + a] - held[:, r]
        return BalanceChunk(np.ascontiguousarray(measured), modelled, columns, step)

    def _averaged(self, stacked: Array, average: int) -> Array:
        """Average neighbouring ticks; what is left waits for the next chunk."""
        if average == 1:
            return stacked
        if self._left:
            stacked = np.concatenate([*self._left, stacked])
        whole = len(stacked) // average * average
        self._left = [stacked[whole:]] if whole < len(stacked) else []
        return np.asarray(stacked[:whole].reshape(-1, average, stacked.shape[1]).mean(axis=1))

    def _parts(self, x: Array, v: Array, x_full: Array, v_full: Array, dt: float) -> tuple[Array, Array, Array]:
        """Return the high-passed forces scaled by stiffness, by damping and by neither, each (K, 3 M)."""
        linear = self._linear.ravel()
        elastic = x * (self.law.stiffness.ravel() * linear)
        viscous = v * (self.law.damping.ravel() * linear)
        rest = np.zeros_like(elastic)
        if self._variants is None:
            return elastic, viscous, rest
        ticks, n = x.shape
        forces = []
        for variant, law in enumerate(self._variants):
            multipliers = self.law.multipliers.copy()
            if variant:
                multipliers[variant - 1] *= 1.0 + _STEP
            law.scale(multipliers)
            forces.append(law.tension(x_full, v_full, dt).reshape(ticks, n) * ~linear)
        raw = np.hstack([(forces[1] - forces[0]) / _STEP, (forces[2] - forces[0]) / _STEP, forces[0]])
        passed = np.empty_like(raw)
        high_pass_block(raw, self.corner, dt, self._nonlinear, passed)
        own_elastic, own_viscous, total = passed[:, :n], passed[:, n : 2 * n], passed[:, 2 * n :]
        return elastic + own_elastic, viscous + own_viscous, total - own_elastic - own_viscous
