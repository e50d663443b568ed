# Copyright 2026 ride_estimation contributors
"""How wrong a motion is by what its redundant equations show: noise larger than stated, gains and angles, biases.

With more channels than unknowns the residuals ``r = (I - H W) e`` of errors e that are alike in all channels have the size of
those errors: ``<r^T r> = n <e^2>`` with n redundant equations. What moves of them scales the stated covariance (Birge, Phys.
Rev. 40, 207, 1932); what is constant are biases, which no filter sees and which reach the motion as ``<e^2> W W^T``. Sensors
within the tolerances of their installation are no reason for a word, but what they leave in the motion is as real as noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.motion.sensor_drift import error_of_residuals, residual_of_errors
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]

#: samples of a filtered signal per independent one
_DEPENDENT = 4.0
#: standard deviations by which a mean square must exceed what was stated
_CLEARLY = 3.0
#: change of a mean within a minute that is more than chance [standard deviations]
_CHANGE_BY_CHANCE = 2.0


def residual_covariance(
    mean: Array, moving: Array, stated: Array, weights: Array, count: float, redundant: int
) -> tuple[float, Array]:  # fmt: skip
    """Return a factor on the standard deviation of the motion, at least 1, and what biases add to its covariance, shape (6, 6).

    Parameters
    ----------
    mean, moving
        Mean of the residuals of the channels that are used and their variance about it, shape (C,).
    stated
        Variance of the noise of the channels, shape (C,).
    weights
        W, shape (6, C).
    count
        Ticks the residuals were seen for.
    redundant
        Equations more than unknowns, at least 1.
    """
    independent = max(count / _DEPENDENT, 1.0)
    ratio = float(np.sum(moving / stated)) / redundant
    factor = math.sqrt(ratio) if ratio > 1.0 + _CLEARLY * math.sqrt(2.0 / (redundant * independent)) else 1.0
    chance = float(np.sum(moving)) / (redundant * independent)
    bias = max(float(mean @ mean) / redundant - chance, 0.0)
    return factor, bias * (weights @ weights.T)


def error_of_one(
    rows: Array, weights: Array, sensor: int, mean: Array, moving: Array, reading: Array, dynamic: Array
) -> tuple[Array, Array]:  # fmt: skip
    """Return what the error of one sensor does to the motion, covariances of its moving and of its constant part, shape (6, 6).

    An error d leaves ``M_s d`` of residuals, ``M = I - H W``, and moves the motion by ``W_s d``. Where the other sensors leave
    no redundant equation, a direction of d shows nothing: there the sensor is as wrong, relative to what it reads, as where it
    shows.

    Parameters
    ----------
    rows
        H, shape (C, 6).
    weights
        W, shape (6, C).
    sensor
        Which; three channels each.
    mean, moving
        Mean of the residuals, shape (C,), and their covariance, shape (C, C).
    reading, dynamic
        Mean and variance of the readings, shape (C,).
    """
    part = slice(3 * sensor, 3 * sensor + 3)
    to_error = error_of_residuals(residual_of_errors(rows, weights), sensor)
    error, steady = to_error @ moving @ to_error.T, to_error @ mean
    # to_error is a pseudo-inverse: what it reaches is what shows
    left, singular, _ = np.linalg.svd(to_error)
    hidden = left[:, singular <= 1e-9 * singular[0]]
    if hidden.size and singular[0] > 0.0:
        shown = left[:, singular > 1e-9 * singular[0]]
        share = float(np.trace(error)) / max(float(dynamic[part] @ np.sum(shown**2, axis=1)), 1e-30)
        unseen = hidden @ hidden.T
        error = error + share * unseen @ (dynamic[part, None] * unseen)
        steady = np.column_stack([steady, math.sqrt(share) * unseen @ np.diag(reading[part])])
    moved = weights[:, part] @ steady.reshape(3, -1)
    return np.asarray(weights[:, part] @ error @ weights[:, part].T), np.asarray(moved @ moved.T)


def installation_variance(sensors: Sequence[Sensor], mean: Array, dynamic: Array) -> tuple[Array, Array]:
    """Return the variance of what installed sensors read wrongly, of the moving and of the constant part, shape (3 S,).

    Gains scale what an axis reads, angles mix in what the other axes read.

    Parameters
    ----------
    sensors
        S of them, three channels each.
    mean, dynamic
        Mean and variance of the readings, shape (3 S,).
    """
    own = [s.stated_installation for s in sensors]
    gain, angle, bias = (np.array([[getattr(i, kind)] for i in own]) ** 2 for kind in ("gain", "misalignment", "bias"))

    def misread(square: Array) -> Array:
        """Return the variance that gains and angles make of squared readings (3 S,), shape (S, 3)."""
        axes = square.reshape(-1, 3)
        return np.asarray(gain * axes + angle * (axes.sum(axis=1, keepdims=True) - axes))

    return misread(dynamic).ravel(), (misread(mean**2) + bias).ravel()


def more_than_chance(change: Array, moving: Array, ticks: float, redundant: int, bias: float) -> bool:
    """Return whether the mean residual of some ticks differs from that of the run by more than chance and good sensors explain.

    Parameters
    ----------
    change
        Of the mean, shape (C,).
    moving
        Variance of the residuals, shape (C,).
    ticks
        How many.
    redundant
        Equations more than unknowns.
    bias
        Standard deviation of a zero error of sensors in good order, which does not change more within a minute [m/s^2].
    """
    chance = _CHANGE_BY_CHANCE**2 * _DEPENDENT * float(np.sum(moving)) / ticks
    return float(change @ change) >= redundant * bias**2 + chance
