# Copyright 2026 ride_estimation contributors
"""CG motion from all accelerometer and gyro channels of a body by weighted least squares, with a residual test.

``y_j = e_j . (f + alpha x r_j + omega x (omega x r_j))`` per channel, f the specific force at the CG (gravity in it), so
``[f, alpha] = (H^T R^-1 H)^-1 H^T R^-1 (y - centripetal)``. The six-channel matrix B of document 000 eq. (3), (4) is the
case of six channels. The centripetal term takes omega from gyros or from integrated alpha.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ride_estimation.errors import ConfigurationError
from ride_estimation.estimation.arrangement import motion_rows
from ride_estimation.estimation.motion_kernel import cg_block
from ride_estimation.estimation.settings import PipelineSettings
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: standard deviation of an angular acceleration that no channel tells [rad/s^2]
UNKNOWN_ANGULAR_ACCEL = 20.0
#: standard deviation of a linear acceleration that no channel tells [m/s^2]
UNKNOWN_ACCEL = 100.0
#: growth of accelerometer biases: (rad/s^2)^2/s and (rad/s)^2/s for gyros
_BIAS_DENSITY = 1.0e-8
_GYRO_BIAS_DENSITY = 1.0e-10
#: standard deviation of a constant bias at the start
_ALPHA_BIAS = 0.1
_GYRO_BIAS = 0.02
_YAW_STD = 0.1
_YAW_TIME = 3.0
_MASKS = 64
#: standard deviation of the angular rate from which on residuals count: before, centripetal terms are a guess [rad/s]
_RATE_KNOWN = 0.03
#: memory of the residual test [s]
_TEST_MEMORY = 60.0
#: what sensors in good order may differ by: constant offset (bias, and tilt of the mounting times gravity), share of the
#: dynamic signal (gain and cross sensitivity) [m/s^2, 1], place [m]
OFFSET_TOLERANCE, GAIN_TOLERANCE, PLACE_TOLERANCE = 0.05, 0.005, 0.005
#: excess of the mean squared residual over noise and tolerances from which on it is worth a word
MEANINGFUL = 1.2
#: time over which horizontal acceleration counts as slow, and memory of its size [s]
_SLOW_TIME, _SLOW_MEMORY = 1.0, 2.0


def b_matrix(sensors: Sequence[tuple[Array, str]]) -> Array:
    """Return B of document 000 eq. (3): rows ``[e, r x e]`` of single channels, shape (C, 6).

    Parameters
    ----------
    sensors
        Per channel the place relative to the CG [m] and the axis ``x``, ``y`` or ``z``.

    Raises
    ------
    ConfigurationError
        Six channels that do not determine the six accelerations (document 000: three sensors on one line in plan, or
        sensors 2 and 3 with equal x).
    """
    rows = []
    for place, axis in sensors:
        e = np.eye(3)["xyz".index(axis)]
        rows.append(np.concatenate([e, np.cross(np.asarray(place, dtype=float), e)]))
    matrix = np.array(rows)
    singular = np.linalg.svd(matrix, compute_uv=False)
    if len(matrix) < 6 or singular[-1] < 1e-9 * singular[0]:
        raise ConfigurationError(
            f"{len(matrix)} channels of rank {int(np.sum(singular > 1e-9 * singular[0]))} do not determine the six "
            "accelerations of a body; place three triaxial sensors off one line", where="sensor layout",
        )  # fmt: skip
    return matrix


@dataclasses.dataclass(frozen=True)
class Weights:
    """Least squares for one set of channels that speak: weights (6, C), covariance (6, 6), rank of the rows."""

    matrix: Array
    covariance: Array
    residual_variance: Array
    rank: int


@dataclasses.dataclass(frozen=True)
class MotionBlock:
    """CG motion at K ticks: specific force and angular acceleration (K, 6), rate, tilt (K, 3), what the
    accelerometers read for it (K, C).
    """

    motion: Array
    covariance: Array
    rate: Array
    tilt: Array
    tilt_variance: float
    predicted: Array
    valid: BoolArray


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
        self._gravity = gravity
        self._settings = settings or PipelineSettings()
        directions, points, rows = motion_rows(self.sensors, np.asarray(cg, dtype=float))
        extra = 3 * len(self.gyros)
        self.directions = np.vstack([directions, np.zeros((extra, 3))])
        self.points = np.vstack([points, np.zeros((extra, 3))])
        self.rows = np.vstack([rows, *([np.hstack([np.zeros((3, 3)), np.eye(3)])] * len(self.gyros))])
        self.variance = np.concatenate([np.full(3, s.noise_std**2) for s in self.sensors])
        self._along = np.sum(directions * points, axis=1)
        self._gyro_variance = np.array([self.sensors[i].gyro_noise_std ** 2 for i in self.gyros])
        self._cache: dict[tuple[bytes, float], Weights] = {}
        self._observed_tilt = bool(self._free[3] or self._free[4])
        self.residual_products = np.zeros((len(directions), len(directions)))
        self.residual_mean = np.zeros(len(directions))
        self.signal_square = np.zeros(len(directions))
        self.signal_mean = np.zeros(len(directions))
        self.turn_square = 0.0
        self.residual_count = 0.0
        self.reset()

    def reset(self) -> None:
        """Forget attitude and rates, keep nothing."""
        self._state = np.zeros((5, 3))
        self._p_tilt = np.diag([0.1**2, 0.2**2, _ALPHA_BIAS**2]) if not self.gyros else np.diag([0.1**2, 0.0, _GYRO_BIAS**2])
        self._p_yaw = self._p_tilt.copy()
        self._last_gyro: Array | None = None
        self._last_good = np.zeros(6)
        s = self._settings
        self._slow = np.zeros(2)
        self._slow_square = (s.tilt_acceleration_std / self._gravity) ** 2 * s.tilt_correlation_time / (2.0 * _SLOW_TIME)

    def set_variance(self, sensor: int, variance: Array) -> None:
        """Use the variance that the messages of a sensor state [(m/s^2)^2], shape (3,)."""
        if not np.array_equal(self.variance[3 * sensor : 3 * sensor + 3], variance):
            self.variance[3 * sensor : 3 * sensor + 3] = variance
            self._cache.clear()

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
        gyro_ok = np.repeat(mask[list(self.gyros)], 3) if self.gyros else np.zeros(0, dtype=bool)
        variance = np.concatenate([self.variance, np.repeat(2.0 * self._gyro_variance / dt**2, 3)])
        inverse = np.concatenate([channels, gyro_ok]) / variance
        prior = np.diag(np.where(self._free, np.repeat([UNKNOWN_ACCEL**-2, UNKNOWN_ANGULAR_ACCEL**-2], 3), 1e12))
        information = self.rows.T @ (inverse[:, None] * self.rows)
        covariance = np.linalg.inv(information + prior)
        covariance = 0.5 * (covariance + covariance.T)
        matrix = covariance @ (self.rows.T * inverse)
        n = 3 * len(self.sensors)
        residual_variance = self.variance - np.einsum("ij,jk,ik->i", self.rows[:n], covariance, self.rows[:n])
        scaled = self.rows[np.concatenate([channels, gyro_ok])][:, self._free]
        rank = int(np.linalg.matrix_rank(scaled, tol=1e-6)) if scaled.size else 0
        weights = Weights(np.ascontiguousarray(matrix), covariance, np.maximum(residual_variance, 0.0), rank)
        if len(self._cache) >= _MASKS:
            self._cache.clear()
        self._cache[key] = weights
        return weights

    def observe(self, samples: Array, gyro: Array, valid: BoolArray, dt: float) -> MotionBlock:
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
        """
        ticks = len(samples)
        out = MotionBlock(
            np.zeros((ticks, 6)), np.zeros((6, 6)), np.zeros((ticks, 3)), np.zeros((ticks, 3)), 0.0,
            np.zeros((ticks, 3 * len(self.sensors))), np.ones(ticks, dtype=bool),
        )  # fmt: skip
        body_gyro = self._body_rates(gyro)
        covariance = np.zeros((6, 6))
        start = 0
        while start < ticks:
            stop = start + 1
            while stop < ticks and np.array_equal(valid[stop], valid[start]):
                stop += 1
            covariance = self._segment(samples[start:stop], body_gyro[start:stop], valid[start], dt, out, slice(start, stop))
            start = stop
        tilt_variance = float(self._p_tilt[0, 0]) if self._observed_tilt else 0.0
        return dataclasses.replace(out, covariance=covariance, tilt_variance=tilt_variance)

    def _body_rates(self, gyro: Array) -> Array:
        """Return gyro rates in body axes, shape (K, G, 3)."""
        rates = np.zeros((len(gyro), len(self.gyros), 3))
        for g, i in enumerate(self.gyros):
            rates[:, g] = gyro[:, 3 * g : 3 * g + 3] @ self.sensors[i].rotation.T
        return rates

    def _segment(self, y: Array, gyro: Array, mask: BoolArray, dt: float, out: MotionBlock, where: slice) -> Array:
        """Estimate over ticks with the same channels; write into ``out`` and return the covariance."""
        weights = self.weights(mask, dt)
        needed = int(np.sum(self._free))
        if weights.rank == 0:
            out.motion[where] = self._last_good
            out.tilt[where] = self._state[0]
            out.valid[where] = False
            return weights.covariance
        gyro_mask = mask[list(self.gyros)] if self.gyros else np.zeros(0, dtype=bool)
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
        cg_block(
            np.ascontiguousarray(y_all), self.directions, self.points, weights.matrix, np.ascontiguousarray(mean_rate), use_gyro,
            self._gravity, dt, self._state, self._p_tilt, self._p_yaw, noise, out.motion[where], out.rate[where], out.tilt[where],
        )  # fmt: skip
        self._last_good = out.motion[where][-1].copy()
        self._follow_slow_acceleration(out.motion[where], out.tilt[where], dt)
        out.valid[where] = weights.rank == needed
        out.predicted[where] = self.predict(out.motion[where], out.rate[where])
        rate_known = use_gyro or self._p_tilt[1, 1] < _RATE_KNOWN**2
        if weights.rank == needed and mask.all() and rate_known:
            self._gather(y, y - out.predicted[where], out.motion[where], dt)
        return weights.covariance

    def _gather(self, y: Array, residual: Array, motion: Array, dt: float) -> None:
        """Add to the sums of the residual test; what is older than its memory fades."""
        keep = float(np.exp(-len(y) * dt / _TEST_MEMORY))
        self.residual_products = keep * self.residual_products + residual.T @ residual
        self.residual_mean = keep * self.residual_mean + residual.sum(axis=0)
        self.signal_square = keep * self.signal_square + np.sum(y**2, axis=0)
        self.signal_mean = keep * self.signal_mean + y.sum(axis=0)
        self.turn_square = keep * self.turn_square + float(np.sum(motion[:, 3:] ** 2))
        self.residual_count = keep * self.residual_count + len(y)

    def _follow_slow_acceleration(self, motion: Array, tilt: Array, dt: float) -> None:
        """Follow how much slow horizontal acceleration disturbs the tilt seen by the specific force (braking, bends)."""
        f = motion.mean(axis=0)
        seen = np.array([f[1], -f[0]]) / self._gravity
        self._slow += (1.0 - np.exp(-len(motion) * dt / _SLOW_TIME)) * (seen - tilt.mean(axis=0)[:2] - self._slow)
        self._slow_square += (1.0 - np.exp(-len(motion) * dt / _SLOW_MEMORY)) * (
            float(np.mean(self._slow**2)) - self._slow_square
        )

    def _filter_noise(self, weights: Weights, dt: float) -> Array:
        s = self._settings
        start = (s.tilt_acceleration_std / self._gravity) ** 2 * s.tilt_correlation_time
        tilt = float(np.clip(2.0 * _SLOW_TIME * self._slow_square, 1e-3 * start, 30.0 * start)) / dt
        gyro = float(np.mean(self._gyro_variance)) / max(len(self.gyros), 1) if self.gyros else 0.0
        alpha = 0.5 * float(weights.covariance[3, 3] + weights.covariance[4, 4])
        bias = _GYRO_BIAS_DENSITY if self.gyros else _BIAS_DENSITY
        return np.array([alpha, _BIAS_DENSITY, tilt, _YAW_STD**2 * _YAW_TIME / dt, gyro, bias, _GYRO_BIAS**2])

    def predict(self, motion: Array, rate: Array) -> Array:
        """Return what the accelerometers read for a motion, sensor axes, shape (K, 3 S)."""
        n = 3 * len(self.sensors)
        e, r = self.directions[:n], self.points[:n]
        centripetal = (rate @ e.T) * (rate @ r.T) - np.sum(rate**2, axis=1)[:, None] * self._along
        return np.asarray(motion @ self.rows[:n].T + centripetal)

    def accelerate(self, block: MotionBlock) -> tuple[Array, Array]:
        """Return acceleration without gravity (K, 6) and its covariance (6, 6).

        ``a = f - R^T [0, 0, g]`` with the tilt estimate; the tilt's variance adds ``g^2 var`` to x and y.
        """
        roll, pitch = block.tilt[:, 0], block.tilt[:, 1]
        accel = block.motion.copy()
        g = self._gravity
        accel[:, 0] += g * np.sin(pitch)
        accel[:, 1] -= g * np.cos(pitch) * np.sin(roll)
        accel[:, 2] -= g * np.cos(pitch) * np.cos(roll)
        covariance = block.covariance.copy()
        covariance[0, 0] += g**2 * block.tilt_variance
        covariance[1, 1] += g**2 * block.tilt_variance
        accel[:, ~self._free] = 0.0
        return accel, covariance

    def residual_test(self, dt: float) -> ResidualTest:
        """Judge the residuals gathered so far and name the sensor that explains them best."""
        return residual_test(self, self.weights(np.ones(len(self.sensors), dtype=bool), dt))

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        return {
            "state": self._state.tolist(), "p_tilt": self._p_tilt.tolist(), "p_yaw": self._p_yaw.tolist(),
            "variance": self.variance.tolist(), "residual_products": self.residual_products.tolist(),
            "residual_count": self.residual_count, "residual_mean": self.residual_mean.tolist(),
            "signal_square": self.signal_square.tolist(), "signal_mean": self.signal_mean.tolist(),
            "turn_square": self.turn_square, "slow": self._slow.tolist(), "slow_square": self._slow_square,
            "last_gyro": None if self._last_gyro is None else self._last_gyro.tolist(), "last_good": self._last_good.tolist(),
        }  # fmt: skip

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        self._state = np.array(saved["state"], dtype=float)
        self._p_tilt = np.array(saved["p_tilt"], dtype=float)
        self._p_yaw = np.array(saved["p_yaw"], dtype=float)
        self.variance = np.array(saved["variance"], dtype=float)
        self.residual_products = np.array(saved["residual_products"], dtype=float)
        self.residual_count = float(saved["residual_count"])
        self.residual_mean = np.array(saved["residual_mean"], dtype=float)
        self.signal_square = np.array(saved["signal_square"], dtype=float)
        self.signal_mean = np.array(saved["signal_mean"], dtype=float)
        self.turn_square = float(saved["turn_square"])
        self._slow, self._slow_square = np.array(saved["slow"], dtype=float), float(saved["slow_square"])
        self._last_gyro = None if saved["last_gyro"] is None else np.array(saved["last_gyro"], dtype=float)
        self._last_good = np.array(saved["last_good"], dtype=float)
        self._cache.clear()


