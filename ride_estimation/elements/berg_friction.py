# Copyright 2026 ride_estimation contributors
"""Berg's smooth friction of filled rubber."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar, final

import numpy as np

from ride_estimation.elements import declarations, kernels_memory
from ride_estimation.elements.base import Array, ForceElement
from ride_estimation.elements.terms import BERG_FRICTION, STATE_SIZE, Term


@final
@dataclasses.dataclass(frozen=True)
class BergFriction(ForceElement):
    """Berg friction with one turning point ``(x_s, F_s)`` as memory.

    ``F = F_s + s d / (x_2 (1 - a) + d) f_max (1 - a)``, ``d = |x - x_s|``, ``s = sign(x - x_s)``, ``a = s F_s / f_max``.
    The slope right after every reversal is ``f_max / x_2`` and the asymptote is ``+-f_max``. At a reversal the turning point
    becomes the extreme just passed; a way back shorter than the dead band is not yet a reversal.

    Source: document 003 eq. (9)-(12); the update at reversals is only implied there.
    """

    KIND: ClassVar[str] = "berg_friction"

    friction: float = declarations.friction_limit()
    half_stroke: float = declarations.half_stroke()
    dead_band: float = declarations.dead_band()

    def initial(self) -> Array:
        """Return the memory at rest at x = 0, laid out as in :mod:`ride_estimation.elements.terms`."""
        return np.zeros(STATE_SIZE)

    def force(self, s: Array, x: float, v: float) -> float:
        """Return the friction force [N] at x, on the running branch or on the one that starts at the extreme."""
        return kernels_memory.berg_trial(s.reshape(1, -1), 0, x, self.friction, self.half_stroke)

    def commit(self, s: Array, x: float, v: float) -> Array:
        """Return the memory after the accepted point x."""
        s = s.copy()
        kernels_memory.berg_commit(s.reshape(1, -1), 0, x, v, self.friction, self.half_stroke, self.dead_band)
        return s

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(BERG_FRICTION, (self.friction, self.half_stroke, self.dead_band)),)

    @classmethod
    def example(cls) -> BergFriction:
        """Return the friction of the bushings of document 003, Table 1."""
        return cls(friction=60.0, half_stroke=0.25e-3)

    def turning_ratio(self, amplitude: float) -> float:
        """Return ``alpha(A)``, the force at the turning points of a steady cycle over f_max.

        ``alpha = (sqrt(x_2^2 + A^2 + 6 x_2 A) - x_2 - A) / (2 x_2)``, written without cancellation; document 003 (12)
        prints the root over the whole numerator.
        """
        x2 = self.half_stroke
        return 2.0 * amplitude / (math.sqrt(x2**2 + amplitude**2 + 6.0 * x2 * amplitude) + x2 + amplitude)

    def dynamic_stiffness(self, omega: float, amplitude: float) -> complex:
        """Return the first-harmonic friction stiffness ``K'_fr + i W_fr / (pi A^2)`` [N/m], exact.

        With ``D = x_2 (1 + alpha)``: ``K'_fr = (2 f (1 + alpha) D / A^2) ((D + A) / sqrt(D^2 + 2 A D) - 1)``.
        """
        if amplitude == 0.0:
            return complex(self.friction / self.half_stroke)
        a1 = 1.0 + self.turning_ratio(amplitude)
        d = self.half_stroke * a1
        q = amplitude / d
        root = math.sqrt(1.0 + 2.0 * q)
        # (1 + q) / root - 1 = q^2 / (root (1 + q + root)), without cancellation for small strokes
        storage = 2.0 * self.friction * a1 / d / (root * (1.0 + q + root))
        return complex(storage, self.loss_energy(omega, amplitude) / (math.pi * amplitude**2))

    def loss_energy(self, omega: float, amplitude: float) -> float:
        """Return ``W_fr = 2 f (2 A - x_2 (1 + alpha)^2 ln(1 + 2 A / D))`` [J] per cycle (document 003 eq. (11)).

        With ``q = 2 A / D`` and ``1 + alpha = 2 (1 + q) / (2 + q)`` it is ``2 f D (q (2 + q) - 2 (1 + q) ln(1 + q)) / (2 + q)``;
        for small q the bracket is ``-2 sum_{k >= 3} (-q)^k / (k (k - 1))``, which does not cancel.
        """
        d = self.half_stroke * (1.0 + self.turning_ratio(amplitude))
        q = 2.0 * amplitude / d
        if q < 0.05:
            bracket = -2.0 * sum((-q) ** k / (k * (k - 1)) for k in range(3, 16))
        else:
            bracket = q * (2.0 + q) - 2.0 * (1.0 + q) * math.log1p(q)
        return 2.0 * self.friction * d * bracket / (2.0 + q)
