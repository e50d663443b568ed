# Copyright 2026 ride_estimation contributors
"""Errors of base sensors that the vertical balance of the body shows: which one change of the readings brings it back.

The mounts carry the body: with G the lever arms of M vertical mount forces, ``w = -G (k x + c x')`` for the vertical force and
the two moments w that the body's motion shows (what horizontal mount forces add to the moments is taken off), x the deflection
from the body's motion minus that of the base sensors. All signals pass one high-pass, so bias, tilt and drift vanish, and
relative acceleration passes it divided by s^2 and s. Where a displacement transducer measures x itself, its difference from that
x, as a force, is a further equation.

Every hypothesis is a linear map of the base readings: one sensor too strong or too weak, inverted, late, without any relation
to the motion (the plane through the other bases is then the best guess of its motion), or two of them exchanged. The residual
sum of squares under each, with k and c fitted anew about the vehicle file, follows from one matrix of fading second moments of
all signals. A stiffer mount, a softer one or other damping is thus no error of a sensor, and a law that is not linear is
explained by none of them. What lessens the residual several times, and clearly more than any error of another sensor does, is
the error.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from ride_estimation.estimation.common.geometry import Geometry, base_transport
from ride_estimation.estimation.faults.left_out import BaseSensorTest
from ride_estimation.estimation.faults.sensor_gate import GateVerdict
from ride_estimation.frames import AXES
from ride_estimation.vehicles.tangent import tangent

Array = NDArray[np.float64]

#: corner of the high-pass [Hz]: at half a hertz a base moves many times farther than its mount deflects
_CORNER_HZ = 0.5
#: data taken at once [s]
_CHUNK = 0.5
#: memory of the moments [s]
_MEMORY = 2.0
#: least data before anything is judged [s]
_LEAST = 4.0
#: time in which the filters forget how they began [s]
_SETTLE = 2.0
#: errors that are tested: reading over true motion, and delay [s]; smaller ones are within tolerance or a matter for the test
#: over the whole run
_GAINS = (-1.0, 0.4, 0.6, 0.77, 1.3, 1.7, 2.5)
_DELAYS = (-0.03, -0.02, -0.01, 0.01, 0.02, 0.03)
#: factor by which an error must lessen the squared residual
_BETTER = 2.0
#: factor by which it must do so better than any error of other sensors
_RIVAL = 1.5
#: factor from which on no parameters are updated until the next tests decide
_HINT = 1.4
#: the two factors over that which the run usually shows: laws that no stiffness and damping describe, as of rubber, resemble a
#: delay a little all the time, an error that comes while driving does not
_NEW = 1.5
_NEW_HINT = 1.25
#: factor by which an error would raise the residual where there is none: only then its absence is seen
_SHOWS = 1.3
#: time without a sign of an error before one that comes is known to have come while driving [s]
_PROVEN = 10.0
#: rise of the residual above that of the run that is suspicious
_RISE = 4.0
#: time over which the residual of the run may change [s]
_RUN = 30.0
#: tests in a row that must agree
_AGREE = 2
#: tests in a row without the error after which a sensor is used again
_RECOVER = 4
#: least singular value of the places of bases, in units of their spread, that make a plane
_PLANE = 0.1
#: least squared residual that is suspicious, share of the squared load
_MATTERS = 0.002
#: least squared residual in which an error is sought: a gain of 1.2 of one base, fitted by softer mounts, leaves no more
_DECIDES = 0.0005
#: least motion of the body, root mean square of the filtered vertical load over the weight
_MOVING = 0.005
#: relative standard deviation of stiffness and damping about the file
_PRIOR = 0.5
#: share of the load that no linear law explains
_UNEXPLAINED = 0.001
#: independent averages per second
_RATE = 8.0


@dataclasses.dataclass(frozen=True)
class BaseError:
    """An error of the base sensors: ``sensors`` by their mounts, ``words``, and what the true motion is of what they read.

    ``motion`` and ``rate``, shapes (M, 3 M), map the readings and their rates to the vertical motion of the bases.
    """

    sensors: tuple[int, ...]
    words: str
    motion: Array
    rate: Array


class BaseBalance(BaseSensorTest):
    """Judge the base sensors of a body by its vertical balance.

    Parameters
    ----------
    geometry
        Body, mounts and their sensors.
    """

    def __init__(self, geometry: Geometry) -> None:
        a = geometry
        self._count = count = len(a.mounts)
        sensors = [s for s in a.base_sensors if s is not None]
        super().__init__(sensors, "wiring, gain, delay and fixing", "and with the motion of the body: ")
        vertical = [m.elements.get(AXES[2]) for m in a.mounts]
        prior = np.array([tangent(e) if e is not None else (0.0, 0.0) for e in vertical]).reshape(count, 2).T.ravel()
        triaxial = all(s.triaxial for s in sensors)
        self.possible = triaxial and 3 <= count == len(sensors) and bool(np.all(prior > 0.0) and np.all(a.free[[2, 3, 4]]))
        #: two mounts whose sensors are exchanged, found just now
        self.exchanged: tuple[int, int] | None = None
        if not self.possible:
            return
        arms = np.stack([np.ones(count), a.arms[:, 1], -a.arms[:, 0]])
        self._scale = np.sqrt(np.mean(arms**2, axis=1))
        self._arms = arms / self._scale[:, None]
        self._heights = a.arms[:, 2]
        self._weight = float(a.weight[2])
        self._prior, self._stiffness = prior, prior[:count]
        self._gram = np.tile(self._arms.T @ self._arms, (2, 2))
        by_mount = {a.mount_names.index(s.mount): i for i, s in enumerate(a.transducers) if s.axis == AXES[2]}
        self._measured = np.array(sorted(by_mount), dtype=np.int64)
        self._transducers = [by_mount[m] for m in self._measured.tolist()]
        transport = base_transport(a.mounts, a.base_sensors)
        self._carried = np.eye(3 * count) if transport is None else transport
        self._rotation = np.array([s.rotation for s in sensors])
        self._hypotheses = self._all_hypotheses()
        self._parts = self._deflections()
        #: errors that also a slow ride shows: those of the motion itself
        self._strong = [n for n, h in enumerate(self._hypotheses) if len(h.sensors) == 1 and not h.rate.any()]
        self.reset()

    def reset(self) -> None:
        """Begin a new time base; verdicts stay."""
        self._waiting: list[tuple[Array, ...]] = []
        self._ticks, self._step, self._age, self._time = 0, 0.0, 0.0, 0.0
        self._moments = np.zeros((0, 0))
        self._found, self._agreed, self._well = -1, 0, 0
        #: time since the readings showed no sign of an error, infinite where they always did, and time without [s]
        self.suspicious, self._proven = math.inf, 0.0
        #: share of the load that the run usually leaves unexplained, and time over which that was followed [s]
        self._usual, self._followed = 0.0, 0.0
        #: factor by which the best error usually lessens the residual
        self._usually = 1.0
        #: a single error would explain the readings better: nothing is learned; the residual is larger than that of the run, as
        #: after a fault that none explains yet or a load that came on: forces are less certain
        self.unusual = self.rises = False
        #: time for which a change of the parameters may still be an error of a sensor [s]
        self._open, self._changes = 0.0, 0

    def _all_hypotheses(self) -> list[BaseError]:
        """Return the map of readings that are right, then those of all errors."""
        count = self._count
        still = np.zeros((count, 3 * count))

        def vertical(reading_of: list[int], share: Array) -> Array:
            """Return the map where mount i takes ``share[i]`` of the reading at mount ``reading_of[i]``."""
            own = np.zeros((3 * count, 3 * count))
            for i, j in enumerate(reading_of):
                own[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = share[i] * self._rotation[i]
            return np.asarray(self._carried[2::3] @ own)

        order, one = list(range(count)), np.ones(count)
        found = [BaseError((), "", vertical(order, one), still)]
        for i in range(count):
            own = np.arange(count) == i
            for gain in _GAINS:
                words = f"it reads {gain:g} times the motion" if gain > 0.0 else "it reads the motion inverted"
                found.append(BaseError((i,), words, vertical(order, np.where(own, 1.0 / gain, 1.0)), still))
            for delay in _DELAYS:
                late = vertical(order, np.where(own, delay, 0.0))
                words = f"it is {1e3 * abs(delay):.0f} ms {'late' if delay > 0.0 else 'early'}"
                found.append(BaseError((i,), words, vertical(order, one), late))
            others = np.flatnonzero(~own)
            if np.linalg.svd(self._arms[:, others], compute_uv=False)[-1] > _PLANE:
                motion = vertical(order, np.where(own, 0.0, 1.0))
                motion[i] = (np.linalg.pinv(self._arms[:, others]) @ self._arms[:, i]) @ motion[others]
                found.append(BaseError((i,), "its motion does not fit at all", motion, still))
        for i, j in itertools.combinations(range(count), 2):
            swapped = [{i: j, j: i}.get(n, n) for n in order]
            found.append(BaseError((i, j), "", vertical(swapped, one), still))
        return found

    def judged(self, verdict: GateVerdict, streams: NDArray[np.int64]) -> GateVerdict:
        """Return the verdict on a block with what the balance adds to it.

        Parameters
        ----------
        verdict
            Of the other checks.
        streams
            Of the base sensors.
        """
        if self.unusual:
            verdict = dataclasses.replace(verdict, unusual=True)
        return self.without_refused(verdict, streams, self.suspicious + 2.0 * _MEMORY)

    @property
    def inconsistent(self) -> bool:
        """Return whether one of the sensors may be wrong though none can be isolated: forces are less certain."""
        return self.unusual or self.rises or self.undecided

    @property
    def undecided(self) -> bool:
        """Return whether parameters changed just now and it is open whether the mounts did or a sensor is wrong."""
        return self._open > 0.0 and not self.refused

    def follow_changes(self, count: int) -> None:
        """Take how often parameters changed faster than driving explains: until the cause is known, a sensor may be why."""
        if count > self._changes:
            self._open = 2.0 * _MEMORY
        self._changes = count

    # -- samples ----------------------------------------------------------------------------------------------------------

    def interrupt(self) -> None:
        """Say that a block is missing or that a sensor of it is not fit to be used: filters begin anew."""
        if self.possible and self._step:
            self._waiting, self._ticks, self._step, self._age = [], 0, 0.0, 0.0

    def gather(self, load: Array, horizontal: Array, body: Array, readings: Array, displaced: Array) -> None:
        """Take a block at which every sensor spoke.

        Parameters
        ----------
        load
            Wrench the mounts carry, shape (K, 6) [N, N m].
        horizontal
            Forces of the mounts along x and y, shape (K, M, 2) [N].
        body
            Vertical specific force of the body at the mounts, shape (K, M).
        readings
            Of the base sensors, sensor axes, shape (K, 3 M).
        displaced
            Of the transducers, shape (K, T), in the order of the geometry.
        """
        moments = np.stack([load[:, 2], load[:, 3], load[:, 4]], axis=1)
        moments[:, 1] += horizontal[:, :, 1] @ self._heights
        moments[:, 2] -= horizontal[:, :, 0] @ self._heights
        self._waiting.append((moments / self._scale, displaced[:, self._transducers], body, readings))
        self._ticks += len(load)

    def learn(self, dt: float) -> None:
        """Test what was gathered once it is a chunk."""
        if self._ticks * dt < _CHUNK:
            return
        forces, displaced, body, readings = (np.concatenate(parts) for parts in zip(*self._waiting))
        duration = self._ticks * dt
        self._open -= duration
        self._waiting, self._ticks = [], 0
        if self._step != dt:
            self._begin(dt, forces, displaced, body, readings)
        direct = self._pass(0, np.hstack([forces, displaced]) - self._offset[0])
        moved = np.hstack([body, readings]) - self._offset[1]
        motion, rate, accel = self._pass(1, moved), self._pass(2, moved), self._pass(3, moved)
        self._age += duration
        if self._age <= _SETTLE:
            return
        count = self._count
        table = np.hstack([direct, motion[:, :count], rate[:, :count], motion[:, count:], rate[:, count:], accel[:, count:]])
        self._remember(table.T @ table / len(table), duration)

    def _remember(self, new: Array, duration: float) -> None:
        """Take the second moments of a chunk."""
        gain = 1.0 - math.exp(-duration / _MEMORY)
        self._time = min(self._time + duration, _LEAST)
        self._moments = new if not self._moments.size else self._moments + gain * (new - self._moments)
        if self._time >= _LEAST:
            self._judge(duration)

    def _begin(self, dt: float, *parts: Array) -> None:
        """Make the filters for a tick, at rest."""
        self._step = dt
        forces, displaced, body, readings = parts
        self._offset = [np.hstack([forces, displaced]).mean(axis=0), np.hstack([body, readings]).mean(axis=0)]
        corner = 2.0 * math.pi * _CORNER_HZ
        # s^6, s^4, s^5 and s^6 over (s + w)^6: as measured, twice integrated, once integrated
        digital = [signal.bilinear_zpk([0.0] * n, [-corner] * 6, 1.0, 1.0 / dt) for n in (6, 4, 5, 6)]
        self._sections = [signal.zpk2sos(*zpk) for zpk in digital]
        widths = [len(self._offset[0])] + 3 * [len(self._offset[1])]
        self._states = [np.zeros((len(s), 2, width)) for s, width in zip(self._sections, widths)]

    def _pass(self, which: int, signals: Array) -> Array:
        out, self._states[which] = signal.sosfilt(self._sections[which], signals, axis=0, zi=self._states[which])
        return np.asarray(out)

    # -- verdict ----------------------------------------------------------------------------------------------------------

    def _judge(self, duration: float) -> None:
        total = float(np.trace(self._moments[:3, :3]))
        if total < (_MOVING * self._weight) ** 2:
            return
        left = self._residuals(total)
        best = int(np.argmin(left))
        chosen = self._hypotheses[best]
        others = [x for x, h in zip(left, self._hypotheses) if not set(h.sensors) & set(chosen.sensors)]
        if len(chosen.sensors) == 2:  # an error of one of them is no exchange
            others = [x for n, x in enumerate(left) if n != best]
        better = left[0] / max(left[best], 1e-30) if left[0] > _DECIDES * total else 1.0
        usually = self._usually if self._followed > _PROVEN else math.inf
        isolates = better > min(_BETTER, _NEW * usually) and min(others) > _RIVAL * left[best]
        self._agreed = self._agreed + 1 if isolates and best == self._found else int(isolates)
        self._found = best
        share = float(left[0]) / total
        rises = self._followed > _LEAST and share > max(_RISE * self._usual, _MATTERS)
        self.unusual, self.rises = not self.refused and better > min(_HINT, _NEW_HINT * usually), not self.refused and rises
        self._followed = min(self._followed + duration, _RUN)
        self._usual += duration / self._followed * (min(share, _RISE * self._usual if rises else share) - self._usual)
        self._usually += duration / self._followed * (min(better, _NEW * usually) - self._usually)
        sound = float(left[self._strong].min()) > _SHOWS * left[0]
        self._proven += duration * sound
        self.suspicious = self.suspicious + duration if not sound else 0.0 if self._proven > _PROVEN else math.inf
        self._well = self._well + 1 if self.refused and left[self._accused()] > _SHOWS * left[0] else 0
        if self._agreed >= _AGREE and len(chosen.sensors) == 2:
            self.exchanged, self.refused = (chosen.sensors[0], chosen.sensors[1]), {}
        elif self._agreed >= _AGREE:
            self.refused = {chosen.sensors[0]: chosen.words}
        elif self._well >= _RECOVER:
            self.refused = {}

    def _accused(self) -> int:
        """Return the hypothesis for which a sensor is left out."""
        ((sensor, words),) = self.refused.items()
        return next(n for n, h in enumerate(self._hypotheses) if h.sensors == (sensor,) and h.words == words)

    def _deflections(self) -> Array:
        """Return what makes deflection and rate of the signals of :meth:`learn`, per hypothesis, shape (H, 2 M, signals)."""
        count, first = self._count, 3 + len(self._measured)
        base, own = first + 2 * count, 3 * count
        parts = np.zeros((len(self._hypotheses), 2 * count, base + 3 * own))
        parts[:, np.arange(2 * count), first + np.arange(2 * count)] = 1.0
        for part, error in zip(parts, self._hypotheses):
            for offset, block in ((0, error.motion), (own, error.rate)):
                part[:count, base + offset : base + offset + own] -= block
                part[count:, base + own + offset : base + 2 * own + offset] -= block
        return parts

    def _residuals(self, total: float) -> Array:
        """Return the least squared residual of balance and transducers, k and c fitted, of every hypothesis, shape (H,)."""
        parts, moments = self._parts, self._moments
        seen = parts @ moments
        normal = (seen @ parts.transpose(0, 2, 1)) * self._gram
        score = -np.sum(seen[:, :, :3] * np.tile(self._arms.T, (2, 1)), axis=2)
        # the prior as so many independent averages
        ridge = _UNEXPLAINED * total / (_RATE * _MEMORY) / (_PRIOR * self._prior) ** 2
        fitted = np.linalg.solve(normal + np.diag(ridge), (score + ridge * self._prior)[:, :, None])[:, :, 0]
        left = total - 2.0 * np.sum(score * fitted, axis=1) + np.einsum("hi,hij,hj->h", fitted, normal, fitted)
        left += np.sum(ridge * (fitted - self._prior) ** 2, axis=1)
        if len(self._measured):
            rows = np.arange(len(self._measured))
            difference = -parts[:, self._measured]
            difference[:, rows, 3 + rows] += 1.0
            weight = self._stiffness[self._measured] ** 2 * np.diag(self._gram)[self._measured]
            left += np.sum(weight * np.sum((difference @ moments) * difference, axis=2), axis=1)
        return np.asarray(left)

    def messages(self) -> list[str]:
        """Return one sentence per sensor that is left out, or that none can be named."""
        found = [
            "the sensors at the mount bases contradict the motion of the body and no single error of one explains it: parameters "
            "are not updated meanwhile, forces are less certain: check wiring, gain and fixing of base sensors, and the mounts"
        ]
        return (found if self.possible and self.unusual else []) + super().messages()

    def save(self) -> dict[str, Any]:
        """Return the verdicts as a mapping that JSON can hold."""
        return {str(m): words for m, words in self.refused.items()}

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        if self.possible:
            self.refused = {int(m): str(words) for m, words in saved.items()}
            self._reported = frozenset(self.refused)
