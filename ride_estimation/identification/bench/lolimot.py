# Copyright 2026 ride_estimation contributors
"""Training of the jounce-bumper grey box: a network of continuous, stable local linear models (document 004 (15)-(26)).

Local model j in continuous time, inputs travel ``u_1`` and static force ``u_2 = F_nl(u_1)`` (Hammerstein)::

    w_j' = -alpha_j w_j + c_1j u_1 + c_2j u_2,   y_j = g_j + w_j + d_1j u_1 + d_2j u_2,   P = sum_j Phi_j(z) y_j

with normalised Gaussians of travel and rate. Given the poles this is linear in g, c, d, also as a SIMULATION, so the network is
fitted to the simulation error directly: no detour over a discrete one-step model and its conversion, and every pole is
negative by construction. The partition grows by LoLiMoT: halve the worst local model along the better axis.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.identification.bench.jounce_model import Load
from ride_estimation.identification.bench.uncertainty import effective_samples, std_from_jacobian

Array = NDArray[np.float64]

#: width of a Gaussian as a share of its rectangle
WIDTH_SHARE = 1.0 / 3.0
#: poles lie between these [1/s], and below the stability limit of an explicit solver
POLE_RANGE = (2.0, 400.0)
#: filtered inputs kept per record
_LAGS_KEPT = 64
#: residuals per record in the search
_RESIDUALS = 1500
#: step of the logarithm of a pole in differences, far above rounding and far below the curvature of the residual
_POLE_STEP = 1.0e-3
#: ridges on scaled columns that are tried: the larger, the quieter are local models where there is little data
RIDGES = (1.0e-7, 1.0e-4, 1.0e-2)


@dataclasses.dataclass(frozen=True)
class Network:
    """A trained network, SI, compression positive.

    Attributes
    ----------
    centres, widths
        Of the Gaussians in normalised travel and rate, shape (M, 2).
    alpha
        Poles are ``-alpha`` [1/s], shape (M,).
    gains
        g [N], d_1 [N/m], d_2 [1], c_1 [N/(m s)], c_2 [1/s] per model, shape (M, 5).
    travel_range, rate_range
        Ranges that are normalised to 0..1 [m], [m/s].
    """

    centres: Array
    widths: Array
    alpha: Array
    gains: Array
    travel_range: tuple[float, float]
    rate_range: tuple[float, float]

    def weights(self, travel: Array, rate: Array) -> Array:
        """Return normalised activities, shape (N, M)."""
        z = np.stack(
            [
                np.clip((travel - self.travel_range[0]) / (self.travel_range[1] - self.travel_range[0]), 0.0, 1.0),
                np.clip((rate - self.rate_range[0]) / (self.rate_range[1] - self.rate_range[0]), 0.0, 1.0),
            ],
            axis=1,
        )
        exponent = -0.5 * np.sum(((z[:, None, :] - self.centres) / self.widths) ** 2, axis=2)
        exponent -= exponent.max(axis=1, keepdims=True)
        activity = np.exp(exponent)
        normalised: Array = activity / activity.sum(axis=1, keepdims=True)
        return normalised

    def force(self, inputs: NetworkInputs) -> Array:
        """Return the compression force over a record, zero out of contact, shape (N,)."""
        phi = self.weights(inputs.travel, inputs.rate)
        total = np.zeros(inputs.travel.size)
        for j, alpha in enumerate(self.alpha):
            g, d1, d2, c1, c2 = self.gains[j]
            lag_u, lag_f = inputs.lagged(float(alpha))
            total += phi[:, j] * (g + d1 * inputs.travel + d2 * inputs.static + c1 / alpha * lag_u + c2 / alpha * lag_f)
        total[~inputs.loaded] = 0.0
        return total


class NetworkInputs:
    """Inputs of one record: travel, rate, static force and their lagged forms.

    Parameters
    ----------
    load
        The record.
    static
        Travel -> static force.
    target
        Force to be modelled [N], shape (N,): the measured one, or what other elements leave of it.
    """

    def __init__(self, load: Load, static: Callable[[Array], Array], target: Array) -> None:
        self.load = load
        self.loaded = load.travel > 0.0
        self.picked = load.picked[:: max(1, load.picked.size // _RESIDUALS)]
        self.travel = np.maximum(load.travel, 0.0)
        self.rate = np.gradient(load.travel, load.step_s)
        self.static = static(self.travel)
        self.target = target
        self._lags: dict[float, tuple[Array, Array]] = {}

    def lagged(self, alpha: float) -> tuple[Array, Array]:
        """Return travel and static force behind ``alpha / (s + alpha)``, exact for inputs straight between samples."""
        key = round(alpha, 6)
        if key not in self._lags:
            while len(self._lags) >= _LAGS_KEPT:
                self._lags.pop(next(iter(self._lags)))
            z = alpha * self.load.step_s
            decay = float(np.exp(-z))
            first = -np.expm1(-z) / z
            second = (1.0 - first) / z
            b = [z * second, z * (first - second)]
            pair = []
            for signal in (self.travel, self.static):
                start = np.array([signal[0] * (1.0 - b[0])])
                pair.append(np.asarray(scipy.signal.lfilter(b, [1.0, -decay], signal, zi=start)[0]))
            self._lags[key] = (pair[0], pair[1])
        return self._lags[key]


@dataclasses.dataclass(frozen=True)
class _Cells:
    """Rectangles of the partition: lower and upper corners, shape (M, 2), and poles."""

    low: Array
    high: Array
    alpha: Array

    def split(self, j: int, axis: int) -> _Cells:
        """Return the partition with rectangle j halved along an axis."""
        middle = 0.5 * (self.low[j, axis] + self.high[j, axis])
        first_high, second_low = self.high[j].copy(), self.low[j].copy()
        first_high[axis], second_low[axis] = middle, middle
        keep = np.arange(self.alpha.size) != j
        return _Cells(
            np.vstack([self.low[keep], self.low[j], second_low]),
            np.vstack([self.high[keep], first_high, self.high[j]]),
            np.concatenate([self.alpha[keep], [self.alpha[j], self.alpha[j]]]),
        )


class _Problem:
    """Least squares of all local models at once for given partition and poles."""

    def __init__(self, inputs: Sequence[NetworkInputs], ridge: float) -> None:
        self._inputs, self._ridge = list(inputs), ridge
        travel = np.concatenate([i.travel[i.picked] for i in inputs])
        rate = np.concatenate([i.rate[i.picked] for i in inputs])
        self.travel_range = (0.0, float(travel.max()))
        self.rate_range = (float(np.quantile(rate, 0.002)), float(np.quantile(rate, 0.998)))
        self._target = np.concatenate([i.target[i.picked] / (i.load.scale * np.sqrt(i.picked.size)) for i in inputs])

    def solve(self, cells: _Cells) -> tuple[Network, Array, Array]:
        """Return the network, the weighted residual and the squared error per local model."""
        m = cells.alpha.size
        network = Network(
            0.5 * (cells.low + cells.high),
            WIDTH_SHARE * (cells.high - cells.low),
            cells.alpha,
            np.zeros((m, 5)),
            self.travel_range,
            self.rate_range,
        )
        designs, activities = [], []
        for item in self._inputs:
            at = item.picked
            phi = network.weights(item.travel[at], item.rate[at])
            weight = 1.0 / (item.load.scale * np.sqrt(at.size))
            one = np.ones(at.size)
            blocks = []
            for j, alpha in enumerate(cells.alpha):
                lag_u, lag_f = item.lagged(float(alpha))
                columns = np.stack([one, item.travel[at], item.static[at], lag_u[at], lag_f[at]], axis=1)
                blocks.append(weight * phi[:, j : j + 1] * columns)
            designs.append(np.hstack(blocks))
            activities.append(phi)
        design, activity = np.vstack(designs), np.vstack(activities)
        scale = np.maximum(np.sqrt(np.sum(design**2, axis=0)), 1e-12)
        gram = (design.T @ design) / np.outer(scale, scale)
        solution = np.linalg.solve(gram + self._ridge * np.eye(scale.size), (design.T @ self._target) / scale) / scale
        residual = design @ solution - self._target
        gains = solution.reshape(m, 5).copy()
        gains[:, 3:] *= cells.alpha[:, None]
        return dataclasses.replace(network, gains=gains), residual, activity.T @ residual**2


def train_network(
    inputs: Sequence[NetworkInputs],
    models: int,
    ridge: float = RIDGES[0],
    *,
    each: Callable[[Network], None] | None = None,
) -> tuple[Network, list[float]]:
    """Grow and fit a network; return it and the root of the summed squared NRMSE over the number of models.

    Parameters
    ----------
    inputs
        Training records.
    models
        Number of local models M.
    ridge
        Price of large gains, on columns scaled to one.
    each
        Called with the network of every size on the way.
    """
    problem = _Problem(inputs, ridge)
    limit = min(POLE_RANGE[1], 0.9 * 2.0 / max(i.load.step_s for i in inputs))
    cells = _Cells(np.zeros((1, 2)), np.ones((1, 2)), np.array([20.0]))
    cells = _refine_poles(problem, cells, limit, evaluations=12)
    history = []
    network, residual, shares = problem.solve(cells)
    if each is not None:
        each(network)
    history.append(float(np.sqrt(residual @ residual / len(inputs))))
    while cells.alpha.size < models:
        best: tuple[float, _Cells, Array] | None = None
        for j in np.argsort(-shares)[:2]:
            for axis in (0, 1):
                trial = cells.split(int(j), axis)
                _, residual, trial_shares = problem.solve(trial)
                cost = float(residual @ residual)
                if best is None or cost < best[0]:
                    best = (cost, trial, trial_shares)
        if best is None:
            break
        cells = _refine_poles(problem, best[1], limit, evaluations=2)
        network, residual, shares = problem.solve(cells)
        history.append(float(np.sqrt(residual @ residual / len(inputs))))
        if each is not None:
            each(network)
    cells = _refine_poles(problem, cells, limit, evaluations=5)
    network, _, _ = problem.solve(cells)
    return network, history


def _refine_poles(problem: _Problem, cells: _Cells, limit: float, evaluations: int) -> _Cells:
    low, high = np.log(POLE_RANGE[0]), np.log(limit)

    def residual(log_alpha: Array) -> Array:
        return problem.solve(dataclasses.replace(cells, alpha=np.exp(log_alpha)))[1]

    start = np.clip(np.log(cells.alpha), low + 1e-6, high - 1e-6)
    found = scipy.optimize.least_squares(residual, start, bounds=(low, high), diff_step=1e-3, max_nfev=evaluations, ftol=1e-5)
    return dataclasses.replace(cells, alpha=np.exp(found.x))


def pole_std(network: Network, inputs: Sequence[NetworkInputs], ridge: float = RIDGES[0]) -> Array:
    """Return standard deviations of the poles [1/s], shape (M,); infinite where the records do not tell a pole.

    The gains of all models are eliminated, so their uncertainty is in the result; the correlation of the residual reduces the
    number of independent samples. The partition is taken as given.

    Parameters
    ----------
    network
        Trained network.
    inputs
        The records it was trained on.
    ridge
        The one it was trained with.
    """
    problem = _Problem(inputs, ridge)
    half = 0.5 * network.widths / WIDTH_SHARE
    cells = _Cells(network.centres - half, network.centres + half, network.alpha)
    base = problem.solve(cells)[1]
    columns = []
    for j in range(network.alpha.size):
        moved = network.alpha.copy()
        moved[j] *= np.exp(_POLE_STEP)
        columns.append((problem.solve(dataclasses.replace(cells, alpha=moved))[1] - base) / _POLE_STEP)
    taken = 6 * network.alpha.size
    variance = float(base @ base) / max(effective_samples(base) * (1.0 - taken / base.size), 1.0)
    relative = std_from_jacobian(np.stack(columns, axis=1), variance)
    return np.asarray(relative * network.alpha)
