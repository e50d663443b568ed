# Copyright 2026 ride_estimation contributors
"""The report of a diagnosis: verdict, cause, gain, evidence, ladder, rivals, what remains, what to measure next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ride_estimation.diagnosis.result import Calibration, Diagnosis, Evidence, NamedCause
from ride_estimation.diagnosis.wording import in_reading_unit, rounded, title
from ride_estimation.reporting.numbers import plain
from ride_estimation.reporting.page import Digits, Page
from ride_estimation.reporting.replay_plots import frequency_axis, legend_above
from ride_estimation.signals.recording import run_title


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
    page = Page(f"Diagnosis of {run_title(run)}")
    page.verdict(diagnosis.sentence)
    for warning in diagnosis.warnings:
        if warning not in diagnosis.isolability and warning not in diagnosis.sentence:
            page.warning(warning)
    for cause in diagnosis.causes:
        _cause(page, cause)
    _gain(page, diagnosis)
    if diagnosis.evidence is not None:
        _evidence(page, diagnosis.evidence)
    _ladder(page, diagnosis)
    _rivals(page, diagnosis)
    _isolability(page, diagnosis)
    _remaining(page, diagnosis)
    _next(page, diagnosis)
    _parameters(page, diagnosis)
    if diagnosis.remarks:
        page.heading("What the extended vehicle file holds and what not")
        for remark in diagnosis.remarks:
            page.text(f"{remark[0].upper()}{remark[1:]}.")
    page.write(path)


def _title(cause: NamedCause) -> str:
    words = title(cause.id, cause.location, cause.axis)
    return f"{words[0].upper()}{words[1:]}"


def _cause(page: Page, cause: NamedCause) -> None:
    page.heading(_title(cause))
    sure = f"{100 * cause.confidence:.0f} %"
    doubt = f"The best candidate, but rather not: confidence {sure}."
    page.text(f"{cause.question} {f'With {sure} confidence, yes.' if cause.confidence >= 0.5 else doubt}")
    rows = []
    for p in cause.parameters:
        value, std, unit = in_reading_unit(p.value, p.std, p.unit)
        rows.append([p.name, *map(Digits, rounded(value, std)), "" if unit == "-" else unit])
    page.table(["quantity", "value", "std", "unit"], rows)


def _gain(page: Page, diagnosis: Diagnosis) -> None:
    if diagnosis.gain is None:
        return
    page.heading("Gain on data that neither fitted nor selected")
    page.text(f"Metric: {diagnosis.gain.metric}.")
    page.table(
        ["run", "calibrated linear model [%]", "extended model [%]", "noise floor [%]", "gain, 95 % interval [points]"],
        [
            [
                run_title(v.run), f"{100 * v.baseline:.1f}", f"{100 * v.extended:.1f}", f"{100 * v.noise_floor:.1f}",
                f"{100 * v.ci95[0]:.1f} to {100 * v.ci95[1]:.1f}",
            ]
            for v in diagnosis.gain.validation
        ],
    )


def _rivals(page: Page, diagnosis: Diagnosis) -> None:
    rows = [
        [_title(cause), title(r.id, r.location, r.axis), r.why_less_likely, r.separable_by or "not close"]
        for cause in diagnosis.causes
        for r in cause.rivals
    ]
    if rows:
        page.heading("Rivals")
        page.table(["named", "rival", "why less likely", "what would separate them"], rows)


def _isolability(page: Page, diagnosis: Diagnosis) -> None:
    if not diagnosis.causes and not diagnosis.isolability:
        return
    page.heading("What this run cannot tell apart")
    for words in diagnosis.isolability:
        page.text(f"{words[0].upper()}{words[1:]}.")
    if not diagnosis.isolability:
        page.text("None of the causes that were fitted comes near the named ones.")


def _remaining(page: Page, diagnosis: Diagnosis) -> None:
    page.heading("What remains")
    words = str(diagnosis.residual.get("words", ""))
    page.text(f"{words[:1].upper()}{words[1:]}{'' if words.endswith('.') else '.'}")
    bands = diagnosis.residual.get("bands", [])
    if bands:
        page.table(
            ["band", "residual over noise, calibrated", "residual over noise, extended"],
            [[b["band"], f"{b['baseline']:.2f}", f"{b['extended']:.2f}"] for b in bands],
        )


def _next(page: Page, diagnosis: Diagnosis) -> None:
    if not diagnosis.causes:
        return
    page.heading("What to measure next")
    for cause in diagnosis.causes:
        page.text(f"{_title(cause)} would be refuted by {cause.would_refute}.")
        if cause.measure_next:
            page.text(f"To make sure: {cause.measure_next}.")


def _ladder(page: Page, diagnosis: Diagnosis) -> None:
    if not diagnosis.ladder:
        return
    page.heading("Ladder of models")
    if all(math.isfinite(s.misfit_per_degree) for s in diagnosis.ladder):
        page.text(
            "Misfit is the mean squared residual over the noise (1 = down to the noise). The gain in evidence is the penalised "
            "log-likelihood over the model without the last cause of the row: 3 are worth a word, 10 leave little doubt."
        )
        header, values = "misfit", [f"{s.misfit_per_degree:.2f}" for s in diagnosis.ladder]
    else:
        page.text("The error is that on samples that were not fitted; the gain in evidence is penalised log-likelihood.")
        header, values = "error [%]", [f"{100 * s.nrmse:.2f}" for s in diagnosis.ladder]
    page.table(
        ["model", header, "gain in evidence [nat]"],
        [
            [s.model, v, f"{s.log_likelihood + 0.0:.{1 if abs(s.log_likelihood) < 100.0 else 0}f}"]
            for s, v in zip(diagnosis.ladder, values)
        ],
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
        [
            [p.name, *map(Digits, rounded(p.value, p.std)), p.unit, Digits(plain(p.prior)) if math.isfinite(p.prior) else ""]
            for p in diagnosis.parameters
        ],
    )


def _evidence(page: Page, evidence: Evidence) -> None:
    page.heading("Evidence")
    page.figure(residual_spectrum(evidence), "Spectrum of the residual against the spectrum that sensor noise predicts")
    page.figure(
        cumulated_periodogram(evidence), "Cumulated periodogram of the residual over the noise; straight for a right model"
    )
    page.figure(residual_over_time(evidence), "Misfit over the run; 1 = down to the noise")
    if evidence.loops:
        words = "Force over deflection; measured: the extended model and what it leaves of the readings"
        page.figure(loops(evidence), words if len(evidence.loops) == 1 else f"{words}, split among the mounts")
    page.figure(stretch(evidence), "Measured and modelled, the channel with the largest misfit")
    page.text("Error of every channel over the whole run that was fitted:")
    page.table(
        ["channel", "calibrated [%]", "extended [%]", "noise floor [%]"],
        [[name, *(f"{100 * float(v):.1f}" for v in row)] for name, row in zip(evidence.channel_names, evidence.channel_nrmse)],
    )


def _printed(unit: str) -> str:
    return unit.replace("^2", "²")


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
    frequency_axis(axes)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel(f"power per bin, all channels [({_printed(evidence.unit)})²]")
    legend_above(axes)
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
    axes.set_ylabel("cumulated share [-]")
    legend_above(axes)
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
    axes.set_ylabel("misfit [-]")
    legend_above(axes)
    axes.grid(alpha=0.3)
    return figure


def loops(evidence: Evidence) -> Figure:
    """Draw the force of every mount axis over its deflection."""
    count = len(evidence.loops)
    columns = min(count, 3)
    rows = -(-count // columns)
    figure = Figure(figsize=(max(3.4 * columns, 6.0), 2.5 * rows if columns > 1 else 4.0))
    for number, (name, (x, *forces)) in enumerate(evidence.loops.items(), start=1):
        axes = figure.add_subplot(rows, columns, number)
        styles = (("C3", "calibrated linear model"), ("C0", "extended model"))
        axes.plot(1e3 * x, forces[2], "k", lw=1.4, alpha=0.4, label="measured")
        for force, (colour, label) in zip(forces, styles):
            axes.plot(1e3 * x, force, colour, lw=0.6, label=label)
        axes.set_title(name, fontsize=8)
        axes.tick_params(labelsize=7)
        axes.set_xlabel("deflection [mm]", fontsize=7)
        axes.set_ylabel("force [N]", fontsize=7)
        axes.xaxis.set_major_locator(MaxNLocator(5))
        if number == 1:
            axes.legend(fontsize=6, loc="upper left")
    figure.tight_layout()
    return figure


def stretch(evidence: Evidence) -> Figure:
    """Draw a few seconds of the channel with the largest relative misfit, and what both models leave of it."""
    figure = Figure(figsize=(9, 4.4))
    axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    excess = evidence.channel_nrmse[:, 0] / np.maximum(evidence.channel_nrmse[:, 2], 1e-12)
    name = evidence.channel_names[int(np.argmax(excess))]
    time_s, measured, baseline, extended = evidence.stretch[name]
    axes.plot(time_s, measured, "k", lw=1.0, label="measured")
    for values, label, style in ((baseline, "calibrated linear model", "C3"), (extended, "extended model", "C0")):
        axes.plot(time_s, values, style, lw=0.8, label=label)
        below.plot(time_s, measured - values, style, lw=0.8)
    axes.set_title(name, fontsize=9, loc="left")
    axes.set_ylabel(f"reading, mean removed\n[{_printed(evidence.unit)}]")
    below.set_ylabel(f"difference\n[{_printed(evidence.unit)}]")
    below.set_xlabel("time [s]")
    legend_above(axes)
    for one in (axes, below):
        one.grid(alpha=0.3)
    return figure
