# Copyright 2026 ride_estimation contributors
"""An oscillator from a record of excitation and response: is its spring linear, and which power bends it.

``m y'' + d y' + k y + k2 y^2 + k3 y^3 = u`` sampled at a coarse rate is fitted as the second-order recursion ::

    y[n] = a1 y[n-1] + a2 y[n-2] + b0 u[n] + b1 u[n-1] + b2 u[n-2] + e + c2 y[n-1]^2 + c3 y[n-1]^3 + c4 y[n-1]^2 (y[n-1]-y[n-2])

by SIMULATION error (only u is fed, never the measured y) with exact sensitivities. Three input coefficients take up
whatever hold the excitation had. In rest the recursion gives ``k y + k2 y^2 + k3 y^3 = u`` with ``k = (1-a1-a2)/B``,
``k2 = -c2/B``, ``k3 = -c3/B``, ``B = b0+b1+b2``; frequency and damping follow from the roots of ``z^2 - a1 z - a2``.
The mass itself is not identifiable without knowing u as a force.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.uncertainty import effective_samples
from ride_estimation.jit import compile_kernel
from ride_estimation.metrics import nrmse

Array = NDArray[np.float64]

#: share of the response's standard deviation below which errors are rounding and choose no model
_RESOLUTION = 1.0e-6

#: names of the recursion's coefficients
COEFFICIENTS = ("a1", "a2", "b0", "b1", "b2", "e", "c2", "c3", "c4")
#: the ladder: name -> coefficients used
LADDER: dict[str, tuple[int, ...]] = {
    "linear": (0, 1, 2, 3, 4, 5),
    "quadratic_spring": (0, 1, 2, 3, 4, 5, 6),
    "cubic_spring": (0, 1, 2, 3, 4, 5, 7),
    "quadratic_cubic_spring": (0, 1, 2, 3, 4, 5, 6, 7),
    "cubic_spring_and_damping": (0, 1, 2, 3, 4, 5, 6, 7, 8),
}
CRITERION = "N_eff ln(held-out mean squared simulation error) + P ln(N_eff); smallest wins"
#: periods of the resonance left out of the score at the start of a simulation
_SETTLING_PERIODS = 30


@dataclasses.dataclass(frozen=True)
class OscillatorRecord:
    """Excitation u and response y on a uniform time base."""

    name: str
    step_s: float
    u: Array
    y: Array


@dataclasses.dataclass(frozen=True)
class OscillatorRung:
    """One fitted oscillator.

    Attributes
    ----------
    name
        Rung of ``LADDER``.
    coefficients, std
        Recursion coefficients and standard deviations, order of ``COEFFICIENTS``, shape (9,).
    physical
        frequency_hz, damping_ratio, stiffness, quadratic, cubic (per unit of u), with the sign of a hardening spring
        positive.
    fitted_rms, fitted_nrmse
        Simulation error on the fitted part.
    held_out
        Name -> (rms error, NRMSE std) on what was not fitted.
    mse
        Mean squared held-out error, each record scaled by its variance.
    criterion, gain
        See ``CRITERION``; fall of the held-out error against the rung before.
    """

    name: str
    coefficients: Array
    std: Array
    physical: dict[str, float]
    fitted_rms: float
    fitted_nrmse: float
    held_out: dict[str, tuple[float, float]]
    mse: float
    criterion: float = np.nan
    gain: float = np.nan


@compile_kernel
def simulate_oscillator(p: Array, u: Array, y0: float, y1: float, used: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return the simulated response, shape (N,), and its sensitivities by the used coefficients, shape (N, P)."""
    n, q = u.size, used.size
    y = np.empty(n)
    s = np.zeros((n, q))
    regressor = np.empty(9)
    y[0], y[1] = y0, y1
    for k in range(2, n):
        a, b = y[k - 1], y[k - 2]
        regressor[0], regressor[1] = a, b
        regressor[2], regressor[3], regressor[4], regressor[5] = u[k], u[k - 1], u[k - 2], 1.0
        regressor[6], regressor[7], regressor[8] = a * a, a * a * a, a * a * (a - b)
        value = 0.0
        for i in range(9):
            value += p[i] * regressor[i]
        y[k] = value
        if abs(value) > 1e6:
            y[k:] = np.inf
            break
        by_a = p[0] + 2.0 * p[6] * a + 3.0 * p[7] * a * a + p[8] * (3.0 * a * a - 2.0 * a * b)
        by_b = p[1] - p[8] * a * a
        for j in range(q):
            s[k, j] = regressor[used[j]] + by_a * s[k - 1, j] + by_b * s[k - 2, j]
    return y, s


