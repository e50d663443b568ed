# Copyright 2026 ride_estimation contributors
"""The sigmoid chirp: a sine whose frequency rises while its amplitude falls, for one short bench test of a bushing."""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError

Array = NDArray[np.float64]

STEPPED, INTEGRAL = "stepped", "integral"


@dataclasses.dataclass(frozen=True)
class SigmoidChirp:
    """Sigmoid chirp of document 003, Table 2.

    ``A(t) = A_min + (A_max - A_min) erfc((t - tau) / lambda) / 2``,
    ``f(t) = (f_max - f_min) sinh(F_r t) / sinh(F_r T) + f_min``.

    Two constructions: ``stepped`` keeps the frequency constant over each half period (as the document did, with small jumps
    of the rate at the joints); ``integral`` is ``A sin(2 pi integral f dt)``, smooth. The formula as printed,
    ``A sin(2 pi f(t) t)``, is refused: its momentary frequency ``f + t f'`` ends at 488 Hz instead of 40 Hz.

    Attributes
    ----------
    amplitude_max, amplitude_min
        [m].
    centre_s, width_s
        tau and lambda of the amplitude [s].
    frequency_min, frequency_max
        [Hz].
    growth
        F_r [1/s].
    duration_s
        T [s].

    Notes
    -----
    Source: document 003 eq. (27)-(29), Table 2. A_min is not reached: A(T) is 2.17 times as large.
    """

    amplitude_max: float = 10.0e-3
    amplitude_min: float = 0.02e-3
    centre_s: float = 135.48
    width_s: float = 32.26
    frequency_min: float = 0.015
    frequency_max: float = 40.0
    growth: float = 0.056
    duration_s: float = 200.0

    def __post_init__(self) -> None:
        problems = [
            f"{f.name}: {getattr(self, f.name)!r} must be a positive finite number"
            for f in dataclasses.fields(self)
            if not (np.isfinite(getattr(self, f.name)) and getattr(self, f.name) > 0.0)
        ]
        if self.frequency_max < self.frequency_min:
            problems.append(f"frequency_max: {self.frequency_max:g} Hz is below frequency_min, {self.frequency_min:g} Hz")
        if self.amplitude_max < self.amplitude_min:
            problems.append(f"amplitude_max: {self.amplitude_max:g} m is below amplitude_min, {self.amplitude_min:g} m")
        if problems:
            raise ConfigurationError(problems, where="sigmoid chirp")

    def amplitude(self, time_s: Array) -> Array:
        """Return A(t) [m]."""
        share = 0.5 * scipy.special.erfc((np.asarray(time_s) - self.centre_s) / self.width_s)
        return np.asarray(self.amplitude_min + (self.amplitude_max - self.amplitude_min) * share)

    def frequency(self, time_s: Array) -> Array:
        """Return f(t) [Hz]."""
        rise = np.sinh(self.growth * np.asarray(time_s)) / np.sinh(self.growth * self.duration_s)
        return np.asarray((self.frequency_max - self.frequency_min) * rise + self.frequency_min)

    def half_cycles(self) -> tuple[Array, Array]:
        """Return start [s] and frequency [Hz] of the half periods of the stepped construction; each lasts ``0.5 / f``."""
        starts, frequencies = [], []
        t = 0.0
        while t < self.duration_s:
            f = float(self.frequency(np.array(t)))
            starts.append(t)
            frequencies.append(f)
            t += 0.5 / f
        return np.array(starts), np.array(frequencies)

    def cycles(self, time_s: Array, construction: str = STEPPED) -> Array:
        """Return the phase in cycles at some times.

        Raises
        ------
        ConfigurationError
            Another construction than ``stepped`` or ``integral``.
        """
        time_s = np.asarray(time_s, dtype=float)
        if construction == INTEGRAL:
            area = (np.cosh(self.growth * time_s) - 1.0) / (self.growth * np.sinh(self.growth * self.duration_s))
            return np.asarray((self.frequency_max - self.frequency_min) * area + self.frequency_min * time_s)
        if construction == STEPPED:
            starts, frequencies = self.half_cycles()
            k = np.clip(np.searchsorted(starts, time_s, side="right") - 1, 0, None)
            return np.asarray(0.5 * k + frequencies[k] * (time_s - starts[k]))
        raise ConfigurationError(
            f"construction: {construction!r} is not allowed; allowed: {STEPPED}, {INTEGRAL} (the printed formula "
            "A sin(2 pi f(t) t) sweeps to 488 Hz and is not offered)",
            where="sigmoid chirp",
        )

    def signal(self, rate_hz: float, construction: str = STEPPED) -> tuple[Array, Array]:
        """Return times [s] and deflection [m], both ends included, shape (T rate + 1,)."""
        if not rate_hz > 2.0 * self.frequency_max:
            raise ConfigurationError(
                f"rate_hz: {rate_hz:g} Hz is not above twice the highest frequency of {self.frequency_max:g} Hz",
                where="sigmoid chirp",
            )
        time_s = np.arange(round(self.duration_s * rate_hz) + 1) / rate_hz
        return time_s, self.amplitude(time_s) * np.sin(2.0 * np.pi * self.cycles(time_s, construction))