@dataclasses.dataclass(frozen=True)
class ResidualTest:
    """Result of the residual test.

    Attributes
    ----------
    ratio
        Mean squared residual over what the stated noise explains; 1 where all is well.
    limit
        Largest ratio still compatible with the noise at 0.1 % false alarms.
    sensor
        The sensor whose fault explains the residuals best, empty where nothing is to explain.
    explained
        Share of the excess it explains.
    rivals
        Sensors that explain nearly as much: the residuals cannot tell them apart.
    channel_ratio
        Root mean square over its expected value per channel, shape (C,).
    """

    ratio: float
    limit: float
    sensor: str
    explained: float
    rivals: tuple[str, ...]
    channel_ratio: Array

    @property
    def passed(self) -> bool:
        """Return whether the residuals agree with the noise."""
        return self.ratio <= self.limit


def _tolerated(estimator: CgMotionEstimator) -> Array:
    """Return the variance of a channel: stated noise plus gain and place tolerances times the motion, shape (C,)."""
    count = estimator.residual_count
    dynamic = np.maximum(estimator.signal_square / count - (estimator.signal_mean / count) ** 2, 0.0)
    # cross sensitivity: a channel sees a share of what the other channels of its sensor see
    shared = np.repeat(dynamic.reshape(-1, 3).mean(axis=1), 3)
    turn = estimator.turn_square / (3.0 * count)
    return np.asarray(estimator.variance + GAIN_TOLERANCE**2 * shared + PLACE_TOLERANCE**2 * turn)


