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
#: share of the deflection seen, or of a travel or speed that was fitted, beyond which a law is extrapolated
BEYOND = 1.05
#: fewest samples that show a motion
_LEAST = 8
#: length of the stretches of a run whose spectra are added up [s]
_STRETCH_S = 10.0


@dataclasses.dataclass(frozen=True)
class DataRange:
    """Motion and preload that were in the data; SI, about an axis rad and N m.

    Attributes
    ----------
    deflection
        Largest distance from the mean, of a bumper the largest travel [m].
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
    x = np.asarray(deflection, dtype=float)[:, None]
    return _range(*_shown(x), step_s, len(x), preload)[0] if len(x) >= _LEAST else None


def seen_in_contact(
    deflection: Array, contact: NDArray[np.bool_], step_s: float, preload: float | None = None
) -> DataRange | None:
    """Return what one record shows of an element that has its zero where contact begins, and not at the mean.

    Parameters
    ----------
    deflection, step_s, preload
        As for :func:`seen_in`; how far the element is out of contact tells nothing of it.
    contact
        Whether the element pushes, shape (N,).
    """
    travel = np.where(contact, deflection, 0.0)
    shown = seen_in(travel, step_s, preload)
    return None if shown is None else dataclasses.replace(shown, deflection=float(np.max(np.abs(travel))))


def _shown(deflection: Array) -> tuple[Array, Array]:
    """Return the largest distance from the mean of every column, shape (P,), and the power of its rate, shape (F, P)."""
    x = deflection - deflection.mean(axis=0)
    # a record that does not end where it began would leak over all frequencies
    spectrum = np.abs(np.fft.rfft(x * np.hanning(len(x))[:, None], axis=0))
    power: Array = (np.arange(len(spectrum), dtype=float)[:, None] * spectrum) ** 2
    return np.abs(x).max(axis=0), power


def _range(
    largest: Array, power: Array, step_s: float, samples: int, *preload: float | None
) -> tuple[DataRange | None, ...]:
    frequency = np.fft.rfftfreq(samples, step_s)
    out: list[DataRange | None] = []
    for size, column, load in zip(largest, power.T, preload, strict=True):
        if not (size > 0.0 and np.sum(column) > 0.0):
            out.append(None)
            continue
        share = np.cumsum(column) / float(np.sum(column))
        low, high = (float(frequency[np.searchsorted(share, s)]) for s in (0.5 - 0.5 * POWER_SHARE, 0.5 + 0.5 * POWER_SHARE))
        out.append(DataRange(float(size), (low, high), None if load is None else (load, load)))
    return tuple(out)


class RangeMeter:
    """What data show of several elements while they arrive: :func:`seen_in` of stretches of 10 s, their power added up.

    Parameters
    ----------
    preload
        Mean force each element carries [N], None where it is not known, length P.
    """

    def __init__(self, *preload: float | None) -> None:
        self._preload = preload
        self._begin(0.0)

    def _begin(self, step_s: float) -> None:
        count = len(self._preload)
        self._step, self._largest, self._power = step_s, np.zeros(count), np.zeros((0, count))
        self.restart()

    def restart(self) -> None:
        """Begin a new stretch; what whole stretches showed stays."""
        self._blocks: list[Array] = []
        self._held = 0

    def observe(self, deflection: Array, step_s: float) -> None:
        """Take a block of deflections [m], shape (n, P), with its sample time [s]; another one than before begins anew."""
        if step_s != self._step:
            self._begin(step_s)
        self._blocks.append(np.array(deflection))
        self._held += len(deflection)
        samples = round(_STRETCH_S / step_s)
        if self._held < samples:
            return
        held = np.concatenate(self._blocks)
        self.restart()
        largest, power = _shown(held[:samples])
        self._power = self._power + power if len(self._power) else power
        self._largest = np.maximum(self._largest, largest)

    def ranges(self) -> tuple[DataRange | None, ...]:
        """Return what was shown of every element, None before the first whole stretch and where it does not move."""
        if not len(self._power):
            return tuple(None for _ in self._preload)
        return _range(self._largest, self._power, self._step, round(_STRETCH_S / self._step), *self._preload)


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
