# Copyright 2026 ride_estimation contributors
"""Checks on a seat-pad accelerometer before it is used to validate a model (document 001 row 1-13)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ride_estimation.errors import InputDataError

GRAVITY = 9.80665


def separation_times(vertical: ArrayLike, rate_hz: float) -> list[float]:
    """Return the times [s] at which the occupant leaves the seat: vertical acceleration below -1 g.

    From there on the pad measures itself, not the person, and the rigid-seat assumption is void.

    Parameters
    ----------
    vertical
        Acceleration of the seat pad without gravity [m/s^2], shape (N,).
    rate_hz
        [Hz].
    """
    a = np.asarray(vertical, dtype=float).ravel()
    if not np.all(np.isfinite(a)):
        raise InputDataError("the seat signal contains values that are not finite")
    off = a < -GRAVITY
    starts = np.flatnonzero(off & ~np.concatenate([[False], off[:-1]]))
    return [float(i / rate_hz) for i in starts]


def signal_to_noise_db(signal: ArrayLike, standstill: ArrayLike) -> float:
    """Return the signal-to-noise ratio [dB] of a run against a stand-still record, ``20 log10(rms_s / rms_n)`` (row 1-21)."""
    s, n = np.asarray(signal, dtype=float).ravel(), np.asarray(standstill, dtype=float).ravel()
    noise = float(np.std(n))
    if s.size < 2 or n.size < 2 or noise == 0.0:
        raise InputDataError("signal and stand-still record need at least two samples and a stand-still that is not constant")
    return float(20.0 * np.log10(np.std(s) / noise))
