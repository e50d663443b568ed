# Copyright 2026 ride_estimation contributors
"""Which sensors are fit to be used at which tick: flat line, full scale, jumps, disagreement with the body or the other sensors.

Uses aligned blocks only and keeps a short memory, so the verdict is a pure function of the samples. A sensor that is not fit
is treated as one that is missing: its ticks are marked not valid and the weights of the others adapt. The limits are physical
tolerances (bias, gain, mounting), not significance: small lasting errors are a matter for the residual test.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.estimation.faults.gate_kernel import (
    LARGEST,
    Scan,
    find_jumps,
    median_root,
    remember,
    scan_block,
    slow_means,
)  # fmt: skip
from ride_estimation.estimation.faults.rigid_check import RigidCheck
from ride_estimation.estimation.faults.stuck_sensors import FLAT, REASONS, StuckSensors
from ride_estimation.sensors.layout import measured_channels
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.alignment import Block

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

CLIPPED = "at full scale"
JUMP = "jumps that no other sensor sees"
BODY = "disagrees with the rigid body"
MEAN = "its mean disagrees with that of the body"

#: shortest exact repetition of a transducer that counts as stuck: they repeat by their resolution [s]
_FLAT_TRANSDUCER = 0.5
#: motion of the accelerometers, in units of their noise, that makes it impossible
_MOVING_TRANSDUCER = 20.0
#: a jump: this many times its own usual step plus this many times the largest step of the others plus noise
_JUMP = np.array([8.0, 4.0, 20.0])
#: time in which the largest step of a sensor is forgotten [s]
_STEP_FADES = 0.05
#: shortest hold after a jump [s]
_HOLD = 0.02
#: longest hold after a jump [s]
_LONGEST_HOLD = 0.5
#: ticks beside a bad sample that interpolation reaches
_REACH = 2
#: memory of mean, size and step [s]; nothing is called a jump before it is filled
_MEMORY = 1.0
#: time constant of each of two stages of the slow mean of a sensor minus the body's [s]
_SLOW = 0.3
#: limit of that mean beyond which a sensor is refused [m/s^2]
_MEAN_LIMIT = 1.5
#: share of the limit below which it is accepted again
_MEAN_RELEASE = 0.67
#: part of the motion that limit grows by: both stages pass 22 % of a body mode of 1 Hz, twice that of the difference of two ends
#: of the body, and peaks of a random motion are two to three times its root mean square
_MOTION_LEFT = 1.0
#: sideways mean by which all bases together may differ from the body, leaning in a bend by up to fifteen degrees [m/s^2]
_LEAN = 2.5
#: time without objection after which a refused sensor is used again [s]
_RECOVERY = 0.5
#: time after which a sensor that was refused is no longer the first suspect [s]
_SUSPECT = 3.0
#: residual of the rigid body now over that of the run at which inconsistency begins
_UNUSUAL = 2.2
#: the same at which it ends
_USUAL = 1.5
#: memory of the residual now [s]
_NOW = 0.7
#: memory of the residual of the run [s]
_RUN = 30.0
#: motion that the comparison needs [m/s^2]
_EXCITED = 0.3
#: smallest residual that matters, in units of the tolerance
_MATTERS = 0.35
#: largest share of one block in that comparison, as a multiple of the residual of the run
_SINGLE_BLOCK = 12.0
#: attributes that are part of a saved state
_SAVED = ("_well", "_mean", "_square", "_step_square", "_slow", "_age", "inconsistent_ticks", "unusual")


@dataclasses.dataclass(frozen=True)
class GateVerdict:
    """Verdict on one block.

    Attributes
    ----------
    valid
        Which streams may be used at which tick, shape (K, S).
    began
        Whether a fault was found just now that lasts: what was learned in the last second is contaminated.
    newly_refused
        Streams refused for such a fault just now.
    suspects
        Sensors one of which is wrong and cannot be distinguished; empty where they agree.
    unusual
        Whether the sensors of the body disagree clearly more than before: nothing is to be learned.
    excess
        Factor on the standard deviation of the body's motion, 1 where the sensors agree.
    spoiled
        Time for which what was learned is spoiled where a fault began, beyond the second or two it always is [s].
    """

    valid: BoolArray
    began: bool
    newly_refused: tuple[int, ...]
    suspects: tuple[str, ...]
    unusual: bool
    excess: float
    spoiled: float = 0.0

    def with_refused(self, refused: Sequence[int], new: Sequence[int], spoiled: float) -> GateVerdict:
        """Return the verdict without streams that are refused.

        Parameters
        ----------
        refused
            Streams.
        new
            Those of them that are refused from this block on.
        spoiled
            How long before they may have spoiled what was learned [s].
        """
        verdict = self
        if new:
            newly = (*self.newly_refused, *new)
            verdict = dataclasses.replace(self, began=True, newly_refused=newly, spoiled=max(self.spoiled, spoiled))
        return verdict.without(np.array(refused)) if refused else verdict

    def without(self, streams: int | NDArray[np.int64]) -> GateVerdict:
        """Return the verdict with some streams left out of the whole block."""
        valid = self.valid.copy()
        valid[:, streams] = False
        return dataclasses.replace(self, valid=valid)


class SensorGate:
    """Judge every sensor, block by block.

    Parameters
    ----------
    sensors
        One per stream.
    columns
        First column of each stream in an aligned block.
    body
        Streams on the body, in the order of ``check``.
    base
        Streams on the bases of the mounts.
    transducers
        Displacement streams.
    check
        Rigid-body test of the body sensors.
    gravity
        [m/s^2].
    """

    def __init__(
        self,
        sensors: Sequence[Sensor],
        columns: Sequence[int],
        body: Sequence[int],
        base: Sequence[int],
        transducers: Sequence[int],
        check: RigidCheck,
        gravity: float,
    ) -> None:
        self._sensors = tuple(sensors)
        self._check = check
        self._accels = np.array([*body, *base], dtype=np.int64)
        self._bodies = len(body)
        self._columns = np.array([[columns[i], columns[i] + 1, columns[i] + 2] for i in self._accels])
        self._rotation = np.array([sensors[i].rotation for i in self._accels])
        self._dc = np.array([sensors[i].coupling == "dc" for i in self._accels])
        self._noise = np.array([sensors[i].noise_std for i in self._accels])
        self._limit = 0.999 * np.array([sensors[i].reach for i in self._accels])
        measured = measured_channels(sensors[i] for i in self._accels).reshape(-1, 3)
        #: whose mean is a vector that compares with those of the others
        self._vectors = self._dc & measured.all(axis=1)
        self._stuck = StuckSensors(self._rotation, self._noise, self._dc, self._bodies, gravity, measured)
        self._all = np.ones(len(self._accels), dtype=bool)
        self._transducers = tuple(transducers)
        self._transducer_columns = np.array([columns[i] for i in transducers], dtype=np.int64)
        #: stream -> reason -> ticks it was refused for it
        self.refused: dict[int, Counter[str]] = {}
        #: stream -> reason it is refused for now
        self.active: dict[int, str] = {}
        self.inconsistent_ticks = 0
        self.reset()

    def reset(self) -> None:
        """Begin a new time base; counters stay."""
        count = len(self._accels)
        self._last, self._started = np.zeros((count, 3)), False
        self._stuck.reset()
        self._mean = np.zeros((count, 3))
        self._square = np.zeros(count)
        self._step_square = np.zeros(count)
        self._age = 0.0
        self._others = np.zeros(count)
        self._hold, self._holding = np.zeros(count), False
        self._held = np.zeros(count)
        self._before = np.zeros((count, 3))
        self._jump = np.zeros(count)
        self._clear = np.full(count, np.inf)
        self._slow = np.zeros((2, count, 3))
        self._latched: dict[int, str] = {}
        self._well = np.zeros(count)
        self._displaced: Array | None = None
        self._displaced_run = np.zeros(len(self._transducers))
        self.active = {}
        self.suspects: tuple[str, ...] = ()
        self.unusual = False
        self._ratio_now, self._ratio_run, self._ratio_age = 0.0, 0.0, 0.0

    def judge(self, block: Block, rate: Array, dt: float) -> GateVerdict:
        """Return which sensors may be used in a block.

        Parameters
        ----------
        block
            Aligned samples.
        rate
            Latest angular rate of the body, shape (3,) [rad/s].
        dt
            Tick [s].
        """
        valid = block.valid[:, self._accels]
        values = np.take(block.values, self._columns, axis=1)
        if not self._started and self._age == 0.0:
            self._mean = values[0].copy()
        duration = len(values) * dt
        scan = self._scan(values, valid)
        refused = np.zeros(valid.shape, dtype=bool)
        reasons: dict[int, str] = {}
        before, usual = set(self._latched), not self.unusual
        self._clipping(values, scan, refused, reasons)
        self._flat(values, scan, refused, reasons, duration, dt)
        self._jumps(values, scan, refused, reasons, duration, dt)
        # the normal case: every sample there and none refused
        whole = bool(valid.all()) and not reasons
        good = self._all if whole else np.asarray(valid.all(axis=0) & ~refused.any(axis=0))
        excess = self._body(values, valid, good, refused, reasons, rate, duration)
        if reasons:
            good = np.asarray(valid.all(axis=0) & ~refused.any(axis=0))
        self._means(valid, scan, good, refused, reasons, duration)
        if reasons:
            good = np.asarray(valid.all(axis=0) & ~refused.any(axis=0))
        gain = min(duration / min(_MEMORY, self._age + duration), 1.0)
        remember(scan.figures, scan.mean, good, gain, self._mean, self._square, self._step_square)
        self._age += duration
        self._last, self._started = values[-1].copy(), True
        result = block.valid
        if reasons:
            result = block.valid.copy()
            result[:, self._accels] &= ~refused
        result = self._stuck_transducers(block, result, reasons, dt)
        self._count(block.valid, result, reasons)
        new = tuple(int(self._accels[a]) for a in sorted(set(self._latched) - before))
        began = bool(new) or (usual and self.unusual)
        self._clear += duration
        if reasons:
            self._clear[refused.any(axis=0)] = 0.0
        if self.suspects or self.unusual:
            self.inconsistent_ticks += len(values)
        return GateVerdict(result, began, new, self.suspects, self.unusual, excess)

    def _scan(self, values: Array, valid: BoolArray) -> Scan:
        ticks, count = valid.shape
        runs, sizes = np.empty((ticks, count), dtype=np.int64), np.empty((ticks, count))
        figures, mean = np.empty((4, count)), np.empty((count, 3))
        stuck = self._stuck
        longest, longest_axis, full = scan_block(
            values, valid, self._last, self._started, self._mean, self._limit, stuck.run, stuck.axis_run, stuck.held, runs,
            sizes, figures, mean,
        )  # fmt: skip
        return Scan(runs, sizes, figures, mean, longest, longest_axis, full)

    # -- single sensors ---------------------------------------------------------------------------------------------------

    def _clipping(self, values: Array, scan: Scan, refused: BoolArray, reasons: dict[int, str]) -> None:
        if not scan.full:
            return
        clipped = np.any(np.abs(values) >= self._limit[None, :, None], axis=2)
        refused |= clipped
        for a in np.flatnonzero(clipped.any(axis=0)):
            reasons[int(a)] = CLIPPED

    def _flat(
        self, values: Array, scan: Scan, refused: BoolArray, reasons: dict[int, str], duration: float, dt: float
    ) -> None:
        known = {a for a, reason in self._latched.items() if reason in REASONS}
        found = self._stuck.judge(values, scan, self._square, known, self._age == 0.0, dt)
        for a, reason in found.items():
            self._latched.setdefault(a, reason)
        for a in sorted(known | {a for a in found if self._latched[a] == found[a]}):
            self._still_refused(a, duration, a not in found, refused, reasons)

    def _jumps(
        self, values: Array, scan: Scan, refused: BoolArray, reasons: dict[int, str], duration: float, dt: float
    ) -> None:
        limits, largest = np.empty(len(self._accels)), scan.figures[LARGEST]
        found = find_jumps(
            scan.figures, self._others, self._step_square, self._noise, _JUMP, math.exp(-duration / _STEP_FADES), limits
        )
        if found and self._age >= _MEMORY and len(limits) > 1:
            for a in np.flatnonzero(largest > limits):
                at = np.flatnonzero(scan.sizes[:, a] > limits[a])
                if self._hold[a] <= 0.0:
                    self._before[a], self._jump[a], self._held[a] = self._mean[a], 0.0, 0.0
                self._jump[a] = max(self._jump[a], float(largest[a]))
                refused[max(int(at[0]) - _REACH, 0) :, a] = True
                self._hold[a] = max(_HOLD, _REACH * dt)
                self._others[a] = 0.0
                self._holding = True
                reasons[int(a)] = JUMP
        if not self._holding:
            return
        for a in np.flatnonzero(self._hold > 0.0):
            refused[:, a] |= reasons.get(int(a)) != JUMP
            reasons[int(a)] = JUMP
            self._hold[a] -= duration
            self._held[a] += duration
            away = float(np.abs(values[-1, a] - self._before[a]).max()) > 0.5 * self._jump[a]
            if self._hold[a] <= 0.0 and away and self._held[a] < _LONGEST_HOLD:
                self._hold[a] = duration
        self._holding = bool((self._hold > 0.0).any())

    def _still_refused(self, a: int, duration: float, well: bool, refused: BoolArray, reasons: dict[int, str]) -> None:
        """Keep a latched sensor out until it was well for long enough."""
        self._well[a] = self._well[a] + duration if well else 0.0
        if self._well[a] > _RECOVERY:
            del self._latched[a]
            self._well[a] = 0.0
            return
        refused[:, a] = True
        reasons.setdefault(a, self._latched[a])

    # -- against the others -----------------------------------------------------------------------------------------------

    def _body(
        self, values: Array, valid: BoolArray, good: BoolArray, refused: BoolArray, reasons: dict[int, str], rate: Array,
        duration: float,
    ) -> float:  # fmt: skip
        """Judge the sensors of the body against one rigid body; return the factor on the motion's standard deviation."""
        n = self._bodies
        size = float(median_root(self._square, n))
        fit = good[:n].copy()
        samples = values.reshape(len(values), -1)
        for a in [k for k, reason in self._latched.items() if reason == BODY]:
            well = bool(valid[:, a].all()) and self._check.agrees(samples, rate, fit, a, size)
            self._still_refused(a, duration, well, refused, reasons)
            fit[a] = False
        found = self._check.judge(samples, rate, fit, size, lambda: np.flatnonzero(self._clear[:n] < _SUSPECT).tolist())
        self.suspects = tuple(self._sensors[self._accels[a]].name for a in found.suspects)
        if found.ratio and size > _EXCITED:
            self._compare(found.ratio, duration)
        for a in found.lasting:
            self._latched[a] = BODY
            self._well[a] = 0.0
            refused[:, a] = True
            reasons[a] = BODY
        for a, ticks in found.single.items():
            wide = np.convolve(ticks, np.ones(2 * _REACH + 1), mode="same") > 0
            refused[:, a] |= wide[: len(values)]
            reasons.setdefault(a, BODY)
        return found.excess

    def _compare(self, ratio: float, duration: float) -> None:
        """Compare the residual of the last second with that of the run."""
        if self._ratio_age > 4.0 * _NOW:  # a single bad block is no lasting change
            ratio = min(ratio, _SINGLE_BLOCK * self._ratio_run)
        self._ratio_now += min(duration / _NOW, 1.0) * (ratio - self._ratio_now)
        self._ratio_age += duration
        self._ratio_run += duration / min(self._ratio_age, _RUN) * (ratio - self._ratio_run)
        over = math.sqrt(self._ratio_now / max(self._ratio_run, 1e-12))
        matters = self._ratio_now > _MATTERS**2 and self._ratio_age > 4.0 * _NOW
        self.unusual = bool(matters and over > (_USUAL if self.unusual else _UNUSUAL))

    def _means(
        self, valid: BoolArray, scan: Scan, good: BoolArray, refused: BoolArray, reasons: dict[int, str], duration: float
    ) -> None:
        """Judge the slow mean of every sensor against the median of the body: they ride together, but the body leans."""
        n = self._bodies
        part = good[:n] & self._vectors[:n]
        if not part.any():
            return
        follows = self._vectors if good is self._all else valid.all(axis=0) & self._vectors
        largest = slow_means(scan.mean, self._rotation, part, follows, 1.0 - math.exp(-duration / _SLOW), self._slow)
        limit = math.hypot(_MEAN_LIMIT, _MOTION_LEFT * float(median_root(self._square, n)))
        if largest <= limit and MEAN not in self._latched.values():
            return
        away = self._slow[1].copy()
        bases = np.arange(n, len(away))[follows[n:]]
        if len(bases) >= 3:  # of two that contradict each other neither shows how the body leans
            away[bases, :2] -= np.clip(np.median(away[bases, :2], axis=0), -_LEAN, _LEAN)
        size = np.linalg.norm(away, axis=1)
        for a in range(0 if part.sum() >= 3 else n, len(self._accels)):
            latched = self._latched.get(a)
            if latched is None and size[a] > limit and (a >= n or self._check.dispensable(part, a)):
                self._latched[a] = MEAN
                self._well[a] = 0.0
            if self._latched.get(a) == MEAN:
                self._still_refused(a, duration, bool(size[a] < _MEAN_RELEASE * limit), refused, reasons)

    def _stuck_transducers(self, block: Block, result: BoolArray, reasons: dict[int, str], dt: float) -> BoolArray:
        """Refuse displacement transducers that repeat exactly while the body moves."""
        if not self._transducers:
            return result
        values = block.values[:, self._transducer_columns]
        first = values[:1] if self._displaced is None else self._displaced[None]
        same = np.all(np.abs(np.diff(np.concatenate([first, values]), axis=0)) <= 1e-12, axis=0)
        self._displaced = values[-1].copy()
        self._displaced_run = np.where(same, self._displaced_run + len(values) * dt, 0.0)
        size = np.sqrt(self._square)
        moving = bool(len(size) and np.median(size / self._noise) > _MOVING_TRANSDUCER)
        stuck = np.flatnonzero(self._displaced_run > _FLAT_TRANSDUCER)
        if not (moving and stuck.size):
            return result
        result = result.copy()
        for n in stuck:
            result[:, self._transducers[n]] = False
            reasons[len(self._accels) + int(n)] = FLAT
        return result

    def _count(self, there: BoolArray, used: BoolArray, reasons: dict[int, str]) -> None:
        self.active = {}
        if not reasons:
            return
        lost = there & ~used
        streams = [*self._accels.tolist(), *self._transducers]
        for a, reason in reasons.items():
            stream = streams[a]
            ticks = int(lost[:, stream].sum())
            if ticks:
                self.active[stream] = reason
                self.refused.setdefault(stream, Counter())[reason] += ticks

    def messages(self) -> list[str]:
        """Return one sentence per sensor that was refused, and one where it is open which sensor is wrong."""
        found = []
        for stream, counts in sorted(self.refused.items()):
            text = "; ".join(f"{count} ticks {reason}" for reason, count in sorted(counts.items()))
            now = " (now)" if stream in self.active else ""
            found.append(f"{self._sensors[stream].name} was not used{now}: {text}")
        if self.unusual:
            found.append("the sensors of the body disagree clearly more than before: parameters are not updated meanwhile")
        elif self.inconsistent_ticks:
            found.append(
                f"sensors of the body contradicted each other for {self.inconsistent_ticks} ticks: parameters not updated"
            )
        if self.suspects:
            found.append(
                f"one of {', '.join(self.suspects)} is wrong and cannot be isolated: parameters are held, uncertainty is larger"
            )
        return found

    def save(self) -> dict[str, Any]:
        """Return what a sensor is known for as plain lists; the last samples are not part of it."""
        return {
            "refused": {str(stream): dict(counts) for stream, counts in self.refused.items()},
            "latched": {str(a): reason for a, reason in self._latched.items()},
            "blame": np.minimum(self._clear, 2.0 * _SUSPECT).tolist(), "varied": self._stuck.save(),
            "ratio": [self._ratio_now, self._ratio_run, self._ratio_age], **fields_of(self, _SAVED),
        }  # fmt: skip

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`: a sensor that was refused stays so until it is well again."""
        self.reset()
        self.refused = {int(stream): Counter(counts) for stream, counts in saved["refused"].items()}
        self._latched = {int(a): str(reason) for a, reason in saved["latched"].items()}
        take_fields(self, _SAVED, saved)
        self._clear = np.array(saved["blame"], dtype=float).reshape(self._clear.shape)
        self._stuck.load(saved["varied"])
        self._ratio_now, self._ratio_run, self._ratio_age = (float(v) for v in saved["ratio"])
