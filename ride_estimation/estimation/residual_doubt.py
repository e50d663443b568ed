# Copyright 2026 ride_estimation contributors
"""How wrong a motion is by what its spare equations show: noise larger than stated, gains and angles, biases.

With more channels than unknowns the residuals ``r = (I - H W) e`` of errors e that are alike in all channels have the size of
those errors: ``<r^T r> = spare <e^2>``. What moves of them scales the stated covariance (Birge, Phys. Rev. 40, 207, 1932); what
is constant are biases, which no filter sees and which reach the motion as ``<e^2> W W^T``. Sensors within the tolerances of their
installation are no reason for a word, but what they leave in the motion is as real as noise.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.sensor_drift import error_of_residuals, residual_of_errors

Array = NDArray[np.float64]

#: samples of a filtered signal per independent one
_DEPENDENT = 4.0
#: standard deviations by which a mean square must exceed what was stated
_CLEARLY = 3.0


def residual_doubt(
    mean: Array, moving: Array, stated: Array, weights: Array, count: float, spare: int
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
    spare
        Equations more than unknowns, at least 1.
    """
    independent = max(count / _DEPENDENT, 1.0)
    ratio = float(np.sum(moving / stated)) / spare
    factor = math.sqrt(ratio) if ratio > 1.0 + _CLEARLY * math.sqrt(2.0 / (spare * independent)) else 1.0
    chance = float(np.sum(moving)) / (spare * independent)
    bias = max(float(mean @ mean) / spare - chance, 0.0)
    return factor, bias * (weights @ weights.T)


def motion_of_residuals(rows: Array, weights: Array, sensor: int) -> Array:
    """Return what an error of one sensor does to the motion by what it leaves of residuals, ``W_s M_s^+``, shape (6, C).

    An error d leaves ``M_s d`` with ``M = I - H W`` and moves the motion by ``W_s d``.

    Parameters
    ----------
    rows
        H, shape (C, 6).
    weights
        W, shape (6, C).
    sensor
        Which; three channels each.
    """
    part = slice(3 * sensor, 3 * sensor + 3)
    return np.asarray(weights[:, part] @ error_of_residuals(residual_of_errors(rows, weights), sensor))
