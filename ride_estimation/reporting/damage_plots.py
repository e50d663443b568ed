# Copyright 2026 ride_estimation contributors
"""Pictures of durability: rainflow matrix, range pairs, level crossings, damage over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ride_estimation.assessment.durability import damage_over_time
from ride_estimation.assessment.rainflow import level_crossings, rainflow_matrix, range_pairs
from ride_estimation.assessment.run_assessment import MountDamage

Array = NDArray[np.float64]

_CLASSES = 48
_LEVELS = 80
_BLOCK_S = 1.0


def matrix_plot(damage: MountDamage, force: Array) -> Figure:
    """Return the from-to rainflow matrix of one force and its level crossings.

    Parameters
    ----------
    damage
        Of the force.
    force
        The force itself at the valid ticks, shape (N,) [N].
    """
    figure = Figure(figsize=(11, 4.2))
    left, right = figure.subplots(1, 2)
    low, high = float(np.min(force)), float(np.max(force))
    edges = np.linspace(low, max(high, low + 1e-9 * max(abs(low), 1.0)), _CLASSES + 1)
    matrix = rainflow_matrix(damage.cycles, edges)
    extent = (1e-3 * edges[0], 1e-3 * edges[-1], 1e-3 * edges[0], 1e-3 * edges[-1])
    shown = np.ma.masked_equal(matrix, 0.0)
    scale = LogNorm(0.5, max(float(matrix.max()), 1.0)) if matrix.any() else None
    image = left.imshow(shown, origin="lower", extent=extent, cmap="viridis", norm=scale, interpolation="nearest", aspect="auto")
    figure.colorbar(image, ax=left, label="cycles [-]", pad=0.02, format="%g").minorticks_off()
    left.set_title(f"rainflow matrix, {damage.mount} {damage.axis}", fontsize=9)
    left.set_xlabel("to [kN]")
    left.set_ylabel("from [kN]")
    levels = np.linspace(low, high, _LEVELS)
    right.semilogx(np.maximum(level_crossings(force, levels), 0.5), 1e-3 * levels, color="#0969da", lw=1.0)
    right.set_title(f"level crossings upwards, {damage.mount} {damage.axis}", fontsize=9)
    right.set_xlabel("crossings [-]")
    right.set_ylabel("force [kN]")
    right.grid(alpha=0.3)
    figure.subplots_adjust(left=0.07, right=0.99, bottom=0.13, top=0.92, wspace=0.22)
    return figure


def range_pair_plot(damages: Sequence[MountDamage]) -> Figure:
    """Return how many cycles are at least as large as a range, per force."""
    figure = Figure(figsize=(11, 3.8))
    axes = figure.add_subplot()
    for i, damage in enumerate(damages):
        ranges, counts = range_pairs(damage.cycles)
        if len(ranges):
            error = 2.0 * damage.estimated.relative_std
            low, high = (1e-3 * ranges * max(1.0 + sign * error, 0.0) for sign in (-1.0, 1.0))
            axes.fill_between(counts, low, high, color=f"C{i % 10}", alpha=0.15, lw=0.0)
            axes.semilogx(counts, 1e-3 * ranges, lw=1.0, color=f"C{i % 10}", label=f"{damage.mount} {damage.axis}")
    axes.set_xlabel("cumulative cycles [-]")
    axes.set_ylabel("range [kN]")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, ncols=2)
    figure.subplots_adjust(left=0.07, right=0.99, bottom=0.14, top=0.97)
    return figure


def damage_time_plot(damages: Sequence[MountDamage], time_s: Array, rate_hz: float) -> Figure:
    """Return the share of every second in the damage, per force.

    Parameters
    ----------
    damages
        Counted over the same ticks.
    time_s
        Of these ticks, shape (N,) [s].
    rate_hz
        [Hz].
    """
    figure = Figure(figsize=(11, 0.7 + 1.25 * len(damages)))
    panels = figure.subplots(len(damages), 1, sharex=True, squeeze=False)[:, 0]
    block = min(max(_BLOCK_S, 2.0 / rate_hz), len(time_s) / rate_hz)
    for axes, damage in zip(panels, damages, strict=True):
        share = 100.0 * damage_over_time(damage.cycles, rate_hz, len(time_s), block, damage.estimated.slope)
        start = time_s[np.minimum(np.arange(len(share)) * round(block * rate_hz), len(time_s) - 1)]
        axes.bar(start, share, width=block, align="edge", color="#0969da")
        axes.set_ylabel(f"{damage.mount}\n{damage.axis} [%]", fontsize=8)
        axes.grid(alpha=0.3)
    panels[-1].set_xlabel("time [s]")
    height = 0.7 + 1.25 * len(damages)
    figure.subplots_adjust(left=0.09, right=0.99, bottom=0.5 / height, top=1.0 - 0.1 / height, hspace=0.18)
    return figure


def worst(damages: Sequence[MountDamage]) -> Mapping[str, MountDamage]:
    """Return the most damaged axis of every mount."""
    found: dict[str, MountDamage] = {}
    for damage in damages:
        if damage.mount not in found or damage.estimated.value > found[damage.mount].estimated.value:
            found[damage.mount] = damage
    return found
