# Copyright 2026 ride_estimation contributors
"""Filters that integrate acceleration with what comes before and after, and the error each of them leaves.

With the whole record known the best estimate of a deflection e from ``u = e'' + n`` passes the double integral through
``H = S / (S + N)``, real and without phase (Wiener 1949); S and N are the densities of e'' and n. Deflections have less and less
acceleration towards low frequency, so H is a high-pass: ``H = 1 / (1 + (w / omega)^(2 n))`` here, with the order n and the
corner w that leave least. As in :mod:`deformation_filter` no model is believed: what a filter leaves is taken from the measured
spectrum, ``sum (S (1 - H)^2 + N H^2) / omega^4 df``, and that sum is the variance that is stated.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: corners [Hz] and orders n
_CORNERS, _ORDERS = np.geomspace(0.1, 8.0, 31), (1, 2, 4)
#: frequencies over the corner at which white noise is integrated
_RELATIVE = np.geomspace(1e-3, 3e3, 3000)
#: grid on which a missing half of the record is weighed: rate [Hz] and length [s]
_EDGE_RATE, _EDGE_SPAN = 50.0, 80.0
#: distances from the edge of a record [s]
EDGES = np.array([0.0, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 9.0, 13.0])


class ZeroPhaseBank:
    """Candidate filters.

    Parameters
    ----------
    frequencies, widths
        Centres and widths of the bins of a spectrum, shape (F,) [Hz].
    highest
        Largest corner the time base resolves [Hz].
    """

    def __init__(self, frequencies: Array, widths: Array, highest: float) -> None:
        corners = _CORNERS[: max(1, int(np.sum(highest >= _CORNERS)))]
        self.corner: Array = 2.0 * np.pi * np.repeat(corners, len(_ORDERS))
        self.order: Array = np.tile(np.array(_ORDERS, dtype=float), len(corners))
        self._frequencies, self._widths = frequencies, widths
        omega = 2.0 * np.pi * frequencies
        passed = 1.0 / (1.0 + (self.corner[:, None] / omega) ** (2.0 * self.order[:, None]))
        self._missed, self._passed = (1.0 - passed) ** 2, passed**2
        self._weight, self._weight_rate = widths / omega**4, widths / omega**2
        unit = [(1.0 / (1.0 + _RELATIVE ** (-2.0 * n))) ** 2 / (2.0 * np.pi) for n in _ORDERS]
        self._white = np.tile([_integral(h / _RELATIVE**4) for h in unit], len(corners)) / self.corner**3
        self._white_rate = np.tile([_integral(h / _RELATIVE**2) for h in unit], len(corners)) / self.corner

    def errors(self, signal: Array, noise: Array, white: float) -> tuple[Array, Array]:
        """Return the error variance of value and rate of every filter, shape (C,) each.

        Parameters
        ----------
        signal, noise
            One-sided densities of the acceleration in the bins, shape (F,) [(m/s^2)^2/Hz]: what is wanted, and noise that is
            not white.
        white
            One-sided density of the white noise.
        """
        density = self._missed * signal + self._passed * noise
        return density @ self._weight + white * self._white, density @ self._weight_rate + white * self._white_rate

    def left(self, index: int, signal: Array, noise: Array) -> Array:
        """Return the density of the error of the value of a filter, shape (F,) [m^2/Hz]."""
        return np.asarray((self._missed[index] * signal + self._passed[index] * noise) * self._weight / self._widths)

    def passed(self, index: int, measured: Array) -> Array:
        """Return the density of what a filter makes of measured acceleration, shape (F,) [m^2/Hz]."""
        return np.asarray(self._passed[index] * measured * self._weight / self._widths)

    def response(self, index: int, omega: Array) -> Array:
        """Return H over ``-omega^2`` at angular frequencies, 0 at zero: from acceleration to deflection."""
        safe = np.where(omega > 0.0, omega, 1.0)
        two = 2.0 * self.order[index]
        # omega^(2n - 2) / (omega^2n + w^2n), scaled so that no power overflows
        ratio = safe / self.corner[index]
        passed = np.where(ratio > 1.0, 1.0 / (1.0 + np.maximum(ratio, 1.0) ** -two), 0.0)
        low = np.minimum(ratio, 1.0) ** two
        passed = np.where(ratio > 1.0, passed, low / (1.0 + low))
        return np.asarray(np.where(omega > 0.0, -passed / safe**2, 0.0))

    def edge(self, index: int, measured: Array) -> tuple[Array, Array]:
        """Return the variance of value and rate that the missing other side of the record leaves, at :data:`EDGES`.

        The record is continued by zeros: what would have been there, of this spectrum, is missing from the sum.

        Parameters
        ----------
        index
            Filter.
        measured
            One-sided density of the acceleration, shape (F,).
        """
        count = round(_EDGE_RATE * _EDGE_SPAN)
        grid = np.asarray(np.arange(count // 2 + 1) * (_EDGE_RATE / count), dtype=np.float64)
        density = np.interp(grid, self._frequencies, measured, left=float(measured[0]), right=0.0)
        response = self.response(index, 2.0 * np.pi * grid)
        shapes = np.fft.irfft(np.stack([response, 2j * np.pi * grid * response]), count, axis=1)[:, : count // 2]
        later = np.arange(count // 2) / _EDGE_RATE >= EDGES[:, None]
        cut = np.abs(np.fft.rfft(shapes[:, None] * later, count, axis=2)) ** 2
        value, rate = cut @ density * (grid[1] - grid[0])
        return np.asarray(value), np.asarray(rate)


@functools.lru_cache(maxsize=4)
def zero_phase_bank(frequencies: tuple[float, ...], widths: tuple[float, ...], highest: float) -> ZeroPhaseBank:
    """Return the bank of these bins, made once."""
    return ZeroPhaseBank(np.array(frequencies), np.array(widths), highest)


def _integral(values: Array) -> float:
    return float(np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(_RELATIVE)))
