# Copyright 2026 ride_estimation contributors
"""The page of the demonstration: what the estimator found beside what is true."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ride_estimation.reporting.page import Link, Page
from ride_estimation.reporting.replay_plots import differences, legend_above

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
    height = 0.8 + 2.3 * len(mounts)
    figure = Figure(figsize=(11, height))
    grid = figure.add_gridspec(len(mounts), 1)
    chosen = (time_s >= window[0]) & (time_s <= window[1])
    t, first = time_s[chosen], None
    for i, mount in enumerate(mounts):
        halves = grid[i].subgridspec(2, 1, height_ratios=(3, 1), hspace=0.06)
        upper = figure.add_subplot(halves[0], sharex=first)
        first = upper
        lower = figure.add_subplot(halves[1], sharex=upper)
        known, middle, spread = (1e-3 * values[chosen, i] for values in (true, found, std))
        upper.fill_between(t, middle - 2.0 * spread, middle + 2.0 * spread, color=BAND, linewidth=0, label="± 2 std")
        upper.plot(t, known, color=TRUE, linewidth=1.6, label="true")
        upper.plot(t, middle, color=FOUND, linewidth=0.8, label="estimate")
        upper.set_ylabel(f"{mount} z [kN]")
        upper.tick_params(labelbottom=False)
        differences(lower, t, known - middle, spread, "kN")
        if i == 0:
            legend_above(upper)
            legend_above(lower)
        lower.set_xlabel("time [s]")
    figure.subplots_adjust(left=0.08, right=0.99, bottom=0.5 / height, top=1.0 - 0.15 / height, hspace=0.12)
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
        What must be known to read the numbers.
    links
        Title -> file beside the page with the details.
    """
    page = Page("Demonstration: estimates against the truth of a simulated run")
    page.verdict(verdict)
    for note in notes:
        page.text(note)
    if links:
        page.table(("in detail", "file"), [(title, Link(target, target)) for title, target in links.items()])
    for heading, (head, rows) in tables.items():
        page.heading(heading)
        page.table(head, rows)
    page.heading("Vertical mount forces")
    caption = "Force on the cab by each mount, static share included, and its error with the stated ± 2 std"
    page.figure(figure, caption, tight=False)
    page.write(path)
