# Copyright 2026 ride_estimation contributors
"""The report of a diagnosis: verdict, cause, gain, evidence, ladder, rivals, what remains, what to measure next."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ride_estimation.diagnosis.answer.result import Calibration, Diagnosis, Evidence, NamedCause
from ride_estimation.diagnosis.common.wording import in_reading_unit, rounded, title
from ride_estimation.reporting.numbers import plain, reading_unit
from ride_estimation.reporting.page import Digits, Page
from ride_estimation.reporting.replay_plots import frequency_axis, legend_above
from ride_estimation.signals.recording import run_title

_MEASURED, _LINEAR, _EXTENDED = "#8c959f", "#cf222e", "#0969da"


@dataclasses.dataclass(frozen=True)
class Truth:
    """What a simulated run was made with, to be shown beside what was found.

    Attributes
    ----------
    sentence
        The hidden effect in words.
    values
        ``<mount>.<axis>.<parameter>`` -> true value, SI.
    """

    sentence: str
    values: Mapping[str, float]


def write_diagnosis_report(diagnosis: Diagnosis, run: str, path: Path, truth: Truth | None = None) -> None:
    """Write the HTML report of a diagnosis.

    Parameters
    ----------
    diagnosis
        What was found.
    run
        Name of the run.
    path
        File to write.
    truth
        Of a simulated run.
    """
    values = {} if truth is None else truth.values
    page = Page(f"Diagnosis of {run_title(run)}")
    page.verdict(diagnosis.sentence)
    if truth is not None:
        page.text(f"The truth of this simulated run: {truth.sentence}.")
    _answer(page, diagnosis, values)
    if diagnosis.evidence is not None and diagnosis.evidence.loops:
        port = leading_port(diagnosis, diagnosis.evidence)
        page.figure(
            large_loop(diagnosis.evidence, port), f"{port}: force over deflection, and what the linear model lacks over the rate",
            tight=False,
        )  # fmt: skip
    shown = [w for w in diagnosis.warnings if w not in diagnosis.isolability and w not in diagnosis.sentence]
    if shown:
        page.heading("Warnings")
    for warning in shown:
        page.warning(warning)
    _rivals(page, diagnosis)
    _isolability(page, diagnosis)
    _stability(page, diagnosis)
    _next(page, diagnosis)
    if diagnosis.evidence is not None:
        _evidence(page, diagnosis, diagnosis.evidence)
    _ladder(page, diagnosis)
    _remaining(page, diagnosis)
    _parameters(page, diagnosis, values)
    if diagnosis.remarks:
        page.heading("What the extended vehicle file holds and what not")
        for remark in diagnosis.remarks:
            page.text(f"{remark[0].upper()}{remark[1:]}.")
    page.write(path)


def _title(cause: NamedCause) -> str:
    words = title(cause.id, cause.location, cause.axis)
    return f"{words[0].upper()}{words[1:]}"


def _answer(page: Page, diagnosis: Diagnosis, truth: Mapping[str, float]) -> None:
    """Add the named causes and the gain, side by side."""
    parts: dict[str, tuple[Sequence[str], list[list[object]]]] = {}
    for cause in diagnosis.causes:
        rows: list[list[object]] = []
        for p in cause.parameters:
            value, std, unit = in_reading_unit(p.value, p.std, p.unit)
            known = truth.get(f"{cause.location}.{cause.axis}.{p.name}")
            factor = value / p.value if p.value else 1.0
            beside = [] if not truth else ["" if known is None else Digits(plain(factor * known))]
            rows.append([p.name, *map(Digits, rounded(value, std)), *beside, "" if unit == "-" else unit])
        sure = f"{100 * cause.confidence:.0f} %"
        doubt = "" if cause.confidence >= 0.5 else "; the best candidate, but rather not"
        head = ["quantity", "value", "std", *(["truth"] if truth else []), "unit"]
        parts[f"{_title(cause)} (confidence {sure}{doubt})"] = (head, rows)
    if parts:
        page.beside(parts)
    if diagnosis.gain is not None and diagnosis.gain.validation:
        page.beside({"Error on validation data [%]": (
            ["run", "linear", "extended", "noise floor", "gain, 95 % interval"],
            [
                [
                    run_title(v.run), *(Digits(f"{100 * e:.1f}") for e in (v.baseline, v.extended, v.noise_floor)),
                    Digits(f"{100 * v.ci95[0]:.1f} to {100 * v.ci95[1]:.1f}"),
                ]
                for v in diagnosis.gain.validation
            ],
        )})  # fmt: skip
    for cause in diagnosis.causes:
        page.text(f"Question of this cause: {cause.question}")
    if diagnosis.gain is not None:
        page.text(f"Error: {diagnosis.gain.metric}. Linear: the calibrated linear model.")


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
    page.heading("What this run cannot distinguish")
    for words in diagnosis.isolability:
        page.text(f"{words[0].upper()}{words[1:]}.")
    if not diagnosis.isolability:
        page.text("None of the causes that were fitted comes near the named ones.")


def _stability(page: Page, diagnosis: Diagnosis) -> None:
    if diagnosis.stability is None:
        return
    page.heading("Perturbed copies of the run")
    said = {True: "the same", False: "another: ", None: "none: "}
    page.table(["copy", "answer"], [[c.change, f"{said[c.agrees]}{c.found}"] for c in diagnosis.stability.copies])
    page.text("The share of run and copies with this answer is part of the confidence.")


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
    if diagnosis.next_run is not None:
        page.text(diagnosis.next_run.sentence)
        page.table(
            ["run, simulated with both", f"right if {diagnosis.next_run.first}", f"right if {diagnosis.next_run.second}"],
            [[c.words, f"{100 * c.first:.0f} %", f"{100 * c.second:.0f} %"] for c in diagnosis.next_run.tried],
        )


def _ladder(page: Page, diagnosis: Diagnosis) -> None:
    if not diagnosis.ladder:
        return
    page.heading("Ladder of models")
    if all(math.isfinite(s.misfit_per_degree) for s in diagnosis.ladder):
        page.text(
            "Misfit is the mean squared residual over the noise (1 = down to the noise). The gain in evidence is the penalised "
            "log-likelihood over the model without the last cause of the row: 3 = weak evidence, 10 = strong evidence."
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
                f"{p.name}: k/m is {factor:.2f} times the value of the vehicle file (natural frequency of a mode on it alone: "
                f"times {math.sqrt(factor):.2f})"
            )
    return tuple(found)


def _parameters(page: Page, diagnosis: Diagnosis, truth: Mapping[str, float]) -> None:
    if not diagnosis.parameters:
        return
    page.heading("Calibrated parameters")
    for words in stiffness_words(diagnosis.parameters):
        page.text(words + ".")
    rows: list[list[object]] = []
    for p in diagnosis.parameters:
        unit, factor = reading_unit(p.unit)
        shown = [*map(Digits, rounded(factor * p.value, factor * p.std)), unit, _digits(factor * p.prior)]
        rows.append([p.name, *shown, *([_digits(factor * truth.get(p.name, math.nan))] if truth else []), p.status])
    page.table(["parameter", "value", "std", "unit", "vehicle file", *(["truth"] if truth else []), "status"], rows)
    if any(p.status == "suspect" for p in diagnosis.parameters):
        page.text("Suspect: no cause explains what is left in this run; the value may make up for it, its std does not say so.")


def _digits(value: float) -> Digits:
    return Digits(plain(value) if math.isfinite(value) else "")


def leading_port(diagnosis: Diagnosis, evidence: Evidence) -> str:
    """Return the mount axis whose loop says most: that of the first named cause, else where the linear model lacks most force."""
    for cause in diagnosis.causes:
        if f"{cause.location}.{cause.axis}" in evidence.loops:
            return f"{cause.location}.{cause.axis}"
    lack = {name: float(np.std(measured - linear)) for name, (_, linear, _, measured) in evidence.loops.items()}
    return max(lack, key=lambda name: lack[name])


def _evidence(page: Page, diagnosis: Diagnosis, evidence: Evidence) -> None:
    page.heading("Evidence")
    page.figure(
        residual_spectrum(evidence), "Spectrum of the residual against the spectrum that sensor noise predicts", tight=False
    )
    page.figure(
        cumulated_periodogram(evidence), "Cumulative periodogram of the residual over the noise; straight for a right model",
        tight=False,
    )
    page.figure(residual_over_time(evidence), "Misfit over the run; 1 = down to the noise", tight=False)
    if len(evidence.loops) > 1:
        axis = leading_port(diagnosis, evidence).rpartition(".")[2]
        page.figure(
            loops(evidence, axis), f"Force over deflection of every mount along {axis}; measured: the extended model and what it "
            "leaves of the readings, split among the mounts", tight=False,
        )  # fmt: skip
    page.figure(stretch(evidence), "Measured and modelled, the channel with the largest misfit", tight=False)
    page.text("Error of every channel over the whole run that was fitted:")
    page.table(
        ["channel", "calibrated [%]", "extended [%]", "noise floor [%]"],
        [[name, *(f"{100 * float(v):.1f}" for v in row)] for name, row in zip(evidence.channel_names, evidence.channel_nrmse)],
    )


def _printed(unit: str) -> str:
    return unit.replace("^2", "²")


def residual_spectrum(evidence: Evidence) -> Figure:
    """Draw residual and noise spectra."""
    figure = Figure(figsize=(11, 3.6))
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
    axes.set_ylabel(f"power per bin, all channels{' but gyros' if evidence.rates else ''} [({_printed(evidence.unit)})²]")
    legend_above(axes)
    axes.grid(alpha=0.3)
    figure.subplots_adjust(left=0.08, right=0.99, bottom=0.14, top=0.93)
    return figure


def cumulated_periodogram(evidence: Evidence) -> Figure:
    """Draw the cumulated whitened periodogram of both models."""
    figure = Figure(figsize=(11, 3.0))
    axes = figure.add_subplot()
    noise = np.maximum(evidence.noise_power, 1e-300)
    for values, label, style in (
        (evidence.residual_power, "calibrated linear model", "C3"), (evidence.extended_power, "extended model", "C0"),
    ):
        axes.plot(evidence.frequency_hz, np.cumsum(values / noise) / len(noise), style, label=label)
    axes.plot(evidence.frequency_hz, np.arange(len(noise)) / len(noise), "k--", label="noise alone")
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("cumulative share [-]")
    legend_above(axes)
    axes.grid(alpha=0.3)
    figure.subplots_adjust(left=0.08, right=0.99, bottom=0.16, top=0.92)
    return figure


def residual_over_time(evidence: Evidence) -> Figure:
    """Draw the misfit of every block."""
    figure = Figure(figsize=(11, 2.6))
    axes = figure.add_subplot()
    axes.plot(evidence.block_time_s, evidence.block_misfit[:, 0], "C3.-", label="calibrated linear model")
    axes.plot(evidence.block_time_s, evidence.block_misfit[:, 1], "C0.-", label="extended model")
    axes.axhline(1.0, color="k", ls="--", lw=0.8)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("misfit [-]")
    legend_above(axes)
    axes.grid(alpha=0.3)
    figure.subplots_adjust(left=0.08, right=0.99, bottom=0.19, top=0.9)
    return figure


def large_loop(evidence: Evidence, port: str) -> Figure:
    """Draw the loop that must convince: force over deflection, and what the linear model lacks of it over the rate.

    A dry friction is a step over the rate, a nonlinear damping a bent curve there; a hardening bends the loop.

    Parameters
    ----------
    evidence
        Numbers of the diagnosis.
    port
        Key of its loops.
    """
    figure = Figure(figsize=(11, 4.8))
    left, right = figure.subplots(1, 2)
    x, linear, extended, measured = evidence.loops[port]
    _loop(left, evidence, port, 1.0)
    left.legend(fontsize=8, loc="upper left")
    times = next(iter(evidence.stretch.values()))[0]
    rate = 1e3 * np.gradient(x) / max(float(np.median(np.diff(times))), 1e-9)
    right.plot(rate, measured - linear, ".", color=_MEASURED, ms=3, label="measured minus linear")
    right.plot(rate, extended - linear, ".", color=_EXTENDED, ms=2.4, label="extended minus linear")
    right.axhline(0.0, color=_LINEAR, lw=1.2)
    right.set_xlabel("rate [mm/s]")
    right.set_ylabel("force the linear model lacks [N]")
    right.legend(fontsize=8, loc="upper left")
    right.grid(alpha=0.3)
    figure.subplots_adjust(left=0.07, right=0.99, bottom=0.12, top=0.96, wspace=0.18)
    return figure


def loops(evidence: Evidence, axis: str) -> Figure:
    """Draw the force of every mount along one axis over its deflection."""
    names = [name for name in evidence.loops if name.rpartition(".")[2] == axis]
    columns = min(len(names), 4)
    rows = -(-len(names) // columns)
    height = 0.6 + 2.7 * rows
    figure = Figure(figsize=(11, height))
    for number, name in enumerate(names, start=1):
        axes = figure.add_subplot(rows, columns, number)
        _loop(axes, evidence, name, 0.6)
        axes.set_title(name, fontsize=9)
        if number == 1:
            axes.legend(fontsize=6, loc="upper left")
    figure.subplots_adjust(left=0.07, right=0.99, bottom=0.55 / height, top=1.0 - 0.3 / height, wspace=0.32, hspace=0.5)
    return figure


def _loop(axes: Axes, evidence: Evidence, port: str, width: float) -> None:
    x, linear, extended, measured = evidence.loops[port]
    axes.plot(1e3 * x, 1e-3 * measured, color=_MEASURED, lw=2.0 * width, label="measured")
    axes.plot(1e3 * x, 1e-3 * linear, color=_LINEAR, lw=width, label="linear")
    axes.plot(1e3 * x, 1e-3 * extended, color=_EXTENDED, lw=width, label="extended")
    axes.set_xlabel("deflection [mm]")
    axes.set_ylabel("force [kN]")
    axes.grid(alpha=0.3)


def stretch(evidence: Evidence) -> Figure:
    """Draw a few seconds of the channel with the largest relative misfit, and what both models leave of it."""
    figure = Figure(figsize=(11, 4.4))
    axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    excess = evidence.channel_nrmse[:, 0] / np.maximum(evidence.channel_nrmse[:, 2], 1e-12)
    name = evidence.channel_names[int(np.argmax(excess))]
    time_s, measured, baseline, extended = evidence.stretch[name]
    axes.plot(time_s, measured, "k", lw=1.0, label="measured")
    for values, label, style in ((baseline, "calibrated linear model", "C3"), (extended, "extended model", "C0")):
        axes.plot(time_s, values, style, lw=0.8, label=label)
        below.plot(time_s, measured - values, style, lw=0.8)
    axes.set_title(name, fontsize=9, loc="left")
    unit = "rad/s" if name in evidence.rates else _printed(evidence.unit)
    axes.set_ylabel(f"reading, mean removed\n[{unit}]")
    below.set_ylabel(f"difference\n[{unit}]")
    below.set_xlabel("time [s]")
    legend_above(axes)
    for one in (axes, below):
        one.grid(alpha=0.3)
    figure.subplots_adjust(left=0.08, right=0.99, bottom=0.11, top=0.94)
    return figure
