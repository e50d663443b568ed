# Copyright 2026 ride_estimation contributors
"""Pictures of a replay. Every axis has a unit, every estimate its two-sigma band."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray
from scipy import signal

from ride_estimation.estimation.offline import OfflineRun
from ride_estimation.frames import AXES

Array = NDArray[np.float64]

MEASURED, MODEL, BAND, RESIDUAL = "#57606a", "#0969da", "#9ec5fe", "#cf222e"
#: most points of a curve over the whole run, and blocks of a band there
_POINTS, _BLOCKS = 6000, 1500


def thinned(time_s: Array, values: Array) -> tuple[Array, Array]:
    """Return a signal with at most a few thousand points that still shows every extreme.

    Parameters
    ----------
    time_s
        Shape (N,).
    values
        Shape (N,).
    """
    if len(values) <= _POINTS:
        return time_s, values
    width = int(np.ceil(2 * len(values) / _POINTS))
    count = len(values) // width
    parts = values[: count * width].reshape(count, width)
    starts = np.arange(count) * width
    places = np.sort(np.concatenate([starts + parts.argmin(axis=1), starts + parts.argmax(axis=1)]))
    return time_s[places], values[places]


def banded(axes: Axes, time_s: Array, values: Array, std: Array, colour: str, label: str) -> None:
    """Draw a signal of a whole run with its two-sigma band.

    Parameters
    ----------
    axes
        Where to.
    time_s, values, std
        Shape (N,).
    colour, label
        Of the curve.
    """
    low, high = values - 2.0 * std, values + 2.0 * std
    if len(values) > 2 * _BLOCKS:
        # the band of a block reaches from its lowest to its highest value, as the curve does
        starts = np.linspace(0, len(values), _BLOCKS, endpoint=False).astype(int)
        axes.fill_between(
            time_s[starts], np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts), color=colour, alpha=0.3, lw=0.0
        )
    else:
        axes.fill_between(time_s, low, high, color=colour, alpha=0.3, lw=0.0)
    axes.plot(*thinned(time_s, values), color=colour, lw=0.6, label=label)


def differences(axes: Axes, time_s: Array, values: Array, std: Array | None, unit: str) -> None:
    """Draw a difference on a scale of its own, with the two-sigma band it should stay in where that is known."""
    if std is not None:
        axes.fill_between(time_s, -2.0 * std, 2.0 * std, color=BAND, lw=0.0, label="± 2 std")
    axes.plot(time_s, values, color=RESIDUAL, lw=0.6, label="difference")
    axes.set_ylabel(f"difference\n[{unit}]", fontsize=8)
    axes.tick_params(labelsize=8)


def measured_against_model(run: OfflineRun, sensor: str, window_s: float = 5.0) -> Figure:
    """Return measured and modelled specific force of one sensor where it moves most, and both spectra.

    Parameters
    ----------
    run
        The replay.
    sensor
        Accelerometer of the body.
    window_s
        Length of the stretch shown [s].
    """
    both = run.measured[sensor].astype(float), run.predicted[sensor].astype(float)
    return measured_and_model(run, *both, "rigid body", window_s)


def measured_and_model(run: OfflineRun, measured: Array, predicted: Array, model: str, window_s: float = 5.0) -> Figure:
    """Return a measured and a modelled acceleration where it moves most, and both spectra.

    Parameters
    ----------
    run
        The replay.
    measured, predicted
        Shape (N, 3) [m/s^2].
    model
        Name of the model.
    window_s
        Length of the stretch shown [s].
    """
    time = run.time_s
    first, last = busiest_stretch(time, measured[:, 2], window_s)
    residual = measured - predicted
    figure = Figure(figsize=(11, 8.0))
    grid = figure.add_gridspec(3, 2, width_ratios=(2, 1))
    upper = right = None
    for i, axis in enumerate(AXES):
        # the difference has a strip and a scale of its own: beside the signal it is a straight line
        halves = grid[i, 0].subgridspec(2, 1, height_ratios=(3, 1), hspace=0.08)
        upper = figure.add_subplot(halves[0], sharex=upper)
        lower = figure.add_subplot(halves[1], sharex=upper)
        right = figure.add_subplot(grid[i, 1], sharex=right)
        upper.plot(time[first:last], measured[first:last, i], color=MEASURED, linewidth=1.2, label="measured")
        upper.plot(time[first:last], predicted[first:last, i], color=MODEL, linewidth=0.8, label=model)
        upper.set_ylabel(f"{axis} [m/s²]")
        upper.tick_params(labelbottom=False)
        differences(lower, time[first:last], residual[first:last, i], None, "m/s²")
        for values, colour, label in ((measured, MEASURED, "measured"), (residual, RESIDUAL, "difference")):
            frequency, density = spectrum(values[run.valid, i], time)
            right.loglog(frequency, density, color=colour, linewidth=0.9, label=label)
        frequency_axis(right)
        right.set_ylabel("[(m/s²)²/Hz]")
        if i == 0:
            legend_above(upper)
            legend_above(right)
        if i == 2:
            lower.set_xlabel("time [s]")
            right.set_xlabel("frequency [Hz]")
    figure.subplots_adjust(left=0.1, right=0.98, bottom=0.07, top=0.96, hspace=0.22, wspace=0.22)
    return figure


def frequency_axis(axes: Axes) -> None:
    """Label a logarithmic axis of frequencies 1, 2, 5, 10 ...: a short one would have labels upon labels otherwise."""
    if axes.get_xscale() != "log":  # no curve was drawn
        return
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def legend_above(axes: Axes) -> None:
    """Put the legend above the frame, where it hides nothing."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), fontsize=8, ncols=3, frameon=False)


