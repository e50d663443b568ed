# Copyright 2026 ride_estimation contributors
"""Spring with a linear and a cubic rate."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, final

from ride_estimation.elements.base import Array, ForceElement, parameter
from ride_estimation.elements.terms import ELASTIC, Term


@final
@dataclasses.dataclass(frozen=True)
class CubicSpring(ForceElement):
    """Odd cubic spring, ``F = k_1 x + k_3 x^3``; ``k_3 < 0`` softens.

    Source: document 003 eq. (16).
    """

    KIND: ClassVar[str] = "cubic_spring"

    stiffness: float = parameter(
        "N/m", key="stiffness_n_per_m", lower=0.0, upper=1e10, meaning="spring rate k_1 at zero", role="stiffness",
        source="003 (16)",
    )
    cubic: float = parameter(
        "N/m^3", key="cubic_n_per_m3", lower=-1e18, upper=1e18, meaning="cubic rate k_3", role="stiffness",
        source="003 (16)",
    )

    def force(self, s: Array, x: float, v: float) -> float:
        """Return ``k_1 x + k_3 x^3`` [N]."""
        return self.stiffness * x + self.cubic * x**3

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(ELASTIC, (self.stiffness, self.cubic, 0.0)),)

    @classmethod
    def example(cls) -> CubicSpring:
        """Return the elastic part of the modified Berg bushing of document 003, Table 1."""
        return cls(stiffness=60e3, cubic=-0.15e9)

    def dynamic_stiffness(self, omega: float, amplitude: float) -> complex:
        """Return ``k_1 + (3/4) k_3 A^2`` [N/m], the first harmonic; document 003 (19) prints the secant ``k_3 A^2``."""
        return complex(self.stiffness + 0.75 * self.cubic * amplitude**2)
