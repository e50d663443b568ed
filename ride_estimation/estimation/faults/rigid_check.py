# Copyright 2026 ride_estimation contributors
"""Gross faults of body sensors from the redundant equations of the rigid body, block by block.

With unit weights the residual is ``P y``, ``P = I - H H^+``. A fault of sensor s explains ``(P y)_s^T (P_ss)^+ (P y)_s`` of
``|P y|^2``; it can be distinguished from other faults when redundant equations are left without that sensor.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.faults.gate_kernel import residual_ratio
from ride_estimation.estimation.sensor_errors.isolation import Redundancy, ambiguity_group, isolated
from ride_estimation.sensors.installation import pooled
from ride_estimation.sensors.layout import residual_projection
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: what the means of good sensors may differ by, in standard deviations of their bias and of gravity at their misalignment
_OFFSET = 2.5
#: what their motion may differ by, in standard deviations of gain and angle, to which position, filters and an elastic body add
_SHARE = 10.0
#: residual in units of that tolerance from which on a sensor is refused as a lasting fault
_LASTING = 5.0
#: the same at a single tick
_SINGLE = 10.0
#: the same below which it is accepted again
_AGAIN = 3.0
#: share of the residual one sensor must explain
_EXPLAINED = 0.8
#: singular values of what the other sensors leave to one of them that count as zero, as a share of the largest
_RANK = 1e-4


@dataclasses.dataclass(frozen=True)
class Found:
    """Sensors refused for the whole block, at single ticks, those of which one is wrong, factor on the noise, and the
    mean squared residual in units of the tolerance.
    """

    lasting: tuple[int, ...] = ()
    single: dict[int, BoolArray] = dataclasses.field(default_factory=dict)
    suspects: tuple[int, ...] = ()
    excess: float = 1.0
    ratio: float = 0.0


@dataclasses.dataclass(frozen=True)
class _Projection:
    channels: NDArray[np.int64]
    sensors: tuple[int, ...]
    redundancy: Redundancy


class RigidCheck:
    """Test of the accelerometers of one body.

    Parameters
    ----------
    rows
        Rows ``[e, r x e]`` of the accelerometer channels, zero where nothing is measured, shape (3 S, 6).
    directions, points
        Of the channels, shape (3 S, 3).
    sensors
        Of the body, S of them.
    gravity
        [m/s^2].
    """

    def __init__(self, rows: Array, directions: Array, points: Array, sensors: Sequence[Sensor], gravity: float) -> None:
        self._rows = rows
        self._directions, self._points = np.ascontiguousarray(directions), np.ascontiguousarray(points)
        self._along = np.sum(directions * points, axis=1)
        usual = pooled([s.tolerated_installation for s in sensors])
        #: squared tolerance of a body at rest [(m/s^2)^2], and what a squared motion adds as a share of it
        self._still = float(np.mean([s.noise_std**2 for s in sensors] or [0.0])) + (_OFFSET * usual.offset(gravity)) ** 2
        self._moving = (_SHARE * usual.cross_sensitivity) ** 2
        self._cache: dict[bytes, _Projection] = {}

    def centripetal(self, rate: Array) -> Array:
        """Return what the channels read of ``omega x (omega x r)``, shape (3 S,)."""
        e, r = self._directions, self._points
        return np.asarray((e @ rate) * (r @ rate) - float(rate @ rate) * self._along)

    def _projection(self, fit: BoolArray) -> _Projection:
        key = fit.tobytes()
        found = self._cache.get(key)
        if found is None:
            sensors = tuple(int(s) for s in np.flatnonzero(fit))
            channels = np.flatnonzero(np.repeat(fit, 3))
            redundancy = Redundancy.of(residual_projection(self._rows[channels]), 3, _RANK)
            found = _Projection(channels, sensors, redundancy)
            self._cache[key] = found
        return found

    def _residual(self, samples: Array, rate: Array, p: _Projection) -> Array:
        return np.asarray((samples[:, p.channels] - self.centripetal(rate)[p.channels]) @ p.redundancy.matrix)

    def _tolerance(self, size: float) -> float:
        return self._still + self._moving * size**2

    def dispensable(self, fit: BoolArray, sensor: int) -> bool:
        """Return whether the other sensors determine the motion as completely without this one.

        Parameters
        ----------
        fit
            Sensors that take part, shape (S,).
        sensor
            One of them.
        """
        rest = fit.copy()
        rest[sensor] = False
        whole = np.linalg.matrix_rank(self._rows, tol=1e-6)
        return bool(rest.any() and np.linalg.matrix_rank(self._rows[np.repeat(rest, 3)], tol=1e-6) == whole)

    def judge(
        self, samples: Array, rate: Array, fit: BoolArray, size: float, suspected: Callable[[], Collection[int]] = tuple
    ) -> Found:
        """Test for gross faults.

        Parameters
        ----------
        samples
            Accelerometer channels, those of the body first, shape (K, 3 S or more).
        rate
            Angular rate of the body, shape (3,) [rad/s].
        fit
            Sensors that take part, shape (S,).
        size
            Root mean square of the motion [m/s^2].
        suspected
            Returns the sensors refused a moment ago: where several could be wrong, it is one of these.
        """
        p = self._projection(fit)
        redundant = p.redundancy.count
        if redundant <= 0:
            return Found()
        ratio = np.empty(len(samples))
        scale = 1.0 / (redundant * self._tolerance(size))
        mean = float(
            residual_ratio(samples, p.channels, rate, self._directions, self._points, p.redundancy.matrix, scale, ratio)
        )
        if mean <= _LASTING**2 and ratio.max() <= _SINGLE**2:
            return Found(ratio=mean)
        bad = ratio > _SINGLE**2
        residual = self._residual(samples, rate, p)
        if int(bad.sum()) > len(ratio) // 2 or (mean > _LASTING**2 and not bad.any()):
            bad = np.ones(len(ratio), dtype=bool)
        explained = p.redundancy.explained(residual[bad].T @ residual[bad])
        excess = float(np.sqrt(max(mean, 1.0)))
        alone = isolated(explained, _EXPLAINED)
        if alone is None or redundant == p.redundancy.ranks[alone]:
            recent = suspected()
            likely = [s for s, e in zip(p.sensors, explained) if s in recent and e > _EXPLAINED]
            if len(likely) != 1 or not self.dispensable(fit, likely[0]):
                return self._several(samples, rate, fit, size, p, explained, excess)
            sensor = likely[0]
        else:
            sensor = p.sensors[alone]
        if not self.dispensable(fit, sensor):
            return Found(suspects=p.sensors, excess=excess)
        if bad.all():
            return Found(lasting=(sensor,))
        return Found(single={sensor: bad})

    def _several(
        self, samples: Array, rate: Array, fit: BoolArray, size: float, p: _Projection, explained: Array, excess: float
    ) -> Found:
        """Try two faults at once; else name all that could be meant."""
        place = int(np.argmax(explained))
        best, rest = p.sensors[place], fit.copy()
        rest[best] = False
        if explained[place] < _EXPLAINED and p.redundancy.count > p.redundancy.ranks[place]:
            second = self.judge(samples, rate, rest, size)
            if second.lasting and self.dispensable(rest, second.lasting[0]):
                return Found(lasting=(best, *second.lasting))
        suspects = tuple(p.sensors[n] for n in ambiguity_group(explained))
        return Found(suspects=suspects if len(suspects) > 1 else p.sensors, excess=excess)

    def agrees(self, samples: Array, rate: Array, fit: BoolArray, sensor: int, size: float) -> bool:
        """Return whether a refused sensor agrees with the others again: ``r_s^T P_ss^+ r_s`` of a tick is within tolerance.

        Parameters
        ----------
        samples, rate, fit, size
            As of :meth:`judge`.
        sensor
            The refused one.
        """
        with_it = fit.copy()
        with_it[sensor] = True
        p = self._projection(with_it)
        place, redundancy = p.sensors.index(sensor), p.redundancy
        if redundancy.count <= 0 or redundancy.ranks[place] == 0:
            return True
        part = self._residual(samples, rate, p)[:, 3 * place : 3 * place + 3]
        explained = float(np.einsum("ki,ij,kj->", part, redundancy.inverse[place], part)) / len(part)
        return explained <= _AGAIN**2 * self._tolerance(size) * int(redundancy.ranks[place])
