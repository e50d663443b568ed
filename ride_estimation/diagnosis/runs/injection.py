# Copyright 2026 ride_estimation contributors
"""How pseudo-signals reach the whitened outputs: transfer functions whitened once, then one product per signal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.effect import Column, Effect, Where
from ride_estimation.diagnosis.common.spectra import FrequencyGrid
from ride_estimation.diagnosis.model.response import LinearResponse

ComplexArray = NDArray[np.complex128]

_FORCES = (Where.PORT, Where.WRENCH)
_TRANSFERS = {Where.PORT: "output_from_port", Where.WRENCH: "output_from_wrench", Where.INPUT: "output_from_input"}


class Injector:
    """Whitened response to pseudo-signals; the whitened transfer functions are made when first needed and kept.

    Parameters
    ----------
    grid
        Frequencies.
    response
        Transfer functions of the plant.
    whitener
        Shape (F, ny, ny).
    silent
        Number of the first whitened channels that no force reaches; forces are pushed into the others alone.
    """

    def __init__(self, grid: FrequencyGrid, response: LinearResponse, whitener: ComplexArray, silent: int = 0) -> None:
        self._grid, self._response, self._whitener, self._silent = grid, response, whitener, silent
        self._known: dict[tuple[Where, bool], NDArray[Any]] = {}

    def transfer(self, where: Where, single: bool = False) -> NDArray[Any]:
        """Return the whitened transfer function from an entry point, shape (F, channels, number of entries).

        Of forces, the channels are those that they reach.
        """
        found = self._known.get((where, single))
        if found is None:
            found = self._whitener[:, self._silent :] if where in _FORCES else self._whitener
            if where is not Where.OUTPUT:
                found = found @ getattr(self._response, _TRANSFERS[where])
            self._known[where, single] = found = found.astype(np.complex64) if single else found
        return found

    def reached(self, columns: Sequence[Column]) -> int:
        """Return how many of the whitened channels columns of effects reach, the last ones."""
        forces = all(e.where in _FORCES for column in columns for e in column if e.where is not Where.MEAN)
        return int(self._whitener.shape[1]) - (self._silent if forces else 0)

    def whitened(self, columns: Sequence[Column], single: bool = False) -> NDArray[Any]:
        """Return the whitened output spectra of columns of effects, shape (F, channels, q); mean readings are left out.

        Of forces alone, the channels are those that they reach.

        Parameters
        ----------
        single
            Products in single precision, for scores of many columns; spectra are taken in double precision.
        """
        kind = np.complex64 if single else np.complex128
        parts = [[e for e in column if e.where is not Where.MEAN] for column in columns]
        f, count = len(self._whitener), self.reached(columns)
        out = np.zeros((f, count, len(columns)), dtype=kind)
        for where in dict.fromkeys(e.where for part in parts for e in part):
            transfers = self.transfer(where, single)
            reached = out[:, count - transfers.shape[1] :]
            alone = [j for j, part in enumerate(parts) if len(part) == 1 and part[0].where is where]
            if alone:
                effects = [parts[j][0] for j in alone]
                transfer = transfers[:, :, [e.index for e in effects]]
                product = transfer * self._spectra(effects).astype(kind, copy=False)[:, None, :]
                if len(alone) == len(columns):
                    return np.asarray(product)
                reached[:, :, alone] += product
            shared = [j for j, part in enumerate(parts) if len(part) > 1 and any(e.where is where for e in part)]
            if shared:
                used = [(n, e) for n, j in enumerate(shared) for e in parts[j] if e.where is where]
                entries = sorted({e.index for _, e in used})
                signals = np.zeros((f, len(entries), len(shared)), dtype=kind)
                spectra = self._spectra([e for _, e in used])
                for i, (n, e) in enumerate(used):
                    signals[:, entries.index(e.index), n] += spectra[:, i]
                reached[:, :, shared] += transfers[:, :, entries] @ signals
        return out

    def _spectra(self, effects: Sequence[Effect]) -> ComplexArray:
        """Return the spectra of the signals of effects, shape (F, q)."""
        return self._grid.spectrum(np.stack([e.signal for e in effects], axis=1))
