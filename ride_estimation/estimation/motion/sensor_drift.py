# Copyright 2026 ride_estimation contributors
"""What a sensor that drifts does to the motion: seen in constant parts of the residuals that moved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: directions of an error of a sensor that show less than this share of the largest are left out
_RANK = 0.1


def residual_of_errors(rows: Array, weights: Array) -> Array:
    """Return M, shape (C, C): from errors of the channels to residuals, zero for channels without weight, which are left out."""
    used = np.any(weights != 0.0, axis=0)
    return np.asarray((np.eye(len(rows)) - rows @ weights) * np.outer(used, used))


def error_of_residuals(left: Array, sensor: int) -> Array:
    """Return ``M_s^+``, shape (3, C): from residuals to the error of the one sensor that left them.

    Parameters
    ----------
    left
        M of :func:`residual_of_errors`.
    sensor
        Which; three channels each.
    """
    return np.asarray(np.linalg.pinv(left[:, 3 * sensor : 3 * sensor + 3], rcond=_RANK))


def motion_error(change: Array, rows: Array, weights: Array) -> Array:
    """Return the constant error of the motion, shape (6,), that goes with a change of constant residuals.

    An error e of sensor s alone leaves ``M_s e`` of it, ``M = I - H W``, and moves the motion by ``W_s e``. The sensor is taken
    whose ``M_s^+ r`` explains the change r best.

    Parameters
    ----------
    change
        Of the mean residuals, three channels per sensor, shape (3 S,) [m/s^2].
    rows
        H, shape (3 S, 6).
    weights
        W, shape (6, 3 S).
    """
    left = residual_of_errors(rows, weights)
    parts = [slice(3 * s, 3 * s + 3) for s in range(len(change) // 3)]
    errors = [error_of_residuals(left, s) @ change for s in range(len(parts))]
    best = int(np.argmin([float(np.sum((change - left[:, part] @ e) ** 2)) for part, e in zip(parts, errors)]))
    return np.asarray(weights[:, parts[best]] @ errors[best])
