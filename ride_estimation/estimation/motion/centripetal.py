# Copyright 2026 ride_estimation contributors
"""What an uncertain angular rate leaves of the centripetal terms: the largest error of a motion by very quiet sensors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]


def centripetal_terms(directions: Array, points: Array) -> Array:
    """Return T, shape (C, 9): the centripetal term of a channel is ``omega^T T omega / 2``.

    ``e . (omega x (omega x r)) = (e . omega)(r . omega) - (e . r) omega^2``, so ``T = e r^T + r e^T - 2 (e . r) I``.

    Parameters
    ----------
    directions, points
        e and r of the channels, shape (C, 3) each.
    """
    outer = np.einsum("ci,cj->cij", directions, points)
    along = np.sum(directions * points, axis=1)
    return np.asarray((outer + outer.transpose(0, 2, 1) - 2.0 * along[:, None, None] * np.eye(3)).reshape(len(points), 9))


def centripetal_covariance(weights: Array, terms: Array, rate: Array, variance: Array) -> Array:
    """Return the covariance of the motion from the error d of the angular rate: ``W T (omega d + d d / 2)``, shape (6, 6).

    Parameters
    ----------
    weights
        W, shape (6, C).
    terms
        T, shape (C, 9).
    rate
        omega over a block, shape (K, 3).
    variance
        Of the components of d, which are independent, shape (3,).
    """
    total = np.zeros((6, 6))
    _add_covariance(weights, terms, np.ascontiguousarray(rate), variance, total)
    return total


@compile_kernel
def _add_covariance(weights: Array, terms: Array, rate: Array, variance: Array, total: Array) -> None:
    """Add the covariance of :func:`centripetal_covariance` to ``total`` (6, 6)."""
    size, mapped, half = np.zeros((3, 3)), np.zeros((6, 9)), np.empty((6, 3))
    for i in range(3):
        for j in range(3):
            for k in range(rate.shape[0]):
                size[i, j] += rate[k, i] * rate[k, j]
            size[i, j] /= rate.shape[0]
        # E (d d^T / 2)^2 of independent normal components: half their variance beside omega omega^T
        size[i, i] += 0.5 * variance[i]
    for i in range(6):
        for c in range(weights.shape[1]):
            for j in range(9):
                mapped[i, j] += weights[i, c] * terms[c, j]
    for axis in range(3):
        for i in range(6):
            for j in range(3):
                half[i, j] = 0.0
                for k in range(3):
                    half[i, j] += mapped[i, 3 * axis + k] * size[k, j]
        for i in range(6):
            for j in range(6):
                for k in range(3):
                    total[i, j] += variance[axis] * half[i, k] * mapped[j, 3 * axis + k]
