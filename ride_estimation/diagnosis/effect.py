# Copyright 2026 ride_estimation contributors
"""Pseudo-signals: what a cause adds to the model, as a force at a port, a wrench, a measurement or an input error."""

from __future__ import annotations

import dataclasses
import enum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Where(enum.Enum):
    """Where a pseudo-signal enters the plant."""

    PORT = "port"  #: extra tension in a port [N]
    WRENCH = "wrench"  #: extra generalised force on a coordinate [N, N m]
    OUTPUT = "output"  #: extra reading of an output channel
    INPUT = "input"  #: error of an input channel that the model should not have seen
    MEAN = "mean"  #: change of a mean reading, row of the mean table


@dataclasses.dataclass(frozen=True)
class Effect:
    """One pseudo-signal.

    Attributes
    ----------
    where, index
        Entry point and its row.
    signal
        Samples at the full rate, shape (N,), or shape (1,) for ``MEAN``.
    """

    where: Where
    index: int
    signal: Array


#: pseudo-signals that share one coefficient
Column = tuple[Effect, ...]


@dataclasses.dataclass(frozen=True)
class Shape:
    """A nonlinear parameter of a hypothesis: value, bounds, and whether to search it on a logarithmic scale."""

    name: str
    value: float
    lower: float
    upper: float