def spectrum(values: Array, time_s: Array) -> tuple[Array, Array]:
    """Return frequency [Hz] and power spectral density [unit^2/Hz] without the mean."""
    rate = 1.0 / max(float(np.median(np.diff(time_s))), 1e-9)
    frequency, density = signal.welch(values, fs=rate, nperseg=min(len(values), max(int(4 * rate), 16)))
    floor = max(float(density.max()) * 1e-15, 1e-300) if len(density) else 1e-300
    return frequency[1:], np.maximum(density[1:], floor)


def busiest_stretch(time_s: Array, values: Array, window_s: float) -> tuple[int, int]:
    """Return first and last index of the stretch of a given length with the largest variance."""
    if len(values) < 2:
        return 0, len(values)
    n = min(len(values), max(int(window_s / max(float(np.median(np.diff(time_s))), 1e-9)), 2))
    sums = np.concatenate([[0.0], np.cumsum((values - values.mean()) ** 2)])
    first = int(np.argmax(sums[n:] - sums[:-n])) if len(values) > n else 0
    return first, first + n


def motion_and_load(run: OfflineRun) -> Figure:
    """Return CG acceleration and inertial load over the run."""
    figure = Figure(figsize=(11, 7.5))
    axes = figure.subplots(4, 1, sharex=True)
    time = run.time_s
    groups = (
        ("cg_accel", 0, "acceleration [m/s²]", 1.0), ("cg_accel", 3, "angular accel. [rad/s²]", 1.0),
        ("inertial_load", 0, "force [kN]", 1e-3), ("inertial_load", 3, "moment [kN m]", 1e-3),
    )
    for axis, (name, start, label, factor) in zip(axes, groups):
        values, std = factor * run.signals[name], factor * run.signals[f"{name}_std"]
        for i, direction in enumerate(AXES if start == 0 else ("roll", "pitch", "yaw")):
            banded(axis, time, values[:, start + i], std[:, start + i], f"C{i}", direction)
        axis.set_ylabel(label)
        legend_above(axis)
    axes[-1].set_xlabel("time [s]")
    figure.subplots_adjust(left=0.08, right=0.98, bottom=0.09, top=0.95, hspace=0.28, wspace=0.22)
    return figure


