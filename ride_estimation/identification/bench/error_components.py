# Copyright 2026 ride_estimation contributors
"""How much of the scatter of measured stiffnesses is proportional to them and how much is force noise, by maximum likelihood.

A measured K* errs by a share of itself (class of the load cell, fixture, what the model leaves out) and by force noise over
the amplitude. Weights that assume the wrong mixture waste data: they throw good small amplitudes away or let bad ones rule.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: limits of the proportional share; below 0.01 % no load cell is linear
SHARE = (1e-4, 0.3)
#: limits of the force noise on top of the stated one, in shares of the largest force amplitude
NOISE = (1e-7, 1e-2)
#: grids of the search; the last is spaced by half a percent
_GRIDS = 6


@dataclasses.dataclass(frozen=True)
class ErrorComponents:
    """Error of a measured stiffness, ``sigma^2 = (share |K*|)^2 + (noise / A)^2`` per real and imaginary part.

    Attributes
    ----------
    share
        Proportional part.
    noise
        Standard deviation of the first force harmonic beyond the stated one [N].
    """

    share: float
    noise: float

    def relative_sigma(self, stiffness: Array, amplitude: Array, stated_noise: Array) -> Array:
        """Return the relative standard deviation of K* at points, shape (N,).

        Parameters
        ----------
        stiffness, amplitude
            ``|K*|`` [N/m] and A [m], shape (N,).
        stated_noise
            Standard deviation of the first force harmonic known from the extraction [N], shape (N,).
        """
        noise = np.hypot(stated_noise, self.noise) / (amplitude * stiffness)
        return np.asarray(np.hypot(self.share, noise))


def estimate_components(
    stiffness: Array, amplitude: Array, stated_noise: Array, misfit: NDArray[np.complex128], parameters: int
) -> ErrorComponents:
    """Estimate both components from the misfit of a fitted model.

    Minimises ``sum(2 ln s + |e|^2 q / (2 s^2))`` over share and noise, e the relative misfit, s the relative standard
    deviation and ``q = 2N / (2N - P)`` for the degrees of freedom the fit took.

    Parameters
    ----------
    stiffness, amplitude, stated_noise
        See :meth:`ErrorComponents.relative_sigma`.
    misfit
        Relative misfit ``K*_model / K*_measured - 1``, shape (N,).
    parameters
        Number of fitted parameters P.
    """
    largest = float(np.max(stiffness * amplitude))
    square = np.abs(misfit) ** 2 * (2.0 * misfit.size / max(2 * misfit.size - parameters, 1))
    stated, unit = (stated_noise / (amplitude * stiffness)) ** 2, (largest / (amplitude * stiffness)) ** 2

    def costs(shares: Array, noises: Array) -> Array:
        variance = np.exp(2.0 * shares)[:, None, None] + stated + np.exp(2.0 * noises)[None, :, None] * unit
        return np.asarray(np.sum(np.log(variance) + 0.5 * square / variance, axis=2))

    # the likelihood may have a ridge between the two: grids around the best point, each a third as wide as the one before
    limits = [(math.log(low), math.log(high)) for low, high in (SHARE, NOISE)]
    best, half = [0.5 * (low + high) for low, high in limits], [0.5 * (high - low) for low, high in limits]
    for _ in range(_GRIDS):
        axes = [np.clip(np.linspace(b - h, b + h, 9), *limit) for b, h, limit in zip(best, half, limits, strict=True)]
        i, j = np.unravel_index(int(np.argmin(costs(axes[0], axes[1]))), (9, 9))
        best, half = [float(axes[0][i]), float(axes[1][j])], [h / 3.0 for h in half]
    return ErrorComponents(math.exp(best[0]), largest * math.exp(best[1]))
