# Copyright 2026 ride_estimation contributors
"""Force laws that hide a cause in a mount, sized by its own motion: the one list that every world draws from.

None is a formula of the finder: ``test_hiding_laws.py`` fits each with every family of its library and asks for a remainder.
"""

from __future__ import annotations

import dataclasses

from worlds import laws

#: cause -> forms that hide it
FORMS: dict[str, tuple[str, ...]] = {
    "coulomb_friction": ("lugre", "bouc_wen", "stribeck", "jenkins_chain"),
    "viscoelasticity": ("two_cells", "six_cells", "fractional"),
    "stiffness_nonlinearity": ("hyperbolic", "contoured_piston", "offset_square", "hollow_rubber"),
    "damping_nonlinearity": ("blow_off", "relief_valve", "orifice"),
    "bump_stop": ("foam_one_side", "foam_both_sides"),
    "backlash": ("soft_play",),
}
#: laws of effects that no library lists
OUTSIDE = ("levelling", "inerter")

#: largest size of a form: friction up to its own dynamic force, relaxing stiffness up to three times the static one, ...
LARGEST = {
    "hyperbolic": 0.95, "contoured_piston": 0.45, "offset_square": 3.0, "hollow_rubber": 4.0, "blow_off": 4.0,
    "relief_valve": 4.0, "orifice": 6.0, "two_cells": 3.0, "six_cells": 3.0, "fractional": 3.0, "levelling": 3.0,
    "inerter": 3.0, "soft_play": 6.0,
}  # fmt: skip
#: forms that take linear damping away: beyond this size the damper itself must be a larger one
TAKES_DAMPING = ("blow_off", "relief_valve")
MOST_TAKEN = 0.97


@dataclasses.dataclass(frozen=True)
class Site:
    """What a law is sized by: stiffness [N/m], damping [N s/m], mass it carries [kg], rms deflection, rate, force and a peak."""

    stiffness: float
    damping: float
    mass: float
    deflection: float
    rate: float
    force: float
    upright: bool = True  #: a vertical mount rests on one side of its play


def law_of(form: str, site: Site, size: float, u: float = 0.5, w: float = 0.5) -> tuple[int, tuple[float, ...]]:
    """Return law code and parameters of a form; ``u`` and ``w``, 0 to 1, choose its shape."""
    k, c, x, v = site.stiffness, site.damping, site.deflection, site.rate
    level = 0.4 * size * site.force
    if form == "lugre":
        return laws.LUGRE, (level / ((0.02 + 0.06 * u) * x), 0.0, level, level * (1.2 + 0.3 * w), 0.1 * v)
    if form == "bouc_wen":
        return laws.BOUC_WEN, (level, (0.08 + 0.12 * u) * x, 0.5 + 0.3 * w, 1.0 + w)
    if form == "stribeck":
        return laws.STRIBECK, (level, level * (1.5 + 0.3 * w), 0.3 * v, (0.03 + 0.05 * u) * v)
    if form == "jenkins_chain":
        return laws.JENKINS, (level / ((0.05 + 0.15 * u) * x), level, 8, 10.0)
    if form in ("two_cells", "six_cells", "fractional"):
        n, span = {"two_cells": (2, 40.0), "six_cells": (6, 400.0), "fractional": (12, 3000.0)}[form]
        fast = (0.3 if form == "fractional" else 1.0) * 0.16 / (6.0 + 10.0 * u)
        return laws.MANY_CELLS, (size * k, fast, fast * span, n, 0.1 + 0.4 * w if form == "fractional" else 0.0)
    if form == "hyperbolic":
        return laws.HYPERBOLIC, (min(size, 0.95) * k, (0.5 + 0.5 * u) * x)
    if form == "contoured_piston":
        return laws.CONTOURED, (min(size, 0.45) * k, (0.75 + 0.25 * u) * x, 0.15 + 0.15 * w)
    if form == "offset_square":
        return laws.OFFSET_SQUARE, (0.5 * size * k, x, (0.3 + 0.3 * u) * x * (1.0 if w > 0.5 else -1.0))
    if form == "hollow_rubber":
        return laws.HOLLOW, (0.3 * size * k, x, 0.3 * u * x)
    if form == "blow_off":
        return laws.BLOW_OFF, (size * c, (0.9 + 0.4 * u) * v, (0.2 + 0.1 * w) * v, 0.1 * v)
    if form == "relief_valve":
        return laws.RELIEF, (size * c, (0.6 + 0.4 * u) * v, 0.1 * v)
    if form == "orifice":
        return laws.ORIFICE, (size * c, v, (0.8 + 0.4 * u) * v)
    if form in ("foam_one_side", "foam_both_sides"):
        side = 0.0 if form == "foam_both_sides" else (-1.0 if w < 0.7 else 1.0)
        return laws.FOAM, (0.8 * size * k * x, (1.6 + 0.5 * u) * x, 0.1 * x, 0.5 * x, 0.3 + 0.4 * w, 0.3 * v, side)
    if form == "soft_play":
        centre = (0.3 + 0.7 * u) * x * (1.0 if w > 0.5 else -1.0) if site.upright else 0.0
        return laws.SOFT_PLAY, (k, c, 0.3 * size * x, 0.15 * size * x, centre)
    if form == "levelling":
        return laws.LEVELLING, (0.6 * size * site.force, 4.0 * k * size, 0.3 + u)
    if form == "inerter":
        inertance = size * site.mass / 8.0
        spring = 4.0 * k + inertance * (6.28 * (12.0 + 10.0 * u)) ** 2
        return laws.INERTER, (inertance, spring, 0.6 * (spring * inertance) ** 0.5)
    raise ValueError(f"unknown form {form!r}")


def damping_factor(form: str, size: float) -> float:
    """Return by what the linear damper of a mount grows so that a law that takes damping away leaves it positive."""
    return max(size / MOST_TAKEN, 1.0) if form in TAKES_DAMPING else 1.0
