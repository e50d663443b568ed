# Copyright 2026 ride_estimation contributors
"""Bounded multi-start least squares of the six quarter-car models, nested models never worse than what they contain."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.identification.quarter_car import plausibility
from ride_estimation.identification.quarter_car.models import MODELS, PARAMETERS, QuarterCarModel, QuarterCarSimulation
from ride_estimation.metrics import nrmse

Array = NDArray[np.float64]

_POSITIVE = ("spring_rate", "tyre_rate", "damping")  # estimated in logarithm
_SINE = ("sine_in_phase", "sine_quadrature", "sine_frequency")
#: two parameters whose relative standard deviation exceeds this are not identified by the run
_IDENTIFIED = 0.5
#: starts followed, evaluations before the ways are compared, ways kept within this factor of the best, evaluations to the end
_DESCENTS, _FIRST_EVALUATIONS, _CLOSE, _EVALUATIONS = 3, 10, 1.02, 60


@dataclasses.dataclass(frozen=True)
class Sinusoid:
    """A sinusoid the way an engineer can check it; document 002 reports none of the three."""

    amplitude: float
    frequency_hz: float
    phase_rad: float
    unit: str


@dataclasses.dataclass(frozen=True)
class QuarterCarFit:
    """Result of one model.

    Attributes
    ----------
    model
        Which of the six.
    values, std
        Every parameter; std only of the fitted ones, ``inf`` where the run does not identify them.
    sum_of_squares
        Weighted sum of squared residuals, comparable among models of one call.
    nrmse
        Body and axle acceleration error over their standard deviation.
    on_bounds, not_identified
        Names.
    sinusoid
        None for models without.
    plausible
        The gate of row 2-10.
    """

    model: QuarterCarModel
    values: dict[str, float]
    std: dict[str, float]
    sum_of_squares: float
    nrmse: tuple[float, float]
    on_bounds: tuple[str, ...]
    not_identified: tuple[str, ...]
    sinusoid: Sinusoid | None
    plausible: plausibility.Plausibility


def fit_models(
    road: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    *,
    sprung_mass: float,
    unsprung_mass: float,
    noise_std: tuple[float, float],
    fixed: Mapping[str, float] | None = None,
    seed: int = 0,
    starts: int = 4,
    models: Sequence[int] = (1, 2, 3, 4, 5, 6),
) -> tuple[QuarterCarFit, ...]:
    """Fit the models of document 002 to measured body and axle accelerations by simulation error.

    Every model starts from the solutions of the models it contains and from random points, so that the sum of squares of
    a larger model is never above that of a smaller one (Tables II and III of the document break this).

    Parameters
    ----------
    road
        Road displacement at the wheel centre [m], shape (N,).
    measured
        Body and axle acceleration [m/s^2], shape (N, 2).
    rate_hz
        [Hz].
    sprung_mass, unsprung_mass
        Known masses [kg]; without them only ratios are identifiable.
    noise_std
        Standard deviation of the two measured channels [m/s^2].
    fixed
        Parameters held at known values (a leaf spring rate from geometry).
    seed, starts
        Random starts per model.

    Raises
    ------
    InputDataError
        Shapes that do not fit, values not finite, too short, masses or noise not positive, unknown names in ``fixed``.
    """
    u, y = np.asarray(road, dtype=float).ravel(), np.asarray(measured, dtype=float)
    if y.shape != (u.size, 2) or u.size < 50:
        raise InputDataError(f"road of shape (N,) and accelerations of shape (N, 2), N >= 50; given {u.shape} and {y.shape}")
    if not (np.all(np.isfinite(u)) and np.all(np.isfinite(y))):
        raise InputDataError("road or accelerations contain values that are not finite")
    if not (0.0 < sprung_mass < np.inf and 0.0 < unsprung_mass < np.inf and min(noise_std) > 0.0):
        raise InputDataError(
            f"masses {sprung_mass:g} kg, {unsprung_mass:g} kg and noise {noise_std[0]:g}, {noise_std[1]:g} m/s^2 must be positive"
        )
    held = dict(fixed or {})
    unknown = [n for n in held if n not in PARAMETERS]
    if unknown:
        raise InputDataError(f"unknown parameter {', '.join(unknown)}; allowed: {', '.join(PARAMETERS)}")
    problem = _Problem(QuarterCarSimulation(sprung_mass, unsprung_mass, u, rate_hz), y, np.asarray(noise_std), rate_hz, held)
    rng = np.random.default_rng(seed)
    done: dict[int, QuarterCarFit] = {}
    for model in MODELS:
        needed = model.number in models or any(model.number in m.contains for m in MODELS if m.number in models)
        if needed:
            inner = [done[n].values for n in model.contains if n in done]
            best = problem.solve(model, problem.start_values(model, inner, rng, starts))
            done[model.number] = _result(problem, model, best, (sprung_mass, unsprung_mass))
    return tuple(done[n] for n in sorted(done) if n in models)


class _Problem:
    """The least squares problem of one run."""

    def __init__(
        self, simulation: QuarterCarSimulation, measured: Array, noise: Array, rate_hz: float, fixed: dict[str, float]
    ) -> None:
        self.simulation, self.measured, self.noise, self.rate_hz, self.fixed = simulation, measured, noise, rate_hz, fixed

    def free(self, model: QuarterCarModel) -> list[str]:
        """Return the names fitted for a model."""
        return [n for n in model.free if n not in self.fixed]

    def residual(self, model: QuarterCarModel, values: dict[str, float]) -> Array:
        """Return the weighted residual, shape (2 N,)."""
        error = (self.simulation.run(values, model.sine) - self.measured) / self.noise
        return np.asarray(np.nan_to_num(error, nan=1e6, posinf=1e6, neginf=-1e6).ravel())

    def start_values(
        self, model: QuarterCarModel, inner: list[dict[str, float]], rng: np.random.Generator, starts: int
    ) -> list[dict[str, float]]:
        """Return starting points: contained solutions, the literature, random ones; the sinusoid from the residual."""
        literature = {n: p.literature if n in model.free else p.off for n, p in PARAMETERS.items()} | self.fixed
        found = [dict(v) for v in inner] + [literature]
        for _ in range(starts):
            guess = dict(literature)
            for name in self.free(model):
                if name in _POSITIVE:
                    guess[name] *= float(np.exp(rng.uniform(-1.5, 1.5)))
            found.append(guess)
        return [self._with_sine(model, g) for g in found] if model.sine else found

    def _with_sine(self, model: QuarterCarModel, values: dict[str, float]) -> dict[str, float]:
        """Start the sinusoid at the strongest line of the residual of the body, with the best amplitude there."""
        if values["sine_in_phase"] != 0.0 or values["sine_quadrature"] != 0.0:
            return values
        error = self.measured - self.simulation.run(values, "")
        window = np.hanning(error.shape[0])
        size = 8 * error.shape[0]
        spectrum = np.abs(np.fft.rfft(error[:, 0] * window, size))
        frequency = np.fft.rfftfreq(size, 1.0 / self.rate_hz)
        parameter = PARAMETERS["sine_frequency"]
        inside = (frequency > max(parameter.lower, 2.0 * self.rate_hz / error.shape[0])) & (frequency < parameter.upper)
        best = dict(values)
        best["sine_frequency"] = float(frequency[inside][np.argmax(spectrum[inside])])
        unit = 1e-3 if model.sine == "road" else 100.0
        columns = []
        for name in ("sine_in_phase", "sine_quadrature"):
            trial = dict(best) | {name: unit}
            columns.append(((self.simulation.run(trial, model.sine) - self.measured + error) / self.noise).ravel() / unit)
        solution, *_ = np.linalg.lstsq(np.column_stack(columns), (error / self.noise).ravel(), rcond=None)
        best["sine_in_phase"], best["sine_quadrature"] = (float(v) for v in solution)
        return best

    def solve(self, model: QuarterCarModel, starts: list[dict[str, float]]) -> tuple[dict[str, float], Array, Array]:
        """Return (values, residual, Jacobian in fitted coordinates) of the best start."""
        names = self.free(model)
        lower, upper, scale = _transformed_bounds(names, starts)

        def objective(z: Array, base: dict[str, float]) -> Array:
            return self.residual(model, base | _untransform(names, z))

        def descend(start: dict[str, float], evaluations: int) -> tuple[dict[str, float], Array, Array]:
            z0 = np.clip(_transform(names, start), lower + 1e-9 * scale, upper - 1e-9 * scale)
            result = scipy.optimize.least_squares(
                objective, z0, bounds=(lower, upper), x_scale=scale, args=(start,), method="trf", xtol=1e-8, ftol=1e-8,
                diff_step=1e-6, max_nfev=evaluations,
            )
            start_residual = self.residual(model, start)
            if np.sum(start_residual**2) < np.sum(result.fun**2):
                return start, start_residual, result.jac
            return start | _untransform(names, result.x), result.fun, result.jac

        def cost(found: tuple[dict[str, float], Array, Array]) -> float:
            return float(np.sum(found[1] ** 2))

        nearest = sorted(starts, key=lambda s: float(np.sum(self.residual(model, s) ** 2)))[:_DESCENTS]
        ways = [descend(start, _FIRST_EVALUATIONS) for start in nearest]
        level = _CLOSE * min(cost(way) for way in ways)
        return min((descend(way[0], _EVALUATIONS) for way in ways if cost(way) <= level), key=cost)


def _transform(names: list[str], values: dict[str, float]) -> Array:
    return np.array([math.log(values[n]) if n in _POSITIVE else values[n] for n in names])


def _untransform(names: list[str], z: Array) -> dict[str, float]:
    return {n: math.exp(v) if n in _POSITIVE else float(v) for n, v in zip(names, z)}


def _transformed_bounds(names: list[str], starts: list[dict[str, float]]) -> tuple[Array, Array, Array]:
    lower = [math.log(PARAMETERS[n].lower) if n in _POSITIVE else PARAMETERS[n].lower for n in names]
    upper = [math.log(PARAMETERS[n].upper) if n in _POSITIVE else PARAMETERS[n].upper for n in names]
    sine = max((abs(s[n]) for s in starts for n in _SINE[:2]), default=0.0) or 1.0
    scales = {"tyre_damping": 1000.0, "sine_in_phase": sine, "sine_quadrature": sine, "sine_frequency": 0.05}
    return np.array(lower), np.array(upper), np.array([scales.get(n, 0.3) for n in names])


def _result(
    problem: _Problem, model: QuarterCarModel, best: tuple[dict[str, float], Array, Array], masses: tuple[float, float]
) -> QuarterCarFit:
    values, residual, jacobian = best
    names = problem.free(model)
    modelled = problem.simulation.run(values, model.sine)
    degrees = max(residual.size - len(names), 1)
    variance = max(float(residual @ residual) / degrees, 1.0)
    relative = relative_std(jacobian, variance)
    std = {}
    for name, s in zip(names, relative):
        std[name] = float(s * values[name]) if name in _POSITIVE else float(s)
    bounds = tuple(n for n in names if _at_bound(n, values[n]))
    loose = tuple(n for n in names if n not in _SINE and std[n] > _IDENTIFIED * max(abs(values[n]), 1e-12))
    tyre_force = -masses[1] * modelled[:, 1] - masses[0] * modelled[:, 0]
    sinusoid = _sinusoid(model, values) if model.sine else None
    return QuarterCarFit(
        model=model,
        values=values,
        std=std,
        sum_of_squares=float(residual @ residual),
        nrmse=(nrmse(problem.measured[:, 0], modelled[:, 0]), nrmse(problem.measured[:, 1], modelled[:, 1])),
        on_bounds=bounds,
        not_identified=loose,
        sinusoid=sinusoid,
        plausible=plausibility.check(*masses, values, tyre_force),
    )


def relative_std(jacobian: Array, variance: float) -> Array:
    """Return the standard deviations in the coordinates of a Jacobian, ``inf`` where the residual does not depend on one.

    Parameters
    ----------
    jacobian
        Of the weighted residual, shape (M, P).
    variance
        Of the weighted residual.
    """
    scale = np.linalg.norm(jacobian, axis=0)
    blind = scale <= 1e-12 * max(float(scale.max()), 1e-300)
    scaled = jacobian / np.where(blind, 1.0, scale)
    covariance = np.linalg.pinv(scaled.T @ scaled, rcond=1e-12) * variance
    return np.where(blind, np.inf, np.sqrt(np.maximum(np.diag(covariance), 0.0)) / np.where(blind, 1.0, scale))


def _at_bound(name: str, value: float) -> bool:
    parameter = PARAMETERS[name]
    span = abs(value) if name in _POSITIVE else max(abs(parameter.literature), 1.0)
    return abs(value - parameter.lower) < 1e-3 * span or abs(parameter.upper - value) < 1e-3 * span


def _sinusoid(model: QuarterCarModel, values: dict[str, float]) -> Sinusoid:
    a, b = values["sine_in_phase"], values["sine_quadrature"]
    return Sinusoid(math.hypot(a, b), values["sine_frequency"], math.atan2(b, a), "m" if model.sine == "road" else "N")
