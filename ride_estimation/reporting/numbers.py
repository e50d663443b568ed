# Copyright 2026 ride_estimation contributors
"""Numbers as a person reads them: no more digits than are meant, no powers of ten where plain digits do."""

from __future__ import annotations

import math
from collections.abc import Iterable

#: plain digits are readable between these; beyond, a power of ten is
_SMALL, _LARGE = 1e-4, 1e7


def plain(value: float, digits: int = 4) -> str:
    """Return a number with some significant digits and without a power of ten as long as it stays readable.

    Examples
    --------
    >>> plain(434630.0), plain(0.07188, 3), plain(2.0), plain(1.19e20, 3)
    ('434600', '0.0719', '2', '1.19e+20')
    """
    if value == 0.0 or not math.isfinite(value) or not _SMALL <= abs(value) < _LARGE:
        return f"{value + 0.0:.{digits}g}"  # a zero has no sign
    rounded = float(f"{value:.{digits}g}")
    decimals = max(digits - 1 - math.floor(math.log10(abs(rounded))), 0)
    text = f"{rounded:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def alike(values: Iterable[float], digits: int = 3) -> str:
    """Return numbers with as many decimals as the largest of them deserves.

    Examples
    --------
    >>> alike((-0.0142, 0.7831, 9.7912)), alike((0.0041,))
    ('-0.01  0.78  9.79', '0.00410')
    """
    given = [float(v) for v in values]
    largest = max((abs(v) for v in given if math.isfinite(v)), default=0.0)
    decimals = min(max(digits - 1 - math.floor(math.log10(largest)), 0), 9) if largest > 0.0 else 0
    # a zero has no sign
    return "  ".join(f"{round(v, decimals) + 0.0:.{decimals}f}" for v in given)


def with_std(value: float, std: float) -> tuple[str, str]:
    """Return a value and its standard deviation, this one with two digits, the value to the same place.

    Examples
    --------
    >>> with_std(434631.2, 56712.0), with_std(1271.53, 13.14), with_std(5.0, 0.0)
    (('435000', '57000'), ('1272', '13'), ('5', '0'))
    """
    if not (math.isfinite(value) and math.isfinite(std)) or std <= 0.0:
        return plain(value), plain(std)
    place = math.floor(math.log10(float(f"{std:.2g}"))) - 1
    if not -8 < place < 8 or not abs(value) < _LARGE:
        return plain(value), plain(std, 2)
    decimals = max(-place, 0)
    return f"{round(value, -place) + 0.0:.{decimals}f}", f"{round(std, -place):.{decimals}f}"


def with_half(value: float, half: float) -> str:
    """Return ``value ± half``, both to the place of the second digit of the half width.

    Examples
    --------
    >>> with_half(4.2061, 0.0512), with_half(1.5, 0.0)
    ('4.206 ± 0.051', '1.5')
    """
    return " ± ".join(with_std(value, half)) if half > 0.0 and math.isfinite(half) else plain(value)


def interval(lower: float, upper: float, digits: int) -> str:
    """Return an interval in words; a lower end of zero means that the value is not known."""
    low, high = plain(lower, digits), plain(upper, digits)
    if low == high:
        return "not stated" if upper > 0.0 else "-"
    return f"{low} to {high}" if lower > 0.0 else f"not known, below {high}"


#: unit inside -> (unit people read, factor)
_READ = {"N/m": ("N/mm", 1e-3), "N s/m": ("N s/mm", 1e-3), "N/m^3": ("N/mm³", 1e-9), "kg m^2": ("kg m²", 1.0)}


def reading_unit(unit: str) -> tuple[str, float]:
    """Return the unit a parameter is shown in and the factor to it; files keep SI.

    Examples
    --------
    >>> reading_unit("N/m"), reading_unit("kg")
    (('N/mm', 0.001), ('kg', 1.0))
    """
    return _READ.get(unit, (unit, 1.0))
