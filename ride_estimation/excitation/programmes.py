# Copyright 2026 ride_estimation contributors
"""Bench programmes: harmonic (DMA) plan, validation signals of bushings."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class HarmonicTest:
    """One steady harmonic test: frequency [Hz], amplitude [m], cycles."""

    frequency_hz: float
    amplitude_m: float
    cycles: int

    @property
    def duration_s(self) -> float:
        """Return the duration [s]."""
        return self.cycles / self.frequency_hz

    @property
    def peak_speed(self) -> float:
        """Return the largest rate [m/s]."""
        return 2.0 * np.pi * self.frequency_hz * self.amplitude_m

    def signal(self, points_per_cycle: int = 500) -> tuple[Array, Array]:
        """Return times [s] and deflection [m] at a fixed number of points per cycle; evaluate the last cycles only."""
        time_s = np.arange(self.cycles * points_per_cycle + 1) / (self.frequency_hz * points_per_cycle)
        return time_s, self.amplitude_m * np.sin(2.0 * np.pi * self.frequency_hz * time_s)


def dma_plan(
    smallest_m: float = 0.02e-3, largest_m: float = 10.24e-3, lowest_hz: float = 0.04, highest_hz: float = 40.0,
    amplitudes: int = 10, frequencies: int = 11, cycles: int = 6,
) -> tuple[HarmonicTest, ...]:
    """Return a triangular plan of harmonic tests: large strokes only slowly, fast tests only with small strokes.

    Amplitudes A_i and frequencies f_j on logarithmic grids; kept are ``i + j <= frequencies - 1`` with ``i + j`` even, which
    for the grids of document 003 gives its 35 tests in 1453 s with at most 5.13 mm/s. The document states the grids and the
    number 35, not which pairs; this plan is a reconstruction.

    Returns
    -------
    tuple
        In order of rising frequency, large strokes first (preconditioning effects fade from large to small).

    Notes
    -----
    Source: document 003, Section 3.1.1.
    """
    if amplitudes < 2 or frequencies < 2 or cycles < 2:
        raise ConfigurationError("dma plan: at least 2 amplitudes, 2 frequencies and 2 cycles are needed")
    strokes = smallest_m * (largest_m / smallest_m) ** (np.arange(amplitudes) / (amplitudes - 1))
    rates = lowest_hz * (highest_hz / lowest_hz) ** (np.arange(frequencies) / (frequencies - 1))
    return tuple(
        HarmonicTest(float(rates[j]), float(strokes[i]), cycles)
        for j in range(frequencies)
        for i in reversed(range(amplitudes))
        if i + j <= frequencies - 1 and (i + j) % 2 == 0
    )


def preconditioning(plan: tuple[HarmonicTest, ...], excess: float = 0.1, cycles: int = 3) -> HarmonicTest:
    """Return the test to run before a plan: slow, ``excess`` above its largest amplitude, against the Mullins effect."""
    largest = max(plan, key=lambda test: test.amplitude_m)
    slowest = min(test.frequency_hz for test in plan)
    return HarmonicTest(slowest, (1.0 + excess) * largest.amplitude_m, cycles)


def band_limited_random(
    rms_m: float, lowest_hz: float, highest_hz: float, duration_s: float, rate_hz: float, seed: int
) -> tuple[Array, Array]:
    """Return times [s] and a stationary Gaussian deflection [m] with a flat spectrum in a band, faded in and out.

    Parameters
    ----------
    rms_m
        Root mean square before fading [m].
    lowest_hz, highest_hz
        Band [Hz]; at most half the rate.
    duration_s, rate_hz
        [s], [Hz].
    seed
        Of the phases and amplitudes.
    """
    if not 0.0 < lowest_hz < highest_hz <= 0.5 * rate_hz:
        raise ConfigurationError(f"band {lowest_hz:g} to {highest_hz:g} Hz must rise within 0 to {0.5 * rate_hz:g} Hz")
    n = round(duration_s * rate_hz)
    frequencies = np.fft.rfftfreq(n, 1.0 / rate_hz)
    inside = (frequencies >= lowest_hz) & (frequencies <= highest_hz)
    if not np.any(inside):
        raise ConfigurationError(f"{duration_s:g} s are too short for a line between {lowest_hz:g} and {highest_hz:g} Hz")
    rng = np.random.default_rng(seed)
    spectrum = np.zeros(frequencies.size, dtype=complex)
    spectrum[inside] = rng.standard_normal(inside.sum()) + 1j * rng.standard_normal(inside.sum())
    signal = np.fft.irfft(spectrum, n)
    signal *= rms_m / np.sqrt(np.mean(signal**2))
    fade = min(n // 10, round(rate_hz / lowest_hz))
    window = np.ones(n)
    if fade > 0:
        ramp = 0.5 - 0.5 * np.cos(np.pi * np.arange(fade) / fade)
        window[:fade], window[n - fade :] = ramp, ramp[::-1]
    return np.arange(n) / rate_hz, signal * window


def harmonic_pulse(
    peak_m: float = 5e-3, frequency_hz: float = 2.0, cycles: int = 4, rest_s: float = 1.0, rate_hz: float = 1000.0
) -> tuple[Array, Array]:
    """Return times [s] and a sine under a Hann window [m] between two rests."""
    duration = cycles / frequency_hz
    time_s = np.arange(round((duration + 2.0 * rest_s) * rate_hz) + 1) / rate_hz
    inside = time_s - rest_s
    active = (inside >= 0.0) & (inside <= duration)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * inside / duration)
    return time_s, np.where(active, peak_m * window * np.sin(2.0 * np.pi * frequency_hz * inside), 0.0)


def validation_signals(seed: int, rate_hz: float = 1000.0, duration_s: float = 60.0) -> dict[str, tuple[Array, Array]]:
    """Return the validation deflections V1, V2 (two stationary random ones) and V3 (harmonic pulse) by name.

    V1 0.5-10 Hz with 1 mm rms, V2 1-30 Hz with 0.25 mm rms, V3 5 mm under a Hann window at 2 Hz. Document 003 describes the
    kind of signal only; bands and sizes are this project's.
    """
    return {
        "V1": band_limited_random(1e-3, 0.5, 10.0, duration_s, rate_hz, seed),
        "V2": band_limited_random(0.25e-3, 1.0, 30.0, duration_s, rate_hz, seed + 1),
        "V3": harmonic_pulse(rate_hz=rate_hz),
    }
