# Copyright 2026 ride_estimation contributors
"""Columns of one sensor that drift, or that were not measured but computed from another column."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: blocks whose means show a drift, probability of a false alarm for means that scatter independently
_BLOCKS, _FALSE_ALARM = 20, 1e-6
#: smallest drift over the run worth a word, in standard deviations of the signal
_DRIFT_SHARE = 0.5
#: shortest run in which a drift can be told from motion [s]
_DRIFT_LEAST_S = 20.0
#: unexplained share of the variance below which one column is computed from another: rounding of single precision and text files
_COMPUTED = 1e-9
#: samples that are enough to show that a column is not computed from another
_PART = 512


def drift_findings(values: Array, time_s: Array) -> list[str]:
    """Return a sentence per column whose mean moves steadily through the run.

    A straight line is fitted to the means of equal blocks; the line must stand out of their scatter (t-test) and move the mean by
    a good part of the signal.

    Parameters
    ----------
    values
        Shape (N, C), finite.
    time_s
        Shape (N,), increasing [s].
    """
    if len(values) < 10 * _BLOCKS or time_s[-1] - time_s[0] < _DRIFT_LEAST_S:
        return []
    means = np.array([part.mean(axis=0) for part in np.array_split(values, _BLOCKS)])
    place = np.linspace(-0.5, 0.5, _BLOCKS)
    square = float(place @ place)
    slope = place @ means / square
    rest = means - means.mean(axis=0) - np.outer(place, slope)
    error = np.sqrt((rest**2).sum(axis=0) / (_BLOCKS - 2) / square)
    limit = -float(scipy.special.stdtrit(_BLOCKS - 2, 0.5 * _FALSE_ALARM))
    within = np.sqrt(np.mean((values - values.mean(axis=0)) ** 2, axis=0))
    return [
        f"the mean of column {i + 1} drifts by {slope[i]:.3g} over the run"
        for i in range(values.shape[1])
        if abs(slope[i]) > max(limit * error[i], _DRIFT_SHARE * within[i], 1e-12)
    ]


def derived_findings(values: Array) -> list[str]:
    """Return a sentence per column that repeats another one, or is its derivative, its sum or the magnitude of the others.

    Parameters
    ----------
    values
        Shape (N, C), finite, equidistant.
    """
    if len(values) < 16:
        return []
    found = []
    for i, j in itertools.combinations(range(values.shape[1]), 2):
        x, y = values[:, i], values[:, j]
        if _related(_themselves, x, y):
            u = x - x.mean()
            slope = float(u @ y) / float(u @ u)
            found.append(f"column {j + 1} is {slope:.3g} times column {i + 1}: computed, or one axis recorded twice")
            continue
        for first, second, a, b in ((i, j, x, y), (j, i, y, x)):
            if _related(_derivatives, a, b):
                found.append(f"column {second + 1} is the derivative of column {first + 1}: computed, not measured")
    for i in range(values.shape[1]) if values.shape[1] >= 3 else ():
        others = np.delete(values[:, :3] if i < 3 else values, i, axis=1)
        if _related(_magnitude, others, values[:, i]):
            found.append(f"column {i + 1} is the magnitude of the others: computed, not measured")
    return found


_Pairs = list[tuple[Array, Array]]


def _themselves(x: Array, y: Array) -> _Pairs:
    return [(x, y)]


def _derivatives(x: Array, y: Array) -> _Pairs:
    change = np.diff(x)
    return [(change, y[:-1]), (change, y[1:]), (np.gradient(x), y)]


def _magnitude(x: Array, y: Array) -> _Pairs:
    return [(np.sqrt((x**2).sum(axis=1)), y)]


def _related(pairs: Callable[[Array, Array], _Pairs], x: Array, y: Array) -> bool:
    """Return whether one of the pairs made of ``x`` and ``y`` is the same but for scale and offset and rounding."""
    if len(y) > 4 * _PART:
        # the best line leaves no more of a part than of the whole, so a part can rule it out; the last place may be one-sided
        limit = _COMPUTED * float(y @ y)
        if all(_left(u[:-1], v[:-1])[1] > limit for u, v in pairs(x[:_PART], y[:_PART])):
            return False
    return any(varies and rest <= _COMPUTED * total for varies, rest, total in (_left(u, v) for u, v in pairs(x, y)))


def _left(x: Array, y: Array) -> tuple[bool, float, float]:
    """Return whether both vary, what ``a + b x`` leaves of the sum of squares of ``y`` about its mean, and that sum."""
    u, v = x - x.mean(), y - y.mean()
    uu, vv = float(u @ u), float(v @ v)
    # the mean of equal values may differ from them by rounding
    if np.ptp(x) == 0.0 or np.ptp(y) == 0.0 or uu <= 0.0 or vv <= 0.0:
        return False, 0.0, vv
    rest = v - (u @ v) / uu * u
    return True, float(rest @ rest), vv
