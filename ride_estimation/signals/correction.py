# Copyright 2026 ride_estimation contributors
"""What is known to be wrong with the readings of a sensor: lateness, gain, bias; and how they are put right."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.frames import AXES

Array = NDArray[np.float64]

#: largest delay that is a correction and not another clock [s]
LONGEST_DELAY = 0.25


@dataclasses.dataclass(frozen=True)
class Correction:
    """Known errors of one sensor: ``reading(t) = gain * true(t - delay) + bias``.

    Readings are put right by ``true(stamp - delay) = (reading(stamp) - bias) / gain``: stamps move by whole nanoseconds, values
    are corrected on the common time base, which is the same because interpolation is linear in the values.

    Attributes
    ----------
    delay
        How late the values are behind their stamps [s]; negative where they are early.
    gain, bias
        Per channel, [-] and in the unit of the channel; channels beyond their length (angular rates of an IMU) are right.
        Empty where nothing is wrong.
    """

    delay: float = 0.0
    gain: tuple[float, ...] = ()
    bias: tuple[float, ...] = ()

    @property
    def delay_ns(self) -> int:
        """Return the delay in whole nanoseconds."""
        return round(self.delay * 1e9)

    @property
    def changes_values(self) -> bool:
        """Return whether values, not only stamps, are corrected."""
        return any(g != 1.0 for g in self.gain) or any(b != 0.0 for b in self.bias)

    @property
    def empty(self) -> bool:
        """Return whether there is nothing to correct."""
        return self.delay == 0.0 and not self.changes_values

    def gains(self, channels: int) -> Array:
        """Return the gain of every channel, shape (channels,)."""
        return _padded(self.gain, 1.0, channels)

    def biases(self, channels: int) -> Array:
        """Return the bias of every channel, shape (channels,)."""
        return _padded(self.bias, 0.0, channels)

    def apply(self, readings: Array) -> Array:
        """Return corrected values of readings, shape (N, C)."""
        if not self.changes_values:
            return readings
        channels = readings.shape[1]
        return np.asarray((readings - self.biases(channels)) / self.gains(channels), dtype=float)

    def reading(self, values: Array) -> Array:
        """Return what the sensor shows for true values, shape (N, C); the other way round."""
        if not self.changes_values:
            return values
        channels = values.shape[1]
        return np.asarray(values * self.gains(channels) + self.biases(channels), dtype=float)

    def and_then(self, found: Correction, channels: int) -> Correction:
        """Return the correction of raw readings when ``found`` was found on readings this one had corrected already."""
        gain = self.gains(channels) * found.gains(channels)
        bias = self.biases(channels) + self.gains(channels) * found.biases(channels)
        values = bool(np.any(gain != 1.0) or np.any(bias != 0.0))
        return Correction(
            self.delay + found.delay, tuple(gain.tolist()) if values else (), tuple(bias.tolist()) if values else ()
        )

    def only(self, axes: Sequence[str]) -> Correction:
        """Return the correction with gain and bias of the axes x, y, z that are measured; the others read nothing."""
        if not self.changes_values or len(axes) == len(AXES):
            return self
        measured = [axis in axes for axis in AXES]
        gain = tuple(g if m else 1.0 for g, m in zip(self.gains(len(AXES)).tolist(), measured))
        return Correction(
            self.delay, gain, tuple(b if m else 0.0 for b, m in zip(self.biases(len(AXES)).tolist(), measured))
        )

    def reach(self, full_scale: float) -> float:
        """Return the smallest magnitude of a corrected value at which a reading may be cut at full scale."""
        channels = max(len(self.gain), len(self.bias), 1)
        return float(np.min((full_scale - np.abs(self.biases(channels))) / self.gains(channels)))


def _padded(values: tuple[float, ...], fill: float, channels: int) -> Array:
    out = np.full(channels, fill)
    out[: len(values)] = values[:channels]
    return out


NO_CORRECTION = Correction()