def residual_test(estimator: CgMotionEstimator, weights: Weights) -> ResidualTest:
    """Compare the spare equations with noise and tolerances (document 000 has none; ride_models 4.4).

    With ``Q = R^-1 - R^-1 H (H^T R^-1 H)^-1 H^T R^-1`` the statistic is ``tr(Q C)``, C the covariance of the residuals, and a
    fault in sensor s explains ``tr((E^T Q E)^+ E^T R^-1 C R^-1 E)`` of it. Their mean has a tolerance of its own, that of bias
    and mounting, and joins C in units of it. R holds the stated noise and what sensors in good order differ by.
    """
    count = 3 * len(estimator.sensors)
    spare = count - weights.rank
    empty = ResidualTest(1.0, np.inf, "", 0.0, (), np.ones(count))
    if spare <= 0 or estimator.residual_count < 50:
        return empty
    variance = _tolerated(estimator)
    inverse = np.diag(1.0 / variance)
    rows = estimator.rows[:count]
    free = rows[:, estimator._free]
    covariance = np.linalg.pinv(free.T @ inverse @ free, hermitian=True)
    q = inverse - inverse @ free @ covariance @ free.T @ inverse
    mean = estimator.residual_mean / estimator.residual_count
    c = estimator.residual_products / estimator.residual_count - np.outer(mean, mean)
    # the residuals of the weighted least squares pass through Q's own projection, whatever weights made them
    project = np.eye(count) - free @ covariance @ free.T @ inverse
    c = project @ c @ project.T
    offset = (project @ mean) * np.sqrt(variance / (variance + OFFSET_TOLERANCE**2))
    # one draw of the mean with ``spare`` degrees of freedom: what chance and tolerance explain of it does not count
    slack = float(stats.chi2.ppf(0.999, spare)) / spare
    constant = float(offset @ inverse @ offset) / spare
    c = c + np.outer(offset, offset) * max(1.0 - slack / max(constant, 1e-12), 0.0)
    ratio = float(np.sum(np.diag(inverse) * np.diag(c))) / spare
    # samples of an anti-alias filtered signal are not independent: count a quarter of them
    freedom = spare * max(estimator.residual_count, 50.0) / 4.0
    limit = MEANINGFUL * float(stats.chi2.ppf(0.999, freedom) / freedom)
    residual_variance = np.maximum(variance - np.einsum("ij,jk,ik->i", free, covariance, free), 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        channel = np.sqrt(np.diag(c) / np.where(residual_variance > 1e-12, residual_variance, np.inf))
    if ratio <= limit:
        return dataclasses.replace(empty, ratio=ratio, limit=limit, channel_ratio=channel)
    explained = np.zeros(len(estimator.sensors))
    weighted = inverse @ c @ inverse
    for s in range(len(estimator.sensors)):
        part = slice(3 * s, 3 * s + 3)
        explained[s] = float(np.trace(np.linalg.pinv(q[part, part], rcond=1e-6) @ weighted[part, part])) / (spare * ratio)
    best = int(np.argmax(explained))
    rivals = tuple(s.name for i, s in enumerate(estimator.sensors) if i != best and explained[i] > 0.9 * explained[best])
    return ResidualTest(ratio, limit, estimator.sensors[best].name, float(explained[best]), rivals, channel)
