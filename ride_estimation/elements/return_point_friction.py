# Copyright 2026 ride_estimation contributors
"""Smooth friction that remembers nested loops: Masing rules with return points."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar, final

import numpy as np

from ride_estimation.elements import declarations, kernels_hysteresis
from ride_estimation.elements.base import Array, ForceElement
from ride_estimation.elements.terms import RETURN_POINT, Term


@final
@dataclasses.dataclass(frozen=True)
class ReturnPointFriction(ForceElement):
    """Friction with Berg's first loading and return-point memory.

    First loading ``g(u) = f_max u / (x_2 + |u|)``; after a turning point ``F = F_s + 2 g((x - x_s) / 2)`` (Masing). A loop that
    comes back to where it began is closed and forgotten, and the motion goes on along the branch it had left. Twenty small
    loops inside a large one therefore leave it where it was, while :class:`~ride_estimation.elements.berg_friction.
    BergFriction`, which remembers one turning point, creeps by 31 % of f_max. Which of both a rubber does is a question to a
    record of small loops on a large stroke.

    A way back shorter than the dead band makes no turning point. Noise of a measured deflection costs no more than its
    own slope here, with or without dead band, because the loops it makes close again. Up to 32 nested turning points are kept;
    beyond that the loop whose forces differ least from its neighbours' is forgotten.

    Source: Masing 1926; Berg's backbone document 003 eq. (9).
    """

    KIND: ClassVar[str] = "return_point_friction"

    friction: float = declarations.friction_limit()
    half_stroke: float = declarations.half_stroke()
    dead_band: float = declarations.dead_band()

    def initial(self) -> Array:
        """Return the memory at rest at x = 0, laid out as in :mod:`ride_estimation.elements.kernels_hysteresis`."""
        return np.zeros(kernels_hysteresis.RETURN_POINT_STATE)

    def force(self, s: Array, x: float, v: float) -> float:
        """Return the friction force [N] at x."""
        return kernels_hysteresis.return_point_trial(s.reshape(1, -1), 0, x, self.friction, self.half_stroke)

    def commit(self, s: Array, x: float, v: float) -> Array:
        """Return the memory after the accepted point x."""
        s = s.copy()
        kernels_hysteresis.return_point_commit(s.reshape(1, -1), 0, x, v, self.friction, self.half_stroke, self.dead_band)
        return s

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(RETURN_POINT, (self.friction, self.half_stroke, self.dead_band)),)

    @classmethod
    def example(cls) -> ReturnPointFriction:
        """Return the friction of the bushings of document 003, Table 1, with return points."""
        return cls(friction=60.0, half_stroke=0.25e-3)

    def dynamic_stiffness(self, omega: float, amplitude: float) -> complex:
        """Return ``K' + i W / (pi A^2)`` [N/m], ``K' = (8 f x_2 / A^2) ((2 x_2 + A) / (2 sqrt(x_2 (x_2 + A))) - 1)``, exact."""
        if amplitude == 0.0:
            return complex(self.friction / self.half_stroke)
        q = amplitude / self.half_stroke
        root = math.sqrt(1.0 + q)
        # (1 + q/2) / root - 1 = q^2 / (4 root (1 + q/2 + root)), without cancellation for small strokes
        storage = 2.0 * self.friction / self.half_stroke / (root * (1.0 + 0.5 * q + root))
        return complex(storage, self.loss_energy(omega, amplitude) / (math.pi * amplitude**2))

    def loss_energy(self, omega: float, amplitude: float) -> float:
        """Return ``W = 8 (integral_0^A g du - A g(A) / 2)`` [J] per cycle.

        With ``q = A / x_2`` it is ``8 f x_2 (q (2 + q) / (2 (1 + q)) - ln(1 + q))``; for small q the bracket is
        ``sum_{k >= 3} (-q)^k (1/k - 1/2)``, which does not cancel.
        """
        q = amplitude / self.half_stroke
        if q < 0.05:
            bracket = sum((-q) ** k * (1.0 / k - 0.5) for k in range(3, 16))
        else:
            bracket = q * (2.0 + q) / (2.0 * (1.0 + q)) - math.log1p(q)
        return 8.0 * self.friction * self.half_stroke * bracket
