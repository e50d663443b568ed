# Copyright 2026 ride_estimation contributors
"""Score tests: how much of the residual each hypothesis would explain beyond everything a calibration can adjust."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from ride_estimation.diagnosis.calibration.baseline import MeanTable
from ride_estimation.diagnosis.calibration.regression import Regression
from ride_estimation.diagnosis.common.effect import Column, Where
from ride_estimation.diagnosis.common.parallel import in_order
from ride_estimation.diagnosis.hypotheses.hypothesis import Hypothesis, Shapes, Sign
from ride_estimation.diagnosis.runs.noise import temper_of
from ride_estimation.diagnosis.runs.run_view import RunView

Array = NDArray[np.float64]
SingleArray = NDArray[np.float32]
IntArray = NDArray[np.int64]

_BATCH = 16  # columns of one product: more take memory and no less time
_USUAL_COLUMNS = 2  # of a hypothesis at one place

#: hypothesis, shape, and the hypotheses served by its columns with the places of their ports among its own
_Job = tuple[Hypothesis, Shapes, list[tuple[Hypothesis, tuple[int, ...]]]]


@dataclasses.dataclass(frozen=True)
class Score:
    """Result of one score test.

    Attributes
    ----------
    gain
        Half the drop of the objective over the temper, log-likelihood gain [nat].
    penalised
        Gain minus the price of columns, shapes and choices [nat].
    """

    hypothesis: Hypothesis
    shape: Shapes
    coefficients: Array
    gain: float
    penalised: float


def mean_rows(table: MeanTable, columns: Sequence[Column]) -> Array:
    """Return the mean rows of columns in units of the offset tolerance, shape (K, q)."""
    out = np.zeros((len(table.std), len(columns)))
    for j, column in enumerate(columns):
        for effect in column:
            if effect.where is Where.MEAN:
                out[effect.index, j] += effect.signal[0] / table.std[effect.index]
    return out


@dataclasses.dataclass(frozen=True)
class Pushed:
    """Candidate rows prepared once for every normal matrix they are part of.

    Attributes
    ----------
    rows, size
        Rows of the fit blocks with unit norm, shape (B, R, Q), and their norms (Q,). Rows before them are zero.
    cross
        Products with the baseline columns and the residual, shape (p + 1, Q).
    means
        Mean rows, weighted with the temper, shape (K, Q).
    """

    rows: Array
    size: Array
    cross: Array
    means: Array

    def part(self, columns: slice) -> Pushed:
        """Return some of the columns."""
        return Pushed(
            np.ascontiguousarray(self.rows[:, :, columns]), self.size[columns], self.cross[:, columns], self.means[:, columns]
        )

    def last(self, count: int) -> Array:
        """Return the last rows of every block, flat, shape (B * count, Q)."""
        return self.rows[:, self.rows.shape[1] - count :].reshape(-1, self.rows.shape[2])


class Projector:
    """Removes what the baseline explains and solves small candidate systems.

    Parameters
    ----------
    regression
        Baseline columns and residual.
    blocks
        Blocks of the fit.
    """

    def __init__(self, regression: Regression, blocks: IntArray) -> None:
        self.regression, self.blocks = regression, blocks
        p = regression.count
        total = regression.grams[blocks].sum(axis=0)
        precision = 1.0 / regression.prior_std**2
        normal = total[:p, :p] + regression.mean_columns.T @ regression.mean_columns + np.diag(precision)
        right = total[:p, p] + regression.mean_columns.T @ regression.mean_residual + precision * regression.prior_offset
        self._scale = 1.0 / np.sqrt(np.diag(normal))
        self._factor = cho_factor(normal * np.outer(self._scale, self._scale) + 1e-11 * np.eye(p))
        self._solution = self._solve(right)
        # single precision halves the traffic; the score of a column survives it, the normal matrix above is double
        full = regression.rows(blocks)
        self._full = full.reshape(len(blocks), -1, full.shape[1])
        self._last: dict[int, SingleArray] = {}

    def _solve(self, right: Array) -> Array:
        scale = self._scale if right.ndim == 1 else self._scale[:, None]
        return np.asarray(scale * cho_solve(self._factor, scale * right))

    def pushed(self, rows: Array, means: Array) -> Pushed:
        """Return candidate rows, shape (B, R, Q), with what they share with the baseline; rows before them are zero."""
        used = rows[self.blocks]
        flat = used.reshape(-1, rows.shape[2])
        size = np.sqrt(np.einsum("ij,ij->j", flat, flat, dtype=float))
        flat /= np.maximum(size, np.finfo(flat.dtype).tiny).astype(flat.dtype)
        cross = (self._baseline(rows.shape[1]).T @ flat.astype(np.float32, copy=False)).astype(float) * size
        return Pushed(used, size, cross, np.sqrt(self.regression.temper) * means)

    def _baseline(self, count: int) -> SingleArray:
        """Return the last rows of every block of the baseline, flat, shape (B * count, p + 1)."""
        if count not in self._last:
            self._last[count] = self._full[:, self._full.shape[1] - count :].reshape(-1, self._full.shape[2])
        return self._last[count]

    def join(self, *parts: Pushed) -> tuple[Array, Array]:
        """Return the normal matrix (Q, Q) and right side (Q,) of candidates together after the baseline is removed."""
        p = self.regression.count
        own = [[np.zeros((0, 0))] * len(parts) for _ in parts]
        for i, a in enumerate(parts):
            for j, b in enumerate(parts[: i + 1]):
                count = min(a.rows.shape[1], b.rows.shape[1])
                own[i][j] = (a.last(count).T @ b.last(count)).astype(float) * np.outer(a.size, b.size)
                own[j][i] = own[i][j].T
        cross, means = (np.hstack([getattr(part, name) for part in parts]) for name in ("cross", "means"))
        against = cross[:p] + self.regression.mean_columns.T @ means
        normal = np.block(own) + means.T @ means - against.T @ self._solve(against)
        right = cross[p] + means.T @ self.regression.mean_residual - against.T @ self._solution
        return normal, right

    def reduce(self, rows: Array, means: Array) -> tuple[Array, Array]:
        """Return the normal matrix (Q, Q) and right side (Q,) of candidate rows after the baseline is removed."""
        return self.join(self.pushed(rows, means))


def solve_signed(normal: Array, right: Array, signs: Sequence[Sign]) -> tuple[Array, float]:
    """Return coefficients that respect their signs and the drop of the objective (columns of wrong sign are dropped)."""
    active = list(range(len(right)))
    out = np.zeros(len(right))
    while active:
        a = normal[np.ix_(active, active)]
        scale = 1.0 / np.sqrt(np.maximum(np.diag(a), 1e-300))
        scaled = a * np.outer(scale, scale) + 1e-9 * np.eye(len(active))
        coefficients = scale * np.linalg.solve(scaled, scale * right[active])
        wrong = [
            (abs(c) / s, i) for c, s, i in zip(coefficients, scale, active) if signs[i] != Sign.ANY and c * int(signs[i]) < 0.0
        ]
        if not wrong:
            out[active] = coefficients
            return out, float(right[active] @ coefficients)
        active.remove(max(wrong)[1])
    return out, 0.0


def price(hypothesis: Hypothesis, columns: int, samples: float, choices: int) -> float:
    """Return the price of a hypothesis [nat]: BIC of columns, shapes and data-drawn parameters, and the number of choices."""
    count = columns + len(hypothesis.shapes) + hypothesis.complexity
    return 0.5 * count * float(np.log(max(samples, 2.0))) + float(np.log(max(choices, 1)))


def screen(
    view: RunView, table: MeanTable, projector: Projector, hypotheses: Sequence[Hypothesis], samples: float
) -> list[Score]:
    """Return the best score of every hypothesis over its grid, best first.

    Parameters
    ----------
    samples
        Effective number of samples of the fit, for the price of a parameter.
    """
    jobs = _jobs(hypotheses)
    choices = sum(len(members) for _, _, members in jobs)

    def score(batch: Sequence[_Job]) -> list[Score]:
        return _score_batch(view, table, projector, batch, samples, choices)

    best: dict[int, Score] = {}
    for scores in in_order(score, _batches(jobs), view.settings.threads):
        for s in scores:
            known = best.get(id(s.hypothesis))
            if known is None or s.gain > known.gain:
                best[id(s.hypothesis)] = s
    return sorted(_at_common_temper(view, projector.regression.temper, best.values(), samples), key=lambda s: -s.penalised)


def _at_common_temper(view: RunView, temper: float, scores: Iterable[Score], samples: float) -> list[Score]:
    """Return scores with gains weighed as after the best of them, as full fits are compared.

    The temper of the model before the round counts all its misfit as model error. Gains divided by that shrink below every
    price, and the order would be the order of the prices.
    """
    known = list(scores)
    misfit = 1.0 + (temper - 1.0) / max(view.inefficiency, 1.0)
    largest = max((2.0 * temper * s.gain for s in known), default=0.0)
    factor = temper / temper_of(max(misfit - largest / max(samples, 1.0), 1.0), view.inefficiency)
    return [dataclasses.replace(s, gain=factor * s.gain, penalised=factor * s.gain - (s.gain - s.penalised)) for s in known]


def _jobs(hypotheses: Sequence[Hypothesis]) -> list[_Job]:
    """Return what to compute: hypothesis, shape and the hypotheses that its columns serve with the places of their ports.

    A law at all mounts of an axis serves the same law at each of them and at every pair.
    """
    jobs: list[_Job] = []
    served: set[tuple[int, int]] = set()
    for h in sorted(hypotheses, key=lambda h: -len(h.ports)):
        family = [
            o for o in hypotheses
            if len(h.ports) > len(o.ports) > 0 and (o.cause, o.axis, o.variant) == (h.cause, h.axis, h.variant)
            and set(o.ports) <= set(h.ports)
        ]
        for i, shape in enumerate(h.grid):
            if (id(h), i) in served:
                continue
            members = [(h, tuple(range(max(len(h.ports), 1))))]
            for o in family:
                if shape in o.grid and (id(o), o.grid.index(shape)) not in served:
                    members.append((o, tuple(h.ports.index(p) for p in o.ports)))
                    served.add((id(o), o.grid.index(shape)))
            jobs.append((h, shape, members))
    return jobs


def _batches(jobs: Sequence[_Job]) -> list[list[_Job]]:
    """Return the jobs in batches of about as many columns as pay in one product, taking two per port for all of them."""
    out: list[list[_Job]] = []
    total = _BATCH
    for job in jobs:
        if total >= _BATCH:
            out.append([])
            total = 0
        out[-1].append(job)
        total += _USUAL_COLUMNS * max(len(job[0].ports), 1)
    return out


def _score_batch(
    view: RunView, table: MeanTable, projector: Projector, jobs: Sequence[_Job], samples: float, choices: int
) -> list[Score]:
    """Return the scores of the jobs of one batch."""
    batch = [(job, columns) for job in jobs if (columns := job[0].columns(view, job[1]))]
    flat = [c for _, columns in batch for c in columns]
    if not flat:
        return []
    out: list[Score] = []
    normal, right = projector.reduce(view.push(flat, single=True), mean_rows(table, flat))
    offset = 0
    for (main, shape, members), columns in batch:
        per_port = len(columns) // max(len(main.ports), 1)
        for h, places in members:
            part = np.array([offset + place * per_port + i for place in places for i in range(per_port)])
            q = len(part)
            coefficients, drop = solve_signed(normal[np.ix_(part, part)], right[part], h.column_signs(q))
            gain = 0.5 * drop / projector.regression.temper if h.absorbed or h.meaningful(coefficients, shape) else 0.0
            out.append(Score(h, shape, coefficients, gain, gain - price(h, q, samples, choices)))
        offset += len(columns)
    return out
