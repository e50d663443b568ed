# Copyright 2026 ride_estimation contributors
"""Numbers and names as an engineer reads them: one rounding for sentences, tables and reports."""

from __future__ import annotations

import math

#: unit -> (smaller unit, factor, values below this are stated in it)
_SMALLER = {"m": ("mm", 1e3, 0.1), "s": ("ms", 1e3, 0.1), "m/s": ("mm/s", 1e3, 0.1)}


def in_reading_unit(value: float, std: float, unit: str) -> tuple[float, float, str]:
    """Return a value and its standard deviation in mm and ms where m and s would be small."""
    smaller = _SMALLER.get(unit)
    if smaller is None or not math.isfinite(value) or abs(value) >= smaller[2]:
        return value, std, unit
    return value * smaller[1], std * smaller[1], smaller[0]


def rounded(value: float, std: float) -> tuple[str, str]:
    """Return value and standard deviation as texts: two digits of the deviation, the value to the same place.

    The deviation is empty where it is not known; the value then has three digits.
    """
    if not (math.isfinite(std) and std > 0.0 and math.isfinite(value)):
        return f"{value:.3g}", ""
    place = 1 - math.floor(math.log10(std))
    if place < 0:
        return f"{round(value, place):.0f}", f"{round(std, place):.0f}"
    if place > 6 or abs(value) >= 1e9:
        return f"{value:.4g}", f"{std:.2g}"
    return f"{value:.{place}f}", f"{std:.{place}f}"


def quantity(name: str, value: float, std: float, unit: str) -> str:
    """Return ``name value +- std unit``."""
    scaled, spread, shown = in_reading_unit(value, std, unit)
    number, deviation = rounded(scaled, spread)
    return f"{name} {number}{f' +- {deviation}' if deviation else ''}{'' if shown == '-' else f' {shown}'}"


def title(cause: str, location: str, axis: str) -> str:
    """Return a cause and its place in words: ``coulomb friction at front_left z``."""
    place = " ".join(part for part in (location, axis) if part)
    return f"{cause.replace('_', ' ')}{f' at {place}' if place else ''}"
