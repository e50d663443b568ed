# Copyright 2026 ride_estimation contributors
"""What the residual of a right model looks like: sensor noise through the plant, as a whitening operator.

Noise of the base sensors reaches the residual through the model; noise of the body sensors directly. Their covariance per
frequency is ``S = diag(s_y^2) + T diag(s_u^2) T^H + (adequacy^2) diag(P_y)``; the Cholesky factor of S whitens the residual,
so that a sum of squares is a chi-square and its excess over the degrees of freedom is what the model misses.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def smoothed_power(spectrum: ComplexArray, samples: int, width: int) -> Array:
    """Return power per bin in the unit of a variance per sample, averaged over ``width`` bins, shape (F, ny)."""
    power = np.abs(spectrum) ** 2 / samples
    if width < 3:
        return power
    kernel = np.ones(width) / width
    padded = np.pad(power, ((width // 2, width - 1 - width // 2), (0, 0)), mode="edge")
    return np.stack([np.convolve(padded[:, i], kernel, mode="valid") for i in range(power.shape[1])], axis=1)


def residual_covariance(
    output_noise: Array, input_noise: Array, output_from_input: ComplexArray, output_power: Array, adequacy: float
) -> ComplexArray:
    """Return the residual covariance per frequency, shape (F, ny, ny).

    Parameters
    ----------
    output_noise, input_noise
        Standard deviation of one sample, shapes (ny,) and (nu,).
    output_from_input
        Shape (F, ny, nu).
    output_power
        Smoothed power of the measured outputs, shape (F, ny).
    adequacy
        Relative error of a model that still counts as right.
    """
    scaled = output_from_input * input_noise
    covariance = scaled @ np.conj(np.swapaxes(scaled, 1, 2))
    ny = len(output_noise)
    covariance[:, np.arange(ny), np.arange(ny)] += output_noise**2 + adequacy**2 * output_power
    return covariance


def whitening(covariance: ComplexArray, weight: Array) -> ComplexArray:
    """Return ``weight * inv(cholesky(S))`` per frequency, shape (F, ny, ny)."""
    scale = np.sqrt(np.real(np.diagonal(covariance, axis1=1, axis2=2)))
    correlation = covariance / (scale[:, :, None] * scale[:, None, :])
    ny = covariance.shape[1]
    correlation[:, np.arange(ny), np.arange(ny)] += 1e-9
    factor = np.linalg.cholesky(correlation)
    return np.asarray(np.linalg.inv(factor) / scale[:, None, :] * weight[:, None, None])


def excess_inefficiency(white: ComplexArray, samples: int, group: int = 15) -> float:
    """Return how many nominal degrees of freedom one independent sample of the model error takes.

    The participation ratio of the eigenvalues of the excess cross spectra, averaged over ``group`` bins: a model error that
    lives in a few directions and a narrow band is few samples, however many were recorded.

    Parameters
    ----------
    white
        Whitened residual spectrum, shape (F, ny).
    samples
        Length of the run, for the unit of power.
    """
    count = len(white) // group
    if count == 0:
        return 1.0
    part = white[: count * group].reshape(count, group, -1)
    cross = np.einsum("gbi,gbj->gij", part, np.conj(part)) / (group * samples)
    values = np.clip(np.linalg.eigvalsh(cross) - 1.0, 0.0, None)
    if not np.any(values > 0.0):
        return 1.0
    participating = float(values.sum() ** 2 / np.sum(values**2))
    return float(np.clip(values.size / participating, 1.0, 100.0))


def temper_of(misfit_per_dof: float, inefficiency: float) -> float:
    """Return the weight that turns nominal into effective evidence: one for a right model."""
    return 1.0 + max(misfit_per_dof - 1.0, 0.0) * inefficiency
