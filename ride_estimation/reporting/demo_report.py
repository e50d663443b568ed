# Copyright 2026 ride_estimation contributors
"""The page of the demonstration: what the estimator found beside what is true."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ride_estimation.reporting.page import Page

Array = NDArray[np.float64]

TRUE, FOUND, BAND = "#57606a", "#0969da", "#9ec5fe"


def force_figure(
    time_s: Array, mounts: Sequence[str], true: Array, found: Array, std: Array, window: tuple[float, float]
) -> Figure:
    """Return vertical mount forces, true and estimated with a two-sigma band.

    Parameters
    ----------
    time_s
        Shape (N,) [s].
    mounts
        Names, M of them.
    true, found, std
        Vertical force per mount, shape (N, M) [N].
    window
        First and last second shown.
    """
    figure = Figure(figsize=(11, 2.1 * len(mounts)))
    chosen = (time_s >= window[0]) & (time_s <= window[1])
    panels = figure.subplots(len(mounts), 1, sharex=True, squeeze=False)[:, 0]
    for i, (axis, mount) in enumerate(zip(panels, mounts, strict=True)):
        middle, spread, t = found[chosen, i], 2.0 * std[chosen, i], time_s[chosen]
        axis.fill_between(t, middle - spread, middle + spread, color=BAND, linewidth=0, label="estimate +- 2 std")
        axis.plot(t, true[chosen, i], color=TRUE, linewidth=1.6, label="true")
        axis.plot(t, middle, color=FOUND, linewidth=0.8, label="estimate")
        axis.set_ylabel(f"{mount}\nforce z [N]")
        axis.grid(alpha=0.3)
        if i == 0:
            axis.legend(loc="upper right", ncols=3, fontsize="small")
        if i == len(mounts) - 1:
            axis.set_xlabel("time [s]")
    return figure


def write_demo_report(
    path: Path,
    verdict: str,
    tables: Mapping[str, tuple[Sequence[str], Sequence[Sequence[object]]]],
    figure: Figure,
    notes: Sequence[str],
    links: Mapping[str, str],
) -> None:
    """Write the page.

    Parameters
    ----------
    path
        File to write.
    verdict
        The sentence the reader came for.
    tables
        Heading -> (column heads, rows).
    figure
        Of :func:`force_figure`.
    notes
        Sentences below, what must be known to read the numbers.
    links
        Title -> file beside the page with the details.
    """
    page = Page("Demonstration: estimates against the truth of a simulated run")
    page.verdict(verdict)
    for heading, (head, rows) in tables.items():
        page.heading(heading)
        page.table(head, rows)
    page.heading("Vertical mount forces")
    page.figure(figure, "Force on the cab by each mount, static share included")
    for note in notes:
        page.text(note)
    if links:
        page.heading("Details")
        page.table(("report", "file"), list(links.items()))
    page.write(path)
