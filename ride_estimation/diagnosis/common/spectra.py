# Copyright 2026 ride_estimation contributors
"""One frequency grid for a whole run: zero-phase band limits, differentiation and decimation without a filter's lag."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FADE_S = 1.0  # length of the fading at both ends of a run [s]
_LAW_RATE = 5.0  # rate at which laws are evaluated over the upper edge of the band, at least


@dataclasses.dataclass(frozen=True)
class FrequencyGrid:
    """Frequencies of a run of ``samples`` values, padded to ``padded`` values.

    Attributes
    ----------
    first, last
        Half-open range of kept bins.
    decimated
        Length of a decimated time signal that still holds the kept bins.
    """

    samples: int
    rate_hz: float
    padded: int
    first: int
    last: int
    decimated: int
    lower_hz: float
    upper_hz: float

    @property
    def frequency(self) -> Array:
        """Return the kept frequencies [Hz], shape (F,)."""
        return np.asarray(np.arange(self.first, self.last) * (self.rate_hz / self.padded), dtype=float)

    @property
    def omega(self) -> Array:
        """Return the kept angular frequencies [rad/s], shape (F,)."""
        return 2.0 * np.pi * self.frequency

    @property
    def duration_s(self) -> float:
        """Return the duration of the run [s]."""
        return self.samples / self.rate_hz

    @property
    def decimated_rate_hz(self) -> float:
        """Return the rate of decimated signals [Hz]."""
        return self.rate_hz * self.decimated / self.padded

    @property
    def band_weight(self) -> Array:
        """Return the zero-phase band gain, one inside the band with half-cosine flanks, shape (F,)."""
        f = self.frequency
        high = np.clip((1.08 * self.upper_hz - f) / (0.08 * self.upper_hz), 0.0, 1.0)
        return np.asarray(self.low_flank * np.sin(0.5 * np.pi * high))

    @property
    def low_flank(self) -> Array:
        """Return the lower flank of the band alone, shape (F,)."""
        low = np.clip((self.frequency - 0.8 * self.lower_hz) / (0.4 * self.lower_hz), 0.0, 1.0)
        return np.asarray(np.sin(0.5 * np.pi * low))

    def spectrum(self, signal: Array) -> ComplexArray:
        """Return the kept bins of real signals, time along axis 0, shape (F, ...)."""
        return np.asarray(rfft(signal, n=self.padded, axis=0)[self.first : self.last])

    def signal(self, spectrum: ComplexArray) -> Array:
        """Return the full-rate signals of kept bins, shape (samples, ...)."""
        full = np.zeros((self.padded // 2 + 1, *spectrum.shape[1:]), dtype=complex)
        full[self.first : self.last] = spectrum
        return np.asarray(irfft(full, n=self.padded, axis=0)[: self.samples])

    def below(self, signal: Array, flank: bool) -> Array:
        """Return what real signals hold below the kept bins, where ``flank`` below the band, shape (samples, q)."""
        full = rfft(signal, n=self.padded, axis=0)
        full[self.first : self.last] *= (1.0 - self.low_flank)[:, None] if flank else 0.0
        full[self.last :] = 0.0
        return np.asarray(irfft(full, n=self.padded, axis=0)[: self.samples])

    @property
    def refinement(self) -> int:
        """Return by how many times the sample rate laws are evaluated.

        A force that jumps has overtones. What a law makes of samples folds those beyond half their rate back: in a run of 100
        samples per second, those from 60 Hz on into a band up to 40 Hz. A recorder filters them out before it samples.
        """
        return max(1, int(np.ceil(_LAW_RATE * self.upper_hz / self.rate_hz - 1e-9)))

    def refined(self, spectrum: ComplexArray) -> Array:
        """Return the signals of kept bins at ``refinement`` times the rate, shape (refinement * samples, ...)."""
        times = self.refinement
        full = np.zeros((times * self.padded // 2 + 1, *spectrum.shape[1:]), dtype=complex)
        full[self.first : self.last] = times * spectrum
        return np.asarray(irfft(full, n=times * self.padded, axis=0)[: times * self.samples])

    def unrefined(self, signal: Array) -> Array:
        """Return signals at ``refinement`` times the rate without what lies above the kept bins, shape (samples, ...).

        What lies below them stays: a body leans on the force that a law holds there.
        """
        times = self.refinement
        spectrum = rfft(signal, n=times * self.padded, axis=0)[: self.last] / times
        full = np.zeros((self.padded // 2 + 1, *spectrum.shape[1:]), dtype=complex)
        full[: self.last] = spectrum
        return np.asarray(irfft(full, n=self.padded, axis=0)[: self.samples])

    def filtered(self, signal: Array, response: ComplexArray) -> Array:
        """Return a signal at the sample rate, or at ``refinement`` times it, through a response (F,) at the kept bins."""
        times = self.refinement if len(signal) > self.samples else 1
        spectrum = response * rfft(signal, n=times * self.padded)[self.first : self.last] / times
        return self.refined(spectrum) if times > 1 else self.signal(spectrum)

    def decimated_signal(self, spectrum: NDArray[Any]) -> Array:
        """Return decimated signals scaled so that unit white noise in the kept band has one unit per degree of freedom."""
        full = np.zeros((self.decimated // 2 + 1, *spectrum.shape[1:]), dtype=spectrum.dtype)
        full[self.first : self.last] = spectrum
        signal = irfft(full, n=self.decimated, axis=0, overwrite_x=True)
        signal *= np.sqrt(self.decimated / self.padded)
        return np.asarray(signal)


def make_grid(samples: int, rate_hz: float, band_hz: tuple[float, float]) -> FrequencyGrid:
    """Return the grid of a run.

    Parameters
    ----------
    samples
        Length of the run.
    rate_hz
        Sample rate [Hz].
    band_hz
        Analysis band; the upper edge is cut at 0.42 of the rate.
    """
    upper = min(band_hz[1], 0.42 * rate_hz)
    padded = next_fast_len(samples + round(4.0 * rate_hz), real=True)
    padded += padded % 2
    step = rate_hz / padded
    first = max(1, int(np.ceil(0.45 * band_hz[0] / step)))
    last = min(padded // 2, int(np.floor(1.08 * upper / step)) + 1)
    decimated = min(padded, next_fast_len(2 * last + 2, real=True))
    decimated += decimated % 2
    return FrequencyGrid(samples, rate_hz, padded, first, last, min(decimated, padded), band_hz[0], upper)


def edge_taper(samples: int, rate_hz: float, length_s: float = FADE_S) -> Array:
    """Return a window of ones with half-cosine ends of ``length_s`` seconds, shape (samples,)."""
    count = min(round(length_s * rate_hz), samples // 4)
    ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(count) + 0.5) / max(count, 1))
    window = np.ones(samples)
    window[:count] = ramp
    window[samples - count :] = ramp[::-1]
    return window
