# Copyright 2026 ride_estimation contributors
"""Do the accelerometers of a body agree with one rigid body: size of the residuals, and constant errors of single sensors."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ride_estimation.estimation.common.block_math import mean_of_ticks
from ride_estimation.estimation.motion.motion_kernel import add_residuals
from ride_estimation.estimation.sensor_errors.isolation import Redundancy, ambiguity_group
from ride_estimation.estimation.sensor_errors.sensor_faults import Fault
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]

#: excess of the mean squared residual over noise and tolerances from which on it is worth a word
MEANINGFUL = 1.2
#: singular values of what the other sensors leave to one of them that count as zero, as a share of the largest
_RANK = 1e-6


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
        Sensors that explain nearly as much: an ambiguity group.
    channel_ratio
        Root mean square over its expected value per channel, shape (C,).
    fault
        Constant error of one sensor beyond tolerance, None where there is none.
    """

    ratio: float
    limit: float
    sensor: str
    explained: float
    rivals: tuple[str, ...]
    channel_ratio: Array
    fault: Fault | None = None

    @property
    def passed(self) -> bool:
        """Return whether the residuals agree with noise and tolerances."""
        return self.ratio <= self.limit and self.fault is None

    def with_fault(self, fault: Fault | None) -> ResidualTest:
        """Return the result with what the test of constant errors found: it names the sensor better than sizes do."""
        if fault is None:
            return self
        return dataclasses.replace(
            self, sensor=fault.sensor, explained=fault.explained, rivals=fault.rivals, fault=fault
        )


@dataclasses.dataclass
class ResidualSums:
    """Fading sums over the ticks at which every sensor spoke.

    Attributes
    ----------
    products, mean
        Of the residuals, shapes (C, C) and (C,).
    signal_square, signal_mean
        Of the readings, shape (C,).
    slope_square
        Of the slope of the readings, shape (C,) [(m/s^3)^2].
    turn_square
        Of the angular acceleration.
    count
        Ticks.
    """

    products: Array
    mean: Array
    signal_square: Array
    signal_mean: Array
    slope_square: Array
    turn_square: float = 0.0
    count: float = 0.0

    @classmethod
    def empty(cls, channels: int) -> ResidualSums:
        """Return sums over nothing."""
        mean, square, signal, slope = np.zeros((4, channels))
        return cls(np.zeros((channels, channels)), mean, square, signal, slope)

    def add(self, samples: Array, predicted: Array, motion: Array, keep: float, dt: float) -> None:
        """Add ticks.

        Parameters
        ----------
        samples, predicted
            Readings and what the fitted motion lets expect, shape (K, C).
        motion
            Shape (K, 6).
        keep
            Factor on what was there.
        dt
            Tick [s].
        """
        sums = np.array([self.turn_square, self.count])
        add_residuals(samples, predicted, motion, keep, self.products, self.mean, self.signal_square, self.signal_mean, sums)
        self.turn_square, self.count = float(sums[0]), float(sums[1])
        self.slope_square *= keep
        if len(samples) > 1:
            self.slope_square += len(samples) * mean_of_ticks((samples[1:] - samples[:-1]) ** 2) / dt**2

    def noise_ratio(self, stated: Array) -> float:
        """Return the sum over the channels of the mean squared residual over the stated variance, shape (C,)."""
        return float(np.sum(np.diagonal(self.products) / stated)) / self.count

    def moments(self) -> tuple[Array, Array]:
        """Return the mean of the residuals (C,) and their covariance about it (C, C)."""
        mean = self.mean / self.count
        return mean, self.products / self.count - np.outer(mean, mean)

    def dynamic(self) -> Array:
        """Return the variance of the readings, shape (C,)."""
        return np.asarray(np.maximum(self.signal_square / self.count - (self.signal_mean / self.count) ** 2, 0.0))

    def save(self) -> dict[str, Any]:
        """Return the sums as plain lists."""
        return {f.name: np.asarray(getattr(self, f.name)).tolist() for f in dataclasses.fields(self)}

    @classmethod
    def load(cls, saved: dict[str, Any]) -> ResidualSums:
        """Return sums from :meth:`save`."""
        products, mean, square, signal, slope = (
            np.array(saved[n], dtype=float) for n in ("products", "mean", "signal_square", "signal_mean", "slope_square")
        )
        return cls(products, mean, square, signal, slope, float(saved["turn_square"]), float(saved["count"]))


