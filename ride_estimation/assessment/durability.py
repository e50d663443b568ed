# Copyright 2026 ride_estimation contributors
"""Pseudo-damage of load signals by rainflow counting (ASTM E1049) and a power law: how much, when, how sure.

Only ratios of pseudo-damage mean anything; the unit is the unit of the signal to the power of the slope.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ride_estimation.assessment.rainflow import Cycles, RainflowCounter, count_cycles
from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]

DEFAULT_SLOPE = 5.0  # exponent of the pseudo S-N line for welded and formed steel parts, the usual default in load comparison
SLOPES = (1.0, 20.0)  # range of published S-N slopes, and beyond
KNOWLEDGE_S = 10.0  # an estimate of parameters takes about that long, and ten seconds of driving tell the size of a load to 20 %
EQUIVALENT_RATE_HZ = 1.0  # cycles per second of the damage-equivalent load (the "1 Hz" convention of load comparison)


def rainflow_ranges(values: ArrayLike) -> tuple[Array, Array]:
    """Return (ranges, counts) of the rainflow cycles, half cycles counted 0.5 (ASTM E1049 section 5.4.4).

    Parameters
    ----------
    values
        Load signal, shape (N,), any unit.

    Raises
    ------
    InputDataError
        Fewer than two samples, or values not finite.
    """
    cycles = count_cycles(values)
    return cycles.ranges, cycles.count


def cycle_damage(cycles: Cycles, slope: float = DEFAULT_SLOPE) -> Array:
    """Return ``n range^slope`` of every cycle, shape (C,) [unit^slope].

    Raises
    ------
    InputDataError
        A slope outside :data:`SLOPES`.
    """
    return np.asarray(cycles.count * cycles.ranges ** checked_slope(slope))


def checked_slope(slope: float) -> float:
    """Return the slope, or say what is allowed."""
    if not SLOPES[0] <= slope <= SLOPES[1]:
        raise InputDataError(f"slope {slope!r} is not a valid S-N slope; allowed: {SLOPES[0]:g} to {SLOPES[1]:g}")
    return float(slope)


def pseudo_damage(values: ArrayLike, slope: float = DEFAULT_SLOPE) -> float:
    """Return ``sum n_i range_i^slope`` [unit^slope]; only ratios of it mean anything."""
    return float(np.sum(cycle_damage(count_cycles(values), slope)))


def damage_ratio(measured: ArrayLike, modelled: ArrayLike, slope: float = DEFAULT_SLOPE) -> float:
    """Return pseudo-damage of the model over that of the measurement; 1 is right, 2 means half the life."""
    reference = pseudo_damage(measured, slope)
    if reference == 0.0:
        raise InputDataError("the measured signal does no damage: a ratio is not defined")
    return pseudo_damage(modelled, slope) / reference


def damage_over_time(cycles: Cycles, rate_hz: float, samples: int, block_s: float, slope: float = DEFAULT_SLOPE) -> Array:
    """Return the share of each time block in the damage, shape (B,); the shares add up to one.

    Every cycle gives half of its damage to each of its two turning points, so a cycle between two bumps belongs to both.

    Parameters
    ----------
    cycles
        Of the whole signal.
    rate_hz
        Sample rate [Hz].
    samples
        Length of the signal.
    block_s
        Length of a block [s]; the last one may be shorter.
    """
    length = round(block_s * rate_hz)
    if not 1 <= length <= samples:
        raise InputDataError(f"blocks of {block_s:g} s do not fit a record of {samples / rate_hz:g} s")
    damage = cycle_damage(cycles, slope)
    share = np.zeros(-(-samples // length))
    np.add.at(share, cycles.start_index // length, 0.5 * damage)
    np.add.at(share, cycles.end_index // length, 0.5 * damage)
    total = float(np.sum(damage))
    return share / total if total > 0.0 else share


def equivalent_amplitude(damage: float, duration_s: float, slope: float = DEFAULT_SLOPE) -> float:
    """Return the amplitude of the sine of :data:`EQUIVALENT_RATE_HZ` that does the same damage in the same time.

    ``(D / (f T))^(1/slope) / 2`` [unit of the signal].
    """
    if not duration_s > 0.0:
        raise InputDataError(f"duration {duration_s:g} s must be positive")
    return float(0.5 * (damage / (EQUIVALENT_RATE_HZ * duration_s)) ** (1.0 / checked_slope(slope)))


@dataclasses.dataclass(frozen=True)
class Damage:
    """Pseudo-damage of one load signal.

    Attributes
    ----------
    value
        [unit^slope].
    lower, upper
        95 % interval from the uncertainty of the load; equal to ``value`` where none was given.
    equivalent_amplitude, equivalent_lower, equivalent_upper
        Of a 1 Hz sine with the same damage [unit].
    relative_std
        Standard deviation of the load over the rms of its dynamic part that the upper bound stands for, as the damage weighs it.
    largest_range
        Largest counted range [unit].
    slope
        Of the damage line.
    duration_s
        Of the signal [s].
    """

    value: float
    lower: float
    upper: float
    equivalent_amplitude: float
    equivalent_lower: float
    equivalent_upper: float
    relative_std: float
    largest_range: float
    slope: float
    duration_s: float

    @property
    def known(self) -> bool:
        """Return whether the load is known well enough for its damage to mean anything (lower bound above zero)."""
        return self.lower > 0.0


class DamageMeter:
    """Damage of a load whose samples arrive in chunks, with the uncertainty of the load carried into it.

    The standard deviation of the load is taken as that of one unknown factor on its dynamic part: a wrong stiffness, damping
    or mass. That is the kind of error that changes damage most, because it shifts all cycles the same way; errors that change
    from sample to sample average out, an offset changes no range. So the interval is on the safe side. How large the factor may
    be is told for every :data:`KNOWLEDGE_S` by itself, ``s = rms(std) / rms(load - mean)``: loads of the first seconds, before
    the parameters are known, do not spoil what is said about the rest. A cycle has the s of its two turning points, weighted by
    how far they are from the mean, and ``D = sum n (range (1 +- 2 s))^slope``; where that is as much as one s of a half does, the
    lower bound is zero. Where the load carries a weight and its standard
    deviation holds that of the weight, the share of the weight is an offset and is taken off:
    ``s^2 = max(mean(std^2) - (r mean)^2, (r rms)^2) / rms^2`` with the relative standard deviation r of the mass.

    Parameters
    ----------
    rate_hz
        Sample rate [Hz].
    mass_relative_std
        r [-].
    """

    def __init__(self, rate_hz: float, mass_relative_std: float = 0.0) -> None:
        if not rate_hz > 0.0:
            raise InputDataError(f"sample rate {rate_hz:g} Hz must be positive")
        self._rate = rate_hz
        self._mass_relative_std = mass_relative_std
        self._counter = RainflowCounter()
        self._length = max(round(KNOWLEDGE_S * rate_hz), 1)
        self._sums = np.zeros((3, 0))  # load, load^2, std^2 of every block
        self._origin = 0.0

    def feed(self, load: ArrayLike, std: ArrayLike | None = None) -> None:
        """Take in the next samples.

        Parameters
        ----------
        load
            Shape (N,), any unit.
        std
            Standard deviation of the load, shape (N,), or None for an exact load.

        Raises
        ------
        InputDataError
            Shapes that differ, or values that are not finite.
        """
        y = np.asarray(load, dtype=float).ravel()
        s = np.zeros_like(y) if std is None else np.asarray(std, dtype=float).ravel()
        if s.shape != y.shape or not np.all(np.isfinite(s)):
            raise InputDataError(f"standard deviation of a load: {s.size} finite values are needed for {y.size} samples")
        if not y.size:
            return
        first = self._counter.samples
        self._counter.feed(y)
        if first == 0:
            self._origin = float(y[0])
        moved = y - self._origin
        place = (first + np.arange(y.size)) // self._length
        self._sums = np.pad(self._sums, ((0, 0), (0, int(place[-1]) + 1 - self._sums.shape[1])))
        for sums, values in zip(self._sums, (moved, moved**2, s**2)):
            # added one by one, so that the sums do not depend on the chunks
            np.add.at(sums, place, values)

    @property
    def cycles(self) -> Cycles:
        """Return the cycles counted so far."""
        return self._counter.cycles()

    @property
    def samples(self) -> int:
        """Return the number of samples so far."""
        return self._counter.samples

    def damage(self, slope: float = DEFAULT_SLOPE) -> Damage:
        """Return the damage so far.

        Raises
        ------
        InputDataError
            Fewer than two samples, or a slope outside :data:`SLOPES`.
        """
        n = self.samples
        if n < 2:
            raise InputDataError(f"damage needs at least two samples; given {n}")
        cycles = self.cycles
        damage, relative = cycle_damage(cycles, slope), self._relative_std(cycles)
        duration = n / self._rate
        middle, low, high = (
            float(np.sum(damage * np.maximum(1.0 + times * relative, 0.0) ** slope)) for times in (0.0, -2.0, 2.0)
        )
        # the factor that the upper bound stands for; from a half on it may be the whole load that is not there
        factor = 0.5 * ((high / middle) ** (1.0 / slope) - 1.0) if middle > 0.0 else 0.0
        low = low if factor < 0.5 else 0.0
        return Damage(
            value=middle, lower=low, upper=high,
            equivalent_amplitude=equivalent_amplitude(middle, duration, slope),
            equivalent_lower=equivalent_amplitude(low, duration, slope),
            equivalent_upper=equivalent_amplitude(high, duration, slope),
            relative_std=factor, largest_range=float(np.max(cycles.ranges, initial=0.0)), slope=slope, duration_s=duration,
        )  # fmt: skip

    def _relative_std(self, cycles: Cycles) -> Array:
        """Return s of every cycle, shape (C,)."""
        n = self.samples
        whole = max(n // self._length, 1)
        # what is left over at the end is too short to tell the size of a load: it belongs to the block before
        sums = np.column_stack([self._sums[:, : whole - 1], self._sums[:, whole - 1 :].sum(axis=1)])
        counts = np.full(whole, float(self._length))
        counts[-1] = n - (whole - 1) * self._length
        load, square, spread = sums / counts
        mean = float(self._sums[0].sum()) / n
        variance = np.maximum(square - 2.0 * mean * load + mean**2, 0.0)
        weight, least = (self._mass_relative_std * (self._origin + mean)) ** 2, self._mass_relative_std**2 * variance
        dynamic = np.maximum(spread - weight, np.minimum(spread, least))
        s = np.sqrt(np.divide(dynamic, variance, out=np.zeros(whole), where=variance > 0.0))
        far = np.abs(np.array([cycles.start, cycles.end]) - (self._origin + mean))
        block = np.minimum(np.array([cycles.start_index, cycles.end_index]) // self._length, whole - 1)
        total = far.sum(axis=0)
        return np.asarray(np.divide((s[block] * far).sum(axis=0), total, out=np.zeros(total.shape), where=total > 0.0))


def assess_load(
    load: ArrayLike,
    rate_hz: float,
    std: ArrayLike | None = None,
    slope: float = DEFAULT_SLOPE,
    mass_relative_std: float = 0.0,
) -> Damage:
    """Return the damage of a whole load signal; see :class:`DamageMeter` for how its uncertainty is carried along."""
    meter = DamageMeter(rate_hz, mass_relative_std)
    meter.feed(load, std)
    return meter.damage(slope)
