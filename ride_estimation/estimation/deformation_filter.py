# Copyright 2026 ride_estimation contributors
"""Causal optimal filters that make deformation out of its noisy acceleration, and the error each of them leaves.

Model of one channel, from low to high frequency: nothing, then acceleration of density A above a corner w,
``e'' = s^4 / B(s) v``, ``u = e'' + n`` with n white of density N. With the states ``[int int e, int e, e, e']`` the
Kalman filter of that model is causal and best (Wiener 1949; Kalman and Bucy 1961); it depends on A / N and the form of B only,
w scales time. No model is believed: every filter H of the bank is judged by what the measured spectrum S says it
leaves, ``sum (S |1 - H|^2 + N |H|^2) / omega^4 df``, and that sum is the variance that is stated.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

Array = NDArray[np.float64]

#: signal to noise ratio above the corner [dB]
_RATIOS_DB = np.arange(0.0, 51.0, 5.0)
#: second pair of poles over the first: steep rise of the spectrum, or two steps
_SPLITS = (1.0, 0.25)
#: corners w / 2 pi [Hz]
_CORNERS = np.geomspace(0.08, 8.0, 34)
#: damping of the pole pairs of a Butterworth filter of fourth order
_BUTTERWORTH = (0.382683432, 0.923879533)
#: frequencies over the corner at which the noise a filter passes is integrated
_RELATIVE = np.geomspace(1e-3, 3e3, 3000)


def _prototype(ratio_db: float, split: float) -> tuple[Array, Array, Array]:
    """Return b of the model, the gain of its Kalman filter, (4,) each, and the covariance (4, 4) of its states for unit drive.

    For a corner of 1 rad/s.
    """
    first = np.array([1.0, 2.0 * _BUTTERWORTH[0], 1.0])
    second = np.array([1.0, 2.0 * _BUTTERWORTH[1] * split, split**2])
    b = np.polymul(first, second)[:0:-1]
    power = 10.0 ** (ratio_db / 10.0)
    a = np.diag(np.ones(3), 1)
    a[3] = -b
    drive, out = np.zeros((4, 1)), -b[None]
    drive[3] = 1.0
    # the process noise reaches the measurement directly
    total = np.array([[power + 1.0]])
    p = linalg.solve_continuous_are(a.T, out.T, power * drive @ drive.T, total, s=power * drive)
    gain = (p @ out.T + power * drive)[:, 0] / (power + 1.0)
    return b, np.asarray(gain), np.asarray(linalg.solve_continuous_lyapunov(a, -drive @ drive.T))


class FilterBank:
    """Candidate filters and what they leave of every frequency.

    Parameters
    ----------
    frequencies, widths
        Centres and widths of the bins of a spectrum, shape (F,) [Hz].
    highest
        Largest corner the time base resolves [Hz].
    """

    def __init__(self, frequencies: Array, widths: Array, highest: float) -> None:
        omega = 2.0 * np.pi * frequencies
        prototypes = [_prototype(float(r), s) for s in _SPLITS for r in _RATIOS_DB]
        corners = _CORNERS[: max(1, int(np.sum(highest >= _CORNERS)))]
        w = np.repeat(2.0 * np.pi * corners, len(prototypes))[:, None]
        powers = np.arange(4)
        b: Array = np.tile(np.array([p[0] for p in prototypes]), (len(corners), 1)) * w ** (4.0 - powers)
        gain: Array = np.tile(np.array([p[1] for p in prototypes]), (len(corners), 1)) * w ** (powers - 3.0)
        self.corner, self.b, self._gain = w[:, 0], b, gain
        self._unit = [p[2] for p in prototypes]
        self._ratio = np.tile([10.0 ** (r / 10.0) for _ in _SPLITS for r in _RATIOS_DB], len(corners))
        value, rate = self._responses(b, gain, omega)
        weight, weight_rate = widths / omega**4, widths / omega**2
        self._missed, self._passed = np.abs(1.0 - value) ** 2 * weight, np.abs(value) ** 2 * weight
        self._missed_rate, self._passed_rate = np.abs(1.0 - rate) ** 2 * weight_rate, np.abs(rate) ** 2 * weight_rate
        self._omega4, self._widths = omega**4, widths
        #: squared value a constant acceleration leads to, per (m/s^2)^2
        self.static = self._passed[:, 0] / widths[0]
        # slowest pole of the closed loop: what the start left decays with it
        self._slowest = -np.max(np.real(np.linalg.eigvals(self._closed(b, gain))), axis=1)
        # white noise on a corner of 1 rad/s, scaled
        unit = [self._responses(p[0][None], p[1][None], _RELATIVE) for p in prototypes]
        white = [_integral(np.abs(h[0]) ** 2 / _RELATIVE**4) / (2.0 * np.pi) for h, _ in unit]
        white_rate = [_integral(np.abs(h[0]) ** 2 / _RELATIVE**2) / (2.0 * np.pi) for _, h in unit]
        self._white = np.tile(white, len(corners)) / self.corner**3
        self._white_rate = np.tile(white_rate, len(corners)) / self.corner

    @staticmethod
    def _closed(b: Array, gain: Array) -> Array:
        """Return the system matrices of the filters, shape (C, 4, 4)."""
        closed = np.zeros((len(b), 4, 4))
        closed[:, [0, 1, 2], [1, 2, 3]] = 1.0
        closed[:, 3] = -b
        return np.asarray(closed + gain[:, :, None] * b[:, None, :])

    @staticmethod
    def _responses(b: Array, gain: Array, omega: Array) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return estimated over true value and rate at frequencies, shape (C, F) each."""
        s = 1j * omega
        system = s[None, :, None, None] * np.eye(4) - FilterBank._closed(b, gain)[:, None]
        x = np.linalg.solve(system, np.broadcast_to(gain[:, None, :, None], (len(b), len(omega), 4, 1)))[..., 0]
        return s**2 * x[..., 2], s * x[..., 3]

    def errors(self, signal: Array, noise: Array, white: float, age: float) -> tuple[Array, Array]:
        """Return the error variance of value and rate of every filter, shape (C,) each.

        Parameters
        ----------
        signal, noise
            One-sided densities of the acceleration in the bins, shape (F,): deformation, and noise that is not white.
        white
            One-sided density of the white noise.
        age
            Time since the start [s]: deformation and rate were unknown then.
        """
        # an unknown start of a chain of four integrators fades as t^3 exp(-t) of its slowest pole
        passed = self._slowest * age
        start = (1.0 + passed) ** 6 * np.exp(-2.0 * passed)
        value = self._missed @ signal + self._passed @ noise + white * self._white
        rate = self._missed_rate @ signal + self._passed_rate @ noise + white * self._white_rate
        whole, whole_rate = self._widths / self._omega4 @ signal, self._widths / np.sqrt(self._omega4) @ signal
        return value + start * whole, rate + start * whole_rate

    def left(self, index: int, signal: Array, noise: Array) -> Array:
        """Return the density of the error of the value of a filter, shape (F,) [m^2/Hz]."""
        return np.asarray((self._missed[index] * signal + self._passed[index] * noise) / self._widths)

    def start_weight(self, index: int, step: float) -> Array:
        """Return the inverse covariance (4, 4) of an unknown state, in units of the variance of an innovation."""
        w, powers = self.corner[index], np.arange(1, 5)
        covariance = self._unit[index % len(self._unit)] * w ** (powers[:, None] + powers - 9.0)
        return np.asarray(np.linalg.inv(covariance) * (1.0 + 1.0 / self._ratio[index]) / step)

    def discretised(self, index: int, dt: float) -> tuple[Array, Array, Array]:
        """Return transition (4, 4) and the shares of the old and the new sample (4,) of a filter, linear between samples."""
        b, gain = self.b[index], self._gain[index]
        system = np.zeros((6, 6))
        system[:4, :4] = self._closed(b[None], gain[None])[0]
        system[:4, 4], system[4, 5] = gain, 1.0 / dt
        exact = linalg.expm(system * dt)
        return exact[:4, :4], exact[:4, 4] - exact[:4, 5], exact[:4, 5]


@functools.lru_cache(maxsize=4)
def filter_bank(frequencies: tuple[float, ...], widths: tuple[float, ...], highest: float) -> FilterBank:
    """Return the bank of these bins, made once: it takes half a second, and a time base that begins anew has the same bins."""
    return FilterBank(np.array(frequencies), np.array(widths), highest)


def _integral(values: Array) -> float:
    return float(np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(_RELATIVE)))
