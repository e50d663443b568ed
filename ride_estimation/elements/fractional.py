# Copyright 2026 ride_estimation contributors
"""A fractional element (spring-pot) over a stated band of frequencies, as Maxwell cells."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterator
from typing import ClassVar, final

import numpy as np

from ride_estimation.elements.base import Array, ForceElement, parameter
from ride_estimation.elements.composite import CompositeElement
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.maxwell import Maxwell
from ride_estimation.errors import ConfigurationError

#: Maxwell cells per decade; the sum is then within 2 exp(-2 pi^2 / ln 10) = 0.04 % of the integral it stands for
CELLS_PER_DECADE = 2
#: decades that the cells reach beyond the band on either side
MARGIN_DECADES = 1.5


@functools.lru_cache(maxsize=64)
def _unit_cells(order: float, decades: float) -> tuple[float, float, Array, Array]:
    """Return spring, damper, cell stiffnesses and corners that stand for ``(i omega)^order`` from 1 to 10^decades rad/s."""
    step = math.log(10.0) / CELLS_PER_DECADE
    count = math.ceil(CELLS_PER_DECADE * (decades + 2.0 * MARGIN_DECADES)) + 1
    first = 0.5 * (decades * math.log(10.0) - (count - 1) * step)
    corners = np.exp(first + step * np.arange(count))
    scale = math.sin(math.pi * order) / math.pi * step
    # the cells below the first and above the last are summed as geometric series: springs there, dampers here
    spring = scale * corners[0] ** order / math.expm1(order * step)
    damper = scale * corners[-1] ** (order - 1.0) / math.expm1((1.0 - order) * step)
    return float(spring), float(damper), scale * corners**order, corners


@final
@dataclasses.dataclass(frozen=True)
class Fractional(CompositeElement):
    """Fractional damping ``K*(omega) = k (i omega / omega_ref)^alpha`` between two frequencies.

    ``s^alpha = sin(pi alpha) / pi integral s / (s + Omega) Omega^(alpha - 1) dOmega``: a continuum of Maxwell cells. It is
    summed at two corners per decade from 1.5 decades below the band to 1.5 above; the slower cells are one spring, the faster
    ones one damper. All stiffnesses are positive, so the element is passive, and exact steps of the cells carry over. Inside
    the band it is within 0.1 % of the law (:meth:`band_error`); outside it ends as a spring and as a damper. The loss angle
    is ``alpha pi / 2`` at every frequency and amplitude. Sampled signals cannot follow cells much faster than their rate:
    take the high end no higher than the record or the simulation step shows.

    Source: document 001, chapter 2 (models of the literature); spectral representation of the power: Samko et al. 1993.
    """

    KIND: ClassVar[str] = "fractional"

    stiffness: float = parameter(
        "N/m", key="stiffness_n_per_m", lower=0.0, upper=1e10, meaning="dynamic stiffness k at the reference frequency",
        role="stiffness", source="001 ch. 2",
    )
    order: float = parameter(
        "1", key="order", lower=0.05, upper=0.95, meaning="order alpha of the derivative: near 0 a spring, near 1 a damper",
        source="001 ch. 2",
    )
    reference: float = parameter(
        "rad/s", key="reference_rad_per_s", lower=1e-3, upper=1e5, meaning="frequency of the stiffness", source="001 ch. 2"
    )
    lowest: float = parameter(
        "rad/s", key="lowest_rad_per_s", lower=1e-4, upper=1e5, default=0.1, meaning="low end of the band",
        source="this project",
    )
    highest: float = parameter(
        "rad/s", key="highest_rad_per_s", lower=1e-3, upper=1e6, default=300.0, meaning="high end of the band",
        source="this project",
    )

    def _bound_problems(self) -> Iterator[str]:
        problems = list(super()._bound_problems())
        yield from problems
        if problems:
            return
        if self.highest < 2.0 * self.lowest:
            yield f"highest_rad_per_s: {self.highest:g} rad/s is not at least twice lowest_rad_per_s, {self.lowest:g} rad/s"
            return
        try:
            self.parts()
        except ConfigurationError as error:
            yield f"stiffness_n_per_m: {self.stiffness:g} N/m at reference and band given asks for impossible cells ({error})"

    def parts(self) -> tuple[ForceElement, ...]:
        """Return the spring with damper and the cells."""
        spring, damper, stiffnesses, corners = _unit_cells(self.order, math.log10(self.highest / self.lowest))
        scale = self.stiffness * (self.lowest / self.reference) ** self.order
        cells = (
            Maxwell(float(scale * k), max(float(scale * k / (corner * self.lowest)), 1e-9))
            for k, corner in zip(stiffnesses, corners, strict=True)
        )
        return (KelvinVoigt(scale * spring, scale * damper / self.lowest), *cells)

    def law(self, omega: float) -> complex:
        """Return the law itself, ``k (i omega / omega_ref)^alpha`` [N/m]."""
        return complex(self.stiffness * (1j * omega / self.reference) ** self.order)

    def band_error(self) -> float:
        """Return the largest relative distance of :meth:`dynamic_stiffness` from :meth:`law` inside the band."""
        if self.stiffness == 0.0:
            return 0.0
        worst = 0.0
        for omega in np.geomspace(self.lowest, self.highest, 200).tolist():
            value = self.dynamic_stiffness(omega, 1.0)
            if value is not None:
                worst = max(worst, abs(value / self.law(omega) - 1.0))
        return worst

    @classmethod
    def example(cls) -> Fractional:
        """Return a rubber whose loss angle is 18 degrees from 0.016 to 10 Hz."""
        return cls(stiffness=150e3, order=0.2, reference=2.0 * math.pi, lowest=0.1, highest=63.0)
