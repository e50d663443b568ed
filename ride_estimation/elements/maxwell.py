# Copyright 2026 ride_estimation contributors
"""One Maxwell cell: a spring and a damper in series."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, final

import numpy as np

from ride_estimation.elements.base import Array, ForceElement, parameter
from ride_estimation.elements.terms import MAXWELL, Term


@final
@dataclasses.dataclass(frozen=True)
class Maxwell(ForceElement):
    """Maxwell cell, ``m' = -(k / c) m + k v``; the memory is its force m.

    Source: document 003 eq. (8), (17), (18). Document 004 writes c for stiffness and d for damping; here k and c.
    """

    KIND: ClassVar[str] = "maxwell"

    stiffness: float = parameter(
        "N/m", key="stiffness_n_per_m", lower=0.0, upper=1e10, meaning="series spring rate k", role="stiffness",
        source="003 (8)",
    )
    damping: float = parameter(
        "N s/m", key="damping_n_s_per_m", lower=1e-9, upper=1e9, meaning="series damping c", role="damping",
        source="003 (8)",
    )

    @property
    def corner(self) -> float:
        """Return the corner frequency ``Omega = k / c`` [rad/s]."""
        return self.stiffness / self.damping

    def initial(self) -> Array:
        """Return the memory at rest: no force."""
        return np.zeros(1)

    def rate(self, s: Array, x: float, v: float) -> Array:
        """Return ``-(k / c) m + k v`` [N/s]."""
        return np.array([-self.corner * s[0] + self.stiffness * v])

    def force(self, s: Array, x: float, v: float) -> float:
        """Return m [N]."""
        return float(s[0])

    def fastest_rate(self, peak_speed: float) -> float:
        """Return ``k / c`` [1/s] (document 004, stability regions)."""
        return self.corner

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(MAXWELL, (self.stiffness, self.corner)),)

    @classmethod
    def example(cls) -> Maxwell:
        """Return the viscous part of the Berg bushing of document 003, Table 1."""
        return cls(stiffness=60e3, damping=2387.0)

    def dynamic_stiffness(self, omega: float, amplitude: float) -> complex:
        """Return ``k i omega / (Omega + i omega)`` [N/m]; document 003 (13), (19) print the storage part wrongly."""
        return self.stiffness * 1j * omega / complex(self.corner, omega)


def bilinear_response(x: Array, step_s: float, stiffness: float, corner: float) -> Array:
    """Return the force of a Maxwell cell by the bilinear transformation of ``k s / (s + Omega)``, the published discrete form.

    ``F_k = -a F_(k-1) + b (x_k - x_(k-1))``, ``a = (Omega T - 2) / (Omega T + 2)``, ``b = 2 k / (Omega T + 2)``. For comparison
    with documents and controllers that use it; the elements use the exact step.

    Parameters
    ----------
    x
        Deflection [m], shape (N,); at rest at the first sample.
    step_s
        T [s].
    stiffness, corner
        k [N/m], Omega [rad/s].

    Notes
    -----
    Source: document 004 eq. (10)-(14), restored: (14) has a minus before a, which the transcript lost.
    """
    from scipy.signal import lfilter  # takes a second to import, which a player of recordings need not wait for

    z = corner * step_s
    a, b = (z - 2.0) / (z + 2.0), 2.0 * stiffness / (z + 2.0)
    return np.asarray(lfilter([b, -b], [1.0, a], x - x[0]))
