# Copyright 2026 ride_estimation contributors
"""Accelerometers that repeat a value exactly although there is motion: the whole sample, one axis of it, or its largest values.

A repetition is no measurement where the others move. Resolution lets one axis repeat while the motion along it is small, so an
axis is stuck only where the sensors beside it, on the body or at the bases, ranged along it meanwhile by many times its noise and
its resolution. The resolution is the least distance of two repeated values that follow each other; where noise is larger than
that, no value repeats. A sample that never changes and is not gravity measures nothing, whatever the others do. An axis that
repeats its largest and least values, and hardly any between them, is saturated below the full scale that the vehicle file states.
"""

from __future__ import annotations

import math
from collections.abc import Container
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.faults.gate_kernel import DEVIATION, Scan

Array = NDArray[np.float64]

FLAT = "stuck: its value repeats exactly while the other sensors move"
FLAT_AXES = tuple(f"stuck: its {axis} repeats exactly while the other sensors move along it" for axis in "xyz")
SATURATED = tuple(f"saturated: its {axis} rests at its largest values" for axis in "xyz")
DEAD = "dead: its value repeats exactly and is not gravity"
REASONS = (FLAT, *FLAT_AXES, *SATURATED, DEAD)

#: shortest exact repetition that counts as stuck [s]
_TIME = 0.03
#: the same in ticks
_TICKS = 4
#: shortest exact repetition of one axis: at the turn of a slow motion resolution makes shorter ones [s]
_AXIS_TIME = 0.25
#: shortest exact repetition of a sensor that never said anything else [s]
_DEAD_TIME = 1.0
#: motion of the others, in units of the noise, that makes the exact repetition of a sample impossible
_MOVING = 5.0
#: range of the others along an axis, in units of its noise and resolution, that makes its exact repetition impossible: white
#: noise alone ranges over half of it
_RANGE = 10.0
#: time in which the range of the others is searched [s]
_BEFORE = 0.5
#: number of repeated values that determine a resolution
_LEVELS = 8
#: data in which an axis rests at its largest values [s]
_RESTS_IN = 2.0
#: time between two tests for that [s]
_EVERY = 0.25
#: how often it comes to rest there
_RESTS = 4
#: largest number of repetitions elsewhere over those there
_ELSEWHERE = 0.25
#: distance of the largest and the least value in units of noise: less is standstill
_APART = 20.0
#: share of gravity by which the size of a value that never changes is another
_OFF = 0.5