def _tolerated(sums: ResidualSums, stated: Array, measured: NDArray[np.bool_], sensors: Sequence[Sensor]) -> Array:
    """Return the variance of a channel: stated noise plus what the installation makes of the motion, shape (C,)."""
    count, dynamic = sums.count, sums.dynamic()
    # cross sensitivity: a channel sees a share of what the other channels of its sensor see
    shared = np.repeat(dynamic.reshape(-1, 3).sum(axis=1) / np.maximum(measured.reshape(-1, 3).sum(axis=1), 1), 3)
    # of a place that is off along all axes, what the angular acceleration across makes of it
    turn = 2.0 * sums.turn_square / (3.0 * count)
    own = [s.tolerated_installation for s in sensors]
    share, place, delay = (np.repeat(v, 3) for v in zip(*((i.cross_sensitivity, i.position, i.delay) for i in own), strict=True))
    return np.asarray(stated + share**2 * shared + place**2 * turn + delay**2 * sums.slope_square / count)


def residual_test(
    sums: ResidualSums, stated: Array, free: Array, sensors: Sequence[Sensor], gravity: float
) -> ResidualTest:  # fmt: skip
    """Compare the redundant equations with noise and tolerances (document 000 has none; ride_models 4.4).

    With ``Q = R^-1 - R^-1 H (H^T R^-1 H)^-1 H^T R^-1`` the statistic is ``tr(Q C)``, C the covariance of the residuals; what a
    fault of one sensor explains of it follows from ``R^1/2 Q R^1/2`` (:class:`Redundancy`). Their mean has a tolerance of its
    own, that of bias and mounting, and joins C in units of it. R holds the stated noise and what sensors in good order differ by.

    Parameters
    ----------
    sums
        Of the run so far.
    stated
        Stated noise variance of the channels, shape (C,).
    free
        Rows of B of the free coordinates, zero for channels that are not measured, shape (C, F).
    sensors
        Three channels each.
    gravity
        [m/s^2].
    """
    names = [s.name for s in sensors]
    count, measured = 3 * len(names), np.any(free != 0.0, axis=1)
    redundant = int(measured.sum()) - (int(np.linalg.matrix_rank(free, tol=1e-6)) if free.size else 0)
    empty = ResidualTest(1.0, np.inf, "", 0.0, (), np.ones(count))
    if redundant <= 0 or sums.count < 50:
        return empty
    variance = _tolerated(sums, stated, measured, sensors)
    inverse = np.diag(1.0 / variance)
    covariance = np.linalg.pinv(free.T @ inverse @ free, hermitian=True)
    q = inverse - inverse @ free @ covariance @ free.T @ inverse
    mean, c = sums.moments()
    # the residuals of the weighted least squares pass through Q's own projection, whatever weights made them
    project = np.eye(count) - free @ covariance @ free.T @ inverse
    c = project @ c @ project.T
    tolerated = np.repeat([s.tolerated_installation.offset(gravity) for s in sensors], 3)
    offset = (project @ mean) * np.sqrt(variance / (variance + tolerated**2))
    # gammaincinv: the quantile of chi-squared, without the detours of scipy.stats
    # one draw of the mean with ``redundant`` degrees of freedom: what chance and tolerance explain of it does not count
    slack = float(2.0 * special.gammaincinv(0.5 * redundant, 0.999)) / redundant
    constant = float(offset @ inverse @ offset) / redundant
    c = c + np.outer(offset, offset) * max(1.0 - slack / max(constant, 1e-12), 0.0)
    ratio = float(np.sum(np.diag(inverse) * np.diag(c))) / redundant
    # samples of an anti-alias filtered signal are not independent: count a quarter of them
    freedom = redundant * max(sums.count, 50.0) / 4.0
    limit = MEANINGFUL * float(2.0 * special.gammaincinv(0.5 * freedom, 0.999) / freedom)
    # errors of the installation are one draw however long the run is: at a level of 5 %, as they are found by their score too
    drawn = float(2.0 * special.gammaincinv(0.5 * redundant, 0.95)) / redundant
    limit *= 1.0 + (drawn - 1.0) * float(np.mean(1.0 - stated[measured] / variance[measured]))
    residual_variance = np.maximum(variance - np.einsum("ij,jk,ik->i", free, covariance, free), 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        channel = np.sqrt(np.diag(c) / np.where(residual_variance > 1e-12, residual_variance, np.inf))
    if ratio <= limit:
        return dataclasses.replace(empty, ratio=ratio, limit=limit, channel_ratio=channel)
    white = np.sqrt(variance)
    explained = Redundancy.of(white[:, None] * q * white, 3, _RANK).explained(c / np.outer(white, white))
    best = int(np.argmax(explained))
    rivals = tuple(names[i] for i in ambiguity_group(explained) if i != best)
    return ResidualTest(ratio, limit, names[best], float(explained[best]), rivals, channel)
