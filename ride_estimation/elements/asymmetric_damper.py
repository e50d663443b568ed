# Copyright 2026 ride_estimation contributors
"""Damper with different rates in extension and compression."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar, final

from ride_estimation.elements.base import Array, ForceElement, parameter
from ride_estimation.elements.terms import ASYMMETRIC_DAMPER, Term


@final
@dataclasses.dataclass(frozen=True)
class AsymmetricDamper(ForceElement):
    """Damper with two rates, ``F = c_e v`` for v > 0 (extension), ``c_c v`` for v < 0 (compression).

    Its mean force over a cycle is not zero, ``(c_e - c_c) omega A / pi``: it jacks the body down or up.
    """

    KIND: ClassVar[str] = "asymmetric_damper"

    extension: float = parameter(
        "N s/m", key="extension_n_s_per_m", lower=0.0, upper=1e8, meaning="damping in extension c_e", role="damping",
        source="this project",
    )
    compression: float = parameter(
        "N s/m", key="compression_n_s_per_m", lower=0.0, upper=1e8, meaning="damping in compression c_c", role="damping",
        source="this project",
    )

    def force(self, s: Array, x: float, v: float) -> float:
        """Return the damper force [N]."""
        return (self.extension if v > 0.0 else self.compression) * v

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(ASYMMETRIC_DAMPER, (self.extension, self.compression)),)

    @classmethod
    def example(cls) -> AsymmetricDamper:
        """Return a cab shock absorber."""
        return cls(extension=3500.0, compression=1200.0)

    def dynamic_stiffness(self, omega: float, amplitude: float) -> complex:
        """Return ``i omega (c_e + c_c) / 2`` [N/m]."""
        return complex(0.0, 0.5 * omega * (self.extension + self.compression))

    def mean_force(self, omega: float, amplitude: float) -> float:
        """Return the mean force over a steady cycle [N], ``(c_e - c_c) omega A / pi``."""
        return (self.extension - self.compression) * omega * amplitude / math.pi
