# Copyright 2026 ride_estimation contributors
"""Pseudo-damage of load signals by rainflow counting (ASTM E1049) and a power law; comparison of model and measurement."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ride_estimation.errors import InputDataError

Array = NDArray[np.float64]

DEFAULT_SLOPE = 5.0  # exponent of the pseudo S-N line for welded and formed steel parts, the usual default in load comparison


def rainflow_ranges(values: ArrayLike) -> tuple[Array, Array]:
    """Return (ranges, counts) of the rainflow cycles, half cycles counted 0.5 (ASTM E1049 section 5.4.4).

    Parameters
    ----------
    values
        Load signal, shape (N,), any unit.

    Raises
    ------
    InputDataError
        Fewer than two samples, values not finite, or the ``rainflow`` library (extra ``durability``) is missing.
    """
    y = np.asarray(values, dtype=float).ravel()
    if y.size < 2 or not np.all(np.isfinite(y)):
        raise InputDataError("rainflow counting needs at least two finite samples")
    try:
        import rainflow
    except ImportError as error:
        raise InputDataError("rainflow counting needs the extra 'durability': pip install ride_estimation[durability]") from error
    cycles = [(r, c) for r, _, c, _, _ in rainflow.extract_cycles(y)]
    if not cycles:
        return np.zeros(0), np.zeros(0)
    ranges, counts = np.array(cycles, dtype=float).T
    return ranges, counts


def pseudo_damage(values: ArrayLike, slope: float = DEFAULT_SLOPE) -> float:
    """Return ``sum n_i range_i^slope`` [unit^slope]; only ratios of it mean anything."""
    ranges, counts = rainflow_ranges(values)
    return float(np.sum(counts * ranges**slope))


def damage_ratio(measured: ArrayLike, modelled: ArrayLike, slope: float = DEFAULT_SLOPE) -> float:
    """Return pseudo-damage of the model over that of the measurement; 1 is right, 2 means half the life."""
    reference = pseudo_damage(measured, slope)
    if reference == 0.0:
        raise InputDataError("the measured signal does no damage: a ratio is not defined")
    return pseudo_damage(modelled, slope) / reference


def relative_damage_share(values: ArrayLike, rate_hz: float, block_s: float, slope: float = DEFAULT_SLOPE) -> Array:
    """Return the share of each time block in the summed block damages, shape (B,): which minute did it.

    Cycles that span blocks are counted in no block, so shares rank blocks and do not add up to the damage of the run.
    """
    y = np.asarray(values, dtype=float).ravel()
    length = round(block_s * rate_hz)
    if length < 2 or y.size < length:
        raise InputDataError(f"blocks of {block_s:g} s do not fit a record of {y.size / rate_hz:g} s")
    blocks = [pseudo_damage(y[i : i + length], slope) for i in range(0, y.size - length + 1, length)]
    total = sum(blocks)
    return np.array(blocks) / total if total > 0.0 else np.zeros(len(blocks))


def level_crossings(values: ArrayLike, levels: ArrayLike) -> NDArray[np.int64]:
    """Return how often the signal crosses each level upwards, shape (L,)."""
    y, level = np.asarray(values, dtype=float).ravel(), np.asarray(levels, dtype=float).ravel()
    below = y[:-1, None] < level[None, :]
    above = y[1:, None] >= level[None, :]
    return np.asarray(np.sum(below & above, axis=0), dtype=np.int64)
