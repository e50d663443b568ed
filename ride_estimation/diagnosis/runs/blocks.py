# Copyright 2026 ride_estimation contributors
"""The stretch of a run that is analysed, dealt into blocks of equal length; ends and gaps are left out."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.spectra import FrequencyGrid, edge_taper

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclasses.dataclass(frozen=True)
class Blocks:
    """Decimated samples of the analysed stretch dealt into equal blocks.

    Attributes
    ----------
    index
        Decimated sample of every row, shape (B, L).
    weight
        One, or zero inside gaps, shape (B, L).
    time_s
        Middle of every block [s], shape (B,).
    """

    index: NDArray[np.int64]
    weight: Array
    time_s: Array

    @property
    def count(self) -> int:
        """Return the number of blocks."""
        return len(self.index)


def make_blocks(grid: FrequencyGrid, valid: BoolArray, settings: Settings) -> Blocks:
    """Deal the decimated samples into blocks, leaving out both ends and the surroundings of gaps."""
    rate = grid.decimated_rate_hz
    reach = round(min(settings.trim_s, 1.0) * grid.rate_hz)
    bad = np.convolve(~valid, np.ones(2 * reach + 1), mode="same") > 0.5
    length = max(round(settings.block_s * rate), 4)
    first = round(settings.trim_s * rate)
    last = int(np.floor((grid.samples / grid.rate_hz - settings.trim_s) * rate))
    count = max((last - first) // length, 0)
    index = first + np.arange(count * length).reshape(count, length)
    full = np.minimum(np.round(index * grid.rate_hz / rate).astype(int), grid.samples - 1)
    weight = np.where(bad[full], 0.0, 1.0)
    keep = weight.mean(axis=1) > 0.5 if count else np.zeros(0, dtype=bool)
    index, weight = index[keep], weight[keep]
    return Blocks(index, weight, index.mean(axis=1) / rate if len(index) else np.zeros(0))


def inside_window(grid: FrequencyGrid, valid: BoolArray, settings: Settings) -> Array:
    """Return the window of the stretch that is analysed, both ends and the surroundings of gaps zero, shape (N,)."""
    trim = round(settings.trim_s * grid.rate_hz)
    reach = round(min(settings.trim_s, 1.0) * grid.rate_hz)
    window = np.where(np.convolve(~valid, np.ones(2 * reach + 1), mode="same") > 0.5, 0.0, 1.0)
    if grid.samples > 4 * trim:
        window[:trim] = window[grid.samples - trim :] = 0.0
        window[trim : grid.samples - trim] *= edge_taper(grid.samples - 2 * trim, grid.rate_hz)
    return window
