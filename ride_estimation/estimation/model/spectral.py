# Copyright 2026 ride_estimation contributors
"""Discrete Fourier transforms of a segment and of the model's response over it.

Over N samples ``x' = A x + B w`` reads ``X(f) = (i w - A)^-1 B W(f) + (1 - e^(-i w dt) e^(A dt))^-1 (x_0 - x_N)`` at the
frequencies of the transform, exactly but for what W aliases: a segment need neither be periodic nor begin at rest (Pintelon and
Schoukens, System Identification: A Frequency Domain Approach, 2012, 6.3.2). All transforms are divided by sqrt N, so that white
noise keeps its variance.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy.linalg as sl
from numpy.typing import NDArray
from scipy import ndimage

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: highest frequency that is used, over the rate of the readings: the low-pass of :mod:`run_readings` (Kaiser) begins at 0.37
_HIGHEST = 0.36
#: half width over which spectra are smoothed [Hz], and least number of lines: widths of resonances of a vehicle on a road
_HALF_WIDTH_HZ, _LEAST_LINES = 0.25, 5


@dataclasses.dataclass(frozen=True)
class Lines:
    """Frequencies of the transform of a segment.

    Attributes
    ----------
    count, dt
        Samples N and their distance [s].
    frequency
        Shape (F,), without zero [Hz].
    """

    count: int
    dt: float
    frequency: Array

    @classmethod
    def of(cls, count: int, dt: float) -> Lines:
        """Return the frequencies for so many samples."""
        frequency = np.asarray(np.fft.rfftfreq(count, dt)[1:], dtype=np.float64)
        return cls(count, dt, frequency[frequency * dt < _HIGHEST])

    @property
    def laplace(self) -> Complex:
        """Return i w, shape (F,) [rad/s]."""
        return np.asarray(2j * np.pi * self.frequency)

    def transform(self, values: Array) -> Complex:
        """Return the transform of values, shape (N, K) to (F, K)."""
        found = np.fft.rfft(values, axis=0)[1 : len(self.frequency) + 1]
        return np.asarray(found / np.sqrt(self.count))

    def back(self, values: Complex) -> Array:
        """Return values with that transform and mean zero, shape (F, K) to (N, K)."""
        # columns lie together: a transform along the first axis would fetch every value from another place
        full = np.zeros((values.shape[1], self.count // 2 + 1), dtype=np.complex128)
        full[:, 1 : len(values) + 1] = values.T * np.sqrt(self.count)
        return np.asarray(np.fft.irfft(full, self.count)).T

    def leap(self, jump: Array) -> Array:
        """Return what :meth:`back` misses of values that differ between the ends of the segment, shape (N, K).

        Continued periodically they leap there by ``x_0 - x_N``, given as transforms count it, shape (K,). That is a sawtooth
        ``-n / N`` whose spectrum is in all lines: without those that are not used it rings (Gibbs).
        """
        sawtooth = 0.5 - (np.arange(self.count)[:, None] + 0.5) / self.count
        return np.asarray(np.sqrt(self.count) * (sawtooth - self.back(self.transform(sawtooth))) * jump)

    def taper(self, spectrum: Complex) -> Complex:
        """Return the transform (F, K) after a Hann window that keeps the power: ends do not leak into quiet lines."""
        padded = np.pad(spectrum, ((1, 1), (0, 0)))
        return np.asarray((0.5 * spectrum - 0.25 * (padded[:-2] + padded[2:])) / np.sqrt(0.375))

    def smooth(self, values: Array) -> Array:
        """Return values (F, ...) averaged over neighbouring lines."""
        return np.asarray(ndimage.convolve1d(values, self._window(), axis=0, mode="mirror"))

    def smoothing_error(self) -> float:
        """Return the relative standard deviation that a smoothed spectrum of white noise has."""
        return float(np.linalg.norm(self._window()))

    def _window(self) -> Array:
        half = min(max(_LEAST_LINES, round(_HALF_WIDTH_HZ * self.count * self.dt)), len(self.frequency) - 1)
        weight = np.hanning(2 * half + 3)[1:-1]
        return np.asarray(weight / weight.sum(), dtype=np.float64)


@dataclasses.dataclass(frozen=True)
class Response:
    """Response of the states at F frequencies.

    Attributes
    ----------
    drive
        To the inputs, shape (F, X, W).
    accel
        To an acceleration of body and carried bodies that the equations do not contain, shape (F, X, 6 + Q).
    jump
        To the state before the segment less that after it, shape (F, X, X).
    """

    drive: Complex
    accel: Complex
    jump: Complex


def response(A: Array, lines: Lines, rate: slice, driven: int) -> Response:
    """Return the response of ``x' = A v``, shape (X, V), by the modes of the states.

    Parameters
    ----------
    A, lines
        Dynamics and frequencies.
    rate
        States that accelerations change.
    driven
        The first so many states follow the others without acting on them; the others are integrated twice: their matrix N has
        ``N^2 = 0``.
    """
    size, laplace, count = len(A), lines.laplace[:, None, None], len(lines.frequency)
    first, last, inputs = slice(0, driven), slice(driven, size), A.shape[1] - size
    values, modes = np.linalg.eig(A[first, first])
    into, twice = np.linalg.inv(modes), A[last, last]
    found = np.empty((count, size, inputs + rate.stop - rate.start), dtype=np.complex128)
    right = np.hstack([A[:, size:], np.eye(size)[:, rate]])
    once, again = 1.0 / laplace, 1.0 / laplace**2
    across = into @ A[first, last]
    acting = into @ right[first] + once * (across @ right[last]) + again * (across @ twice @ right[last])
    np.matmul(modes, acting / (laplace - values[:, None]), out=found[:, first])
    found[:, last] = once * right[last] + again * (twice @ right[last])

    jump = np.zeros((count, size, size), dtype=np.complex128)
    follow = into @ np.asarray(sl.expm(A[:, :size] * lines.dt))[first, last]
    shift = np.exp(-laplace * lines.dt)
    whole = 1.0 / (1.0 - shift)
    steps = shift * lines.dt * whole**2
    modal = 1.0 / (1.0 - shift * np.exp(values * lines.dt)[:, None])
    np.matmul(modes, modal * into, out=jump[:, first, first])
    np.matmul(modes, modal * shift * (whole * follow + steps * (follow @ twice)), out=jump[:, first, last])
    jump[:, last, last] = whole * np.eye(size - driven) + steps * twice
    return Response(found[:, :, :inputs], found[:, :, inputs:], jump)
