# Copyright 2026 ride_estimation contributors
"""Estimates against known truth: error, and whether the stated standard deviation was honest."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.metrics import nrmse

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class SignalScore:
    """How one estimated signal compares with the true one.

    Attributes
    ----------
    nrmse
        Error rms over the standard deviation of the true signal.
    rms_error
        [unit of the signal].
    coverage
        Share of samples whose true value lies within two stated standard deviations, NaN where none is stated.
    """

    nrmse: float
    rms_error: float
    coverage: float


def at_times(wanted_ns: ArrayLike, stamp_ns: ArrayLike, values: ArrayLike) -> Array:
    """Return a signal at other stamps by linear interpolation.

    Parameters
    ----------
    wanted_ns
        Shape (N,), within the span of ``stamp_ns``.
    stamp_ns
        Rising, shape (M,).
    values
        Shape (M, ...).
    """
    origin = np.asarray(stamp_ns, dtype=np.int64)[0]
    wanted = (np.asarray(wanted_ns, dtype=np.int64) - origin) * 1e-9
    given = (np.asarray(stamp_ns, dtype=np.int64) - origin) * 1e-9
    table = np.asarray(values, dtype=float)
    flat = table.reshape(len(table), -1)
    columns = [np.interp(wanted, given, flat[:, i]) for i in range(flat.shape[1])]
    return np.stack(columns, axis=1).reshape(len(wanted), *table.shape[1:])


def score(true: ArrayLike, estimated: ArrayLike, std: ArrayLike | None = None) -> SignalScore:
    """Return the score of one signal.

    Parameters
    ----------
    true, estimated
        Shape (N,).
    std
        Stated standard deviation, shape (N,), or None.

    Raises
    ------
    InputDataError
        Different lengths, or fewer than two samples.
    """
    truth, guess = np.asarray(true, dtype=float), np.asarray(estimated, dtype=float)
    if truth.shape != guess.shape or truth.ndim != 1 or len(truth) < 2:
        raise InputDataError(f"shapes {truth.shape} and {guess.shape} cannot be compared; allowed: equal, one column, 2 samples")
    error = guess - truth
    covered = float("nan") if std is None else float(np.mean(np.abs(error) <= 2.0 * np.asarray(std, dtype=float)))
    return SignalScore(nrmse(truth, guess), float(np.sqrt(np.mean(error**2))), covered)
