# Copyright 2026 ride_estimation contributors
"""Whitened block regression: baseline columns with priors, candidate columns on top, any split by adding block Grams.

Rows are kept in single precision: they are measured in standard deviations of the noise, which rounding changes by 1e-7 of a row.
Their products are those of the rounded rows in double precision, so that every Gram is that of some rows.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

Array = NDArray[np.float64]
SingleArray = NDArray[np.float32]
IntArray = NDArray[np.int64]

#: smallest share of the stated offset tolerance that mean readings which agree better make believe
_BEST_OFFSETS = 1.0 / 3.0


@dataclasses.dataclass(frozen=True)
class Fit:
    """Least squares with priors on some blocks.

    Attributes
    ----------
    coefficients
        Baseline coefficients followed by those of the candidate columns.
    objective
        Sum of squares plus prior penalty on the blocks of the fit; mean rows as in :func:`offset_deviance`.
    covariance
        Of the coefficients.
    expected_penalty
        Mean of the squared deviations from priors and mean readings where all are what is stated: their number without those
        that the blocks leave where they are, ``n - tr(C P)`` with P the information of priors and mean readings.
    """

    coefficients: Array
    objective: float
    covariance: Array
    expected_penalty: float


def offset_deviance(squares: float, count: int) -> float:
    """Return minus twice the log-likelihood of mean readings whose scatter is no larger than the tolerance, up to a constant.

    ``min over s of squares / s^2 + count ln s^2`` with ``s`` from a third to one: where all but one of many readings agree far
    better than the tolerance of offsets says, they were zeroed that well and the one is off.

    Parameters
    ----------
    squares
        Sum of squared mean readings in units of the tolerance.
    count
        Number of readings.
    """
    if count == 0:
        return 0.0
    scale = float(np.clip(squares / count, _BEST_OFFSETS**2, 1.0))
    return squares / scale + count * float(np.log(scale))


def block_products(left: Array | SingleArray, right: Array | SingleArray) -> Array:
    """Return the products of rows of every block in double precision, (B, R, p) and (B, R, q) -> (B, p, q)."""
    out = np.empty((len(left), left.shape[2], right.shape[2]))
    for block, a, b in zip(out, left, right):  # all blocks in double precision at once would take what single precision saves
        wide = a.astype(float, copy=False)
        np.matmul(wide.T, wide if left is right else b.astype(float, copy=False), out=block)
    return out


def whole_rows(rows: NDArray[Any], count: int) -> NDArray[Any]:
    """Return rows (B, R, q) of which the last were given, the others of all ``count`` zero, shape (B, count, q)."""
    if rows.shape[1] == count:
        return rows
    out = np.zeros((len(rows), count, rows.shape[2]), dtype=rows.dtype)
    out[:, count - rows.shape[1] :] = rows
    return out


def side_by_side(*parts: NDArray[Any]) -> NDArray[Any]:
    """Return rows (B, R, q) of several columns together; of parts with fewer rows those before them are zero."""
    count = max(part.shape[1] for part in parts)
    return np.concatenate([whole_rows(part, count) for part in parts], axis=2)


class Regression:
    """Residual rows against baseline columns.

    Parameters
    ----------
    residual
        Shape (B, R), whitened.
    columns
        Shape (B, R, p).
    mean_residual, mean_columns
        Shapes (K,) and (K, p): rows that belong to no block and are in every fit.
    prior_std, prior_offset
        Shape (p,).
    temper
        Sum of squares per degree of freedom that the model cannot avoid. A wrong model is systematically off, so its many
        samples are not independent evidence: priors and mean rows are weighted with it, gains are divided by it.
    """

    def __init__(
        self,
        residual: Array,
        columns: Array | SingleArray,
        mean_residual: Array,
        mean_columns: Array,
        prior_std: Array,
        prior_offset: Array,
        temper: float = 1.0,
    ) -> None:
        root = np.sqrt(temper)
        self.mean_residual, self.mean_columns = root * mean_residual, root * mean_columns
        self.prior_std, self.prior_offset = prior_std / root, prior_offset
        self.temper = temper
        self.count = columns.shape[2]
        # the rows of a minute take sixty megabytes: regressions that differ in few columns share the others
        self._shared: SingleArray = np.empty((*residual.shape, self.count + 1), dtype=np.float32)
        self._shared[:, :, :-1], self._shared[:, :, -1] = whole_rows(columns, residual.shape[1]), residual
        self._fresh: tuple[list[int], SingleArray] = ([], self._shared[:, :, :0])
        self.grams = block_products(self._shared, self._shared)

    def rows(self, blocks: IntArray) -> SingleArray:
        """Return columns and residual of some blocks in single precision, shape (blocks * R, p + 1)."""
        places, fresh = self._fresh
        out = np.empty((len(blocks), *self._shared.shape[1:]), dtype=np.float32)
        for row, block in enumerate(blocks):
            out[row] = self._shared[block]
            out[row][:, places] = fresh[block]
        return out.reshape(-1, out.shape[2])

    def extended(self, rows: Array, means: Array, std: float) -> Regression:
        """Return the regression with further baseline columns.

        Parameters
        ----------
        rows, means
            Shapes (B, R, q) and (K, q); of fewer rows those before them are zero.
        std
            Prior standard deviation of their coefficients.
        """
        other, (p, q), (places, fresh) = copy.copy(self), (self.count, rows.shape[2]), self._fresh
        rows = whole_rows(rows.astype(np.float32), self._shared.shape[1])
        other._shared = np.empty((*rows.shape[:2], p + q + 1), dtype=np.float32)
        other._shared[:, :, :p], other._shared[:, :, -1] = self._shared[:, :, :p], self._shared[:, :, -1]
        other._shared[:, :, [i if i < p else -1 for i in places]] = fresh
        other._shared[:, :, p : p + q] = rows
        other._fresh = [], other._shared[:, :, :0]
        other.count, other.grams = p + q, self.candidate_grams(rows)
        root = np.sqrt(self.temper)
        other.mean_columns = np.hstack([self.mean_columns, root * means])
        other.prior_std = np.concatenate([self.prior_std, np.full(q, std / root)])
        other.prior_offset = np.concatenate([self.prior_offset, np.zeros(q)])
        return other

    def _products(self, rows: Array | SingleArray) -> Array:
        """Return the block products of columns and residual with some rows, (B, R, q) -> (B, p + 1, q).

        Of fewer rows those before them are zero.
        """
        places, fresh = self._fresh
        first = self._shared.shape[1] - rows.shape[1]
        out = block_products(self._shared[:, first:], rows)
        out[:, places] = block_products(fresh[:, first:], rows)
        return out

    def candidate_grams(self, rows: Array | SingleArray) -> Array:
        """Return block Grams of [columns, candidate rows, residual], (B, p + q + 1, p + q + 1); rows as in :meth:`extended`."""
        p, q = self.count, rows.shape[2]
        cross = self._products(rows)
        own = block_products(rows, rows)
        out = np.zeros((len(rows), p + q + 1, p + q + 1))
        out[:, :p, :p], out[:, :p, -1] = self.grams[:, :p, :p], self.grams[:, :p, -1]
        out[:, -1, :p], out[:, -1, -1] = self.grams[:, -1, :p], self.grams[:, -1, -1]
        out[:, :p, p : p + q] = cross[:, :p]
        out[:, p : p + q, :p] = np.swapaxes(cross[:, :p], 1, 2)
        out[:, -1, p : p + q] = cross[:, -1]
        out[:, p : p + q, -1] = cross[:, -1]
        out[:, p : p + q, p : p + q] = own
        return out

    def fit(
        self, grams: Array, blocks: IntArray | Sequence[int], candidate_std: Array | None = None,
        candidate_means: Array | None = None,
    ) -> Fit:
        """Solve on some blocks.

        Parameters
        ----------
        grams
            Of :meth:`candidate_grams`, or :attr:`grams`.
        blocks
            Blocks of the fit.
        candidate_std
            Prior standard deviation of candidate coefficients, shape (q,).
        candidate_means
            Mean rows of the candidate columns, shape (K, q).
        """
        total = grams[np.asarray(blocks, dtype=int)].sum(axis=0)
        size = total.shape[0] - 1
        q = size - self.count
        std = np.concatenate([self.prior_std, np.full(q, np.inf) if candidate_std is None else candidate_std])
        offset = np.concatenate([self.prior_offset, np.zeros(q)])
        means = np.hstack([
            self.mean_columns,
            np.zeros((len(self.mean_residual), q)) if candidate_means is None else np.sqrt(self.temper) * candidate_means,
        ])
        precision = 1.0 / std**2
        known = means.T @ means + np.diag(precision)
        normal = total[:size, :size] + known
        right = total[:size, -1] + means.T @ self.mean_residual + precision * offset
        scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
        factor = cho_factor(normal * np.outer(scale, scale) + 1e-11 * np.eye(size))
        solution = scale * cho_solve(factor, scale * right)
        covariance = self.temper * (scale[:, None] * cho_solve(factor, np.eye(size)) * scale)
        finite = np.isfinite(std)
        objective = (
            self.misfit(grams, blocks, solution)
            + self.temper * offset_deviance(float(np.sum((self.mean_residual - means @ solution) ** 2)) / self.temper, len(means))
            + float(np.sum(((solution - offset)[finite] / std[finite]) ** 2))
        )
        expected = np.count_nonzero(finite) + len(means) - float(np.sum(covariance * known)) / self.temper
        return Fit(solution, objective, covariance, expected)

    def with_temper(self, temper: float) -> Regression:
        """Return the same regression with another temper; Grams are shared."""
        other = copy.copy(self)
        factor = float(np.sqrt(temper / self.temper))
        other.temper = temper
        other.mean_residual, other.mean_columns = factor * self.mean_residual, factor * self.mean_columns
        other.prior_std = self.prior_std / factor
        return other

    def with_prior(self, std: Array, offset: Array) -> Regression:
        """Return the same regression with another prior, shapes (p,); rows and Grams are shared."""
        other = copy.copy(self)
        other.prior_std, other.prior_offset = std / np.sqrt(self.temper), offset
        return other

    def replaced(
        self, index: Sequence[int], rows: Array, residual: Array, prior: tuple[Array, Array], temper: float,
        mean_residual: Array | None = None,
    ) -> Regression:
        """Return the regression with some columns and the residual replaced; Grams of the rest are kept.

        Parameters
        ----------
        index, rows
            Columns to replace and their rows, shape (B, R, len(index)).
        residual
            Shape (B, R).
        prior
            Standard deviation and offset of all baseline coefficients.
        temper
            Of the new regression.
        mean_residual
            Shape (K,); the one there is where None.
        """
        other = copy.copy(self)
        earlier = [i for i, place in enumerate(self._fresh[0]) if place not in index and place != self.count]
        places = [*(self._fresh[0][i] for i in earlier), *index, self.count]
        rows = whole_rows(rows, self._shared.shape[1])
        parts = (self._fresh[1][:, :, earlier], *(new.astype(np.float32) for new in (rows, residual[:, :, None])))
        other._fresh = places, np.concatenate(parts, axis=2)
        cross = other._products(other._fresh[1])
        other.grams = self.grams.copy()
        other.grams[:, :, places] = cross
        other.grams[:, places, :] = np.swapaxes(cross, 1, 2)
        root, old = np.sqrt(temper), np.sqrt(self.temper)
        means = self.mean_residual / old if mean_residual is None else mean_residual
        other.mean_residual, other.mean_columns = root * means, self.mean_columns * root / old
        other.prior_std, other.prior_offset = prior[0] / root, prior[1]
        other.temper = temper
        return other

    @staticmethod
    def misfit(grams: Array, blocks: IntArray | Sequence[int], coefficients: Array) -> float:
        """Return the sum of squares of some blocks for given coefficients."""
        return float(np.sum(Regression.block_misfit(grams, coefficients)[np.asarray(blocks, dtype=int)]))

    @staticmethod
    def block_misfit(grams: Array, coefficients: Array) -> Array:
        """Return the sum of squares of every block, shape (B,)."""
        vector = np.concatenate([coefficients, [-1.0]])
        return np.asarray(np.einsum("i,bij,j->b", vector, grams, vector))
