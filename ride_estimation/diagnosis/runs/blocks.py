# Copyright 2026 ride_estimation contributors
"""What is analysed of a run, dealt into blocks of equal length: stretches between long gaps, without their ends."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.spectra import FrequencyGrid, edge_taper

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: longest gap that is bridged by a straight line [s]: five of 0.1 s in a minute leave a misfit of 1.00 to 1.05 per degree of
#: freedom (0.97 without gaps), of 0.2 s 1.08 to 1.10, of 0.3 s 1.13 to 1.56 (four healthy drawn cabs)
BRIDGED_S = 0.1


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
    stretch
        Number of the stretch between gaps that every block lies in, shape (B,).
    """

    index: NDArray[np.int64]
    weight: Array
    time_s: Array
    stretch: NDArray[np.int64]

    @property
    def begins(self) -> list[int]:
        """Return the first block of every stretch that has some."""
        return [int(block) for block in np.unique(self.stretch, return_index=True)[1]]

    @property
    def count(self) -> int:
        """Return the number of blocks."""
        return len(self.index)


def stretches_of(valid: BoolArray, rate_hz: float) -> tuple[tuple[int, int], ...]:
    """Return the stretches of a run between its long gaps, first sample and the one after the last.

    What the bases do in a long gap nobody knows: after it a run begins anew, from a state of its own.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[True], valid, [True]]).astype(int)))
    gaps = [(first, last) for first, last in edges.reshape(-1, 2).tolist() if last - first > BRIDGED_S * rate_hz]
    cuts = [0, *(edge for gap in gaps for edge in gap), len(valid)]
    return tuple((first, last) for first, last in zip(cuts[::2], cuts[1::2]) if last > first)


def fading(samples: int, stretches: Sequence[tuple[int, int]], rate_hz: float) -> Array:
    """Return a window that fades every stretch in and out, zero between them, shape (N,)."""
    window = np.zeros(samples)
    for first, last in stretches:
        window[first:last] = edge_taper(last - first, rate_hz)
    return window


def _near_gaps(valid: BoolArray, rate_hz: float, settings: Settings) -> BoolArray:
    """Return where a gap is near, bridged ones included, shape (N,)."""
    reach = round(min(settings.trim_s, 1.0) * rate_hz)
    return np.asarray(np.convolve(~valid, np.ones(2 * reach + 1), mode="same") > 0.5)


def make_blocks(
    grid: FrequencyGrid, valid: BoolArray, stretches: Sequence[tuple[int, int]], settings: Settings
) -> Blocks:
    """Deal the decimated samples into blocks, leaving out both ends of every stretch and the surroundings of gaps."""
    rate, full_rate = grid.decimated_rate_hz, grid.rate_hz
    bad = _near_gaps(valid, full_rate, settings)
    length = max(round(settings.block_s * rate), 4)
    parts = []
    for start, end in stretches:
        first = round((start / full_rate + settings.trim_s) * rate)
        last = int(np.floor((end / full_rate - settings.trim_s) * rate))
        count = max((last - first) // length, 0)
        parts.append(first + np.arange(count * length).reshape(count, length))
    index = np.concatenate(parts) if parts else np.zeros((0, length), dtype=int)
    full = np.minimum(np.round(index * full_rate / rate).astype(int), grid.samples - 1)
    weight = np.where(bad[full], 0.0, 1.0)
    keep = weight.mean(axis=1) > 0.5 if len(index) else np.zeros(0, dtype=bool)
    stretch = np.repeat(np.arange(len(parts)), [len(part) for part in parts])[keep]
    index, weight = index[keep], weight[keep]
    return Blocks(index, weight, index.mean(axis=1) / rate if len(index) else np.zeros(0), stretch)


def inside_window(
    grid: FrequencyGrid, valid: BoolArray, stretches: Sequence[tuple[int, int]], settings: Settings
) -> Array:
    """Return the window of what is analysed, both ends of every stretch and the surroundings of gaps zero, shape (N,)."""
    trim = round(settings.trim_s * grid.rate_hz)
    window = np.where(_near_gaps(valid, grid.rate_hz, settings), 0.0, 1.0)
    if len(stretches) == 1 and grid.samples <= 4 * trim:
        return window
    inner = [(first + trim, last - trim) for first, last in stretches if last - first > 2 * trim]
    return window * fading(grid.samples, inner, grid.rate_hz)
