# Copyright 2026 ride_estimation contributors
"""The report of a diagnosis: verdict, evidence, ladder, rivals, what remains, what to measure next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ride_estimation.diagnosis.result import Calibration, Diagnosis, Evidence, NamedCause
from ride_estimation.reporting.page import Page


def write_diagnosis_report(diagnosis: Diagnosis, run: str, path: Path) -> None:
    """Write the HTML report of a diagnosis.

    Parameters
    ----------
    diagnosis
        What was found.
    run
        Name of the run.
    path
        File to write.
    """
    page = Page(f"Diagnosis of {run}")
    page.verdict(diagnosis.sentence)
    for warning in diagnosis.warnings:
        page.warning(warning)
    for cause in diagnosis.causes:
        _cause(page, cause)
    _gain(page, diagnosis)
    _remaining(page, diagnosis)
    if diagnosis.evidence is not None:
        _evidence(page, diagnosis.evidence)
    _ladder(page, diagnosis)
    _parameters(page, diagnosis)
    if diagnosis.remarks:
        page.heading("What the extended vehicle file holds and what not")
        for remark in diagnosis.remarks:
            page.text(remark)
    page.write(path)


def _cause(page: Page, cause: NamedCause) -> None:
    place = " ".join(part for part in (cause.location, cause.axis) if part)
    page.heading(f"{cause.id.replace('_', ' ')} at {place}")
    page.text(f"{cause.question} Confidence {100 * cause.confidence:.0f} %.")
    page.table(["quantity", "value", "std", "unit"], [[p.name, p.value, p.std, p.unit] for p in cause.parameters])
    if cause.rivals:
        page.text("Rivals:")
        page.table(
            ["rival", "place", "why less likely", "what would separate them"],
            [[r.id, " ".join(x for x in (r.location, r.axis) if x), r.why_less_likely, r.separable_by] for r in cause.rivals],
        )
    page.text(f"Would refute it: {cause.would_refute}.")
    if cause.measure_next:
        page.text(f"To measure next: {cause.measure_next}.")


def _gain(page: Page, diagnosis: Diagnosis) -> None:
    if diagnosis.gain is None:
        return
    page.heading("Gain on data that neither fitted nor selected")
    page.text(f"Metric: {diagnosis.gain.metric}.")
    page.table(
        ["run", "calibrated linear model [%]", "extended model [%]", "noise floor [%]", "gain, 95 % interval [points]"],
        [
            [
                v.run, 100 * v.baseline, 100 * v.extended, 100 * v.noise_floor,
                f"{100 * v.ci95[0]:.2f} to {100 * v.ci95[1]:.2f}",
            ]
            for v in diagnosis.gain.validation
        ],
    )


def _remaining(page: Page, diagnosis: Diagnosis) -> None:
    page.heading("What remains")
    page.text(str(diagnosis.residual.get("words", "")))
    bands = diagnosis.residual.get("bands", [])
    if bands:
        page.table(
            ["band", "residual over noise, calibrated", "residual over noise, extended"],
            [[b["band"], b["baseline"], b["extended"]] for b in bands],
        )


def _ladder(page: Page, diagnosis: Diagnosis) -> None:
    if not diagnosis.ladder:
        return
    page.heading("Ladder of models")
    page.text("Misfit is the mean squared whitened residual (1 = down to the noise); gain is penalised log-likelihood.")
    page.table(
        ["model", "misfit", "gain over the model before [nat]"],
        [[s.model, s.misfit_per_degree, s.log_likelihood] for s in diagnosis.ladder],
    )


def stiffness_words(parameters: Sequence[Calibration]) -> tuple[str, ...]:
    """Say by which factor stiffness over mass of the vehicle file is off, and what that does to natural frequencies.

    Only stiffnesses that differ from the file by more than 5 % and three standard deviations are named. Accelerations tell
    ratios: without an anchor it may as well be the mass that is off the other way.

    Source: document 001, 1.1 Hz instead of 1.5 Hz.
    """
    found = []
    for p in parameters:
        if not (p.name.endswith("stiffness") and p.prior > 0.0 and p.value > 0.0):
            continue
        factor = p.value / p.prior
        if abs(factor - 1.0) > max(0.05, 3.0 * p.std / p.prior):
            found.append(
                f"{p.name}: stiffness over mass must be {factor:.2f} times the vehicle file's; a mode on it alone lies "
                f"{math.sqrt(factor):.2f} times as high"
            )
    return tuple(found)


def _parameters(page: Page, diagnosis: Diagnosis) -> None:
    if not diagnosis.parameters:
        return
    page.heading("Calibrated parameters")
    for words in stiffness_words(diagnosis.parameters):
        page.text(words + ".")
    page.table(
        ["parameter", "value", "std", "unit", "vehicle file"],
        [[p.name, p.value, p.std, p.unit, p.prior] for p in diagnosis.parameters],
    )


def _evidence(page: Page, evidence: Evidence) -> None:
    page.heading("Evidence")
    page.figure(residual_spectrum(evidence), "Spectrum of the residual against the spectrum that sensor noise predicts")
    page.figure(
        cumulated_periodogram(evidence), "Cumulated periodogram of the residual over the noise; straight for a right model"
    )
    page.figure(residual_over_time(evidence), "Misfit over the run; 1 = down to the noise")
    if evidence.loops:
        page.figure(loops(evidence), "Force over deflection: linear part and with what was found")
    page.figure(stretch(evidence), "Measured and modelled, the channel with the largest misfit")
    page.table(
        ["channel", "calibrated [%]", "extended [%]", "noise floor [%]"],
        [[name, *(100 * float(v) for v in row)] for name, row in zip(evidence.channel_names, evidence.channel_nrmse)],
    )


def residual_spectrum(evidence: Evidence) -> Figure:
    """Draw residual and noise spectra."""
    figure = Figure(figsize=(9, 3.6))
    axes = figure.add_subplot()
    width = max(len(evidence.frequency_hz) // 300, 1)
    kernel = np.ones(width) / width
    for values, label, style in (
        (evidence.residual_power, "calibrated linear model", "C3"),
        (evidence.extended_power, "extended model", "C0"),
        (evidence.noise_power, "predicted noise", "k--"),
    ):
        axes.loglog(evidence.frequency_hz, np.convolve(values, kernel, mode="same"), style, lw=1.0, label=label)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("power per bin, all channels")
    axes.legend()
    axes.grid(alpha=0.3)
    return figure


def cumulated_periodogram(evidence: Evidence) -> Figure:
    """Draw the cumulated whitened periodogram of both models."""
    figure = Figure(figsize=(9, 3.0))
    axes = figure.add_subplot()
    noise = np.maximum(evidence.noise_power, 1e-300)
    for values, label, style in (
        (evidence.residual_power, "calibrated linear model", "C3"), (evidence.extended_power, "extended model", "C0"),
    ):
        axes.plot(evidence.frequency_hz, np.cumsum(values / noise) / len(noise), style, label=label)
    axes.plot(evidence.frequency_hz, np.arange(len(noise)) / len(noise), "k--", label="noise alone")
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("cumulated share")
    axes.legend()
    axes.grid(alpha=0.3)
    return figure


def residual_over_time(evidence: Evidence) -> Figure:
    """Draw the misfit of every block."""
    figure = Figure(figsize=(9, 2.6))
    axes = figure.add_subplot()
    axes.plot(evidence.block_time_s, evidence.block_misfit[:, 0], "C3.-", label="calibrated linear model")
    axes.plot(evidence.block_time_s, evidence.block_misfit[:, 1], "C0.-", label="extended model")
    axes.axhline(1.0, color="k", ls="--", lw=0.8)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("misfit")
    axes.legend()
    axes.grid(alpha=0.3)
    return figure


def loops(evidence: Evidence) -> Figure:
    """Draw the force of every mount axis over its deflection."""
    count = len(evidence.loops)
    columns = min(count, 3)
    rows = -(-count // columns)
    figure = Figure(figsize=(3.4 * columns, 2.5 * rows))
    for number, (name, (x, linear, total)) in enumerate(evidence.loops.items(), start=1):
        axes = figure.add_subplot(rows, columns, number)
        axes.plot(1e3 * x, total, "C0", lw=0.6, label="with cause")
        axes.plot(1e3 * x, linear, "C3", lw=0.6, label="linear part")
        axes.set_title(name, fontsize=8)
        axes.tick_params(labelsize=7)
        axes.set_xlabel("deflection [mm]", fontsize=7)
        axes.set_ylabel("force [N]", fontsize=7)
    figure.tight_layout()
    return figure


def stretch(evidence: Evidence) -> Figure:
    """Draw a few seconds of the channel with the largest relative misfit."""
    figure = Figure(figsize=(9, 3.2))
    axes = figure.add_subplot()
    excess = evidence.channel_nrmse[:, 0] / np.maximum(evidence.channel_nrmse[:, 2], 1e-12)
    name = evidence.channel_names[int(np.argmax(excess))]
    time_s, measured, baseline, extended = evidence.stretch[name]
    axes.plot(time_s, measured, "k", lw=1.0, label="measured")
    axes.plot(time_s, baseline, "C3", lw=0.8, label="calibrated linear model")
    axes.plot(time_s, extended, "C0", lw=0.8, label="extended model")
    axes.set_title(name, fontsize=9)
    axes.set_xlabel("time [s]")
    axes.legend(loc="upper right")
    axes.grid(alpha=0.3)
    return figure
