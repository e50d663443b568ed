# Copyright 2026 ride_estimation contributors
"""Last rounds of the white box: the hysteresis height is searched as what it is, weight and steering of the friction at once.

In the earlier stages the height is eliminated as a linear weight while the one of the step before steers the friction slope
(document 004 (3)). Where records tell it badly, putting the new one in for the old changes the model again and the rounds
wander. Here its coefficients are searched together with slopes, contact points, rates and entry; static curve and stiffnesses
stay eliminated.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.identification.bench.jounce_columns import contact_cell
from ride_estimation.identification.bench.jounce_model import Load, WhiteBox
from ride_estimation.identification.bench.jounce_search import HEIGHT_PRIOR, SMOOTHNESS, NonlinearPack
from ride_estimation.identification.bench.variable_projection import solve_linear

Array = NDArray[np.float64]


class _Problem:
    """Weighted residual of all records over nonlinear parameters and height, static curve and stiffnesses at their optimum."""

    def __init__(self, box: WhiteBox, loads: Sequence[Load], pack: NonlinearPack) -> None:
        self._box, self._loads, self._pack = box, loads, pack
        self._splines = [box.basis(load.travel[load.picked]) for load in loads]
        self._friction_splines = [box.basis(load.friction) for load in loads]
        self._weights = [1.0 / (load.scale * np.sqrt(load.picked.size)) for load in loads]
        self._cells: dict[tuple[int, float, float, float], Array] = {}
        size = box.basis.size
        self.height_scale = max(float(box.constructed.max()), 1.0)
        rough = np.diff(np.eye(size), n=3, axis=0)
        largest = max(float(load.force.max()) for load in loads)
        self._smooth_static = np.sqrt(SMOOTHNESS) / largest * rough
        # the same price of a height that departs from the constructed one as in the earlier stages
        self._prior = np.sqrt(HEIGHT_PRIOR) * np.vstack([np.eye(size), np.sqrt(10.0) * rough])

    def _cell(self, i: int, contact: float, smooth: float, rate: float) -> Array:
        key = (i, contact, smooth, rate)
        if key not in self._cells:
            if len(self._cells) > 400:  # finite differences move one cell at a time: the others are found again
                self._cells.clear()
            load = self._loads[i]
            self._cells[key] = contact_cell(load.travel, load.step_s, contact, smooth, rate)[load.picked, None]
        return self._cells[key]

    def solve(self, x: Array) -> tuple[WhiteBox, Array]:
        """Return the white box and the weighted residual with the prices of roughness and of the height's departure."""
        size = self._box.basis.size
        box = dataclasses.replace(self._pack.box_at(x[size:]), height=x[:size] * self.height_scale)
        rows, targets = [], []
        for i, (load, spline, inner) in enumerate(zip(self._loads, self._splines, self._friction_splines, strict=True)):
            z = box.state(load, inner)[load.picked]
            friction = 0.5 * z * np.maximum(spline @ box.height, 0.0)
            cells = [self._cell(i, float(c), box.smooth, float(r)) for c, r in zip(box.contacts, box.rates, strict=True)]
            rows.append(self._weights[i] * np.hstack([spline, *cells]))
            targets.append(self._weights[i] * (load.force[load.picked] - friction))
        price = np.zeros((self._smooth_static.shape[0], size + box.rates.size))
        price[:, :size] = self._smooth_static
        design, target = np.vstack([*rows, price]), np.concatenate([*targets, np.zeros(price.shape[0])])
        positive = np.arange(size + box.rates.size) >= size
        solution, _ = solve_linear(design.T @ design, design.T @ target, positive)
        box = dataclasses.replace(box, static=solution[:size], stiffness=solution[size:])
        departure = self._prior @ (x[:size] - box.constructed / self.height_scale)
        return box, np.concatenate([design @ solution - target, departure])


def fit_consistent(box: WhiteBox, loads: Sequence[Load], *, evaluations: int = 6) -> WhiteBox:
    """Fit all parameters to all records with one height for weight and steering.

    Parameters
    ----------
    box
        Start, from the stages of :mod:`~ride_estimation.identification.bench.jounce`.
    loads
        Records; each weighs the same.
    evaluations
        Limit of steps.
    """
    start_box = with_idle_cells_moved(box)
    pack = NonlinearPack.of_everything(start_box, loads)
    problem = _Problem(start_box, loads, pack)
    start, lower, upper = pack.start()
    size = box.basis.size
    full_start = np.concatenate([np.maximum(start_box.height, 0.0) / problem.height_scale, start])
    found = scipy.optimize.least_squares(
        lambda x: problem.solve(x)[1],
        np.maximum(full_start, np.concatenate([np.full(size, 1e-9), lower])),
        bounds=(np.concatenate([np.zeros(size), lower]), np.concatenate([np.full(size, 1e3), upper])),
        diff_step=1e-4,
        max_nfev=evaluations,
        ftol=1e-5,
        xtol=1e-5,
    )
    return problem.solve(found.x)[0]


def with_idle_cells_moved(box: WhiteBox) -> WhiteBox:
    """Return the box with cells that carry nothing moved to the widest gap between contact points.

    A cell without stiffness feels no gradient and would stay where it is.
    """
    contacts, rates = box.contacts.copy(), box.rates.copy()
    for i in np.flatnonzero(box.stiffness <= 0.0):
        others = np.sort(np.concatenate([[0.0], np.delete(contacts, i), [float(box.basis.knots[-1])]]))
        widest = int(np.argmax(np.diff(others)))
        contacts[i] = 0.5 * (others[widest] + others[widest + 1])
        rates[i] = float(np.exp(np.mean(np.log(np.delete(rates, i)))))
    return dataclasses.replace(box, contacts=contacts, rates=rates)
