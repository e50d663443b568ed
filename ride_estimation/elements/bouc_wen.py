# Copyright 2026 ride_estimation contributors
"""Bouc-Wen hysteresis."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import ClassVar, final

import numpy as np
import scipy

from ride_estimation.elements import declarations
from ride_estimation.elements.base import Array, ForceElement, parameter
from ride_estimation.elements.terms import BOUC_WEN, Term


@final
@dataclasses.dataclass(frozen=True)
class BoucWen(ForceElement):
    """Bouc-Wen hysteresis, ``dF/dt = k (1 - |F / f|^n (b sign(F v) + 1 - b)) v``; the memory is its force.

    In the usual letters ``z' = A x' - beta |x'| |z|^(n-1) z - gamma x' |z|^n`` it is ``k = A``, ``f^n = A / (beta + gamma)``,
    ``b = beta / (beta + gamma)``. The bounds are those of a law that is stable and never yields energy: ``b >= 1/2`` is
    ``-beta <= gamma <= beta``, and then |F| <= f. b = 1/2 unloads along the initial slope, b = 1 (gamma = 0) with n = 1 is
    Dahl friction. A spring in parallel is another element of the sum.

    Like every law without return points it creeps where small loops ride on a large stroke.

    Source: Wen 1976; Ikhouane and Rodellar 2007 (bounds); document 001, chapter 2 (models of the literature).
    """

    KIND: ClassVar[str] = "bouc_wen"

    friction: float = parameter(
        "N", key="friction_n", lower=0.0, upper=1e6, meaning="largest force f", role="friction", source="Wen 1976"
    )
    slope: float = parameter(
        "N/m", key="slope_n_per_m", lower=0.0, upper=1e12, meaning="stiffness k at rest", role="friction", source="Wen 1976"
    )
    exponent: float = parameter(
        "1", key="exponent", lower=1.0, upper=20.0, default=2.0,
        meaning="sharpness n of the transition to sliding; large: spring and dry slider", source="Wen 1976",
    )
    share: float = parameter(
        "1", key="share", lower=0.5, upper=5.0, default=0.5,
        meaning="share b = beta / (beta + gamma) of the unloading; 0.5: unloads along the initial slope", source="Wen 1976",
    )
    dead_band: float = declarations.dead_band()

    def initial(self) -> Array:
        """Return the memory at rest: no force."""
        return np.zeros(1)

    def rate(self, s: Array, x: float, v: float) -> Array:
        """Return ``k (1 - |F / f|^n (b sign(F v) + 1 - b)) v`` [N/s]."""
        if self.friction == 0.0:
            return np.zeros(1)
        ratio = min(abs(float(s[0])) / self.friction, 1.0)
        same = 1.0 if float(s[0]) * v >= 0.0 else -1.0
        return np.array([self.slope * (1.0 - math.pow(ratio, self.exponent) * (self.share * same + 1.0 - self.share)) * v])

    def force(self, s: Array, x: float, v: float) -> float:
        """Return F [N]."""
        return float(s[0])

    def fastest_rate(self, peak_speed: float) -> float:
        """Return ``n k v / f`` times ``2 b - 1`` where that exceeds 1 [1/s]."""
        if self.friction == 0.0:
            return 0.0
        return self.exponent * max(1.0, 2.0 * self.share - 1.0) * self.slope * abs(peak_speed) / self.friction

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(BOUC_WEN, (self.friction, self.slope, self.exponent, self.share, self.dead_band)),)

    @classmethod
    def example(cls) -> BoucWen:
        """Return the hysteresis of a suspension seat."""
        return cls(friction=80.0, slope=40e3)

    def _over_room(self, numerator: Callable[[float], float], end: float) -> float:
        """Return ``integral_0^w numerator(w) / (1 - w^n) dw`` to ``w = 1 - exp(-end)``."""
        n = self.exponent

        def inside(y: float) -> float:
            # in y = -ln(1 - w): dw = e^-y dy, and 1 - w^n without cancellation near w = 1
            left, w = math.exp(-y), -math.expm1(-y)
            if w == 0.0:
                return numerator(w)
            return numerator(w) * left / -math.expm1(n * (math.log1p(-left) if left < 0.5 else math.log(w)))

        # beyond y = 32 it is numerator(1) / n to rounding
        inner = min(end, 32.0)
        value = scipy.integrate.quad(inside, 0.0, inner, epsabs=0.0, epsrel=1e-12, limit=200)[0]
        return float(value) + (end - inner) * numerator(1.0) / n

    def loss_energy(self, omega: float, amplitude: float) -> float:
        """Return the energy lost in a steady cycle [J], by quadrature to 1e-10.

        A stroke of a steady cycle runs from ``w = -w_m`` to ``w_m``, w the force over f in the direction of motion and
        ``c = 2 b - 1``: ``2 A k / f = integral_0^w_m (1 / (1 + c w^n) + 1 / (1 - w^n)) dw`` gives w_m, and
        ``W = (2 f^2 / k) integral_0^w_m 2 b w^(n+1) / ((1 - w^n) (1 + c w^n)) dw``.
        """
        if self.friction == 0.0 or self.slope == 0.0 or amplitude == 0.0:
            return 0.0
        n, back = self.exponent, 2.0 * self.share - 1.0
        stroke = 2.0 * amplitude * self.slope / self.friction

        def excess(end: float) -> float:
            return self._over_room(lambda w: (2.0 + (back - 1.0) * w**n) / (1.0 + back * w**n), end) - stroke

        # the integral is at least end / n
        end = float(scipy.optimize.brentq(excess, 0.0, n * stroke, xtol=1e-15, rtol=1e-13))
        area = self._over_room(lambda w: 2.0 * self.share * w ** (n + 1.0) / (1.0 + back * w**n), end)
        return 2.0 * self.friction**2 / self.slope * area
