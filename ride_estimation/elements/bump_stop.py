# Copyright 2026 ride_estimation contributors
"""Bump stops and free play: force only past a gap, entered smoothly."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import ClassVar, final

from ride_estimation.elements.base import Array, ForceElement, parameter
from ride_estimation.elements.kernels_static import contact_force
from ride_estimation.elements.terms import CONTACT, Term


def gap_harmonic(ratio: float) -> float:
    """Return the first harmonic of a spring behind a gap on both sides over that of the spring, ``ratio = gap / A``."""
    if ratio >= 1.0:
        return 0.0
    return 1.0 - 2.0 / math.pi * (math.asin(ratio) + ratio * math.sqrt(1.0 - ratio**2))


@final
@dataclasses.dataclass(frozen=True)
class BumpStop(ForceElement):
    """One- or two-sided stop, ``F = side max(k u + k_3 u^3 + c u' v, 0)`` per side; it pushes, never pulls.

    u is the penetration past the gap, quadratic inside ``gap +- entry`` and C1 (document 004; the cubic coefficient of its
    third-order polynomial is identically zero). A gap of 10 m means there is no stop on that side.
    """

    KIND: ClassVar[str] = "bump_stop"

    compression_gap: float = parameter(
        "m", key="compression_gap_m", lower=0.0, upper=10.0, meaning="free travel in compression; 10 m: no stop",
        source="004 free travel",
    )
    stiffness: float = parameter(
        "N/m", key="stiffness_n_per_m", lower=0.0, upper=1e10, meaning="rate of the stop k", role="stiffness",
        source="004 free travel",
    )
    extension_gap: float = parameter(
        "m", key="extension_gap_m", lower=0.0, upper=10.0, default=10.0,
        meaning="free travel in extension; 10 m: no stop", source="004 free travel",
    )
    cubic: float = parameter(
        "N/m^3", key="cubic_n_per_m3", lower=0.0, upper=1e18, default=0.0, meaning="cubic rate of the stop k_3",
        role="stiffness", source="this project",
    )
    damping: float = parameter(
        "N s/m", key="damping_n_s_per_m", lower=0.0, upper=1e8, default=0.0, meaning="damping while in contact c",
        role="damping", source="this project",
    )
    entry: float = parameter(
        "m", key="entry_m", lower=0.0, upper=1.0, default=0.0,
        meaning="half width p of the smooth entry around the gap", source="004 free travel",
    )

    def _bound_problems(self) -> Iterator[str]:
        yield from super()._bound_problems()
        if self.entry > min(self.compression_gap, self.extension_gap):
            yield (
                f"entry_m: {self.entry:g} m is more than the gap of {min(self.compression_gap, self.extension_gap):g} m; "
                "the stop would push at rest"
            )

    def force(self, s: Array, x: float, v: float) -> float:
        """Return the force of both sides [N]."""
        total = 0.0
        for _, p in self.terms():
            total += contact_force(x, v, *p)
        return total

    def terms(self) -> tuple[Term, ...]:
        """Return one primitive per side that has a stop."""
        rest = (self.entry, self.stiffness, self.cubic, self.damping)
        sides = ((-1.0, self.compression_gap), (1.0, self.extension_gap))
        return tuple(Term(CONTACT, (side, gap, *rest)) for side, gap in sides)

    def dynamic_stiffness(self, omega: float, amplitude: float) -> complex | None:
        """Return the first harmonic [N/m] of the two gaps; None with smooth entry, cubic rate or damping."""
        if self.entry > 0.0 or self.cubic > 0.0 or self.damping > 0.0 or amplitude == 0.0:
            return None
        shares = (gap_harmonic(gap / amplitude) for gap in (self.compression_gap, self.extension_gap))
        return complex(0.5 * self.stiffness * sum(shares))

    @classmethod
    def example(cls) -> BumpStop:
        """Return the stop of a cab mount with 12 mm of free travel in compression."""
        return cls(compression_gap=0.012, stiffness=4e5, damping=800.0, entry=0.002)
