# Copyright 2026 ride_estimation contributors
"""Random roads after ISO 8608 with coherent left and right tracks, and the wheel paths over them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError

Array = NDArray[np.float64]

#: reference spatial frequency n0 [1/m]
REFERENCE_WAVENUMBER = 0.1
#: geometric mean of Gd(n0) per class [m^3], ISO 8608 Table A.1: factor 4 per class
CLASS_ROUGHNESS: dict[str, float] = {name: 16.0e-6 * 4.0**i for i, name in enumerate("ABCDEFGH")}
#: decay of the coherence between tracks about 2 m apart [m]; assumed, ordinary roads
COHERENCE_LENGTH = 3.8


@dataclasses.dataclass(frozen=True)
class Road:
    """Heights of the left and the right wheel track over the distance.

    Attributes
    ----------
    spacing
        Distance between samples [m].
    left, right
        Height [m], shape (N,); the first sample is at distance ``start``.
    start
        Distance of the first sample [m], so that a rear axle has road behind the start line.
    """

    spacing: float
    left: Array
    right: Array
    start: float = 0.0

    def __post_init__(self) -> None:
        if not self.spacing > 0.0 or self.left.shape != self.right.shape or self.left.ndim != 1 or len(self.left) < 2:
            raise ConfigurationError(
                f"road: spacing {self.spacing:g} m, tracks {self.left.shape} and {self.right.shape}; "
                "allowed: spacing > 0, two tracks of equal length of at least 2 samples"
            )

    @property
    def distance(self) -> Array:
        """Return the distance of the samples [m], shape (N,)."""
        return np.asarray(self.start + np.arange(len(self.left)) * self.spacing, dtype=np.float64)

    def heights(self, distance: Array) -> Array:
        """Return (left, right) at given distances, linear in between, shape (K, 2) [m].

        Raises
        ------
        ConfigurationError
            A distance outside the road.
        """
        first, last = self.distance[0], self.distance[-1]
        if distance.min() < first - 1e-9 or distance.max() > last + 1e-9:
            raise ConfigurationError(
                f"road: distance {distance.min():.1f} to {distance.max():.1f} m asked, the road covers "
                f"{first:.1f} to {last:.1f} m"
            )
        return np.stack([np.interp(distance, self.distance, t) for t in (self.left, self.right)], axis=1)

    def plus(self, left: Array, right: Array) -> Road:
        """Return the road with heights [m] added to its tracks."""
        return dataclasses.replace(self, left=self.left + left, right=self.right + right)

    def smoothed(self, contact_length: float) -> Road:
        """Return what an elastic tyre feels: the mean height over its contact patch of the given length [m]."""
        width = max(1, round(contact_length / self.spacing))
        kernel = np.ones(width) / width

        def mean(track: Array) -> Array:
            padded = np.pad(track, (width // 2, width - 1 - width // 2), mode="edge")
            return np.convolve(padded, kernel, mode="valid")

        return dataclasses.replace(self, left=mean(self.left), right=mean(self.right))


def iso_spectrum(wavenumber: Array, roughness: float, waviness: float = 2.0) -> Array:
    """Return ``Gd(n) = Gd(n0) (n / n0)^-w`` [m^3] (ISO 8608; document 004 eq. (1) with its minus sign restored).

    Parameters
    ----------
    wavenumber
        n [1/m], greater than zero.
    roughness
        Gd(n0) [m^3].
    waviness
        w.
    """
    return np.asarray(roughness * (np.asarray(wavenumber) / REFERENCE_WAVENUMBER) ** -waviness, dtype=np.float64)


def coherence(wavenumber: Array, length: float = COHERENCE_LENGTH) -> Array:
    """Return the coherence of the two tracks ``|G_lr| / Gd = exp(-L n)``: one for long waves, zero for short ones."""
    return np.asarray(np.exp(-length * np.asarray(wavenumber)), dtype=np.float64)


def random_road(
    length: float,
    seed: int,
    *,
    roughness: float,
    waviness: float = 2.0,
    spacing: float = 0.02,
    band: tuple[float, float] = (0.01, 10.0),
    coherence_length: float = COHERENCE_LENGTH,
    start: float = 0.0,
) -> Road:
    """Make a Gaussian road whose tracks have the ISO 8608 spectrum and the given coherence.

    Parameters
    ----------
    length
        [m].
    seed
        Of numpy's default generator.
    roughness, waviness
        Gd(n0) [m^3] (:data:`CLASS_ROUGHNESS`) and w.
    spacing
        [m].
    band
        Spatial frequencies that are present [1/m]; outside the road is flat.
    coherence_length
        L of :func:`coherence` [m]; 0 makes both tracks equal.
    start
        Distance of the first sample [m].

    Raises
    ------
    ConfigurationError
        Values that make no road.
    """
    problems = []
    if not length > 0.0 or not spacing > 0.0 or length < 10.0 * spacing:
        problems.append(f"length {length:g} m, spacing {spacing:g} m; allowed: length at least 10 spacings, both > 0")
    if not roughness >= 0.0:
        problems.append(f"roughness {roughness:g} m^3; allowed: 0 or more")
    if not 0.0 < band[0] < band[1]:
        problems.append(f"band {band}; allowed: 0 < lower < upper [1/m]")
    if not coherence_length >= 0.0:
        problems.append(f"coherence_length {coherence_length:g} m; allowed: 0 or more")
    if problems:
        raise ConfigurationError(problems, where="road")
    wanted = math.ceil(length / spacing) + 1
    # twice the length is made and half of it used, so that the end does not run into the beginning again
    count = 2 * wanted
    n: Array = np.fft.rfftfreq(count, spacing).astype(np.float64)
    inside = (n >= band[0]) & (n <= band[1])
    amplitude = np.zeros(len(n))
    amplitude[inside] = np.sqrt(0.5 * iso_spectrum(n[inside], roughness, waviness) / (count * spacing))
    generator = np.random.default_rng(seed)
    normal = generator.standard_normal((2, 2, len(n)))
    first, second = (normal[i, 0] + 1j * normal[i, 1] for i in range(2))
    common = coherence(n, coherence_length)
    tracks = (first, common * first + np.sqrt(1.0 - common**2) * second)
    # E|X|^2 of one-sided bins: Gd df / 2 per complex amplitude, irfft divides by the count
    left, right = (np.fft.irfft(amplitude * t / math.sqrt(2.0) * count, n=count)[:wanted] for t in tracks)
    return Road(spacing, left, right, start)


def flat_road(length: float, *, spacing: float = 0.02, start: float = 0.0) -> Road:
    """Make a flat road of a length [m]."""
    count = math.ceil(length / spacing) + 1
    return Road(spacing, np.zeros(count), np.zeros(count), start)
