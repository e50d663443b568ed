# Copyright 2026 ride_estimation contributors
"""Welch spectra that state their true resolution, transfer functions with coherence, and spectral lines."""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

HANN_ENBW_BINS = 1.5  # equivalent noise bandwidth of a Hann window, in bins


@dataclasses.dataclass(frozen=True)
class Spectrum:
    """One-sided power spectral density with the numbers a reader needs to trust it.

    Attributes
    ----------
    frequency_hz
        Shape (F,).
    density
        [unit^2/Hz], shape (F,).
    resolution_hz
        Line spacing fs / N.
    bandwidth_hz
        Equivalent noise bandwidth, 1.5 line spacings for a Hann window.
    averages
        Number of half-overlapping blocks.
    """

    frequency_hz: Array
    density: Array
    resolution_hz: float
    bandwidth_hz: float
    averages: int

    def describe(self) -> str:
        """Return the resolution statement that belongs beside every plot."""
        return (
            f"resolution {self.resolution_hz:.4g} Hz, noise bandwidth {self.bandwidth_hz:.4g} Hz (Hann), "
            f"{self.averages} averages at 50 % overlap"
        )


def _block(rate_hz: float, block: int, samples: int) -> None:
    if not rate_hz > 0.0:
        raise InputDataError(f"sample rate {rate_hz:g} Hz must be positive")
    if not 8 <= block <= samples:
        raise InputDataError(f"block of {block} samples is not possible; allowed: 8 to the {samples} samples given")


def welch_spectrum(
    values: ArrayLike, rate_hz: float, block: int, claimed_resolution_hz: float | None = None
) -> Spectrum:
    """Estimate a power spectral density by Welch's method, Hann window, 50 % overlap.

    Source: document 001 section 4.

    Parameters
    ----------
    values
        Signal, shape (N,).
    rate_hz
        Sample rate [Hz].
    block
        Samples per block; the resolution is ``rate_hz / block``.
    claimed_resolution_hz
        Resolution somebody states for this spectrum; refused unless it is the true one within 1 %.

    Raises
    ------
    InputDataError
        Impossible block, values that are not finite, or a claimed resolution that does not match.
    """
    y = np.asarray(values, dtype=float).ravel()
    _block(rate_hz, block, y.size)
    if not np.all(np.isfinite(y)):
        raise InputDataError("the signal contains values that are not finite")
    resolution = rate_hz / block
    if claimed_resolution_hz is not None and abs(claimed_resolution_hz / resolution - 1.0) > 0.01:
        raise InputDataError(
            f"claimed resolution {claimed_resolution_hz:g} Hz does not match {rate_hz:g} Hz / {block} samples = "
            f"{resolution:.4g} Hz; it needs blocks of {round(rate_hz / claimed_resolution_hz)} samples"
        )
    frequency, density = scipy.signal.welch(y, rate_hz, window="hann", nperseg=block, noverlap=block // 2, detrend="constant")
    averages = 1 + (y.size - block) // (block - block // 2)
    return Spectrum(frequency, density, resolution, HANN_ENBW_BINS * resolution, averages)


@dataclasses.dataclass(frozen=True)
class TransferFunction:
    """H1 estimate with coherence.

    Attributes
    ----------
    frequency_hz, h1, coherence
        Shape (F,); ``h1`` is output over input, complex.
    averages
        Number of half-overlapping blocks.
    """

    frequency_hz: Array
    h1: ComplexArray
    coherence: Array
    averages: int


def transfer_function(x: ArrayLike, y: ArrayLike, rate_hz: float, block: int) -> TransferFunction:
    """Estimate ``H1 = S_xy / S_xx`` and the ordinary coherence from input ``x`` and output ``y``, shape (N,) each."""
    a, b = np.asarray(x, dtype=float).ravel(), np.asarray(y, dtype=float).ravel()
    if a.size != b.size:
        raise InputDataError(f"input has {a.size} samples, output {b.size}: they must be equal")
    _block(rate_hz, block, a.size)
    options = {"fs": rate_hz, "window": "hann", "nperseg": block, "noverlap": block // 2}
    frequency, cross = scipy.signal.csd(a, b, **options)
    auto = scipy.signal.welch(a, **options)[1]
    coherence = scipy.signal.coherence(a, b, **options)[1]
    floor = np.finfo(float).tiny
    averages = 1 + (a.size - block) // (block - block // 2)
    return TransferFunction(frequency, cross / np.maximum(auto, floor), np.nan_to_num(coherence), averages)


@dataclasses.dataclass(frozen=True)
class Peak:
    """A spectral peak and what explains it: ``mode``, ``input`` or ``unexplained``."""

    frequency_hz: float
    label: str
    explained_by: str


def label_peaks(
    output: Spectrum, excitation: Spectrum, mode_frequencies_hz: ArrayLike, prominence: float = 4.0
) -> tuple[Peak, ...]:
    """Label each peak of an output spectrum as input line or mode.

    A peak at a line of the excitation that is no mode is ``input``: document 001 read input peaks at 1.6 and 2.4 Hz as
    properties of the machine.

    Parameters
    ----------
    output, excitation
        Spectra on the same frequency grid.
    mode_frequencies_hz
        Natural frequencies of the model [Hz].
    prominence
        Ratio of a peak to the median of its neighbourhood (one octave) from which it counts.
    """
    if output.frequency_hz.shape != excitation.frequency_hz.shape:
        raise InputDataError("output and excitation spectra must share their frequencies")
    modes = np.asarray(mode_frequencies_hz, dtype=float)
    reach = output.bandwidth_hz
    lines = _peak_frequencies(excitation, prominence)
    found = []
    for f in _peak_frequencies(output, prominence):
        near_mode = modes[np.abs(modes - f) <= np.maximum(reach, 0.05 * modes)]
        near_line = lines[np.abs(lines - f) <= reach]
        if near_mode.size:
            found.append(Peak(float(f), "mode", f"natural frequency {near_mode[0]:.3g} Hz"))
        elif near_line.size:
            found.append(Peak(float(f), "input", f"line of the excitation at {near_line[0]:.3g} Hz"))
        else:
            found.append(Peak(float(f), "unexplained", "neither a mode of the model nor a line of the excitation"))
    return tuple(found)


def _peak_frequencies(spectrum: Spectrum, prominence: float) -> Array:
    density = spectrum.density
    index, _ = scipy.signal.find_peaks(density)
    keep = []
    for i in index:
        lower, upper = np.searchsorted(spectrum.frequency_hz, spectrum.frequency_hz[i] * np.array([0.71, 1.41]))
        neighbourhood = density[max(lower, 1) : max(upper, lower + 3)]
        if density[i] >= prominence * np.median(neighbourhood):
            keep.append(i)
    return np.asarray(spectrum.frequency_hz[np.array(keep, dtype=int)])


def spectrum_correlation(measured: ArrayLike, modelled: ArrayLike, rate_hz: float, block: int) -> float:
    """Return Pearson's r of two Welch amplitude spectra, the score document 000 uses.

    It is printed beside time-domain scores for comparison only: it stays near 0.99 for two unrelated roads.
    """
    a = np.sqrt(welch_spectrum(measured, rate_hz, block).density)
    b = np.sqrt(welch_spectrum(modelled, rate_hz, block).density)
    return float(np.corrcoef(a, b)[0, 1])
