# Copyright 2026 ride_estimation contributors
"""Lasting faults of base sensors, also from the very start: wrong gain, sign, axes, misalignment, delay.

The readings at the bases belong to one frame: six rigid accelerations and, with four bases or more, its twist ``W x y``. What is
left is judged by the score test of :mod:`sensor_faults` between 2 Hz, above which tilting brackets no longer turn gravity into
horizontal readings, and 10 Hz, below which a frame is hardly anything but rigid and twisted. As frames do bend with their motion,
only what is far beyond that counts as an error of a sensor (:data:`_FRAME`); such a sensor is treated as missing. A place that
is off is not determined at all: brackets of a frame that twists and bends move sideways as if they stood a metre away.

Axes that are exchanged or inverted are tested directly. With ``P = I - H H^+`` the redundant equations of such a frame and C
the moments of the readings the squared misfit is ``tr(P C)``; with other axes of one sensor, a signed permutation S that fits
gravity, it is ``tr(P S C S^T)``. Where that is several times smaller, and no axes of another sensor do it, S is found.

A smaller gain or tilt shows twice. A reading that is (I + E) times the true one shows ``E g`` at rest and E in motion; a
bias shows the first only, a bending frame the second only. Where both are there and agree, nothing learned is called valid;
where the mean alone differs from those of the other bases that is said.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from ride_estimation.estimation.common.block_math import biquad_block
from ride_estimation.estimation.common.geometry import LEAST_SPREAD, channel_geometry
from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.estimation.faults.base_kernel import follow_means
from ride_estimation.estimation.faults.left_out import BaseSensorTest
from ride_estimation.estimation.faults.sensor_gate import GateVerdict
from ride_estimation.estimation.sensor_errors.sensor_faults import Fault, FaultTest
from ride_estimation.sensors.layout import motion_rows
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.alignment import Block

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: pass band [Hz]
_BAND = (2.0, 10.0)
#: limits by which the motion at a base may differ from that of a rigid and twisted frame beyond the installation of its sensor,
#: as a bias [m/s^2], gain, angle [rad], place [m] and delay [s]: a bending of a tenth of the motion, with a loss factor
#: of a tenth a quarter of a millisecond at 6 Hz
_FRAME = (0.3, 0.1, 0.1, 0.1, 0.001)
#: data taken at once [s]
_CHUNK = 1.0
#: least motion [m/s^2]
_MOVING = 0.1
#: share of the deviations that an error of one sensor must explain
_EXPLAINED = 0.4
#: the share that it must explain where another sensor could be meant: what is left then is as small as a bending frame leaves it
_ONE_OF_FEW = 0.85
#: logarithm of the probability within tolerance below which an error is as large as the motion: a quarter of a turn
_GROSS = -300.0
#: fewer bases do not distinguish a frame that twists, and so moves its brackets horizontally, from an error that is not gross
_TWISTING = 4
#: averages before anything is judged
_LEAST = 90
#: chunks before errors that are not gross are judged: their scatter has to be known
_SETTLED = 5
#: chunks that are judged one by one
_FIRST = 20
#: time between two judgements later, as a share of all
_LATER = 0.1
#: axes other than those of the vehicle file: signed permutations, shape (47, 3, 3)
_AXES = np.array(
    [
        np.diag(signs) @ np.eye(3)[list(order)]
        for order, signs in itertools.product(itertools.permutations(range(3)), itertools.product((1.0, -1.0), repeat=3))
    ]
)[1:]
#: factor by which other axes must lessen the squared misfit and be better than those of every other sensor: half of the amplitude
_BETTER = 4.0
#: memory of the moments [s]
_MEMORY = 10.0
#: chunks that the moments need
_LEAST_CHUNKS = 2
#: mean that may stay with other axes, as the gate lets it pass [m/s^2]
_UPRIGHT = 1.5
#: share of what a verdict needed that keeps it
_KEEPS = 0.5
#: least mean off gravity that is reported, as a share of it
_MEAN_OFF = 0.03
#: the same in standard deviations of the installation
_STDS = 3.0
#: agreement of mean and motion, as a share of them
_AGREE = 0.35
#: least time of means [s]
_MEAN_LEAST = 5.0
#: memory of means [s]
_MEAN_MEMORY = 60.0


class BaseFaults(BaseSensorTest):
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
        super().__init__(sensors, "rotation, gain, delay and fixing")
        self._sensors = tuple(sensors)
        self._streams = np.array(streams, dtype=np.int64)
        self._columns = np.array([[c, c + 1, c + 2] for c in columns], dtype=np.int64).ravel()
        self._gravity = gravity
        place = np.array([s.position for s in sensors]).reshape(-1, 3)
        place = place - place.mean(axis=0) if len(place) else place
        spread = np.linalg.svd(place[:, :2], compute_uv=False) if len(place) >= 3 else np.zeros(2)
        self.possible = len(place) >= 3 and bool(spread[1] > LEAST_SPREAD) and all(s.triaxial for s in sensors)
        self._rotation = np.array([s.rotation for s in sensors]).reshape(-1, 3, 3)
        self._dc = np.array([s.coupling == "dc" for s in sensors], dtype=bool)
        self._least_mean = [max(_MEAN_OFF, _STDS * s.tolerated_installation.offset(gravity) / gravity) for s in sensors]
        #: what is said about sensors that are used
        self.suspects: dict[str, str] = {}
        if not self.possible:
            return
        middle = np.mean([s.position for s in sensors], axis=0)
        rows, points = motion_rows(self._sensors, middle), channel_geometry(self._sensors, middle)[1]
        twist = np.concatenate([s.rotation[2] * x * y for s, (x, y, _) in zip(self._sensors, place)])
        if len(place) >= 4 and np.linalg.matrix_rank(np.column_stack([rows, twist]), tol=1e-3) == 7:
            rows = np.column_stack([rows, twist])
        self._inverse = np.linalg.pinv(rows, rcond=1e-6)
        self._project = np.eye(len(rows)) - rows @ self._inverse
        self._moments, self._seen = np.zeros_like(self._project), 0
        self.test = FaultTest(self._sensors, rows, points[::3], 0.0, np.array(_FRAME) / np.sqrt(3.0), _LEAST)
        self.test.set_variance(np.repeat([s.noise_std**2 for s in self._sensors], 3))
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
        self.test.interrupt()

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
        return self.without_refused(verdict, self._streams, math.inf)

    def learn(self, dt: float) -> None:
        """Test what :meth:`judged` gathered once it is a chunk; takes milliseconds, so after the forces of a block are out."""
        if self.possible and self._ticks * dt >= _CHUNK:
            self._take(np.concatenate(self._waiting), dt)
            self._waiting, self._ticks = [], 0

    def _follow_means(self, values: Array, force: Array, duration: float) -> None:
        """Follow what every base reads more than the body, sensor axes [m/s^2]."""
        gain = duration / min(self._mean_time + duration, _MEAN_MEMORY)
        follow_means(values, force, self._rotation, gain, self._mean)
        self._mean_time += duration

    def _take(self, values: Array, dt: float) -> None:
        """Take a chunk of readings (K, 3 N)."""
        moving = self._passed(values, dt)
        if np.mean(moving**2) < _MOVING**2:
            self.test.interrupt()
            return
        self._moments = math.exp(-len(moving) * dt / _MEMORY) * self._moments + moving.T @ moving
        self._seen += 1
        motion = moving @ self._inverse.T
        self.test.observe(moving, np.ascontiguousarray(motion[:, :6]), np.zeros((len(moving), 3)), dt)
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
        before, suspects = self.refused, self.suspects
        self.refused, self.suspects = {}, {}
        mixed = self._mixed_axes(before)
        if mixed is not None:
            self.refused[mixed[0]] = mixed[1]
            return
        fault = self.test.judge()
        few = len(self._sensors) < _TWISTING
        if fault is not None and (fault.kind == "position" or (few and fault.log_probability > _GROSS)):
            fault = None  # a position that is off reads what a bracket on a bending frame does
        if self._chunks < _SETTLED and (fault is None or fault.log_probability > _GROSS):
            return
        if fault is not None and not fault.rivals:
            place = next(i for i, s in enumerate(self._sensors) if s.name == fault.sensor)
            if fault.explained > _EXPLAINED * (_KEEPS if place in before else 1.0):
                # errors as large as the motion are seen for certain, but their size is not: they bend the motion of the frame
                gross = fault.log_probability < _GROSS and fault.kind != "delay"
                self.refused[place] = "by its sign, axes, gain or delay" if gross else f"by its {fault.kind} ({fault.amount})"
                return
        # what every sensor would explain is how the frame bends: brackets of a twisting frame move sideways too
        if fault is not None and len(fault.rivals) < len(self._sensors) - 1 and fault.explained > _ONE_OF_FEW:
            self.suspects[fault.sensor] = _ambiguous(fault)
            return
        for i, sensor in enumerate(self._sensors):
            words = self._agreeing(i, _AGREE / (_KEEPS if sensor.name in suspects else 1.0))
            if words:
                self.suspects[sensor.name] = words

    def _mixed_axes(self, before: dict[int, str]) -> tuple[int, str] | None:
        """Return a sensor whose readings fit those of the others with other axes, and words; None where there is none.

        Parameters
        ----------
        before
            Sensors that are left out.
        """
        if self._seen < _LEAST_CHUNKS:
            return None
        count = len(self._sensors)
        misfit = float(np.sum(self._project * self._moments))
        least, chosen = np.full(count, np.inf), np.zeros(count, dtype=np.int64)
        for i in range(count):
            own = slice(3 * i, 3 * i + 3)
            # tr(P S C S^T) without what S leaves as it is
            rest = self._moments[own] @ self._project[:, own] - self._moments[own, own] @ self._project[own, own]
            cross = 2.0 * np.einsum("kij,ji->k", _AXES - np.eye(3), rest)
            turned = np.einsum("kij,jl,kml->kim", _AXES, self._moments[own, own], _AXES) - self._moments[own, own]
            after = misfit + cross + np.einsum("kim,im->k", turned, self._project[own, own])
            upward = self._gravity * self._rotation[i][2]
            off = np.linalg.norm(_AXES @ (self._mean[i] + upward) - upward, axis=1)
            after = np.where((off < _UPRIGHT) | (not self._dc[i]), after, np.inf)
            least[i], chosen[i] = after.min(), int(np.argmin(after))
        best = int(np.argmin(least))
        better = _BETTER * (_KEEPS if best in before else 1.0)
        if better * least[best] > misfit or better * least[best] > np.delete(least, best).min():
            return None
        names = ["".join(("-" if v < 0.0 else "") + "xyz"[k] for k, v in enumerate(row) if v) for row in _AXES[chosen[best]]]
        return best, f"by its axes (x, y, z are its {', '.join(names)})"

    def _agreeing(self, i: int, limit: float) -> str:
        """Return words on a gain or tilt of a sensor that both its mean and its motion show within a limit, empty without."""
        if not self._dc[i] or self._mean_time < _MEAN_LEAST:
            return ""
        upward = self._rotation[i][2]
        off = self._mean[i] / self._gravity
        along = float(off @ upward)
        across = off - along * upward
        size = float(np.linalg.norm(across))
        least = self._least_mean[i]
        if max(size, abs(along)) <= least:
            return ""
        gain, angle = self.test.errors(i)
        if size > least and float(np.linalg.norm(np.cross(upward, angle) - across)) < limit * size:
            return f"its mean and its motion both look misaligned by {math.degrees(size):.1f} deg"
        level = np.argsort(np.abs(upward))[:2]
        if abs(along) > least and bool(np.all(np.abs(gain[level] - along) < limit * abs(along))):
            return f"its mean and its motion are both {100.0 * along:+.0f} % too large"
        return ""

    def _mean_alone(self, i: int) -> str:
        """Return words on the mean of a sensor that differs from those of the other bases, empty without.

        The body may lean against its frame; what is common to the bases is no sign of an error.
        """
        level = [n for n in range(len(self._sensors)) if self._dc[n] and n not in self.refused]
        if i not in level or len(level) < 3 or self._mean_time < _MEAN_LEAST:
            return ""
        read = np.einsum("sij,sj->si", self._rotation, self._mean) / self._gravity
        # of three the one that is off moves the middle of the other two, but not of all
        off = read[i] - np.median(read[level], axis=0)
        tilt = float(np.linalg.norm(off[:2]))
        if tilt > max(self._least_mean[i], abs(off[2])):
            return f"its mean looks misaligned by {math.degrees(tilt):.1f} deg, or is a bias of {tilt * self._gravity:.2f} m/s^2"
        if abs(off[2]) > self._least_mean[i]:
            bias = off[2] * self._gravity
            return f"its mean is {100.0 * off[2]:+.0f} % of gravity off, by its gain or a bias of {bias:+.2f} m/s^2"
        return ""

    @property
    def finds_delays(self) -> bool:
        """Return whether the test finds delays that are not gross."""
        return self.possible and len(self._sensors) >= _TWISTING

    @property
    def suspicion(self) -> str:
        """Return why nothing learned is called valid, empty where nothing speaks against it."""
        return "; ".join(f"{name}: {words}" for name, words in self.suspects.items())

    def messages(self) -> list[str]:
        """Return one sentence per sensor that is left out or suspect."""
        found = super().messages()
        found += [f"{name} at the mount base may be wrong: {words}" for name, words in self.suspects.items()]
        if self.possible:
            unsaid = [i for i, s in enumerate(self._sensors) if i not in self.refused and s.name not in self.suspects]
            alone = [(self._sensors[i].name, self._mean_alone(i)) for i in unsaid]
            found += [f"{name} at the mount base: {words}; its motion does not show which" for name, words in alone if words]
        return found

    def save(self) -> dict[str, Any]:
        """Return verdicts and what they rest on as plain lists."""
        if not self.possible:
            return {}
        return {
            "test": self.test.save(), **fields_of(self, ("_mean", "_mean_time", "_chunks")),
            "refused": {str(i): words for i, words in self.refused.items()}, "suspects": dict(self.suspects),
        }  # fmt: skip

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        if not self.possible or not saved:
            return
        self.reset()
        self.test.load(saved["test"])
        take_fields(self, ("_mean", "_mean_time", "_chunks"), saved)
        self.refused = {int(i): str(words) for i, words in saved["refused"].items()}
        self.suspects = {str(name): str(words) for name, words in saved["suspects"].items()}
        self._reported = frozenset(self.refused)


def _ambiguous(fault: Fault) -> str:
    others = ", ".join(fault.rivals) if fault.rivals else "several sensors at once"
    return f"{fault.kind} ({fault.amount}), or {others}"
