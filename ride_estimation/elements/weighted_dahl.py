# Copyright 2026 ride_estimation contributors
"""Dahl friction whose height and stiffness follow the travel: the hysteresis of a jounce bumper."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import ClassVar, final

import numpy as np

from ride_estimation.elements import declarations
from ride_estimation.elements.base import Array, ForceElement, series
from ride_estimation.elements.curve import curve_columns, curve_problems, evaluate_curve
from ride_estimation.elements.terms import WEIGHTED_DAHL, Term


@final
@dataclasses.dataclass(frozen=True)
class WeightedDahl(ForceElement):
    """Displacement-weighted Dahl friction of a buffer that is loaded in compression.

    With the travel ``u = -x - clearance`` into the buffer, the height w(u) of the hysteresis [N] and ``w_ref = w(u_ref)``:
    ``dF~ = sigma(u) (1 - s F~ / (w_ref / 2)) du``, ``sigma = s_min + (w / w_ref)^n (s_max - s_min)``, ``F = -F~ w / w_ref``.
    The force saturates at ``+-w(u) / 2``; the loop is w(u) high.

    Source: document 004 eq. (3)-(5), restored: the transcript lost the minus sign and the fractions.
    """

    KIND: ClassVar[str] = "weighted_dahl"

    travels: tuple[float, ...] = series(
        "m", key="travels_m", lower=0.0, upper=10.0, meaning="travels of the points, increasing from 0", source="004 (3)"
    )
    heights: tuple[float, ...] = declarations.hysteresis_heights()
    reference_travel: float = declarations.reference_travel()
    lowest_slope: float = declarations.dahl_slope_at_rest()
    highest_slope: float = declarations.dahl_slope_at_reference()
    exponent: float = declarations.distortion()
    clearance: float = declarations.clearance()
    dead_band: float = declarations.dead_band()

    def _bound_problems(self) -> Iterator[str]:
        yield from super()._bound_problems()
        faults = list(curve_problems("travels_m", self.travels, "heights_n", self.heights))
        yield from faults
        if not faults and self.reference_height <= 0.0:
            yield f"heights_n: the height at the reference travel of {self.reference_travel:g} m is not positive"
        if self.lowest_slope > self.highest_slope:
            yield f"lowest_slope_n_per_m: {self.lowest_slope:g} N/m exceeds highest_slope_n_per_m, {self.highest_slope:g} N/m"

    def _columns(self) -> tuple[float, ...]:
        return curve_columns(self.travels, self.heights, flat_ends=(True, True))

    @property
    def reference_height(self) -> float:
        """Return ``w_ref`` [N]."""
        return self.height(self.reference_travel)

    def height(self, travel: float) -> float:
        """Return the height w(u) of the hysteresis [N]; constant beyond the last point."""
        return max(evaluate_curve(self._columns(), travel), 0.0)

    def slope(self, travel: float) -> float:
        """Return the Dahl stiffness sigma(u) [N/m] (document 004 (3))."""
        share = math.pow(self.height(travel) / self.reference_height, self.exponent)
        return self.lowest_slope + share * (self.highest_slope - self.lowest_slope)

    def initial(self) -> Array:
        """Return the memory at rest: ``F~ = 0``."""
        return np.zeros(1)

    def rate(self, s: Array, x: float, v: float) -> Array:
        """Return the rate of F~ [N/s] (document 004 (4))."""
        room = 1.0 - math.copysign(1.0, -v) * float(s[0]) / (0.5 * self.reference_height)
        return np.array([-self.slope(-x - self.clearance) * room * v])

    def force(self, s: Array, x: float, v: float) -> float:
        """Return ``-F~ w(u) / w_ref`` [N] (document 004 (5); tension positive here)."""
        return -float(s[0]) * self.height(-x - self.clearance) / self.reference_height

    def fastest_rate(self, peak_speed: float) -> float:
        """Return ``s_max |v| / (w_ref / 2)`` [1/s], the steepest place of the travel."""
        return max(self.slope(u) for u in self.travels) * abs(peak_speed) / (0.5 * self.reference_height)

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        head = (
            -1.0, self.clearance, self.reference_height, self.lowest_slope, self.highest_slope, self.exponent,
            self.dead_band, float(len(self.travels)),
        )
        return (Term(WEIGHTED_DAHL, (*head, *self._columns())),)

    @classmethod
    def example(cls) -> WeightedDahl:
        """Return the hysteresis of a jounce bumper of 70 mm travel."""
        return cls(
            travels=(0.0, 0.02, 0.04, 0.055, 0.07), heights=(0.0, 150.0, 500.0, 1000.0, 1800.0), reference_travel=0.07,
            lowest_slope=30e3, highest_slope=500e3, exponent=0.8,
        )
