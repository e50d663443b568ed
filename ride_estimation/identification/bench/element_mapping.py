# Copyright 2026 ride_estimation contributors
"""An identified model as the YAML form of a force element, checked by building the element."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.registry import element_from_mapping
from ride_estimation.errors import ConfigurationError
from ride_estimation.identification.bench.columns import FRICTION_BERG
from ride_estimation.identification.bench.frequency_domain import FrequencyDomainFit
from ride_estimation.identification.bench.time_domain import TimeDomainFit

Mapping = dict[str, Any]


def element_parts(fit: TimeDomainFit | FrequencyDomainFit, dead_band: float = 0.0) -> list[Mapping]:
    """Return the YAML forms of the elements the model is the sum of.

    Parts held at zero are left out.

    Parameters
    ----------
    fit
        Identified model.
    dead_band
        Reversal dead band that suits the sensor the model was identified with [m].
    """
    value = {q.name: float(v) for q, v in zip(fit.model.quantities, fit.values, strict=True)}
    lay = fit.model.layout
    parts: list[Mapping] = []
    if lay.cubic:
        parts.append(
            {
                "kind": "cubic_spring",
                "stiffness_n_per_m": value["stiffness"],
                "cubic_n_per_m3": value["cubic_stiffness"],
            }
        )
        if lay.viscous:
            parts.append({"kind": "kelvin_voigt", "stiffness_n_per_m": 0.0, "damping_n_s_per_m": value["damping"]})
    elif lay.spring or lay.viscous:
        parts.append(
            {
                "kind": "kelvin_voigt",
                "stiffness_n_per_m": value.get("stiffness", 0.0),
                "damping_n_s_per_m": value.get("damping", 0.0),
            }
        )
    for i in range(1, lay.cells + 1):
        if value[f"cell_{i}_stiffness"] > 0.0:
            parts.append(
                {
                    "kind": "maxwell",
                    "stiffness_n_per_m": value[f"cell_{i}_stiffness"],
                    "damping_n_s_per_m": value[f"cell_{i}_damping"],
                }
            )
    if lay.friction and value["friction"] > 0.0:
        if lay.friction == FRICTION_BERG:
            parts.append(
                {
                    "kind": "berg_friction",
                    "friction_n": value["friction"],
                    "half_stroke_m": value["half_stroke"],
                    "dead_band_m": dead_band,
                }
            )
        else:
            parts.append(
                {
                    "kind": "dahl",
                    "friction_n": value["friction"],
                    "slope_n_per_m": value["friction"] / value["presliding"],
                    "dead_band_m": dead_band,
                }
            )
    return parts


def element_mapping(fit: TimeDomainFit | FrequencyDomainFit, dead_band: float = 0.0) -> Mapping:
    """Return the YAML form of the element: a named element where there is one, else the sum of its parts."""
    lay = fit.model.layout
    parts = element_parts(fit, dead_band)
    complete = len(parts) == 1 + lay.cells + 1
    value = {q.name: float(v) for q, v in zip(fit.model.quantities, fit.values, strict=True)}
    if lay.friction == FRICTION_BERG and complete and not lay.viscous:
        tail = {"friction_n": value["friction"], "half_stroke_m": value["half_stroke"], "dead_band_m": dead_band}
        if lay.cubic and lay.cells == 2:
            cells = {
                f"cell_{i}_{what}_{unit}": value[f"cell_{i}_{what}"]
                for i in (1, 2)
                for what, unit in (("stiffness", "n_per_m"), ("damping", "n_s_per_m"))
            }
            return {
                "kind": "modified_berg",
                "stiffness_n_per_m": value["stiffness"],
                "cubic_n_per_m3": value["cubic_stiffness"],
                **cells,
                **tail,
            }
        if not lay.cubic and lay.cells == 1:
            return {
                "kind": "berg",
                "stiffness_n_per_m": value["stiffness"],
                "cell_stiffness_n_per_m": value["cell_1_stiffness"],
                "cell_damping_n_s_per_m": value["cell_1_damping"],
                **tail,
            }
    return sum_mapping(parts)


def sum_mapping(parts: Sequence[Mapping]) -> Mapping:
    """Return one mapping for several parts: the part itself where there is only one."""
    return dict(parts[0]) if len(parts) == 1 else {"kind": "sum", "elements": [dict(p) for p in parts]}


def build_element(mapping: Mapping) -> tuple[ForceElement | None, str]:
    """Return the element a mapping stands for, or None and why it is outside the element's bounds."""
    try:
        return element_from_mapping(mapping), ""
    except ConfigurationError as error:
        return None, str(error)