class StuckSensors:
    """Test of repeated values of all accelerometers.

    Parameters
    ----------
    rotation
        Sensor to body axes, shape (A, 3, 3).
    noise
        Standard deviations, shape (A,) [m/s^2].
    dc
        Which sensors measure gravity, shape (A,).
    bodies
        How many of them are on the body; the others are at the bases.
    gravity
        [m/s^2].
    measured
        Which axes they measure, shape (A, 3); all where None.
    """

    def __init__(
        self, rotation: Array, noise: Array, dc: NDArray[np.bool_], bodies: int, gravity: float,
        measured: NDArray[np.bool_] | None = None,
    ) -> None:  # fmt: skip
        self._rotation, self._noise, self._dc, self._gravity = rotation, noise, dc, gravity
        count = len(rotation)
        self._measured = measured = np.ones((count, 3), dtype=bool) if measured is None else measured
        self._triaxial = measured.all(axis=1)
        # what a sensor at rest reads of gravity along the axes it measures
        seen = np.linalg.norm(measured * rotation[:, 2], axis=1)
        self._at_rest = gravity * np.where(self._triaxial, 1.0, seen)
        groups = (np.arange(bodies), np.arange(bodies, count))
        beside = [g[g != a] for a in range(count) for g in groups if a in g]
        #: whose range along an axis counts: the sensors beside it, all others where there are none
        self._beside = [g if g.size else np.flatnonzero(np.arange(count) != a) for a, g in enumerate(beside)]
        self.reset()

    def reset(self) -> None:
        """Begin a new time base."""
        count = len(self._rotation)
        #: ticks the last sample and the last value of every axis have repeated, and what they were, see :func:`scan_block`
        self.run, self.axis_run = np.zeros(count, dtype=np.int64), np.zeros((count, 3), dtype=np.int64)
        self.held = np.zeros((3, count, 3))
        self.held[1] = np.inf
        self._blocks: list[Array] = []
        self._saturated, self._next = np.zeros((count, 3), dtype=bool), 0
        #: ticks since which a sensor was not stuck: what it repeated then is no rest
        self._free = np.full(count, np.inf)
        self._stuck = np.zeros((count, 3), dtype=bool)
        self._varied, self._all_varied = np.zeros((count, 3), dtype=bool), False

    def judge(self, values: Array, scan: Scan, square: Array, refused: Container[int], first: bool, dt: float) -> dict[int, str]:
        """Return the sensors that repeat a value at which they cannot be, and why.

        Parameters
        ----------
        values
            Samples of a block, shape (K, A, 3).
        scan
            Of the block.
        square
            Mean squared motion of every sensor, shape (A,).
        refused
            Sensors that are refused for such a repetition: any long one keeps them refused.
        first
            Whether nothing was seen before this block.
        dt
            Tick [s].
        """
        ticks = len(values)
        self._blocks = [*self._blocks[-math.ceil(_RESTS_IN / (dt * ticks)) :], values]
        if not first and not self._all_varied:
            self._varied |= self.axis_run < ticks
            self._all_varied = bool((self._varied | ~self._measured).all())
        least = max(_TICKS, math.ceil(_TIME / dt - 1e-9))
        found: dict[int, str] = {}
        if scan.longest >= least:
            # one axis alone repeats by its resolution
            needed = np.where(self._triaxial, least, max(least, math.ceil(_DEAD_TIME / dt)))
            for a in np.flatnonzero((scan.runs >= needed).any(axis=0)).tolist():
                reason = self._sample(a, scan, square, dt)
                if reason or a in refused:
                    found[a] = reason or FLAT
        self._stuck &= self.axis_run >= least
        lasting = max(least, math.ceil(_AXIS_TIME / dt - 1e-9))
        if scan.longest_axis >= least:
            for a, c in np.argwhere(self._stuck | (self._measured & (self.axis_run >= lasting))).tolist():
                self._stuck[a, c] = self._stuck[a, c] or (a not in found and self._others_range(a, c, dt))
                if self._stuck[a, c]:
                    found.setdefault(a, FLAT_AXES[c])
        self._free += ticks
        self._free[list(found)] = 0.0
        self._next -= ticks
        if self._next <= 0 and not first:
            self._next = round(_EVERY / dt)
            self._find_rests(self._free * dt > _RESTS_IN)
        for a, c in np.argwhere(self._saturated).tolist() if self._saturated.any() else ():
            found.setdefault(a, SATURATED[c])
        return found

    def _find_rests(self, free: NDArray[np.bool_]) -> None:
        values = np.concatenate(self._blocks)
        largest, least = values.max(axis=0), values.min(axis=0)
        same = np.abs(np.diff(values, axis=0)) <= 1e-9 * (1.0 + np.abs(values[1:]))
        resting = same & ((values[1:] == largest) | (values[1:] == least))
        begun, repeated = np.sum(resting[1:] & ~resting[:-1], axis=0), np.sum(resting, axis=0)
        rests = (begun >= _RESTS) & (np.sum(same & ~resting, axis=0) <= _ELSEWHERE * repeated)
        self._saturated = rests & (largest - least > _APART * self._noise[:, None]) & free[:, None]

    def _sample(self, a: int, scan: Scan, square: Array, dt: float) -> str:
        """Return why a repeated sample cannot be a measurement, empty where it can."""
        # resolution and standstill let a value repeat; a second of motion does not, nor does one that varied before
        lasting = float(scan.runs[:, a].max()) * dt > _DEAD_TIME
        size = np.sqrt(np.maximum(square, scan.figures[DEVIATION])[np.arange(len(square)) != a])
        if (lasting or bool(self._varied[a].any())) and size.size and np.median(size) > _MOVING * self._noise[a]:
            return FLAT
        off = abs(float(np.linalg.norm(scan.mean[a])) - self._at_rest[a])
        return DEAD if lasting and self._dc[a] and off > _OFF * self._gravity else ""

    def _others_range(self, a: int, c: int, dt: float) -> bool:
        """Return whether the sensors beside it moved along an axis, while it repeated, by more than noise and resolution."""
        run, beside = int(self.axis_run[a, c]), self._beside[a]
        if not beside.size or (not self._varied[a, c] and run * dt <= _DEAD_TIME):
            return False
        along = self._rotation[beside].transpose(0, 2, 1) @ self._rotation[a][:, c]
        window = min(run + 1, round(_BEFORE / dt))
        others = np.einsum("kps,ps->kp", np.concatenate(self._blocks)[-window:, beside], along)
        resolution = float(self.held[1, a, c]) if self.held[2, a, c] > _LEVELS else 0.0
        return bool(np.median(np.ptp(others, axis=0)) > _RANGE * math.hypot(float(self._noise[a]), resolution))

    def save(self) -> list[Any]:
        """Return which axes ever said anything else as a plain list."""
        return list(self._varied.tolist())

    def load(self, saved: list[Any]) -> None:
        """Continue from :meth:`save`."""
        self._varied = np.array(saved, dtype=bool).reshape(self._varied.shape)
