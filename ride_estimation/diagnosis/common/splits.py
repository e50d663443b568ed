# Copyright 2026 ride_estimation contributors
"""Which stretches of a run fit, which select and which judge."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]

#: fewer blocks cannot fit, select and judge
LEAST_BLOCKS = 4


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


def judges(index: IntArray) -> NDArray[np.bool_]:
    """Return which blocks judge: the last of every four."""
    return np.asarray(index % 4 == 3)


def make_splits(count: int) -> Splits:
    """Deal blocks: of every four, two to fit, one to select, one to judge."""
    index = np.arange(count)
    return Splits(index[np.isin(index % 4, (0, 2))], index[index % 4 == 1], index[judges(index)])
