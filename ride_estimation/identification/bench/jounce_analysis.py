# Copyright 2026 ride_estimation contributors
"""From jounce-bumper records to a white box, a grey box, or a grey box with Dahl friction, scored on held-out loads."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.registry import element_from_mapping
from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.choices import JOUNCE_MODELS
from ride_estimation.identification.bench.jounce import identify_white_box
from ride_estimation.identification.bench.jounce_choice import NetworkChoice, choose_network, white_box_of
from ride_estimation.identification.bench.jounce_model import (
    Load,
    WhiteBox,
    as_load,
    compression_side,
    loaded_nrmse,
    split_static,
)
from ride_estimation.identification.bench.jounce_static import fit_static
from ride_estimation.identification.bench.jounce_uncertainty import active_cells, white_box_std
from ride_estimation.identification.bench.ladder import HeldOut
from ride_estimation.identification.bench.lolimot import Network, NetworkInputs, pole_std, train_network
from ride_estimation.identification.bench.record import BenchRecord
from ride_estimation.identification.bench.reversals import noise_level
from ride_estimation.identification.bench.time_domain import prepare
from ride_estimation.vehicles.data_range import BEYOND

Array = NDArray[np.float64]

#: points of exported curves
_POINTS = 31


@dataclasses.dataclass(frozen=True)
class JounceIdentification:
    """Everything the command reports of a jounce bumper.

    Attributes
    ----------
    model
        One of ``JOUNCE_MODELS``.
    stages
        Stage or number of local models -> record -> NRMSE on fitted loads.
    fitted, held_out
        Record -> NRMSE of the chosen model; held out: load events or records that were not fitted.
    exported
        Record -> NRMSE of the element as written to ``element.yaml`` (same loads as ``fitted``).
    noise_floor
        Record -> NRMSE that white noise of the load cell alone gives.
    quantities
        Named parameters: name, value, unit, standard deviation (None where it is not estimated).
    element
        YAML form.
    curves
        Held-out stretches for pictures.
    choice
        How the size of a network was chosen, and what it is worth on records it did not see; None for the white box.
    warnings
        What was noticed.
    """

    model: str
    stages: dict[str, dict[str, float]]
    fitted: dict[str, float]
    held_out: dict[str, float]
    exported: dict[str, float]
    noise_floor: dict[str, float]
    quantities: tuple[tuple[str, float, str, float | None], ...]
    element: dict[str, Any]
    curves: tuple[HeldOut, ...]
    choice: NetworkChoice | None
    warnings: tuple[str, ...]


def identify_jounce(
    records: Sequence[BenchRecord],
    validation: Sequence[BenchRecord],
    model: str = "jounce_bumper",
    *,
    static: Sequence[BenchRecord] = (),
    models: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> JounceIdentification:
    """Identify a jounce bumper.

    Parameters
    ----------
    records
        Checked records: at least one slow (static ramps), unless ``static`` has it, and one fast.
    validation
        Records that are not fitted; empty: every fourth load event of the fast records is held out.
    model
        One of ``JOUNCE_MODELS``.
    static
        Slow records for the static curve (and Dahl friction) of a network only; the network is not trained on them.
    models
        Local models of a network; None: chosen on records left out.
    progress
        Called with 1 per stage, or per record left out and once more for ``validation``.
    """
    if model not in JOUNCE_MODELS:
        raise InputDataError(f"model {model!r} is no jounce-bumper model; allowed: {', '.join(JOUNCE_MODELS)}")
    if static and model == JOUNCE_MODELS[0]:
        raise InputDataError("records for the static curve alone are for networks; the white box is fitted to all its records")
    prepared = [prepare(r) for r in records]
    apart = [prepare(r) for r in static]
    side = compression_side([*prepared, *apart])
    plain = [as_load(p, side) for p in prepared]
    curves_from = [as_load(p, side) for p in apart] or split_static(plain)[0]
    slow = {load.name for load in curves_from}
    dynamic = [i for i, load in enumerate(plain) if load.name not in slow]
    keep_out = not validation or len(dynamic) == 1
    loads = [
        load if load.name in slow or not keep_out else as_load(p, side, hold_out=True)
        for load, p in zip(plain, prepared, strict=True)
    ]
    held = [as_load(prepare(r), side) for r in validation]
    choice = None
    if model == JOUNCE_MODELS[0]:
        predict, stages, element, quantities = _white(loads, progress)
    else:
        dahl = model.endswith("dahl")
        predict, stages, element, quantities, choice = _grey(loads, curves_from, dynamic, dahl, models, progress)
    fitted = {load.name: loaded_nrmse(load, predict(load)) for load in loads}
    held_out = {load.name: loaded_nrmse(load, predict(load), load.held_out) for load in loads if load.held_out.any()}
    unseen = {load.name: loaded_nrmse(load, predict(load)) for load in held}
    held_out |= unseen
    warnings = [w for r in (*records, *static, *validation) for w in r.warnings]
    warnings += _beyond(loads, held)
    if choice is not None:
        if held:
            box = white_box_of(curves_from, loads)
            white = {load.name: loaded_nrmse(load, box.force(load)) for load in held}
            choice = dataclasses.replace(choice, unseen=unseen, white_unseen=white)
            if progress is not None:
                progress(1.0)
        warnings += [choice.refusal] if choice.refusal else []
    exported, remarks = _exported(element, loads, fitted)
    warnings += remarks
    shown = held or [load for load in loads if load.held_out.any()] or loads
    curves = tuple(_stretch(load, predict(load)) for load in shown[:4])
    return JounceIdentification(
        model,
        stages,
        fitted,
        held_out,
        exported,
        {load.name: noise_level(load.force) / load.scale for load in loads},
        quantities,
        element,
        curves,
        choice,
        tuple(dict.fromkeys(warnings)),
    )


def _beyond(loads: Sequence[Load], held: Sequence[Load]) -> list[str]:
    """Warn of records that are not fitted and go beyond the travels or rates that are."""
    said = []
    for unit, scale, extent in (
        ("mm", 1e3, lambda load: float(load.travel.max())),
        ("m/s", 1.0, lambda load: float(np.quantile(np.abs(np.diff(load.travel)), 0.999)) / load.step_s),
    ):
        widest = max(extent(load) for load in loads)
        said += [
            f"{load.name}: goes to {scale * extent(load):.3g} {unit}, the fitted records to {scale * widest:.3g} {unit}: "
            "the score there is extrapolation"
            for load in held
            if extent(load) > BEYOND * widest
        ]
    return said


def _exported(
    element: dict[str, Any], loads: Sequence[Load], fitted: dict[str, float]
) -> tuple[dict[str, float], list[str]]:
    """Return the NRMSE of the element as it is written to file, and a warning where it is worse than the fitted model."""
    built = element_from_mapping(element)
    exported = {load.name: loaded_nrmse(load, _response(built, load)) for load in loads}
    worse = max(exported[n] / max(fitted[n], 1e-9) for n in fitted)
    if worse <= 1.1:
        return exported, []
    return exported, [
        f"the exported element is {worse:.2g} times less accurate than the fitted model: see the column of the exported element"
    ]


def _response(element: ForceElement, load: Load) -> Array:
    """Return the compression force of an element over a record (its deflection is negative in compression)."""
    time = np.asarray(np.arange(load.travel.size) * load.step_s, dtype=float)
    force: Array = -element.response(time, -load.travel)
    return force


def _stretch(load: Load, force: Array) -> HeldOut:
    part = load.held_out if load.held_out.any() else load.fitted
    time = np.asarray(np.arange(load.travel.size) * load.step_s, dtype=float)
    return HeldOut(load.name, time[part], load.travel[part], load.force[part], force[part])


def _points(box: WhiteBox) -> tuple[list[float], list[float], list[float]]:
    """Return travels, static forces and heights of the exported curves, not negative and without decreasing travels."""
    travel = np.unique(np.concatenate([np.linspace(0.0, float(box.basis.knots[-1]), _POINTS), box.basis.knots]))
    travel = travel[np.concatenate([[True], np.diff(travel) > 1e-5])]
    spline = box.basis(travel)
    force = np.maximum(spline @ box.static, 0.0)
    height = np.maximum(spline @ box.height, 0.0)
    force[0] = height[0] = 0.0
    return travel.tolist(), force.tolist(), height.tolist()


def _white(
    loads: Sequence[Load], progress: Callable[[float], None] | None
) -> tuple[
    Callable[[Load], Array], dict[str, dict[str, float]], dict[str, Any], tuple[tuple[str, float, str, float | None], ...]
]:
    box, stages = identify_white_box(loads, progress=progress)
    travels, forces, heights = _points(box)
    active = active_cells(box)
    element = {
        "kind": "jounce_bumper",
        "travels_m": travels,
        "forces_n": forces,
        "heights_n": heights,
        "cell_stiffnesses_n_per_m": [float(box.stiffness[i]) for i in active],
        "cell_corners_rad_per_s": [float(box.rates[i]) for i in active],
        "contact_points_m": [float(box.contacts[i]) for i in active],
        "reference_travel_m": travels[-1],
        "lowest_slope_n_per_m": float(box.slopes[0]),
        "highest_slope_n_per_m": float(box.slopes[1]),
        "exponent": float(box.slopes[2]),
        "entry_m": float(box.smooth),
    }
    quantities = [
        ("reference_travel", travels[-1], "m"),
        ("static_force_at_reference", forces[-1], "N"),
        ("hysteresis_height_at_reference", heights[-1], "N"),
        ("dahl_lowest_slope", float(box.slopes[0]), "N/m"),
        ("dahl_highest_slope", float(box.slopes[1]), "N/m"),
        ("dahl_exponent", float(box.slopes[2]), "1"),
        ("entry", float(box.smooth), "m"),
    ]
    for n, i in enumerate(active, 1):
        quantities += [
            (f"cell_{n}_contact_point", float(box.contacts[i]), "m"),
            (f"cell_{n}_stiffness", float(box.stiffness[i]), "N/m"),
            (f"cell_{n}_corner", float(box.rates[i]), "rad/s"),
        ]
    std = white_box_std(box, loads)
    listed = tuple((name, value, unit, std.get(name)) for name, value, unit in quantities)
    return box.force, stages, element, listed


def _grey(
    loads: Sequence[Load],
    static: Sequence[Load],
    dynamic: Sequence[int],
    dahl: bool,
    models: int | None,
    progress: Callable[[float], None] | None,
) -> tuple[
    Callable[[Load], Array],
    dict[str, dict[str, float]],
    dict[str, Any],
    tuple[tuple[str, float, str, float | None], ...],
    NetworkChoice,
]:
    box = fit_static(static, max(float(load.travel.max()) for load in loads))

    def curve(travel: Array) -> Array:
        return np.asarray(np.maximum(box.basis(travel) @ box.static, 0.0))

    def friction(load: Load) -> Array:
        if not dahl:
            return np.zeros(load.force.size)
        force = 0.5 * box.state(load) * np.maximum(box.basis(load.travel) @ box.height, 0.0)
        force[load.travel <= 0.0] = 0.0
        return np.asarray(force)

    inputs = [NetworkInputs(load, curve, load.force - friction(load)) for load in loads]
    choice = choose_network(inputs, dynamic, static, friction, models, progress)
    network, history = train_network(inputs, choice.models, choice.ridge)

    def predict(load: Load) -> Array:
        return np.asarray(network.force(NetworkInputs(load, curve, load.force)) + friction(load))

    stages = {f"{n} local models": {"all": value} for n, value in enumerate(history, 1)}
    travels, forces, heights = _points(box)
    mapping = network_mapping(network, travels, forces)
    if dahl:
        weighted = {
            "kind": "weighted_dahl",
            "travels_m": travels,
            "heights_n": heights,
            "reference_travel_m": travels[-1],
            "lowest_slope_n_per_m": float(box.slopes[0]),
            "highest_slope_n_per_m": float(box.slopes[1]),
            "exponent": float(box.slopes[2]),
        }
        mapping = {"kind": "sum", "elements": [mapping, weighted]}
    poles = zip(network.alpha, pole_std(network, inputs, choice.ridge), strict=True)
    quantities = [(f"pole_{j}", -float(alpha), "1/s", float(std)) for j, (alpha, std) in enumerate(poles, 1)]
    return predict, stages, mapping, tuple(quantities), choice


def network_mapping(network: Network, travels: Sequence[float], forces: Sequence[float]) -> dict[str, Any]:
    """Return the YAML form of a network."""
    g, d1, d2, c1, c2 = network.gains.T
    lists = {
        "travel_centres": network.centres[:, 0],
        "rate_centres": network.centres[:, 1],
        "travel_widths": network.widths[:, 0],
        "rate_widths": network.widths[:, 1],
        "poles_per_s": network.alpha,
        "offsets_n": g,
        "travel_gains_n_per_m": d1,
        "travel_inputs": c1,
        "force_gains": d2,
        "force_inputs_per_s": c2,
    }
    return {
        "kind": "local_linear_network",
        **{k: [float(v) for v in values] for k, values in lists.items()},
        "travels_m": list(travels),
        "forces_n": list(forces),
        "lowest_travel_m": network.travel_range[0],
        "highest_travel_m": network.travel_range[1],
        "lowest_rate_m_per_s": network.rate_range[0],
        "highest_rate_m_per_s": network.rate_range[1],
    }