def fit_oscillator(
    record: OscillatorRecord, name: str, keep: NDArray[np.bool_], start: Array | None = None, iterations: int = 60
) -> tuple[Array, Array, float]:
    """Fit one rung by simulation error on the samples of ``keep``; return coefficients, std, rms error."""
    used = np.asarray(LADDER[name], dtype=np.int64)
    scale_u, scale_y = float(np.std(record.u)), float(np.std(record.y))
    u, y = record.u / scale_u, record.y / scale_y
    p = _equation_error_start(u, y, used) if start is None else start * _scaling(scale_u, scale_y)
    damping = 1e-3
    model, sensitivity = simulate_oscillator(p, u, y[0], y[1], used)
    cost = _cost(model, y, keep)
    for _ in range(iterations):
        jacobian = sensitivity[keep]
        residual = (y - model)[keep]
        h = jacobian.T @ jacobian
        gradient = jacobian.T @ residual
        step = np.linalg.solve(h + damping * np.diag(np.diag(h)) + 1e-300 * np.eye(used.size), gradient)
        trial = p.copy()
        trial[used] += step
        trial_model, trial_sensitivity = simulate_oscillator(trial, u, y[0], y[1], used)
        trial_cost = _cost(trial_model, y, keep)
        if trial_cost < cost:
            fall = 1.0 - trial_cost / cost
            p, model, sensitivity, cost = trial, trial_model, trial_sensitivity, trial_cost
            damping = max(0.2 * damping, 1e-9)
            if fall < 1e-9:
                break
        else:
            damping *= 5.0
            if damping > 1e9:
                break
    jacobian, residual = sensitivity[keep], (y - model)[keep]
    inflation = residual.size / effective_samples(residual)
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * cost / residual.size * inflation
    std = np.zeros(9)
    std[used] = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    factor = _scaling(scale_u, scale_y)
    return p / factor, std / factor, scale_y * float(np.sqrt(cost / residual.size))


def _scaling(scale_u: float, scale_y: float) -> Array:
    """Return the factors from coefficients in record units to coefficients of the unit-variance signals."""
    s = scale_u / scale_y
    return np.array([1.0, 1.0, s, s, s, 1.0 / scale_y, scale_y, scale_y**2, scale_y**2])


def _equation_error_start(u: Array, y: Array, used: NDArray[np.int64]) -> Array:
    a, b = y[1:-1], y[:-2]
    columns = np.stack([a, b, u[2:], u[1:-1], u[:-2], np.ones_like(a), a**2, a**3, a**2 * (a - b)], axis=1)[:, used]
    p = np.zeros(9)
    p[used] = np.linalg.lstsq(columns, y[2:], rcond=None)[0]
    # the start must not ring up: pull the poles inside the unit circle
    radius = float(np.max(np.abs(np.roots([1.0, -p[0], -p[1]]))))
    if radius >= 0.999:
        p[0], p[1] = p[0] * 0.998 / radius, p[1] * (0.998 / radius) ** 2
    return p


def _cost(model: Array, y: Array, keep: NDArray[np.bool_]) -> float:
    if not np.all(np.isfinite(model)):
        return np.inf
    return float(np.sum((model - y)[keep] ** 2))


def physical(p: Array, step_s: float) -> dict[str, float]:
    """Return frequency, damping ratio and the static curve of a recursion, per unit of u."""
    roots = np.roots([1.0, -p[0], -p[1]]).astype(complex)
    pole = np.log(roots[0]) / step_s
    total = float(p[2] + p[3] + p[4])
    return {
        "frequency_hz": float(abs(pole) / (2.0 * np.pi)),
        "damping_ratio": float(-pole.real / abs(pole)),
        "stiffness": float((1.0 - p[0] - p[1]) / total),
        "quadratic": float(-p[6] / total),
        "cubic": float(-p[7] / total),
    }


