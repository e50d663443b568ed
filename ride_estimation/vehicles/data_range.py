# Copyright 2026 ride_estimation contributors
"""What the data showed of a force element that was identified from them: the range its law is known in."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: share of the power of the deflection rate that lies between the two frequencies
POWER_SHARE = 0.95


@dataclasses.dataclass(frozen=True)
class DataRange:
    """Motion and preload that were in the data; SI, about an axis rad and N m.

    Attributes
    ----------
    deflection
        Largest distance from the mean [m].
    frequency
        Lowest and highest frequency [Hz]: 95 % of the power of the rate lies between them.
    preload
        Lowest and highest mean force [N], None where it was not measured.
    """

    deflection: float
    frequency: tuple[float, float]
    preload: tuple[float, float] | None = None

    def sentence(self, axis: str = "z") -> str:
        """Return the range in words; units of an axis of rotation for ``roll``, ``pitch`` and ``yaw``."""
        length, force = ("rad", "N m") if axis in ("roll", "pitch", "yaw") else ("m", "N")
        words = f"seen in the data: up to {self.deflection:.4g} {length}, {self.frequency[0]:.4g} to {self.frequency[1]:.4g} Hz"
        if self.preload is not None:
            words += f", preload {self.preload[0]:.4g} to {self.preload[1]:.4g} {force}"
        return words


def seen_in(deflection: Array, step_s: float, preload: float | None = None) -> DataRange | None:
    """Return what one record shows of an element, None where it does not move.

    Parameters
    ----------
    deflection
        [m], shape (N,).
    step_s
        Sample time [s].
    preload
        Mean force [N] the element carried.
    """
    x = np.asarray(deflection, dtype=float) - float(np.mean(deflection))
    largest = float(np.max(np.abs(x), initial=0.0))
    if x.size < 8 or not largest > 0.0:
        return None
    frequency = np.fft.rfftfreq(x.size, step_s)
    # a record that does not end where it began would leak over all frequencies
    power = (frequency * np.abs(np.fft.rfft(x * np.hanning(x.size)))) ** 2
    share = np.cumsum(power) / float(np.sum(power))
    low, high = (float(frequency[np.searchsorted(share, s)]) for s in (0.5 - 0.5 * POWER_SHARE, 0.5 + 0.5 * POWER_SHARE))
    return DataRange(largest, (low, high), None if preload is None else (preload, preload))


def union(ranges: Iterable[DataRange | None]) -> DataRange | None:
    """Return the range that several records show together, None where none shows any."""
    known = [r for r in ranges if r is not None]
    if not known:
        return None
    preloads = [r.preload for r in known if r.preload is not None]
    return DataRange(
        max(r.deflection for r in known),
        (min(r.frequency[0] for r in known), max(r.frequency[1] for r in known)),
        (min(p[0] for p in preloads), max(p[1] for p in preloads)) if preloads else None,
    )
