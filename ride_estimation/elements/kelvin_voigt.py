# Copyright 2026 ride_estimation contributors
"""Linear spring and damper in parallel."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, final

from ride_estimation.elements.base import Array, ForceElement, parameter
from ride_estimation.elements.terms import ELASTIC, Term


@final
@dataclasses.dataclass(frozen=True)
class KelvinVoigt(ForceElement):
    """Kelvin-Voigt element, ``F = k x + c v``.

    Source: document 003 eq. (3)-(5).
    """

    KIND: ClassVar[str] = "kelvin_voigt"

    stiffness: float = parameter(
        "N/m", key="stiffness_n_per_m", lower=0.0, upper=1e10, meaning="spring rate k", role="stiffness", source="003 (3)"
    )
    damping: float = parameter(
        "N s/m", key="damping_n_s_per_m", lower=0.0, upper=1e8, meaning="viscous damping c", role="damping", source="003 (3)"
    )

    def force(self, s: Array, x: float, v: float) -> float:
        """Return ``k x + c v`` [N]."""
        return self.stiffness * x + self.damping * v

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(ELASTIC, (self.stiffness, 0.0, self.damping)),)

    @classmethod
    def example(cls) -> KelvinVoigt:
        """Return the bushing of document 003, Table 1."""
        return cls(stiffness=60e3, damping=2387.0)

    def dynamic_stiffness(self, omega: float, amplitude: float) -> complex:
        """Return ``k + i omega c`` [N/m] (document 003 eq. (4))."""
        return complex(self.stiffness, omega * self.damping)
