# Copyright 2026 ride_estimation contributors
"""The white-box jounce bumper: static curve, weighted Dahl friction, Maxwell cells with contact points."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import ClassVar, final

from ride_estimation.elements import declarations
from ride_estimation.elements.base import ForceElement, parameter, series
from ride_estimation.elements.buffer_curve import BufferCurve
from ride_estimation.elements.composite import CompositeElement
from ride_estimation.elements.contact_maxwell import ContactMaxwell
from ride_estimation.elements.curve import curve_problems
from ride_estimation.elements.weighted_dahl import WeightedDahl


@final
@dataclasses.dataclass(frozen=True)
class JounceBumper(CompositeElement):
    """Jounce bumper, ``F = -(F_nl(u) + F_Dahl + sum_i m_i)`` with the travel ``u = -x - clearance``.

    Static curve and hysteresis height at common travels, weighted Dahl friction (document 004 (3)-(5)), Maxwell cells of
    stiffness k_i and corner Omega_i that engage at contact points, push only and forget when unloaded ((7), (8)).

    Source: document 004, white-box model.
    """

    KIND: ClassVar[str] = "jounce_bumper"

    travels: tuple[float, ...] = series(
        "m", key="travels_m", lower=0.0, upper=10.0, meaning="travels of the points, increasing from 0", source="004 (6)"
    )
    forces: tuple[float, ...] = series(
        "N", key="forces_n", lower=0.0, upper=1e8, meaning="static push F_nl at the points, 0 at the first", role="stiffness",
        source="004 (6)",
    )
    heights: tuple[float, ...] = declarations.hysteresis_heights()
    cell_stiffnesses: tuple[float, ...] = series(
        "N/m", key="cell_stiffnesses_n_per_m", lower=0.0, upper=1e10, meaning="spring rates of the Maxwell cells",
        role="stiffness", source="004 (7)",
    )
    cell_corners: tuple[float, ...] = series(
        "rad/s", key="cell_corners_rad_per_s", lower=0.0, upper=1e6, meaning="corner frequencies of the Maxwell cells",
        source="004 (8)",
    )
    contact_points: tuple[float, ...] = series(
        "m", key="contact_points_m", lower=0.0, upper=10.0, meaning="travels at which the Maxwell cells engage",
        source="004 (9)",
    )
    reference_travel: float = declarations.reference_travel()
    lowest_slope: float = declarations.dahl_slope_at_rest()
    highest_slope: float = declarations.dahl_slope_at_reference()
    exponent: float = declarations.distortion()
    entry: float = parameter(
        "m", key="entry_m", lower=0.0, upper=1.0, default=0.0,
        meaning="half width p of the smooth entry around the contact points", source="004 smoothing",
    )
    clearance: float = declarations.clearance()
    dead_band: float = declarations.dead_band()

    def _bound_problems(self) -> Iterator[str]:
        yield from super()._bound_problems()
        yield from curve_problems("travels_m", self.travels, "forces_n", self.forces)
        yield from curve_problems("travels_m", self.travels, "heights_n", self.heights)
        counts = {len(self.cell_stiffnesses), len(self.cell_corners), len(self.contact_points)}
        if len(counts) != 1:
            yield (
                f"cell_stiffnesses_n_per_m, cell_corners_rad_per_s and contact_points_m have {len(self.cell_stiffnesses)}, "
                f"{len(self.cell_corners)} and {len(self.contact_points)} entries; one of each per cell is needed"
            )

    def parts(self) -> tuple[ForceElement, ...]:
        """Return static curve, friction and the Maxwell cells."""
        friction = WeightedDahl(
            self.travels, self.heights, self.reference_travel, self.lowest_slope, self.highest_slope, self.exponent,
            self.clearance, self.dead_band,
        )
        cells = (
            ContactMaxwell(k, corner, self.clearance + point, self.entry)
            for k, corner, point in zip(self.cell_stiffnesses, self.cell_corners, self.contact_points, strict=True)
        )
        return (BufferCurve(self.travels, self.forces, self.clearance), friction, *cells)

    @classmethod
    def example(cls) -> JounceBumper:
        """Return a bumper of 70 mm travel, 9 kN and five cells, in the range of document 004."""
        return cls(
            travels=(0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07),
            forces=(0.0, 120.0, 300.0, 560.0, 1000.0, 1900.0, 4000.0, 9000.0),
            heights=(0.0, 60.0, 150.0, 280.0, 500.0, 800.0, 1200.0, 1800.0),
            cell_stiffnesses=(5e3, 9e3, 16e3, 36e3, 80e3), cell_corners=(20.0, 30.0, 40.0, 60.0, 80.0),
            contact_points=(0.004, 0.018, 0.032, 0.046, 0.058), reference_travel=0.07, lowest_slope=30e3,
            highest_slope=500e3, exponent=0.8, entry=0.003,
        )

    def static_force(self, travel: float) -> float:
        """Return the static push ``F_nl(u)`` [N]."""
        return -self.parts()[0].force(self.initial()[:0], -travel - self.clearance, 0.0)
