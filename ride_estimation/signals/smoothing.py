# Copyright 2026 ride_estimation contributors
"""Gauss smoothing and fourth-order differentiation of bench records.

Smooth for the rate only. The true model of a jounce bumper driven by a deflection smoothed with 5 ms misses the peaks of
fast ramps by more than ten percent; reversals are protected from noise by the dead band of the friction elements instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]

#: standard deviation of the kernel of document 004 [s]
KERNEL_SD_S = 0.005
_REACH = 6.0  # standard deviations at which the kernel ends; what is cut off is below 1e-8
_ONE_SIDED = np.array([[-25.0, 48.0, -36.0, 16.0, -3.0], [-3.0, -10.0, 18.0, -6.0, 1.0]]) / 12.0


def gauss_kernel(sd_s: float, rate_hz: float) -> Array:
    """Return the weights of a Gauss kernel, odd length, sum 1.

    Parameters
    ----------
    sd_s
        Standard deviation [s]; in frequency it is ``1 / (2 pi sd_s)``, 31.8 Hz for 5 ms.
    rate_hz
        Sampling rate [Hz].
    """
    if not sd_s > 0.0 or not rate_hz > 0.0:
        raise InputDataError(f"kernel: standard deviation {sd_s:g} s and rate {rate_hz:g} Hz must be positive")
    reach = max(int(np.ceil(_REACH * sd_s * rate_hz)), 1)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (sd_s * rate_hz)) ** 2)
    return np.asarray(weights / np.sum(weights))


def gauss_smooth(signal: Array, rate_hz: float, sd_s: float = KERNEL_SD_S) -> Array:
    """Return the signal convolved with a Gauss kernel, zero phase, mirrored at its ends about the end values.

    Gain at f: ``exp(-(2 pi f sd_s)^2 / 2)``.

    Parameters
    ----------
    signal
        Shape (N,).
    rate_hz
        Sampling rate [Hz].
    sd_s
        Standard deviation of the kernel [s].

    Raises
    ------
    InputDataError
        The signal is shorter than half the kernel, or has samples that are not finite.

    Notes
    -----
    Source: document 004, preprocessing.
    """
    weights = gauss_kernel(sd_s, rate_hz)
    reach = weights.size // 2
    _require_finite(signal, reach + 1)
    left = 2.0 * signal[0] - signal[reach:0:-1]
    right = 2.0 * signal[-1] - signal[-2 : -reach - 2 : -1]
    return np.convolve(np.concatenate([left, signal, right]), weights, mode="valid")


def fourth_order_rate(signal: Array, step_s: float) -> Array:
    """Return the derivative by the central difference of fourth order, one-sided of fourth order at the ends.

    ``(x_(k-2) - 8 x_(k-1) + 8 x_(k+1) - x_(k+2)) / (12 h)``.

    Parameters
    ----------
    signal
        Shape (N,), N >= 5.
    step_s
        h [s].

    Notes
    -----
    Source: document 004, preprocessing.
    """
    _require_finite(signal, 5)
    if not step_s > 0.0:
        raise InputDataError(f"step: {step_s:g} s must be positive")
    return difference(signal, step_s)


def difference(signal: Array, step_s: float) -> Array:
    """Return :func:`fourth_order_rate` of every column along axis 0, nothing checked; shape (N, ...), N >= 5."""
    rate = np.empty(signal.shape)
    rate[2:-2] = (signal[:-4] - 8.0 * signal[1:-3] + 8.0 * signal[3:-1] - signal[4:]) / 12.0
    rate[:2] = np.tensordot(_ONE_SIDED, signal[:5], axes=1)
    rate[-1:-3:-1] = -np.tensordot(_ONE_SIDED, signal[-1:-6:-1], axes=1)
    return rate / step_s


def _require_finite(signal: Array, least: int) -> None:
    if signal.ndim != 1 or signal.size < least:
        raise InputDataError(f"a signal of at least {least} samples is needed, given shape {signal.shape}")
    if not np.all(np.isfinite(signal)):
        raise InputDataError(f"{int(np.sum(~np.isfinite(signal)))} samples of the signal are not finite")
