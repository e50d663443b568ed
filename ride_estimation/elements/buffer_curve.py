# Copyright 2026 ride_estimation contributors
"""Static curve of a buffer."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import ClassVar, final

from ride_estimation.elements import declarations
from ride_estimation.elements.base import Array, ForceElement, series
from ride_estimation.elements.curve import curve_columns, curve_problems, evaluate_curve
from ride_estimation.elements.terms import CURVE_SPRING, Term


@final
@dataclasses.dataclass(frozen=True)
class BufferCurve(ForceElement):
    """Static curve of a buffer loaded in compression, ``F = -f(-x - clearance)``; no force out of contact.

    Source: document 004, nonlinear force-displacement characteristic.
    """

    KIND: ClassVar[str] = "buffer_curve"

    travels: tuple[float, ...] = series(
        "m", key="travels_m", lower=0.0, upper=10.0, meaning="travels of the points, increasing from 0", source="004 (6)"
    )
    forces: tuple[float, ...] = series(
        "N", key="forces_n", lower=0.0, upper=1e8, meaning="static push at the points, 0 at the first", role="stiffness",
        source="004 (6)",
    )
    clearance: float = declarations.clearance()

    def _bound_problems(self) -> Iterator[str]:
        yield from super()._bound_problems()
        yield from curve_problems("travels_m", self.travels, "forces_n", self.forces)
        if self.forces and self.forces[0] != 0.0:
            yield f"forces_n[0]: {self.forces[0]:g} N; the push starts from 0 N at the first travel"

    def _columns(self) -> tuple[float, ...]:
        return curve_columns(self.travels, self.forces, flat_ends=(True, False))

    def force(self, s: Array, x: float, v: float) -> float:
        """Return the force on the curve [N]."""
        return -evaluate_curve(self._columns(), -x - self.clearance)

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(CURVE_SPRING, (-1.0, self.clearance, float(len(self.travels)), *self._columns())),)

    @classmethod
    def example(cls) -> BufferCurve:
        """Return a jounce bumper of 70 mm travel and 9 kN."""
        return cls(
            travels=(0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07),
            forces=(0.0, 120.0, 300.0, 560.0, 1000.0, 1900.0, 4000.0, 9000.0),
        )
