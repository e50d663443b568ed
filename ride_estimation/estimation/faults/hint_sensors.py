# Copyright 2026 ride_estimation contributors
"""Which sensor of a rigid body is late, wrongly scaled, turned or displaced: residual regressed on its own signal.

The residual of the rigid-body least squares is ``r = M y`` with ``M = I - H W``. An error ``d`` of sensor s alone leaves
``r = M_s d``, M_s the columns of the sensor. To first order ``d`` is linear in ten numbers: delay (times minus the rate of the
reading), gain per axis, rotation about each axis, displacement along each axis (times the angular acceleration). Normal equations
are formed per chunk of two seconds; the scatter of the chunks about the common solution gives standard deviations that hold for
residuals of any spectrum (sandwich estimate), tested with Student's t.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ride_estimation.estimation.faults.hint_types import MEMORY, Hint, level
from ride_estimation.frames import AXES
from ride_estimation.sensors.layout import measured_channels
from ride_estimation.sensors.sensor import Sensor

Array = NDArray[np.float64]

#: cause, columns, unit, kind of error of an installation
_GROUPS = (
    ("sensor_delay", slice(0, 1), "s", "delay"),
    ("sensor_gain", slice(1, 4), "-", "gain"),
    ("sensor_misalignment", slice(4, 7), "rad", "misalignment"),
    ("wrong_sensor_position", slice(7, 10), "m", "position"),
)
_COUNT = 10
#: standard deviations of an installation within which nothing is said
_STDS = 3.0
#: columns are held to zero with this many tolerances where the motion does not tell them
_WIDE = 30.0
#: share of the leading explanation from which on another sensor could be meant as well
_RIVAL = 0.8
#: chunks before the first look; least energy of the motion over the noise
_LEAST_CHUNKS, _LEAST_SIGNAL = 16, 10.0


class SensorHints:
    """Detector for the accelerometers of one body.

    Parameters
    ----------
    sensors
        Accelerometers of the body.
    rows
        Rows ``[e, r x e]`` of their channels, shape (3 S, 6).
    weights
        Least squares that takes the channels to the motion, shape (6, 3 S).
    """

    def __init__(self, sensors: Sequence[Sensor], rows: Array, weights: Array) -> None:
        self._sensors = tuple(sensors)
        #: what every sensor may have of every error and nothing is said, shape (S, 10)
        self._tolerance = np.array([_tolerance(s) for s in self._sensors]).reshape(-1, _COUNT)
        count = 3 * len(self._sensors)
        measured = measured_channels(self._sensors)
        matrix = np.diag(measured.astype(float)) - rows[:count] @ weights[:, :count]
        inverse = 1.0 / np.repeat([s.noise_std for s in self._sensors], 3) ** 2
        parts = [matrix[:, 3 * i : 3 * i + 3] for i in range(len(self._sensors))]
        self._project = [inverse[:, None] * p for p in parts]
        self._gram = [p.T @ (inverse[:, None] * p) for p in parts]
        self._spare = float(np.trace(matrix)) > 0.5
        self._chunks: deque[tuple[Array, Array]] = deque(maxlen=1)
        self._cutoff = 0.0

    def reset(self) -> None:
        """Forget everything."""
        self._chunks.clear()

    def observe(self, measured: Array, residual: Array, angular: Array, dt: float) -> None:
        """Take one chunk of ticks.

        Parameters
        ----------
        measured, residual
            Channels and residual of the rigid body, shape (K, 3 S) [m/s^2].
        angular
            Angular acceleration of the body, shape (K, 3) [rad/s^2].
        dt
            Tick [s].
        """
        if not self._spare:
            return
        keep = max(round(MEMORY / (len(measured) * dt)), _LEAST_CHUNKS)
        if self._chunks.maxlen != keep:
            self._chunks = deque(self._chunks, maxlen=keep)
        moving = measured - measured.mean(axis=0)
        rate = np.gradient(moving, dt, axis=0)
        residual = residual - residual.mean(axis=0)
        normal, right = np.empty((len(self._sensors), _COUNT, _COUNT)), np.empty((len(self._sensors), _COUNT))
        for i, sensor in enumerate(self._sensors):
            part = slice(3 * i, 3 * i + 3)
            if np.mean(moving[:, part][:, sensor.measured[:3]] ** 2) < (_LEAST_SIGNAL * sensor.noise_std) ** 2:
                return  # a standing vehicle tells nothing, and its noise would pose as gain
            columns = _columns(moving[:, part], rate[:, part], angular @ sensor.rotation)
            flat = columns.reshape(_COUNT, -1)
            normal[i] = flat @ (columns @ self._gram[i]).reshape(_COUNT, -1).T
            right[i] = flat @ (residual @ self._project[i]).ravel()
            # the noise of a reading is in its own residual and would pose as gain
            right[i, 1:4] -= len(measured) * np.diag(self._gram[i]) * sensor.noise_std**2
        self._chunks.append((normal, right))

    def hints(self) -> tuple[Hint, ...]:
        """Return the suspicion about the sensor that explains the residual best, if it is significant."""
        count = len(self._chunks)
        if count < _LEAST_CHUNKS:
            return ()
        normal = np.stack([n for n, _ in self._chunks])
        right = np.stack([r for _, r in self._chunks])
        total, sums = normal.sum(axis=0), right.sum(axis=0)
        prior = 1.0 / (_WIDE * self._tolerance) ** 2
        inverse = np.linalg.inv(total + prior[:, :, None] * np.eye(_COUNT))
        found = np.einsum("sij,sj->si", inverse, sums)
        explained = np.einsum("si,si->s", found, sums)
        best = int(np.argmax(explained))
        score = right[:, best] - normal[:, best] @ found[best]
        spread = score.T @ score * count / (count - _COUNT)
        std = np.sqrt(np.maximum(np.diag(inverse[best] @ spread @ inverse[best]), 0.0))
        tests = _COUNT * len(self._sensors)
        cutoff = float(stats.t.isf(level(tests) / 2.0, count - _COUNT))
        alone = [_alone(total[best], sums[best], prior[best], g[1]) for g in _GROUPS]
        cause, part, unit, _ = _GROUPS[int(np.argmax(alone))]
        excess = np.abs(found[best][part]) - self._tolerance[best, part] - cutoff * std[part]
        if not np.any(excess > 0.0):
            return ()
        axis = int(np.argmax(excess))
        strength, error = float(found[best][part][axis]), float(std[part][axis])
        rivals = [s.name for i, s in enumerate(self._sensors) if i != best and explained[i] > _RIVAL * explained[best]]
        return (self._hint(cause, best, axis, strength, error, unit, rivals),)

    def _hint(
        self, cause: str, sensor: int, axis: int, strength: float, std: float, unit: str, rivals: Sequence[str]
    ) -> Hint:
        name = self._sensors[sensor].name
        names = {"sensor_delay": "", "sensor_misalignment": ("roll", "pitch", "yaw")[axis]}
        where = names.get(cause, AXES[axis])
        number = f"{strength:.3g} +- {std:.1g}{'' if unit == '-' else ' ' + unit}"
        others = f"; {', '.join(rivals)} could be meant as well" if rivals else ""
        words = f"{name}{' ' + where if where else ''} looks like {cause.replace('_', ' ')} ({number}){others}"
        return Hint(cause, name, where, strength, std, unit, words)


def _columns(moving: Array, rate: Array, angular: Array) -> Array:
    """Return what one unit of each of the ten errors adds to the readings of a sensor, shape (10, K, 3).

    Parameters
    ----------
    moving, rate, angular
        Reading without its mean [m/s^2], its rate [m/s^3], angular acceleration [rad/s^2] in sensor axes, shape (K, 3).
    """
    out = np.zeros((_COUNT, *moving.shape))
    out[0] = -rate
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        out[1 + k, :, k] = moving[:, k]
        # turned by e_k: reading - e_k x reading; displaced by e_k: angular x e_k
        out[4 + k, :, a], out[4 + k, :, b] = moving[:, b], -moving[:, a]
        out[7 + k, :, a], out[7 + k, :, b] = angular[:, b], -angular[:, a]
    return out


def _tolerance(sensor: Sensor) -> Array:
    stated = [_STDS * getattr(sensor.tolerated_installation, kind) for *_, kind in _GROUPS]
    return np.repeat(stated, [part.stop - part.start for _, part, *_ in _GROUPS])


def _alone(normal: Array, right: Array, prior: Array, part: slice) -> float:
    """Return the sum of squares that some columns explain without the others."""
    return float(right[part] @ np.linalg.solve(normal[part, part] + np.diag(prior[part]), right[part]))
