# Copyright 2026 ride_estimation contributors
"""How sure the identified parameters are: standard deviations, correlation, effective samples, null direction."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.identification.bench.reversals import Motion
from ride_estimation.identification.bench.time_domain import PreparedRecord, TimeDomainFit, full_jacobian

Array = NDArray[np.float64]

#: a parameter whose relative standard deviation exceeds this is not identifiable
NOT_IDENTIFIABLE = 0.5
#: blocks of the record from which the long-run covariance of the score is estimated
_BLOCKS = 60
#: samples of a record among which states of equal motion are looked for
_STATES = 6000
#: least distance in time of two samples whose residuals are compared, as a share of the record
_APART_SHARE = 0.02
#: neighbours looked through for one far enough in time
_NEIGHBOURS = 64
#: relative standard deviation beyond which its size says nothing more
_MANY_TIMES = 10.0


@dataclasses.dataclass(frozen=True)
class ParameterStatus:
    """One parameter as reported.

    Attributes
    ----------
    name, unit, meaning
        What it is.
    value, std
        SI.
    status
        ``valid``, ``at_bound`` or ``not_identifiable``.
    reason
        In words; empty where valid.
    """

    name: str
    unit: str
    meaning: str
    value: float
    std: float
    status: str
    reason: str


@dataclasses.dataclass(frozen=True)
class Uncertainty:
    """Uncertainty of one fit.

    Attributes
    ----------
    parameters
        Values with standard deviations and status.
    correlation
        Shape (P, P), order of the parameters.
    effective_samples
        Number of independent residuals.
    white_std
        Standard deviations a white residual would give (the Cramer-Rao bound for white noise), shape (P,).
    missing_rms
        Root mean square of the residual that repeats with the motion [N]: force the model lacks.
    condition
        Condition number of the information matrix in relative parameters.
    null_direction
        The combination the record tells worst, in words.
    """

    parameters: tuple[ParameterStatus, ...]
    correlation: Array
    effective_samples: float
    white_std: Array
    missing_rms: float
    condition: float
    null_direction: str


def effective_samples(residual: Array, max_lag_share: float = 0.1) -> float:
    """Return the number of independent samples of a correlated residual.

    ``N_eff = N / (1 + 2 sum rho_k^2)``, the equivalent number for second moments, with the sum cut at the first lag whose
    autocorrelation lies inside the band ``2/sqrt(N)`` for ten lags in a row.
    """
    r = residual - np.mean(residual)
    n = r.size
    size = 1 << int(np.ceil(np.log2(2 * n)))
    spectrum = np.fft.rfft(r, size)
    rho = np.fft.irfft(spectrum * np.conj(spectrum), size)[: max(2, int(max_lag_share * n))]
    if rho[0] <= 0.0:
        return float(n)
    rho = rho / rho[0]
    quiet = np.abs(rho[1:]) < 2.0 / np.sqrt(n)
    runs = np.convolve(quiet, np.ones(10), mode="valid") == 10
    stop = int(np.argmax(runs)) if runs.any() else rho.size - 1
    return float(np.clip(n / (1.0 + 2.0 * np.sum(rho[1 : stop + 1] ** 2)), 2.0, n))


def std_from_jacobian(jacobian: Array, variance: float) -> Array:
    """Return standard deviations of parameters from the Jacobian of residuals, shape (P,); infinite in unobservable directions.

    Parameters
    ----------
    jacobian
        Residuals by parameters, shape (N, P).
    variance
        Sum of squared residuals over the number of independent ones.
    """
    _, s, vt = np.linalg.svd(jacobian, full_matrices=False)
    observable = s > 1e-8 * s[0]
    std: Array = np.sqrt(variance * np.sum((vt[observable].T / s[observable]) ** 2, axis=1))
    std[np.sum(vt[~observable] ** 2, axis=0) > 1e-6] = np.inf
    return std


def motion_states(motion: Motion) -> Array:
    """Return what the force may depend on at every sample: displacement, rate, travel since the reversal, shape (N, 3)."""
    since = motion.x - np.repeat(motion.anchors, np.diff(motion.starts))
    return np.column_stack([motion.x, np.gradient(motion.x), since])


def repeatable_energy(residual: Array, states: Array) -> float:
    """Return the energy of the part of a residual that comes again when the motion does [N^2], summed over samples.

    Noise is another one each time, a part of the force law that the model lacks is not. Every sample is paired with the one,
    elsewhere in the record, of the most alike state; the mean product of their residuals is the mean square of what repeats.

    Parameters
    ----------
    residual
        Measured minus modelled force [N], shape (N,).
    states
        What the force may depend on, shape (N, S).
    """
    n = residual.size
    picked = np.unique(np.linspace(0, n - 1, min(n, _STATES)).astype(int))
    state = states[picked]
    state = state / np.maximum(state.std(axis=0), np.finfo(float).tiny)
    r = residual[picked] - np.mean(residual)
    apart = max(int(_APART_SHARE * picked.size), 1)
    _, index = scipy.spatial.cKDTree(state).query(state, k=min(_NEIGHBOURS, picked.size))
    far = np.abs(index - np.arange(picked.size)[:, None]) >= apart
    found = far.any(axis=1)
    partner = index[np.arange(picked.size), np.argmax(far, axis=1)]
    if not found.any():
        return 0.0
    return max(float(np.mean(r[found] * r[partner[found]])), 0.0) * n


def _score_covariance(fit: TimeDomainFit, prepared: Sequence[PreparedRecord]) -> tuple[Array, Array, float, float]:
    """Return information J'J, long-run covariance of J'r (sums over blocks), effective samples and repeatable energy."""
    p = fit.model.parameter_count
    information, meat, independent, repeatable = np.zeros((p, p)), np.zeros((p, p)), 0.0, 0.0
    for item in prepared:
        keep = item.fitted
        jacobian = full_jacobian(fit, item.motion)[:, keep]
        jacobian -= jacobian.mean(axis=1, keepdims=True)
        whole = item.force - fit.force(item.motion)
        residual = whole[keep] - whole[keep].mean()
        information += jacobian @ jacobian.T
        independent += effective_samples(residual)
        # what is not fitted (clipped, at rest) is no evidence of a missing part of the law
        repeatable += repeatable_energy(np.where(keep, whole - whole[keep].mean(), 0.0), motion_states(item.motion))
        edges = np.linspace(0, residual.size, min(_BLOCKS, residual.size // 10) + 1).astype(int)[:-1]
        sums = np.add.reduceat(jacobian * residual, edges, axis=1)
        meat += sums @ sums.T
    return information, meat, independent, repeatable


def uncertainty(fit: TimeDomainFit, prepared: Sequence[PreparedRecord]) -> Uncertainty:
    """Return standard deviations, correlation and null direction.

    Notes
    -----
    Two things make an estimate uncertain. Noise: the larger of ``s^2 (J'J)^-1`` for a white residual and
    ``(J'J)^-1 S (J'J)^-1`` with S from sums of the score over blocks, for a correlated one. And the part of the force law that
    the model lacks: its share outside the columns of the model is the residual that repeats with the motion, of energy E; a
    share of the same energy along a column is taken up by its parameter and seen by nobody, so ``E (J'J)^-1`` is added. It does
    not shrink with the length of the record, as a bias does not.
    """
    information, meat, independent, repeatable = _score_covariance(fit, prepared)
    searched_scale = np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
    scaled = information / np.outer(searched_scale, searched_scale)
    inverse = np.linalg.pinv(scaled, rcond=1e-12, hermitian=True) / np.outer(searched_scale, searched_scale)
    to_physical = fit.model.physical_jacobian(fit.theta, fit.coefficients)
    unit = to_physical @ inverse @ to_physical.T
    white = unit * fit.residual_std**2
    robust = to_physical @ inverse @ meat @ inverse @ to_physical.T
    white_std = np.sqrt(np.maximum(np.diag(white), 0.0))
    robust_std = np.sqrt(np.maximum(np.diag(robust), 0.0))
    missing = unit * repeatable
    std = np.sqrt(np.maximum(white_std, robust_std) ** 2 + np.diag(missing))
    chosen = (robust if np.sum(robust_std) > np.sum(white_std) else white) + missing
    diagonal = np.sqrt(np.maximum(np.diag(chosen), np.finfo(float).tiny))
    correlation = chosen / np.outer(diagonal, diagonal)
    magnitude = np.where(fit.values == 0.0, 1.0, np.abs(fit.values))
    relative = white / np.outer(magnitude, magnitude)
    eigenvalues, vectors = np.linalg.eigh(relative)
    smallest = max(float(eigenvalues[0]), 1e-300)
    condition = float(np.sqrt(max(float(eigenvalues[-1]), smallest) / smallest))
    statuses = _statuses(fit, std)
    return Uncertainty(
        statuses,
        correlation,
        independent,
        white_std,
        float(np.sqrt(repeatable / max(fit.samples, 1))),
        condition,
        _in_words(statuses, vectors[:, -1]),
    )


def _statuses(fit: TimeDomainFit, std: Array) -> tuple[ParameterStatus, ...]:
    lay = fit.model.layout
    found = []
    for i, quantity in enumerate(fit.model.quantities):
        value, deviation = float(fit.values[i]), float(std[i])
        status, reason = "valid", ""
        part = _part_of(fit, i)
        if part >= 0 and lay.static + part in fit.result.at_zero:
            status, reason = "at_bound", "held at its bound 0: the record asks for a negative value"
        elif part >= 0 and part in fit.result.at_bound:
            status, reason = "at_bound", "its rate or length sits at the limit of what the record can show"
        elif deviation > NOT_IDENTIFIABLE * abs(value):
            status, reason = "not_identifiable", f"standard deviation is {_share(deviation, value)}"
        found.append(ParameterStatus(quantity.name, quantity.unit, quantity.meaning, value, deviation, status, reason))
    return tuple(found)


def _part_of(fit: TimeDomainFit, index: int) -> int:
    """Return which cell or friction a reported parameter belongs to, -1 for springs and dampers without memory."""
    lay = fit.model.layout
    return -1 if index < lay.static else (index - lay.static) // 2


def _share(deviation: float, value: float) -> str:
    """Return how a standard deviation compares to its value, in words."""
    if deviation > _MANY_TIMES * abs(value):
        return f"more than {_MANY_TIMES:g} times the value"
    return f"{100 * deviation / abs(value):.0f} % of the value"


def _in_words(statuses: Sequence[ParameterStatus], direction: Array) -> str:
    valid = [s for s in statuses if s.status == "valid"]
    relative = {s.name: s.std / abs(s.value) if s.value else np.inf for s in statuses}
    others = [s.name.replace("_", " ") for s in statuses if s.status != "valid"]
    worst = max((relative[s.name] for s in valid), default=np.inf)
    if not others and worst <= 0.1:
        return f"every parameter is identifiable from the record; the largest relative standard deviation is {100 * worst:.2g} %"
    said = f"not identifiable from the record: {', '.join(others)}; " if others else ""
    top = int(np.argmax(np.abs(direction)))
    sign = np.sign(direction[top])
    parts = [
        f"{statuses[i].name.replace('_', ' ')} {'up' if sign * direction[i] > 0 else 'down'} "
        f"{100 * abs(direction[i] / direction[top]):.0f} %"
        for i in np.argsort(-np.abs(direction))
        if abs(direction[i]) > 0.15 * abs(direction[top])
    ]
    return f"{said}the record is hardly sensitive to this change: {', '.join(parts)} together"
