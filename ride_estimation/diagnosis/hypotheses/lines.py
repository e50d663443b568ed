# Copyright 2026 ride_estimation contributors
"""Spectral lines of a residual over time and over the distance driven, and the phase of a line that wanders."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.signal import medfilt
from scipy.stats import chi2

from ride_estimation.diagnosis.runs.run_view import RunView

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_PARTS = 8  # of a run, whose frequencies are compared
_STEADY = 0.02  # relative standard deviation of a speed up to which orders are lines
_SLOWEST = 0.3  # share of the mean speed below which distance goes on as at that share: standing still makes no cycles
_CHANCE = 1e-4  # probability that noise has a line over the distance
_AROUND = 20  # trials on either side of a peak of the order spectrum, over one line of it
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
    ratio = _over_floor(power, inside, width)
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


def _over_floor(power: Array, inside: NDArray[np.bool_], width: int) -> Array:
    """Return a spectrum over its median within so many bins, zero where it is not inside, shape (F,)."""
    floor = np.maximum(medfilt(power, width), 0.3 * float(np.median(power[inside])) + 1e-12)
    return np.where(inside, power / floor, 0.0)


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


@dataclasses.dataclass(frozen=True)
class Order:
    """A line of the whitened residual over the distance driven: something that turns with the wheels or the drive.

    Attributes
    ----------
    cycles_per_m, std
        How often it turns, and the standard deviation of that [1/m].
    phase
        Through the run [rad], shape (N,).
    """

    cycles_per_m: float
    std: float
    phase: Array


def residual_orders(view: RunView, count: int = 2) -> list[Order]:
    """Return the strongest orders of a view's residual, strongest first; none where the speed is not measured or hardly changes.

    Order analysis: the residual at equal steps of the distance, ``r(s) / v``, has a line where ``r(t)`` sweeps with the speed.
    """
    speed, grid = view.data.measured.speed, view.grid
    if speed is None:
        return []
    inside = np.flatnonzero(view.data.analysed_samples)
    mean = float(np.mean(speed[inside]))
    if mean <= 0.0 or float(np.std(speed[inside])) < _STEADY * mean:
        return []
    moving = np.maximum(speed, _SLOWEST * mean)
    distance = np.cumsum(moving) / grid.rate_hz
    residual = grid.signal(white_spectrum(view))
    step = float(moving[inside].min()) / (2.5 * grid.upper_hz)
    place = np.arange(distance[inside[0]], distance[inside[-1]], step)
    slowness = 1.0 / np.interp(place, distance, moving)
    rows = np.stack([np.interp(place, distance, channel) * slowness for channel in residual.T], axis=1)
    power = np.sum(np.abs(np.fft.rfft(rows, axis=0)) ** 2, axis=1)
    cycles = np.fft.rfftfreq(len(place), step)
    line = cycles[1]
    # an order that the band holds at the mean speed
    allowed = (cycles * mean > view.settings.band_hz[0]) & (cycles * mean < grid.upper_hz)
    width = max(round(2.0 / mean / line), 10) | 1
    ratio = _over_floor(power, allowed, width)
    # of few channels noise alone has peaks
    freedom = 2 * rows.shape[1]
    chance = chi2.isf(_CHANCE / len(cycles), freedom) / chi2.median(freedom)
    out: list[Order] = []
    for _ in range(count):
        peak = int(np.argmax(ratio))
        if ratio[peak] < max(_PEAK_OVER_MEDIAN, chance):
            break
        near = cycles[peak] + line * np.arange(-_AROUND, _AROUND + 1) / _AROUND
        found = np.abs(np.exp(-2j * np.pi * np.outer(near, place)) @ rows) ** 2
        best = float(near[int(np.argmax(found.sum(axis=1)))])
        out.append(Order(best, line / _AROUND, 2.0 * np.pi * best * distance))
        ratio[max(peak - _AROUND, 0) : peak + _AROUND] = 0.0
    return out
