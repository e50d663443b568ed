# Copyright 2026 ride_estimation contributors
"""From acceleration to velocity and displacement, with the drift under control and stated.

Integrating white noise of standard deviation sigma at step dt for a time T gives a velocity of standard deviation
``sigma sqrt(dt T)`` and a displacement of ``sigma sqrt(dt) T^1.5 / sqrt(3)``. A high-pass stops that growth and turns
phase near its corner, so every signal that is compared must pass the same one.
"""

from __future__ import annotations

import math

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]


def velocity_drift(noise_std: float, rate_hz: float, duration_s: float) -> float:
    """Return the standard deviation of integrated white noise, ``sigma sqrt(dt T)`` [unit s]."""
    return noise_std * math.sqrt(duration_s / rate_hz)


def displacement_drift(noise_std: float, rate_hz: float, duration_s: float) -> float:
    """Return the standard deviation of twice integrated white noise, ``sigma sqrt(dt) T^1.5 / sqrt(3)`` [unit s^2]."""
    return noise_std * math.pow(duration_s, 1.5) / math.sqrt(3.0 * rate_hz)


def high_pass(values: ArrayLike, rate_hz: float, corner_hz: float, zero_phase: bool = True) -> Array:
    """Remove what lies below ``corner_hz`` with a second-order Butterworth high-pass (run twice when zero-phase).

    Parameters
    ----------
    values
        Shape (N,) or (N, C), filtered along the first axis.
    rate_hz, corner_hz
        [Hz]; the corner must lie between 0 and half the sample rate.
    zero_phase
        Filter forwards and backwards (offline); else causally.
    """
    y = np.asarray(values, dtype=float)
    if not 0.0 < corner_hz < rate_hz / 2.0:
        raise InputDataError(f"corner {corner_hz:g} Hz must lie between 0 and half the sample rate {rate_hz / 2:g} Hz")
    sos = scipy.signal.butter(2, corner_hz, "highpass", fs=rate_hz, output="sos")
    if zero_phase:
        pad = min(y.shape[0] - 1, int(3 * rate_hz / corner_hz))
        return np.asarray(scipy.signal.sosfiltfilt(sos, y, axis=0, padlen=pad))
    return np.asarray(scipy.signal.sosfilt(sos, y, axis=0))


def integrate(values: ArrayLike, rate_hz: float) -> Array:
    """Integrate by the trapezoidal rule from zero, along the first axis."""
    y = np.asarray(values, dtype=float)
    total = np.zeros_like(y)
    np.cumsum(0.5 * (y[1:] + y[:-1]) / rate_hz, axis=0, out=total[1:])
    return total


def acceleration_to_velocity(acceleration: ArrayLike, rate_hz: float, corner_hz: float) -> Array:
    """Remove the offset, integrate once, high-pass (document 001 chapter 4 with the detrending it omits).

    Parameters
    ----------
    acceleration
        [m/s^2], shape (N,) or (N, C).
    """
    a = np.asarray(acceleration, dtype=float)
    return high_pass(integrate(a - a.mean(axis=0), rate_hz), rate_hz, corner_hz)


def acceleration_to_displacement(acceleration: ArrayLike, rate_hz: float, corner_hz: float) -> Array:
    """Integrate twice with a high-pass after each integration; [m], same shape as the input."""
    velocity = acceleration_to_velocity(acceleration, rate_hz, corner_hz)
    return high_pass(integrate(velocity, rate_hz), rate_hz, corner_hz)
