# Copyright 2026 ride_estimation contributors
"""Units at the border: the key suffix of a file says the unit, inside everything is SI."""

from __future__ import annotations

import math

#: suffix of a YAML key or CSV column -> (unit as printed, factor to SI)
SUFFIXES: dict[str, tuple[str, float]] = {
    "_n_s_per_m": ("N s/m", 1.0),
    "_n_s_per_mm": ("N s/mm", 1.0e3),
    "_n_per_m": ("N/m", 1.0),
    "_n_per_mm": ("N/mm", 1.0e3),
    "_n_per_m3": ("N/m^3", 1.0),
    "_kgf_per_mm": ("kgf/mm", 9.80665e3),
    "_kg_m2": ("kg m^2", 1.0),
    "_kg_mm2": ("kg mm^2", 1.0e-6),
    "_rad_per_s2": ("rad/s^2", 1.0),
    "_rad_per_s": ("rad/s", 1.0),
    "_deg_per_s": ("deg/s", math.pi / 180.0),
    "_m_per_s2": ("m/s^2", 1.0),
    "_g": ("g", 9.80665),
    "_m_per_s": ("m/s", 1.0),
    "_km_per_h": ("km/h", 1.0 / 3.6),
    "_kg": ("kg", 1.0),
    "_mm": ("mm", 1.0e-3),
    "_m": ("m", 1.0),
    "_kn": ("kN", 1.0e3),
    "_n": ("N", 1.0),
    "_n_m": ("N m", 1.0),
    "_ms": ("ms", 1.0e-3),
    "_s": ("s", 1.0),
    "_hz": ("Hz", 1.0),
    "_deg": ("deg", math.pi / 180.0),
    "_rad": ("rad", 1.0),
    "_pa": ("Pa", 1.0),
    "_bar": ("bar", 1.0e5),
    "_m2": ("m^2", 1.0),
    "_m3": ("m^3", 1.0),
    "_n_m_per_rad": ("N m/rad", 1.0),
    "_n_m_s_per_rad": ("N m s/rad", 1.0),
    "_n_m_per_rad3": ("N m/rad^3", 1.0),
    "_rpm": ("rpm", 1.0 / 60.0),
}

#: printed unit -> SI unit of the same dimension, where it is not SI itself
SI_UNITS: dict[str, str] = {
    "N s/mm": "N s/m", "N/mm": "N/m", "kgf/mm": "N/m", "kg mm^2": "kg m^2", "deg/s": "rad/s", "g": "m/s^2", "km/h": "m/s",
    "mm": "m", "kN": "N", "ms": "s", "deg": "rad", "bar": "Pa",
    "rpm": "Hz",
}

#: SI unit of a force element along an axis -> about an axis, where force is a moment and deflection an angle
ABOUT_AN_AXIS: dict[str, str] = {
    "N": "N m", "m": "rad", "m/s": "rad/s", "N/m": "N m/rad", "N s/m": "N m s/rad", "N/m^3": "N m/rad^3",
}


def key_about_an_axis(key: str) -> str:
    """Return the key of a force element's parameter as it reads at a roll, pitch or yaw axis.

    Examples
    --------
    >>> key_about_an_axis("stiffness_n_per_m")
    'stiffness_n_m_per_rad'
    """
    base, printed, _ = split_suffix(key)
    turned = ABOUT_AN_AXIS.get(printed)
    return key if turned is None else base + suffixes_of(turned)[0]


def si_unit(unit: str) -> str:
    """Return the SI unit of the dimension of a printed unit.

    Examples
    --------
    >>> si_unit("kgf/mm")
    'N/m'
    """
    return SI_UNITS.get(unit, unit)


def suffixes_of(unit: str) -> tuple[str, ...]:
    """Return the key suffixes whose values convert to an SI unit, SI first.

    Examples
    --------
    >>> suffixes_of("rad")
    ('_rad', '_deg')
    """
    found = [(factor != 1.0, suffix) for suffix, (printed, factor) in SUFFIXES.items() if si_unit(printed) == unit]
    return tuple(suffix for _, suffix in sorted(found, key=lambda item: item[0]))


def split_suffix(key: str) -> tuple[str, str, float]:
    """Return (name without suffix, unit, factor to SI) of a key; unit is empty where the key has no suffix.

    The longest matching suffix wins, so that ``stiffness_n_per_m`` is newton per metre and not metre.

    Examples
    --------
    >>> split_suffix("stiffness_n_per_mm")
    ('stiffness', 'N/mm', 1000.0)
    """
    for suffix in sorted(SUFFIXES, key=len, reverse=True):
        if key.endswith(suffix) and len(key) > len(suffix):
            unit, factor = SUFFIXES[suffix]
            return key[: -len(suffix)], unit, factor
    return key, "", 1.0
