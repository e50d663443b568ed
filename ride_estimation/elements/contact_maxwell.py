# Copyright 2026 ride_estimation contributors
"""A Maxwell cell that engages at a contact point, pushes only and forgets when unloaded."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, final

import numpy as np

from ride_estimation.elements.base import Array, ForceElement, parameter
from ride_estimation.elements.kernels_static import engagement, penetration
from ride_estimation.elements.terms import CONTACT_MAXWELL, Term


@final
@dataclasses.dataclass(frozen=True)
class ContactMaxwell(ForceElement):
    """Maxwell cell behind free travel, ``m' = -Omega m + k du/dt``, ``F = -max(m, 0)``; m = 0 out of contact.

    u is the smoothed penetration past the contact point in compression, ``(e + p)^2 / (4 p)`` for ``|e| < p``,
    ``e = -x - contact point``; document 004 asks for a third-order polynomial there, whose cubic coefficient is identically
    zero.

    Source: document 004 eq. (7), (8), reset after each load event.
    """

    KIND: ClassVar[str] = "contact_maxwell"

    stiffness: float = parameter(
        "N/m", key="stiffness_n_per_m", lower=0.0, upper=1e10, meaning="spring rate k", role="stiffness", source="004 (7)"
    )
    corner: float = parameter(
        "rad/s", key="corner_rad_per_s", lower=0.0, upper=1e6, meaning="corner frequency Omega = k / c", source="004 (8)"
    )
    contact_point: float = parameter(
        "m", key="contact_point_m", lower=-1.0, upper=10.0, meaning="compression at which the cell engages", source="004 (9)"
    )
    entry: float = parameter(
        "m", key="entry_m", lower=0.0, upper=1.0, default=0.0, meaning="half width p of the smooth entry",
        source="004 smoothing",
    )

    def initial(self) -> Array:
        """Return the memory at rest: no force."""
        return np.zeros(1)

    def rate(self, s: Array, x: float, v: float) -> Array:
        """Return ``-Omega m + k du/dt`` [N/s] in contact, 0 out of it."""
        if penetration(x, -1.0, self.contact_point, self.entry) <= 0.0:
            return np.zeros(1)
        u_rate = -engagement(x, -1.0, self.contact_point, self.entry) * v
        return np.array([-self.corner * s[0] + self.stiffness * u_rate])

    def force(self, s: Array, x: float, v: float) -> float:
        """Return ``-max(m, 0)`` [N] in contact, 0 out of it."""
        if penetration(x, -1.0, self.contact_point, self.entry) <= 0.0:
            return 0.0
        return -max(float(s[0]), 0.0)

    def commit(self, s: Array, x: float, v: float) -> Array:
        """Return the memory, zero out of contact."""
        return np.zeros(1) if penetration(x, -1.0, self.contact_point, self.entry) <= 0.0 else s

    def fastest_rate(self, peak_speed: float) -> float:
        """Return Omega [1/s] (document 004, stability regions)."""
        return self.corner

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(CONTACT_MAXWELL, (-1.0, self.contact_point, self.entry, self.stiffness, self.corner)),)

    @classmethod
    def example(cls) -> ContactMaxwell:
        """Return a cell of a jounce bumper that engages after 18 mm."""
        return cls(stiffness=9e3, corner=30.0, contact_point=0.018, entry=0.003)
