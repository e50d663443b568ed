# Copyright 2026 ride_estimation contributors
"""Do the angular rates that IMUs state belong to the turning that the accelerometers of the body show: unit, sign, axes.

The accelerometers alone give the angular acceleration ``alpha = (H^+ y)_alpha`` of the body, so rates w of a gyro in good order
and alpha agree after ``alpha -> s / (s + c)^2 alpha`` and ``w -> s^2 / (s + c)^2 w``: integration and differentiation cancel, and
biases of both are gone. The matrix that takes one to the other, ``M = <w a^T> <a a^T>^-1`` over the axes that turn, is the unit
matrix; degrees per second make it 57.3 times that, an inverted axis a minus one on the diagonal. A gyro whose matrix is far from
it is left out and rates follow from the accelerometers; estimates made with it are discarded.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from ride_estimation.estimation.common.block_math import biquad_block
from ride_estimation.frames import AXES
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: corner of the sections [Hz]
_CORNER_HZ = 1.0
#: time in which the sections forget their beginning [s]
_SETTLED = 1.0
#: memory of the moments [s]
_MEMORY = 10.0
#: least time of rotation [s]
_LEAST = 0.8
#: size of the turning that says something: multiple of what noise makes of it
_TURNING = 6.0
#: independent values of a turning of a few hertz per second
_PER_SECOND = 4.0
#: error of an element of the matrix that no gyro in good order has
_WRONG = 0.3
#: standard deviations that such an error must be
_SIGMAS = 5.0
#: share of the readings that may contradict one rigid body for alpha to be believed
_CONTRADICTION = 0.3
#: units that are mistaken for rad/s: factor, words
_UNITS = ((180.0 / math.pi, "deg/s"), (1000.0, "mrad/s"), (math.pi / 180.0, "rad/s turned into degrees once too often"))


class GyroCheck:
    """Judge the gyros of one body, block by block.

    Parameters
    ----------
    sensors
        Accelerometers and IMUs of the body.
    gyros
        Which of them measure rates.
    rows
        Rows of B of the accelerometer channels, shape (3 S, 6).
    free
        Coordinates of the body that move, shape (6,) bool.
    """

    def __init__(self, sensors: Sequence[Sensor], gyros: Sequence[int], rows: Array, free: BoolArray) -> None:
        self._names = [sensors[i].name for i in gyros]
        own, measured = rows[:, free], np.any(rows != 0.0, axis=1)
        self.possible = bool(gyros) and int(measured.sum()) > own.shape[1]
        self.possible = self.possible and np.linalg.matrix_rank(own, tol=1e-6) == own.shape[1]
        self.possible = self.possible and bool(free[3:].any())
        inverse = np.linalg.pinv(own, rcond=1e-6) if self.possible else np.zeros(own.T.shape)
        whole = np.zeros((6, len(rows)))
        whole[free] = inverse
        self._turn = whole[3:]
        self._project = np.diag(measured.astype(float)) - rows @ whole
        self._redundant = max(float(np.trace(self._project)), 1.0)
        self._noise = np.sqrt(np.square(self._turn) @ np.repeat([s.noise_std**2 for s in sensors], 3))
        #: words on the gyros that are left out
        self.found: dict[int, str] = {}
        self.reset()

    def reset(self) -> None:
        """Begin a new time base; verdicts stay."""
        count = len(self._names)
        self._step = 0.0
        self._filters: list[tuple[Array, Array]] = []
        self._states: list[Array] = []
        self._age = self._time = 0.0
        self._alpha = np.zeros((3, 3))
        self._cross, self._rates = np.zeros((count, 3, 3)), np.zeros((count, 3))
        self._residual = self._size = 0.0

    def observe(self, samples: Array, rates: Array, there: BoolArray, dt: float) -> list[int]:
        """Take a block; return the gyros that were found wrong just now.

        Parameters
        ----------
        samples
            Accelerometer channels, shape (K, 3 S).
        rates
            Angular rates in body axes, shape (K, G, 3).
        there
            Which sensors may be used, shape (K, S).
        dt
            Tick [s].
        """
        if not self.possible:
            return []
        if not there.all():
            self._step = self._age = 0.0
            return []
        readings, alpha, turning = self._passed(samples, rates.reshape(len(rates), -1), dt)
        duration = len(samples) * dt
        self._age += duration
        if self._age < _SETTLED:
            return []
        keep = math.exp(-duration / _MEMORY)
        self._time = keep * self._time + duration
        self._alpha = keep * self._alpha + dt * alpha.T @ alpha
        turning = turning.reshape(len(turning), -1, 3)
        self._cross = keep * self._cross + dt * np.einsum("kgi,kj->gij", turning, alpha)
        self._rates = keep * self._rates + dt * np.sum(turning**2, axis=0)
        self._residual = keep * self._residual + dt * float(np.sum((readings @ self._project) ** 2))
        self._size = keep * self._size + dt * float(np.sum(readings**2))
        return self._judge()

    def _passed(self, samples: Array, rates: Array, dt: float) -> tuple[Array, Array, Array]:
        """Return readings, turning by the accelerometers and turning by the gyros, all without what is slow."""
        signals = (samples, samples @ self._turn.T, rates)
        if self._step != dt:
            c = 2.0 * math.pi * _CORNER_HZ
            made = [signal.bilinear(b, [1.0, 2.0 * c, c * c], 1.0 / dt) for b in ([1.0, 0.0, 0.0], [1.0, 0.0], [1.0, 0.0, 0.0])]
            self._filters = [(np.asarray(b), np.asarray(a)) for b, a in made]
            # as if the first values had always been there
            self._states = [signal.lfilter_zi(b, a)[:, None] * v[:1] for (b, a), v in zip(self._filters, signals)]
            self._step = dt
        found = [np.empty_like(v) for v in signals]
        for values, (b, a), state, out in zip(signals, self._filters, self._states, found):
            biquad_block(np.ascontiguousarray(values), b, a, state, out)
        return found[0], found[1], found[2]

    def _judge(self) -> list[int]:
        floor = _TURNING * self._noise / (2.0 * math.pi * _CORNER_HZ)
        turns = np.flatnonzero(np.diag(self._alpha) > self._time * floor**2)
        channels = len(self._project)
        contradiction = (self._residual / self._redundant) / max(self._size / channels, 1e-300)
        if self._time < _LEAST or not turns.size or contradiction > _CONTRADICTION**2:
            return []
        new = []
        inverse = np.linalg.inv(self._alpha[np.ix_(turns, turns)])
        for g in range(len(self._names)):
            if g in self.found:
                continue
            cross = self._cross[g][:, turns]
            matrix = cross @ inverse
            left = np.maximum(self._rates[g] - np.einsum("ij,ij->i", matrix, cross), 0.0)
            std = np.sqrt(np.outer(left, np.diag(inverse)) / max(_PER_SECOND * self._time, 1.0))
            off = np.abs(matrix - np.eye(3)[:, turns])[turns]
            if np.any((off > _WRONG) & (off > _SIGMAS * std[turns])):
                self.found[g] = wrong_rates(np.diag(matrix[turns]), turns)
                new.append(g)
        return new

    def messages(self) -> list[str]:
        """Return one sentence per gyro that is left out."""
        return [
            f"{self._names[g]}: its angular rates are not those that the accelerometers show ({words}): they are not used"
            for g, words in sorted(self.found.items())
        ]

    def save(self) -> dict[str, str]:
        """Return the verdicts as a plain mapping."""
        return {str(g): words for g, words in self.found.items()}

    def load(self, saved: Mapping[str, str]) -> None:
        """Continue from :meth:`save`."""
        self.reset()
        self.found = {int(g): str(words) for g, words in saved.items()}


def wrong_rates(gains: Array, axes: NDArray[np.int64]) -> str:
    """Return what is wrong with rates that are so many times the true ones, gains (A,), about axes 0 to 2, shape (A,)."""
    for factor, unit in _UNITS:
        if np.all(np.abs(gains / factor - 1.0) < 0.3):
            return f"{float(np.mean(gains)):.3g} times as large: {unit} instead of rad/s"
    listed = ", ".join(f"{gain:+.2f} about {AXES[a]}" for gain, a in zip(gains, axes))
    return f"times the true ones: {listed}; sign, axes or unit"
