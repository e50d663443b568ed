# Copyright 2026 ride_estimation contributors
"""Least squares with the linear parameters eliminated (variable projection), from Gram matrices alone.

For ``F = B(theta) a`` the best ``a`` at given theta follows from the normal equations; the reduced problem in theta is
solved by Levenberg-Marquardt with Kaufman's Jacobian ``J_j = -P a_j dB_j``, ``P`` the projector off the columns of B. All
that is needed is the Gram matrix of ``[B, dB, F]``, one pass over the data per trial.

Source: Golub and Pereyra 1973, Kaufman 1975; use for this problem: project notes, time-domain identification.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]

#: relative fall of the cost, promised or made, below which the search has arrived
COST_TOLERANCE = 1.0e-9
#: change of log parameters below which the search has arrived
STEP_TOLERANCE = 1.0e-6
#: coefficients whose eigen-direction is weaker than this share of the strongest are not resolved
RANK_TOLERANCE = 1.0e-12
_TINY = float(np.finfo(float).tiny)


@dataclasses.dataclass(frozen=True)
class Projection:
    """Linear solution, cost and Kaufman quantities at one theta."""

    coefficients: Array
    cost: float
    gradient: Array
    hessian: Array
    at_zero: tuple[int, ...]


@dataclasses.dataclass(frozen=True)
class VariableProjectionResult:
    """Outcome of one search.

    Attributes
    ----------
    theta, coefficients
        Nonlinear (logarithms) and linear parameters.
    cost
        Sum of squared residuals.
    gram
        Gram matrix at the solution, offset eliminated.
    iterations, passes
        Accepted steps, passes over the data.
    at_zero
        Linear parameters held at their bound 0.
    at_bound
        Nonlinear parameters at a bound.
    prediction_error
        Share by which the last steps missed the fall of the cost they promised: how wrong the Hessian is.
    """

    theta: Array
    coefficients: Array
    cost: float
    gram: Array
    iterations: int
    passes: int
    at_zero: tuple[int, ...]
    at_bound: tuple[int, ...]
    converged: bool
    prediction_error: float


def eliminate_offset(gram: Array) -> Array:
    """Return the Gram matrix with the constant column (the last but one) projected out."""
    size = gram.shape[0]
    keep = np.arange(size - 1)
    keep[-1] = size - 1
    column = gram[keep, size - 2]
    reduced: Array = gram[keep][:, keep] - column[:, None] * (column / gram[size - 2, size - 2])
    return reduced


def first_order(gram: Array, step: Array, linear: int, sensitivities: NDArray[np.int64]) -> Array:
    """Return the Gram matrix of ``[B + dB step, dB, F]``: that of a small step in theta without another pass over the data.

    Parameters
    ----------
    gram
        Gram matrix of [B, dB, F], offset eliminated, shape (P + Q + 1, P + Q + 1).
    step
        Change of theta, shape (Q,).
    linear, sensitivities
        See :func:`project`.
    """
    change = np.eye(gram.shape[0])
    change[linear + np.arange(step.size), sensitivities] = step
    moved: Array = change.T @ gram @ change
    return moved


def solve_linear(basis: Array, target: Array, positive: NDArray[np.bool_]) -> tuple[Array, tuple[int, ...]]:
    """Solve normal equations with some coefficients not below zero (active set); columns are scaled first."""
    scale = np.sqrt(np.maximum(np.diag(basis), _TINY))
    a, b = basis / np.outer(scale, scale), target / scale
    free = np.ones(b.size, dtype=bool)
    for _ in range(2 * b.size):
        solution = np.zeros(b.size)
        index = np.flatnonzero(free)
        solution[index] = _solve_symmetric(a[np.ix_(index, index)], b[index])
        wrong = positive & free & (solution < 0.0)
        if wrong.any():
            free[int(np.argmin(np.where(wrong, solution, np.inf)))] = False
            continue
        pull = b - a @ solution
        pull[free] = 0.0
        release = int(np.argmax(pull))
        if pull[release] <= 1e-12 * float(np.abs(b).max(initial=1e-300)):
            break
        # a released coefficient that turns negative again would cycle: leave it at its bound
        trial = np.append(index, release)
        if _solve_symmetric(a[np.ix_(trial, trial)], b[trial])[-1] <= 0.0:
            break
        free[release] = True
    return solution / scale, tuple(int(i) for i in np.flatnonzero(~free))


def _solve_symmetric(a: Array, b: Array) -> Array:
    solved: Array = _pseudo_inverse(a) @ b
    return solved


def project(gram: Array, linear: int, sensitivities: NDArray[np.int64], positive: NDArray[np.bool_]) -> Projection:
    """Evaluate the reduced problem from a Gram matrix of [B, dB, F].

    Parameters
    ----------
    gram
        Shape (P + Q + 1, P + Q + 1).
    linear
        P.
    sensitivities
        Coefficient each sensitivity column belongs to, shape (Q,).
    positive
        Coefficients that may not fall below zero, shape (P,).
    """
    basis, target = gram[:linear, :linear], gram[:linear, -1]
    scale = np.sqrt(np.maximum(basis.diagonal(), _TINY))
    size = scale[:, None] * scale
    inverse = _pseudo_inverse(basis / size) / size
    coefficients = inverse @ target
    at_zero: tuple[int, ...] = ()
    if (positive & (coefficients < 0.0)).any():
        coefficients, at_zero = solve_linear(basis, target, positive)
        free = np.setdiff1d(np.arange(linear), np.asarray(at_zero, dtype=int))
        part = scale[free]
        inverse = np.zeros_like(basis)
        inverse[np.ix_(free, free)] = _pseudo_inverse(basis[np.ix_(free, free)] / (part[:, None] * part)) / (part[:, None] * part)
    power = float(gram[-1, -1])
    cost = power - 2.0 * float(coefficients @ target) + float(coefficients @ basis @ coefficients)
    cost = max(cost, 1e-15 * power)
    rows = gram[linear : linear + sensitivities.size]
    cross = rows[:, :linear]
    a = coefficients[sensitivities]
    hessian = (rows[:, linear:-1] - cross @ inverse @ cross.T) * (a[:, None] * a)
    gradient = -a * (rows[:, -1] - cross @ coefficients)
    return Projection(coefficients, cost, gradient, hessian, at_zero)


def _pseudo_inverse(symmetric: Array) -> Array:
    if symmetric.size == 0:
        return np.zeros((0, 0))  # every coefficient is held at zero
    values, vectors = np.linalg.eigh(symmetric)
    least = RANK_TOLERANCE * values[-1]
    inverse = (values > least) / np.maximum(values, max(float(least), 1e-300))
    result: Array = (vectors * inverse) @ vectors.T
    return result


def _within(values: Array, lower: Array | float, upper: Array | float) -> Array:
    bounded: Array = np.minimum(np.maximum(values, lower), upper)
    return bounded


def minimise(
    evaluate: Callable[[Array], Array],
    start: Array,
    lower: Array,
    upper: Array,
    linear: int,
    sensitivities: NDArray[np.int64],
    positive: NDArray[np.bool_],
    *,
    cost_tolerance: float = COST_TOLERANCE,
    prediction_error: float = 1.0,
    max_passes: int = 60,
) -> VariableProjectionResult:
    """Minimise the reduced cost by Levenberg-Marquardt inside bounds.

    Parameters
    ----------
    evaluate
        theta -> Gram matrix of [B, dB, F].
    start, lower, upper
        Nonlinear parameters (logarithms), shape (Q,).
    linear, sensitivities, positive
        See :func:`project`.
    cost_tolerance
        Relative fall of the cost, promised or made, below which the search has arrived.
    prediction_error
        That of a search of the same problem on decimated data.
    max_passes
        Limit of passes over the data.
    """
    theta = _within(start, lower, upper)
    gram = evaluate(theta)
    if not np.isfinite(gram).all():
        raise InputDataError("the record and the start values give no finite model force")
    point = project(gram, linear, sensitivities, positive)
    passes, iterations, damping, converged = 1, 0, 1e-3, theta.size == 0
    while passes < max_passes and not converged:
        held = ((theta <= lower) & (point.gradient > 0)) | ((theta >= upper) & (point.gradient < 0))
        move = np.flatnonzero(~held)
        if move.size == 0:
            converged = True
            break
        h = point.hessian[move[:, None], move]
        least = max(1e-12 * float(np.abs(point.hessian.diagonal()).max()), 1e-300)
        step = np.zeros(theta.size)
        h.flat[:: move.size + 1] += damping * np.maximum(h.diagonal(), least)
        step[move] = -np.linalg.solve(h, point.gradient[move])
        promised = float(-step[move] @ point.gradient[move])
        trial = _within(theta + _within(step, -2.0, 2.0), lower, upper)
        # a Hessian wrong by a share misses a promise by that share and the optimum by its square: where that is far less than
        # noise can tell, the step needs no pass over the data
        if promised * prediction_error**2 < cost_tolerance * point.cost:
            moved = first_order(gram, trial - theta, linear, sensitivities)
            moved_point = project(moved, linear, sensitivities, positive)
            if moved_point.cost <= point.cost:
                theta, gram, point = trial, moved, moved_point
            converged = True
            break
        if float(np.abs(trial - theta).max()) < STEP_TOLERANCE:
            converged = True
            break
        trial_gram = evaluate(trial)
        trial_point = project(trial_gram, linear, sensitivities, positive)
        passes += 1
        if trial_point.cost < point.cost:
            fall = (point.cost - trial_point.cost) / point.cost
            # a promise that happens to be kept proves little
            prediction_error = min(1.0, max(abs(1.0 - fall * point.cost / promised), 0.1 * prediction_error))
            theta, gram, point = trial, trial_gram, trial_point
            iterations += 1
            damping = max(damping * 0.1, 1e-9)
            converged = fall < cost_tolerance
        else:
            damping *= 10.0
            converged = damping > 1e8
    bound = np.flatnonzero((theta <= lower + 1e-9) | (theta >= upper - 1e-9))
    return VariableProjectionResult(
        theta,
        point.coefficients,
        point.cost,
        gram,
        iterations,
        passes,
        point.at_zero,
        tuple(int(i) for i in bound),
        bool(converged),
        prediction_error,
    )
