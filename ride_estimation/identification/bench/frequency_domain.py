# Copyright 2026 ride_estimation contributors
"""Frequency-domain identification from operating points (frequency, amplitude, K, W), with repaired weighting.

Norms, as named options:

``complex_modulus`` (default)
    residual ``(K*_measured - K*) / sigma`` with ``sigma^2 = (r |K*|)^2 + (sigma_F / A)^2``: linear in the same
    coefficients as the force, so variable projection applies, and tiny amplitudes whose force drowns in noise count less. The
    mixture of both errors is estimated from the misfit by maximum likelihood, fit and mixture in turn
    (:mod:`~ride_estimation.identification.bench.error_components`), from ``r = 1 %`` as a start;
``repaired``
    document 003 eq. (24) with the loss residual over ``pi A^2 K`` and the same de-weighting;
``printed``
    document 003 eq. (24) as printed (loss residual over the measured loss), for comparison.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.choices import NORMS
from ride_estimation.identification.bench.error_components import estimate_components
from ride_estimation.identification.bench.harmonic_stiffness import complex_stiffness, harmonic_columns
from ride_estimation.identification.bench.models import BenchModel
from ride_estimation.identification.bench.steady_cycles import OperatingPoints
from ride_estimation.identification.bench.time_domain import start_points
from ride_estimation.identification.bench.variable_projection import VariableProjectionResult, minimise

Array = NDArray[np.float64]

#: error of a measured stiffness that does not fall with amplitude (load cell class, fixture)
RELATIVE_FLOOR = 0.01
#: rounds of fit and error mixture; the standard deviations then change by less than a tenth
REWEIGHTINGS = 4
#: weight of the stiffness against the loss in document 003 eq. (24)
BETA = 0.97


@dataclasses.dataclass(frozen=True)
class FrequencyDomainFit:
    """Identified parameters from operating points.

    Attributes
    ----------
    model
        The rung.
    values
        Reported parameters in SI.
    theta, coefficients
        Searched form.
    std
        Standard deviations of the reported parameters from the residual scatter, shape (P + Q,).
    stiffness_error, loss_error
        Relative errors at the points: ``|K*| / |K*_measured| - 1`` and ``(W - W_measured) / (pi A^2 K_measured)``.
    norm
        Which norm was minimised.
    sigma
        Relative standard deviations of K* the fit was weighted with, shape (N,).
    bounds_hit
        Reported parameters at a bound.
    """

    model: BenchModel
    values: Array
    theta: Array
    coefficients: Array
    std: Array
    stiffness_error: Array
    loss_error: Array
    norm: str
    sigma: Array
    bounds_hit: tuple[str, ...]


def relative_sigma(points: OperatingPoints, force_noise: float | None = None) -> Array:
    """Return the relative standard deviation of each measured K*, shape (N,).

    Parameters
    ----------
    points
        Operating points.
    force_noise
        Standard deviation of the first harmonic of the force [N]; None: from the extraction, and at least 0.1 % of the
        largest force amplitude (what a load cell resolves).
    """
    magnitude = np.abs(points.stiffness)
    resolution = 1e-3 * float(np.max(magnitude * points.amplitude))
    noise = np.maximum(points.force_std, resolution if force_noise is None else force_noise)
    sigma: Array = np.sqrt(RELATIVE_FLOOR**2 + (noise / (points.amplitude * magnitude)) ** 2)
    return sigma


def fit_frequency_domain(
    model: BenchModel,
    points: OperatingPoints,
    *,
    norm: str = "complex_modulus",
    beta: float = BETA,
    force_noise: float | None = None,
    starts: int = 8,
) -> FrequencyDomainFit:
    """Identify one model from operating points.

    Parameters
    ----------
    model
        Rung of the ladder.
    points
        Operating points.
    norm
        One of ``NORMS``.
    beta
        Weight of the stiffness in ``repaired`` and ``printed``.
    force_noise
        Standard deviation of the first force harmonic [N], taken as known; None: the error mixture is estimated.
    starts
        Number of start points.

    Raises
    ------
    InputDataError
        Unknown norm, or fewer values than parameters.
    """
    if norm not in NORMS:
        raise InputDataError(f"norm {norm!r} is unknown; allowed: {', '.join(NORMS)}")
    if 2 * points.omega.size < model.parameter_count:
        raise InputDataError(
            f"{points.omega.size} operating points give {2 * points.omega.size} numbers for "
            f"{model.parameter_count} parameters of "
            f"{model.name}: measure more frequencies and amplitudes"
        )
    sigma = relative_sigma(points, force_noise)
    lower, upper = _bounds(model, points)
    found = _project(model, points, sigma, start_points(model.layout, lower, upper, starts))
    if norm == "complex_modulus" and force_noise is None:
        found, sigma = _reweighted(model, points, sigma, found)
    theta, coefficients = found.theta, found.coefficients
    if norm != "complex_modulus":
        theta, coefficients = _refine(model, points, sigma, theta, coefficients, norm, beta)
    return _finish(model, points, sigma, theta, coefficients, norm, found)


def _weighted_rows(model: BenchModel, points: OperatingPoints, sigma: Array, theta: Array) -> Array:
    """Return real weighted rows of [columns, sensitivities, measured], shape (P + Q + 1, 2N)."""
    columns = harmonic_columns(model.layout, theta, points.omega, points.amplitude)
    rows = np.vstack([columns, points.stiffness]) / (np.abs(points.stiffness) * sigma)
    return np.hstack([rows.real, rows.imag])


def _bounds(model: BenchModel, points: OperatingPoints) -> tuple[Array, Array]:
    lower = [np.log(0.05 * points.omega.min())] * model.layout.cells
    upper = [np.log(20.0 * points.omega.max())] * model.layout.cells
    if model.layout.friction:
        lower.append(np.log(1e-2 * points.amplitude.min()))
        upper.append(np.log(10.0 * points.amplitude.max()))
    return np.asarray(lower), np.asarray(upper)


def _reweighted(
    model: BenchModel, points: OperatingPoints, sigma: Array, found: VariableProjectionResult
) -> tuple[VariableProjectionResult, Array]:
    """Estimate the error mixture from the misfit and fit again, in turn."""
    magnitude = np.abs(points.stiffness)
    for _ in range(REWEIGHTINGS):
        value = complex_stiffness(model.layout, found.theta, found.coefficients, points.omega, points.amplitude)
        mixture = estimate_components(
            magnitude, points.amplitude, points.force_std, value / points.stiffness - 1.0, model.parameter_count
        )
        sigma = mixture.relative_sigma(magnitude, points.amplitude, points.force_std)
        found = _project(model, points, sigma, [found.theta])
    return found, sigma


def _project(model: BenchModel, points: OperatingPoints, sigma: Array, starts: Sequence[Array]) -> VariableProjectionResult:
    lower, upper = _bounds(model, points)

    def evaluate(theta: Array) -> Array:
        rows = _weighted_rows(model, points, sigma, theta)
        gram: Array = rows @ rows.T
        return gram

    best: VariableProjectionResult | None = None
    free = np.zeros(model.layout.linear, dtype=bool)
    for start in starts:
        found = minimise(evaluate, start, lower, upper, model.layout.linear, model.sensitivities, free)
        if np.any(found.coefficients[model.positive] < 0.0):
            found = minimise(evaluate, found.theta, lower, upper, model.layout.linear, model.sensitivities, model.positive)
        if best is None or found.cost < best.cost:
            best = found
    if best is None:
        raise InputDataError("no start value was given")
    order = np.argsort(best.theta[: model.layout.cells])
    theta, coefficients = best.theta.copy(), best.coefficients.copy()
    theta[: order.size] = theta[order]
    first = model.layout.static
    coefficients[first : first + order.size] = coefficients[first + order]
    return dataclasses.replace(best, theta=theta, coefficients=coefficients)


def _refine(
    model: BenchModel, points: OperatingPoints, sigma: Array, theta: Array, coefficients: Array, norm: str, beta: float
) -> tuple[Array, Array]:
    """Minimise the misfit of K and W from the complex-modulus solution."""
    measured = np.abs(points.stiffness)
    energy = np.pi * points.amplitude**2
    linear = coefficients.size
    scale = np.where(coefficients == 0.0, 1.0, np.abs(coefficients))
    weight = RELATIVE_FLOOR / sigma

    def residual(p: Array) -> Array:
        value = complex_stiffness(model.layout, p[linear:], p[:linear] * scale, points.omega, points.amplitude)
        stiffness = (np.abs(value) - measured) / measured
        loss = energy * value.imag - points.loss_energy
        if norm == "printed":
            return np.concatenate([np.sqrt(beta) * stiffness, np.sqrt(1 - beta) * loss / points.loss_energy])
        return np.concatenate([np.sqrt(beta) * stiffness, np.sqrt(1 - beta) * loss / (energy * measured)]) * np.tile(weight, 2)

    lower = np.concatenate([np.where(model.positive, 0.0, -np.inf), _bounds(model, points)[0]])
    upper = np.concatenate([np.full(linear, np.inf), _bounds(model, points)[1]])
    start = np.concatenate([coefficients / scale, theta])
    start = np.clip(start, lower + 1e-9, upper - 1e-9)
    found = scipy.optimize.least_squares(residual, start, bounds=(lower, upper), xtol=1e-12, ftol=1e-12, gtol=1e-12)
    return found.x[linear:], found.x[:linear] * scale


def _finish(
    model: BenchModel,
    points: OperatingPoints,
    sigma: Array,
    theta: Array,
    coefficients: Array,
    norm: str,
    found: VariableProjectionResult,
) -> FrequencyDomainFit:
    rows = _weighted_rows(model, points, sigma, theta)
    p = model.layout.linear
    jacobian = rows[:-1].copy()
    jacobian[p:] *= coefficients[model.sensitivities][:, None]
    residual = rows[-1] - coefficients @ rows[:p]
    variance = float(residual @ residual) / max(residual.size - model.parameter_count, 1)
    scale = np.sqrt(np.maximum(np.sum(jacobian**2, axis=1), 1e-300))
    inverse = np.linalg.pinv((jacobian @ jacobian.T) / np.outer(scale, scale), rcond=1e-12, hermitian=True)
    to_physical = model.physical_jacobian(theta, coefficients)
    covariance = to_physical @ (inverse / np.outer(scale, scale)) @ to_physical.T * variance
    value = complex_stiffness(model.layout, theta, coefficients, points.omega, points.amplitude)
    measured = np.abs(points.stiffness)
    names = [q.name for q in model.quantities]
    at_limit = set(found.at_bound) | {i - model.layout.static for i in found.at_zero}
    hit = tuple(n for i, n in enumerate(names) if i >= model.layout.static and (i - model.layout.static) // 2 in at_limit)
    return FrequencyDomainFit(
        model,
        model.physical(theta, coefficients),
        theta,
        coefficients,
        np.sqrt(np.maximum(np.diag(covariance), 0.0)),
        np.abs(value) / measured - 1.0,
        (value.imag - points.stiffness.imag) / measured,
        norm,
        sigma,
        hit,
    )
