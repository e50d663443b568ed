# Copyright 2026 ride_estimation contributors
"""The one place of filterpy's extended Kalman filter, guarded: nothing that goes in or comes out can poison the state.

filterpy 2.0 silently broadcasts wrong shapes, turns one NaN into a NaN state for ever, raises on a singular innovation covariance
and evaluates ``predict_update`` at the state before prediction. Here: ``predict`` then ``update`` only, shapes and finiteness
checked, R floored, P symmetrised and kept positive definite, and every refused update rolled back. The gate of innovations is
that of :mod:`parameter_filter`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]

#: least variance of a measurement
_FLOOR = 1e-12


class GuardedEkf:
    """Extended Kalman filter for parameters that wander.

    Parameters
    ----------
    x, p
        Initial state (N,) and covariance (N, N).

    Raises
    ------
    InputDataError
        Shapes that do not match, values that are not finite, a covariance that is not positive definite.
    """

    def __init__(self, x: Array, p: Array) -> None:
        from filterpy.kalman import ExtendedKalmanFilter  # half a second and 45 MB: only where parameters are estimated

        x, p = np.array(x, dtype=float), np.array(p, dtype=float)
        if x.ndim != 1 or p.shape != (len(x), len(x)):
            raise InputDataError(f"state of shape {x.shape} and covariance of shape {p.shape} do not match")
        if not (np.all(np.isfinite(x)) and _positive_definite(p)):
            raise InputDataError("initial state and covariance must be finite and the covariance positive definite")
        self._size = len(x)
        self._filter = ExtendedKalmanFilter(self._size, 1)
        self._filter.x = x
        self._filter.P = _symmetric(p)

    @property
    def x(self) -> Array:
        """Return the state, shape (N,)."""
        return np.array(self._filter.x, dtype=float)

    @property
    def p(self) -> Array:
        """Return the covariance, shape (N, N)."""
        return np.array(self._filter.P, dtype=float)

    def replace(self, x: Array | None = None, p: Array | None = None) -> None:
        """Set state (N,) or covariance (N, N), with the checks of the constructor.

        Raises
        ------
        InputDataError
            As the constructor.
        """
        new_x = self.x if x is None else np.array(x, dtype=float)
        new_p = self.p if p is None else _symmetric(np.array(p, dtype=float))
        if new_x.shape != (self._size,) or new_p.shape != (self._size, self._size):
            raise InputDataError(f"state {new_x.shape} and covariance {new_p.shape} do not fit a filter of size {self._size}")
        if not (np.all(np.isfinite(new_x)) and _positive_definite(new_p)):
            raise InputDataError("state and covariance must be finite and the covariance positive definite")
        self._filter.x, self._filter.P = new_x, new_p

    def predict(self, q: Array) -> bool:
        """Add process noise, ``P + Q`` with Q of shape (N, N); return False and change nothing where it is no covariance."""
        q = np.asarray(q, dtype=float)
        if q.shape != (self._size, self._size) or not np.all(np.isfinite(q)):
            return False
        before = (self.x, self.p)
        self._filter.F = np.eye(self._size)
        self._filter.Q = _symmetric(q)
        self._filter.predict()
        if not _positive_definite(self._filter.P):
            self._filter.x, self._filter.P = before
            return False
        self._filter.P = _symmetric(self._filter.P)
        return True

    def nis(self, innovation: Array, jacobian: Array, r: Array) -> float:
        """Return the normalised innovation squared, ``y^T (H P H^T + R)^-1 y``; arguments as of :meth:`update`."""
        return float(innovation @ np.linalg.solve(jacobian @ self.p @ jacobian.T + r, innovation))

    def update(self, innovation: Array, jacobian: Array, r: Array) -> str:
        """Take one measurement given by its innovation; a refused one changes nothing. Return why it was refused, empty: taken.

        Parameters
        ----------
        innovation
            Measured minus predicted, shape (M,).
        jacobian
            Shape (M, N).
        r
            Measurement covariance, shape (M, M).
        """
        y, h, r = np.asarray(innovation, dtype=float), np.asarray(jacobian, dtype=float), np.asarray(r, dtype=float)
        if y.ndim != 1 or not len(y) or h.shape != (len(y), self._size) or r.shape != (len(y), len(y)):
            return "shape"
        if not (np.all(np.isfinite(y)) and np.all(np.isfinite(h)) and np.all(np.isfinite(r))):
            return "not_finite"
        r = _symmetric(r)
        r = r + np.diag(np.maximum(_FLOOR - np.diag(r), 0.0))
        before = (self.x, self.p)
        if not _positive_definite(h @ before[1] @ h.T + r):
            return "singular"
        predicted = h @ before[0]
        self._filter.update(y + predicted, lambda x: h, lambda x: h @ x, R=r)
        if not (np.all(np.isfinite(self._filter.x)) and _positive_definite(self._filter.P)):
            self._filter.x, self._filter.P = before
            return "covariance"
        self._filter.P = _symmetric(self._filter.P)
        return ""


def _symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)


def _positive_definite(matrix: Array) -> bool:
    if not np.all(np.isfinite(matrix)):
        return False
    try:
        np.linalg.cholesky(_symmetric(matrix))
    except np.linalg.LinAlgError:
        return False
    return True
