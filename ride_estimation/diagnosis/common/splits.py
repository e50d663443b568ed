# Copyright 2026 ride_estimation contributors
"""Which stretches of a run fit, which select and which judge."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]

_FITS, _SELECTS, _JUDGES = range(3)
_DEAL = (_FITS, _SELECTS, _FITS, _JUDGES)
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

    def of_copy(self, count: int) -> Splits:
        """Return the same of the blocks of a copy of the run, ``count`` of them, which may be shorter."""
        known = len(self.train) + len(self.judge)
        fit = np.concatenate([self.fit, np.arange(known, count)])
        return Splits(*(part[part < count] for part in (fit, self.select, self.judge)))


def make_splits(count: int, begins: Collection[int] = (), order: Sequence[int] | None = None) -> Splits:
    """Deal blocks: of every four, two to fit, one to select, one to judge.

    Parameters
    ----------
    count
        Number of blocks.
    begins
        First blocks of stretches between gaps: they tell the initial state, and the next block judges instead, if there is one.
    order
        All blocks in the order in which they are dealt; that of time where None.
    """
    dealt: tuple[list[int], list[int], list[int]] = ([], [], [])
    turn = 0
    for block in range(count) if order is None else order:
        part = _DEAL[turn % len(_DEAL)]
        if part == _JUDGES and block in begins:
            dealt[_FITS].append(block)
            continue
        dealt[part].append(block)
        turn += 1
    if begins and not dealt[_JUDGES]:
        return make_splits(count, (), order)
    return Splits(*(np.sort(np.array(part, dtype=np.int64)) for part in dealt))
