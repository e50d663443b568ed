# Copyright 2026 ride_estimation contributors
"""Errors of integrated accelerations that are slow instead of white: what wrong angles and gains make of braking and bends.

A filter that integrates acceleration of white noise of density Q and is held by a pseudo measurement of density R leaks away at
``omega^4 = Q / R``. With sensors far quieter than they are well mounted that corner falls so low that an error of a few mm/s^2,
a thousandth of a braking that lasts, is integrated for half a minute. An error of variance S that is slow against the corner
has the density ``2 S / omega`` there.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.jit import compile_kernel

Array = NDArray[np.float64]

#: standard deviations of the installation that count: what lasts is integrated, and an attitude that believes its sensors too
#: much returns slowly (with 1 instead of sqrt 2, sensors 0.3 degrees off and 1.5 m/s^2 for 8 s: 2 degrees left after 20 s, not 1)
_STDS = math.sqrt(2.0)
#: time over which an acceleration counts as slow, twice, one after the other: what a road excites at a hertz or two does not [s]
_SLOW = 0.5
#: time after which it is part of gravity [s]
_LASTING = 30.0
#: memory of its size [s]
_MEMORY = 5.0
#: rows of the state as they are saved
_NAMES = ("first", "slow", "mean")


@compile_kernel
def follow_lasting(accel: Array, gain: float, lasting: float, state: Array) -> float:
    """Follow the slow acceleration and its mean; return the square of how far they are apart.

    Parameters
    ----------
    accel
        Specific force at the ticks of a block, shape (K, 3).
    gain, lasting
        Share of a block in both slow accelerations, and in the mean.
    state
        Acceleration slow once and twice, and the mean, shape (3, 3); in place.
    """
    size = 0.0
    for a in range(3):
        total = 0.0
        for k in range(accel.shape[0]):
            total += accel[k, a]
        state[0, a] += gain * (total / accel.shape[0] - state[0, a])
        state[1, a] += gain * (state[0, a] - state[1, a])
        state[2, a] += lasting * (state[1, a] - state[2, a])
        size += (state[1, a] - state[2, a]) ** 2
    return size


class LastingAcceleration:
    """Size of the acceleration that lasts longer than half a second, and what sensors in good order make of it.

    Parameters
    ----------
    share
        Standard deviation of what a channel reads wrongly per acceleration of its sensor: gain and misalignment.
    """

    def __init__(self, share: float) -> None:
        #: acceleration slow once and twice, and its mean
        self._state = np.zeros((3, 3))
        self._age = 0.0
        self._square = 0.0
        #: squared share of an acceleration that a channel reads wrongly
        self._share = self._least = (_STDS * share) ** 2

    @property
    def error_variance(self) -> float:
        """Return the variance of the slow error of an accelerometer channel [(m/s^2)^2]."""
        return self._share * self._square / 3.0

    def learn_share(self, residual: Array, noise: Array, reading: Array, redundant: int) -> None:
        """Take over from residuals which share of an acceleration the sensors read wrongly, at least the tolerances.

        Parameters
        ----------
        residual, noise, reading
            Variances of the residuals, of the noise and of the readings of the channels, shape (C,).
        redundant
            Equations more than unknowns.
        """
        excess = float(np.sum(residual)) / redundant - float(np.mean(noise))
        self._share = max(self._least, excess / max(float(np.mean(reading)), 1e-12))

    def observe(self, accel: Array, duration: float) -> None:
        """Take the specific force at the ticks of a block, shape (K, 3), which lasts so long [s]."""
        if not self._age:
            self._state[:] = accel.mean(axis=0)
        self._age += duration
        gain, lasting = -math.expm1(-duration / _SLOW), -math.expm1(-duration / min(_LASTING, self._age))
        size = float(follow_lasting(accel, gain, lasting, self._state))
        # at once up, slowly down
        self._square = max(size, self._square + math.expm1(-duration / _MEMORY) * (self._square - size))

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        return {
            **dict(zip(_NAMES, self._state.tolist())), "age": self._age, "square": self._square, "share": self._share,
        }  # fmt: skip

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        self._state = np.array([saved[name] for name in _NAMES], dtype=float)
        self._age, self._square, self._share = (float(saved[name]) for name in ("age", "square", "share"))


def with_slow_error(white: float, slow: float, held: float, dt: float) -> float:
    """Return the variance of an acceleration sample that stands for white noise and a slow error together.

    Solves ``omega^4 = (Q + 2 S / omega) / R``.

    Parameters
    ----------
    white
        Variance of the white noise of a sample.
    slow
        Variance of the slow error.
    held
        Variance of a pseudo measurement of the double integral, at every tick.
    dt
        Tick [s].
    """
    if slow <= 0.0:
        return white
    omega = max(math.pow(white / held, 0.25), math.pow(2.0 * slow / (held * dt), 0.2))
    return white + 2.0 * slow / (omega * dt)
