# Copyright 2026 ride_estimation contributors
"""The summary of a fleet: what failed, how the numbers spread over the runs, which runs are outliers."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ride_estimation.io.run_metrics import Metric, best_parameters, run_metrics
from ride_estimation.reporting.numbers import plain, reading_unit
from ride_estimation.reporting.outliers import Outlier, find_outliers, run_sentence
from ride_estimation.reporting.page import Digits, Link, Page

#: what names of metrics hold: damage of a mount along an axis, exposure of a place
_EQUIVALENT, _EXPOSURE = " equivalent amplitude", "A(8) of"
#: outliers and numbers per run that are shown; the table has all
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

    @property
    def labels(self) -> Mapping[str, str]:
        """Return what is said of the run: vehicle, payload, tags."""

    @property
    def report(self) -> str:
        """Return where its report is, seen from this page; empty where there is none."""


def fleet_page(title: str, rows: Sequence[Row]) -> Page:
    """Return the summary page.

    Parameters
    ----------
    title
        Of the page.
    rows
        One per run.
    """
    page = Page(title)
    counts = Counter(row.status for row in rows)
    good = [(row.name, run_metrics(row.result)) for row in rows if row.result]
    outliers = find_outliers(good)
    page.verdict(_verdict(len(rows), counts["failed"], len({o.run for o in outliers}), good))
    if counts["failed"]:
        page.heading("Failed runs")
        page.table(["run", "reason"], [[row.name, row.error] for row in rows if row.status == "failed"])
    if not good:
        return page
    page.heading("Runs")
    page.table(*_runs(rows, {outlier.run for outlier in outliers}))
    page.heading("Outliers")
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
    groups = _groups(rows)
    if len(groups) > 1:
        page.heading("By tag")
        page.text("Median over the usable values of the runs with a tag; a run may have several.")
        page.table(["metric", "unit", *(f"{tag} ({len(own)})" for tag, own in groups.items())], _by_tag(names, groups))
    shown = [name for name in names if _varies(name, good)][:_PANELS]
    if shown:
        page.heading("Pictures")
        caption = "Every run by its row in the table of the fleet; outliers in red"
        numbers = [place for place, row in enumerate(rows, start=1) if row.result]
        page.figure(_strips(shown, good, numbers, outliers), caption, tight=False)
    return page


def _verdict(asked: int, failed: int, odd: int, good: Sequence[tuple[str, Mapping[str, Metric]]]) -> str:
    """Return what became of the runs, and which of them loads mounts and people most."""
    words = [f"{len(good)} of {asked} runs evaluated, {failed} failed, {odd} outliers"]
    loads = [(most.value, most.name, run) for run, metrics in good if (most := _most(metrics, _EQUIVALENT)) is not None]
    if loads:
        value, name, run = max(loads)
        words.append(f"the most damaging load is {_place(name)} in {run}: equivalent amplitude {plain(1e-3 * value, 3)} kN")
    exposures = [(most.value, run) for run, metrics in good if (most := _most(metrics, _EXPOSURE)) is not None]
    if exposures:
        value, run = max(exposures)
        words.append(f"A(8) is highest in {run}: {plain(value, 3)} m/s²")
    return f"{'; '.join(words)}."


def _most(metrics: Mapping[str, Metric], what: str) -> Metric | None:
    """Return the largest usable metric of a kind."""
    return max((m for m in metrics.values() if what in m.name and m.sure), key=lambda m: m.value, default=None)


def _place(name: str) -> str:
    """Return mount and axis of a metric, as in ``front_left z``."""
    return name.partition(_EQUIVALENT)[0].replace(".", " ")


def _reading(name: str, runs: Iterable[tuple[str, Mapping[str, Metric]]]) -> tuple[str, float]:
    """Return the unit a metric of some runs is read in and the factor to it."""
    metric = next(metrics[name] for _, metrics in runs if name in metrics)
    return ("kN", 1e-3) if _EQUIVALENT in metric.name else reading_unit(metric.unit)


def _runs(rows: Sequence[Row], odd: Collection[str]) -> tuple[list[str], list[list[object]]]:
    """Return headings and one line per run: what it is, how loud, what its report says."""
    labels = list(dict.fromkeys(label for row in rows for label in row.labels))
    lines: list[list[object]] = []
    for row in rows:
        metrics = run_metrics(row.result) if row.result else {}
        numbers = [metrics[name].value if name in metrics else "" for name in ("duration", "valid ticks", "warnings")]
        known = sum(p.get("status") == "valid" for p in best_parameters(row.result))
        name: object = Link(row.name, row.report) if row.report else row.name
        what = "outlier" if row.name in odd else row.status
        load, exposure = _most(metrics, _EQUIVALENT), _most(metrics, _EXPOSURE)
        loads: list[object] = [] if load is None else [_place(load.name), Digits(plain(1e-3 * load.value, 3))]
        found = [*(loads or ("", "")), "" if exposure is None else Digits(plain(exposure.value, 3))]
        said = [row.labels.get(label, "") for label in labels]
        lines.append([name, *said, what, *found, *numbers, known if row.result else ""])
    heads = ["most damaging", "eq. amplitude [kN]", "A(8) [m/s²]", "duration [s]", "valid [%]", "warnings"]
    return ["run", *labels, "status", *heads, "parameters valid"], lines


def _groups(rows: Sequence[Row]) -> dict[str, list[tuple[str, Mapping[str, Metric]]]]:
    """Return the finished runs by tag."""
    found: dict[str, list[tuple[str, Mapping[str, Metric]]]] = {}
    for row in rows:
        for tag in row.labels.get("tags", "").split():
            if row.result:
                found.setdefault(tag, []).append((row.name, run_metrics(row.result)))
    return found


def _by_tag(names: Sequence[str], groups: Mapping[str, Sequence[tuple[str, Mapping[str, Metric]]]]) -> list[list[object]]:
    """Return a line per metric that is usable under two tags: its median under each."""
    lines: list[list[object]] = []
    for name in names:
        values = [[value for _, value in _known(name, runs)] for runs in groups.values()]
        if sum(map(bool, values)) > 1:
            unit, factor = _reading(name, itertools.chain.from_iterable(groups.values()))
            lines.append([name, unit, *(factor * float(np.median(own)) if own else "" for own in values)])
    return lines


def _known(name: str, runs: Sequence[tuple[str, Mapping[str, Metric]]]) -> list[tuple[int, float]]:
    return [(i, metrics[name].value) for i, (_, metrics) in enumerate(runs) if name in metrics and metrics[name].sure]


def _spread(name: str, runs: Sequence[tuple[str, Mapping[str, Metric]]]) -> list[object]:
    unit, factor = _reading(name, runs)
    values = factor * np.array([value for _, value in _known(name, runs)])
    middle = float(np.median(values))
    robust = 1.4826 * float(np.median(np.abs(values - middle))) if len(values) > 1 else ""
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
        unit, factor = _reading(name, runs)
        axes.scatter([numbers[i] for i, _ in known], [factor * value for _, value in known], s=10, c=colours)
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