def identify_oscillator(
    record: OscillatorRecord,
    fit: NDArray[np.bool_],
    validation: Sequence[OscillatorRecord] = (),
    choose: NDArray[np.bool_] | None = None,
) -> tuple[tuple[OscillatorRung, ...], int]:
    """Climb the ladder; return the rungs and the index of the chosen one.

    Parameters
    ----------
    record
        Record with the fitted part.
    fit
        Samples that are fitted; the others are held out, shape (N,).
    validation
        Further records that are not fitted.
    choose
        Samples of the record that choose the rung, shape (N,); all that are not fitted where None.

    Raises
    ------
    InputDataError
        Nothing is held out, constant signals, values that are not finite.
    """
    for item in (record, *validation):
        _check(item)
    held_out = ~fit if choose is None else choose
    if not validation and np.sum(held_out) < 200:
        raise InputDataError("no held-out samples: give --validate or a fit range that leaves some")
    rungs: list[OscillatorRung] = []
    errors: list[Array] = []
    start: Array | None = None
    for name in LADDER:
        p, std, rms = fit_oscillator(record, name, fit, start)
        start = p if start is None else start
        held, error = _score(record, held_out, validation, p)
        mse = float(np.mean(error**2))
        gain = float(1.0 - np.sqrt(mse / rungs[-1].mse)) if rungs else np.nan
        rungs.append(
            OscillatorRung(
                name,
                p,
                std,
                physical(p, record.step_s),
                rms,
                rms / float(np.std(record.y[fit])),
                held,
                mse,
                gain=gain,
            )
        )
        errors.append(error)
    best = int(np.argmin([r.mse for r in rungs]))
    n = effective_samples(errors[best])
    floor = (_RESOLUTION * float(np.std(record.y))) ** 2
    scored = tuple(
        dataclasses.replace(r, criterion=float(n * np.log(max(r.mse, floor)) + len(LADDER[r.name]) * np.log(n))) for r in rungs
    )
    return scored, int(np.argmin([r.criterion for r in scored]))


def _score(
    record: OscillatorRecord, held: NDArray[np.bool_], validation: Sequence[OscillatorRecord], p: Array
) -> tuple[dict[str, tuple[float, float]], Array]:
    found, errors = {}, []
    pairs = [(record, held, " (held-out part)")] if held.any() else []
    pairs += [(v, np.ones(v.u.size, dtype=bool), "") for v in validation]
    for item, part, suffix in pairs:
        model, _ = simulate_oscillator(p, item.u, item.y[0], item.y[1], np.zeros(0, dtype=np.int64))
        keep = part.copy()
        settled = _settling(p, item.step_s)
        keep[:settled] = False
        if not np.any(keep):
            raise InputDataError(
                f"{item.name}{suffix}: nothing is left to judge the model by: it has {item.u.size} samples, and the oscillator "
                f"takes {settled} to forget its start"
            )
        measured, modelled = item.y[keep], np.nan_to_num(model[keep], posinf=1e6)
        found[item.name + suffix] = (float(np.sqrt(np.mean((measured - modelled) ** 2))), nrmse(measured, modelled))
        errors.append((measured - modelled) / np.std(measured))
    return found, np.concatenate(errors)


def _settling(p: Array, step_s: float) -> int:
    return int(_SETTLING_PERIODS / max(physical(p, step_s)["frequency_hz"] * step_s, 1e-6))


def _check(record: OscillatorRecord) -> None:
    for name, values in (("input", record.u), ("output", record.y)):
        if values.size < 1000:
            raise InputDataError(f"{record.name}: {name} has {values.size} samples, at least 1000 are needed")
        if not np.all(np.isfinite(values)):
            raise InputDataError(f"{record.name}: {name} has values that are not finite")
        if np.ptp(values) == 0.0:
            raise InputDataError(f"{record.name}: {name} is constant")
