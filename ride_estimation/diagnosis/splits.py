# Copyright 2026 ride_estimation contributors
"""Which stretches of a run fit, which select and which judge."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]

#: fewer blocks cannot fit, select and judge
LEAST_BLOCKS = 4
_FIT, _SELECT, _JUDGE = range(3)
#: blocks of every four for each of them
_SHARES = (2, 1, 1)


@dataclasses.dataclass(frozen=True)
class Splits:
    """Blocks dealt to fit, select and judge, interleaved in time."""

    fit: IntArray
    select: IntArray
    judge: IntArray

    @property
    def train(self) -> IntArray:
        """Return fit and select blocks."""
        return np.sort(np.concatenate([self.fit, self.select]))


def make_splits(peaks: NDArray[np.float64]) -> Splits:
    """Deal blocks: of every four, two to fit, one to select and one to judge, each part with its share of the roughest ones.

    What shows in a few blocks alone (a stop that is hit now and then) is found and confirmed only where both parts have some of
    them: the roughest block is dealt first, each to the part of its four that has the fewest of the rougher ones.

    Parameters
    ----------
    peaks
        How rough every block is, shape (B,).
    """
    free = [[_FIT, _SELECT, _FIT, _JUDGE][: len(peaks) - first] for first in range(0, len(peaks), 4)]
    roles, dealt = np.zeros(len(peaks), dtype=int), np.zeros(3)
    for block in np.argsort(-peaks, kind="stable"):
        part = min(free[block // 4], key=lambda p: (dealt[p] / _SHARES[p], p))
        free[block // 4].remove(part)
        roles[block] = part
        dealt[part] += 1
    return Splits(*(np.flatnonzero(roles == part) for part in (_FIT, _SELECT, _JUDGE)))
