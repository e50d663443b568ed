# Copyright 2026 ride_estimation contributors
"""Innovations and gradients of an interval in compressed form, and the honest scatter over the last intervals."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.parameters.parameter_change import observable_directions, steady_scatter

Array = NDArray[np.float64]

#: intervals in memory
_LENGTH = 40
#: factor on standard deviations for what linearisation and few intervals leave out; measured on worlds of their own
_MARGIN = 1.2
#: intervals' worth of white-noise theory that the scatter is mixed with
_SHRINK = 4.0
#: scatter over white-noise theory before it is known
_START = 4.0
#: bounds of that ratio
_INFLATION = (0.5, 1e6)
#: share of its information that rounding leaves of a column which parameters explain
_ROUNDING = 1e-9
#: intervals that a scatter needs
_FEWEST = 4
#: intervals that distinguish scatter from parameters that move
_FEWEST_STEADY = 8


class Interval:
    """Normal equations of an interval: ``A = sum psi^T W psi``, ``g = sum psi^T W nu``, ``sum nu^T W nu``, ``sum psi^T W c``.

    Parameters
    ----------
    count
        Number of parameters.
    considered
        Number of quantities that are not estimated but whose uncertainty is considered; c are their gradients.
    cross_sensitivity
        Share of an acceleration that sensors in good order read wrongly, on both sides of the mounts.

    Attributes
    ----------
    information, gradient
        A and g, shapes (N, N) and (N,).
    cross, considered_information, considered_gradient
        The same with the considered quantities, shapes (N, O), (O, O) and (O,).
    square, explained
        Of the innovations, and what of it noise and tolerances of the sensors explain.
    """

    def __init__(self, count: int, considered: int, cross_sensitivity: float) -> None:
        self._cross_sensitivity = cross_sensitivity
        self.information = np.zeros((count, count))
        self.cross = np.zeros((count, considered))
        self.considered_information, self.considered_gradient = np.zeros((considered, considered)), np.zeros(considered)
        self.gradient = np.zeros(count)
        self.square = self.explained = 0.0
        self.duration = 0.0

    def add(self, innovation: Array, gradient: Array, measured: Array, weights: Array, duration: float) -> None:
        """Add the ticks of a chunk.

        Parameters
        ----------
        innovation, gradient
            Shapes (K, 6) and (K, 6, N + O), parameters first.
        measured
            Acceleration that the mounts cause, shape (K, 6).
        weights
            L with ``L L^T`` the inverse covariance of an innovation, shape (6, 6).
        duration
            [s].
        """
        white = innovation @ weights
        both = np.matmul(weights.T, gradient).reshape(-1, gradient.shape[2])
        rows, considered = both[:, : len(self.gradient)], both[:, len(self.gradient) :]
        self.cross += rows.T @ considered
        self.considered_information += considered.T @ considered
        self.considered_gradient += considered.T @ white.reshape(-1)
        self.information += rows.T @ rows
        self.gradient += rows.T @ white.reshape(-1)
        self.square += float(np.sum(white**2))
        noise = len(white) * int(np.count_nonzero(np.diag(weights)))
        self.explained += noise + self._cross_sensitivity**2 * float(np.sum((measured @ weights) ** 2))
        self.duration += duration


@dataclasses.dataclass(frozen=True)
class Scatter:
    """How much gradients scatter where intervals are informative: eigenvalues of their joint information (D,), eigenvectors
    (N, D), covariance of the sum of the gradients along them (D, D).
    """

    values: Array
    basis: Array
    covariance: Array

    @property
    def ratio(self) -> float:
        """Return the mean of scatter over what white noise of the stated size would make."""
        return float(np.mean(np.diag(self.covariance) / self.values))


def scatter_of(observable: tuple[Array, Array], scores: Array) -> Scatter:
    """Return the scatter of gradients, each with its neighbour: noise near a resonance is correlated over an interval.

    Parameters
    ----------
    observable
        Where J intervals together are informative, see :func:`observable_directions`.
    scores
        Gradients at the parameters in question, shape (J, N).
    """
    n = len(scores)
    # neighbours together: half of the scatter of sums of two
    pairs = scores[1:] + scores[:-1]
    scatter = pairs.T @ pairs / 2.0 * n / (n - 1)
    values, basis = observable
    return Scatter(values, basis, basis.T @ scatter @ basis)


class IntervalMemory:
    """The last intervals, for a covariance that rests on their scatter.

    ``Cov = A^-1 B A^-1`` with ``A = sum A_j`` and ``B`` the scatter of the gradients at the present parameters, each with its
    neighbour (noise near a resonance is correlated over an interval): the estimate is no surer than its intervals agree.

    Parameters
    ----------
    count
        Number of parameters.
    considered
        Number of quantities whose uncertainty is considered, see :class:`Interval`.
    """

    def __init__(self, count: int, considered: int) -> None:
        self._count, self._considered = count, considered
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._information: list[Array] = []
        self._gradient: list[Array] = []
        self._centre: list[Array] = []
        self._cross: list[Array] = []
        #: information and gradient of what is considered, squares of the innovations and what is explained of them
        self._considered_parts: list[tuple[Array, Array]] = []
        self._squares: list[Array] = []
        self._stack: Array | None = None
        self._observable: tuple[Array, Array] | None = None
        self.inflation = _START

    def foresee(self, intervals: list[Interval]) -> None:
        """Take the scatter of intervals that are about to be learned, linearised where they fit best: sensors may be far better
        than the model, and the first intervals would be believed as if the model were as good.
        """
        if len(intervals) >= _FEWEST:
            scores = np.array([i.gradient for i in intervals])
            ratio = scatter_of(observable_directions(np.sum([i.information for i in intervals], axis=0)), scores).ratio
            self.inflation = float(np.clip(ratio, _START, _INFLATION[1]))

    @property
    def length(self) -> int:
        """Return the number of intervals in memory."""
        return len(self._information)

    @property
    def total(self) -> Array:
        """Return the information of all intervals in memory, shape (N, N)."""
        return np.asarray(np.sum(self._information, axis=0)) if self._information else np.zeros((self._count, self._count))

    def add(self, interval: Interval, centre: Array) -> None:
        """Add an interval linearised at parameters ``centre``, shape (N,)."""
        for stack, item in (
            (self._information, interval.information),
            (self._gradient, interval.gradient),
            (self._centre, centre),
            (self._cross, interval.cross),
            (self._squares, np.array([interval.square, interval.explained])),
        ):
            stack.append(np.array(item))
            if len(stack) > _LENGTH:
                stack.pop(0)
        self._considered_parts.append((interval.considered_information, interval.considered_gradient))
        self._considered_parts = self._considered_parts[-_LENGTH:]
        self._stack = self._observable = None

    def _coherence(self, theta: Array, considered: Array) -> float:
        """Return by how much more the sum of the gradients varies than that of independent ones.

        What the model does not hold of friction, play or curvature is the same in every interval: so far as the innovations
        of most of them are made of that, parameters of half a second differ by what is missing and their mean is no better than
        one of them.

        Parameters
        ----------
        theta, considered
            Where the innovations are asked for, shapes (N,) and (O,): what was not learned yet is not missing in the model.
        """
        square, explained = np.array(self._squares).T
        steps = theta - np.array(self._centre)
        left = square - 2.0 * np.sum(steps * np.array(self._gradient), axis=1)
        left += np.einsum("ja,jab,jb->j", steps, self._stacked(), steps)
        if considered.any():
            own, slope = (np.array(part) for part in zip(*self._considered_parts))
            left += 2.0 * np.einsum("ja,jao,o->j", steps, np.array(self._cross), considered)
            left += np.einsum("joq,o,q->j", own, considered, considered) - 2.0 * slope @ considered
        share = float(np.median(1.0 - explained / np.maximum(left, explained)))
        return 1.0 + (self.length - 1.0) * share

    def _stacked(self) -> Array:
        """Return the information of all intervals, shape (J, N, N); asked for several times per interval."""
        if self._stack is None:
            self._stack = np.array(self._information)
        return self._stack

    def _directions(self) -> tuple[Array, Array]:
        """Return along which directions all intervals together are informative."""
        if self._observable is None:
            self._observable = observable_directions(self._stacked().sum(axis=0))
        return self._observable

    def scores(self, theta: Array) -> tuple[Array, Array]:
        """Return the information of the intervals (J, N, N) and their gradients at given parameters (J, N)."""
        information = self._stacked()
        return information, np.array(self._gradient) - np.einsum("jab,jb->ja", information, theta - np.array(self._centre))

    def carry(self, step: Array, recent: int) -> None:
        """Carry all but the recent intervals over to parameters that moved by ``step`` (N,) since: they were about others."""
        old = max(self.length - recent, 0)
        self._centre[:old] = [c + step for c in self._centre[:old]]

    def weigh(self, theta: Array) -> float:
        """Refresh ``inflation`` with the present parameters (N,); return it over what it was."""
        if self.length < _FEWEST_STEADY:
            return 1.0
        before = self.inflation
        values, basis = self._directions()
        # parameters that move are no noise
        steady = np.einsum("ai,ab,bi->i", basis, steady_scatter(self.scores(theta)[1]), basis)
        self.inflation = float(np.clip(np.mean(steady / values), *_INFLATION))
        return self.inflation / before

    def standard_deviation(self, p: Array, theta: Array) -> Array:
        """Return the standard deviations of the parameters, shape (N,).

        Parameters
        ----------
        p
            Covariance of the filter, whose measurement noise was scaled by ``inflation``.
        theta
            Present parameters.
        """
        n = self.length
        stated = np.sqrt(np.diag(p))
        if n < _FEWEST:
            return stated
        information, scores = self.scores(theta)
        total = information.sum(axis=0)
        scatter = scatter_of(self._directions(), scores)
        ratio = scatter.ratio
        # the filter remembers more than this memory: take its covariance, with the scatter instead of scaled theory
        half = p @ scatter.basis / self.inflation
        mixed = (n * scatter.covariance + _SHRINK * ratio * np.diag(scatter.values)) / (n + _SHRINK)
        weight = float(np.sum(scatter.values))
        filtered = half @ mixed @ half.T
        gained = float(np.trace(p @ total) / self.inflation / len(p))
        scale = max(1.0, gained) if weight > 0.0 else 1.0
        sandwich = np.diag(filtered) / scale
        # degrees of freedom are few: Student instead of Gauss
        student = (n + _SHRINK) / max(n + _SHRINK - 3.0, 1.0)
        sandwich = _MARGIN**2 * self._coherence(theta, np.zeros(self._considered)) * sandwich
        stated = _MARGIN * stated
        excited = np.clip(np.diag(total) / self.inflation * np.diag(p), 0.0, 1.0)
        return np.asarray(np.sqrt(np.maximum(excited * student * sandwich + (1.0 - excited) * stated**2, stated**2)))

    def sensitivity(self, prior_std: Array) -> Array:
        """Return by how much the parameters move per unit of what is considered, ``(A + lambda P0^-1)^-1 C``, shape (N, O).

        The consider covariance of Schmidt (Jazwinski, Stochastic Processes and Filtering Theory, 8.4) follows from it.

        Parameters
        ----------
        prior_std
            Standard deviations before anything was learned, shape (N,).
        """
        if not self._cross or not self._considered:
            return np.zeros((self._count, self._considered))
        information = self.total + self.inflation * np.diag(prior_std**-2.0)
        return np.asarray(np.linalg.solve(information, np.sum(self._cross, axis=0)))

    def estimate_considered(self, theta: Array, prior_std: Array, spread: Array, count: int) -> tuple[Array, Array]:
        """Return the first of what is considered as the intervals in memory alone estimate it, (Q,), and its covariance, (Q, Q).

        The step of Gauss-Newton from zero, together with the parameters, which keep their prior.

        Parameters
        ----------
        theta
            Present parameters, shape (N,).
        prior_std
            Standard deviations of them before anything was learned, shape (N,).
        spread
            Standard deviation by which they differ from themselves within the run, shape (N,).
        count
            Q; the others are zero.
        """
        precision, crosses = self.inflation * prior_std**-2.0, np.array(self._cross)[:, :, :count]
        cross = crosses.sum(axis=0)
        own = np.sum([a[:count, :count] for a, _ in self._considered_parts], axis=0)
        # the gradients belong to the parameters of their time
        steps = theta - np.array(self._centre)
        right = np.sum([g[:count] for _, g in self._considered_parts], axis=0) - np.einsum("jno,jn->o", crosses, steps)
        slope = self.scores(theta)[1].sum(axis=0)
        reduced = np.linalg.solve(self.total + np.diag(precision), np.column_stack([cross, slope - precision * theta]))
        inverse = np.linalg.pinv(own - cross.T @ reduced[:, :-1], rcond=1e-9, hermitian=True)
        found = inverse @ (right - cross.T @ reduced[:, -1])
        step = reduced[:, -1] - reduced[:, :-1] @ found
        moved = np.linalg.pinv(own, rcond=1e-9, hermitian=True) @ cross.T * spread
        whole = np.append(found, np.zeros(self._considered - count))
        noise = _MARGIN**2 * max(self.inflation, 1.0) * self._coherence(theta + step, whole) * inverse
        return np.asarray(found), np.asarray(noise + moved @ moved.T)

    def judge_considered(self, theta: Array, prior_std: Array, first: int, recent: int) -> tuple[Array, Array, Array]:
        """Return what each of what is considered is where the others are zero, its std, and what it explains, shape (Q,) each.

        With the parameters eliminated, ``S = sum c^T c - C^T (A + P0^-1)^-1 C``, the estimate is ``g = r / S``, r the reduced
        gradient, and ``r^2 / S`` what it explains of the squared innovations (Cox and Hinkley, Theoretical Statistics, 9.3). Its
        variance rests on how far the intervals disagree after it is taken off: with something wrong in the model that of another
        hypothesis would be no measure.

        Parameters
        ----------
        theta, prior_std
            As for :meth:`estimate_considered`.
        first
            Those from this one on are judged.
        recent
            Number of last intervals that count.
        """
        last = slice(-recent, None)
        information, cross = self._stacked()[last], np.array(self._cross[last])[:, :, first:]
        own, right = (np.array(part) for part in zip(*self._considered_parts[last]))
        own, right = np.diagonal(own, axis1=1, axis2=2)[:, first:], right[:, first:]
        # the gradients belong to the parameters of their time
        steps = theta - np.array(self._centre[last])
        right = right - np.einsum("jno,jn->jo", cross, steps)
        slope = np.array(self._gradient[last]) - np.einsum("jab,jb->ja", information, steps)
        precision, total = prior_std**-2.0, cross.sum(axis=0)
        sides = np.column_stack([total, slope.sum(axis=0) - precision * theta])
        turn, move = np.split(np.linalg.solve(information.sum(axis=0) + np.diag(precision), sides), [-1], axis=1)
        # a base that stands still, and what the parameters explain but for rounding, is not informative
        whole = own.sum(axis=0)
        size = np.maximum(whole - np.sum(total * turn, axis=0), _ROUNDING * whole + 1e-30)
        found = (right.sum(axis=0) - (total.T @ move)[:, 0]) / size
        at = move - turn * found
        left = right - np.einsum("jno,no->jo", cross, at) - own * found
        others = slope[:, :, None] - np.einsum("jab,bo->jao", information, at) - cross * found
        left -= np.sum(others * turn, axis=1)
        # neighbours together, see scatter_of; white noise of the stated size at least
        scatter = np.sum((left[1:] + left[:-1]) ** 2, axis=0) / 2.0 * len(left) / (len(left) - 1)
        return found, np.sqrt(np.maximum(scatter, size)) / size, found**2 * size

    def snapshot(self) -> dict[str, Any]:
        """Return the state; its arrays are shared and never change."""
        return {
            "information": list(self._information), "gradient": list(self._gradient), "centre": list(self._centre),
            "cross": list(self._cross), "considered": [list(pair) for pair in self._considered_parts],
            "squares": list(self._squares), "inflation": self.inflation,
        }  # fmt: skip

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`snapshot`."""
        self._information = [np.array(i, dtype=float) for i in saved["information"]]
        self._gradient = [np.array(g, dtype=float) for g in saved["gradient"]]
        self._centre = [np.array(c, dtype=float) for c in saved["centre"]]
        self._cross = [np.array(c, dtype=float).reshape(self._count, self._considered) for c in saved["cross"]]
        size = self._considered
        self._considered_parts = [
            (np.array(a, dtype=float).reshape(size, size), np.array(g, dtype=float).reshape(size)) for a, g in saved["considered"]
        ]
        self._squares = [np.array(s, dtype=float) for s in saved["squares"]]
        self.inflation = float(saved["inflation"])
        self._stack = self._observable = None
