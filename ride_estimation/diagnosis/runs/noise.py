# Copyright 2026 ride_estimation contributors
"""What the residual of a right model looks like: sensor noise through the plant, as a whitening operator.

Noise of the base sensors reaches the residual through the model; noise of the body sensors directly. Their covariance per
frequency is ``S = diag(s_y^2) + T diag(s_u^2) T^H + (adequacy^2) diag(P_y)``; the Cholesky factor of S whitens the residual,
so that a sum of squares is a chi-square and its excess over the degrees of freedom is what the model misses.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: added to the correlations of forces and noise together: far above rounding, far below the noise of any sensor
_RIDGE = 1e-12


def smoothed_power(spectrum: ComplexArray, samples: int, width: int) -> Array:
    """Return power per bin in the unit of a variance per sample, averaged over ``width`` bins, shape (F, ny)."""
    power = np.abs(spectrum) ** 2 / samples
    if width < 3:
        return power
    kernel = np.ones(width) / width
    padded = np.pad(power, ((width // 2, width - 1 - width // 2), (0, 0)), mode="edge")
    return np.stack([np.convolve(padded[:, i], kernel, mode="valid") for i in range(power.shape[1])], axis=1)


def gross_power(
    measured: Array, transfer: NDArray[Any], coordinates: ComplexArray, samples: int, width: int, rigid: NDArray[np.bool_]
) -> Array:
    """Return the power of the motions that a channel is the sum of, shape (F, ny).

    Near a node an accelerometer reads the small difference of a translation and a rotation. A model that has both right to
    four per mille does not have their difference right to four per mille: its tolerated error refers to the sum of the powers of
    the coordinates' parts, and to the measured power where that is larger.

    Parameters
    ----------
    measured
        Smoothed power of the measured outputs, shape (F, ny).
    transfer, coordinates
        Outputs from the coordinates of the bodies, shape (F, ny, n), and the predicted coordinates, shape (F, n).
    samples, width
        As in :func:`smoothed_power`.
    rigid
        Channels it applies to, shape (ny,); a transducer reads what its mount stretches, whatever both ends move.
    """
    parts = np.sum(np.abs(transfer * coordinates[:, None, :]) ** 2, axis=2)
    return np.where(rigid, np.maximum(measured, smoothed_power(np.sqrt(parts).astype(complex), samples, width)), measured)


def over_band(power: Array, weight: Array) -> Array:
    """Return the mean power of a band at every frequency, shapes (F, ny) of both; ``weight`` of the band, shape (F,)."""
    inside = weight[:, None] ** 2
    return np.broadcast_to(np.sum(power * inside, axis=0) / np.sum(inside), power.shape)


def residual_covariance(
    output_noise: Array, disturbance: ComplexArray, output_power: Array, adequacy: float
) -> ComplexArray:
    """Return the residual covariance per frequency, shape (F, ny, ny).

    Parameters
    ----------
    output_noise
        Standard deviation of one sample, shape (ny,).
    disturbance
        Output of one standard deviation of everything that is wrong with the measured base motion, shape (F, ny, d).
    output_power
        What the relative error of the model refers to, shape (F, ny).
    adequacy
        Relative error of a model that still counts as right.
    """
    covariance = disturbance @ np.conj(np.swapaxes(disturbance, 1, 2))
    ny = len(output_noise)
    covariance[:, np.arange(ny), np.arange(ny)] += output_noise**2 + adequacy**2 * output_power
    return covariance


def whitening(covariance: ComplexArray, weight: Array, basis: Array) -> ComplexArray:
    """Return ``weight * inv(cholesky(T S T^T)) T`` per frequency, shape (F, ny, ny).

    What rows of the basis T do not reach first, none of the first whitened rows reaches either.
    """
    covariance = basis @ covariance @ basis.T
    scale = np.sqrt(np.real(np.diagonal(covariance, axis1=1, axis2=2)))
    correlation = covariance / (scale[:, :, None] * scale[:, None, :])
    ny = covariance.shape[1]
    correlation[:, np.arange(ny), np.arange(ny)] += 1e-9
    factor = np.linalg.cholesky(correlation)
    return np.asarray((np.linalg.inv(factor) / scale[:, None, :] * weight[:, None, None]) @ basis)


def noise_scale(
    spectrum: ComplexArray, motion: Array, stated: Array, frequency: Array, samples: int, sensors: Sequence[str] = ()
) -> float:
    """Return measured over stated noise of the body accelerometers, at least one.

    Rigid motion cannot reach the null space of the sensor map; what is there in the upper third of the band is noise. One
    faulty sensor fills all of that space, so each sensor is left out in turn where enough others remain and the smallest
    value counts; the median over bins and directions keeps lines out. Interpolation on stamps lowers the noise there, so
    less than the stated noise is not believed.

    Parameters
    ----------
    spectrum
        Measured outputs, shape (F, ny).
    motion
        Map from coordinates to outputs, shape (ny, n).
    stated
        Stated noise, shape (ny,).
    sensors
        Sensor of every row; none is left out where empty.
    """
    upper = frequency > frequency[0] + 0.67 * (frequency[-1] - frequency[0])
    if not np.any(upper):
        return 1.0
    scaled, white = motion / stated[:, None], spectrum[upper] / stated
    everything = np.ones(len(stated), dtype=bool)
    without = [np.array([s != name for s in sensors]) for name in dict.fromkeys(sensors)]
    levels = [v for keep in (everything, *without) if (v := _null_level(white[:, keep], scaled[keep], samples)) is not None]
    return float(np.sqrt(max(min(levels, default=1.0), 1.0)))


def _null_level(white: ComplexArray, motion: Array, samples: int) -> float | None:
    """Return the median power in the null space of a motion map over the one of unit noise, None without null space."""
    if len(motion) <= motion.shape[1]:
        return None
    left, values, _ = np.linalg.svd(motion, full_matrices=True)
    null = left[:, int(np.count_nonzero(values > 1e-9 * values.max(initial=0.0))) :]
    # the power of a complex Gaussian bin is exponential: median = ln 2 x mean
    return float(np.median(np.abs(white @ null) ** 2 / samples) / np.log(2.0))


def gyro_noise_scale(
    spectra: tuple[ComplexArray, ComplexArray], motion: tuple[Array, Array], stated: tuple[Array, Array], omega: Array,
    samples: int,
) -> float:
    """Return measured over stated noise of one gyro, at least one.

    What its readings, ``i omega`` times, differ by from the angular acceleration that accelerometers show is noise of both. In
    the upper third of the band, as in :func:`noise_scale`; one where the accelerometers do not show it.

    Parameters
    ----------
    spectra
        Of the accelerometers of the bodies, shape (F, na), and of the gyro, shape (F, nr).
    motion
        Maps from accelerations of the coordinates to accelerometers (na, n) and to the derivatives of the rates (nr, n).
    stated
        Noise of both, that of the accelerometers as measured, shapes (na,) and (nr,).
    omega
        Angular frequencies within the band [rad/s], shape (F,).
    samples
        Length of the run.
    """
    upper = omega > omega[0] + 0.67 * (omega[-1] - omega[0])
    weight = motion[1] @ np.linalg.pinv(motion[0] / stated[0][:, None]) / stated[0]
    if not np.any(upper) or not np.allclose(weight @ motion[0], motion[1], atol=1e-6):
        return 1.0
    difference = 1j * omega[upper, None] * spectra[1][upper] - spectra[0][upper] @ weight.T
    known, own = np.square(weight) @ np.square(stated[0]), np.square(omega[upper, None] * stated[1])
    # the power of a complex Gaussian bin is exponential: median = ln 2 x mean
    level = float(np.median((np.abs(difference) ** 2 / samples / np.log(2.0) - known) / own))
    return float(np.sqrt(max(level, 1.0)))


def missing_forces(residual: ComplexArray, transfer: ComplexArray, power: Array, noise: ComplexArray) -> ComplexArray:
    """Return the forces that explain a residual best, shape (F, P): Wiener estimate of independent forces of known power.

    Parameters
    ----------
    residual
        Shape (F, ny).
    transfer
        Residual of unit forces, shape (F, ny, P).
    power
        Of the forces, variance per sample, shape (F, P).
    noise
        Covariance of the rest of the residual, shape (F, ny, ny).

    Notes
    -----
    The covariance of forces and noise together is solved as a matrix of correlations, as :func:`whitening` does: forces of any
    power then leave it regular.
    """
    shaped = transfer * power[:, None, :]
    total = shaped @ np.conj(np.swapaxes(transfer, 1, 2)) + noise
    scale = np.sqrt(np.real(np.diagonal(total, axis1=1, axis2=2)))
    correlation = total / (scale[:, :, None] * scale[:, None, :])
    correlation[:, np.arange(total.shape[1]), np.arange(total.shape[1])] += _RIDGE
    weighted = np.linalg.solve(correlation, (residual / scale)[:, :, None]) / scale[:, :, None]
    return np.asarray((np.conj(np.swapaxes(shaped, 1, 2)) @ weighted)[:, :, 0])


@dataclasses.dataclass(frozen=True)
class DeflectionFilter:
    """Wiener filter of deflections against base sensor noise, in the principal directions of that noise.

    Attributes
    ----------
    vectors
        Principal directions, shape (F, P, P).
    gain
        Shape (F, P).
    scale
        Of the ports, shape (P,).
    """

    vectors: ComplexArray
    gain: Array
    scale: Array

    def apply(self, spectrum: ComplexArray, power: float = 1.0) -> ComplexArray:
        """Return deflections multiplied by the gain raised to a power, shape (F, P)."""
        component = np.einsum("fji,fj->fi", np.conj(self.vectors), spectrum / self.scale)
        return np.asarray(np.einsum("fij,fj->fi", self.vectors, self.gain**power * component) * self.scale)


def deflection_filter(
    spectrum: ComplexArray, disturbance: ComplexArray, samples: int, width: int
) -> DeflectionFilter:
    """Return the filter that removes from deflections what errors of the measured base motion explain.

    Double integration turns noise of the base sensors into slow apparent stretching of the base, which loads the mounts
    against each other and moves nothing that is measured. In the principal directions of that noise at every frequency,
    each component is multiplied by ``max(0, 1 - noise power / measured power)`` (Wiener).

    Parameters
    ----------
    spectrum
        Deflections, shape (F, P).
    disturbance
        Deflection of one standard deviation of every error of the measured base motion, shape (F, P, d).
    width
        Bins over which the measured power is averaged.
    """
    scale = np.sqrt(np.mean(np.abs(spectrum) ** 2, axis=0)) + 1e-300
    shaped = disturbance / scale[None, :, None]
    values, vectors = np.linalg.eigh(shaped @ np.conj(np.swapaxes(shaped, 1, 2)))
    component = np.einsum("fji,fj->fi", np.conj(vectors), spectrum / scale)
    power = smoothed_power(component, samples, width)
    gain = np.clip(1.0 - np.maximum(values, 0.0) / np.maximum(power, 1e-300), 0.0, 1.0)
    return DeflectionFilter(vectors, gain, scale)


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
    if not np.all(np.isfinite(cross)):  # a trial model without finite motion
        return 1.0
    values = np.clip(np.linalg.eigvalsh(cross) - 1.0, 0.0, None)
    if not np.any(values > 0.0):
        return 1.0
    participating = float(values.sum() ** 2 / np.sum(values**2))
    return float(np.clip(values.size / participating, 1.0, 100.0))


def temper_of(misfit_per_dof: float, inefficiency: float) -> float:
    """Return the weight that turns nominal into effective evidence: one for a right model."""
    return 1.0 + max(misfit_per_dof - 1.0, 0.0) * inefficiency
