# Copyright 2026 ride_estimation contributors
"""Output error over the last seconds by damped Gauss-Newton: the start of the filter, and its review after a start or a change.

The extended Kalman filter linearises once; from a start tens of per cent off it can settle beside the optimum. A pass over the
last seconds of the force balance, repeated to convergence, does not. It costs a hundred times as much as the filter, so it is
made of small steps: every function here is a generator that yields after each of them what it cost (one pass over a chunk is one)
and returns its result at the end. Who runs it decides how many steps to take at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.parameters.force_balance import BalanceChunk
from ride_estimation.estimation.parameters.interval import Interval
from ride_estimation.estimation.parameters.parameter_filter import ParameterFilter
from ride_estimation.estimation.parameters.parameter_model import ParameterModel
from ride_estimation.estimation.parameters.rls import RecursiveLeastSquares

Array = NDArray[np.float64]
T = TypeVar("T")
Steps: TypeAlias = Generator[int, None, T]
#: a chunk of the force balance and the parameters it was filtered with
Kept: TypeAlias = tuple[BalanceChunk, Array]

_ITERATIONS = 8
_LARGEST_STEP = 0.5
_SETTLED = 1e-3
#: improvement of the squared error that moves the parameters in a review, in units of its scatter
_CLEARLY = 6.0
#: what preparing the response costs, in passes over a chunk
_PREPARE = 4
#: the same of learning an interval
_LEARN = 6


class Refinement:
    """What parameters fit a segment of the force balance best.

    Parameters
    ----------
    model
        Balance and response; used up, so one of its own.
    prior_std, lower, upper
        Of the parameters, shape (N,).
    fresh
        Makes a filter that has learned nothing, from the parameters it starts with.
    """

    def __init__(
        self, model: ParameterModel, prior_std: Array, lower: Array, upper: Array, fresh: Callable[[Array], ParameterFilter]
    ) -> None:
        self.model = model
        self._prior_std, self._lower, self._upper = prior_std, lower, upper
        self._fresh = fresh

    # -- whole tasks ------------------------------------------------------------------------------------------------------

    def first_estimate(self, kept: list[Kept], theta: Array, weights: Array) -> Steps[ParameterFilter]:
        """Estimate by least squares, refine by output error, and give all to a new filter.

        Parameters
        ----------
        kept
            Chunks; those that are appended meanwhile are learned too.
        theta
            The other start of the refinement, shape (N,).
        weights
            L with ``L L^T`` the inverse covariance of an innovation, shape (6, 6).
        """
        chunks = tuple(kept)
        regression = yield from self.least_squares(chunks)
        memory = self._fresh(theta).memory
        best = theta
        # with sensors far better than the model the first answer overrides the prior in all that it cannot observe
        for _ in range(2):
            lowest = np.inf
            for start in (regression, theta):
                found, cost = yield from self.refine(chunks, start, weights, memory.inflation)
                if cost < lowest:
                    best, lowest = found, cost
            before = memory.inflation
            memory.foresee((yield from self.passed(chunks, best, weights)))
            if memory.inflation <= before:
                break
        return (yield from self._learned(kept, best, weights))

    def review(self, kept: list[Kept], theta: Array, weights: Array, inflation: float) -> Steps[ParameterFilter | None]:
        """Return a new filter where other parameters fit the segment as a whole clearly better than ``theta``, else None.

        Parameters
        ----------
        kept, theta, weights
            As for :meth:`first_estimate`.
        inflation
            Scatter of the gradients over what the weights let expect.
        """
        chunks = tuple(kept)
        found, cost = yield from self.refine(chunks, theta, weights, inflation)
        prior = inflation * float(np.sum((theta / self._prior_std) ** 2))
        present = prior + sum(i.square for i in (yield from self.passed(chunks, theta, weights)))
        if present - cost <= _CLEARLY * inflation:
            return None
        return (yield from self._learned(kept, found, weights))

    def _learned(self, kept: list[Kept], centre: Array, weights: Array) -> Steps[ParameterFilter]:
        """Return a new filter that learned the segment, linearised at one point, up to the newest chunk."""
        new = self._fresh(centre)
        done = len(kept)
        intervals = yield from self.passed(tuple(kept), centre, weights)
        new.memory.foresee(intervals)
        for interval in intervals:
            new.learn(interval, centre)
            yield _LEARN
        while done < len(kept):
            new.learn(self._interval(kept[done], centre, weights), centre)
            done += 1
            yield _LEARN + 1
        return new

    # -- parts ------------------------------------------------------------------------------------------------------------

    def _rescaled(self, kept: Kept, theta: Array) -> BalanceChunk:
        """Return a chunk for other parameters than those it was filtered with."""
        c, at = kept
        n, turns, inertial = len(self.model.free_parameters), self.model.turns, self.model.inertial
        own, placed = slice(n + 1, n + 1 + len(turns)), slice(n + 1 + len(turns), len(at))
        ratio = np.append(np.exp(theta[:n] - at[:n]), 1.0)
        shift = np.append(ratio[:-1] - 1.0, theta[n] - at[n])
        modelled, columns = c.modelled + c.columns[:, :, : n + 1] @ shift, c.columns.copy()
        columns[:, :, : n + 1] *= ratio
        if inertial is not None and turns:
            moved = inertial.inertia_map(theta[own], at[own])
            modelled, columns[:, :, : n + 1] = modelled @ moved.T, moved @ columns[:, :, : n + 1]
            for r, a in enumerate(turns, start=n + 1):
                columns[:, 3 + a, r] += modelled[:, 3 + a] - c.modelled[:, 3 + a]
        # where the CG lies moves the measured side
        modelled = modelled + c.columns[:, :, placed] @ (theta[placed] - at[placed])
        return BalanceChunk(c.measured, modelled, columns, c.step)

    def _interval(self, kept: Kept, theta: Array, weights: Array) -> Interval:
        chunk = self._rescaled(kept, theta)
        innovation, gradient = self.model.response.observe(chunk)
        interval = Interval(len(theta), gradient.shape[2] - len(theta), self.model.geometry.tolerated_cross_sensitivity)
        interval.add(innovation, gradient, chunk.measured, weights, len(chunk.measured) * chunk.step)
        return interval

    def passed(self, chunks: Sequence[Kept], theta: Array, weights: Array) -> Steps[list[Interval]]:
        """Run the response over chunks and return their intervals; the first chunk only lets the start fade.

        Parameters
        ----------
        chunks
            With the parameters that each was filtered with.
        theta
            Parameters of the run, shape (N,).
        weights
            Whitening of the innovations, shape (6, 6).
        """
        self.model.prepare(theta, chunks[0][0].step)
        self.model.response.reset()
        yield _PREPARE
        intervals = []
        for kept in chunks:
            intervals.append(self._interval(kept, theta, weights))
            yield 1
        return intervals[1:]

    def least_squares(self, chunks: Sequence[Kept]) -> Steps[Array]:
        """Return parameters from the linear regression on measured deflections (biased by noise, but never lost)."""
        count = len(self._prior_std)
        n = len(self.model.free_parameters)
        spread = np.append(np.expm1(self._prior_std[:n]), self._prior_std[n:])
        rls = RecursiveLeastSquares(np.zeros(count), spread, 1.0 - 1e-9)
        for kept in chunks:
            c = self._rescaled(kept, np.zeros(count))
            residual = c.measured - c.modelled
            scale = np.sqrt(np.mean(residual**2, axis=0)) + 1e-9
            rows = (c.columns[:, :, :count] / scale[:, None]).reshape(-1, count)
            target = (residual / scale).reshape(-1)
            rls.update(rows.T @ rows, rows.T @ (target - rows @ rls.theta))
            yield 2
        logs = np.log(np.maximum(1.0 + rls.theta[:n], 0.1))
        return np.asarray(np.clip(np.append(logs, rls.theta[n:]), self._lower, self._upper))

    def refine(self, chunks: Sequence[Kept], start: Array, weights: Array, inflation: float) -> Steps[tuple[Array, float]]:
        """Minimise the output error from a start; return the best parameters and their cost.

        Parameters
        ----------
        chunks
            The segment.
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
            intervals = yield from self.passed(chunks, theta, weights)
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
