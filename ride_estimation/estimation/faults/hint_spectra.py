# Copyright 2026 ride_estimation contributors
"""What the mount model misses of the force on the body, by frequency: lines of one frequency, and the share in all.

Spectra of four seconds (Hann, half overlapped) are averaged over a minute. A line stands out of its neighbours by more than the
scatter of an averaged periodogram lets expect (F distribution), both in the missing force and in its ratio to the force of the
mounts: a line of the road or of the engine that the bases bring along shows in both alike and is no line of the ratio. It stands
out of its nearest neighbours too: a resonance, as of wheels on their tyres, is wider than a line.

The level of the tests gives :data:`FALSE_ALARMS_PER_HOUR` in all, counted over the independent tests of an hour.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.faults.hints import Hint
from ride_estimation.frames import COORDINATES

Array = NDArray[np.float64]

#: false hints an hour of all tests together, by theory
FALSE_ALARMS_PER_HOUR = 0.01
#: memory of the spectra [s]; tests that far apart are independent
_MEMORY = 60.0
#: length of a spectrum [s], analysed band [Hz]
_SEGMENT = 4.0
_BAND = (0.5, 40.0)
#: lines are sought above [Hz]: below, slow errors of integrated deflections have edges of their own
_LOWEST_LINE = 3.0
#: bins of a line beside its peak
_LINE = 2
#: bins beside the line that it is compared with: many for a sure level, few for a near one
_BESIDE = (12, 2)
#: spectra before the first test
_LEAST_SEGMENTS = 12
#: share of the force on the body, in amplitude, below which a line is not reported
_LEAST_LINE = 0.01
#: the same of a misfit
_LEAST_MISFIT = 0.25
#: forgetting per spectrum, two of them a segment
_KEEP = 1.0 - 2.0 * _SEGMENT / _MEMORY / 2.0


class SpectrumHints:
    """Detector of lines and of a mount model that misses much.

    Parameters
    ----------
    geometry
        Body and mounts; without the motion of their bases the forces are not tested.
    """

    def __init__(self, geometry: Geometry) -> None:
        self._body, self._possible = geometry.body.name, geometry.has_base_motion
        self._axes = np.flatnonzero(geometry.free)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._waiting: list[Array] = []
        self._ticks, self._step = 0, 0.0
        self._power: Array = np.zeros((12, 0))
        self._weight, self._squares, self._segments = 0.0, 0.0, 0

    def interrupt(self) -> None:
        """Begin a new segment after a gap."""
        self._transform()
        self._waiting, self._ticks = [], 0

    def observe(self, support: Array, missing: Array, dt: float) -> None:
        """Take a block without a gap; a segment that it completes is transformed with the next one.

        Parameters
        ----------
        support, missing
            Force on the body and what the mounts' model does not explain of it, shape (K, 6) [N, N m].
        dt
            Tick [s].
        """
        if not self._possible:
            return
        self._transform()
        if dt != self._step:
            self.reset()
            self._step = dt
        self._waiting.append(np.hstack([missing, support - missing]))
        self._ticks += len(support)

    def _transform(self) -> None:
        """Add the segments that are complete; the second half of each is the first of the next."""
        length = round(_SEGMENT / self._step) if self._step else 0
        if not length or self._ticks < length:
            return
        waiting = np.concatenate(self._waiting)
        while len(waiting) >= length:
            self._add(waiting[:length])
            waiting = waiting[length // 2 :]
        self._waiting, self._ticks = [waiting], len(waiting)

    def _add(self, segment: Array) -> None:
        length = len(segment)
        first, last = (round(f * _SEGMENT) for f in (_BAND[0], min(_BAND[1], 0.4 / self._step)))
        window = np.hanning(length)[:, None]
        spectrum = np.fft.rfft((segment - segment.mean(axis=0)) * window, axis=0)[first : last + 1]
        power = np.abs(spectrum.T) ** 2
        if self._power.shape != power.shape:
            self._power = np.zeros_like(power)
        self._power = _KEEP * self._power + power
        self._weight, self._squares = _KEEP * self._weight + 1.0, _KEEP**2 * self._squares + 1.0
        self._segments += 1

    def hints(self) -> tuple[Hint, ...]:
        """Return the strongest line and, where there is none, a misfit that is large."""
        self._transform()
        if self._segments < _LEAST_SEGMENTS or not len(self._axes):
            return ()
        missing, mounts = self._power[self._axes], self._power[6 + self._axes]
        total = np.maximum(mounts.sum(axis=1), 1e-300)
        best = self._line(missing, mounts, total)
        if best is not None:
            axis, place, share = best
            frequency = _BAND[0] + place / _SEGMENT
            name = COORDINATES[self._axes[axis]]
            words = (
                f"{self._body} {name} is shaken at {frequency:.2f} Hz by {100.0 * share:.0f} % of the force of its mounts: looks "
                "like harmonic disturbance"
            )
            return (Hint("harmonic_disturbance", self._body, name, frequency, 0.5 / _SEGMENT, "Hz", words),)
        share = np.sqrt(missing.sum(axis=1) / total)
        vertical = int(np.argmax(self._axes == 2)) if 2 in self._axes else int(np.argmax(total))
        if share[vertical] < _LEAST_MISFIT:
            return ()
        name = COORDINATES[self._axes[vertical]]
        words = (
            f"the mounts' model misses {100.0 * share[vertical]:.0f} % of the force on {self._body} {name}: diagnose the "
            "recorded run"
        )
        return (Hint("unexplained", self._body, name, float(share[vertical]), 0.0, "-", words),)

    def _line(self, missing: Array, mounts: Array, total: Array) -> tuple[int, int, float] | None:
        """Return (component, bin, share of the force in amplitude) of the strongest line."""
        bins = missing.shape[1]
        # degrees of freedom of the averages: two per spectrum; neighbours of a Hann window share half of theirs
        own = 2.0 * self._weight**2 / self._squares
        ratio = missing / np.maximum(mounts, 1e-12 * total[:, None])
        # over what chance allows, against the nearest and the wider neighbours
        allowed = {n: float(stats.f.isf(_level(missing.size), own, own * n)) for n in _BESIDE}
        over = np.min([p / (_beside(p, n) * allowed[n]) for p in (missing, ratio) for n in _BESIDE], axis=0)
        power = np.stack([missing[:, max(i - 1, 0) : i + 2].sum(axis=1) for i in range(bins)], axis=1)
        share = np.sqrt(power / total[:, None])
        over[share < _LEAST_LINE] = 0.0
        over[:, : round((_LOWEST_LINE - _BAND[0]) * _SEGMENT)] = 0.0
        over[:, bins - _LINE - max(_BESIDE) // 2 :] = 0.0
        axis, place = np.unravel_index(int(np.argmax(over)), over.shape)
        return (int(axis), int(place), float(share[axis, place])) if over[axis, place] > 1.0 else None


def _beside(power: Array, count: int) -> Array:
    """Return the larger of the mean levels of so many bins on both sides of every bin, beyond a line, shape as given.

    The larger of the two, so that a flank is no line.
    """
    bins = power.shape[1]
    padded = np.concatenate([np.zeros((len(power), 1)), np.cumsum(power, axis=1)], axis=1)
    index = np.arange(bins)
    out = np.full(power.shape, 1e-300)
    for low, high in ((index - _LINE - count, index - _LINE), (index + _LINE + 1, index + _LINE + 1 + count)):
        a, b = np.clip(low, 0, bins), np.clip(high, 0, bins)
        there = b - a
        mean = (padded[:, b] - padded[:, a]) / np.maximum(there, 1)
        out = np.where(there >= count // 2, np.maximum(out, mean), out)
    return out


def _level(tests: int) -> float:
    """Return the probability of a false alarm that one test may have.

    Parameters
    ----------
    tests
        Made at a time; an hour has ``3600 / _MEMORY`` independent times.
    """
    return FALSE_ALARMS_PER_HOUR / (3600.0 / _MEMORY * max(tests, 1))
