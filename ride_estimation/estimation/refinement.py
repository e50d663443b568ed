# Copyright 2026 ride_estimation contributors
"""Output error over the last seconds by damped Gauss-Newton: the start of the filter, and its review after a start or a change.

The extended Kalman filter linearises once; from a start tens of per cent off it can settle beside the optimum. A pass over the
last seconds of the force balance, repeated to convergence, does not.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.force_balance import BalanceChunk, ForceBalance
from ride_estimation.estimation.interval import Interval
from ride_estimation.estimation.response import ModelResponse
from ride_estimation.estimation.rls import RecursiveLeastSquares
from ride_estimation.estimation.transducer_balance import MeasuredResponse

Array = NDArray[np.float64]

_ITERATIONS = 8
_LARGEST_STEP = 0.5
_SETTLED = 1e-3


class Refinement:
    """The last seconds of the force balance and what parameters fit them best.

    Parameters
    ----------
    response
        Simulated body; its state is used up.
    prepare
        Function that makes the response ready for a parameter vector and the step of a chunk.
    prior_std, lower, upper
        Of the parameters (logarithms, the follow share minus one, logarithms of inverse inertias), shape (N,).
    balance
        Whose inertia is estimated, None where it is not.
    """

    def __init__(
        self,
        response: ModelResponse | MeasuredResponse,
        prepare: Callable[[Array, float], None],
        prior_std: Array,
        lower: Array,
        upper: Array,
        balance: ForceBalance | None = None,
    ) -> None:
        self._response = response
        self._prepare = prepare
        self._prior_std = prior_std
        self._lower, self._upper = lower, upper
        self._balance = balance
        self._turns = balance.turns if balance is not None else ()
        self._count = len(prior_std) - 1 - len(self._turns)
        self.clear()

    def clear(self) -> None:
        """Forget the signals."""
        self._chunks: list[tuple[BalanceChunk, Array]] = []

    @property
    def duration(self) -> float:
        """Return how much is in memory [s]."""
        return sum(len(c.measured) * c.step for c, _ in self._chunks)

    def add(self, chunk: BalanceChunk, theta: Array, longest: float) -> None:
        """Keep a chunk that was filtered with parameters ``theta``; drop what is older than ``longest`` [s]."""
        self._chunks.append((chunk, theta.copy()))
        while len(self._chunks) > 2 and self.duration > longest:
            self._chunks.pop(0)

    def _rescaled(self, theta: Array) -> list[BalanceChunk]:
        """Return the chunks for other parameters than those they were filtered with."""
        result = []
        n = self._count
        for c, at in self._chunks:
            ratio = np.append(np.exp(theta[:n] - at[:n]), 1.0)
            shift = np.append(ratio[:-1] - 1.0, theta[n] - at[n])
            modelled, columns = c.modelled + c.columns[:, :, : n + 1] @ shift, c.columns.copy()
            columns[:, :, : n + 1] *= ratio
            if self._balance is not None and self._turns:
                moved = self._balance.inertia_map(theta[n + 1 :], at[n + 1 :])
                modelled, columns[:, :, : n + 1] = modelled @ moved.T, moved @ columns[:, :, : n + 1]
                for r, a in enumerate(self._turns, start=n + 1):
                    columns[:, 3 + a, r] += modelled[:, 3 + a] - c.modelled[:, 3 + a]
            result.append(BalanceChunk(c.measured, modelled, columns, c.step))
        return result

    def passed(self, theta: Array, weights: Array) -> list[Interval]:
        """Run the response over the chunks with given parameters, the first chunk only to let the start fade."""
        self._prepare(theta, self._chunks[0][0].step)
        self._response.reset()
        intervals = []
        for n, c in enumerate(self._rescaled(theta)):
            innovation, gradient = self._response.observe(c)
            if n == 0:
                continue
            interval = Interval(len(theta))
            interval.add(innovation, gradient, weights, len(c.measured) * c.step)
            intervals.append(interval)
        return intervals

    def least_squares(self) -> Array:
        """Return parameters from the linear regression on measured deflections (biased by noise, but never lost)."""
        count = len(self._prior_std)
        n = self._count
        spread = np.append(np.expm1(self._prior_std[:n]), self._prior_std[n:])
        rls = RecursiveLeastSquares(np.zeros(count), spread, 1.0 - 1e-9)
        for c in self._rescaled(np.zeros(count)):
            residual = c.measured - c.modelled
            scale = np.sqrt(np.mean(residual**2, axis=0)) + 1e-9
            rows = (c.columns / scale[:, None]).reshape(-1, count)
            target = (residual / scale).reshape(-1)
            rls.update(rows.T @ rows, rows.T @ (target - rows @ rls.theta))
        logs = np.log(np.maximum(1.0 + rls.theta[:n], 0.1))
        return np.asarray(np.clip(np.append(logs, rls.theta[n:]), self._lower, self._upper))

    def refine(self, start: Array, weights: Array, inflation: float) -> tuple[Array, float]:
        """Minimise the output error from a start; return the best parameters and their cost.

        Parameters
        ----------
        start
            Shape (N,).
        weights
            L with ``L L^T`` the inverse covariance of an innovation, shape (6, 6).
        inflation
            Scatter of the gradients over what these weights let expect: so much less they count against the prior.
        """
        prior = inflation * np.diag(self._prior_std**-2.0)
        best, best_cost, damping = start, np.inf, 0.0
        information, gradient = prior, np.zeros(len(start))
        theta = start
        for _ in range(_ITERATIONS):
            intervals = self.passed(theta, weights)
            cost = sum(i.square for i in intervals) + float(theta @ prior @ theta)
            if np.isfinite(cost) and cost < best_cost:
                settled = cost > (1.0 - _SETTLED) * best_cost
                best, best_cost = theta, cost
                information = np.sum([i.information for i in intervals], axis=0)
                gradient = np.sum([i.gradient for i in intervals], axis=0)
                damping *= 0.1
                if settled:
                    break
            else:
                damping = max(10.0 * damping, 1e-3)
            matrix = information + prior + damping * np.diag(np.diag(information))
            step = np.linalg.solve(matrix, gradient - prior @ best)
            largest = float(np.max(np.abs(step)))
            theta = np.clip(best + step * min(1.0, _LARGEST_STEP / max(largest, 1e-12)), self._lower, self._upper)
        return best, best_cost
