# Copyright 2026 ride_estimation contributors
"""Angular rate from centripetal acceleration, for bodies without gyros.

Integrated angular acceleration drifts; what holds it is the direction of gravity, wrong while a bend lasts, and for yaw
nothing. Centripetal terms of a wrong rate are no motion of a rigid body: with omega = w + d they leave ``r = M T w d`` in the
redundant equations, ``M = I - H W``, T of :func:`centripetal.centripetal_terms`. A body that turns shows its rate so, the
better the faster; one that does not turn shows nothing, and nothing is used. (Schuler, Grammatikos and Fegley, IEEE Trans.
Aerosp. Electron. Syst. AES-3, 465, 1967, measured rotation with accelerometers alone.)

A constant error of a sensor looks like a constant rate, so only what differs from the means of the last minute counts.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.estimation.motion.sensor_drift import residual_of_errors

Array = NDArray[np.float64]

#: time over which residuals are averaged [s]
_WINDOW = 0.1
#: time for which errors of gain and angle stay alike [s]
_ALIKE = 2.0
#: memory of the biases [s]
_MEMORY = 60.0
#: samples of a filtered signal per independent one
_DEPENDENT = 4.0


class ResidualRate:
    """Correction of the angular rate by the residuals of the accelerometers.

    Parameters
    ----------
    terms
        T of the accelerometer channels, shape (C, 9).
    rows
        H of the same, shape (C, 6).
    redundant
        Equations more than unknowns, 0 where nothing is to be taken.
    offset
        Standard deviation of the mean reading of sensors in good order [m/s^2].
    """

    def __init__(self, terms: Array, rows: Array, redundant: int, offset: float) -> None:
        self._terms, self._rows, self._redundant, self._offset = terms.reshape(len(terms), 3, 3), rows, redundant, offset
        self._bias, self._seen, self._age = np.zeros(len(terms)), np.zeros((len(terms), 3)), 0.0
        self.reset()

    def reset(self) -> None:
        """Begin a new window."""
        self._sum, self._rate, self._ticks = np.zeros(len(self._bias)), np.zeros(3), 0

    def observe(self, residual: Array, rate: Array, dt: float) -> bool:
        """Add residuals (K, C) at the rates (K, 3) they are those of; return whether a window is full."""
        self._sum += residual.sum(axis=0)
        self._rate += rate.sum(axis=0)
        self._ticks += len(residual)
        return self._redundant > 0 and self._ticks * dt >= _WINDOW

    def correct(
        self, weights: Array, noise: float, slow: float, state: Array, tilt: Array, yaw: Array, dt: float
    ) -> None:  # fmt: skip
        """Correct angle, rate and bias of all axes and their covariances by the window, in place.

        Parameters
        ----------
        weights
            W of the channels, shape (6, C).
        noise, slow
            Variance of a sample and of the slow error of a channel [(m/s^2)^2].
        state
            (5, 3): angle, rate, bias of the angular acceleration first.
        tilt, yaw
            Covariances of those for roll and pitch and for yaw, shape (3, 3).
        dt
            Tick [s].
        """
        ticks, duration = self._ticks, self._ticks * dt
        mean, rate = self._sum / ticks, self._rate / ticks
        self.reset()
        variance = np.array([tilt[1, 1], tilt[1, 1], yaw[1, 1]])
        project = residual_of_errors(self._rows, weights)
        seen = project @ (self._terms @ rate)
        self._age += duration
        gain = min(duration / min(self._age, _MEMORY), 1.0)
        self._bias += gain * (mean - self._bias)
        self._seen += gain * (seen - self._seen)
        left, seen = mean - self._bias, seen - self._seen
        # what d d / 2 leaves, errors that last, and a mean in which the window itself may be: of a faulty sensor that is large
        size = max(self._offset, float(np.sqrt(self._bias @ self._bias / self._redundant)))
        known = size * min(1.0, _ALIKE / self._age)
        lasting = (slow + known**2) * max(_ALIKE / duration, 1.0) + float(np.mean(self._terms**2)) * float(variance @ variance)
        stated = _DEPENDENT * noise / ticks + lasting
        information, asked = seen.T @ seen, seen.T @ left
        for _ in range(2):
            after = np.linalg.inv(information / stated + np.diag(1.0 / variance))
            step = after @ asked / stated
            # a faulty sensor leaves what no rate explains
            stated = max(stated, float(np.sum((left - seen @ step) ** 2)) / self._redundant)
        for axes, p, now in (([0, 1], tilt, max(after[0, 0], after[1, 1])), ([2], yaw, after[2, 2])):
            along = p[:, 1] / p[1, 1]
            state[:3, axes] += np.outer(along, step[axes])
            p[...] = p - np.outer(along, along) * (p[1, 1] - now)

    def save(self) -> dict[str, Any]:
        """Return what was learned as plain lists."""
        return fields_of(self, ("_bias", "_seen", "_age"))

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        take_fields(self, ("_bias", "_seen", "_age"), saved)
