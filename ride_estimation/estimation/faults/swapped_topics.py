# Copyright 2026 ride_estimation contributors
"""Two accelerometers whose topics are exchanged: each reading fits at the place of the other.

With ``P = I - H H^+`` the redundant equations of a rigid body (:mod:`rigid_check`) and C the covariance of all readings, the mean
squared residual is ``tr(P C)``; with readings i and j exchanged it is ``tr(P X C X^T)``, X the exchange. Constant errors (bias,
tilt) are no part of a covariance. An exchange with a sensor on a mount base puts its reading into the redundant equations of the
body; the reading it takes must then also fit better among the other bases, moving as a rigid frame, than the one it gives.

What is found is put right: the readings are used where they belong, and it is reported.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.block_math import follow_moments
from ride_estimation.sensors.layout import residual_projection
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: memory of the covariance [s]
_MEMORY = 2.0
#: data it needs [s]
_LEAST = 1.0
#: time between two tests [s]
_EVERY = 0.2
#: least residual as a share of the motion: below it nothing can be decided and little is lost
_SHARE = 0.02
#: the same as a multiple of the noise
_NOISE = 4.0
#: factor by which the exchange must lessen the squared residual of the body
_BETTER = 4.0
#: factor by which it must lessen the squared difference of a reading from the other bases
_NEARER = 2.0


@dataclasses.dataclass(frozen=True)
class _Exchange:
    """Sensors, the channels that take the places of those of the body, and the misfit among the bases before and after."""

    first: int
    second: int
    channels: NDArray[np.int64]
    before: Array | None = None
    after: Array | None = None


class SwappedTopics:
    """Search for exchanged topics among the accelerometers of a body, and between them and those at its mount bases.

    Parameters
    ----------
    body, base
        Accelerometers and IMUs on the body and at the bases.
    streams, columns
        Stream and first column of each in an aligned block, the body's first.
    rows
        Rows ``[e, r x e]`` of the accelerometer channels of the body, shape (3 S, 6).
    """

    def __init__(
        self, body: Sequence[Sensor], base: Sequence[Sensor], streams: Sequence[int], columns: Sequence[int], rows: Array
    ) -> None:
        self._sensors = (*body, *base)
        self.bodies = len(body)
        self._streams = np.array(streams, dtype=np.int64)
        self._columns = [np.arange(c, c + s.channels) for c, s in zip(columns, self._sensors)]
        self._channels = np.concatenate([c[:3] for c in self._columns]) if self._columns else np.zeros(0, dtype=np.int64)
        self._rows = rows
        self._noise = float(np.mean([s.noise_std**2 for s in body])) if body else 0.0
        #: exchanges in force, pairs of sensors in the order of the sensors given
        self.pairs: list[tuple[int, int]] = []
        self._all: BoolArray = np.ones(len(self._sensors), dtype=bool)
        self._setups: dict[bytes, tuple[Array, list[_Exchange]]] = {}
        self.reset()

    def reset(self) -> None:
        """Forget the readings; exchanges in force stay."""
        size = len(self._channels)
        self._fit: BoolArray = np.zeros(len(self._sensors), dtype=bool)
        self._sum, self._square = np.zeros(size), np.zeros((size, size))
        self._weight, self._time, self._next = 0.0, 0.0, _LEAST

    def exchange(self, values: Array, valid: BoolArray) -> tuple[Array, BoolArray]:
        """Return readings (K, columns) and which may be used (K, streams), exchanged where they are in force."""
        if not self.pairs:
            return values, valid
        values, valid = values.copy(), valid.copy()
        for i, j in self.pairs:
            values[:, [*self._columns[i], *self._columns[j]]] = values[:, [*self._columns[j], *self._columns[i]]]
            both = self._streams[[i, j]]
            valid[:, both] = valid[:, both[::-1]]
        return values, valid

    def observe(self, values: Array, valid: BoolArray, dt: float) -> str:
        """Take one block; return words where an exchange was found or ended just now.

        Parameters
        ----------
        values, valid
            As :meth:`exchange` returns them.
        dt
            Tick [s].
        """
        # the normal case: every sensor spoke
        fit: BoolArray = self._all if valid.all() else np.asarray(valid[:, self._streams].all(axis=0))
        if fit is not self._fit and not np.array_equal(fit, self._fit):
            self.reset()
            self._fit = fit
        if not fit.any():
            return ""
        duration = len(values) * dt
        keep = math.exp(-duration / _MEMORY)
        self._weight = keep * self._weight + len(values)
        follow_moments(values, self._channels, keep, self._sum, self._square)
        self._time += duration
        if self._time < self._next:
            return ""
        self._next = self._time + _EVERY
        return self._judge()

    def _judge(self) -> str:
        mean = self._sum / self._weight
        covariance = self._square / self._weight - np.outer(mean, mean)
        project, exchanges = self._setup(self._fit)
        redundant = float(np.trace(project))
        if redundant < 0.5 or not exchanges:
            return ""
        own = np.flatnonzero(np.repeat(self._fit[: self.bodies], 3))
        motion = float(np.mean(np.diag(covariance)[own]))
        residual = float(np.sum(project * covariance[np.ix_(own, own)]))
        if residual / redundant < _SHARE**2 * motion + _NOISE**2 * self._noise:
            return ""
        found = [float(np.sum(project * covariance[np.ix_(e.channels, e.channels)])) for e in exchanges]
        best = int(np.argmin(found))
        chosen = exchanges[best]
        if _BETTER * found[best] > residual or not _nearer(chosen, covariance):
            return ""
        return self.toggle(chosen.first, chosen.second)

    def toggle(self, first: int, second: int) -> str:
        """Exchange two sensors from now on, or no longer where they are; return words.

        Parameters
        ----------
        first, second
            In the order of the sensors given, the body's first.
        """
        names = " and ".join(self._sensors[n].name for n in (first, second))
        pair = (first, second)
        ended = pair in self.pairs
        if ended:
            self.pairs.remove(pair)
        else:
            self.pairs.append(pair)
        self.reset()
        return f"the topics of {names} are {'no longer ' if ended else ''}exchanged"

    def _setup(self, fit: BoolArray) -> tuple[Array, list[_Exchange]]:
        """Return P of the body sensors that speak, and the exchanges to be tested."""
        key = fit.tobytes()
        if key not in self._setups:
            body = np.flatnonzero(fit[: self.bodies])
            h = self._rows[np.repeat(fit[: self.bodies], 3)]
            self._setups[key] = (residual_projection(h), self._exchanges(fit, body))
        return self._setups[key]

    def _exchanges(self, fit: BoolArray, body: NDArray[np.int64]) -> list[_Exchange]:
        found = []
        for i, j in itertools.product(body.tolist(), np.flatnonzero(fit).tolist()):
            if j <= i or self._sensors[i].channels != self._sensors[j].channels or self._sensors[i].axes != self._sensors[j].axes:
                continue
            order = [{i: j, j: i}.get(n, n) for n in body.tolist()]
            channels = np.concatenate([np.arange(3 * n, 3 * n + 3) for n in order])
            if j < self.bodies:
                found.append(_Exchange(i, j, channels))
                continue
            others = [n for n in np.flatnonzero(fit).tolist() if n >= self.bodies and n != j and self._sensors[n].triaxial]
            weights = _rigid_weights(self._sensors[j], [self._sensors[n] for n in others])
            if weights is not None:
                found.append(_Exchange(i, j, channels, self._misfit(j, j, others, weights), self._misfit(i, j, others, weights)))
        return found

    def _misfit(self, reading: int, place: int, others: Sequence[int], weights: Array) -> Array:
        """Return the rows (3, channels) that compare a reading at the place of a base sensor with the other bases."""
        rows = np.zeros((3, len(self._channels)))
        rows[:, 3 * reading : 3 * reading + 3] = self._sensors[place].rotation
        for n, weight in zip(others, weights.T):
            rows[:, 3 * n : 3 * n + 3] -= weight[:, None] * self._sensors[n].rotation
        return rows

    def messages(self) -> list[str]:
        """Return one sentence per exchange in force."""
        return [
            f"the topics of {self._sensors[i].name} and {self._sensors[j].name} are exchanged: each fits at the place of the "
            "other, and is used there until the topics are put right"
            for i, j in self.pairs
        ]

    def save(self) -> list[list[int]]:
        """Return the exchanges in force as plain lists."""
        return [list(pair) for pair in self.pairs]

    def load(self, saved: Sequence[Sequence[Any]]) -> None:
        """Continue from :meth:`save`."""
        self.pairs = [(int(i), int(j)) for i, j in saved]
        for i, j in self.pairs:
            if not 0 <= i < j < len(self._sensors) or self._sensors[i].channels != self._sensors[j].channels:
                raise ValueError(f"exchanged topics {self.pairs} are none of {len(self._sensors)} sensors of one kind")
        self.reset()


def _nearer(exchange: _Exchange, covariance: Array) -> bool:
    """Return whether the base sensor takes a reading that fits better among the other bases than the one it gives."""
    if exchange.before is None or exchange.after is None:
        return True
    before, after = (float(np.sum((rows @ covariance) * rows)) for rows in (exchange.before, exchange.after))
    return _NEARER * after < before


def _rigid_weights(sensor: Sensor, others: Sequence[Sensor]) -> Array | None:
    """Return weights (3, N) of the other base sensors on the motion at one of them, rigid frame; None where undetermined.

    Longitudinal motion is linear in y, lateral in x (yaw), vertical in x and y.
    """
    if len(others) < 3:
        return None
    places = np.array([s.position for s in others])
    centre = places.mean(axis=0)
    if np.linalg.svd((places - centre)[:, :2], compute_uv=False)[1] < 0.1:
        return None
    weights = np.zeros((3, len(others)))
    for axis, columns in enumerate(((1,), (0,), (0, 1))):
        design = np.column_stack([np.ones(len(others)), (places - centre)[:, columns]])
        own = np.concatenate([[1.0], (sensor.position - centre)[list(columns)]])
        weights[axis] = own @ np.linalg.pinv(design, rcond=1e-6)
    return weights
