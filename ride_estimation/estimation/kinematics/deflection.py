# Copyright 2026 ride_estimation contributors
"""Deflection of the mounts from the motion of body and bases and, where there are some, displacement transducers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.estimation.kinematics.bracket_tilt import BracketTilt
from ride_estimation.estimation.kinematics.deflection_kernel import deflection_block
from ride_estimation.estimation.motion.motion_block import MotionBlock
from ride_estimation.estimation.motion.slow_error import LastingAcceleration, with_slow_error
from ride_estimation.frames import AXES

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: growth of the bias of a relative acceleration [(m/s^2)^2/s]: temperature, slow tilt
_BIAS_DENSITY = np.array([1e-6, 1e-6, 1e-8])
#: standard deviation of the constant bias at the start [m/s^2]: two sensors; two sensors and a degree of tilt for x, y
_BIAS_STD = np.array([0.2, 0.2, 0.07])
#: deflection assumed before it is known [m]
_DEFLECTION_STD = np.array([2e-3, 2e-3, 8e-3])
#: rate of a motion nothing is known of over its deflection: cabs on their mounts [1/s]
_RATE_RATIO = 10.0
#: time in which such a motion comes to rest [s]
_COASTS = 0.2
#: standard deviation of the deflection of a mount that a faulty sensor made worthless [m]
_SPOILED_STD = 0.01
#: the same of its rate [m/s]
_SPOILED_RATE_STD = 0.1
#: time over which the slow deflection stays similar [s]
_CORRELATION_TIME = 0.3
#: relative acceleration while no base sensor measures it [m/s^2]
_UNKNOWN_RELATIVE = 5.0
#: memory of the amplitude [s]
_MEMORY = 5.0
_ATTACK = 0.1
#: time between two evaluations of the noise [s]
_RENEWAL = 0.05
#: slow share of the mean squared deflection that is not observable by equilibrium (twist of the frame), as a factor per axis
_MARGIN = np.array([0.2, 0.2, 0.05])
#: smallest deflection assumed [m]
_LEAST = np.array([1e-4, 1e-4, 2e-4])
#: largest deflection of a mount [m]: no suspension of a cab, seat or axle travels a metre
LARGEST_TRAVEL = 1.0
#: rigid deflection that equilibrium misses over what all the forces on the body deflect and the stated error, from which on the
#: integrals went astray: a file whose stiffness is off by half leaves two or three
_ASTRAY = 5.0
#: corner of the filter times how late the equilibrium of the last block is, up to which it may be fed back: the loop stays stable
#: to three times that for any ratio of damping to stiffness, and for a law twice as stiff as its tangent
_FED_BACK = 1.0
#: attributes that are part of a saved state
_SAVED = ("_state", "_p", "_mean_square", "_started", "_sized")


@dataclasses.dataclass(frozen=True)
class Equilibrium:
    """What the forces on the body say of rigid deflections.

    Attributes
    ----------
    now
        Deflection plus ``lag`` times its rate that spring and damper of every mount need for its share, shape (K, M, 3) [m].
    lag
        Damping over stiffness, shape (M, 3) [s].
    missing
        Deflection that the whole mount law asked for beyond the estimated one in the last block, shape (M, 3) [m].
    """

    now: Array
    lag: Array
    missing: Array


@dataclasses.dataclass(frozen=True)
class DeflectionBlock:
    """Deflection, rate, relative acceleration, rotation against the bracket (K, M, 3); rotation of the frame that the brackets do
    not make and its rate (K, 3); std of deflection and rate (M, 3); specific force of the brackets in bracket axes (K, M, 3).
    """

    deflection: Array
    rate: Array
    relative: Array
    turn: Array
    frame_turn: Array
    frame_turn_rate: Array
    std: Array
    rate_std: Array
    base: Array


class DeflectionEstimator:
    """Drift-free double integration of relative acceleration at every mount, fused with transducers.

    How fast drift leaks away follows from the noise and from the size of the deflection: a corner ``omega^4 = sigma^2 dt /
    (d^2 tau)``, d its standard deviation and tau the time over which it stays similar.

    Parameters
    ----------
    geometry
        Body, mounts, sensors.
    tilting
        How the brackets tilt with their frame.
    """

    def __init__(self, geometry: Geometry, tilting: BracketTilt) -> None:
        self.geometry = geometry
        self._tilting = tilting
        self._count = len(geometry.mounts)
        seen = geometry.base_seen
        #: axes along which the base of a mount is measured or follows from others as that of a rigid frame, shape (M, 3)
        self.has_base = np.tile(geometry.base_observable.any(axis=0), (self._count, 1))
        self._cross_sensitivity = geometry.tolerated_cross_sensitivity / math.sqrt(2.0)
        own = np.array([s.noise_std if s is not None else 0.0 for s in geometry.base_sensors]) ** 2
        self._base_variance = np.where(seen, own[:, None], _UNKNOWN_RELATIVE**2)
        wrench = geometry.wrench[geometry.free]
        #: part of deflections that a rigid motion makes, shape (3 M, 3 M)
        self._rigid = np.linalg.pinv(wrench) @ wrench
        self._slots = [
            (geometry.mount_names.index(s.mount), AXES.index(s.axis), s.noise_std**2) for s in geometry.transducers
        ]
        self._transducer_variance = np.ones((self._count, 3))
        self.has_transducer = np.zeros((self._count, 3), dtype=bool)
        for i, a, variance in self._slots:
            self._transducer_variance[i, a] = variance
            self.has_transducer[i, a] = True
        #: whether the deflections of the last block began from rest because equilibrium contradicted them
        self.began_anew = False
        self.reset()

    @property
    def known(self) -> BoolArray:
        """Return which mount axes have a deflection from sensors at all, shape (M, 3)."""
        return self.has_base | self.has_transducer

    def reset(self) -> None:
        """Start again from rest with wide uncertainty; how large deflections are is forgotten too."""
        self._mean_square, self._sized = np.tile(_MARGIN * _DEFLECTION_STD**2, (self._count, 1)), False
        self.restart()

    def restart(self) -> None:
        """Start again from rest; deflections may be as large as they were."""
        self._lasting = LastingAcceleration(self._cross_sensitivity)
        self._begin_from_rest()

    def _begin_from_rest(self) -> None:
        m = self._count
        self._state = np.zeros((4, m, 3))
        square = np.maximum(_DEFLECTION_STD**2, self._mean_square / _MARGIN)
        self._p = np.zeros((m, 3, 3, 3))
        self._p[:, :, 0, 0], self._p[:, :, 1, 1], self._p[:, :, 2, 2] = square, _RATE_RATIO**2 * square, _BIAS_STD**2
        self._started = False
        self._noise_age, self._held_noise = _RENEWAL, np.zeros((m, 3, 5))

    def restart_mounts(self, mounts: Sequence[int], earlier: Mapping[str, Any]) -> None:
        """Start some mounts again from rest with wide uncertainty after a faulty sensor; their biases are those of before it.

        Parameters
        ----------
        mounts
            Which start again.
        earlier
            From :meth:`save`, before the fault.
        """
        state, p = (np.array(earlier[name], dtype=float) for name in ("state", "p"))
        for m in mounts:
            self._state[:, m], self._mean_square[m] = state[:, m], earlier["mean_square"][m]
            self._state[:2, m] = 0.0
            for axis in range(3):
                self._p[m, axis] = np.diag([_SPOILED_STD**2, _SPOILED_RATE_STD**2, p[m, axis, 2, 2]])

    def forget_bias(self, mounts: Sequence[int]) -> None:
        """Take the bias at some mounts as no better known than at the start: their sensors are back after a long absence."""
        for i in mounts:
            self._p[i, :, 2, 2] += _BIAS_STD**2

    @property
    def constant(self) -> tuple[Array, Array]:
        """Return the constant horizontal readings of the bases against the body and their variance, shape (M, 2) each."""
        return -self._state[2, :, :2], self._p[:, :2, 2, 2].copy()

    def observe(
        self,
        motion: MotionBlock,
        base: Array,
        base_ok: BoolArray,
        measured: BoolArray,
        displaced: Array,
        displaced_ok: BoolArray,
        expected_square: Array,
        dt: float,
        equilibrium: Equilibrium | None = None,
    ) -> DeflectionBlock:
        """Integrate over the ticks of a block.

        Parameters
        ----------
        motion
            CG motion at the ticks.
        base, base_ok
            Specific force of the brackets in bracket axes (K, M, 3), finite; which spoke or could be made up for (K, M).
        measured
            Whether all of them spoke, shape (K,).
        displaced, displaced_ok
            Transducers (K, M, 3); which spoke.
        expected_square
            Mean squared deflection that the forces on the body and the stiffness let expect, shape (M, 3): it cannot drift.
        dt
            Tick [s].
        equilibrium
            None where it is not known.
        """
        ticks = len(base)
        shape = (ticks, self._count, 3)
        self.began_anew = equilibrium is not None and self._astray(equilibrium, expected_square)
        if self.began_anew:
            self._begin_from_rest()
            equilibrium = None
        deflection, rate, relative, turn = (np.zeros(shape) for _ in range(4))
        if not self._started:
            self._begin(motion, base)
        if not self._sized:
            self._mean_square, self._sized = _MARGIN * expected_square, True
        self._lasting.observe(motion.motion[:, :3], ticks * dt)
        frame_turn, frame_turn_rate = self._tilting.frame_turn(base, measured, dt)
        noise = self._noise_now(motion.covariance, ticks, dt)
        drawn, lag = self._drawn(equilibrium, noise, bool(base_ok[:, self.has_base.any(axis=1)].all()), ticks, dt)
        deflection_block(
            motion.motion, motion.rate, motion.valid, np.ascontiguousarray(base), base_ok, self.geometry.arms,
            self._tilting.maps, frame_turn, self.geometry.vehicle.gravity, dt, self._state, self._p, noise,
            displaced, displaced_ok, self._transducer_variance, drawn, lag, LARGEST_TRAVEL, math.exp(-dt / _COASTS), _RATE_RATIO,
            deflection, rate, relative, turn,
        )  # fmt: skip
        self._follow_size(_MARGIN * expected_square, ticks * dt)
        std, rate_std = np.sqrt(self._p[:, :, 0, 0]), np.sqrt(self._p[:, :, 1, 1])
        return DeflectionBlock(deflection, rate, relative, turn, frame_turn, frame_turn_rate, std, rate_std, base)

    def _astray(self, equilibrium: Equilibrium, expected_square: Array) -> bool:
        """Return whether equilibrium contradicts the deflections beyond any error of the mount law.

        A rotation theta turns gravity into a relative acceleration ``g theta^2 / 2``, which deflects the mounts and turns the
        body on: from some tenths of a radian on the integrals feed their own error faster than equilibrium draws them back, and
        their covariance, that of small rotations, does not contain.
        """
        size = np.maximum(np.maximum(self._mean_square / _MARGIN, expected_square), _LEAST**2)
        return bool((equilibrium.missing**2 > _ASTRAY**2 * (size + self._p[:, :, 0, 0])).any())

    def _drawn(
        self, equilibrium: Equilibrium | None, noise: Array, whole: bool, ticks: int, dt: float
    ) -> tuple[Array, Array]:
        """Return what deflections are drawn to (K, M, 3) and its lag (M, 3): rigid motion to equilibrium, deformation to nothing.

        The whole law is known to the residual of the last block only, and feeding that back makes a loop: it grows, faster and
        faster, where the filter follows quicker than a block, as it does while bases or the body are silent. Then spring and
        damper stand for the law, at once and without feedback.
        """
        lag = np.zeros((self._count, 3))
        if equilibrium is None:
            return np.zeros((ticks, self._count, 3)), lag
        late = ticks * dt + equilibrium.lag
        if whole and bool((noise[:, :, 0] * late**4 <= _FED_BACK**4 * noise[:, :, 2]).all()):
            target = (self._rigid @ self._state[0].ravel()).reshape(1, self._count, 3) + equilibrium.missing
            return np.repeat(target, ticks, axis=0), lag
        return np.ascontiguousarray(equilibrium.now), equilibrium.lag

    def _follow_size(self, square: Array, duration: float) -> None:
        """Follow the mean squared deflection, quickly up and slowly down: at rest the deflection is known to be small."""
        memory = np.where(square > self._mean_square, _ATTACK, _MEMORY)
        self._mean_square += np.minimum(duration / memory, 1.0) * (square - self._mean_square)

    def turn_rate(self, block: DeflectionBlock) -> Array:
        """Return the rate of the rotation of the body against each bracket, shape (K, M, 3) [rad/s]."""
        flat = block.rate.reshape(len(block.rate), 3 * self._count)
        relative = (flat @ self._tilting.maps.reshape(3 * self._count, 3 * self._count).T).reshape(block.rate.shape)
        return np.asarray(relative + block.frame_turn_rate[:, None])

    def _begin(self, motion: MotionBlock, base: Array) -> None:
        """Take the first relative acceleration as bias in x and y: it is mostly tilt of the sensors."""
        first = motion.motion[0, :3] - base[0]
        self._state[2, :, :2] = np.clip(first[:, :2], -0.5, 0.5) * self.has_base[:, :2]
        self._state[3] = self._state[2]
        self._started = True

    def _noise_now(self, covariance: Array, ticks: int, dt: float) -> Array:
        """Return the noise, renewed every tenth of a second."""
        self._noise_age += ticks * dt
        if self._noise_age >= _RENEWAL:
            self._noise_age, self._held_noise = 0.0, self._noise(covariance, dt)
        return self._held_noise

    def _noise(self, covariance: Array, dt: float) -> Array:
        """Return the noise that :func:`deflection_block` takes, shape (M, 3, 5)."""
        noise, square = np.empty((self._count, 3, 5)), np.maximum(self._mean_square, _LEAST**2)
        for a in range(3):
            noise[:, a, 0] = self._base_variance[:, a] + covariance[a, a]
        noise[:, :, 1] = _BIAS_DENSITY
        noise[:, :, 2] = square * _CORRELATION_TIME / dt
        # sensors on both sides whose angles and gains are not quite those of the file
        slow = 2.0 * self._lasting.error_variance
        if slow > 0.0:
            both = zip(noise[:, :, 0].ravel().tolist(), noise[:, :, 2].ravel().tolist())
            noise[:, :, 0] = np.reshape([with_slow_error(white, slow, held, dt) for white, held in both], (self._count, 3))
        # an error of the tilt, as slow as the drift of the vertical deflections, is an acceleration in the horizontal axes
        gravity = self.geometry.vehicle.gravity
        corner = np.mean(noise[:, 2, 0] / noise[:, 2, 2]) ** 0.25 / dt**0.5 if self._count else 1.0
        for a, row in ((0, 1), (1, 0)):
            tilt_variance = self._tilting.maps[:, row, 2::3] ** 2 @ self._p[:, 2, 0, 0]
            noise[:, a, 0] += gravity**2 * tilt_variance * 2.0 / (corner * dt)
        # white in continuous time, so that the answer does not depend on the tick
        noise[:, :, 3] = _UNKNOWN_RELATIVE**2 * 0.002 / dt
        noise[:, :, 4] = square / _MARGIN
        return noise

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        return {**fields_of(self, _SAVED), "lasting": self._lasting.save()}

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        take_fields(self, _SAVED, saved)
        self._lasting.load(saved["lasting"])
