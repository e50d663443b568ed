# Copyright 2026 ride_estimation contributors
"""Parameters that move while they are learned: the last seconds against all that was learned before.

A filter that remembers half a minute follows rubber that warms with a lag of half a minute, and calls the misfit noise. The
gradients of the last intervals at the present parameters show it: without a change their sum ``S`` is zero within the scatter
``r A`` of an interval against its neighbours (successive differences, von Neumann, Ann. Math. Stat. 12, 367, 1941: what moves
slowly does not count). Along directions where it is not, the sum of many intervals is forgotten and the last ones count alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: intervals that show a change: a few seconds
RECENT = 8
#: intervals that show how much gradients scatter
_FEWEST = 16
#: standard deviations beyond which the last intervals contradict what was learned
_CONTRADICT = 4.0
#: intervals' worth of the mean scatter that the scatter of a direction is mixed with
_SHRINK = 4.0
#: standard deviation a change opens in a logarithm along its direction
_CHANGE_STD = 0.15


def observable_directions(information: Array) -> tuple[Array, Array]:
    """Return eigenvalues and eigenvectors of an information (N, N) along which it is informative, shapes (D,), (N, D)."""
    values, basis = np.linalg.eigh(information)
    keep = values > 1e-6 * values[-1]
    return values[keep], basis[:, keep]


def steady_scatter(scores: Array) -> Array:
    """Return the scatter of the sum of J gradients from differences of neighbouring pairs, shape (N, N).

    Parameters
    ----------
    scores
        Gradients of intervals one after the other, shape (J, N), J at least 4.
    """
    pairs = scores[1:] + scores[:-1]
    steps = pairs[2:] - pairs[:-2]
    return np.asarray(steps.T @ steps / 4.0 * len(scores) / len(steps))


def moved(information: Array, scores: Array, p: Array, common: Array) -> tuple[Array, Array]:
    """Return by how much the parameters have moved, shape (N,), and what that adds to their covariance, shape (N, N).

    Parameters
    ----------
    information
        Of the intervals, shape (J, N, N).
    scores
        Their gradients at the present parameters, shape (J, N).
    p
        Covariance of the parameters, shape (N, N).
    common
        Directions that are tested first, shape (N, C): what a load or warmth does to all mounts alike.
    """
    step, added = np.zeros(len(p)), np.zeros_like(p)
    if len(scores) < _FEWEST:
        return step, added
    recent = information[-RECENT:].sum(axis=0)
    basis = np.hstack([common, observable_directions(recent)[1]])
    values = np.sum(basis * (recent @ basis), axis=0)
    size = np.sum(basis * (information @ basis), axis=1)
    # rough segments are more informative and scatter more than smooth ones
    scatter = np.diag(steady_scatter(scores @ basis / np.sqrt(np.maximum(size, 1e-12 * values)))) / len(scores)
    scatter = (len(scores) * scatter + _SHRINK * scatter.mean()) / (len(scores) + _SHRINK)
    total = scores[-RECENT:].sum(axis=0)
    for n, direction in enumerate(basis.T):
        along = float((total - recent @ step) @ direction)
        if along**2 <= _CONTRADICT**2 * scatter[n] * values[n]:
            continue
        before = float(direction @ p @ direction)
        variance = before + _CHANGE_STD**2
        gain = variance * values[n] / (variance * values[n] + scatter[n])
        step += gain * along / values[n] * direction
        added += max((1.0 - gain) * variance - before, 0.0) * np.outer(direction, direction)
    return step, added


def common_change(old: Array, old_std: Array, new: Array, new_std: Array) -> tuple[float, float, float]:
    """Return the change of logarithms that is common to all, its standard deviation, and the share of all change it explains.

    Parameters
    ----------
    old, old_std, new, new_std
        Logarithms and their standard deviations before and after, shape (N,).
    """
    weight = 1.0 / (old_std**2 + new_std**2)
    change = new - old
    total = float(np.sum(weight))
    mean = float(np.sum(weight * change)) / total
    left, whole = float(np.sum(weight * (change - mean) ** 2)), float(np.sum(weight * change**2))
    return mean, float(total**-0.5), 1.0 - left / whole if whole > 0.0 else 0.0
