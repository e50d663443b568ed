# Copyright 2026 ride_estimation contributors
"""Causal optimal filters that make deformation out of its noisy acceleration, and the error each of them leaves.

Model of one channel, from low to high frequency: nothing, then acceleration of density A above a corner w,
``e'' = s^4 / B(s) v``, ``u = e'' + n`` with n white of density N. With the states ``[int int e, int e, e, e']`` the
Kalman filter of that model is causal and best (Wiener 1949; Kalman and Bucy 1961); it depends on A / N and the form of B only,
w scales time. No model is believed: every filter H of the bank is judged by what the measured spectrum S says it
leaves, ``sum (S |1 - H|^2 + N |H|^2) / omega^4 df``, and that sum is the variance that is stated.
"""

from __future__ import annotations

import dataclasses
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


@dataclasses.dataclass(frozen=True)
class _Prototypes:
    """The filters for a corner of 1 rad/s, P of them, and what does not depend on the corner.

    Attributes
    ----------
    b, gain
        Of the model and of its Kalman filter, shape (P, 4).
    states
        Covariance of the states of the model for unit drive, shape (P, 4, 4).
    denominator, numerator
        Of the transfer functions from acceleration to the states, falling powers, shapes (P, 5) and (P, 4, 4) (power, state).
    slowest
        Rate of the slowest pole, shape (P,).
    white, white_rate
        Variance of value and rate that white noise of one-sided density 1 leads to, shape (P,).
    """

    b: Array
    gain: Array
    states: Array
    denominator: Array
    numerator: Array
    slowest: Array
    white: Array
    white_rate: Array

    def responses(self, relative: Array) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return estimated over true value and rate at frequencies over the corner (...,), shape (..., P) each."""
        return _responses(self.denominator, self.numerator, relative)


@functools.cache
def _prototypes() -> _Prototypes:
    """Return the prototypes, made once: they depend on nothing."""
    parts = [_prototype(float(r), s) for s in _SPLITS for r in _RATIOS_DB]
    b, gain, states = (np.array(part) for part in zip(*parts, strict=True))
    denominator, numerator = _transfer(_closed(b, gain), gain)
    value, rate = _responses(denominator, numerator, _RELATIVE)
    return _Prototypes(
        b, gain, states, denominator, numerator, -np.max(np.real(np.linalg.eigvals(_closed(b, gain))), axis=1),
        _integral(np.abs(value) ** 2 / _RELATIVE[:, None] ** 4), _integral(np.abs(rate) ** 2 / _RELATIVE[:, None] ** 2),
    )  # fmt: skip


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


def _closed(b: Array, gain: Array) -> Array:
    """Return the system matrices of filters, shape (C, 4, 4)."""
    closed = np.zeros((len(b), 4, 4))
    closed[:, [0, 1, 2], [1, 2, 3]] = 1.0
    closed[:, 3] = -b
    return np.asarray(closed + gain[:, :, None] * b[:, None, :])


def _transfer(system: Array, gain: Array) -> tuple[Array, Array]:
    """Return denominators (P, 5) and numerators (P, 4, 4) of ``(s I - A)^-1 gain`` (Faddeev and LeVerrier)."""
    adjugate = np.broadcast_to(np.eye(4), system.shape)
    denominator, numerator = [np.ones(len(system))], []
    for order in range(1, 5):
        numerator.append((adjugate @ gain[:, :, None])[:, :, 0])
        product = system @ adjugate
        denominator.append(-np.trace(product, axis1=1, axis2=2) / order)
        adjugate = product + denominator[-1][:, None, None] * np.eye(4)
    return np.stack(denominator, axis=1), np.stack(numerator, axis=1)


def _responses(denominator: Array, numerator: Array, relative: Array) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    s = 1j * relative[..., None]
    below = np.polyval(denominator.T, s)
    value, rate = (np.polyval(numerator[:, :, state].T, s) for state in (2, 3))
    return s**2 * value / below, s * rate / below


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
        unit = _prototypes()
        corners = 2.0 * np.pi * _CORNERS[: max(1, int(np.sum(highest >= _CORNERS)))]
        many, powers = (len(corners), 1), np.arange(4)
        self.corner = np.repeat(corners, len(unit.b))
        w = self.corner[:, None]
        self.b: Array = np.tile(unit.b, many) * w ** (4.0 - powers)
        self._gain: Array = np.tile(unit.gain, many) * w ** (powers - 3.0)
        self._unit = unit.states
        self._ratio = np.tile([10.0 ** (r / 10.0) for _ in _SPLITS for r in _RATIOS_DB], len(corners))
        # the filters of a corner are the prototypes on another scale of time
        value, rate = (np.swapaxes(h, 1, 2).reshape(-1, len(omega)) for h in unit.responses(omega / corners[:, None]))
        weight, weight_rate = widths / omega**4, widths / omega**2
        self._missed, self._passed = np.abs(1.0 - value) ** 2 * weight, np.abs(value) ** 2 * weight
        self._missed_rate, self._passed_rate = np.abs(1.0 - rate) ** 2 * weight_rate, np.abs(rate) ** 2 * weight_rate
        self._omega4, self._widths = omega**4, widths
        #: squared value a constant acceleration leads to, per (m/s^2)^2
        self.static = self._passed[:, 0] / widths[0]
        # slowest pole of the closed loop: what the start left decays with it
        self._slowest = np.tile(unit.slowest, len(corners)) * self.corner
        self._white = np.tile(unit.white, len(corners)) / self.corner**3
        self._white_rate = np.tile(unit.white_rate, len(corners)) / self.corner

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

    def passed(self, index: int, noise: Array) -> tuple[float, float]:
        """Return what a filter lets through of noise of a density (F,), as variances of value [m^2] and rate [(m/s)^2]."""
        return float(self._passed[index] @ noise), float(self._passed_rate[index] @ noise)

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
        system[:4, :4] = _closed(b[None], gain[None])[0]
        system[:4, 4], system[4, 5] = gain, 1.0 / dt
        exact = linalg.expm(system * dt)
        return exact[:4, :4], exact[:4, 4] - exact[:4, 5], exact[:4, 5]


def _integral(values: Array) -> Array:
    """Return the integral of densities (R, P) over the relative frequencies, shape (P,)."""
    step = np.diff(_RELATIVE)[:, None]
    return np.asarray(np.sum(0.5 * (values[1:] + values[:-1]) * step, axis=0) / (2.0 * np.pi))
