# Copyright 2026 ride_estimation contributors
"""Which sensor a residual of redundant readings accuses: share that each explains, isolation, ambiguity group.

Readings ``y = H x + f`` of a motion x leave the residual ``r = P y`` with ``P = I - H H^+``. A fault f of sensor s alone explains
``r_s^T P_ss^+ r_s`` of ``|r|^2`` (least squares over f), over many samples ``tr(P_ss^+ C_ss)`` of ``tr C`` with the moments
``C = <r r^T>``. It is isolated where that is enough and no other sensor explains nearly as much (analytical redundancy, parity
space; Gertler, Fault Detection and Diagnosis in Engineering Systems, 1998).
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: share of what the best sensor explains from which on another could be meant as well
_RIVAL = 0.9


@dataclasses.dataclass(frozen=True)
class Redundancy:
    """What the residual says of every sensor.

    Attributes
    ----------
    matrix
        P of all channels, symmetric, shape (C, C); with weights also ``R^-1 P``.
    inverse
        Pseudo-inverse of the diagonal block of every sensor, shape (S, n, n).
    ranks
        Of these blocks, shape (S,): equations that are left to a sensor by the others.
    count
        Number of redundant equations.
    """

    matrix: Array
    inverse: Array
    ranks: NDArray[np.int64]
    count: int

    @classmethod
    def of(cls, matrix: Array, channels: int, tolerance: float) -> Redundancy:
        """Split a projection by sensors.

        Parameters
        ----------
        matrix
            P, shape (C, C).
        channels
            Of every sensor, n; the sensors follow each other.
        tolerance
            Singular values of a block below this share of its largest count as zero.
        """
        parts = range(0, len(matrix), channels)
        blocks = [matrix[i : i + channels, i : i + channels] for i in parts]
        inverse = [np.linalg.pinv(b, rcond=tolerance, hermitian=True) for b in blocks]
        ranks = [np.linalg.matrix_rank(b, tol=tolerance, hermitian=True) for b in blocks]
        count = round(float(np.trace(matrix)))
        return cls(matrix, np.array(inverse).reshape(-1, channels, channels), np.array(ranks, dtype=np.int64), count)

    def explained(self, moments: Array) -> Array:
        """Return the share of ``tr C`` that a fault of each sensor alone explains, shape (S,).

        Parameters
        ----------
        moments
            C of the residuals, shape (C, C), in any unit.
        """
        count, channels = self.inverse.shape[:2]
        own = moments.reshape(count, channels, count, channels)[np.arange(count), :, np.arange(count)]
        return np.asarray(np.sum(self.inverse * own, axis=(1, 2)) / max(float(np.trace(moments)), 1e-30))


def ambiguity_group(explained: Array) -> tuple[int, ...]:
    """Return the sensors that explain nearly as much as the best, in their order, that one included.

    Parameters
    ----------
    explained
        Share that each explains, shape (S,).
    """
    return tuple(int(s) for s in np.flatnonzero(explained >= _RIVAL * explained.max(initial=0.0)))


def isolated(explained: Array, enough: float) -> int | None:
    """Return the sensor that explains enough while no other could be meant, None where there is none.

    Parameters
    ----------
    explained
        Share that each explains, shape (S,).
    enough
        Share that it must explain.
    """
    group = ambiguity_group(explained)
    return group[0] if len(group) == 1 and explained[group[0]] > enough else None
