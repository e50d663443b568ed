# Copyright 2026 ride_estimation contributors
"""The Berg bushing: spring, one Maxwell cell, smooth friction."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, final

from ride_estimation.elements import declarations
from ride_estimation.elements.base import ForceElement, parameter
from ride_estimation.elements.berg_friction import BergFriction
from ride_estimation.elements.composite import CompositeElement
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.maxwell import Maxwell


@final
@dataclasses.dataclass(frozen=True)
class Berg(CompositeElement):
    """Berg model, ``F = k_e x + m + F_fr``: five parameters and the dead band of the friction.

    Source: document 003 eq. (6)-(9).
    """

    KIND: ClassVar[str] = "berg"

    stiffness: float = parameter(
        "N/m", key="stiffness_n_per_m", lower=0.0, upper=1e10, meaning="static spring rate k_e", role="stiffness",
        source="003 (7)",
    )
    cell_stiffness: float = parameter(
        "N/m", key="cell_stiffness_n_per_m", lower=0.0, upper=1e10, meaning="spring rate k_v of the Maxwell cell",
        role="stiffness", source="003 (8)",
    )
    cell_damping: float = parameter(
        "N s/m", key="cell_damping_n_s_per_m", lower=1e-9, upper=1e9, meaning="damping c_v of the Maxwell cell",
        role="damping", source="003 (8)",
    )
    friction: float = declarations.friction_limit()
    half_stroke: float = declarations.half_stroke()
    dead_band: float = declarations.dead_band()

    def parts(self) -> tuple[ForceElement, ...]:
        """Return spring, Maxwell cell and friction."""
        return (
            KelvinVoigt(self.stiffness, 0.0),
            Maxwell(self.cell_stiffness, self.cell_damping),
            BergFriction(self.friction, self.half_stroke, self.dead_band),
        )

    @classmethod
    def example(cls) -> Berg:
        """Return the bushing of document 003, Table 1."""
        return cls(stiffness=60e3, cell_stiffness=60e3, cell_damping=2387.0, friction=60.0, half_stroke=0.25e-3)
