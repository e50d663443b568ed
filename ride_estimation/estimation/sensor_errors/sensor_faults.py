# Copyright 2026 ride_estimation contributors
"""Small lasting faults of the sensors of a body or of its bases: gain, misalignment, position and delay, by their score test.

The redundant equations of the rigid body are ``z = Z (y - omega x (omega x r))`` with ``Z H = 0`` and ``Z R Z^T = I`` (H rows
of B, R stated noise). A sensor whose errors are ``b`` (in units of their tolerance) shows ``G b`` in them, and every column of
G follows from the fitted motion at its place: gain its own specific force, misalignment the cross axes, position ``alpha x dr +
omega x (omega x dr)``, delay the derivative; a constant bias is a nuisance. Averages over 20 ms keep these equations
exact and make the noise one of low frequency, whose level is estimated from the data.

Sensors in good order have ``b ~ N(0, I)``. With ``A = G^T G``, ``c = G^T z`` and noise variance q, ``K = (q I + A)^-1 A`` and
``u = (q I + A)^-1 c``, the columns g of one kind of error of one sensor are judged by the score test ``u_g^T K_gg^+ u_g ~ chi^2``
(Cox and Hinkley, Theoretical Statistics, 9.3). The level is shared by all sensors and kinds (Bonferroni).
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ride_estimation.estimation.common.block_math import average_ticks
from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]

#: kinds of error of an installation: number of columns, and standard deviation of the error of a sensor that is wrong, as it
#: happens on vehicles [m/s^2, -, rad, m, s]
_ERRORS = {"bias": (3, 0.5), "gain": (3, 0.2), "misalignment": (3, 0.2), "position": (3, 0.2), "delay": (1, 0.02)}
_COUNTS = tuple(count for count, _ in _ERRORS.values())
_COLUMNS = sum(_COUNTS)
#: columns of every kind that is named among those of a sensor; a bias is a nuisance
KINDS = {
    kind: slice(end - count, end)
    for kind, count, end in zip(_ERRORS, _COUNTS, itertools.accumulate(_COUNTS))
    if kind != "bias"
}
#: probability that anything is called faulty where all sensors are within tolerance
FALSE_ALARM = 1e-3
#: a sensor is a rival when its fault is not this many times less likely than that of the best
_RIVAL = 1000.0
#: length of one average [s]
_AVERAGE = 0.02
#: averages handled together
_BATCH = 50
#: memory of the sums [s]
_MEMORY = 120.0
#: batches before errors of prediction count for the noise
_SETTLE = 3
#: largest squared error of prediction in units of what is expected
_OUTLIER = 9.0
#: averages needed before anything is judged
_LEAST = 4 * _BATCH
#: relative error of an integrated angular rate
_RATE_SHARE = 0.1
#: directions of less information than this share count as not observable
_RANK = 1e-6
#: attributes that are part of a saved state
_SAVED = ("_information", "_score", "_square", "_count", "_scatter", "_batches")


@dataclasses.dataclass(frozen=True)
class Fault:
    """An error of one sensor beyond tolerance.

    Attributes
    ----------
    sensor
        The sensor that explains the redundant equations best.
    kind
        One of :data:`KINDS`.
    amount
        Size in words, with its standard deviation.
    explained
        Share of all deviations that errors of this sensor explain.
    rivals
        Sensors whose errors explain nearly as much.
    log_probability
        Natural logarithm of the probability of such a deviation within tolerance.
    error, std
        Size of every column of the kind and its standard deviation [-, rad, m, s].
    """

    sensor: str
    kind: str
    amount: str
    explained: float
    rivals: tuple[str, ...]
    log_probability: float
    error: tuple[float, ...] = ()
    std: tuple[float, ...] = ()


class FaultTest:
    """Score tests of small constant errors of the accelerometers of one rigid body.

    Parameters
    ----------
    sensors
        Of the body, S of them.
    rows
        Rows of B of their channels in the free coordinates, shape (3 S, F).
    points
        Places from the CG, shape (S, 3).
    rate_std
        Standard deviation of slow errors of the angular rate [rad/s], 0 where gyros measure it.
    further
        Standard deviations of bias, gain, misalignment, position and delay beyond those of the installation.
    least
        Averages needed before anything is judged.
    """

    def __init__(
        self, sensors: Sequence[Sensor], rows: Array, points: Array, rate_std: float,
        further: Sequence[float] = (0.0, 0.0, 0.0, 0.0, 0.0), least: int = _LEAST,
    ) -> None:  # fmt: skip
        self._names = tuple(s.name for s in sensors)
        self._rotation = np.array([s.rotation for s in sensors])
        self._rows, self._points, self._rate_std = rows, points, rate_std
        self._size, self._least = _COLUMNS * len(self._names), least
        self._further_delay = float(further[-1])
        own = [[getattr(s.tolerated_installation, kind) for kind in _ERRORS] for s in sensors]
        #: standard deviation of the errors of every sensor in good order, shape (S, 13)
        self._unit = np.repeat(np.hypot(np.reshape(own, (len(own), len(_ERRORS))), further), _COUNTS, axis=1)
        self._weight = (self._unit / np.repeat([wrong for _, wrong in _ERRORS.values()], _COUNTS)) ** 2
        self._whitening = np.zeros((0, len(rows)))
        self._information = np.zeros((self._size, self._size))
        self._score = np.zeros(self._size)
        self._square, self._count = 0.0, 0.0
        self._scatter = np.zeros((2, len(KINDS)))
        self._batches = 0
        self._buffer = np.zeros((_BATCH + 2, len(rows) + 27))
        self._open = np.zeros(len(rows) + 27)
        self._progress = np.zeros(2, dtype=np.int64)
        self._step, self._noise_share = 0.0, 1.0
        self._found: tuple[Fault | None] | None = None

    @property
    def possible(self) -> bool:
        """Return whether there are redundant equations."""
        return len(self._whitening) > 0

    def set_variance(self, variance: Array) -> None:
        """Use the stated noise variance of the channels, shape (3 S,) [(m/s^2)^2]."""
        self._digest()
        self.interrupt()
        # a row of zeros is of an axis that is not measured: no equation
        measured = np.any(self._rows != 0.0, axis=1)
        scaled = self._rows[measured] / np.sqrt(variance[measured])[:, None]
        left, singular, _ = np.linalg.svd(scaled, full_matrices=True)
        rank = int(np.sum(singular > 1e-6 * singular[0])) if singular.size else 0
        self._whitening = np.zeros((len(left) - rank, len(variance)))
        self._whitening[:, measured] = left[:, rank:].T / np.sqrt(variance[measured])

    def interrupt(self) -> None:
        """Say that the next tick does not follow the last one."""
        self._digest()
        self._progress[:] = 0
        self._open[:] = 0.0

    def observe(self, samples: Array, motion: Array, rate: Array, dt: float) -> None:
        """Take ticks at which every sensor spoke.

        Parameters
        ----------
        samples
            Channels, shape (K, 3 S).
        motion
            Specific force and angular acceleration at the CG, shape (K, 6).
        rate
            Angular rate, shape (K, 3).
        dt
            Tick [s].
        """
        if not self.possible:
            return
        length = max(1, round(_AVERAGE / dt))
        self._noise_share = 1.0 / length
        if length * dt != self._step:
            self.interrupt()
            self._step = length * dt
        start = 0
        while start < len(samples):
            start = int(average_ticks(samples, motion, rate, start, length, self._open, self._progress, self._buffer))
            if self._progress[1] == len(self._buffer):
                self._digest()

    # -- sums -------------------------------------------------------------------------------------------------------------

    def _digest(self) -> None:
        """Add the averages that have neighbours on both sides to the sums; keep the last two as neighbours."""
        ready = int(self._progress[1])
        if ready < 3:
            return
        columns, deviations = self._equations(self._buffer[:ready])
        kept, freedom = self._without_rate_error(self._buffer[:ready], np.column_stack([columns, deviations]))
        self._buffer[:2] = self._buffer[ready - 2 : ready]
        self._progress[1] = 2
        products = np.column_stack([columns, deviations]).T @ kept
        products = 0.5 * (products + products.T)
        information, score = products[:-1, :-1], products[:-1, -1]
        if self._batches >= _SETTLE:
            self._follow_scatter(information, score)
        keep = float(np.exp(-(ready - 2) * self._step / _MEMORY))
        self._information = keep * self._information + information
        self._score = keep * self._score + score
        self._square = keep * self._square + float(products[-1, -1])
        self._count = keep * self._count + freedom
        self._scatter *= keep
        self._batches += 1
        self._found = None

    def _equations(self, averages: Array) -> tuple[Array, Array]:
        """Return columns (N, 13 S) and deviations (N,) of the redundant equations of all averages but the first and last."""
        channels = len(self._rows)
        inner = averages[1:-1]
        motion, products = inner[:, channels : channels + 6], inner[:, channels + 6 : channels + 12]
        first, last = averages[:, channels + 15 : channels + 21], averages[:, channels + 21 :]
        edges = 0.5 * (last[:-1] + first[1:])
        slope = np.diff(edges, axis=0) / self._step
        ticks, count = len(inner), len(self._names)
        turning = _symmetric(products)  # omega x (omega x r) = turning r
        spin = _skew(motion[:, 3:]) + turning
        body = motion[:, None, :3] + np.einsum("kij,sj->ksi", spin, self._points)
        force = np.einsum("sij,ksi->ksj", self._rotation, body)
        change = slope[:, None, :3] + np.einsum("kij,sj->ksi", _skew(slope[:, 3:]), self._points)
        errors = np.zeros((ticks, count, 3, _COLUMNS))
        diagonal = np.arange(3)
        errors[:, :, diagonal, diagonal] = 1.0
        errors[:, :, diagonal, diagonal + 3] = force
        errors[..., 6:9] = _skew(force)
        errors[..., 9:12] = np.einsum("sij,kil->ksjl", self._rotation, spin)
        errors[..., 12] = -np.einsum("sij,ksi->ksj", self._rotation, change)
        errors *= self._unit[:, None]
        redundant = len(self._whitening)
        parts = self._whitening.reshape(redundant, count, 3).transpose(1, 0, 2)
        columns = np.matmul(parts, errors).transpose(0, 2, 1, 3).reshape(ticks * redundant, self._size)
        steady = np.einsum("sij,kil,sl->ksj", self._rotation, turning, self._points).reshape(ticks, channels)
        deviations = (inner[:, :channels] - steady) @ self._whitening.T
        return columns, deviations.ravel()

    def _without_rate_error(self, averages: Array, table: Array) -> tuple[Array, float]:
        """Return the rows of a table weighted for an unknown error of the angular rate, and how many equations are left.

        Without gyros the rate is an integral that leaks; an error ``d`` of it shows as ``d x (omega x r) + omega x (d x r)``.
        Over a batch it is drift, linear in time, and a share of the rate and of its integral (amplitude and phase of the leak).
        It is marginalised: ``W = I - N (N^T N + q I)^-1 N^T``, q the noise, columns N in units of the size of the error.
        """
        if self._rate_std <= 0.0:
            return table, float(len(table))
        rate = averages[1:-1, len(self._rows) + 12 : len(self._rows) + 15]
        ticks, count, redundant = len(rate), len(self._names), len(self._whitening)
        spin, arms = _skew(rate), _skew(self._points)
        # d x (omega x r) = -skew(omega x r) d,  omega x (d x r) = -skew(omega) skew(r) d
        shown = -_skew(np.einsum("kij,sj->ksi", spin, self._points)) - np.einsum("kij,sjl->ksil", spin, arms)
        shown = np.einsum("sij,ksil->ksjl", self._rotation, shown).reshape(ticks, 3 * count, 3)
        seen = np.matmul(self._whitening, shown)
        time = np.linspace(-1.0, 1.0, ticks)[:, None]
        turned = np.cumsum(rate - rate.mean(axis=0), axis=0)
        turned -= turned.mean(axis=0) + time * (time * turned).sum(axis=0) / max(float((time * time).sum()), 1e-30)
        turned *= np.sqrt((rate**2).sum(axis=0) / np.maximum((turned**2).sum(axis=0), 1e-30))
        sizes = (np.full((1, 3), self._rate_std), self._rate_std * time, _RATE_SHARE * rate, _RATE_SHARE * turned)
        errors = np.concatenate([seen * size[:, None] for size in sizes], axis=2).reshape(ticks * redundant, -1)
        gram = errors.T @ errors
        gain = np.linalg.solve(gram + self._noise_share * np.eye(len(gram)), np.column_stack([errors.T @ table, gram]))
        used = gain[:, : table.shape[1]]
        return table - errors @ used, len(table) - float(np.trace(gain[:, table.shape[1] :]))

    def _follow_scatter(self, information: Array, score: Array) -> None:
        """Compare the errors of prediction of a batch with what white noise lets expect, per kind."""
        noise = self._noise()
        error = score - information @ np.linalg.solve(self._information + noise * np.eye(self._size), self._score)
        expected = noise * np.diag(information)
        square = np.minimum(error**2, _OUTLIER * expected).reshape(-1, _COLUMNS).sum(axis=0)
        expected = expected.reshape(-1, _COLUMNS).sum(axis=0)
        for n, part in enumerate(KINDS.values()):
            self._scatter[0, n] += square[part].sum()
            self._scatter[1, n] += expected[part].sum()

    def _noise(self) -> float:
        """Return the variance of a deviation that no constant error of any sensor explains."""
        shift = 1e-9 * float(np.diag(self._information).max(initial=1e-30))
        explained = float(self._score @ np.linalg.solve(self._information + shift * np.eye(self._size), self._score))
        freedom = max(self._count - self._size, 0.2 * self._count, 1.0)
        return max((self._square - explained) / freedom, 1e-6 * self._square / max(self._count, 1.0), 1e-30)

    # -- result -----------------------------------------------------------------------------------------------------------

    def judge(self) -> Fault | None:
        """Return the fault found so far, None where all sensors are within tolerance."""
        if self._found is None:
            self._found = (self._judge(),)
        return self._found[0]

    def errors(self, sensor: int) -> tuple[Array, Array]:
        """Return what the readings of one sensor look like: errors of gain and misalignment [rad], shapes (3,).

        Zero where nothing is seen; others are taken to be within tolerance, no prior draws the numbers to zero.
        """
        if self._count == 0.0:
            return np.zeros(3), np.zeros(3)
        both = self._solved(self._noise())
        parts = (KINDS["gain"], KINDS["misalignment"])
        tests = (self._score_test(*both, _COLUMNS * sensor + np.arange(p.start, p.stop)) for p in parts)
        gain, angle = (value * self._unit[sensor, p] for (_, (value, _)), p in zip(tests, parts, strict=True))
        return gain, angle

    def delay_of(self, name: str) -> tuple[float, float, bool] | None:
        """Return how late a sensor is and its standard deviation [s], and whether noise is no longer most of that.

        What is tolerated beyond the installation, as of frames that bend, looks like a delay too and is part of the standard
        deviation. None for sensors of others and before anything is judged.
        """
        if name not in self._names or not self._ready:
            return None
        column = self._delay_column(name)
        noise = self._noise() * float(self._inflation()[list(KINDS).index("delay")])
        _, (value, std) = self._score_test(*self._solved(noise), np.array([column]))
        unit = float(self._unit.ravel()[column])
        # of sensors in good order var(u_g) = K_gg: their own error, with a variance of one, is in it
        left = math.sqrt(max(float(std[0]) ** 2 - 1.0, 0.0)) * unit
        return float(value[0]) * unit, math.hypot(left, self._further_delay), left <= unit

    def put_back(self, name: str, delay: float) -> None:
        """Take off what a delay [s] of a sensor made, whose readings come without it from now on."""
        column = self._delay_column(name)
        size = delay / float(self._unit.ravel()[column])
        self._square += size * (size * float(self._information[column, column]) - 2.0 * float(self._score[column]))
        self._score -= size * self._information[:, column]
        self._found = None

    def _delay_column(self, name: str) -> int:
        return _COLUMNS * self._names.index(name) + KINDS["delay"].start

    @property
    def _ready(self) -> bool:
        return self.possible and self._count >= self._least * len(self._whitening)

    def _inflation(self) -> Array:
        """Return the factor on the noise by which errors of prediction are larger than those of white noise, per kind."""
        return np.asarray(np.maximum(self._scatter[0] / np.maximum(self._scatter[1], 1e-300), 1.0))

    def _judge(self) -> Fault | None:
        if not self._ready:
            return None
        noise = self._noise()
        inflation = self._inflation()
        table = np.zeros((len(self._names), len(KINDS)))
        amounts: dict[tuple[int, int], tuple[Array, Array]] = {}
        solved = functools.cache(self._solved)  # without scatter beyond white noise all kinds ask for the same
        for n, part in enumerate(KINDS.values()):
            both = solved(noise * float(inflation[n]))
            for s in range(len(self._names)):
                table[s, n], amounts[s, n] = self._score_test(*both, _COLUMNS * s + np.arange(part.start, part.stop))
        if table.min() > np.log(FALSE_ALARM / table.size):
            return None
        information, score = solved(noise * float(inflation.max()))
        alone = np.array([self._explained(information, score, [s]) for s in range(len(self._names))])
        best = int(np.argmax(alone))
        rivals = tuple(m for s, m in enumerate(self._names) if s != best and alone[s] > alone[best] - 2.0 * math.log(_RIVAL))
        kind = int(np.argmin(table[best]))
        name, part = list(KINDS.items())[kind]
        value, std = (amount * self._unit[best, part] for amount in amounts[best, kind])
        return Fault(
            self._names[best], name, _words(name, value, std), self._share(best, noise), rivals, float(table.min()),
            tuple(value.tolist()), tuple(std.tolist()),
        )  # fmt: skip

    def _explained(self, information: Array, score: Array, sensors: Sequence[int], noise: float = 1.0) -> float:
        """Return how much errors of some sensors, as large as they happen, lessen the squared deviations."""
        columns = np.concatenate([_COLUMNS * s + np.arange(_COLUMNS) for s in sensors])
        weight = noise * self._weight[list(sensors)].ravel()
        u = score[columns]
        return float(u @ np.linalg.solve(information[np.ix_(columns, columns)] + np.diag(weight), u))

    def _share(self, sensor: int, noise: float) -> float:
        """Return which share of what constant errors of all sensors explain of the deviations one sensor explains alone."""
        everyone = self._explained(self._information, self._score, range(len(self._names)), noise)
        return min(self._explained(self._information, self._score, [sensor], noise) / max(everyone, 1e-30), 1.0)

    def _solved(self, noise: float) -> tuple[Array, Array]:
        """Return K (symmetric) and u for one noise variance."""
        shifted = self._information + noise * np.eye(self._size)
        both: Array = np.asarray(np.linalg.solve(shifted, np.column_stack([self._information, self._score])), dtype=np.float64)
        return 0.5 * (both[:, :-1] + both[:, :-1].T), both[:, -1]

    @staticmethod
    def _score_test(information: Array, score: Array, columns: NDArray[np.int64]) -> tuple[float, tuple[Array, Array]]:
        """Return the log probability of a score within tolerance, and error and standard deviation it speaks for."""
        k, u = information[np.ix_(columns, columns)], score[columns]
        values, vectors = np.linalg.eigh(k)
        seen = values > max(_RANK, 1e-4 * float(values[-1]))
        if not seen.any():
            return 0.0, (np.zeros(len(u)), np.zeros(len(u)))
        along = (vectors[:, seen].T @ u) / np.sqrt(values[seen])
        inverse = vectors[:, seen] / np.sqrt(values[seen])
        probability = _log_tail(float(along @ along), int(seen.sum()))
        return probability, (inverse @ along, np.asarray(np.linalg.norm(inverse, axis=1), dtype=np.float64))

    def save(self) -> dict[str, Any]:
        """Return the sums as plain lists; averages not yet added are dropped."""
        return fields_of(self, (*_SAVED, "_unit"))

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        self._progress[:] = 0
        # sums are in units of the tolerances, which a delay that was found changes
        unit = (self._unit / np.array(saved["unit"], dtype=float).reshape(self._unit.shape)).ravel()
        take_fields(self, _SAVED, saved)
        self._information, self._score = np.outer(unit, unit) * self._information, unit * self._score
        self._found = None


def _skew(vectors: Array) -> Array:
    """Return S with ``S u = v x u`` for vectors (..., 3)."""
    result = np.zeros((*vectors.shape, 3))
    result[..., 0, 1], result[..., 0, 2], result[..., 1, 2] = -vectors[..., 2], vectors[..., 1], -vectors[..., 0]
    result[..., 1, 0], result[..., 2, 0], result[..., 2, 1] = vectors[..., 2], -vectors[..., 1], vectors[..., 0]
    return result


def _symmetric(products: Array) -> Array:
    """Return ``omega omega^T - |omega|^2 I`` from the products xx, yy, zz, xy, xz, yz, shape (K, 6) -> (K, 3, 3)."""
    xx, yy, zz, xy, xz, yz = products.T
    rows = [[-yy - zz, xy, xz], [xy, -xx - zz, yz], [xz, yz, -xx - yy]]
    return np.array(rows).transpose(2, 0, 1)


def _log_tail(value: float, freedom: int) -> float:
    """Return the log probability that chi-squared exceeds a value, where the probability itself is too small for a float."""
    tail = float(special.chdtrc(freedom, value))
    if tail > 1e-250:
        return math.log(tail)
    # leading term of the incomplete gamma function (DLMF 8.11.2)
    return (0.5 * freedom - 1.0) * math.log(0.5 * value) - 0.5 * value - math.lgamma(0.5 * freedom)


def _words(kind: str, value: Array, std: Array) -> str:
    """Return the size of an error in words."""
    if kind == "gain":
        axis = int(np.argmax(np.abs(value) / np.maximum(std, 1e-12)))
        return f"gain of {'xyz'[axis]} {100.0 * value[axis]:+.1f} +- {100.0 * std[axis]:.1f} %"
    if kind == "delay":
        return f"{1e3 * value[0]:+.1f} +- {1e3 * std[0]:.1f} ms late"
    size = float(np.linalg.norm(value))
    spread = float(np.sqrt(np.sum((value * std) ** 2))) / max(size, 1e-12)
    if kind == "position":
        return f"{1e3 * size:.0f} +- {1e3 * spread:.0f} mm off its position"
    return f"misaligned by {np.degrees(size):.1f} +- {np.degrees(spread):.1f} deg"
