# Copyright 2026 ride_estimation contributors
"""Where readings are cut off, from how often their extreme value occurs: on samples as they arrived, before any interpolation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: values next to the extreme one that it is compared with
_NEIGHBOURS = 8
#: how many times as often as the most frequent of them the extreme value of a clipped signal occurs, and how often at least
_RATIO, _LEAST = 3, 4
#: share of the samples above which a signal rests at a value rather than being cut there
_RESTS = 0.5


def clipping_levels(values: Array) -> Array:
    """Return the values at which a signal is cut, shape (2, C): lower ones, -inf where not, and upper ones, inf where not.

    Values grow rarer towards an extreme, whatever the resolution of the converter: an extreme value that occurs far more often
    than those next to it is a limit.

    Parameters
    ----------
    values
        Finite samples, shape (N, C).
    """
    out = np.tile(np.array([[-np.inf], [np.inf]]), (1, values.shape[1]))
    for i, column in enumerate(values.T):
        known, counts = np.unique(column, return_counts=True)
        if len(known) <= _NEIGHBOURS:
            continue
        for row, ordered, level in ((0, counts, known[0]), (1, counts[::-1], known[-1])):
            often = int(ordered[1 : 1 + _NEIGHBOURS].max())
            if ordered[0] >= _LEAST and ordered[0] > _RATIO * often and ordered[0] < _RESTS * len(column):
                out[row, i] = level
    return out
