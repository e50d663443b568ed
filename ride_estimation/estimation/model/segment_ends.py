# Copyright 2026 ride_estimation contributors
"""Deformation of the base near the ends of a segment.

A transform continues a segment with its own other end, and integrating twice carries that far inside. Near an end the deformation
is estimated from the record as it is: z of spectrum S, its acceleration u seen with noise of spectrum N and an unknown mean,
``E[z(t) | u] = r_zu (R_uu + R_nn)^-1 u`` with Toeplitz matrices of the covariances (Kailath, Sayed, Hassibi, Linear Estimation,
2000, 3.1 and 7.1), which is the smoother inside and the filter at the end.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy.linalg as sl
from numpy.typing import NDArray

from ride_estimation.estimation.model.spectral import Complex, Lines

Array = NDArray[np.float64]

#: part of a segment that its end is estimated from, distance from the end within which that counts [s], and the share of that
#: over which it fades: alone for longer than the slowest deformation that accelerometers show (:data:`segments.DEFORMS_HZ`)
_PART_S, _COUNTS_S, _FADE = 8.0, 6.0, 1.0 / 3.0
#: variance of the unknown mean of the acceleration over that of the acceleration and its noise
_MEAN = 100.0
#: instants at which the variance is computed
_INSTANTS = 50


@dataclasses.dataclass(frozen=True)
class Ends:
    """What changes near the ends of a segment of N samples, n patterns.

    Attributes
    ----------
    value, rate
        Change of deformation and rate, shape (N, n) [m, m/s].
    variance
        By how much the variance of the deformation is larger than inside, shape (N, n) [m^2].
    """

    value: Array
    rate: Array
    variance: Array


def ends_of(lines: Lines, seen: Complex, power: Array, noise: Array, value: Array, rate: Array) -> Ends:
    """Return how deformations near the ends differ from those of the transform.

    Parameters
    ----------
    lines
        Frequencies, F of them, of N samples.
    seen
        Acceleration of the deformation with its noise, shape (F, n) [m/s^2].
    power, noise
        Spectra of that acceleration and of the noise, shape (F, n).
    value, rate
        Deformation by the transform and its rate, shape (N, n) [m, m/s].
    """
    count, patterns = value.shape
    part = min(count, round(_PART_S / lines.dt))
    distance = np.arange(part) * lines.dt
    reach = min(_COUNTS_S, 0.5 * count * lines.dt)
    weight = 0.5 - 0.5 * np.cos(np.pi * np.clip((reach - distance) / (_FADE * reach), 0.0, 1.0))
    instants = np.unique(np.linspace(0, part - 1, _INSTANTS).astype(np.int64))
    inside = len(instants) // 2
    accel = lines.back(seen)
    found = Ends(*np.zeros((3, count, patterns)))
    for k in range(patterns):
        own, of_value, of_rate, variance = _covariances(lines, power[:, k], noise[:, k], part)
        factor = sl.cho_factor(own)
        left = variance - np.einsum("ij,ij->j", of_value[instants].T, sl.cho_solve(factor, of_value[instants].T))
        wider = np.interp(np.arange(part), instants, np.maximum(left - left[inside], 0.0))
        for side in (slice(None), slice(None, None, -1)):  # read backwards, the end is a beginning
            turn = 1.0 if side.step is None else -1.0
            solved = sl.cho_solve(factor, accel[side, k][:part])
            found.value[side, k][:part] += weight * (of_value @ solved - value[side, k][:part])
            found.rate[side, k][:part] += weight * (turn * (of_rate @ solved) - rate[side, k][:part])
            found.variance[side, k][:part] += weight * wider
    return found


def _covariances(lines: Lines, power: Array, noise: Array, part: int) -> tuple[Array, Array, Array, float]:
    """Return covariances over so many samples: of what is seen, of deformation and of rate with it, (N, N); and the variance.

    On a period of twice the segment: none of its samples follows another one's end.
    """
    length = 2 * lines.count
    frequency = np.fft.rfftfreq(length, lines.dt)
    square = (2.0 * np.pi * frequency) ** 2
    deformation = np.interp(frequency, lines.frequency, power / np.abs(lines.laplace) ** 4)
    deformation[frequency > lines.frequency[-1]] = 0.0
    own = np.fft.irfft(deformation * square**2 + np.interp(frequency, lines.frequency, noise), length)
    of_value = np.fft.irfft(-deformation * square, length)
    of_rate = np.fft.irfft(-1j * deformation * square * np.sqrt(square), length)[:part]
    variance = float(np.fft.irfft(deformation, length)[0])
    return sl.toeplitz(own[:part]) + _MEAN * own[0], sl.toeplitz(of_value[:part]), sl.toeplitz(of_rate, -of_rate), variance
