# Copyright 2026 ride_estimation contributors
"""Scores of a model signal against a measured one, each with one name and one definition."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]


def _pair(measured: ArrayLike, modelled: ArrayLike) -> tuple[Array, Array]:
    a, b = np.asarray(measured, dtype=float).ravel(), np.asarray(modelled, dtype=float).ravel()
    if a.shape != b.shape or a.size < 2:
        raise InputDataError(f"two signals of equal length of at least 2 are needed; given {a.size} and {b.size} samples")
    if not (np.all(np.isfinite(a)) and np.all(np.isfinite(b))):
        raise InputDataError("signals to be scored contain values that are not finite")
    return a, b


def rmse(measured: ArrayLike, modelled: ArrayLike) -> float:
    """Return the root mean square error in the unit of the signals (document 000 eq. (16) with one N)."""
    a, b = _pair(measured, modelled)
    return float(np.sqrt(np.mean((a - b) ** 2)))


def nrmse(measured: ArrayLike, modelled: ArrayLike, norm: str = "std") -> float:
    """Return RMSE over a norm of the measured signal.

    Parameters
    ----------
    measured, modelled
        Signals of equal length.
    norm
        ``std`` (document 004 eq. (2)), ``max`` (largest magnitude, document 003) or ``range`` (max - min).

    Raises
    ------
    InputDataError
        Unknown norm, or a constant measured signal.
    """
    a, b = _pair(measured, modelled)
    norms = {"std": np.std(a), "max": np.max(np.abs(a)), "range": np.ptp(a)}
    if norm not in norms:
        raise InputDataError(f"norm {norm!r} is unknown; allowed: {', '.join(norms)}")
    if norms[norm] == 0.0:
        raise InputDataError("the measured signal is constant: a normalised error is not defined")
    return float(np.sqrt(np.mean((a - b) ** 2)) / norms[norm])


def pearson_r(measured: ArrayLike, modelled: ArrayLike) -> float:
    """Return Pearson's correlation (document 000 eq. (15)); blind to gain and offset, not a score of fit."""
    a, b = _pair(measured, modelled)
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        raise InputDataError("correlation is not defined for a constant signal")
    return float(np.corrcoef(a, b)[0, 1])


def r_squared(measured: ArrayLike, modelled: ArrayLike) -> float:
    """Return the coefficient of determination ``1 - sum e^2 / sum (y - mean y)^2``; negative for a bad model."""
    return 1.0 - nrmse(measured, modelled) ** 2


def variance_accounted_for(measured: ArrayLike, modelled: ArrayLike) -> float:
    """Return ``1 - var(e) / var(y)``; blind to offset, not to gain."""
    a, b = _pair(measured, modelled)
    if np.ptp(a) == 0.0:
        raise InputDataError("the measured signal is constant: VAF is not defined")
    return float(1.0 - np.var(a - b) / np.var(a))
