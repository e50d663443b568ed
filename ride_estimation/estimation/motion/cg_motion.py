# Copyright 2026 ride_estimation contributors
"""CG motion from all accelerometer and gyro channels of a body by weighted least squares, with a residual test.

``y_j = e_j . (f + alpha x r_j + omega x (omega x r_j))`` per channel, f the specific force at the CG (gravity in it), so
``[f, alpha] = (H^T R^-1 H)^-1 H^T R^-1 (y - centripetal)``. The six-channel matrix B of document 000 eq. (3), (4) is the
case of six channels. The centripetal term takes omega from gyros or from integrated alpha.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.block_math import segment_ends
from ride_estimation.estimation.common.geometry import channel_geometry
from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.motion.centripetal import centripetal_covariance, centripetal_terms
from ride_estimation.estimation.motion.motion_block import MotionBlock
from ride_estimation.estimation.motion.motion_kernel import (
    LARGEST_RATE,
    cg_block,
    follow_slow,
    follow_speed,
    predict_block,
    remove_gravity,
)
from ride_estimation.estimation.motion.residual_covariance import (
    error_of_one,
    installation_variance,
    more_than_chance,
    residual_covariance,
)
from ride_estimation.estimation.motion.residual_rate import ResidualRate
from ride_estimation.estimation.motion.residuals import MEANINGFUL, ResidualSums, ResidualTest, residual_test
from ride_estimation.estimation.motion.sensor_drift import motion_error
from ride_estimation.estimation.motion.slow_error import LastingAcceleration, with_slow_error
from ride_estimation.estimation.sensor_errors.sensor_faults import FaultTest
from ride_estimation.sensors.installation import pooled
from ride_estimation.sensors.layout import measured_channels, motion_rows
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: standard deviation of an angular acceleration that no channel measures [rad/s^2]
UNKNOWN_ANGULAR_ACCEL = 20.0
#: standard deviation of a linear acceleration that no channel measures [m/s^2]
UNKNOWN_ACCEL = 100.0
#: growth of the bias of the angular acceleration from accelerometers [(rad/s^2)^2/s]
_BIAS_DENSITY = 1.0e-8
#: growth of the bias of gyros [(rad/s)^2/s]
_GYRO_BIAS_DENSITY = 1.0e-10
#: standard deviation of a constant bias of the angular acceleration at the start [rad/s^2]
_ALPHA_BIAS = 0.1
#: the same of gyros [rad/s]
_GYRO_BIAS = 0.02
#: angular rate about the vertical of a body without gyros [rad/s]
_YAW_STD = 0.1
#: how long it lasts [s]
_YAW_TIME = 3.0
_MASKS = 64
#: standard deviation of the angular rate from which on residuals count: before, centripetal terms are a guess [rad/s]
_RATE_KNOWN = 0.03
#: the same from which on they no longer do [rad/s]
_RATE_LOST = 0.15
#: ticks handled with one covariance of the angular rate
_LONGEST = 100
#: memory of the residual test [s]
_TEST_MEMORY = 60.0
#: longest time for which attitude and rates wait for the verdict on a gross error [s]
_HOLD = 0.5
#: ticks of residuals that say something
_LEAST_SUMS = 50.0
#: time after which a sensor that does not speak or is refused counts as left out [s]
_LEFT_OUT = 2.0
#: time in which attitude and rates are lost while the sensors that speak do not determine the motion [s]: a quarter of the period
#: of a cab that rolls or pitches
_COASTS = 0.2
#: what centripetal terms may be off while the angular rate is not known [m/s^2]: 2 * 0.2 rad/s * 0.2 rad/s * 1 m
_CENTRIPETAL = 0.08
#: time constant of each stage of the low-pass of the rate of the vehicle's speed [s]: wheel speeds are coarse
_SPEED_TIME = 0.1
#: what the rate of the vehicle's speed leaves of the longitudinal acceleration of the body, which shakes on its mounts [m/s^2]
_SURGE_ERROR = 0.2
#: time over which a stated error of the speed counts as such [s]
_SPEED_ERROR_TIME = 2.0
#: time over which horizontal acceleration counts as slow [s]
_SLOW_TIME = 1.0
#: memory of its size [s]
_SLOW_MEMORY = 2.0
#: attributes that are part of a saved state
_SAVED = ("_state", "_p_tilt", "_p_pitch", "_p_yaw", "_slow", "_slow_square", "_speed", "_surge", "_last_good")
#: time after which a difference of estimated tilt and specific force is an error of the tilt: nothing brakes for so long [s]
_LASTING = 10.0


@dataclasses.dataclass(frozen=True)
class Weights:
    """Least squares for the channels that speak: weights (6, C), covariance (6, 6), rank of the rows, mean variance of roll
    and pitch acceleration per unit variance of independent errors of the accelerometer channels.
    """

    matrix: Array
    covariance: Array
    residual_variance: Array
    rank: int
    turn_gain: float


class CgMotionEstimator:
    """Weighted least squares over all channels of one body, sample by sample.

    Parameters
    ----------
    sensors
        Accelerometers and IMUs of the body.
    cg
        Centre of gravity [m], shape (3,).
    free
        Which of the six coordinates the body has, shape (6,) bool; the others are zero.
    gravity
        [m/s^2].
    """

    def __init__(
        self, sensors: Sequence[Sensor], cg: Array, free: BoolArray, gravity: float, settings: PipelineSettings | None = None
    ) -> None:
        self.sensors = tuple(sensors)
        self.gyros = tuple(i for i, s in enumerate(self.sensors) if s.kind == "imu")
        self._free = np.asarray(free, dtype=bool)
        self._gravity, self._settings = gravity, settings or PipelineSettings()
        self._installation = pooled([s.tolerated_installation for s in self.sensors])
        directions, points = channel_geometry(self.sensors, np.asarray(cg, dtype=float))
        rows = motion_rows(self.sensors, np.asarray(cg, dtype=float))
        extra = 3 * len(self.gyros)
        self.directions = np.vstack([directions, np.zeros((extra, 3))])
        self.points = np.vstack([points, np.zeros((extra, 3))])
        self.rows = np.vstack([rows, *([np.hstack([np.zeros((3, 3)), np.eye(3)])] * len(self.gyros))])
        self._own_variance = np.concatenate([np.full(3, s.noise_std**2) for s in self.sensors])
        self.variance = self._own_variance.copy()
        self._along = np.sum(directions * points, axis=1)
        self._gyro_variance = np.array([self.sensors[i].gyro_noise_std ** 2 for i in self.gyros])
        #: which gyros measure angular rates: one whose unit or axes are wrong does not, see :mod:`gyro_check`
        self._gyro_fit = np.ones(len(self.gyros), dtype=bool)
        self._cache: dict[tuple[bytes, float], Weights] = {}
        self._needed = int(np.sum(self._free))
        #: standard deviation of the speed of the vehicle, where it is measured [m/s]
        self.speed_std = 0.0
        self._observed_tilt = bool(self._free[3] or self._free[4])
        self._sums = ResidualSums.empty(len(directions))
        self._accelerometer_rows = np.ascontiguousarray(self.rows[: len(directions)])
        #: what is estimated: along an axis that is no coordinate of a planar body gravity and motion of the base are there too
        self._estimated: BoolArray = self._free | (np.arange(6) < 3)
        self._unknowns = int(np.sum(self._estimated))
        #: channels that are measured, shape (3 S,); those of the others are zero, as are their rows
        self._measured = measured_channels(self.sensors)
        self._redundant = max(int(self._measured.sum()) - self._unknowns, 0)
        self._used_rows = np.ascontiguousarray(self._accelerometer_rows[:, self._estimated])
        self._centripetal = centripetal_terms(self.directions, self.points)
        redundant = self._redundant if self._free[3:].all() else 0
        offset = self._installation.offset(gravity)
        self._turning = ResidualRate(self._centripetal[: len(directions)], self._accelerometer_rows, redundant, offset)
        self.fault_test = FaultTest(self.sensors, self._used_rows, points[::3], 0.0 if self.gyros else _YAW_STD)
        self.fault_test.set_variance(self.variance)
        #: whether one of the sensors is grossly wrong and it is open which: a moment of that would rule the residuals of a minute
        self.inconsistent, self._held = False, 0.0
        #: sums of the residuals since the last evaluation, and ticks
        self._fresh, self._drift = np.zeros(len(directions) + 1), np.zeros((6, 6))
        #: sensors that spoke last, and how long it is those [s]
        self._mask: BoolArray = np.ones(len(self.sensors), dtype=bool)
        self._same, self._summed = 0.0, self._mask.copy()
        self.reset()

    def reset(self) -> None:
        """Forget attitude and rates; what the residuals showed stays."""
        self.fault_test.interrupt()
        self._turning.reset()
        self._begin_attitude()
        self._last_gyro: Array | None = None
        #: residuals while the angular rate is not known yet
        self._early = ResidualSums.empty(3 * len(self.sensors))
        self._last_good, self._slow = np.array([0.0, 0.0, self._gravity, 0.0, 0.0, 0.0]), np.zeros(4)
        s, self._lasting = self._settings, LastingAcceleration(self._installation.cross_sensitivity)
        #: last speed of the vehicle, stages of the low-pass of its rate, ticks; stages of that of the innovation of the pitch
        self._speed, self._surge = np.zeros(4), np.zeros(2)
        self._slow_square = (s.tilt_acceleration_std / self._gravity) ** 2 * s.tilt_correlation_time / (2.0 * _SLOW_TIME)

    def _begin_attitude(self) -> None:
        """Begin attitude and rates anew from the next specific force."""
        self._state, self._rate_known, self._rate_variance = np.zeros((5, 3)), False, np.zeros(3)
        self._p_tilt, self._p_yaw = self._first_covariance(), self._first_covariance()
        self._p_pitch = self._p_tilt.copy()

    def _first_covariance(self) -> Array:
        """Return the covariance of angle, rate and bias of an attitude that nothing is known of yet."""
        return np.diag([0.1**2, 0.0, _GYRO_BIAS**2] if self._gyro_fit.any() else [0.1**2, 0.2**2, _ALPHA_BIAS**2])

    def set_variance(self, sensor: int, variance: Array) -> None:
        """Use the variance that the messages of a sensor state [(m/s^2)^2], shape (3,)."""
        if not np.array_equal(self.variance[3 * sensor : 3 * sensor + 3], variance):
            self.variance[3 * sensor : 3 * sensor + 3] = variance
            self._cache.clear()
            self.fault_test.set_variance(self.variance)

    def leave_out_gyros(self, gyros: Iterable[int]) -> None:
        """Take angular rates from the other gyros or else from the accelerometers; attitude and rates begin anew."""
        for gyro in gyros:
            self._gyro_fit[gyro] = False
            self._cache.clear()
            points, rate_std = self.points[: 3 * len(self.sensors) : 3], 0.0 if self._gyro_fit.any() else _YAW_STD
            self.fault_test = FaultTest(self.sensors, self._used_rows, points, rate_std)
            self.fault_test.set_variance(self.variance)
            self._sums = ResidualSums.empty(3 * len(self.sensors))
            self.reset()

    def weights(self, mask: BoolArray, dt: float) -> Weights:
        """Return the least squares for the channels that speak.

        Directions nothing observes get a wide prior instead of a singular matrix: their estimate is zero, their standard
        deviation says so.

        Parameters
        ----------
        mask
            Per sensor, shape (S,) bool.
        dt
            Tick [s], for the noise of differentiated gyro rates.
        """
        key = (mask.tobytes(), dt)
        found = self._cache.get(key)
        if found is not None:
            return found
        channels = np.repeat(mask, 3)
        gyro_ok = np.repeat(mask[list(self.gyros)] & self._gyro_fit, 3) if self.gyros else np.zeros(0, dtype=bool)
        variance = np.concatenate([self.variance, np.repeat(2.0 * self._gyro_variance / dt**2, 3)])
        inverse = np.concatenate([channels, gyro_ok]) / variance
        prior = np.diag(np.where(self._estimated, np.repeat([UNKNOWN_ACCEL**-2, UNKNOWN_ANGULAR_ACCEL**-2], 3), 1e12))
        information = self.rows.T @ (inverse[:, None] * self.rows)
        covariance = np.linalg.inv(information + prior)
        covariance = 0.5 * (covariance + covariance.T)
        matrix = covariance @ (self.rows.T * inverse)
        n = 3 * len(self.sensors)
        residual_variance = self.variance - np.einsum("ij,jk,ik->i", self.rows[:n], covariance, self.rows[:n])
        scaled = self.rows[np.concatenate([channels, gyro_ok])][:, self._free]
        rank = int(np.linalg.matrix_rank(scaled, tol=1e-6)) if scaled.size else 0
        turn_gain = 0.5 * float(np.sum(matrix[3:5, :n] ** 2))
        if len(self._cache) >= _MASKS:
            self._cache.clear()
        made = Weights(np.ascontiguousarray(matrix), covariance, np.maximum(residual_variance, 0.0), rank, turn_gain)
        return self._cache.setdefault(key, made)

    def observe(
        self, samples: Array, gyro: Array, valid: BoolArray, dt: float, speed: tuple[Array, BoolArray] | None = None
    ) -> MotionBlock:
        """Estimate the motion at the ticks of a block.

        Parameters
        ----------
        samples
            Accelerometer channels in sensor axes and file order, shape (K, 3 S), finite.
        gyro
            Angular rates of the IMUs in sensor axes, shape (K, 3 G).
        valid
            Shape (K, S).
        dt
            Tick [s].
        speed
            Speed of the vehicle, shape (K,) [m/s], and at which ticks it is measured; None where no sensor measures it.
        """
        ticks = len(samples)
        surge = self._surge_at(speed, ticks, dt)
        out = MotionBlock(
            np.zeros((ticks, 6)), np.zeros((6, 6)), np.zeros((ticks, 3)), np.zeros((ticks, 3)), 0.0,
            np.zeros((ticks, 3 * len(self.sensors))), np.ones(ticks, dtype=bool),
        )  # fmt: skip
        samples = np.ascontiguousarray(samples)
        body_gyro = self.body_rates(gyro)
        covariance, start = np.zeros((6, 6)), 0
        # rates and tilt are integrals: a gross error of a moment would stay in them for seconds
        before = self._state.copy() if self.inconsistent and self._held < _HOLD else None
        for stop in segment_ends(valid, _LONGEST):
            own = (samples[start:stop], body_gyro[start:stop], surge[start:stop])
            covariance = self._segment(*own, valid[start], dt, out, slice(start, stop))
            start = stop
        self._held = self._held + ticks * dt if self.inconsistent else 0.0
        if before is not None:
            self._state = before
        pitch = self._p_pitch if self._speed[3] > 0.0 else self._p_tilt
        variances = [float(p[0, 0]) if self._observed_tilt else 0.0 for p in (self._p_tilt, pitch)]
        return MotionBlock(
            out.motion, covariance, out.rate, out.tilt, variances[0], out.predicted, out.valid, self._rate_variance, variances[1]
        )

    def body_rates(self, gyro: Array) -> Array:
        """Return gyro rates in body axes, shape (K, G, 3)."""
        rates = np.zeros((len(gyro), len(self.gyros), 3))
        for g, i in enumerate(self.gyros):
            rates[:, g] = gyro[:, 3 * g : 3 * g + 3] @ self.sensors[i].rotation.T
        return rates

    def _surge_at(self, speed: tuple[Array, BoolArray] | None, ticks: int, dt: float) -> Array:
        """Return the rate of the vehicle's speed, shape (K,) [m/s^2], zero where it is not measured."""
        surge = np.zeros(ticks)
        if speed is not None:
            follow_speed(*speed, self._speed_gain(dt), dt, self._speed, surge)
        return surge

    @staticmethod
    def _speed_gain(dt: float) -> float:
        return -math.expm1(-dt / _SPEED_TIME)

    def _segment(
        self, y: Array, gyro: Array, surge: Array, mask: BoolArray, dt: float, out: MotionBlock, where: slice
    ) -> Array:
        """Estimate over ticks with the same channels; write into ``out`` and return the covariance."""
        weights = self.weights(mask, dt)
        needed = self._needed
        if weights.rank < self._determined(dt):
            out.motion[where], out.tilt[where], out.valid[where] = self._last_good, self._state[0], False
            self._coast(len(y) * dt)
            self.fault_test.interrupt()
            return weights.covariance
        gyro_mask = mask[list(self.gyros)] & self._gyro_fit if self.gyros else np.zeros(0, dtype=bool)
        use_gyro = bool(gyro_mask.any())
        mean_rate = gyro[:, gyro_mask].mean(axis=1) if use_gyro else np.zeros((len(y), 3))
        if self.gyros:
            before = gyro[:1] if self._last_gyro is None else self._last_gyro[None]
            difference = np.diff(np.concatenate([before, gyro]), axis=0) / dt
            self._last_gyro = gyro[-1].copy()
            y_all = np.hstack([y, difference.reshape(len(y), -1)])
        else:
            y_all = y
        noise = self._filter_noise(weights, dt)
        motion, rate, tilt, predicted = out.motion[where], out.rate[where], out.tilt[where], out.predicted[where]
        measured = self._speed[3] > 0.0
        if not measured:
            self._surge[:], self._p_pitch = 0.0, self._p_tilt.copy()
        cg_block(
            np.ascontiguousarray(y_all), self.directions, self.points, weights.matrix, np.ascontiguousarray(mean_rate), use_gyro,
            self._gravity, dt, self._state, self._p_tilt, self._p_pitch, self._p_yaw, noise, surge,
            self._speed_gain(dt) if measured else 0.0, self._surge, motion, rate, tilt,
        )  # fmt: skip
        self._last_good = motion[-1].copy()
        # how much slow horizontal acceleration disturbs the tilt seen by the specific force (braking, bends)
        slow, size, mean = (-math.expm1(-len(y) * dt / time) for time in (_SLOW_TIME, _SLOW_MEMORY, _LASTING))
        self._lasting.observe(motion[:, :3], len(y) * dt)
        self._slow_square = float(
            follow_slow(motion, tilt, surge, self._gravity, slow, size, mean, self._slow, self._slow_square)
        )
        diverged = not use_gyro and bool(np.abs(rate).max() >= LARGEST_RATE)
        if weights.rank != needed or diverged:
            out.valid[where] = False
        predict_block(motion, rate, self._accelerometer_rows, self.directions, self.points, predicted)
        self._rate_known = use_gyro or bool(self._p_tilt[1, 1] < (_RATE_LOST if self._rate_known else _RATE_KNOWN) ** 2)
        if diverged:
            self._begin_attitude()
        observed = weights.rank == needed and not self.inconsistent and not diverged and self._observes(mask, len(y) * dt)
        if observed:
            # of a sensor that is left out since long nothing is asked; the others go on being compared
            said = y if mask.all() else np.where(np.repeat(mask, 3), y, predicted)
            (self._sums if self._rate_known else self._early).add(
                said, predicted, motion, math.exp(-len(y) * dt / _TEST_MEMORY), dt
            )
            left = said - predicted
            self._fresh += [*np.sum(left, axis=0), len(y)]
            if not use_gyro and mask.all() and self._turning.observe(left, rate, dt):
                own, white, lasts = weights.matrix[:, : y.shape[1]], float(np.mean(self.variance)), self._lasting.error_variance
                self._turning.correct(own, white, lasts, self._state, self._p_tilt, self._p_yaw, dt)
        if observed and self._rate_known:
            self.fault_test.observe(said, motion, rate, dt)
        else:
            self.fault_test.interrupt()
        return weights.covariance + self._rate_contribution(weights, rate, use_gyro)

    def _determined(self, dt: float) -> int:
        """Return the rank from which on the motion is no guess: that of all coordinates, or of all sensors where it is less."""
        return min(self._needed, max(self.weights(np.ones(len(self.sensors), dtype=bool), dt).rank, 1))

    def _coast(self, duration: float) -> None:
        """Let attitude and rates go on without sensors: a body on mounts comes to rest, and what was known of it is lost.

        A centripetal term of a guessed rate would feed the guess of the next.
        """
        left = math.exp(-duration / _COASTS)
        p_tilt, p_pitch, p_yaw = (self._first_covariance() for _ in range(3))
        for own, first in ((self._p_tilt, p_tilt), (self._p_pitch, p_pitch), (self._p_yaw, p_yaw)):
            first[2, 2] = own[2, 2]  # biases do not move
            own[:] = left * own + (1.0 - left) * first
        self._state[1] *= left
        self._state[3] = self._state[2] if not self._gyro_fit.any() else 0.0
        self._last_gyro = None

    def _observes(self, mask: BoolArray, duration: float) -> bool:
        """Return whether the residuals of a set of sensors say something: all of them, or since long the same ones."""
        if not np.array_equal(mask, self._mask):
            self._mask, self._same = mask.copy(), 0.0
        self._same += duration
        if self._same > _LEFT_OUT and not mask.all() and not np.array_equal(mask, self._summed):
            # what a sensor left in the residuals before it was left out says nothing about the others
            self._summed, self._sums = mask.copy(), ResidualSums.empty(3 * len(mask))
        left = int((np.repeat(mask, 3) & self._measured).sum())
        return bool(mask.all()) or (self._same > _LEFT_OUT and left > self._unknowns)

    def _rate_contribution(self, weights: Weights, rate: Array, use_gyro: bool) -> Array:
        """Return what the error of the angular rate adds to the covariance of the motion, shape (6, 6)."""
        at, more = (2, float(np.mean(self._gyro_variance)) / len(self.gyros)) if use_gyro else (1, 0.0)
        self._rate_variance = self._free[3:] * (np.array([p[at, at] for p in (self._p_tilt, self._p_tilt, self._p_yaw)]) + more)
        return centripetal_covariance(weights.matrix, self._centripetal, rate, self._rate_variance)

    def _filter_noise(self, weights: Weights, dt: float) -> Array:
        s = self._settings
        start = (s.tilt_acceleration_std / self._gravity) ** 2 * s.tilt_correlation_time
        tilt = min(max(2.0 * _SLOW_TIME * self._slow_square, 1e-3 * start), 30.0 * start) / dt
        gyro = float(np.mean(self._gyro_variance)) / max(len(self.gyros), 1) if self.gyros else 0.0
        alpha = 0.5 * float(weights.covariance[3, 3] + weights.covariance[4, 4])
        bias = _GYRO_BIAS_DENSITY if self._gyro_fit.any() else _BIAS_DENSITY
        # wrong angles and gains turn an acceleration that lasts into an angular acceleration: slow, not white
        alpha = with_slow_error(alpha, self._lasting.error_variance * weights.turn_gain, tilt, dt)
        surge = math.hypot(_SURGE_ERROR, self.speed_std / _SPEED_ERROR_TIME) / self._gravity
        pitch = surge**2 * s.tilt_correlation_time / dt
        return np.array([alpha, _BIAS_DENSITY, tilt, _YAW_STD**2 * _YAW_TIME / dt, gyro, bias, _GYRO_BIAS**2, pitch])

    def predict(self, motion: Array, rate: Array) -> Array:
        """Return what the accelerometers read for a motion, sensor axes, shape (K, 3 S)."""
        predicted = np.empty((len(motion), 3 * len(self.sensors)))
        predict_block(motion, rate, self._accelerometer_rows, self.directions, self.points, predicted)
        return predicted

    def accelerate(self, block: MotionBlock) -> tuple[Array, Array]:
        """Return acceleration without gravity (K, 6) and its covariance (6, 6).

        ``a = f - R^T [0, 0, g]`` with the tilt estimate; the tilt's variance adds ``g^2 var`` to x and y.
        """
        g = self._gravity
        accel = np.empty_like(block.motion)
        remove_gravity(block.motion, block.tilt, g, self._free, accel)
        covariance = block.covariance.copy()
        covariance[0, 0] += g**2 * block.pitch_variance
        covariance[1, 1] += g**2 * block.roll_variance
        return accel, covariance

    def residual_test(self) -> ResidualTest:
        """Judge the residuals gathered so far and name the sensor that explains them best."""
        return self._sized().with_fault(self.fault_test.judge())

    def contradicting(self, ratio: float) -> str:
        """Return the sensor that contradicts the others most where the ratio of the residual test is above one, else empty."""
        # with a sensor left out hardly any redundancy is left that would show more; without tolerances the ratio is larger
        ratio = ratio if self._mask.all() else MEANINGFUL
        sums, stated = self._compared()
        if sums.count == 0.0 or sums.noise_ratio(stated) <= 0.5 * ratio * max(self._redundant, 1):
            return ""
        test = self._sized()
        return test.sensor if test.ratio > ratio else ""

    def disagreement(self, dt: float) -> tuple[float, Array, Array]:
        """Return what the residuals of the last minute ask of the covariance of the motion: a factor on the std, and an addition.

        Scaled and widened by what all residuals show, see :mod:`residual_covariance`. Where they are more than noise and
        tolerances explain, what an error of the sensor that explains them best does to the motion is added, gradually up to
        twice that. What is constant is kept apart, as nothing is learned from constant parts of a motion.

        Parameters
        ----------
        dt
            Tick [s].

        Returns
        -------
        tuple
            Factor, at least 1; what moving residuals add, shape (6, 6); what their constant part adds, shape (6, 6).
        """
        drift = self._follow_drift(dt)
        sums, stated = self._compared()
        used = np.flatnonzero(np.repeat(self._mask, 3) & self._measured)
        if sums.count < _LEAST_SUMS:
            return 1.0, np.zeros((6, 6)), drift
        weights = self.weights(self._mask, dt).matrix[:, : len(stated)]
        if len(used) <= self._unknowns:
            # no redundancy shows the errors of the sensors: it is as large as their installation says
            errors = installation_variance(self.sensors, sums.signal_mean / sums.count, sums.dynamic())
            added, constant = (weights[:, used] * e[used] @ weights[:, used].T for e in errors)
            return 1.0, added, constant
        mean, moving = sums.moments()
        redundant = len(used) - self._unknowns
        own = np.diagonal(moving)[used], stated[used], weights[:, used]
        factor, biases = residual_covariance(mean[used], *own, sums.count, redundant)
        constant = biases + drift
        if sums is self._sums:
            self._lasting.learn_share(np.diagonal(moving)[used], stated[used], sums.dynamic()[used], redundant)
        if sums.noise_ratio(self.variance) / max(self._redundant, 1) <= MEANINGFUL:
            return factor, np.zeros((6, 6)), constant
        test = residual_test(sums, stated, self._used_rows, self.sensors, self._gravity)
        share = min(max(math.sqrt(test.ratio / MEANINGFUL) - 1.0, 0.0), 1.0)
        if share == 0.0 or not test.sensor:
            return factor, np.zeros((6, 6)), constant
        sensor = [s.name for s in self.sensors].index(test.sensor)
        reading = sums.signal_mean / sums.count
        one, steady = error_of_one(self._accelerometer_rows, weights, sensor, mean, moving, reading, sums.dynamic())
        return factor, share**2 * one, share**2 * steady + constant

    def _follow_drift(self, dt: float) -> Array:
        """Return what constant parts of the residuals that moved since long add to the covariance of the motion, shape (6, 6).

        A sensor that drifts turns into a constant motion, taken as the error of the sensor that explains the change best. On an
        angular one attitude and rates would run away: the bias of that is as open as the change is large.
        """
        (*fresh, ticks), self._fresh = self._fresh, np.zeros_like(self._fresh)
        if self._redundant == 0 or self._sums.count < _LEAST_SUMS or ticks == 0.0:
            return np.zeros((6, 6)) if ticks else self._drift
        before, self._drift = np.diagonal(self._drift), np.zeros((6, 6))
        mean, moving = self._sums.moments()
        change = np.array(fresh) / ticks - mean
        if more_than_chance(change, np.diagonal(moving), ticks, self._redundant, self._installation.bias):
            moved = motion_error(change, self._accelerometer_rows, self.weights(self._mask, dt).matrix[:, : len(change)])
            self._drift = np.outer(moved, moved)
        if not self._gyro_fit.any():  # where a drift ends the bias is as open as where it goes on
            roll, pitch, yaw = np.maximum(before, np.diagonal(self._drift))[3:].tolist()
            self._p_pitch[2, 2] = max(self._p_pitch[2, 2], pitch)
            self._p_tilt[2, 2], self._p_yaw[2, 2] = max(self._p_tilt[2, 2], roll, pitch), max(self._p_yaw[2, 2], yaw)
        return self._drift

    def _compared(self) -> tuple[ResidualSums, Array]:
        """Return the residuals that count, those of an unknown angular rate where there are no others, and their variance."""
        early = self._sums.count < _LEAST_SUMS
        return (self._early, self.variance + _CENTRIPETAL**2) if early else (self._sums, self.variance)

    def _sized(self) -> ResidualTest:
        return residual_test(*self._compared(), self._used_rows, self.sensors, self._gravity)

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        return {
            **fields_of(self, (*_SAVED, "variance", "_own_variance", "_last_gyro")),
            "residuals": self._sums.save(), "faults": self.fault_test.save(), "turning": self._turning.save(),
            "lasting": self._lasting.save(),
        }  # fmt: skip

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        take_fields(self, _SAVED, saved)
        # variances that messages state are kept, those of the vehicle file are the ones of now: their scale may have been changed
        before = np.array(saved["variance"], dtype=float)
        self.variance = np.where(before == np.array(saved["own_variance"], dtype=float), self._own_variance, before)
        self._sums = ResidualSums.load(saved["residuals"])
        self.fault_test.set_variance(self.variance)
        self.fault_test.load(saved["faults"])
        self._turning.load(saved["turning"])
        self._lasting.load(saved["lasting"])
        self._last_gyro = None if saved["last_gyro"] is None else np.array(saved["last_gyro"], dtype=float)
        self._cache.clear()
