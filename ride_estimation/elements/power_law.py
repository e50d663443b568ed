# Copyright 2026 ride_estimation contributors
"""Spring and damper whose force is a power of deflection or rate."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar, final

from ride_estimation.elements.base import Array, ForceElement, parameter
from ride_estimation.elements.kernels_static import signed_power
from ride_estimation.elements.terms import POWER_DAMPER, POWER_SPRING, Term


def power_harmonic(exponent: float) -> float:
    """Return the first harmonic of ``sign(sin) |sin|^n``, ``(2 / sqrt(pi)) Gamma(n/2 + 1) / Gamma((n + 3)/2)``."""
    return 2.0 / math.sqrt(math.pi) * math.exp(math.lgamma(0.5 * exponent + 1.0) - math.lgamma(0.5 * exponent + 1.5))


@final
@dataclasses.dataclass(frozen=True)
class PowerSpring(ForceElement):
    """Power-law spring, ``F = k r sign(x) |x / r|^n``.

    k is the secant rate at the reference deflection r, so k keeps its unit when n changes. With r = 1 m its number is that of
    document 002 in N/m^n. For n < 1 the slope at zero is infinite; ``rounding`` makes it finite.

    Source: document 002, spring force with exponent.
    """

    KIND: ClassVar[str] = "power_spring"

    stiffness: float = parameter(
        "N/m", key="stiffness_n_per_m", lower=0.0, upper=1e10, meaning="secant rate k at the reference deflection",
        role="stiffness", source="002 spring force",
    )
    exponent: float = parameter("1", key="exponent", lower=0.1, upper=5.0, meaning="exponent n", source="002 spring force")
    reference: float = parameter(
        "m", key="reference_m", lower=1e-6, upper=10.0, default=1.0, meaning="reference deflection r", source="this project"
    )
    rounding: float = parameter(
        "m", key="rounding_m", lower=0.0, upper=1.0, default=0.0, meaning="deflection over which the corner at zero is rounded",
        source="this project",
    )

    def force(self, s: Array, x: float, v: float) -> float:
        """Return the spring force [N]."""
        return self.stiffness * signed_power(x, self.reference, self.exponent, self.rounding)

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(POWER_SPRING, (self.stiffness, self.reference, self.exponent, self.rounding)),)

    @classmethod
    def example(cls) -> PowerSpring:
        """Return a progressive rubber buffer."""
        return cls(stiffness=200e3, exponent=1.6, reference=0.02)

    def dynamic_stiffness(self, omega: float, amplitude: float) -> complex | None:
        """Return ``k (A / r)^(n-1)`` times the first harmonic of the power [N/m]; None with rounding."""
        if self.rounding > 0.0 or amplitude == 0.0:
            return None
        return complex(self.stiffness * (amplitude / self.reference) ** (self.exponent - 1.0) * power_harmonic(self.exponent))


@final
@dataclasses.dataclass(frozen=True)
class PowerDamper(ForceElement):
    """Power-law damper, ``F = c r sign(v) |v / r|^n``; n = 1 viscous, n = 2 orifice, n < 1 degressive.

    c is the secant damping at the reference rate r. With r = 1 m/s its number is that of document 002 in N (s/m)^n.

    Source: document 002, damping force with exponent.
    """

    KIND: ClassVar[str] = "power_damper"

    damping: float = parameter(
        "N s/m", key="damping_n_s_per_m", lower=0.0, upper=1e9, meaning="secant damping c at the reference rate",
        role="damping", source="002 damping force",
    )
    exponent: float = parameter("1", key="exponent", lower=0.1, upper=5.0, meaning="exponent n", source="002 damping force")
    reference: float = parameter(
        "m/s", key="reference_m_per_s", lower=1e-6, upper=100.0, default=1.0, meaning="reference rate r",
        source="this project",
    )
    rounding: float = parameter(
        "m/s", key="rounding_m_per_s", lower=0.0, upper=10.0, default=0.0,
        meaning="rate over which the corner at zero is rounded", source="this project",
    )

    def force(self, s: Array, x: float, v: float) -> float:
        """Return the damper force [N]."""
        return self.damping * signed_power(v, self.reference, self.exponent, self.rounding)

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(POWER_DAMPER, (self.damping, self.reference, self.exponent, self.rounding)),)

    @classmethod
    def example(cls) -> PowerDamper:
        """Return a degressive shock absorber."""
        return cls(damping=4000.0, exponent=0.7, reference=0.3, rounding=0.01)

    def dynamic_stiffness(self, omega: float, amplitude: float) -> complex | None:
        """Return ``i omega c (omega A / r)^(n-1)`` times the first harmonic of the power [N/m]; None with rounding."""
        if self.rounding > 0.0 or amplitude == 0.0 or omega == 0.0:
            return None
        secant = self.damping * (omega * amplitude / self.reference) ** (self.exponent - 1.0)
        return complex(0.0, omega * secant * power_harmonic(self.exponent))
