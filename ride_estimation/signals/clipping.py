# Copyright 2026 ride_estimation contributors
"""Where readings are cut off, from how often their extreme value occurs: on samples as they arrived, before any interpolation."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ride_estimation.signals.recording import Channel

Array = NDArray[np.float64]

#: how many times as often as any of the values beside it the extreme value occurs where a signal is clipped; at the extreme of a
#: sinusoid in whole steps it is 2.4, where chance or a rate raised by repetition decides about one
CLIPPED_RATIO = 5.0
#: values beside the extreme that are looked at
_NEIGHBOURS = 8
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
        for row, ordered, level in ((0, counts, known[:1]), (1, counts[::-1], known[-1:])):
            near = ordered[1 : 1 + _NEIGHBOURS]
            # zero is where things rest; a value most of the run shows is where this one does
            if not len(near) or level[0] == 0.0 or ordered[0] >= _RESTS * len(column):
                continue
            if ordered[0] > CLIPPED_RATIO * int(near.max()):
                out[row, i] = level[0]
    return out


def clipped_at(channels: Iterable[Channel]) -> dict[str, Array]:
    """Return where the readings of sensors are cut, corrected as their values will be, of those that are, shape (2, C) each."""
    out = {}
    for channel in channels:
        good = np.all(np.isfinite(channel.values), axis=1)
        levels = clipping_levels(channel.values[good][:, :3])
        if np.any(np.isfinite(levels)):
            out[channel.name] = channel.correction.apply(levels)
    return out
