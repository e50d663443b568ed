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
from scipy.optimize import minimize

Array = NDArray[np.float64]

#: limits of the proportional share; below 0.01 % no load cell is linear
SHARE = (1e-4, 0.3)
#: limits of the force noise on top of the stated one, in shares of the largest force amplitude
NOISE = (1e-7, 1e-2)


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

    def components(p: Array) -> ErrorComponents:
        return ErrorComponents(float(np.exp(p[0])), largest * float(np.exp(p[1])))

    def cost(p: Array) -> float:
        variance = components(p).relative_sigma(stiffness, amplitude, stated_noise) ** 2
        return float(np.sum(np.log(variance) + 0.5 * square / variance))

    limits = [(math.log(low), math.log(high)) for low, high in (SHARE, NOISE)]
    # the likelihood may have a ridge between the two: the best of a coarse grid starts the search
    grid = [np.array([a, b]) for a in np.linspace(*limits[0], 7) for b in np.linspace(*limits[1], 7)]
    start = min(grid, key=cost)
    found = minimize(cost, start, bounds=limits, method="L-BFGS-B")
    return components(found.x if found.fun <= cost(start) else start)
