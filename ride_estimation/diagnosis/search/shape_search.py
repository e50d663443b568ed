# Copyright 2026 ride_estimation contributors
"""Trials of the shape parameters of one hypothesis with the linear coefficients of all of them eliminated."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.baseline import MeanTable
from ride_estimation.diagnosis.common.effect import Column, combined_effects
from ride_estimation.diagnosis.hypotheses.hypothesis import Hypothesis, Shapes, Sign
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.screening import Projector, Pushed, mean_rows, solve_signed

Array = NDArray[np.float64]

_STEPS = 2  # Gauss-Newton steps of the shape parameters in one pass
_SHARES = (1.0, 0.4, 0.15)  # of such a step that are tried: the edge of a contact is no straight line
_CLOSE = 2  # best entries of a grid whose scales are varied before the best of all is chosen
_BATCH = 24  # columns of one product: reading the baseline takes as long as 24 products with it


class ShapeTrials:
    """Trials of the shape of one hypothesis, the shapes of all others given; none is computed twice.

    Parameters
    ----------
    view, table, projector
        The run, its mean readings and what the baseline explains.
    hypothesis
        Whose shape is tried.
    others
        Hypotheses in the same model with their shapes.
    """

    def __init__(
        self, view: RunView, table: MeanTable, projector: Projector, hypothesis: Hypothesis,
        others: Sequence[tuple[Hypothesis, Shapes]] = (),
    ) -> None:
        self._view, self._table, self._projector, self._hypothesis = view, table, projector, hypothesis
        parts = [(h, h.columns(view, shape)) for h, shape in others]
        self._signs = [sign for h, own in parts for sign in h.column_signs(len(own))]
        self._others = (self._pushed([c for _, own in parts for c in own]),) if self._signs else ()
        self._known: dict[tuple[tuple[str, float], ...], tuple[Array, float]] = {}
        self._best: tuple[float, Shapes, Pushed] | None = None

    def coefficients(self, shape: Shapes) -> Array:
        """Return the coefficients of the columns of the hypothesis for a shape."""
        self.drops([shape])
        return self._known[_key(shape)][0]

    def drops(self, shapes: Sequence[Shapes]) -> list[float]:
        """Return by how much the objective falls for every one of some shapes."""
        new = list({_key(shape): shape for shape in shapes if _key(shape) not in self._known}.values())
        while new:
            parts = [self._hypothesis.columns(self._view, new[0])]
            count = max(_BATCH // max(len(parts[0]), 1), 1)
            parts += [self._hypothesis.columns(self._view, shape) for shape in new[1:count]]
            together, start = self._pushed([c for own in parts for c in own]), 0
            for shape, own in zip(new, parts):
                one = together.part(slice(start, start + len(own)))
                self._known[_key(shape)] = found = self._solved(one)
                if self._best is None or found[1] > self._best[0]:
                    self._best = found[1], shape, one
                start += len(own)
            del new[:count]
        return [self._known[_key(shape)][1] for shape in shapes]

    def chosen(self, start: dict[str, float]) -> dict[str, float]:
        """Return the best entry of a grid that tells apart more than shape parameters, scales varied, or where one starts.

        The screening chose along stiffness and damping of a model without the law.
        """
        h, refined = self._hypothesis, {s.name for s in self._hypothesis.shapes}
        if not any(name not in refined for name in start):
            return start
        ranked = self._ranked([dict(start), *(dict(g) for g in h.grid if g != start)])
        return self._ranked([ranked[0], *_widened(h, ranked[:_CLOSE])])[0]

    def _ranked(self, shapes: list[dict[str, float]]) -> list[dict[str, float]]:
        """Return shapes, the best first."""
        drops = self.drops(shapes)
        return [shapes[i] for i in sorted(range(len(shapes)), key=lambda i: -drops[i])]

    def searched(self, start: dict[str, float]) -> dict[str, float]:
        """Return shape parameters improved one at a time, see :func:`searched_shape`."""
        return searched_shape(self._hypothesis, start, self.drops)

    def stepped(self, start: dict[str, float]) -> dict[str, float]:
        """Return shape parameters after Gauss-Newton steps of all of them together."""
        shape, h = start, self._hypothesis
        for _ in range(_STEPS):
            coefficients, current = self.coefficients(shape), self.drops([shape])[0]
            slopes, sizes = slopes_of(h, self._view, shape, coefficients)
            best = self._best
            own = best[2] if best is not None and best[1] == shape else self._pushed(h.columns(self._view, shape))
            moves = self._solved(own, self._pushed(slopes))[0][len(coefficients) :] * sizes
            trials = [_moved(h, shape, share * moves) for share in _SHARES]
            better = next((trial for trial in trials if self.drops([trial])[0] > current + 0.5), None)
            if better is None:
                break
            shape = better
        return shape

    def _pushed(self, columns: Sequence[Column]) -> Pushed:
        return self._projector.pushed(self._view.push(columns, single=True), mean_rows(self._table, columns))

    def _solved(self, own: Pushed, *slopes: Pushed) -> tuple[Array, float]:
        """Return the coefficients of columns of the hypothesis and of slopes, and by how much the objective falls."""
        free = sum(len(part.size) for part in slopes)
        signs = [*self._hypothesis.column_signs(len(own.size)), *[Sign.ANY] * free, *self._signs]
        coefficients, drop = solve_signed(*self._projector.join(own, *slopes, *self._others), signs)
        return coefficients[: len(own.size) + free], drop


def _key(shape: Shapes) -> tuple[tuple[str, float], ...]:
    return tuple(sorted(shape.items()))


def searched_shape(
    hypothesis: Hypothesis, start: dict[str, float], drops: Callable[[Sequence[Shapes]], Sequence[float]]
) -> dict[str, float]:
    """Return shape parameters improved one at a time: by a scan where one starts on the grid, and by fixed moves."""
    best, current = start, drops([start])[0]
    for shape in hypothesis.shapes:
        if start in hypothesis.grid:
            scan = [{**best, shape.name: value} for value in shape.scanned(best[shape.name])]
            current, best = max([(current, best), *zip(drops(scan), scan)], key=lambda pair: pair[0])
        for number in range(len(shape.moves(best[shape.name]))):
            for value in shape.moves(best[shape.name])[number]:
                trial = {**best, shape.name: value}
                gained = drops([trial])[0]
                if gained <= current + 0.5:
                    break
                current, best = gained, trial
    return best


def slopes_of(
    hypothesis: Hypothesis, view: RunView, shape: Shapes, coefficients: Array
) -> tuple[list[Column], Array]:
    """Return what small moves of the shape parameters change in the response to a law, and the moves (Gauss-Newton)."""
    own = hypothesis.columns(view, shape)
    weights = coefficients[: len(own)]
    out: list[Column] = []
    sizes = []
    for s in hypothesis.shapes:
        size = 0.1 * s.step if s.step > 0.0 else 0.02 * abs(shape[s.name])
        if shape[s.name] + size > s.upper:
            size = -size
        moved = hypothesis.columns(view, {**shape, s.name: shape[s.name] + size})
        out.append(combined_effects([*moved, *own], np.concatenate([weights, -weights])))
        sizes.append(size)
    return out, np.array(sizes)


def _moved(hypothesis: Hypothesis, shape: dict[str, float], moves: Array) -> dict[str, float]:
    """Return shape parameters after a step, limited to where its linearisation may hold."""
    out = dict(shape)
    for s, move in zip(hypothesis.shapes, moves):
        limit = 3.0 * s.step if s.step > 0.0 else 0.4 * abs(shape[s.name])
        out[s.name] = float(np.clip(shape[s.name] + np.clip(move, -limit, limit), s.lower, s.upper))
    return out


def _widened(hypothesis: Hypothesis, entries: Sequence[Shapes]) -> list[dict[str, float]]:
    """Return shapes with their scales down to half and up to double."""
    scales = {s.name: s for s in hypothesis.shapes if s.step == 0.0}
    out: list[dict[str, float]] = []
    for entry in entries:
        for factor in (0.5, 0.7, 1.4, 2.0):
            scaled = {n: min(max(factor * v, scales[n].lower), scales[n].upper) if n in scales else v for n, v in entry.items()}
            if scaled not in out and scaled != entry:
                out.append(scaled)
    return out
