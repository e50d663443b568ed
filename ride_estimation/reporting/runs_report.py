# Copyright 2026 ride_estimation contributors
"""Several replays side by side: which run stands out, in data, parameters and loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ride_estimation.frames import AXES
from ride_estimation.io.result_files import FinishedReplay
from ride_estimation.io.run_metrics import Metric, best_parameters, run_metrics
from ride_estimation.reporting.differences import add_differences, replay_differences
from ride_estimation.reporting.numbers import plain, with_std
from ride_estimation.reporting.outliers import LEAST_RUNS, OUTLIER, find_outliers, run_sentence
from ride_estimation.reporting.page import Page
from ride_estimation.reporting.replay_plots import frequency_axis, spectrum

Array = NDArray[np.float64]


def runs_page(runs: Sequence[FinishedReplay]) -> tuple[Page, list[str]]:
    """Return the page that compares replays and the sentences about runs that stand out.

    Parameters
    ----------
    runs
        At least one, with names that differ.
    """
    page = Page(f"{len(runs)} runs side by side")
    pair, said = replay_differences(runs[0].result, runs[1].result) if len(runs) == 2 else ([], "")
    metrics = [(run.name, run_metrics(run.result)) for run in runs]
    outliers = find_outliers(metrics)
    findings = [said] if said else [outlier.sentence() for outlier in outliers]
    none = "No outlier." if len(runs) >= LEAST_RUNS else f"Outlier detection needs at least {LEAST_RUNS} runs."
    page.verdict(said or (f"{len({o.run for o in outliers})} of {len(runs)} runs are outliers." if outliers else none))
    for name in dict.fromkeys(o.run for o in outliers):
        page.warning(run_sentence(name, [o for o in outliers if o.run == name], len(outliers)))
    page.heading("Runs")
    page.table(
        ["run", "recording", "vehicle", "duration [s]", "valid ticks [%]", "warnings", "digest"],
        [
            [r.name, r.result["run"]["path"], r.result["vehicle"]["name"], float(r.result["run"]["duration_s"]),
             100.0 * float(np.mean(r.valid)), len(r.result["warnings"]), r.result["digest"][:16]]
            for r in runs
        ],
    )  # fmt: skip
    warned = [[r.name, str(text)] for r in runs for text in r.result["warnings"]]
    if warned:
        page.table(["run", "warning"], warned)
    vehicles = {str(r.result["vehicle"].get("checksum", "")) for r in runs}
    if len(vehicles) > 1:
        page.warning("The vehicle files of the runs differ: parameters that rest on priors may differ for that alone.")
    if len(runs) == 2:
        page.heading("Before and after")
        add_differences(page, pair, (runs[0].name, runs[1].name))
    page.heading("Parameters")
    page.text("Value ± standard deviation per run; in brackets where the status is not valid.")
    names = list(dict.fromkeys(p["name"] for r in runs for p in r.result["parameters"]))
    page.table(["parameter", *(r.name for r in runs)], [[n, *(_parameter(r, n) for r in runs)] for n in names])
    page.heading("Data, durability and comfort")
    page.text(f"An asterisk marks a value farther than {OUTLIER:g} robust standard deviations from the median of the runs.")
    odd = {(o.run, o.metric.name) for o in outliers}
    other = list(dict.fromkeys(name for _, found in metrics for name in found if name not in names))
    rows = []
    for name in other:
        unit = next(found[name].unit for _, found in metrics if name in found)
        rows.append([f"{name} [{unit}]", *(_metric(found.get(name), (run, name) in odd) for run, found in metrics)])
    page.table(["metric", *(r.name for r in runs)], rows)
    page.heading("Loads")
    page.text("Force on the body [N]: rms about the mean / peak (max |F - mean|).")
    mounts = list(dict.fromkeys(m for r in runs for m in r.mount_names))
    page.table(
        ["mount", "axis", *(r.name for r in runs)],
        [[m, axis, *(_load(r, m, i) for r in runs)] for m in mounts for i, axis in enumerate(AXES)],
    )
    page.heading("Overlays")
    page.figure(_motion_spectra(runs), "Power spectral density of the CG acceleration", tight=False)
    for mount in mounts:
        page.figure(_force_spectra(runs, mount), f"Force on the body by mount {mount}", tight=False)
    return page, findings


def _metric(metric: Metric | None, odd: bool) -> str:
    if metric is None:
        return ""
    text = plain(metric.value) if metric.std is None else " ± ".join(with_std(metric.value, metric.std))
    return f"{text if metric.sure else f'({text})'}{' *' if odd else ''}"


def _parameter(run: FinishedReplay, name: str) -> str:
    for p in best_parameters(run.result):
        if p["name"] == name:
            both = (plain(p["value"]), "?") if p["std"] is None else with_std(p["value"], p["std"])
            text = f"{' ± '.join(both)} {p['unit']}"
            return text if p["status"] == "valid" else f"({text}: {p['status']})"
    return ""


def _load(run: FinishedReplay, mount: str, axis: int) -> str:
    if mount not in run.mount_names or not np.any(run.valid):
        return ""
    force = run.mount_force[run.valid, run.mount_names.index(mount), axis]
    swing = force - force.mean()
    return f"{plain(float(np.sqrt(np.mean(swing**2))))} / {plain(float(np.max(np.abs(swing))))}"


def _motion_spectra(runs: Sequence[FinishedReplay]) -> Figure:
    return _spectra(
        {r.name: _by_axis(r.cg_accel[r.valid, :3], r.time_s) for r in runs if np.sum(r.valid) >= 64}, "[(m/s²)²/Hz]"
    )


def _force_spectra(runs: Sequence[FinishedReplay], mount: str) -> Figure:
    found = {}
    for run in runs:
        if mount in run.mount_names and np.sum(run.valid) >= 64:
            densities = _by_axis(run.mount_force[run.valid, run.mount_names.index(mount)], run.time_s)
            found[run.name] = [(frequency, np.sqrt(density)) for frequency, density in densities]
    return _spectra(found, "[N/√Hz]")


def _by_axis(values: Array, time_s: Array) -> list[tuple[Array, Array]]:
    return [spectrum(values[:, i], time_s) for i in range(len(AXES))]


def _spectra(curves: Mapping[str, list[tuple[Array, Array]]], unit: str) -> Figure:
    """Draw (frequency, value) of every axis by name, one picture per axis."""
    figure = Figure(figsize=(11, 3.4))
    axes = figure.subplots(1, 3)
    for i, axis in enumerate(AXES):
        for name, by_axis in curves.items():
            axes[i].loglog(*by_axis[i], linewidth=0.9, label=name)
        frequency_axis(axes[i])
        axes[i].set_title(axis, fontsize=9)
        axes[i].set_xlabel("frequency [Hz]")
        axes[i].set_ylabel(unit)
    if axes[0].get_legend_handles_labels()[0]:
        axes[0].legend(fontsize=7)
    figure.subplots_adjust(left=0.07, right=0.98, bottom=0.16, top=0.9, wspace=0.3)
    return figure
