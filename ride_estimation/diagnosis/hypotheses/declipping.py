# Copyright 2026 ride_estimation contributors
"""Readings that a cut channel could not show, from what the channels beside it read at the same time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch
from scipy.sparse.linalg import LinearOperator, cg

Array = NDArray[np.float64]

#: length of the segments of the power spectrum [s]
_SEGMENT_S = 5.0
#: power below which a frequency of the rest counts as noise, share of the largest
_FLOOR = 1e-6


def missing_readings(readings: Array, index: int, cut: NDArray[np.bool_], side: float, rate_hz: float) -> Array:
    """Return what is missing from a channel where it was cut, shape (N,).

    A frame that hardly deforms moves all its sensors together: the channel is a linear combination of the others plus a rest,
    ``x = A b + d``, b by least squares over the samples that are not cut. At the cut ones d is the conditional mean of a
    stationary Gaussian signal given its other samples, ``min sum |D(f)|^2 / P(f)``, P its power spectrum. Parts of the wrong
    sign are dropped.

    Parameters
    ----------
    readings
        Channels of one frame, shape (N, q).
    index
        The channel that is cut.
    cut
        Samples at the level, shape (N,).
    side
        +1 where the upper peaks are cut, -1 where the lower ones are.
    rate_hz
        Sampling rate.
    """
    samples, free = len(readings), ~cut
    beside = np.delete(readings, index, axis=1)
    beside = np.column_stack([beside - beside.mean(axis=0), np.ones(samples)])
    if np.count_nonzero(free) < 2 * beside.shape[1]:
        return np.zeros(samples)
    together = beside @ np.linalg.lstsq(beside[free], readings[free, index], rcond=None)[0]
    known = (readings[:, index] - together) * free
    rest = np.interp(np.arange(samples), np.flatnonzero(free), known[free])
    frequency, power = welch(rest, rate_hz, nperseg=min(round(_SEGMENT_S * rate_hz), samples), detrend=False)
    inverse = power.max(initial=0.0) / np.maximum(power, _FLOOR * power.max(initial=0.0) + 1e-300)
    weight = np.interp(np.fft.rfftfreq(samples, 1.0 / rate_hz), frequency, inverse)

    def whitened(signal: Array) -> Array:
        return np.asarray(np.fft.irfft(weight * np.fft.rfft(np.ravel(signal)), samples) * cut)

    masked = LinearOperator((samples, samples), matvec=whitened, dtype=float)
    rest = known + cut * cg(masked, -whitened(known), x0=rest * cut, atol=0.0)[0]
    return np.asarray(side * np.maximum(side * (together + rest - readings[:, index]), 0.0) * cut)
