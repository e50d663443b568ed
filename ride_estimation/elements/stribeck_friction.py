# Copyright 2026 ride_estimation contributors
"""Smooth Coulomb friction with a Stribeck peak."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import ClassVar, final

from ride_estimation.elements.base import Array, ForceElement, parameter
from ride_estimation.elements.kernels_static import stribeck_force
from ride_estimation.elements.terms import STRIBECK, Term


@final
@dataclasses.dataclass(frozen=True)
class StribeckFriction(ForceElement):
    """Rate-dependent dry friction without memory, ``F = (f_k + (f_s - f_k) exp(-(v/v_s)^2)) tanh(v / v_0)``.

    It does not stick: below v_0 it is a viscous damper. Where sticking matters use Dahl or Berg friction.
    """

    KIND: ClassVar[str] = "stribeck_friction"

    friction: float = parameter(
        "N", key="friction_n", lower=0.0, upper=1e6, meaning="kinetic friction force f_k", role="friction",
        source="Stribeck 1902",
    )
    breakaway: float = parameter(
        "N", key="breakaway_n", lower=0.0, upper=1e6, meaning="static friction force f_s", role="friction",
        source="Stribeck 1902",
    )
    stribeck_speed: float = parameter(
        "m/s", key="stribeck_speed_m_per_s", lower=1e-6, upper=10.0, default=0.01, meaning="rate v_s at which the peak has gone",
        source="Stribeck 1902",
    )
    rounding: float = parameter(
        "m/s", key="rounding_m_per_s", lower=1e-6, upper=10.0, default=0.001, meaning="rate v_0 over which the sign is rounded",
        source="this project",
    )

    def _bound_problems(self) -> Iterator[str]:
        yield from super()._bound_problems()
        if self.breakaway < self.friction:
            yield f"breakaway_n: {self.breakaway:g} N is less than the kinetic friction of {self.friction:g} N"

    def force(self, s: Array, x: float, v: float) -> float:
        """Return the friction force [N]."""
        return stribeck_force(v, self.friction, self.breakaway, self.stribeck_speed, self.rounding)

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(STRIBECK, (self.friction, self.breakaway, self.stribeck_speed, self.rounding)),)

    @classmethod
    def example(cls) -> StribeckFriction:
        """Return the dry friction of a guide."""
        return cls(friction=80.0, breakaway=120.0)
