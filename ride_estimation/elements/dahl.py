# Copyright 2026 ride_estimation contributors
"""Dahl friction."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar, final

import numpy as np
import scipy

from ride_estimation.elements import declarations
from ride_estimation.elements.base import Array, ForceElement, parameter
from ride_estimation.elements.terms import DAHL, Term


@final
@dataclasses.dataclass(frozen=True)
class Dahl(ForceElement):
    """Dahl friction, ``dF/dt = sigma (1 - s F / f_c)^n v`` with ``s = sign(v)``; the memory is its force.

    Source: document 004 eq. (4) without weighting (n = 1).
    """

    KIND: ClassVar[str] = "dahl"

    friction: float = parameter(
        "N", key="friction_n", lower=0.0, upper=1e6, meaning="largest friction force f_c", role="friction", source="004 (4)"
    )
    slope: float = parameter(
        "N/m", key="slope_n_per_m", lower=0.0, upper=1e12, meaning="stiffness sigma at rest and after a reversal at zero force",
        role="friction", source="004 (4)",
    )
    exponent: float = parameter(
        "1", key="exponent", lower=0.5, upper=5.0, default=1.0, meaning="shape exponent n", source="Dahl 1968"
    )
    dead_band: float = declarations.dead_band()

    def initial(self) -> Array:
        """Return the memory at rest: no force."""
        return np.zeros(1)

    def rate(self, s: Array, x: float, v: float) -> Array:
        """Return ``sigma (1 - s F / f_c)^n v`` [N/s]."""
        if self.friction == 0.0:
            return np.zeros(1)
        room: float = max(1.0 - math.copysign(1.0, v) * float(s[0]) / self.friction, 0.0)
        return np.array([self.slope * math.pow(room, self.exponent) * v])

    def force(self, s: Array, x: float, v: float) -> float:
        """Return F [N]."""
        return float(s[0])

    def fastest_rate(self, peak_speed: float) -> float:
        """Return ``n sigma v / f_c`` times the factor 2^(n-1) of a full reversal [1/s]."""
        if self.friction == 0.0:
            return 0.0
        reversal = math.pow(2.0, max(self.exponent - 1.0, 0.0))
        return self.exponent * reversal * self.slope * abs(peak_speed) / self.friction

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(DAHL, (self.friction, self.slope, self.exponent, self.dead_band)),)

    @classmethod
    def example(cls) -> Dahl:
        """Return the dry friction of a damper seal."""
        return cls(friction=60.0, slope=240e3)

    def dynamic_stiffness(self, omega: float, amplitude: float) -> complex | None:
        """Return ``4 f_c e^(-z) I_1(z) / (A (1 + e^(-2z))) + i W / (pi A^2)``, ``z = sigma A / f_c`` [N/m]; only for n = 1."""
        loss = self.loss_energy(omega, amplitude)
        if loss is None:
            return None
        if amplitude == 0.0 or self.friction == 0.0:
            return complex(self.slope if self.friction > 0.0 else 0.0)
        z = self.slope * amplitude / self.friction
        storage = 4.0 * self.friction * float(scipy.special.ive(1, z)) / (amplitude * (1.0 + math.exp(-2.0 * z)))
        return complex(storage, loss / (math.pi * amplitude**2))

    def loss_energy(self, omega: float, amplitude: float) -> float | None:
        """Return ``4 f_c (A - (f_c / sigma) tanh(sigma A / f_c))`` [J] per cycle; only for n = 1."""
        if self.exponent != 1.0:
            return None
        if self.friction == 0.0 or self.slope == 0.0:
            return 0.0
        z = self.slope * amplitude / self.friction
        # z - tanh z cancels for small strokes
        excess = z**3 * (1 / 3 - z**2 * (2 / 15 - z**2 * (17 / 315 - z**2 * 62 / 2835))) if z < 0.03 else z - math.tanh(z)
        return 4.0 * self.friction**2 / self.slope * excess
