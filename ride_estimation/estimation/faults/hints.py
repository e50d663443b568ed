# Copyright 2026 ride_estimation contributors
"""Hints of the online estimator at what its model gets wrong: the cheap part of the diagnosis, while driving.

Two residuals are looked at. What the accelerometers of the body show beyond one rigid body tells a late, wrongly scaled, turned
or displaced sensor (:mod:`hint_sensors`); what the body's motion asks for beyond the forces of the mounts tells a machine that
shakes the body at one frequency, and how much the mount model misses (:mod:`hint_spectra`). A hint names a suspicion and its
size; ``ride-estimation diagnose`` on the recorded run judges it. Not seen: errors that all sensors of the body share, and those
of base accelerometers, of which nothing else knows.

False alarms: every test is made at a level that gives :data:`FALSE_ALARMS_PER_HOUR` in all, counted over the independent looks
of an hour; installation tolerances come off the estimate before it is tested, so that on good installations there are fewer.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.faults.hint_sensors import SensorHints
from ride_estimation.estimation.faults.hint_spectra import SpectrumHints
from ride_estimation.estimation.faults.hint_types import FALSE_ALARMS_PER_HOUR, Hint
from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator
from ride_estimation.sensors.sensor import Sensor

__all__ = ["FALSE_ALARMS_PER_HOUR", "Hint", "HintBlock", "Hints"]

Array = NDArray[np.float64]

#: what is collected before the detectors look [s]
_CHUNK = 2.0


@dataclasses.dataclass(frozen=True)
class HintBlock:
    """What the detectors see of K ticks, S sensors on the body.

    Attributes
    ----------
    measured, predicted
        Accelerometer channels and what the rigid motion predicts for them, shape (K, 3 S) [m/s^2].
    angular
        Angular acceleration of the body, shape (K, 3) [rad/s^2].
    support, missing
        What the mounts together carry, and the part of it their model does not explain, shape (K, 6) [N, N m].
    usable
        Whether every sensor contributed and none is suspect.
    """

    measured: Array
    predicted: Array
    angular: Array
    support: Array
    missing: Array
    usable: bool


class Hints:
    """All detectors of one body.

    Parameters
    ----------
    sensors
        Accelerometers of the body.
    rows
        Rows ``[e, r x e]`` of their channels, shape (3 S, 6).
    weights
        Least squares that takes the channels to the motion, shape (6, 3 S).
    free
        Which of the six coordinates the body has, shape (6,).
    body
        Its name.
    forces
        Whether the motion of the mounts is measured, so that their forces can be tested.
    """

    def __init__(
        self, sensors: Sequence[Sensor], rows: Array, weights: Array, free: NDArray[np.bool_], body: str, forces: bool
    ) -> None:
        self._sensors = SensorHints(sensors, rows, weights)
        self._spectra = SpectrumHints(body, np.asarray(free, dtype=bool)) if forces else None
        self._blocks: list[HintBlock] = []
        self._ticks = 0
        #: looks at a chunk that are still to be taken
        self._looks: list[Callable[[], None]] = []

    @classmethod
    def of(cls, geometry: Geometry, motion: CgMotionEstimator) -> Hints:
        """Return the hints on the sensors and mounts of a body."""
        a = geometry
        weights = motion.weights(np.ones(len(a.body_sensors), dtype=bool), 0.01).matrix
        return cls(a.body_sensors, motion.rows, weights, a.free, a.body.name, a.has_base_motion)

    def reset(self) -> None:
        """Forget everything."""
        self._drop()
        self._looks = []
        self._sensors.reset()
        if self._spectra is not None:
            self._spectra.reset()

    def _drop(self) -> None:
        self._blocks, self._ticks = [], 0

    def observe(self, block: HintBlock, dt: float) -> None:
        """Take one block; the detectors look once two seconds without a gap are there, one with each block that follows.

        Parameters
        ----------
        dt
            Tick [s].
        """
        if self._looks:
            self._looks.pop(0)()
        if not block.usable:
            self._look()
            self._drop()
            if self._spectra is not None:
                self._spectra.interrupt()
            return
        self._blocks.append(block)
        self._ticks += len(block.measured)
        if self._ticks * dt < _CHUNK:
            return
        joined = [np.concatenate([getattr(b, name) for b in self._blocks]) for name in _FIELDS]
        self._drop()
        measured, predicted, angular, support, missing = joined
        self._looks.append(functools.partial(self._sensors.observe, measured, measured - predicted, angular, dt))
        if self._spectra is not None:
            self._looks.append(functools.partial(self._spectra.observe, support, missing, dt))

    def _look(self) -> None:
        """Take all looks that are still to be taken."""
        for look in self._looks:
            look()
        self._looks = []

    def hints(self) -> tuple[Hint, ...]:
        """Return what is suspected now, strongest evidence first."""
        self._look()
        found = self._sensors.hints()
        if self._spectra is not None:
            found += self._spectra.hints()
        return found


_FIELDS = ("measured", "predicted", "angular", "support", "missing")
