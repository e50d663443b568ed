# Copyright 2026 ride_estimation contributors
"""Stage 1 of the white box: static curve, hysteresis height and Dahl slopes from slow records (document 004)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.identification.bench.jounce_columns import make_basis
from ride_estimation.identification.bench.jounce_model import Load, WhiteBox
from ride_estimation.identification.bench.jounce_search import HEIGHT_PRIOR, fit_balance

Array = NDArray[np.float64]


def hysteresis_branches(load: Load, grid: Array) -> tuple[Array, Array]:
    """Return the mean force of loading and unloading of the largest cycle on a travel grid, shapes (G,)."""
    peak = int(np.argmax(load.travel))
    begin = peak - int(np.argmax(load.travel[peak::-1] <= 0.0)) if np.any(load.travel[: peak + 1] <= 0.0) else 0
    after = load.travel[peak:] <= 0.0
    end = peak + int(np.argmax(after)) if after.any() else load.travel.size - 1
    branches = []
    for part in (slice(begin, peak + 1), slice(peak, end + 1)):
        order = np.argsort(load.travel[part], kind="stable")
        u, f = load.travel[part][order], load.force[part][order]
        edges = np.concatenate([[-np.inf], 0.5 * (grid[1:] + grid[:-1]), [np.inf]])
        index = np.digitize(u, edges) - 1
        count = np.bincount(index, minlength=grid.size)
        mean = np.bincount(index, weights=f, minlength=grid.size) / np.maximum(count, 1)
        known = count > 0
        branches.append(np.interp(grid, grid[known], mean[known]))
    return branches[0], branches[1]


def fit_static(static: Sequence[Load], largest: float) -> WhiteBox:
    """Identify static curve, hysteresis height and Dahl slopes from slow records."""
    basis = make_basis(largest)
    main = max(static, key=lambda load: float(load.travel.max()))
    grid = np.linspace(0.0, float(main.travel.max()), 120)
    loading, unloading = hysteresis_branches(main, grid)
    middle, height = 0.5 * (loading + unloading), np.maximum(loading - unloading, 0.0)
    height = _continued(grid, middle, height)
    spline = basis(grid)
    penalty = 1e-2 * basis.roughness()
    design, zeros = np.vstack([spline, penalty]), np.zeros(penalty.shape[0])
    f = np.linalg.lstsq(design, np.concatenate([middle, zeros]), rcond=None)[0]
    w = np.maximum(np.linalg.lstsq(design, np.concatenate([height, zeros]), rcond=None)[0], 0.0)
    reference = max(float(w[-1]), 1.0)
    slope = 10.0 * reference / float(main.travel.max())
    none = np.zeros(0)
    box = WhiteBox(basis, f, w, np.array([slope, 4.0 * slope, 1.0]), none, none, none, 1e-3, w)
    # first the slopes with the constructed height, then the height may depart from it more and more
    for prior in (1e2, 1e-2, HEIGHT_PRIOR):
        box = fit_balance(box, static, free="static", prior=prior)
    return box


def _continued(grid: Array, middle: Array, height: Array) -> Array:
    """Continue the height beyond its inflection by the scaled and shifted static curve, C1 (document 004)."""
    smooth = np.convolve(np.pad(height, 4, mode="edge"), np.ones(9) / 9, mode="valid")
    slope = np.gradient(smooth, grid)
    inflection = int(np.argmax(slope[5:-5])) + 5
    if inflection >= grid.size - 6:
        return smooth
    ratio = slope[inflection] / max(np.gradient(middle, grid)[inflection], 1e-9)
    continued = smooth.copy()
    continued[inflection:] = smooth[inflection] + ratio * (middle[inflection:] - middle[inflection])
    return np.maximum(continued, smooth)