def mount_forces(run: OfflineRun, mount: int, measured: Array | None = None, window_s: float = 5.0) -> Figure:
    """Return the force on the body by one mount with its two-sigma band: whole run and the busiest stretch.

    Beside the estimate stands the load cell, or the live estimate where there is none; they lie on each other, so their
    difference from the estimate has a strip of its own, with the band the estimate states.

    Parameters
    ----------
    run
        The replay.
    mount
        Its number.
    measured
        Force a load cell measured, shape (N, 3) [N].
    window_s
        Length of the stretch shown [s].
    """
    figure = Figure(figsize=(11, 8.4))
    grid = figure.add_gridspec(3, 2, width_ratios=(3, 2))
    time, force, std = run.time_s, 1e-3 * run.force[:, mount], 1e-3 * run.force_std[:, mount]
    other, name = (run.signals["mount_force"][:, mount], "live") if measured is None else (measured, "load cell")
    compared = measured is not None or not isinstance(run.smoothed, str)
    first, last = busiest_stretch(time, force[:, 2], window_s)
    part = slice(first, last)
    whole = upper = None
    for i, axis in enumerate(AXES):
        whole = figure.add_subplot(grid[i, 0], sharex=whole)
        halves = grid[i, 1].subgridspec(2, 1, height_ratios=(3, 1), hspace=0.08)
        upper = figure.add_subplot(halves[0], sharex=upper)
        lower = figure.add_subplot(halves[1], sharex=upper)
        banded(whole, time, force[:, i], std[:, i], MODEL, "estimate")
        whole.set_ylabel(f"{axis} [kN]")
        low, high = (force[part, i] + sign * std[part, i] for sign in (-2.0, 2.0))
        upper.fill_between(time[part], low, high, color=BAND, lw=0.0, label="± 2 std")
        if compared:
            upper.plot(time[part], 1e-3 * other[part, i], color=MEASURED, lw=1.0, linestyle="--", label=name)
            differences(lower, time[part], 1e-3 * other[part, i] - force[part, i], std[part, i], "kN")
        else:
            differences(lower, time[part], np.zeros(last - first), std[part, i], "kN")
        upper.plot(time[part], force[part, i], color=MODEL, lw=0.8, label="estimate")
        upper.set_ylabel(f"{axis} [kN]")
        upper.tick_params(labelbottom=False)
        if i == 0:
            legend_above(upper)
            legend_above(lower)
    for axes in (whole, lower):
        if axes is not None:
            axes.set_xlabel("time [s]")
    figure.subplots_adjust(left=0.08, right=0.98, bottom=0.07, top=0.985, hspace=0.16, wspace=0.2)
    return figure


def parameter_convergence(run: OfflineRun, names: Sequence[str], label: str) -> Figure:
    """Return how parameters developed, relative to their prior, with two-sigma bands.

    Parameters
    ----------
    run
        The replay.
    names
        Parameters of one kind.
    label
        What they are, for the axis.
    """
    history, prior = run.history, {p.name: p.prior for p in run.parameters}
    time = (history.stamp_ns - run.stamp_ns[0]) * 1e-9
    # one panel per axis of the mounts: twelve curves and their bands in one cannot be distinguished
    panels: dict[str, list[str]] = {}
    for name in names:
        parts = name.split(".")
        panels.setdefault(parts[1] if len(parts) == 3 else "", []).append(name)
    figure = Figure(figsize=(11, 3.2))
    frames = figure.subplots(1, len(panels), squeeze=False)[0]
    for place, (axis, (direction, shown)) in enumerate(zip(frames, panels.items())):
        late = len(time) // 3  # before, little is known and the bands fill everything
        edges = [1.0]
        for name in shown:
            column = history.names.index(name)
            scale = prior[name] or 1.0
            value, std = history.value[:, column] / scale, history.std[:, column] / abs(scale)
            line = axis.plot(time, value, linewidth=1.0, label=name.split(".")[0])[0]
            axis.fill_between(time, value - 2.0 * std, value + 2.0 * std, color=line.get_color(), alpha=0.12, linewidth=0.0)
            edges += [*value[late:], *(value - 2.0 * std)[-1:], *(value + 2.0 * std)[-1:]]
        axis.axhline(1.0, color=MEASURED, linewidth=0.6, linestyle=":")
        margin = max(0.1 * (max(edges) - min(edges)), 0.02)
        axis.set_ylim(min(edges) - margin, max(edges) + margin)
        axis.set_title(direction, fontsize=9)
        axis.set_xlabel("time [s]")
        if place == 0:
            axis.set_ylabel(f"{label} / prior [-]")
            axis.legend(fontsize=7, ncols=2, loc="upper right")
    figure.subplots_adjust(left=0.07, right=0.99, bottom=0.16, top=0.92, wspace=0.15)
    return figure
