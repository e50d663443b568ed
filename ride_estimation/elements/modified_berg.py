# Copyright 2026 ride_estimation contributors
"""The modified Berg bushing: cubic spring, two Maxwell cells, smooth friction."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, final

from ride_estimation.elements import declarations
from ride_estimation.elements.base import ForceElement, parameter
from ride_estimation.elements.berg_friction import BergFriction
from ride_estimation.elements.composite import CompositeElement
from ride_estimation.elements.cubic_spring import CubicSpring
from ride_estimation.elements.maxwell import Maxwell


@final
@dataclasses.dataclass(frozen=True)
class ModifiedBerg(CompositeElement):
    """Modified Berg model, ``F = k_e1 x + k_e3 x^3 + m_1 + m_2 + F_fr``: eight parameters and the dead band.

    Source: document 003 eq. (15)-(18).
    """

    KIND: ClassVar[str] = "modified_berg"

    stiffness: float = parameter(
        "N/m", key="stiffness_n_per_m", lower=0.0, upper=1e10, meaning="static spring rate k_e1", role="stiffness",
        source="003 (16)",
    )
    cubic: float = parameter(
        "N/m^3", key="cubic_n_per_m3", lower=-1e18, upper=1e18, meaning="cubic rate k_e3, negative softens",
        role="stiffness", source="003 (16)",
    )
    cell_1_stiffness: float = parameter(
        "N/m", key="cell_1_stiffness_n_per_m", lower=0.0, upper=1e10, meaning="spring rate k_1 of the first cell",
        role="stiffness", source="003 (17)",
    )
    cell_1_damping: float = parameter(
        "N s/m", key="cell_1_damping_n_s_per_m", lower=1e-9, upper=1e9, meaning="damping c_1 of the first cell",
        role="damping", source="003 (17)",
    )
    cell_2_stiffness: float = parameter(
        "N/m", key="cell_2_stiffness_n_per_m", lower=0.0, upper=1e10, meaning="spring rate k_2 of the second cell",
        role="stiffness", source="003 (18)",
    )
    cell_2_damping: float = parameter(
        "N s/m", key="cell_2_damping_n_s_per_m", lower=1e-9, upper=1e9, meaning="damping c_2 of the second cell",
        role="damping", source="003 (18)",
    )
    friction: float = declarations.friction_limit()
    half_stroke: float = declarations.half_stroke()
    dead_band: float = declarations.dead_band()

    def parts(self) -> tuple[ForceElement, ...]:
        """Return cubic spring, the two Maxwell cells and friction."""
        return (
            CubicSpring(self.stiffness, self.cubic),
            Maxwell(self.cell_1_stiffness, self.cell_1_damping),
            Maxwell(self.cell_2_stiffness, self.cell_2_damping),
            BergFriction(self.friction, self.half_stroke, self.dead_band),
        )

    @classmethod
    def example(cls) -> ModifiedBerg:
        """Return the bushing of document 003, Table 3, time-domain identification."""
        return cls(
            stiffness=127.1e3, cubic=-0.116e9, cell_1_stiffness=6.285e3, cell_1_damping=1555.0, cell_2_stiffness=20e3,
            cell_2_damping=159.0, friction=81.73, half_stroke=0.766e-3,
        )
