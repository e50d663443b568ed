# Copyright 2026 ride_estimation contributors
"""Reports and result documents of the special routes: operating points, jounce bumper, oscillator."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ride_estimation.identification.bench import frequency_analysis, oscillator
from ride_estimation.identification.bench.frequency_analysis import FrequencyIdentification
from ride_estimation.identification.bench.harmonic_stiffness import complex_stiffness
from ride_estimation.identification.bench.jounce_analysis import JounceIdentification
from ride_estimation.identification.bench.jounce_choice import NetworkChoice
from ride_estimation.identification.bench.oscillator import OscillatorRung
from ride_estimation.reporting.identification_report import loops, traces
from ride_estimation.reporting.page import Page

SCHEMA = "ride_estimation/identification/1"


def frequency_document(found: FrequencyIdentification, software: str) -> dict[str, Any]:
    """Return ``identification.json`` of a frequency-domain identification."""
    fit = found.best.fit
    return {
        "schema": SCHEMA,
        "software": software,
        "method": f"frequency domain, {fit.norm}",
        "model": fit.model.name,
        "criterion": frequency_analysis.CRITERION,
        "parameters": [
            {
                "name": q.name,
                "value": float(v),
                "std": float(s),
                "unit": q.unit,
                "meaning": q.meaning,
                "status": "at_bound" if q.name in fit.bounds_hit else "not_identifiable" if s > 0.5 * abs(v) else "valid",
            }
            for q, v, s in zip(fit.model.quantities, fit.values, fit.std, strict=True)
        ],
        "bounds_hit": list(fit.bounds_hit),
        "operating_points": [
            {
                "frequency_hz": float(w / (2 * np.pi)),
                "amplitude_m": float(a),
                "stiffness_n_per_m": float(abs(k)),
                "loss_energy_j": float(e),
                "stiffness_error": float(es),
                "loss_error": float(el),
            }
            for w, a, k, e, es, el in zip(
                found.points.omega,
                found.points.amplitude,
                found.points.stiffness,
                found.points.loss_energy,
                fit.stiffness_error,
                fit.loss_error,
                strict=True,
            )
        ],
        "ladder": [
            {
                "model": r.fit.model.name,
                "parameters": r.fit.model.parameter_count,
                "error_fitted": r.fitted,
                "error_left_out": r.left_out,
                "criterion": r.criterion,
            }
            for r in found.rungs
        ],
        "validation": [{"run": h.name, **{f"nrmse_{n}": v for n, v in h.scores().items()}} for h in found.best.held_out],
        "element": found.element,
        "warnings": list(found.warnings),
    }


def write_frequency_report(found: FrequencyIdentification, path: Path) -> None:
    """Write the HTML report of a frequency-domain identification."""
    page = Page("Identification of a force element from harmonic tests")
    best = found.best
    page.verdict(
        f"{best.fit.model.name}: {best.fit.model.meaning}. Error of the complex stiffness on operating points left out: "
        f"{100 * best.left_out:.3g} % ({found.points.omega.size} points)."
    )
    for warning in found.warnings:
        page.warning(warning)
    page.heading("Ladder of models")
    page.text(f"Criterion: {frequency_analysis.CRITERION}.")
    page.table(
        ["model", "parameters", "error fitted [%]", "error left out [%]", "criterion"],
        [
            [
                ("> " if i == found.chosen else "") + r.fit.model.name,
                r.fit.model.parameter_count,
                100 * r.fitted,
                100 * r.left_out,
                r.criterion,
            ]
            for i, r in enumerate(found.rungs)
        ],
    )
    page.heading("Parameters")
    page.table(
        ["parameter", "value", "std", "unit", "meaning"],
        [
            [q.name, float(v), float(s), q.unit, q.meaning]
            for q, v, s in zip(best.fit.model.quantities, best.fit.values, best.fit.std, strict=True)
        ],
    )
    page.figure(_points_figure(found), "Dynamic stiffness and loss energy: measured points, identified curves")
    if best.held_out:
        page.heading("Validation records")
        page.table(
            ["record", "NRMSE std [%]", "NRMSE max [%]", "NRMSE range [%]"],
            [[h.name, *(100 * v for v in h.scores().values())] for h in best.held_out],
        )
        page.figure(loops(best.held_out), "Hysteresis loops on validation records")
        page.figure(traces(best.held_out[0]), f"Force on {best.held_out[0].name}")
    page.write(path)


def _points_figure(found: FrequencyIdentification) -> Figure:
    fit, points = found.best.fit, found.points
    figure = Figure(figsize=(9.5, 3.8))
    left, right = figure.subplots(1, 2)
    frequency = np.geomspace(points.omega.min(), points.omega.max(), 60) / (2 * np.pi)
    groups = np.unique(np.round(np.log(points.amplitude) / 0.1))
    for n, group in enumerate(groups[:: max(1, groups.size // 8)]):
        at = np.round(np.log(points.amplitude) / 0.1) == group
        amplitude = float(np.mean(points.amplitude[at]))
        k = complex_stiffness(fit.model.layout, fit.theta, fit.coefficients, 2 * np.pi * frequency, np.asarray(amplitude))
        colour = f"C{n % 10}"
        left.semilogx(frequency, np.abs(k) * 1e-3, color=colour, lw=0.9, label=f"{1e3 * amplitude:.3g} mm")
        left.semilogx(points.omega[at] / (2 * np.pi), np.abs(points.stiffness[at]) * 1e-3, "o", color=colour, ms=4)
        right.loglog(frequency, np.maximum(np.pi * amplitude**2 * k.imag, 1e-12), color=colour, lw=0.9)
        right.loglog(points.omega[at] / (2 * np.pi), np.maximum(points.loss_energy[at], 1e-12), "o", color=colour, ms=4)
    left.set(xlabel="frequency [Hz]", ylabel="dynamic stiffness [N/mm]")
    right.set(xlabel="frequency [Hz]", ylabel="loss energy per cycle [J]")
    left.legend(fontsize=7, title="amplitude")
    figure.tight_layout()
    return figure


def jounce_document(found: JounceIdentification, software: str) -> dict[str, Any]:
    """Return ``identification.json`` of a jounce bumper."""
    return {
        "schema": SCHEMA,
        "software": software,
        "method": "staged, linear parameters eliminated",
        "model": found.model,
        "parameters": [
            {
                "name": n,
                "value": v,
                "std": d if d is None or np.isfinite(d) else None,
                "unit": u,
                "status": jounce_status(n, v, d),
            }
            for n, v, u, d in found.quantities
        ],
        "stages": found.stages,
        "nrmse_fitted": found.fitted,
        "nrmse_held_out": found.held_out,
        "nrmse_exported_element": found.exported,
        "noise_floor": found.noise_floor,
        "choice_of_network": None if found.choice is None else _choice(found.choice),
        "element": found.element,
        "warnings": list(found.warnings),
    }


def _choice(choice: NetworkChoice) -> dict[str, Any]:
    return {
        "local_models": choice.models,
        "ridge": choice.ridge,
        "left_out_by_local_models": {str(n): v for n, v in choice.sizes.items()},
        "left_out": choice.left_out,
        "left_out_white_box": choice.white,
        "unseen": choice.unseen,
        "unseen_white_box": choice.white_unseen,
        "refusal": choice.refusal,
    }


def jounce_status(name: str, value: float, std: float | None) -> str:
    """Return the status of a parameter of a jounce bumper; ``fitted`` where no standard deviation is estimated."""
    if std is None:
        return "fitted"
    # a contact point may be zero: it is told where it is told to 5 mm
    limit = 5e-3 if name.endswith("contact_point") else 0.5 * abs(value)
    return "valid" if std <= limit else "not_identifiable"


def write_jounce_report(found: JounceIdentification, path: Path) -> None:
    """Write the HTML report of a jounce bumper."""
    page = Page("Identification of a jounce bumper")
    held = f", {100 * float(np.mean(list(found.held_out.values()))):.3g} % on held-out loads" if found.held_out else ""
    page.verdict(
        f"{found.model}: mean NRMSE {100 * float(np.mean(list(found.fitted.values()))):.3g} % on fitted records{held}; "
        "white noise of "
        f"the load cell alone would give {100 * float(np.mean(list(found.noise_floor.values()))):.3g} %."
    )
    for warning in found.warnings:
        page.warning(warning)
    page.heading("Records")
    page.table(
        ["record", "fitted [%]", "exported element [%]", "held out [%]", "noise floor [%]"],
        [
            [
                n,
                100 * found.fitted[n] if n in found.fitted else "",
                100 * found.exported[n] if n in found.exported else "",
                100 * found.held_out[n] if n in found.held_out else "",
                100 * found.noise_floor[n] if n in found.noise_floor else "",
            ]
            for n in dict.fromkeys([*found.fitted, *found.held_out])
        ],
    )
    page.heading("Stages")
    names = list(next(iter(found.stages.values())))
    page.table(["stage", *names], [[stage, *(100 * values[n] for n in names)] for stage, values in found.stages.items()])
    page.heading("Parameters")
    page.table(
        ["parameter", "value", "std", "unit", "status"],
        [[n, v, "" if d is None else d, u, jounce_status(n, v, d)] for n, v, u, d in found.quantities],
    )
    page.figure(loops(found.curves), "Force over travel, compression positive: measured and identified")
    page.figure(traces(found.curves[0]), f"Force over time, {found.curves[0].name}")
    page.write(path)


def oscillator_document(rungs: Sequence[OscillatorRung], chosen: int, software: str) -> dict[str, Any]:
    """Return ``identification.json`` of an oscillator."""
    best = rungs[chosen]
    names = oscillator.LADDER[best.name]
    return {
        "schema": SCHEMA,
        "software": software,
        "method": "oscillator, simulation error",
        "model": best.name,
        "criterion": oscillator.CRITERION,
        "physical": best.physical,
        "parameters": [
            {
                "name": oscillator.COEFFICIENTS[i],
                "value": float(best.coefficients[i]),
                "std": float(best.std[i]),
                "unit": "",
                "status": "valid",
            }
            for i in names
        ],
        "ladder": [
            {
                "model": r.name,
                "parameters": len(oscillator.LADDER[r.name]),
                "rms_fitted": r.fitted_rms,
                "nrmse_fitted": r.fitted_nrmse,
                "held_out": {n: {"rms": e[0], "nrmse": e[1]} for n, e in r.held_out.items()},
                "criterion": r.criterion,
                "gain": float(r.gain) if np.isfinite(r.gain) else None,
                "physical": r.physical,
            }
            for r in rungs
        ],
        "residual": unexplained_oscillator(rungs, chosen),
        "warnings": [],
    }


def unexplained_oscillator(rungs: Sequence[OscillatorRung], chosen: int) -> str:
    """Say what the ladder found and what stays."""
    linear, best = rungs[0], rungs[chosen]
    words = [
        f"{name}: {linear.held_out[name][0]:.3g} rms linear, {best.held_out[name][0]:.3g} rms {best.name.replace('_', ' ')} "
        f"({100 * best.held_out[name][1]:.2g} % of its standard deviation)"
        for name in best.held_out
    ]
    spring = best.physical["cubic"]
    kind = "hardening" if spring > 0 else "softening" if spring < 0 else "linear"
    return (
        f"The spring is {kind}: cubic over linear rate {spring / best.physical['stiffness']:.4g} per unit of response "
        "squared. On data "
        f"not fitted, {'; '.join(words)}. The remainder is not explained by any rung of this ladder."
    )


def write_oscillator_report(rungs: Sequence[OscillatorRung], chosen: int, path: Path) -> None:
    """Write the HTML report of an oscillator."""
    page = Page("Identification of an oscillator from excitation and response")
    page.verdict(unexplained_oscillator(rungs, chosen))
    page.heading("Ladder of models")
    page.text(f"Only the excitation is fed; errors are simulation errors. Criterion: {oscillator.CRITERION}.")
    page.table(
        [
            "model",
            "parameters",
            "rms fitted",
            *(f"rms {n}" for n in rungs[0].held_out),
            "gain [%]",
            "criterion",
            "frequency [Hz]",
            "damping ratio",
            "cubic/linear",
        ],
        [
            [
                ("> " if i == chosen else "") + r.name,
                len(oscillator.LADDER[r.name]),
                r.fitted_rms,
                *(e[0] for e in r.held_out.values()),
                100 * r.gain if np.isfinite(r.gain) else "",
                r.criterion,
                r.physical["frequency_hz"],
                r.physical["damping_ratio"],
                r.physical["cubic"] / r.physical["stiffness"],
            ]
            for i, r in enumerate(rungs)
        ],
    )
    page.write(path)
