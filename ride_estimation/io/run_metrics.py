# Copyright 2026 ride_estimation contributors
"""The numbers of one replay that runs are compared by, taken from ``result.json``."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from ride_estimation.estimation.common.estimate import best_of


@dataclasses.dataclass(frozen=True)
class Metric:
    """One number of one run.

    Attributes
    ----------
    name
        The same in every run.
    value
        In ``unit``.
    std
        One standard deviation, None where none is known.
    unit
        As printed.
    sure
        False where the number must not be compared: parameters without the status ``valid``, damage that is not known.
    """

    name: str
    value: float
    std: float | None
    unit: str
    sure: bool = True

    @property
    def column(self) -> str:
        """Return the heading of the metric in a table."""
        return f"{self.name} [{self.unit}]"


def run_metrics(result: Mapping[str, Any]) -> dict[str, Metric]:
    """Return the metrics of one replay by name, in the order of tables.

    Parameters
    ----------
    result
        Content of ``result.json``; parts that an older replay did not write are left out.
    """
    run = result.get("run", {})
    found = [Metric("duration", float(run.get("duration_s", 0.0)), None, "s")]
    if run.get("ticks"):
        found.append(Metric("valid ticks", 100.0 * run.get("valid_ticks", 0) / run["ticks"], None, "%"))
    found.append(Metric("warnings", float(len(result.get("warnings", ()))), None, "-"))
    fits = [float(v) for v in result.get("fit", {}).values() if v is not None]
    if fits:
        found.append(Metric("worst channel NRMSE", 100.0 * max(fits), None, "%"))
    found += _parameters(result)
    found += _durability(result)
    found += _comfort(result)
    return {metric.name: metric for metric in found if np.isfinite(metric.value)}


def _parameters(result: Mapping[str, Any]) -> list[Metric]:
    return [
        Metric(p["name"], float(p["value"]), None if p.get("std") is None else float(p["std"]), p["unit"], p["status"] == "valid")
        for p in [*best_parameters(result), *result.get("mass_properties", ())]
        if p.get("value") is not None
    ]


def best_parameters(result: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the parameters of a replay: of the whole run unless suspect there, else as the node publishes them.

    Parameters
    ----------
    result
        Content of ``result.json``; an older replay has none of the whole run.
    """
    live, whole = (result.get(key, ()) for key in ("parameters", "parameters_smoothed"))
    return best_of(live, whole, lambda p: (p["name"], p["status"]))


def _durability(result: Mapping[str, Any]) -> list[Metric]:
    section = result.get("durability", {})
    slope = section.get("slope", 0.0)
    found = []
    for entry in section.get("mounts", ()):
        name = f"{entry['mount']}.{entry['axis']} equivalent amplitude (slope {slope:g})"
        std = (entry["equivalent_upper_n"] - entry["equivalent_lower_n"]) / 4.0
        found.append(Metric(name, float(entry["equivalent_amplitude_n"]), float(std), "N", entry["equivalent_lower_n"] > 0.0))
    return found


def _comfort(result: Mapping[str, Any]) -> list[Metric]:
    found = []
    hours = result.get("comfort", {}).get("daily_exposure_s", 28800.0) / 3600.0
    for place in result.get("comfort", {}).get("places", ()):
        found.append(Metric(f"a_w z, {place['location']}", float(place["z"]["a_w_m_per_s2"]), None, "m/s²"))
        found.append(Metric(f"A(8) of {hours:g} h a day, {place['location']}", float(place["a8_m_per_s2"]), None, "m/s²"))
    return found
