# Copyright 2026 ride_estimation contributors
"""The summary of a fleet: what failed, how the numbers spread over the runs, which runs stand out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ride_estimation.io.run_metrics import Metric, run_metrics
from ride_estimation.reporting.outliers import Outlier, find_outliers, run_sentence
from ride_estimation.reporting.page import Page

#: runs that stand out and numbers per run that are shown; the table holds all
_SHOWN = 40
_NUMBERS = 5
_PANELS = 12


class Row(Protocol):
    """One run of a fleet as the page needs it."""

    @property
    def name(self) -> str:
        """Return the name of the run."""

    @property
    def status(self) -> str:
        """Return what became of it."""

    @property
    def error(self) -> str:
        """Return why it failed."""

    @property
    def result(self) -> Mapping[str, Any]:
        """Return the content of ``result.json``."""


def fleet_page(folder: str, vehicle: str, rows: Sequence[Row]) -> Page:
    """Return the summary page.

    Parameters
    ----------
    folder, vehicle
        What was replayed with what.
    rows
        One per run.
    """
    page = Page(f"Fleet of {len(rows)} runs in {folder}")
    counts = Counter(row.status for row in rows)
    good = [(row.name, run_metrics(row.result)) for row in rows if row.result]
    outliers = find_outliers(good)
    page.verdict(
        f"{len(good)} of {len(rows)} runs evaluated with {vehicle}, {counts['failed']} failed, "
        f"{len({o.run for o in outliers})} stand out."
    )
    if counts["failed"]:
        page.heading("Failed runs")
        page.table(["run", "reason"], [[row.name, row.error] for row in rows if row.status == "failed"])
    if not good:
        return page
    page.heading("Runs that stand out")
    by_run: dict[str, list[Outlier]] = {}
    for outlier in outliers:
        by_run.setdefault(outlier.run, []).append(outlier)
    for name, own in sorted(by_run.items(), key=lambda item: -len(item[1]))[:_SHOWN]:
        page.warning(run_sentence(name, own, _NUMBERS))
    if len(by_run) > _SHOWN:
        page.text(f"{len(by_run) - _SHOWN} more are in the table of the fleet.")
    if not outliers:
        page.text("None.")
    page.heading("Spread over the runs")
    page.text("Only usable values count: parameters with the status valid, damage that is known.")
    names = list(dict.fromkeys(name for _, metrics in good for name in metrics))
    page.table(
        ["metric", "unit", "runs", "median", "smallest", "largest", "robust std"],
        [_spread(name, good) for name in names if _known(name, good)],
    )
    unknown = [name for name in names if not _known(name, good)]
    if unknown:
        page.text(f"Usable in no run: {', '.join(unknown)}.")
    shown = [name for name in names if _varies(name, good)][:_PANELS]
    if shown:
        page.heading("Pictures")
        caption = "Every run by its row in the table of the fleet; runs that stand out in red"
        numbers = [place for place, row in enumerate(rows, start=1) if row.result]
        page.figure(_strips(shown, good, numbers, outliers), caption, tight=False)
    return page


def _known(name: str, runs: Sequence[tuple[str, Mapping[str, Metric]]]) -> list[tuple[int, float]]:
    return [(i, metrics[name].value) for i, (_, metrics) in enumerate(runs) if name in metrics and metrics[name].sure]


def _spread(name: str, runs: Sequence[tuple[str, Mapping[str, Metric]]]) -> list[object]:
    unit = next(metrics[name].unit for _, metrics in runs if name in metrics)
    values = np.array([value for _, value in _known(name, runs)])
    middle = float(np.median(values))
    robust = 1.4826 * float(np.median(np.abs(values - middle)))
    return [name, unit, len(values), middle, float(values.min()), float(values.max()), robust]


def _varies(name: str, runs: Sequence[tuple[str, Mapping[str, Metric]]]) -> bool:
    values = [value for _, value in _known(name, runs)]
    return len(values) >= 2 and max(values) > min(values) and name not in ("duration", "warnings")


def _strips(
    names: Sequence[str], runs: Sequence[tuple[str, Mapping[str, Metric]]], numbers: Sequence[int], outliers: Sequence[Outlier]
) -> Figure:
    rows = -(-len(names) // 3)
    figure = Figure(figsize=(11, 2.3 * rows + 0.4))
    odd = {(outlier.run, outlier.metric.name) for outlier in outliers}
    for place, name in enumerate(names, start=1):
        axes = figure.add_subplot(rows, 3, place)
        known = _known(name, runs)
        colours = ["#cf222e" if (runs[i][0], name) in odd else "#0969da" for i, _ in known]
        axes.scatter([numbers[i] for i, _ in known], [value for _, value in known], s=10, c=colours)
        unit = next(metrics[name].unit for _, metrics in runs if name in metrics)
        axes.set_title(name if len(name) < 46 else f"{name[:44]}...", fontsize=7)
        axes.set_ylabel(f"[{unit}]", fontsize=7)
        axes.set_xlabel("run [row]", fontsize=7)
        axes.set_xlim(0.5, numbers[-1] + 0.5)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.tick_params(labelsize=7)
        axes.grid(alpha=0.3)
    height = 2.3 * rows + 0.4
    figure.subplots_adjust(left=0.08, right=0.99, bottom=0.5 / height, top=1 - 0.3 / height, wspace=0.35, hspace=0.6)
    return figure
