# Copyright 2026 ride_estimation contributors
"""Recursive least squares with forgetting that cannot wind up.

Old information is forgotten at most as fast as new information arrives, direction by direction: in the basis where the old
information is the identity and the new one diagonal, ``old -> 1 - min(new, 1 - lambda)``. Without excitation nothing is forgotten
and the covariance stays; with excitation the memory is ``1 / (1 - lambda)`` updates.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

Array = NDArray[np.float64]


def forgetting_noise(p: Array, information: Array, forgetting: float) -> Array:
    """Return the process noise that forgets in the excited directions only, shape (N, N).

    Parameters
    ----------
    p
        Present covariance, shape (N, N), positive definite.
    information
        Information of the measurement to come, shape (N, N).
    forgetting
        lambda, between 0 and 1.
    """
    factor = np.linalg.cholesky(0.5 * (p + p.T))
    gain, basis = linalg.eigh(factor.T @ information @ factor)
    forgotten = np.clip(gain, 0.0, 1.0 - forgetting)
    scaled = factor @ basis
    return np.asarray((scaled * (forgotten / (1.0 - forgotten))) @ scaled.T)


class RecursiveLeastSquares:
    """Linear regression ``y = phi theta + noise`` in information form.

    Parameters
    ----------
    theta, std
        Prior value and standard deviation of every parameter, shape (N,).
    forgetting
        lambda per update.
    """

    def __init__(self, theta: Array, std: Array, forgetting: float = 0.98) -> None:
        self.theta = np.array(theta, dtype=float)
        self.p = np.diag(np.square(np.asarray(std, dtype=float)))
        self.forgetting = forgetting
        self.rejected = 0

    def update(self, information: Array, gradient: Array) -> bool:
        """Take a batch of rows: ``phi^T W phi`` (N, N) and ``phi^T W (y - phi theta)`` (N,); a bad batch changes nothing."""
        if not (np.all(np.isfinite(information)) and np.all(np.isfinite(gradient))):
            self.rejected += 1
            return False
        p = self.p + forgetting_noise(self.p, information, self.forgetting)
        # P+ = P (I + A P)^-1, symmetric by construction of the factor
        factor = np.linalg.cholesky(0.5 * (p + p.T))
        inner = np.eye(len(p)) + factor.T @ information @ factor
        p_new = factor @ np.linalg.solve(inner, factor.T)
        theta = self.theta + p_new @ gradient
        if not (np.all(np.isfinite(theta)) and np.all(np.isfinite(p_new))):
            self.rejected += 1
            return False
        self.theta, self.p = theta, 0.5 * (p_new + p_new.T)
        return True
