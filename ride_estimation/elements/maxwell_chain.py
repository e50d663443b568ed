# Copyright 2026 ride_estimation contributors
"""Any number of Maxwell cells in parallel with a spring."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import ClassVar, final

from ride_estimation.elements.base import ForceElement, parameter, series
from ride_estimation.elements.composite import CompositeElement
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.maxwell import Maxwell


@final
@dataclasses.dataclass(frozen=True)
class MaxwellChain(CompositeElement):
    """Generalised Maxwell model, ``F = k x + sum_i m_i``, ``m_i' = -(k_i / c_i) m_i + k_i v``.

    Source: document 003 eq. (8), (17), (18).
    """

    KIND: ClassVar[str] = "maxwell_chain"

    stiffness: float = parameter(
        "N/m", key="stiffness_n_per_m", lower=0.0, upper=1e10, meaning="static spring rate k", role="stiffness",
        source="003 (7)",
    )
    cell_stiffnesses: tuple[float, ...] = series(
        "N/m", key="cell_stiffnesses_n_per_m", lower=0.0, upper=1e10, meaning="spring rates k_i of the cells",
        role="stiffness", source="003 (17), (18)",
    )
    cell_dampings: tuple[float, ...] = series(
        "N s/m", key="cell_dampings_n_s_per_m", lower=1e-9, upper=1e9, meaning="dampings c_i of the cells", role="damping",
        source="003 (17), (18)",
    )

    def _bound_problems(self) -> Iterator[str]:
        yield from super()._bound_problems()
        if len(self.cell_stiffnesses) != len(self.cell_dampings):
            yield (
                f"cell_stiffnesses_n_per_m has {len(self.cell_stiffnesses)} and cell_dampings_n_s_per_m "
                f"{len(self.cell_dampings)} entries; one of each per cell is needed"
            )

    def parts(self) -> tuple[ForceElement, ...]:
        """Return the spring and the cells."""
        cells = zip(self.cell_stiffnesses, self.cell_dampings, strict=True)
        return (KelvinVoigt(self.stiffness, 0.0), *(Maxwell(k, c) for k, c in cells))

    @classmethod
    def example(cls) -> MaxwellChain:
        """Return a rubber with three cells a decade apart."""
        return cls(stiffness=100e3, cell_stiffnesses=(10e3, 20e3, 30e3), cell_dampings=(2000.0, 400.0, 60.0))
