# Copyright 2026 ride_estimation contributors
"""What a measured road profile is: its ISO 8608 roughness and waviness, its class, and where along it long waves stand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.excitation.road import CLASS_ROUGHNESS, REFERENCE_WAVENUMBER

Array = NDArray[np.float64]

#: spatial frequencies of the fit [1/m], ISO 8608 and document 004
FIT_BAND = (0.011, 2.83)
#: upper limit of class A, Gd(n0) [m^3]; each further class ends at four times that
CLASS_LIMIT = 32.0e-6
#: bands per octave of the smoothing below 0.031, below 0.25 and above [1/m] (ISO 8608)
_SMOOTHING = ((0.0, 1.0), (2.0**-5, 3.0), (0.25, 12.0))
#: blocks are this many times the longest wave of the fit
_BLOCK_WAVES = 5.0


@dataclasses.dataclass(frozen=True)
class RoadFit:
    """Straight line through the smoothed spectrum of a road.

    Attributes
    ----------
    roughness
        Gd(n0) [m^3] at n0 = 0.1 1/m.
    waviness
        w.
    iso_class
        ``A`` to ``H`` by the roughness.
    wavenumber, density
        The smoothed spectrum the line was laid through [1/m], [m^3], shape (B,).
    """

    roughness: float
    waviness: float
    iso_class: str
    wavenumber: Array
    density: Array


def iso_class(roughness: float) -> str:
    """Return the ISO 8608 class of a roughness Gd(n0) [m^3]: limits ``32e-6 * 4^k``, everything above G is H."""
    if not roughness > 0.0:
        raise InputDataError(f"roughness {roughness:g} m^3; allowed: greater than zero")
    index = max(0, math.ceil(math.log(roughness / CLASS_LIMIT, 4.0) - 1e-12))
    return list(CLASS_ROUGHNESS)[min(index, len(CLASS_ROUGHNESS) - 1)]


def fit_road(height: ArrayLike, spacing: float, band: tuple[float, float] = FIT_BAND) -> RoadFit:
    """Fit ``Gd(n) = Gd(n0) (n / n0)^-w`` to the smoothed spectrum of a profile by least squares in logarithms.

    Each smoothed value counts with the number of spectral lines in it. A profile of length L tells w within
    ``1 / sqrt(L n_max)`` and Gd(n0) within 2.5 times that (one standard deviation): 1.3 % and 3.4 % for 2 km.

    Source: document 004 eq. (1); smoothing and classes ISO 8608.

    Parameters
    ----------
    height
        [m], shape (N,), or several parallel tracks (N, T) that are averaged.
    spacing
        [m].
    band
        Spatial frequencies of the fit [1/m].

    Raises
    ------
    InputDataError
        Values not finite, too short for the lowest or too coarse for the highest spatial frequency.
    """
    tracks = np.asarray(height, dtype=float).reshape(len(np.asarray(height)), -1)
    length = len(tracks) * spacing
    if not np.all(np.isfinite(tracks)) or not spacing > 0.0:
        raise InputDataError("road: heights must be finite and the spacing positive")
    if spacing > 0.5 / band[1] or length < _BLOCK_WAVES / band[0]:
        raise InputDataError(
            f"road: {length:.0f} m at {spacing:g} m; the fit from {band[0]:g} to {band[1]:g} 1/m needs at least "
            f"{_BLOCK_WAVES / band[0]:.0f} m at {0.5 / band[1]:.3g} m or less"
        )
    block = math.ceil(_BLOCK_WAVES / band[0] / spacing)
    n, density = scipy.signal.welch(tracks, 1.0 / spacing, nperseg=block, noverlap=block // 2, detrend="linear", axis=0)
    n, density = n[1:], density[1:].mean(axis=1)
    inside = (n >= band[0]) & (n <= band[1])
    centres, means, weights = _smoothed(n[inside], density[inside])
    design = np.column_stack([np.ones(len(centres)), -np.log(centres / REFERENCE_WAVENUMBER)])
    root = np.sqrt(weights)
    solution, *_ = np.linalg.lstsq(root[:, None] * design, root * np.log(means), rcond=None)
    roughness = float(np.exp(solution[0]))
    return RoadFit(roughness, float(solution[1]), iso_class(roughness), centres, means)


def _smoothed(n: Array, density: Array) -> tuple[Array, Array, Array]:
    """Return centre, mean density and number of lines of the bands.

    The centre is where a spectrum falling with n^-2 has the band's mean, so that wide bands bring no bias of their own.
    """
    lower = np.array([limit for limit, _ in _SMOOTHING])
    per_octave = np.array([bands for _, bands in _SMOOTHING])
    part = np.searchsorted(lower, n, side="right") - 1
    index = 10_000 * part + np.floor(np.log2(n) * per_octave[part]).astype(int)
    _, inverse, counts = np.unique(index, return_inverse=True, return_counts=True)
    centres = (np.bincount(inverse, n**-2.0) / counts) ** -0.5
    return centres, np.bincount(inverse, density) / counts, counts.astype(float)


@dataclasses.dataclass(frozen=True)
class RoadSpectrogram:
    """Spectrum along the road: distance of the window centres [m] (K,), wavenumber [1/m] (F,), density [m^3] (F, K)."""

    distance: Array
    wavenumber: Array
    density: Array

    def band(self, lower: float, upper: float) -> Array:
        """Return the mean square height in a band of spatial frequencies along the road [m^2], shape (K,)."""
        inside = (self.wavenumber >= lower) & (self.wavenumber < upper)
        if not np.any(inside):
            spacing = self.wavenumber[1]
            raise InputDataError(f"road: no line between {lower:g} and {upper:g} 1/m; lines are {spacing:.4g} 1/m apart")
        return np.asarray(np.sum(self.density[inside], axis=0) * self.wavenumber[1])


def road_spectrogram(height: ArrayLike, spacing: float, window: float = 150.0, overlap: float = 0.9) -> RoadSpectrogram:
    """Return the spectrum of a profile along its length, Hann windows (document 004, Figure 4: 150 m).

    Parameters
    ----------
    height
        [m], shape (N,).
    spacing
        [m].
    window
        Length of the windows [m].
    overlap
        Share of a window that the next one repeats.

    Raises
    ------
    InputDataError
        Profile shorter than a window.
    """
    profile = np.asarray(height, dtype=float).ravel()
    samples = round(window / spacing)
    if samples < 8 or profile.size < samples or not 0.0 <= overlap < 1.0:
        raise InputDataError(
            f"road: windows of {window:g} m ({samples} samples) and overlap {overlap:g} do not fit a profile of "
            f"{profile.size * spacing:.0f} m; allowed: at least 8 samples, no longer than the profile, overlap 0 to below 1"
        )
    repeated = min(int(overlap * samples), samples - 1)
    n, distance, density = scipy.signal.spectrogram(
        profile, 1.0 / spacing, window="hann", nperseg=samples, noverlap=repeated, detrend="linear"
    )
    return RoadSpectrogram(distance, n, density)


def speed_of_excitation(wavelength: float, frequency_hz: float) -> float:
    """Return the speed ``v = lambda f`` [m/s] at which waves of a length [m] excite a frequency [Hz] (document 004)."""
    return wavelength * frequency_hz
