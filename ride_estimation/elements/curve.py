# Copyright 2026 ride_estimation contributors
"""Spring and damper given by measured points."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Sequence
from typing import ClassVar, final

import numpy as np
import scipy

from ride_estimation.elements import kernels_curve
from ride_estimation.elements.base import Array, ForceElement, series
from ride_estimation.elements.terms import CURVE_DAMPER, CURVE_SPRING, Term


@functools.lru_cache(maxsize=256)
def curve_columns(points: tuple[float, ...], values: tuple[float, ...], *, flat_ends: tuple[bool, bool]) -> tuple[float, ...]:
    """Return a shape-preserving cubic Hermite curve as parameter columns: points, values, slopes (monotone, C1).

    Parameters
    ----------
    points, values
        Abscissae (strictly increasing) and ordinates, shape (n,).
    flat_ends
        Whether the slope at the first and at the last point is zero, so that the curve is constant outside.
    """
    slopes = scipy.interpolate.PchipInterpolator(points, values).derivative()(np.asarray(points))
    if flat_ends[0]:
        slopes[0] = 0.0
    if flat_ends[1]:
        slopes[-1] = 0.0
    return (*(float(v) for v in points), *(float(v) for v in values), *(float(v) for v in slopes))


def evaluate_curve(columns: Sequence[float], u: float) -> float:
    """Return the curve of :func:`curve_columns` at u."""
    row = np.asarray(columns, dtype=float).reshape(1, -1)
    return kernels_curve.curve_value(row, 0, 0, row.shape[1] // 3, u)


def curve_problems(
    key: str, points: Sequence[float], other: str, values: Sequence[float], *, least: int = 2
) -> Iterator[str]:
    """Yield what is wrong with a curve: lengths, order."""
    if len(points) != len(values):
        yield f"{key} has {len(points)} and {other} {len(values)} entries; one of each per point is needed"
    if len(points) < least:
        yield f"{key}: {len(points)} points; at least {least} are needed"
    for i in range(1, len(points)):
        if not points[i] > points[i - 1]:
            yield f"{key}[{i}]: {points[i]:g} does not exceed the point before it, {points[i - 1]:g}; points must increase"


@final
@dataclasses.dataclass(frozen=True)
class CurveSpring(ForceElement):
    """Spring through measured points, ``F = f(x)``: monotone where the points are, C1, straight beyond the last points.

    Source: document 004, nonlinear force-displacement characteristic; shape-preserving cubic (Fritsch and Carlson 1980).
    """

    KIND: ClassVar[str] = "curve_spring"

    deflections: tuple[float, ...] = series(
        "m", key="deflections_m", lower=-10.0, upper=10.0, meaning="deflections of the points, increasing", source="004"
    )
    forces: tuple[float, ...] = series(
        "N", key="forces_n", lower=-1e8, upper=1e8, meaning="forces at the points", role="stiffness", source="004"
    )

    def _bound_problems(self) -> Iterator[str]:
        yield from super()._bound_problems()
        yield from curve_problems("deflections_m", self.deflections, "forces_n", self.forces)

    def _columns(self) -> tuple[float, ...]:
        return curve_columns(self.deflections, self.forces, flat_ends=(False, False))

    def force(self, s: Array, x: float, v: float) -> float:
        """Return the force on the curve [N]."""
        return evaluate_curve(self._columns(), x)

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(CURVE_SPRING, (1.0, 0.0, float(len(self.deflections)), *self._columns())),)

    @classmethod
    def example(cls) -> CurveSpring:
        """Return a progressive spring."""
        return cls(deflections=(-0.04, -0.02, 0.0, 0.02, 0.04), forces=(-6000.0, -2200.0, 0.0, 2000.0, 4200.0))


@final
@dataclasses.dataclass(frozen=True)
class CurveDamper(ForceElement):
    """Damper through measured points, ``F = f(v)``; C1, straight beyond the last points."""

    KIND: ClassVar[str] = "curve_damper"

    rates: tuple[float, ...] = series(
        "m/s", key="rates_m_per_s", lower=-100.0, upper=100.0, meaning="rates of the points, increasing, extension positive",
        source="this project",
    )
    forces: tuple[float, ...] = series(
        "N", key="forces_n", lower=-1e8, upper=1e8, meaning="forces at the points", role="damping", source="this project"
    )

    def _bound_problems(self) -> Iterator[str]:
        yield from super()._bound_problems()
        yield from curve_problems("rates_m_per_s", self.rates, "forces_n", self.forces)
        for i, (rate, force) in enumerate(zip(self.rates, self.forces)):
            if rate * force < 0.0 or (rate == 0.0 and force != 0.0):
                yield f"forces_n[{i}]: {force:g} N at {rate:g} m/s would drive the motion; force and rate need one sign"

    def _columns(self) -> tuple[float, ...]:
        return curve_columns(self.rates, self.forces, flat_ends=(False, False))

    def force(self, s: Array, x: float, v: float) -> float:
        """Return the force on the curve [N]."""
        return evaluate_curve(self._columns(), v)

    def terms(self) -> tuple[Term, ...]:
        """Return the one primitive."""
        return (Term(CURVE_DAMPER, (float(len(self.rates)), *self._columns())),)

    @classmethod
    def example(cls) -> CurveDamper:
        """Return a degressive shock absorber."""
        return cls(rates=(-1.0, -0.3, -0.05, 0.0, 0.05, 0.3, 1.0), forces=(-900.0, -600.0, -250.0, 0.0, 500.0, 1400.0, 2200.0))
