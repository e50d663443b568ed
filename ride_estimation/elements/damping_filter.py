# Copyright 2026 ride_estimation contributors
"""Frequency-dependent damping as a second-order filter of the relative rate, with its passivity."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar, NamedTuple, final

import numpy as np

from ride_estimation.elements.base import Array, ForceElement, choice, parameter
from ride_estimation.elements.terms import ELASTIC, MAXWELL, RATE_FILTER, Term

LOW, BAND, HIGH, PASSIVE_LOW, PASSIVE_HIGH = "low", "band", "high", "passive_low", "passive_high"


class Passivity(NamedTuple):
    """Whether a damper can yield energy.

    Attributes
    ----------
    passive
        True where the damping is nowhere negative.
    lowest_damping
        Lowest real part of the transfer function [N s/m]; 0 or more for a passive filter.
    at_omega
        Angular frequency of it [rad/s]; ``inf`` where it is only approached.
    """

    passive: bool
    lowest_damping: float
    at_omega: float


@final
@dataclasses.dataclass(frozen=True)
class DampingFilter(ForceElement):
    """Damping filter ``F = TF(s) v`` of document 000, fed with the relative rate of the mount.

    ``low = K w0^2 / N``, ``band = K (w0 / Q) s / N``, ``high = K s^2 / N``, ``N = s^2 + (w0 / Q) s + w0^2``. Low and high are
    not passive: they drive the motion at some frequencies (:meth:`passivity`). Their passive replacements are
    ``passive_low = K w0 / (s + w0)`` (a Maxwell cell) and ``passive_high = K s / (s + w0)``, which ignore Q. Band is a spring
    ``K w0 / Q``, a damper K and an inerter ``K / (Q w0)`` in series; besides damping it stores energy.

    Source: document 000 eq. (12)-(14). K is in N s/m and w0 in rad/s; the units printed there (1/Hz) are wrong. It feeds the
    absolute rate of the attachment point, which makes a skyhook damper; here it is the relative rate.
    """

    KIND: ClassVar[str] = "damping_filter"

    gain: float = parameter(
        "N s/m", key="gain_n_s_per_m", lower=0.0, upper=1e8, meaning="gain K", role="damping", source="000 (12)-(14)"
    )
    centre: float = parameter(
        "rad/s", key="centre_rad_per_s", lower=1e-3, upper=1e5, meaning="centre frequency w0", source="000 (12)-(14)"
    )
    quality: float = parameter(
        "1", key="quality", lower=0.01, upper=1000.0, default=0.5, meaning="quality factor Q", source="000 (12)-(14)"
    )
    shape: str = choice(
        BAND, LOW, HIGH, PASSIVE_LOW, PASSIVE_HIGH, key="shape", meaning="which filter", default=BAND
    )

    def is_passive(self) -> bool:
        """Return whether the damping is nowhere negative."""
        return self.passivity().passive

    def transfer(self, omega: float) -> complex:
        """Return ``TF(i omega)`` [N s/m]."""
        s = 1j * omega
        w0 = self.centre
        if self.shape == PASSIVE_LOW:
            return self.gain * w0 / (s + w0)
        if self.shape == PASSIVE_HIGH:
            return self.gain * s / (s + w0)
        numerator = {LOW: w0**2 + 0j, BAND: w0 / self.quality * s, HIGH: s**2}[self.shape]
        return self.gain * numerator / (s**2 + w0 / self.quality * s + w0**2)

    def passivity(self) -> Passivity:
        """Return the lowest damping over all frequencies, in closed form.

        With ``r = omega / w0``: ``Re(low) = K (1 - r^2) / ((1 - r^2)^2 + r^2 / Q^2)`` is lowest at ``r^2 = 1 + 1 / Q`` with
        ``-K Q^2 / (1 + 2 Q)``; ``Re(high)`` is the same at ``1 / r``.
        """
        if self.shape == LOW and self.gain > 0.0:
            ratio = math.sqrt(1.0 + 1.0 / self.quality)
        elif self.shape == HIGH and self.gain > 0.0:
            ratio = 1.0 / math.sqrt(1.0 + 1.0 / self.quality)
        else:
            return Passivity(True, 0.0, math.inf if self.shape in (LOW, PASSIVE_LOW) else 0.0)
        return Passivity(False, -self.gain * self.quality**2 / (1.0 + 2.0 * self.quality), ratio * self.centre)

    def passive_replacement(self) -> DampingFilter:
        """Return the passive filter of the same gain and centre; the filter itself where it is passive."""
        replacement = {LOW: PASSIVE_LOW, HIGH: PASSIVE_HIGH}.get(self.shape, self.shape)
        return dataclasses.replace(self, shape=replacement)

    def _filter(self) -> tuple[float, float, float, float, float]:
        """Return a_1, a_0, c_1, c_0, d of ``(c_1 s + c_0) / (s^2 + a_1 s + a_0) + d``."""
        a1, a0 = self.centre / self.quality, self.centre**2
        if self.shape == LOW:
            return a1, a0, 0.0, self.gain * a0, 0.0
        if self.shape == BAND:
            return a1, a0, self.gain * a1, 0.0, 0.0
        return a1, a0, -self.gain * a1, -self.gain * a0, self.gain

    def terms(self) -> tuple[Term, ...]:
        """Return the primitives: a filter of the rate, or Maxwell cell and damper for the passive replacements."""
        if self.shape == PASSIVE_LOW:
            return (Term(MAXWELL, (self.gain * self.centre, self.centre)),)
        if self.shape == PASSIVE_HIGH:
            return (Term(ELASTIC, (0.0, 0.0, self.gain)), Term(MAXWELL, (-self.gain * self.centre, self.centre)))
        return (Term(RATE_FILTER, self._filter()),)

    def initial(self) -> Array:
        """Return the memory at rest: the state of the filter."""
        return np.zeros(1 if self.shape in (PASSIVE_LOW, PASSIVE_HIGH) else 2)

    def rate(self, s: Array, x: float, v: float) -> Array:
        """Return the rate of the filter state."""
        if s.size == 1:
            return np.array([self.gain * self.centre * v - self.centre * s[0]])
        a1, a0, *_ = self._filter()
        return np.array([s[1], v - a1 * s[1] - a0 * s[0]])

    def force(self, s: Array, x: float, v: float) -> float:
        """Return the damping force [N]."""
        if self.shape == PASSIVE_LOW:
            return float(s[0])
        if self.shape == PASSIVE_HIGH:
            return self.gain * v - float(s[0])
        _, _, c1, c0, d = self._filter()
        return float(c0 * s[0] + c1 * s[1] + d * v)

    def fastest_rate(self, peak_speed: float) -> float:
        """Return the magnitude of the fastest pole [1/s]."""
        if self.shape in (PASSIVE_LOW, PASSIVE_HIGH):
            return self.centre
        return float(np.max(np.abs(np.roots([1.0, self.centre / self.quality, self.centre**2]))))

    @classmethod
    def example(cls) -> DampingFilter:
        """Return the band filter of document 000, Table 5."""
        return cls(gain=270.0, centre=12.6, quality=0.5)

    def dynamic_stiffness(self, omega: float, amplitude: float) -> complex:
        """Return ``i omega TF(i omega)`` [N/m]."""
        return 1j * omega * self.transfer(omega)
