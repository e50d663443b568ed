# Copyright 2026 ride_estimation contributors
"""The report of a bench identification: verdict, ladder, parameters, identifiability, loops, stiffness and loss."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ride_estimation.identification.bench.analysis import BenchIdentification
from ride_estimation.identification.bench.harmonic_stiffness import complex_stiffness
from ride_estimation.identification.bench.ladder import CRITERION, HeldOut
from ride_estimation.reporting.page import Page

Array = NDArray[np.float64]


def write_identification_report(found: BenchIdentification, path: Path) -> None:
    """Write the HTML report of a time-domain identification."""
    page = Page("Identification of a force element from bench records")
    best = found.best
    held = {h.name: h.scores()["std"] for h in best.held_out}
    worst = max(held, key=lambda name: held[name])
    page.verdict(
        f"{best.fit.model.name}: {best.fit.model.meaning}. Error on data it was not fitted to: "
        f"{100 * held[worst]:.3g} % of the force's standard deviation (worst of {len(held)}: {worst})."
    )
    page.text(found.unexplained)
    for warning in found.warnings:
        page.warning(warning)
    _ladder(page, found)
    _parameters(page, found)
    page.heading("Pictures")
    page.figure(loops(best.held_out), "Hysteresis loops on held-out data: measured and identified")
    page.figure(traces(best.held_out[0]), f"Force on held-out data, {best.held_out[0].name}")
    page.figure(stiffness_and_loss(found), "Dynamic stiffness and loss energy per cycle of the identified element")
    _records(page, found)
    page.write(path)


def _ladder(page: Page, found: BenchIdentification) -> None:
    page.heading("Ladder of models")
    page.text(
        f"Criterion: {CRITERION}. "
        "Gain: fall of the held-out error against the best model with fewer parameters, with its 95 % interval."
    )
    rows = [
        [
            ("> " if i == found.chosen else "") + r.fit.model.name,
            r.fit.model.parameter_count,
            100 * r.fitted["std"],
            100 * float(np.sqrt(r.mse)),
            f"{100 * r.gain:.1f} % ({100 * r.gain_ci95[0]:.1f} to {100 * r.gain_ci95[1]:.1f}) over {r.gain_over}"
            if r.gain_over
            else "",
            r.criterion,
            r.fit.result.passes,
        ]
        for i, r in enumerate(found.rungs)
    ]
    page.table(["model", "parameters", "NRMSE fitted [%]", "NRMSE held out [%]", "gain on held-out", "criterion", "passes"], rows)
    page.heading("Held-out records, chosen model")
    page.table(
        ["record", "NRMSE std [%]", "NRMSE max [%]", "NRMSE range [%]"],
        [[h.name, *(100 * h.scores()[n] for n in ("std", "max", "range"))] for h in found.best.held_out],
    )


def _parameters(page: Page, found: BenchIdentification) -> None:
    page.heading("Parameters")
    page.table(
        ["parameter", "value", "std", "unit", "status", "meaning", "reason"],
        [[p.name, p.value, p.std, p.unit, p.status, p.meaning, p.reason] for p in found.uncertainty.parameters],
    )
    page.text(f"Identifiability: {found.uncertainty.null_direction}.")
    page.text(
        f"Effective samples {found.uncertainty.effective_samples:.0f} of {found.fit.samples}; condition number of the "
        f"relative information {found.uncertainty.condition:.3g}."
    )
    names = [p.name for p in found.uncertainty.parameters]
    page.text("Correlation of the parameters:")
    page.table(
        ["", *names], [[n, *(f"{v:.2f}" for v in row)] for n, row in zip(names, found.uncertainty.correlation, strict=True)]
    )


def _records(page: Page, found: BenchIdentification) -> None:
    page.heading("Records")
    keys = list(found.noise[0])
    page.table([k.replace("_", " ") for k in keys], [[n[k] for k in keys] for n in found.noise])


def loops(held_out: tuple[HeldOut, ...]) -> Figure:
    """Return hysteresis loops of up to four stretches."""
    shown = held_out[:4]
    figure = Figure(figsize=(4.2 * len(shown), 3.8))
    for i, stretch in enumerate(shown):
        axes = figure.add_subplot(1, len(shown), i + 1)
        part = slice(0, min(stretch.measured.size, 20000))
        axes.plot(1e3 * stretch.displacement[part], stretch.measured[part], color="0.6", lw=1.2, label="measured")
        axes.plot(1e3 * stretch.displacement[part], stretch.modelled[part], color="C3", lw=0.8, label="identified")
        axes.set(xlabel="displacement [mm]", ylabel="force [N]", title=stretch.name[-40:])
        axes.title.set_fontsize(8)
        axes.legend(fontsize=8)
    figure.tight_layout()
    return figure


def traces(stretch: HeldOut) -> Figure:
    """Return measured force, modelled force and residual over time around the largest force."""
    centre = int(np.argmax(np.abs(stretch.measured)))
    part = slice(max(0, centre - 1500), centre + 1500)
    figure = Figure(figsize=(9.0, 4.2))
    upper, lower = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [3, 1]})
    upper.plot(stretch.time_s[part], stretch.measured[part], color="0.6", label="measured")
    upper.plot(stretch.time_s[part], stretch.modelled[part], color="C3", lw=0.9, label="identified")
    upper.set(ylabel="force [N]")
    upper.legend(fontsize=8)
    lower.plot(stretch.time_s[part], (stretch.measured - stretch.modelled)[part], color="C0", lw=0.8)
    lower.set(xlabel="time [s]", ylabel="residual [N]")
    figure.tight_layout()
    return figure


def stiffness_and_loss(found: BenchIdentification) -> Figure:
    """Return K and W of the identified element against frequency for the amplitudes the records cover."""
    fit = found.fit
    stroke = max(float(np.ptp(p.motion.x)) for p in found.prepared)
    rate = 1.0 / min(p.motion.step_s for p in found.prepared)
    duration = max(p.motion.step_s * p.motion.x.size for p in found.prepared)
    frequency = np.geomspace(max(1.0 / duration, 1e-3), 0.2 * rate, 80)
    figure = Figure(figsize=(9.5, 3.8))
    left, right = figure.subplots(1, 2)
    for share in (1.0, 0.3, 0.1, 0.03):
        amplitude = 0.5 * stroke * share
        stiffness = complex_stiffness(fit.model.layout, fit.theta, fit.coefficients, 2 * np.pi * frequency, np.asarray(amplitude))
        left.semilogx(frequency, np.abs(stiffness) * 1e-3, label=f"{1e3 * amplitude:.3g} mm")
        right.loglog(frequency, np.maximum(np.pi * amplitude**2 * stiffness.imag, 1e-12), label=f"{1e3 * amplitude:.3g} mm")
    left.set(xlabel="frequency [Hz]", ylabel="dynamic stiffness [N/mm]")
    right.set(xlabel="frequency [Hz]", ylabel="loss energy per cycle [J]")
    left.legend(fontsize=8, title="amplitude")
    figure.tight_layout()
    return figure


def identification_document(found: BenchIdentification, software: str) -> dict[str, Any]:
    """Return the content of ``identification.json``."""
    best = found.best
    return {
        "schema": "ride_estimation/identification/1",
        "software": software,
        "method": "time domain, variable projection",
        "model": best.fit.model.name,
        "criterion": CRITERION,
        "parameters": [
            {
                "name": p.name,
                "value": p.value,
                "std": p.std,
                "unit": p.unit,
                "status": p.status,
                "reason": p.reason,
                "meaning": p.meaning,
            }
            for p in found.uncertainty.parameters
        ],
        "correlation": [[float(v) for v in row] for row in found.uncertainty.correlation],
        "identifiability": {
            "null_direction": found.uncertainty.null_direction,
            "condition": found.uncertainty.condition,
            "effective_samples": found.uncertainty.effective_samples,
        },
        "parameters_from": "all samples of the records to fit",
        "bounds_hit": [p.name for p in found.uncertainty.parameters if p.status == "at_bound"],
        "nrmse_fitted": best.fitted,
        "validation": [{"run": h.name, **{f"nrmse_{n}": v for n, v in h.scores().items()}} for h in best.held_out],
        "ladder": [
            {
                "model": r.fit.model.name,
                "parameters": r.fit.model.parameter_count,
                "nrmse_fitted": r.fitted["std"],
                "nrmse_held_out": float(np.sqrt(r.mse)),
                "criterion": r.criterion,
                "gain": _number(r.gain),
                "gain_over": r.gain_over or None,
                "gain_ci95": [_number(v) for v in r.gain_ci95],
                "passes": r.fit.result.passes,
                "values": {q.name: float(v) for q, v in zip(r.fit.model.quantities, r.fit.values, strict=True)},
            }
            for r in found.rungs
        ],
        "noise": list(found.noise),
        "residual": found.unexplained,
        "element": found.element,
        "warnings": list(found.warnings),
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
