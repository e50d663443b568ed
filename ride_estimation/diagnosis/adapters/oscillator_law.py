# Copyright 2026 ride_estimation contributors
"""A law fitted to an oscillator as numbers to check and as an element of a vehicle file, per unit mass."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from ride_estimation.diagnosis.hypotheses.hypothesis import Reported
from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.bouc_wen import BoucWen
from ride_estimation.elements.bump_stop import BumpStop
from ride_estimation.elements.cubic_spring import CubicSpring
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.maxwell import Maxwell
from ride_estimation.elements.stribeck_friction import StribeckFriction
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.errors import ConfigurationError
from ride_estimation.identification.bench.law_oscillator import PARAMETERS, LawFit

#: what the parameters are called, and in which units per unit mass; Z of a loop with g and h is a reference and not reported
_TITLES = {
    "b": ("reciprocal of the mass", "1/kg"), "c": ("damping over mass", "1/s"), "k": ("stiffness over mass", "1/s^2"),
    "k3": ("cubic stiffness over mass", "1/(m s)^2"), "c2": ("square damping over mass", "1/m"),
    "A": ("stiffness of the law over mass", "1/s^2"), "Z": ("largest force of the law over mass", "m/s^2"),
    "g": ("loss of the loop at the reference force", "-"), "h": ("bending of the loop at the reference force", "-"),
    "n": ("exponent of the loop", "-"), "tau": ("relaxation time", "s"), "stop": ("stiffness of the stop over mass", "1/s^2"),
    "gap": ("gap", "m"), "play": ("half clearance", "m"), "k5": ("quintic stiffness over mass", "1/(m^4 s^2)"),
    "F": ("friction over mass", "m/s^2"), "w": ("rate that rounds it", "m/s"),
}  # fmt: skip


def law_parameters(fit: LawFit) -> tuple[Reported, ...]:
    """Return the fitted numbers, those of the law first, named after it."""
    values = dict(zip(PARAMETERS, zip(fit.values.tolist(), fit.std.tolist())))
    own = [PARAMETERS[i] for i in fit.law.free]
    out = []
    for name in (*own, "b", "c", "k"):
        title, unit = _TITLES[name]
        out.append(Reported(f"{fit.law.name}: {title}" if name in own else title, *values[name], unit))
    return tuple(out)


def law_element(fit: LawFit) -> tuple[ForceElement, tuple[str, ...]]:
    """Return the mount per unit mass and remarks on what an element cannot hold."""
    v = dict(zip(PARAMETERS, fit.values.tolist()))
    spring = KelvinVoigt(v["k"], v["c"])
    try:
        beside = _beside(fit.law.name, v)
    except ConfigurationError:  # in the units of the record, a number may be one that no mount has
        beside = None
    if beside is not None:
        fifth = ("the fifth power of the spring has no element and is left out",) if v["k5"] else ()
        return SumOfElements((spring, beside)), fifth
    left_out = f"{fit.law.name} with these numbers has no element of a vehicle file: its stiffness at rest is in the spring"
    return dataclasses.replace(spring, stiffness=v["k"] + v["A"]), (left_out,)


def _beside(name: str, v: Mapping[str, float]) -> ForceElement | None:
    """Return the element beside the spring and damper, None where there is none."""
    match name:
        case "Maxwell relaxation":
            return Maxwell(v["A"], v["A"] * v["tau"])
        case "nonlinear spring":
            return CubicSpring(0.0, v["k3"])
        case "dry friction":
            return StribeckFriction(v["F"], v["F"], v["w"], rounding=v["w"])
        case "stop":
            return BumpStop(v["gap"], v["stop"], v["gap"])
        case "Bouc-Wen hysteresis" | "Dahl friction":
            total = v["g"] + v["h"]
            # a loop that stiffens with its force is no law of a mount
            if total > 0.0 and v["g"] >= 0.5 * total and v["n"] >= 1.0:
                return BoucWen(v["Z"] * total ** (-1.0 / v["n"]), v["A"], v["n"], v["g"] / total)
    return None
