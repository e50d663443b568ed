# Copyright 2026 ride_estimation contributors
"""Lasting faults of base sensors, also from the very start: wrong gain, sign, axes, mounting angle, delay.

The readings at the bases belong to one frame: six rigid accelerations and, with four bases or more, its twist ``W x y``. What is
left is judged by the score test of :mod:`sensor_faults` between 2 Hz, above which tilting brackets no longer turn gravity into
horizontal readings, and 10 Hz, below which a frame is hardly anything but rigid and twisted. As frames do bend with their motion,
only what is far beyond that counts as an error of a sensor (:data:`_FRAME`); such a sensor is treated as missing. A place that
is off is not told at all: brackets of a frame that twists and bends move sideways as if they stood a metre away.

A smaller gain or tilt has two witnesses. A reading that is (I + E) times the true one shows ``E g`` at rest and E in motion; a
bias shows the first only, a bending frame the second only. Where both are there and agree, nothing learned is called valid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from ride_estimation.estimation.arrangement import LEAST_SPREAD, channel_geometry
from ride_estimation.estimation.block_math import biquad_block
from ride_estimation.estimation.sensor_faults import Fault, FaultTest
from ride_estimation.estimation.sensor_gate import GateVerdict
from ride_estimation.sensors.layout import motion_rows
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.alignment import Block

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: pass band [Hz]
_BAND = (2.0, 10.0)
#: how far the motion at a base may differ from that of a rigid and twisted frame, as a bias [m/s^2], gain, angle [rad], place [m]
#: and delay [s]: a bending of a tenth of the motion, with a loss factor of a tenth a quarter of a millisecond at 6 Hz
_FRAME = (0.3, 0.1, 0.1, 0.1, 0.001)
#: data taken at once [s], least motion [m/s^2], and share of the deviations that an error of one sensor must explain
_CHUNK, _MOVING, _EXPLAINED = 1.0, 0.1, 0.4
#: the share that it must explain where another sensor could be meant: what is left then is as small as a bending frame leaves it
_ONE_OF_FEW = 0.85
#: logarithm of the probability within tolerance below which an error is as large as the motion: a quarter of a turn
_GROSS = -300.0
#: fewer bases do not tell a frame that twists, and moves its brackets sideways by that, from an error that is not gross
_TWISTING = 4
#: averages before anything is judged, chunks before errors that are not gross are: their scatter has to be known
_LEAST, _SETTLED = 90, 5
#: chunks that are judged one by one, and time between two judgements later, as a share of all
_FIRST, _LATER = 20, 0.1
#: bias that sensors in good order have, as a share of gravity, and the agreement of the two witnesses, as a share of them
_BIAS, _AGREE = 0.03, 0.35
#: least time of means [s], their memory [s]
_MEAN_LEAST, _MEAN_MEMORY = 5.0, 60.0


class BaseFaults:
    """Judge the accelerometers at the mount bases over the whole run.

    Parameters
    ----------
    sensors
        At the bases.
    streams, columns
        Stream and first column of each in an aligned block.
    gravity
        [m/s^2].
    """

    def __init__(self, sensors: Sequence[Sensor], streams: Sequence[int], columns: Sequence[int], gravity: float) -> None:
        self._sensors = tuple(sensors)
        self._streams = np.array(streams, dtype=np.int64)
        self._columns = np.array([[c, c + 1, c + 2] for c in columns], dtype=np.int64).ravel()
        self._gravity = gravity
        place = np.array([s.position for s in sensors]).reshape(-1, 3)
        place = place - place.mean(axis=0) if len(place) else place
        spread = np.linalg.svd(place[:, :2], compute_uv=False) if len(place) >= 3 else np.zeros(2)
        self.possible = len(place) >= 3 and bool(spread[1] > LEAST_SPREAD)
        self._rotation = np.array([s.rotation for s in sensors]).reshape(-1, 3, 3)
        self._dc = np.array([s.coupling == "dc" for s in sensors], dtype=bool)
        #: sensors that are left out, and what is said about them; what is said about sensors that are used
        self.refused: dict[int, str] = {}
        self.doubted: dict[str, str] = {}
        if not self.possible:
            return
        middle = np.mean([s.position for s in sensors], axis=0)
        rows, points = motion_rows(self._sensors, middle), channel_geometry(self._sensors, middle)[1]
        twist = np.concatenate([s.rotation[2] * x * y for s, (x, y, _) in zip(self._sensors, place)])
        if len(place) >= 4 and np.linalg.matrix_rank(np.column_stack([rows, twist]), tol=1e-3) == 7:
            rows = np.column_stack([rows, twist])
        self._inverse = np.linalg.pinv(rows, rcond=1e-6)
        self._test = FaultTest(self._sensors, rows, points[::3], 0.0, _FRAME, _LEAST)
        self._test.set_variance(np.repeat([s.noise_std**2 for s in self._sensors], 3))
        self._chunks, self._next = 0, 0
        self._mean_time, self._mean = 0.0, np.zeros((len(place), 3))
        self.reset()

    def reset(self) -> None:
        """Begin a new time base; verdicts and what they rest on stay."""
        if not self.possible:
            return
        self._step = 0.0
        self._filters: list[tuple[Array, Array]] = []
        self._states: list[Array] = []
        self._waiting: list[Array] = []
        self._ticks = 0
        self._test.interrupt()

    def judged(self, block: Block, verdict: GateVerdict, force: Array, dt: float) -> GateVerdict:
        """Return the verdict on a block with what the bases add to it.

        Parameters
        ----------
        block
            Aligned samples.
        verdict
            Of the gate.
        force
            Latest specific force at the CG of the body, shape (3,).
        dt
            Tick [s].
        """
        if not self.possible:
            return verdict
        if verdict.valid[:, self._streams].all():
            values = np.take(block.values, self._columns, axis=1)
            self._follow_means(values, force, len(values) * dt)
            self._waiting.append(values)
            self._ticks += len(values)
        elif self._step:
            self.reset()
        if not self.refused:
            return verdict
        return verdict.without(self._streams[list(self.refused)])

    def learn(self, dt: float) -> None:
        """Look at what :meth:`judged` gathered once it is a chunk; takes milliseconds, so after the forces of a block are out."""
        if self.possible and self._ticks * dt >= _CHUNK:
            self._take(np.concatenate(self._waiting), dt)
            self._waiting, self._ticks = [], 0

    def _follow_means(self, values: Array, force: Array, duration: float) -> None:
        """Follow what every base reads more than the body, sensor axes [m/s^2]."""
        mean = values.mean(axis=0).reshape(-1, 3)
        gain = duration / min(self._mean_time + duration, _MEAN_MEMORY)
        self._mean += gain * (mean - np.einsum("sij,i->sj", self._rotation, force) - self._mean)
        self._mean_time += duration

    def _take(self, values: Array, dt: float) -> None:
        """Take a chunk of readings (K, 3 N)."""
        moving = self._passed(values, dt)
        if np.mean(moving**2) < _MOVING**2:
            self._test.interrupt()
            return
        motion = moving @ self._inverse.T
        self._test.observe(moving, np.ascontiguousarray(motion[:, :6]), np.zeros((len(moving), 3)), dt)
        self._chunks += 1
        if self._chunks >= self._next:
            self._next = self._chunks + (1 if self._chunks < _FIRST else int(_LATER * self._chunks))
            self._judge()

    def _passed(self, values: Array, dt: float) -> Array:
        if self._step != dt:
            self._step = dt
            edges = [min(2.0 * f * dt, 0.9) for f in _BAND]
            self._filters = [signal.butter(2, edges[0], "highpass"), signal.butter(2, edges[1])]
            self._states = [signal.lfilter_zi(*self._filters[0])[:, None] * values[0], np.zeros((2, values.shape[1]))]
        for (b, a), state in zip(self._filters, self._states):
            out = np.empty_like(values)
            biquad_block(values, b, a, state, out)
            values = out
        return values

    # -- result -----------------------------------------------------------------------------------------------------------

    def _judge(self) -> None:
        self.refused, self.doubted = {}, {}
        fault = self._test.judge()
        if fault is not None and (fault.kind == "place" or (len(self._sensors) < _TWISTING and fault.log_probability > _GROSS)):
            fault = None  # a place that is off reads what a bracket on a bending frame does
        if self._chunks < _SETTLED and (fault is None or fault.log_probability > _GROSS):
            return
        if fault is not None and not fault.rivals and fault.explained > _EXPLAINED:
            place = next(i for i, s in enumerate(self._sensors) if s.name == fault.sensor)
            # errors as large as the motion are seen for certain, but their size is not: they bend the frame's motion themselves
            gross = fault.log_probability < _GROSS and fault.kind != "delay"
            self.refused[place] = "by its sign, axes, gain or delay" if gross else f"by its {fault.kind} ({fault.amount})"
            return
        # what every sensor would explain is how the frame bends: brackets of a twisting frame move sideways too
        if fault is not None and len(fault.rivals) < len(self._sensors) - 1 and fault.explained > _ONE_OF_FEW:
            self.doubted[fault.sensor] = _ambiguous(fault)
            return
        for i, sensor in enumerate(self._sensors):
            words = self._agreeing(i)
            if words:
                self.doubted[sensor.name] = words

    def _agreeing(self, i: int) -> str:
        """Return words on a gain or tilt of a sensor that both its mean and its motion show, empty without."""
        if not self._dc[i] or self._mean_time < _MEAN_LEAST:
            return ""
        upward = self._rotation[i][2]
        off = self._mean[i] / self._gravity
        along = float(off @ upward)
        across = off - along * upward
        size = float(np.linalg.norm(across))
        if max(size, abs(along)) <= _BIAS:
            return ""
        gain, angle = self._test.errors(i)
        if size > _BIAS and float(np.linalg.norm(np.cross(upward, angle) - across)) < _AGREE * size:
            return f"its mean and its motion both look turned by {math.degrees(size):.1f} deg"
        level = np.argsort(np.abs(upward))[:2]
        if abs(along) > _BIAS and bool(np.all(np.abs(gain[level] - along) < _AGREE * abs(along))):
            return f"its mean and its motion are both {100.0 * along:+.0f} % too large"
        return ""

    @property
    def doubt(self) -> str:
        """Return why nothing learned is called valid, empty where nothing speaks against it."""
        return "; ".join(f"{name}: {words}" for name, words in self.doubted.items())

    def messages(self) -> list[str]:
        """Return one sentence per sensor that is left out or in doubt."""
        found = [
            f"{self._sensors[i].name} is not used: it disagrees with the other sensors at the mount bases {words}: check its "
            "rotation, gain, delay and fixing"
            for i, words in sorted(self.refused.items())
        ]
        return [*found, *(f"{name} at the mount base may be wrong: {words}" for name, words in self.doubted.items())]

    def save(self) -> dict[str, Any]:
        """Return verdicts and what they rest on as plain lists."""
        if not self.possible:
            return {}
        return {
            "test": self._test.save(), "mean": self._mean.tolist(), "mean_time": self._mean_time, "chunks": self._chunks,
            "refused": {str(i): words for i, words in self.refused.items()}, "doubted": dict(self.doubted),
        }  # fmt: skip

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        if not self.possible or not saved:
            return
        self.reset()
        self._test.load(saved["test"])
        self._mean = np.array(saved["mean"], dtype=float).reshape(self._mean.shape)
        self._mean_time, self._chunks = float(saved["mean_time"]), int(saved["chunks"])
        self.refused = {int(i): str(words) for i, words in saved["refused"].items()}
        self.doubted = {str(name): str(words) for name, words in saved["doubted"].items()}


def _ambiguous(fault: Fault) -> str:
    others = ", ".join(fault.rivals) if fault.rivals else "several sensors at once"
    return f"{fault.kind} ({fault.amount}), or {others}"
