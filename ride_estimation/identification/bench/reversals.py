# Copyright 2026 ride_estimation contributors
"""Reversal points of a measured displacement that survive sensor noise.

A friction law with memory is anchored at reversals; 1 um of white noise at 1 kHz makes 30 times too many of them. The
noise level is estimated, the signal low-passed without phase above the band it carries, and a reversal counts only after
the motion came back by a dead band; it is then dated back to the extremum.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: dead band in standard deviations of the noise that is left after the low-pass
DEAD_BAND_SIGMAS = 6.0
#: noise below this share of the displacement range is treated as none (rounding of stored numbers)
NEGLIGIBLE_NOISE = 1.0e-7


@dataclasses.dataclass(frozen=True)
class Motion:
    """A displacement with its branches between reversals.

    Attributes
    ----------
    x
        Displacement used for the history terms [m], shape (N,).
    step_s
        Sample time [s].
    starts
        First sample of each branch and N at the end, shape (B + 1,).
    anchors
        Displacement at the start of each branch [m], shape (B,).
    directions
        +1 or -1 per branch, shape (B,).
    noise_std
        Estimated white noise of the raw displacement [m].
    dead_band
        Dead band used [m].
    corner_hz
        Low-pass corner [Hz]; 0 where no filter was used.
    """

    x: Array
    step_s: float
    starts: IntArray
    anchors: Array
    directions: Array
    noise_std: float
    dead_band: float
    corner_hz: float

    @functools.cached_property
    def stroke(self) -> float:
        """Return the distance between the largest and the smallest displacement [m]."""
        return float(np.ptp(self.x))

    def thinned(self, factor: int) -> Motion:
        """Return every ``factor``-th sample with the branches kept."""
        x = np.ascontiguousarray(self.x[::factor])
        starts = np.minimum(-(-self.starts // factor), x.size)
        return dataclasses.replace(self, x=x, step_s=self.step_s * factor, starts=starts)

    def decimated(self, factor: int) -> Motion:
        """Return means of ``factor`` samples, the branches kept, for a cheap start of a search; the last few are left out."""
        x = block_means(self.x, factor)
        # a mean belongs to the branch in which its middle lies
        starts = np.minimum(-(-(2 * self.starts - factor + 1) // (2 * factor)), x.size)
        starts[-1] = x.size
        return dataclasses.replace(self, x=x, step_s=self.step_s * factor, starts=np.maximum(starts, 0))


def block_means(values: Array, factor: int) -> Array:
    """Return the means of ``factor`` samples at a time, shape (N // factor,).

    Spring and Maxwell cells are linear: they hold between means of displacement and force as they do between samples, and the
    noise of the force is that of all samples, where every ``factor``-th sample would throw most of it away.
    """
    whole = values[: values.size // factor * factor].reshape(-1, factor)
    means: Array = whole @ np.full(factor, 1.0 / factor)
    return means


def noise_level(values: Array) -> float:
    """Estimate the standard deviation of white noise on a smooth signal.

    The n-th difference of white noise has the variance ``comb(2n, n) sigma^2`` while a smooth signal vanishes in it; the
    smallest of several orders is taken (median absolute deviation, so that single events do not count).
    """
    best = np.inf
    # windows spread over the record keep long records cheap: a median of 4800 values is known to 2 %
    window = min(values.size, 400)
    firsts = np.unique(np.linspace(0, values.size - window, min(24, values.size // window)).astype(int))
    parts = values[firsts[:, None] + np.arange(window)]
    difference = np.diff(parts, n=2, axis=1)
    for order in (4, 6, 8, 10):
        if order >= window:
            break
        difference = np.diff(difference, n=2, axis=1)
        # neighbours share all samples but one: every second tells as much
        deviation = float(np.median(np.abs(difference[:, ::2]))) / 0.6745
        best = min(best, deviation / float(np.sqrt(scipy.special.comb(2 * order, order))))
    return best if np.isfinite(best) else 0.0


def signal_band(values: Array, step_s: float, noise_std: float) -> float:
    """Return the highest frequency [Hz] at which the power of the signal stands ten times above white noise."""
    segment = int(min(values.size, max(256, 4.0 / step_s)))
    frequency, power = scipy.signal.welch(values - np.mean(values), fs=1.0 / step_s, nperseg=segment)
    floor = 2.0 * noise_std**2 * step_s
    above = np.flatnonzero(power > 10.0 * floor)
    return float(frequency[above[-1]]) if above.size else float(frequency[1])


def low_pass(values: Array, step_s: float, corner_hz: float) -> Array:
    """Low-pass without phase: fourth-order Butterworth forward and backward."""
    sos = scipy.signal.butter(4, corner_hz, fs=1.0 / step_s, output="sos")
    filtered: Array = scipy.signal.sosfiltfilt(sos, values)
    return filtered


def find_motion(displacement: Array, step_s: float, *, dead_band: float | None = None, raw: bool = False) -> Motion:
    """Find the branches of a measured displacement.

    Parameters
    ----------
    displacement
        Measured displacement [m], shape (N,).
    step_s
        Sample time [s].
    dead_band
        Motion that must come back before a reversal counts [m]; None: six standard deviations of the remaining noise.
    raw
        Take every sign change of the raw signal (document 003 eq. (9) as printed; for comparison).
    """
    x = np.ascontiguousarray(displacement, dtype=float)
    noise = noise_level(x)
    corner, band = 0.0, 0.0
    if not raw and noise > NEGLIGIBLE_NOISE * np.ptp(x):
        nyquist = 0.5 / step_s
        # four times the band: forward and backward the filter then takes 1.5e-5 of the highest component
        corner = 4.0 * signal_band(x, step_s, noise)
        left = noise
        if corner < 0.8 * nyquist:
            x = low_pass(x, step_s, corner)
            left = noise * float(np.sqrt(corner / nyquist))
        else:
            corner = 0.0
        band = DEAD_BAND_SIGMAS * left
    if dead_band is not None:
        band = dead_band
    starts = np.concatenate([[0], _extrema(x, band), [x.size]])
    anchors = np.ascontiguousarray(x[starts[:-1]])
    ends = np.append(anchors[1:], x[-1])
    directions = np.where(ends >= anchors, 1.0, -1.0)
    return Motion(x, step_s, starts, anchors, directions, noise, band, corner)


@compile_kernel
def _extrema(x: Array, dead_band: float) -> IntArray:
    """Return the samples of the extrema confirmed by a return of more than the dead band, ascending, without the first one."""
    found = np.empty(x.size, np.int64)
    count, k, at = 0, 0, 0
    high, low, high_at, low_at = x[0], x[0], 0, 0
    while k < x.size and high - x[k] <= dead_band and x[k] - low <= dead_band:
        if x[k] > high:
            high, high_at = x[k], k
        if x[k] < low:
            low, low_at = x[k], k
        k += 1
    if k == x.size:
        return found[:0]
    rises = x[k] - low > dead_band
    at = low_at if rises else high_at
    if at > 0:
        found[0] = at
        count = 1
    extreme, at = x[k], k
    for i in range(k + 1, x.size):
        value = x[i]
        # only the extremum of the side the motion goes to can be the next
        if (value > extreme) if rises else (value < extreme):
            extreme, at = value, i
        elif (extreme - value if rises else value - extreme) > dead_band:
            found[count] = at
            count += 1
            rises = not rises
            extreme, at = value, i
    return found[:count]
