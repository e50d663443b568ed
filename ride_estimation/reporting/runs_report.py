# Copyright 2026 ride_estimation contributors
"""Several replays side by side: which run stands out, in data, parameters and loads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ride_estimation.frames import AXES
from ride_estimation.io.result_files import FinishedReplay
from ride_estimation.reporting.page import Page
from ride_estimation.reporting.replay_plots import spectrum

Array = NDArray[np.float64]

#: distance from the median of the runs, in robust standard deviations and at least in own ones, that is pointed out
OUTLIER = 4.0


def write_runs_report(path: Path, runs: Sequence[FinishedReplay]) -> list[str]:
    """Write a page that compares replays and return the sentences about runs that stand out.

    Parameters
    ----------
    path
        File to write.
    runs
        At least one.
    """
    page = Page(f"{len(runs)} runs side by side")
    findings = outliers(runs)
    for text in findings:
        page.warning(text)
    page.heading("Runs")
    page.table(
        ["run", "recording", "vehicle", "duration [s]", "valid ticks [%]", "warnings", "digest"],
        [
            [r.name, r.result["run"]["path"], r.result["vehicle"]["name"], float(r.result["run"]["duration_s"]),
             100.0 * float(np.mean(r.valid)), len(r.result["warnings"]), r.result["digest"][:16]]
            for r in runs
        ],
    )  # fmt: skip
    page.heading("Parameters")
    page.text("Value ± standard deviation per run; in brackets where the status is not valid.")
    names = list(dict.fromkeys(p["name"] for r in runs for p in r.result["parameters"]))
    page.table(["parameter", *(r.name for r in runs)], [[n, *(_parameter(r, n) for r in runs)] for n in names])
    page.heading("Loads")
    page.text("Root mean square about the mean and largest deviation from the mean of the force on the body [N].")
    mounts = list(dict.fromkeys(m for r in runs for m in r.mount_names))
    page.table(
        ["mount", "axis", *(r.name for r in runs)],
        [[m, axis, *(_load(r, m, i) for r in runs)] for m in mounts for i, axis in enumerate(AXES)],
    )
    page.heading("Spectra")
    for mount in mounts:
        page.figure(_force_spectra(runs, mount), f"Force on the body by mount {mount}")
    page.write(path)
    return findings


def outliers(runs: Sequence[FinishedReplay]) -> list[str]:
    """Return a sentence per valid parameter whose value in one run is far from the others, given their uncertainty."""
    found = []
    names = dict.fromkeys(p["name"] for r in runs for p in r.result["parameters"])
    for name in names:
        known = [(r, p) for r in runs for p in r.result["parameters"] if p["name"] == name and p["status"] == "valid"]
        values = np.array([p["value"] for _, p in known], dtype=float)
        if len(values) < 3:
            continue
        middle = float(np.median(values))
        spread = 1.4826 * float(np.median(np.abs(values - middle)))
        for run, p in known:
            distance = abs(p["value"] - middle)
            if distance > OUTLIER * max(spread, float(p["std"])) and distance > 0.02 * abs(middle):
                unit = p["unit"]
                found.append(
                    f"{run.name}: {name} is {p['value']:.4g} {unit}, the median of {len(known)} runs is {middle:.4g} {unit}"
                )
    return found


def _parameter(run: FinishedReplay, name: str) -> str:
    for p in run.result["parameters"]:
        if p["name"] == name:
            std = "?" if p["std"] is None else f"{p['std']:.2g}"
            text = f"{p['value']:.4g} ± {std} {p['unit']}"
            return text if p["status"] == "valid" else f"({text}: {p['status']})"
    return ""


def _load(run: FinishedReplay, mount: str, axis: int) -> str:
    if mount not in run.mount_names or not np.any(run.valid):
        return ""
    force = run.mount_force[run.valid, run.mount_names.index(mount), axis]
    swing = force - force.mean()
    return f"{np.sqrt(np.mean(swing**2)):.4g} / {np.max(np.abs(swing)):.4g}"


def _force_spectra(runs: Sequence[FinishedReplay], mount: str) -> Figure:
    figure = Figure(figsize=(11, 3.4))
    axes = figure.subplots(1, 3)
    for i, axis in enumerate(AXES):
        for run in runs:
            if mount in run.mount_names and np.sum(run.valid) >= 64:
                force = run.mount_force[run.valid, run.mount_names.index(mount), i]
                frequency, density = spectrum(force, run.time_s)
                axes[i].loglog(frequency, np.sqrt(density), linewidth=0.9, label=run.name)
        axes[i].minorticks_off()
        axes[i].set_title(axis, fontsize=9)
        axes[i].set_xlabel("frequency [Hz]")
    axes[0].set_ylabel("N/√Hz")
    if axes[0].get_legend_handles_labels()[0]:
        axes[0].legend(fontsize=7)
    figure.subplots_adjust(left=0.07, right=0.98, bottom=0.16, top=0.9, wspace=0.25)
    return figure
