# Copyright 2026 ride_estimation contributors
"""Base motion at the mounts: carried over from sensors beside them, made up for by the others where a sensor is missing.

The frame is taken as rigid: vertical acceleration linear in x and y, horizontal linear in y and x (yaw). What the frame twists is
lost, so the deflection of that mount is only known to a share of its usual size. Offsets are no motion: what the others do is
added to the mean of the missing sensor, and one that was away for long, plugged in or mounted again perhaps, goes on with its old
mean when that of the new readings is known. Integrated twice, a step of a tenth of a m/s^2 would deflect a mount by centimetres.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.block_math import follow_scatter, follow_squares, mean_of_ticks
from ride_estimation.estimation.common.geometry import Geometry, base_transport
from ride_estimation.estimation.forces.mount_forces import ForceBlock
from ride_estimation.estimation.kinematics.deflection import DeflectionBlock

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: share of the usual deflection that stays unknown
_UNKNOWN_SHARE = 0.7
#: memory of its size [s]
_MEMORY = 5.0
#: time in which the error fades afterwards [s]
_FADES = 3.0
#: factor where a sensor that is used may be wrong: its error adds to what is unknown without it
_WRONG = 2.0
#: memory of the size of the forces meanwhile, which are mostly that error [s]
_NOW = 0.3
#: what a bracket moves on its own over what a slope of the frame moves it
_OWN_SHARE = 0.3
#: lever too short for any slope [m]
_LEAST_LEVER = 1e-3
#: time of a mean [s]
_MEAN = 10.0
#: absence that counts as long: until then a fault of the sensor is found, afterwards an offset may be another [s]
_LONG = 5.0
#: time in which the new offset is determined [s]
_SETTLES = 3.0


class BaseFill:
    """Stand-in for missing base sensors.

    Parameters
    ----------
    geometry
        Mounts and base sensors.
    """

    def __init__(self, geometry: Geometry) -> None:
        both = zip(geometry.mounts, geometry.base_sensors)
        place = np.array([m.position if s is None else s.position for m, s in both]).reshape(-1, 3)
        self._place = place - place.mean(axis=0) if len(place) else place
        self._seen = geometry.base_seen
        self._has: BoolArray = np.asarray(self._seen.any(axis=1), dtype=bool)
        #: axes that nothing measures at a mount and that other bases determine
        self._made_up: BoolArray = np.logical_and(~self._seen, self._seen.any(axis=0))
        self._transport = base_transport(geometry.mounts, geometry.base_sensors)
        self._maps: dict[bytes, Array] = {}
        self.reset()

    def reset(self) -> None:
        """Forget sizes."""
        count = len(self._place)
        self._square, self._rate_square = np.zeros((count, 3)), np.zeros((count, 3))
        self._force, self._force_square = np.zeros((count, 3)), np.zeros((count, 3))
        self._age = 0.0
        #: means of the sensors while all speak, 0 until they are known: those that count, the next ones, the sum and time of now
        self._mean, self._next = np.zeros((count, 3)), np.zeros((count, 3))
        self._sum, self._heard = np.zeros((count, 3)), 0.0
        #: what readings have to be corrected by since they came back
        self._shift = np.zeros((count, 3))
        #: for how long every sensor is away, and is back; sum of its readings since over what was made up for it
        self._away, self._back, self._excess = np.zeros(count), np.full(count, math.inf), np.zeros((count, 3))
        self._quiet = False
        #: mounts whose sensor is used again since the last block, after a long absence
        self.returned: tuple[int, ...] = ()
        self.restart()

    def restart(self) -> None:
        """Begin a new time base: no base motion is a guess any more; sizes stay, and offsets, which are those of the sensors."""
        count = len(self._place)
        self._unknown = np.zeros(count)
        #: variance of made-up motion of the bases in units of that of what a bracket moves on its own, (M, 3)
        self.made_up, self._blend = np.zeros((count, 3)), np.ones((count, 3))
        self._wrong, self._now_square = 0.0, np.zeros((count, 3))

    def _map(self, there: BoolArray) -> Array:
        """Return weights of the axes (M, 3) that speak on the same axis of every mount, shape (3, M, M).

        Their mean, over which what all have in common, gravity above all, goes over whole however few speak, and slopes by least
        squares with a prior: brackets move on their own too, and over a short lever that is no slope.
        """
        key = there.tobytes()
        found = self._maps.get(key)
        if found is None:
            count = len(there)
            found = np.zeros((3, count, count))
            for axis, columns in enumerate(([1], [0], [0, 1])):
                own, usual = there[:, axis], self._place[self._seen[:, axis]]
                if not own.any():
                    continue
                place = self._place - self._place[own].mean(axis=0)
                lever = place[own][:, columns]
                prior = np.diag(_OWN_SHARE**2 * np.mean(usual[:, columns] ** 2, axis=0) + _LEAST_LEVER**2)
                slopes = np.linalg.solve(lever.T @ lever + prior, lever.T)
                found[axis][:, own] = 1.0 / own.sum() + place[:, columns] @ (slopes - slopes.mean(axis=1, keepdims=True))
            self._maps[key] = found
        return found

    def fill(self, base: Array, ok: BoolArray, duration: float) -> tuple[Array, BoolArray]:
        """Replace missing ticks and carry over to the mounts; return the signals (K, M, 3) and which ticks have one (K, M).

        Parameters
        ----------
        base
            Specific force at the base sensors, body axes, shape (K, M, 3) [m/s^2].
        ok
            Which of it is measured, shape (K, M).
        duration
            Of the block [s].
        """
        base, ok = self._filled(base, ok, duration)
        if self._transport is None:
            return base, ok
        return np.asarray(base.reshape(len(base), -1) @ self._transport.T).reshape(base.shape), ok

    def _filled(self, base: Array, ok: BoolArray, duration: float) -> tuple[Array, BoolArray]:
        self._unknown *= math.exp(-duration / _FADES)
        self._wrong *= math.exp(-duration / _FADES)
        gone: BoolArray = np.logical_and(self._has, ~np.asarray(ok.all(axis=0)))
        settling = self._settling(gone, duration)
        missing = gone | settling
        if self._shift.any():
            base = base - self._shift
        there: BoolArray = np.logical_and((self._has & ~missing)[:, None], self._seen)
        if not missing.any():
            self._hear(base, duration)
        if not there.any() or not (missing.any() or self._made_up.any()):
            return base, ok
        filled, filled_ok, mean = base.copy(), ok.copy(), self._offsets()
        for m in np.flatnonzero(missing):
            estimate = mean[m] + np.einsum("aj,kja->ka", self._map(there)[:, m], base - mean)
            lost = ~ok[:, m] | settling[m]
            if settling[m]:
                self._excess[m] += duration / _SETTLES * (base[:, m] - estimate).mean(axis=0)
            filled[lost, m] = estimate[lost]
            filled_ok[lost, m] = True
            self._unknown[m] = max(self._unknown[m], 1.0)
            # what it moves on its own is lost, what those do that stand for it is added
            self._blend[m] = 1.0 + np.sum(self._map(there)[:, m] ** 2, axis=1)
        for m in np.flatnonzero(self._made_up.any(axis=1)):
            estimate = np.einsum("aj,kja->ka", self._map(there)[:, m], base)
            filled[:, m, self._made_up[m]] = estimate[:, self._made_up[m]]
            filled_ok[:, m] |= not self._has[m]
        return filled, filled_ok

    def _hear(self, base: Array, duration: float) -> None:
        """Follow the means of the sensors, all of which speak."""
        self._heard += duration
        self._sum += duration * mean_of_ticks(base)
        if self._heard >= _MEAN:
            self._mean, self._next = self._next, self._sum / self._heard
            self._sum, self._heard = np.zeros_like(self._sum), 0.0

    def _offsets(self) -> Array:
        """Return the means of the readings as far as they are known, shape (M, 3)."""
        if self._mean.any():
            return self._mean
        if self._next.any():
            return self._next
        return self._sum / self._heard if self._heard >= _SETTLES else self._mean

    def _settling(self, gone: BoolArray, duration: float) -> BoolArray:
        """Return which sensors are back from a long absence and still compared with what is made up for them, shape (M,)."""
        if self._quiet and not gone.any():
            self.returned = ()
            return gone
        long = self._away >= _LONG
        self._away = np.where(gone, self._away + duration, 0.0)
        self._back = np.where(gone, np.inf, self._back)
        begins = long & ~gone
        self._back[begins], self._excess[begins] = 0.0, 0.0
        over = np.isfinite(self._back) & (self._back >= _SETTLES)
        self.returned = tuple(np.flatnonzero(over).tolist())
        self._shift[over] += self._excess[over]
        self._back[over] = np.inf
        settling: BoolArray = np.isfinite(self._back)
        self._back[settling] += duration
        self._quiet = not (gone.any() or settling.any())
        return settling

    def suspect(self) -> None:
        """Say that the base motion of any mount may be wrong."""
        self._unknown[:], self._wrong = _WRONG, 1.0

    def refused(self, mounts: Sequence[int]) -> None:
        """Say at which mounts a sensor is heard and refused now: what it read just before may be as wrong."""
        self._unknown[list(mounts)] = _WRONG

    def spoil(self) -> None:
        """Say that the deformation of the frame began anew: what brackets moved on their own is lost at all of them."""
        self._unknown = np.maximum(self._unknown, 1.0)

    def widen(self, block: DeflectionBlock, duration: float) -> DeflectionBlock:
        """Return the deflections with the standard deviation of mounts whose base motion was a guess."""
        gain = np.where(self._unknown < 0.05, min(duration / _MEMORY, 1.0), 0.0)
        follow_squares(block.deflection, gain, self._square)
        follow_squares(block.rate, gain, self._rate_square)
        unknown = np.where(self._unknown < 0.05, 0.0, self._unknown)[:, None]
        self.made_up = unknown**2 * self._blend
        if not unknown.any():
            return block
        share = _UNKNOWN_SHARE * unknown
        return dataclasses.replace(
            block,
            std=np.hypot(block.std, share * np.sqrt(self._square)),
            rate_std=np.hypot(block.rate_std, share * np.sqrt(self._rate_square)),
        )

    def widen_forces(self, block: ForceBlock, duration: float) -> ForceBlock:
        """Return the forces with what a sensor that may be wrong makes of them beyond their usual size, for the mount model."""
        if self._wrong < 0.05:
            self._age += duration
            follow_scatter(block.force, duration / min(max(self._age, duration), _MEMORY), self._force, self._force_square)
            return block
        now = np.mean((block.force - self._force) ** 2, axis=0)
        self._now_square += min(duration / _NOW, 1.0) * (now - self._now_square)
        beyond = self._wrong * np.maximum(self._now_square - self._force_square, 0.0)
        model = np.sqrt(block.std_model**2 + beyond)
        return dataclasses.replace(block, std_model=model, std=np.sqrt(block.std_equilibrium**2 + model**2))
