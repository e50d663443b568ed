# Copyright 2026 ride_estimation contributors
"""How well a sensor is installed: one standard deviation per kind of error."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence


@dataclasses.dataclass(frozen=True)
class Installation:
    """One-sigma errors of one installed sensor, the prior of its columns in every reading.

    The values are what workshop practice reaches: zeroing on a level floor and the drift with temperature since then (bias,
    2 mg), a calibration certificate (gain, usually 0.5 to 1 % for two standard deviations), a machined pad and a square
    (misalignment, 0.2 degrees), a tape measure (position), one clock for converters that read their channels one after the other
    (delay, anywhere within 0.3 ms: 0.3 / sqrt 3), zeroing at rest (travel_zero).

    Attributes
    ----------
    bias
        Zero error of one axis [m/s^2].
    gain
        Relative error of one axis [-].
    misalignment
        Rotation about one sensor axis [rad].
    position
        Along one axis of the body [m].
    delay
        How late the readings are [s].
    travel_zero
        Zero of a displacement transducer [m].
    """

    bias: float = 0.02
    gain: float = 0.003
    misalignment: float = 0.004
    position: float = 0.004
    delay: float = 1.7e-4
    travel_zero: float = 0.001

    @property
    def cross_sensitivity(self) -> float:
        """Share of an acceleration that an axis reads wrongly, ``hypot(gain, misalignment)``."""
        return math.hypot(self.gain, self.misalignment)

    def offset(self, gravity: float) -> float:
        """Return the standard deviation of the mean reading of an axis at rest, bias and misalignment under gravity [m/s^2]."""
        return math.hypot(self.bias, self.misalignment * gravity)

    def at_least(self, other: Installation) -> Installation:
        """Return the larger standard deviation of every kind."""
        return Installation(**{f: max(value, getattr(other, f)) for f, value in dataclasses.asdict(self).items()})


USUAL = Installation()


def pooled(installations: Sequence[Installation]) -> Installation:
    """Return the root mean square of every kind over several sensors, the usual installation where there are none."""
    if not installations:
        return USUAL
    names = [f.name for f in dataclasses.fields(Installation)]
    return Installation(**{n: math.sqrt(sum(getattr(i, n) ** 2 for i in installations) / len(installations)) for n in names})
