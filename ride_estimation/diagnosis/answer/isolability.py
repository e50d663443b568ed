# Copyright 2026 ride_estimation contributors
"""Which causes, and which places of one cause, a run cannot tell apart, and what would separate them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.common.wording import title
from ride_estimation.diagnosis.search.candidates import same_place
from ride_estimation.diagnosis.search.selection import Round

Array = NDArray[np.float64]

#: pairs that look alike and the manoeuvre or sensor that separates them (ride-model notes, section 5.3)
_SEPARATORS: dict[frozenset[str], str] = {
    frozenset(("stiffness_nonlinearity", "bump_stop")): "a run over single bumps: a stop acts only beyond its gap",
    frozenset(("damping_nonlinearity", "coulomb_friction")): (
        "a second run at half the roughness: a friction level stays, a damper force shrinks"
    ),
    frozenset(("coulomb_friction", "viscoelasticity")): "two roughnesses: relaxation keeps its share, friction loses it",
    frozenset(("coulomb_friction", "sensor_delay")): "two roughnesses, or a tap test of the sensors",
    frozenset(("viscoelasticity", "sensor_delay")): "a tap test of the sensors: a delay acts on every axis of one device alike",
    frozenset(("mass_change", "parameter_drift")): "air-spring pressure or a known added mass",
    frozenset(("sensor_gain", "sensor_misalignment")): "turning the sensor over at rest",
    frozenset(("sensor_bias", "sensor_misalignment")): "turning the sensor over at rest",
    frozenset(("missing_degree_of_freedom", "flexible_mode")): "an accelerometer on the suspected mass",
    frozenset(("missing_degree_of_freedom", "harmonic_disturbance")): "a standing run with all machines on",
    frozenset(("missing_degree_of_freedom", "viscoelasticity")): "an accelerometer on the suspected mass",
    frozenset(("backlash", "stiffness_nonlinearity")): "a slow force-deflection line through rest",
    frozenset(("cg_offset", "wrong_sensor_position")): "weighing the body at its mounts",
}


#: log-likelihoods that differ by less are no evidence to speak of [nat], odds of 20 to 1
_ALIKE = 3.0


@dataclasses.dataclass(frozen=True)
class Confusion:
    """Two explanations of a run that differ little.

    Attributes
    ----------
    first, second
        Causes in words, or one cause at two places.
    deficit
        Log-likelihood by which the second falls behind [nat].
    """

    first: str
    second: str
    deficit: float
    separable_by: str

    @property
    def claim(self) -> str:
        """Return what cannot be distinguished on this run."""
        how = "cannot be distinguished" if self.deficit < _ALIKE else "can hardly be distinguished"
        return f"{self.first} and {self.second} {how} on this run"

    @property
    def words(self) -> str:
        """Return what cannot be distinguished, how far that goes, and what would separate it."""
        return f"{self.claim} ({self.deficit:.1f} nat); what separates them: {self.separable_by}"


def separation(first: str, second: str) -> str:
    """Return what would separate two causes."""
    known = _SEPARATORS.get(frozenset((first, second)))
    if known is not None:
        return known
    return " or ".join(dict.fromkeys(library()[c].MEASURE_NEXT for c in (first, second) if library()[c].MEASURE_NEXT))


def confusions(rounds: Sequence[Round], limit: float = 5.0) -> tuple[Confusion, ...]:
    """Return the pairs of causes, or of places of one cause, whose best fits of a round differ by less than ``limit`` nat."""
    out: list[Confusion] = []
    for current in rounds:
        if not current.candidates:
            continue
        best = current.candidates[0]
        for other in current.candidates[1:]:
            one, two = best.hypothesis, other.hypothesis
            deficit = other.behind(best)
            if deficit >= limit:
                continue
            if two.cause != one.cause:
                names = one.cause.replace("_", " "), two.cause.replace("_", " ")
            elif two.axis == one.axis and not same_place(one, two):
                names = title(*one.key), title(*two.key)
            else:
                continue
            out.append(Confusion(*names, float(deficit), separation(one.cause, two.cause)))
    return tuple(out)
