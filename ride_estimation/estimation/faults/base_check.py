# Copyright 2026 ride_estimation contributors
"""Faults of base sensors that come while driving: horizontal motion of the bases against the usual one of a nearly rigid frame.

In the plane a rigid frame has three accelerations, so N bases leave 2 N - 3 redundant equations: longitudinal motion is linear
in y, lateral in x. How far a frame bends and its brackets tilt is its own affair; what counts is the residual, relative to the
motion, now over that of the run so far. The vertical readings are left out: a frame twists, and four bases then have no
redundancy. A faulty sensor still answers to the motion, late, turned or too strongly, so its residual follows from the motion
of the others now and a little earlier; a bump that bends the frame at one mount does not. A sensor whose error explains the
rise is treated as missing; where none does, parameters are not updated meanwhile.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from ride_estimation.estimation.faults.base_kernel import follow_bases
from ride_estimation.estimation.faults.left_out import DISAGREES
from ride_estimation.estimation.faults.sensor_gate import GateVerdict
from ride_estimation.estimation.sensor_errors.isolation import Redundancy, isolated
from ride_estimation.sensors.installation import pooled
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.alignment import Block

Array = NDArray[np.float64]
#: corner of the high-pass [Hz]: below, tilting brackets turn gravity into horizontal readings
_CORNER_HZ = 2.0
#: memory of the residual now [s]
_NOW = 0.5
#: memory of the residual of the run [s]
_RUN = 30.0
#: time before anything is judged [s]
_LEAST = 5.0
#: root mean square relative residual now over that of the run at which inconsistency begins
_BEGINS = 2.2
#: the same at which it ends
_ENDS = 1.5
#: share of the motion that frames bend anyway
_SHARE = 0.05
#: least relative residual that matters
_MATTERS = 2.0
#: motion that the test needs [m/s^2]
_MOVING = 0.1
#: largest residual of one block that the run takes in, as a multiple of its own
_OUTLIER = 4.0
#: share of the residual one sensor must explain
_EXPLAINED = 0.7
#: singular values of what the other sensors leave to one of them that count as zero, as a share of the largest
_RANK = 1e-3
#: share of the rise of the residual that must follow from the motion, of the sensor that is suspected or else of all together
_FOLLOWS = 0.7
#: how much earlier that may be [s]: between and a little beyond, two samples of a motion of a few hertz determine the others
_EARLIER = 0.02
#: longest inconsistency without an isolated sensor: what stays as it is belongs to this vehicle and its road [s]
_LONGEST = 60.0


class BaseCheck:
    """Judge the accelerometers at the mount bases, block by block.

    Parameters
    ----------
    sensors
        At the bases.
    streams, columns
        Stream and first column of each in an aligned block.
    """

    def __init__(self, sensors: Sequence[Sensor], streams: Sequence[int], columns: Sequence[int]) -> None:
        self._sensors = tuple(sensors)
        self._streams = np.array(streams, dtype=np.int64)
        self._columns = np.array([[c, c + 1, c + 2] for c in columns], dtype=np.int64).ravel()
        count = len(self._sensors)
        place = np.array([s.position for s in sensors]).reshape(-1, 3)
        place = place - place.mean(axis=0) if count else place
        rigid = np.zeros((2 * count, 3))
        rigid[0::2, 0], rigid[1::2, 1] = 1.0, 1.0
        rigid[0::2, 2], rigid[1::2, 2] = -place[:, 1], place[:, 0]
        self._project = np.eye(2 * count) - rigid @ np.linalg.pinv(rigid, rcond=1e-6)
        self._redundancy = Redundancy.of(self._project, 2, _RANK)
        # slopes of the vertical readings along x and y, and what such a rotation does at other heights
        plane = np.linalg.pinv(np.column_stack([np.ones(count), place[:, :2]]), rcond=1e-3) if count else np.zeros((3, 0))
        lift = np.zeros((count, 2 * count))
        lift[:, 0::2], lift[:, 1::2] = -np.outer(plane[1], place[:, 2]), -np.outer(plane[2], place[:, 2])
        #: from all readings to horizontal ones in body axes at one height, shape (3 N, 2 N)
        self._to_plane = np.zeros((3 * count, 2 * count))
        for i, s in enumerate(sensors):
            self._to_plane[3 * i : 3 * i + 3, 2 * i : 2 * i + 2] = s.rotation[:2].T
            self._to_plane[3 * i : 3 * i + 3] -= np.outer(s.rotation[2], lift[i])
        noise = float(np.mean([s.noise_std**2 for s in sensors])) if count else 0.0
        misread = pooled([s.tolerated_installation for s in sensors]).cross_sensitivity
        #: noise variance, square of the share by which readings of frames and of good sensors differ anyway, redundant equations
        self._numbers = np.array([noise, _SHARE**2 + misread**2, np.trace(self._project)])
        self.possible = count >= 3 and all(s.triaxial and s.coupling == sensors[0].coupling for s in sensors)
        self.ticks: dict[int, int] = {}
        self.reset()

    def reset(self) -> None:
        """Begin a new time base; counts stay."""
        self._filter: tuple[float, Array, Array] | None = None
        self._state = np.zeros((0, 0))
        self._size, self._moments = 0.0, np.zeros_like(self._project)
        #: products of rigid motion now and earlier and of the residual, (6 N, 6 N), and the last rigid motion
        self._joint, self._before = np.zeros((3 * len(self._project), 3 * len(self._project))), np.zeros((0, 0))
        self._run, self._age, self._inconsistent_s = 0.0, 0.0, 0.0
        self.refused: int | None = None
        self.unusual = False

    @property
    def inconsistent(self) -> bool:
        """Return whether the sensors disagree and none can be isolated."""
        return self.unusual and self.refused is None

    def judged(self, block: Block, verdict: GateVerdict, dt: float) -> GateVerdict:
        """Return the verdict on a block with what the bases add to it.

        Parameters
        ----------
        block
            Aligned samples.
        verdict
            Of the gate.
        dt
            Tick [s].
        """
        if not self.possible:
            return verdict
        if not verdict.valid[:, self._streams].all():
            self._state, self._before = np.zeros((0, 0)), np.zeros((0, 0))  # the filter begins anew
            if self.refused is None:
                return verdict
        else:
            before = self.unusual
            self._follow(block, dt)
            if self.unusual and not before:
                stream = () if self.refused is None else (int(self._streams[self.refused]),)
                verdict = dataclasses.replace(verdict, began=True, newly_refused=(*verdict.newly_refused, *stream))
        if not self.unusual:
            return verdict
        if self.refused is None:
            return dataclasses.replace(verdict, unusual=True)
        self.ticks[self.refused] = self.ticks.get(self.refused, 0) + len(verdict.valid)
        return verdict.without(int(self._streams[self.refused]))

    def _follow(self, block: Block, dt: float) -> None:
        duration = len(block.values) * dt
        b, a = self._ready(block, dt)
        self._size, ratio = follow_bases(
            block.values, self._columns, self._to_plane, self._project, b, a, self._state, self._before, self._numbers,
            1.0 - math.exp(-duration / _NOW), self._size, self._moments, self._joint,
        )  # fmt: skip
        if self._size < _MOVING**2:
            return
        self._age += duration
        limit = _OUTLIER * self._run if self._age > _LEAST else math.inf
        if not self.unusual:
            self._run += duration / min(self._age, _RUN) * (min(ratio, limit) - self._run)
        if self._age < _LEAST:
            return
        over = math.sqrt(ratio / max(self._run, 1e-12))
        self._inconsistent_s = self._inconsistent_s + duration if self.unusual else 0.0
        was = self.unusual
        self.unusual = bool(over > (_ENDS if was else _BEGINS) and ratio > _MATTERS**2 * (_ENDS / _BEGINS if was else 1.0))
        # what was there before follows from nothing
        needed = _FOLLOWS * (1.0 - 1.0 / max(over, 1.0) ** 2)
        self.unusual = self.unusual and (was or self._following()[1] > needed)
        if self._inconsistent_s > _LONGEST and self.refused is None:
            self._run, self.unusual = ratio, False
        if not self.unusual:
            self.refused = None
        elif not was or self.refused is None:
            self.refused = self._isolated(needed)

    def _ready(self, block: Block, dt: float) -> tuple[Array, Array]:
        """Return the filter, at rest before the first block."""
        if self._filter is None or self._filter[0] != dt:
            b, a = signal.butter(2, min(2.0 * _CORNER_HZ * dt, 0.9), "highpass")
            self._filter = (dt, b, a)
            self._state = np.zeros((0, 0))
        _, b, a = self._filter
        if not self._state.size:
            self._state = signal.lfilter_zi(b, a)[:, None] * (block.values[0, self._columns] @ self._to_plane)
            self._before = np.zeros((max(1, round(_EARLIER / dt)), len(self._project)))
        return b, a

    def _isolated(self, follows: float) -> int | None:
        """Return the sensor whose error explains the residual and follows so much from the motion, None where several could."""
        sensor = isolated(self._redundancy.explained(self._moments), _EXPLAINED)
        return sensor if sensor is not None and self._following()[0][sensor] > follows else None

    def _following(self) -> tuple[Array, float]:
        """Return which share of the residual follows from the rigid motion, of every sensor (N,) and of all together."""
        n = len(self._sensors)
        explained = np.zeros(n)
        for i in range(n):
            own = np.array([2 * i, 2 * i + 1])
            cause, effect = np.concatenate([own, 2 * n + own]), 4 * n + own
            normal, mixed = self._joint[np.ix_(cause, cause)], self._joint[np.ix_(cause, effect)]
            scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-30))
            inverse = np.linalg.pinv(normal * np.outer(scale, scale), rcond=1e-9, hermitian=True)
            explained[i] = float(np.sum(mixed * (inverse @ (mixed * scale[:, None]) * scale[:, None])))
        size = np.diag(self._joint)[4 * n :].reshape(n, 2).sum(axis=1)
        return explained / np.maximum(size, 1e-30), float(explained.sum() / max(float(size.sum()), 1e-30))

    def messages(self) -> list[str]:
        """Return one sentence per sensor that was left out, and one where it is open which is wrong."""
        found = []
        for n, ticks in sorted(self.ticks.items()):
            now = " (now)" if n == self.refused else ""
            found.append(f"{self._sensors[n].name} was not used{now}: {ticks} ticks {DISAGREES}")
        if self.inconsistent:
            found.append("the sensors at the mount bases disagree clearly more than before: parameters are not updated meanwhile")
        return found
