# Copyright 2026 ride_estimation contributors
"""Pseudo-signals: what a cause adds to the model, as a force at a port, a wrench, a measurement or an input error."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: values of a scan
_SCANNED = 161


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
    """A nonlinear parameter of a hypothesis.

    Attributes
    ----------
    value, lower, upper
        Start and bounds.
    step
        Step of the search; 0 searches by factors.
    scan
        How far to both sides of its grid all values are tried first, where the best is a narrow peak that steps do not find.
    """

    name: str
    value: float
    lower: float
    upper: float
    step: float = 0.0
    scan: float = 0.0

    @property
    def spread(self) -> float:
        """Return what is known of the value before any run: half the way between its bounds."""
        return 0.5 * (self.upper - self.lower)

    def scanned(self, current: float) -> tuple[float, ...]:
        """Return the values of a scan around a current one."""
        if self.scan == 0.0:
            return ()
        return tuple(np.clip(current + np.linspace(-self.scan, self.scan, _SCANNED), self.lower, self.upper).tolist())

    def moves(self, current: float) -> tuple[tuple[float, ...], ...]:
        """Return the values to try from a current one: per direction, near the first to go."""
        if self.step > 0.0:
            sizes = [sign * size * self.step for size in (3.0, 1.0, 0.3) for sign in (1, -1)]
            chains = [(current + size, current + 2.0 * size) for size in sizes]
        else:
            chains = [(current * factor, current * factor**2) for factor in (1.6, 1.0 / 1.6, 1.15, 1.0 / 1.15)]
        return tuple(tuple(min(max(v, self.lower), self.upper) for v in chain) for chain in chains)


def combined_effects(columns: Sequence[Column], coefficients: Array) -> tuple[Effect, ...]:
    """Return one effect per entry point with the coefficients applied; mean readings are left out."""
    total: dict[tuple[Where, int], Array] = {}
    for column, value in zip(columns, coefficients):
        if value == 0.0:
            continue
        for effect in column:
            if effect.where is not Where.MEAN:
                key = (effect.where, effect.index)
                total[key] = total.get(key, 0.0) + value * effect.signal
    return tuple(Effect(where, index, signal) for (where, index), signal in total.items())
