# Copyright 2026 ride_estimation contributors
"""Search of white-box parameters with the linear ones eliminated; stiffnesses and heights stay non-negative."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.identification.bench.jounce_columns import TravelBasis, contact_cell
from ride_estimation.identification.bench.jounce_model import Load, WhiteBox, loaded_nrmse

Array = NDArray[np.float64]

#: price, in squared NRMSE, of a third difference of the static curve as large as its largest force
SMOOTHNESS = 1.0e-7
#: price, in squared NRMSE, of a hysteresis height that departs by its reference from the constructed one
HEIGHT_PRIOR = 1.0e-4
#: rate limit as a share of the stability limit of an explicit solver at the record's step
RATE_SHARE = 1.0


def rate_limit(loads: Sequence[Load]) -> float:
    """Return the fastest rate of a cell [1/s] that the records can tell."""
    return max(RATE_SHARE * 2.0 / max(load.step_s for load in loads), 20.0)


@dataclasses.dataclass(frozen=True)
class NonlinearPack:
    """Which nonlinear parameters are free and how they are scaled into one vector."""

    box: WhiteBox
    slopes: bool
    cells: bool
    contacts: bool
    rate_limit: float

    @classmethod
    def of_everything(cls, box: WhiteBox, loads: Sequence[Load]) -> NonlinearPack:
        """Return the pack of all nonlinear parameters of a box."""
        return cls(box, True, box.rates.size > 0, box.rates.size > 0, rate_limit(loads))

    def start(self) -> tuple[Array, Array, Array]:
        """Return start, lower and upper bounds."""
        x: list[float] = []
        low: list[float] = []
        high: list[float] = []
        largest = float(self.box.basis.knots[-1])
        if self.slopes:
            scale = self.box.reference_height / largest
            # the second is the ratio of both slopes: the friction does not get softer with travel
            x += [np.log(self.box.slopes[0]), np.log(max(self.box.slopes[1] / self.box.slopes[0], 1.0)), self.box.slopes[2]]
            low += [np.log(0.5 * scale), 0.0, 0.05]
            high += [np.log(5e3 * scale), np.log(5e3), 4.0]
        if self.cells:
            n = self.box.rates.size
            x += [*np.log(self.box.rates), np.log(self.box.smooth)]
            low += [np.log(0.5)] * n + [np.log(1e-3 * largest)]
            high += [np.log(self.rate_limit)] * n + [np.log(0.15 * largest)]
        if self.contacts:
            x += list(self.box.contacts / largest)
            low += [0.0] * self.box.contacts.size
            high += [0.97] * self.box.contacts.size
        lower, upper = np.array(low), np.array(high)
        return np.clip(np.array(x), lower + 1e-6, upper - 1e-6), lower, upper

    def box_at(self, x: Array) -> WhiteBox:
        """Return the white box with the nonlinear parameters of a vector."""
        at, box = 0, self.box
        if self.slopes:
            box = dataclasses.replace(box, slopes=np.array([np.exp(x[0]), np.exp(x[0] + x[1]), x[2]]))
            at = 3
        if self.cells:
            n = box.rates.size
            box = dataclasses.replace(box, rates=np.exp(x[at : at + n]), smooth=float(np.exp(x[at + n])))
            at += n + 1
        if self.contacts:
            box = dataclasses.replace(box, contacts=x[at:] * float(box.basis.knots[-1]))
        return box


class _Linear:
    """The linear problem of one set of loads: Gram matrix and bounded solution."""

    def __init__(self, loads: Sequence[Load], basis: TravelBasis, curves: bool, cells: bool, prior: float) -> None:
        self._loads, self._curves, self._cells, self._prior = loads, curves, cells, prior
        self._splines = [basis(load.travel[load.picked]) for load in loads]
        self._friction_splines = [basis(load.friction) for load in loads]
        self._basis = basis

    def solve(self, box: WhiteBox) -> tuple[WhiteBox, Array]:
        """Return the box with its linear parameters at the optimum and the weighted residual."""
        rows, targets = [], []
        for load, spline, inner in zip(self._loads, self._splines, self._friction_splines, strict=True):
            z = box.state(load, inner)[load.picked]
            weight = 1.0 / (load.scale * np.sqrt(load.picked.size))
            columns: list[Array] = []
            known = np.zeros(load.picked.size)
            if self._curves:
                columns += [spline, 0.5 * z[:, None] * spline]
            else:
                known += spline @ box.static + 0.5 * z * np.maximum(spline @ box.height, 0.0)
            if self._cells:
                pairs = zip(box.contacts, box.rates, strict=True)
                columns += [contact_cell(load.travel, load.step_s, c, box.smooth, r)[load.picked, None] for c, r in pairs]
            else:
                for c, r, k in zip(box.contacts, box.rates, box.stiffness, strict=True):
                    known += k * contact_cell(load.travel, load.step_s, c, box.smooth, r)[load.picked]
            rows.append(weight * np.hstack(columns))
            targets.append(weight * (load.force[load.picked] - known))
        return self._bounded(box, np.vstack(rows), np.concatenate(targets))

    def _bounded(self, box: WhiteBox, design: Array, target: Array) -> tuple[WhiteBox, Array]:
        size = self._basis.size
        scale = np.maximum(np.sqrt(np.sum(design**2, axis=0)), 1e-12)
        gram, right = design.T @ design, design.T @ target
        if self._curves:
            rough = np.diff(np.eye(size), n=3, axis=0)
            largest = max(float(load.force.max()) for load in self._loads)
            gram[:size, :size] += SMOOTHNESS / largest**2 * rough.T @ rough
            prior = self._prior / max(float(box.constructed.max()), 1.0) ** 2 * (np.eye(size) + 10.0 * rough.T @ rough)
            gram[size : 2 * size, size : 2 * size] += prior
            right[size : 2 * size] += prior @ box.constructed
        gram = gram / np.outer(scale, scale) + 1e-10 * np.eye(scale.size)
        right = right / scale
        free = np.ones(scale.size, dtype=bool)
        signed = np.zeros(scale.size, dtype=bool)
        if self._curves:
            signed[:size] = True
        for _ in range(scale.size):
            solution = np.zeros(scale.size)
            index = np.flatnonzero(free)
            solution[index] = np.linalg.solve(gram[np.ix_(index, index)], right[index])
            wrong = free & ~signed & (solution < 0.0)
            if not wrong.any():
                break
            free &= ~wrong
        solution = solution / scale
        at = 0
        if self._curves:
            box = dataclasses.replace(box, static=solution[:size], height=solution[size : 2 * size])
            at = 2 * size
        if self._cells:
            box = dataclasses.replace(box, stiffness=solution[at:])
        return box, design @ solution - target


def mean_nrmse(box: WhiteBox, loads: Sequence[Load]) -> float:
    """Return the mean NRMSE over records while loaded, the objective of document 004."""
    return float(np.mean([loaded_nrmse(load, box.force(load)) for load in loads]))


def fit_balance(
    box: WhiteBox, loads: Sequence[Load], *, free: str, prior: float = HEIGHT_PRIOR, evaluations: int = 12
) -> WhiteBox:
    """Fit part of the parameters; the height that steers the Dahl slope is taken from the step before and iterated.

    Parameters
    ----------
    box
        Start.
    loads
        Records; each weighs the same (mean of squared NRMSE).
    free
        ``static`` (curves and slopes), ``cells`` (rates, entry, stiffnesses; contact points held) or ``all``.
    prior
        Price of a height that departs from the constructed one.
    evaluations
        Limit of steps.
    """
    has_cells = box.rates.size > 0
    pack = NonlinearPack(box, free != "cells", free != "static" and has_cells, free == "all", rate_limit(loads))
    linear = _Linear(loads, box.basis, free != "cells", free != "static" and has_cells, prior)
    start, lower, upper = pack.start()

    def residual(x: Array) -> Array:
        return linear.solve(pack.box_at(x))[1]

    found = scipy.optimize.least_squares(
        residual,
        start,
        bounds=(lower, upper),
        diff_step=1e-4,
        max_nfev=evaluations,
        ftol=1e-5,
        xtol=1e-5,
    )
    result, _ = linear.solve(pack.box_at(found.x))
    for _ in range(2):
        # the height steers the slope of the friction it weighs: repeat until both are the same curve
        result, _ = linear.solve(result)
    return result
