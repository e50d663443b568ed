# Copyright 2026 ride_estimation contributors
"""Spectral lines of a residual and the phase of a line that wanders."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.signal import medfilt

from ride_estimation.diagnosis.runs.run_view import RunView

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_PARTS = 8  # of a run, whose frequencies are compared
_PEAK_OVER_MEDIAN = 12.0  # chi-square of 24 degrees of freedom exceeds 12 x its median with probability below 1e-40


@dataclasses.dataclass(frozen=True)
class Line:
    """A narrow peak of the whitened residual.

    Attributes
    ----------
    half_width_hz
        Half of the band that holds the line with its wander.
    ratio
        Peak over the local median.
    """

    frequency_hz: float
    half_width_hz: float
    ratio: float


def white_spectrum(view: RunView) -> ComplexArray:
    """Return the whitened spectrum of the residual inside the analysed stretch, shape (F, ny)."""
    return np.asarray(np.einsum("fij,fj->fi", view.noise.whitener, view.data.inside(view.residual_spectrum)))


def residual_lines(view: RunView, count: int = 2, least_ratio: float = _PEAK_OVER_MEDIAN) -> list[Line]:
    """Return the strongest lines of a view's residual, strongest first."""
    power = np.sum(np.abs(white_spectrum(view)) ** 2, axis=1) / view.grid.samples
    step = view.grid.rate_hz / view.grid.padded
    inside = view.grid.band_weight > 0.5
    width = round(2.0 / step) | 1
    floor = np.maximum(medfilt(power, width), 0.3 * float(np.median(power[inside])) + 1e-12)
    ratio = np.where(inside, power / floor, 0.0)
    out: list[Line] = []
    for _ in range(count):
        peak = int(np.argmax(ratio))
        if ratio[peak] < least_ratio:
            break
        high = ratio > max(0.02 * ratio[peak], 6.0)
        low = up = peak
        reach = round(0.8 / step)
        near = [i for i in range(max(peak - reach, 0), min(peak + reach, len(high) - 1)) if high[i]]
        low, up = min(near), max(near)
        half = max(0.5 * (up - low) * step, 2.0 * step)
        out.append(Line(float(view.grid.frequency[peak]), float(min(half, 0.8)), float(ratio[peak])))
        ratio[max(low - reach // 2, 0) : up + reach // 2] = 0.0
    return out


def tracked_phase(view: RunView, line: Line) -> Array:
    """Return the phase of a line through the run [rad], shape (N,).

    The residual around the line is projected on its strongest pattern over the channels, demodulated and unwrapped.
    """
    white = np.einsum("fij,fj->fi", view.noise.whitener, view.residual_spectrum)
    f = view.grid.frequency
    reach = 1.5 * line.half_width_hz + 2.0 * view.grid.rate_hz / view.grid.padded
    gate = np.where(np.abs(f - line.frequency_hz) < reach, 1.0, 0.0)
    part = white * gate[:, None]
    _, vectors = np.linalg.eigh(np.conj(part.T) @ part)
    pattern = part @ vectors[:, -1]
    full = np.zeros(view.grid.padded, dtype=complex)
    full[view.grid.first : view.grid.last] = pattern
    analytic = np.fft.ifft(full)[: view.grid.samples]
    return np.asarray(np.unwrap(np.angle(analytic)))


def mean_frequency(phase: Array, view: RunView) -> tuple[float, float]:
    """Return the mean frequency of a phase over the run and its standard deviation [Hz], without the faded ends.

    The standard deviation is that of the mean of parts of the run whose frequencies scatter: no machine turns at one speed.
    """
    trim = round(view.settings.trim_s * view.grid.rate_hz)
    edges = np.linspace(trim, len(phase) - 1 - trim, _PARTS + 1).round().astype(int)
    cycles, seconds = phase[edges] / (2.0 * np.pi), view.data.time_s[edges]
    scatter = float(np.std(np.diff(cycles) / np.diff(seconds), ddof=1)) / _PARTS**0.5
    return float((cycles[-1] - cycles[0]) / (seconds[-1] - seconds[0])), scatter
