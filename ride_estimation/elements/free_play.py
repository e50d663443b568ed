# Copyright 2026 ride_estimation contributors
"""Free play (backlash): a spring and damper that act only past a gap on either side."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import ClassVar, final

from ride_estimation.elements.base import ForceElement, parameter
from ride_estimation.elements.bump_stop import BumpStop
from ride_estimation.elements.composite import CompositeElement


@final
@dataclasses.dataclass(frozen=True)
class FreePlay(CompositeElement):
    """Spring and damper behind free play of ``+-gap``; between the gaps there is no force.

    It is a two-sided :class:`BumpStop` with equal gaps.
    """

    KIND: ClassVar[str] = "free_play"

    gap: float = parameter(
        "m", key="gap_m", lower=0.0, upper=1.0, meaning="free play to either side of rest", source="004 free travel"
    )
    stiffness: float = parameter(
        "N/m", key="stiffness_n_per_m", lower=0.0, upper=1e10, meaning="spring rate past the gap", role="stiffness",
        source="004 free travel",
    )
    damping: float = parameter(
        "N s/m", key="damping_n_s_per_m", lower=0.0, upper=1e8, default=0.0, meaning="damping past the gap", role="damping",
        source="this project",
    )
    entry: float = parameter(
        "m", key="entry_m", lower=0.0, upper=1.0, default=0.0, meaning="half width p of the smooth entry around the gap",
        source="004 smoothing",
    )

    def _bound_problems(self) -> Iterator[str]:
        yield from super()._bound_problems()
        if self.entry > self.gap:
            yield f"entry_m: {self.entry:g} m is more than the gap of {self.gap:g} m; both sides would push at rest"

    def parts(self) -> tuple[ForceElement, ...]:
        """Return the two-sided stop."""
        return (
            BumpStop(
                compression_gap=self.gap, extension_gap=self.gap, stiffness=self.stiffness, damping=self.damping,
                entry=self.entry,
            ),
        )

    @classmethod
    def example(cls) -> FreePlay:
        """Return a worn joint."""
        return cls(gap=0.5e-3, stiffness=5e6)
