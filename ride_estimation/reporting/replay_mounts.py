# Copyright 2026 ride_estimation contributors
"""Pictures of the mounts: hysteresis loops against the law of the vehicle file, dynamic stiffness by frequency and amplitude."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import signal

from ride_estimation.elements.base import ForceElement
from ride_estimation.estimation.offline import OfflineRun
from ride_estimation.frames import AXES
from ride_estimation.reporting.replay_plots import busiest_stretch, frequency_axis
from ride_estimation.reporting.replay_spectra import tick_rate

Array = NDArray[np.float64]

MEASURED, ESTIMATED, LAW = "#57606a", "#0969da", "#bf8700"
#: length of the stretch loops are drawn for, and of the blocks that are sorted by amplitude [s]
_STRETCH_S, _BLOCK_S = 4.0, 2.0
#: blocks an amplitude class needs, classes, frequencies shown [Hz], coherence from which a point is shown
_LEAST_BLOCKS, _CLASSES, _BAND_HZ, _COHERENCE = 6, 3, (0.8, 25.0), 0.8


@dataclasses.dataclass(frozen=True)
class MountCurves:
    """Deflection and force of one mount along one axis; force as tension about its mean, deflection about its mean.

    Attributes
    ----------
    deflection
        Shape (N,) [m].
    estimated
        Shape (N,) [N].
    law
        Force of the element with the values found in this run, None without an element on the axis.
    measured
        Of a load cell, None without one.
    """

    deflection: Array
    estimated: Array
    law: Array | None
    measured: Array | None


def mount_curves(
    run: OfflineRun, mount: int, axis: int, element: ForceElement | None, measured: Array | None
) -> MountCurves:
    """Return the curves of one mount along one axis.

    Parameters
    ----------
    run
        The replay.
    mount, axis
        Numbers.
    element
        Of the vehicle file, with the values found.
    measured
        Force on the body that a load cell measured, shape (N,), or None.
    """
    deflection = run.deflection[:, mount, axis]
    force = run.force[:, mount, axis]
    law = None
    if element is not None:
        time = np.arange(len(deflection)) / tick_rate(run)
        law = element.response(time, deflection)
        law = law - law[run.valid].mean()
    return MountCurves(
        deflection=deflection,
        estimated=force[run.valid].mean() - force,
        law=law,
        measured=None if measured is None else measured[run.valid].mean() - measured,
    )


def loops(run: OfflineRun, mounts: Sequence[str], curves: Mapping[tuple[int, int], MountCurves], axis: int = 2) -> Figure:
    """Return force over deflection and over its rate, of every mount where it moves most.

    Parameters
    ----------
    run
        The replay.
    mounts
        Names.
    curves
        By mount and axis number.
    axis
        0 to 2.
    """
    shown = [m for m in range(len(mounts)) if (m, axis) in curves]
    columns = min(len(shown), 4)
    rows = -(-len(shown) // columns)
    height = 0.6 + 5.8 * rows
    figure = Figure(figsize=(11, height))
    panels = figure.subplots(2 * rows, columns, squeeze=False)
    for place, m in enumerate(shown):
        row, column = 2 * (place // columns), place % columns
        one = curves[m, axis]
        first, last = busiest_stretch(run.time_s, one.deflection, _STRETCH_S)
        part = slice(first, last)
        rate = np.gradient(one.deflection) * tick_rate(run)
        upper, lower = panels[row, column], panels[row + 1, column]
        for axes, values, unit in ((upper, 1e3 * one.deflection, "deflection [mm]"), (lower, 1e3 * rate, "rate [mm/s]")):
            _loop(axes, values[part], one, part)
            axes.set_xlabel(unit, fontsize=8)
        upper.set_title(f"{mounts[m]} {AXES[axis]}", fontsize=9)
        if place == 0:
            # below the rising loop there is room, whatever its size
            upper.legend(fontsize=7, loc="lower right")
    for empty in range(len(shown), rows * columns):
        for row in (0, 1):
            panels[2 * (empty // columns) + row, empty % columns].set_axis_off()
    figure.subplots_adjust(left=0.07, right=0.99, bottom=0.55 / height, top=1.0 - 0.3 / height, wspace=0.42, hspace=0.32)
    return figure


def _loop(axes: Axes, over: Array, curves: MountCurves, part: slice) -> None:
    for values, colour, label in (
        (curves.measured, MEASURED, "load cell"), (curves.law, LAW, "law with found values"),
        (curves.estimated, ESTIMATED, "estimate"),
    ):  # fmt: skip
        if values is not None:
            axes.plot(over, values[part], color=colour, lw=0.7, label=label)
    axes.set_ylabel("tension about mean [N]", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3)


@dataclasses.dataclass(frozen=True)
class StiffnessClass:
    """Dynamic stiffness within one class of amplitude.

    Attributes
    ----------
    amplitude
        Root mean square deflection of the class [m].
    frequency_hz, stiffness, loss_angle
        Shape (F,); ``stiffness`` is the magnitude [N/m], ``loss_angle`` in rad; points of low coherence are left out.
    blocks
        Number of blocks averaged.
    """

    amplitude: float
    frequency_hz: Array
    stiffness: Array
    loss_angle: Array
    blocks: int


def stiffness_by_amplitude(deflection: Array, force: Array, valid: NDArray[np.bool_], rate_hz: float) -> list[StiffnessClass]:
    """Return K*(f) = S_xF / S_xx of the blocks of a run, sorted into classes of equal size by their rms deflection.

    Parameters
    ----------
    deflection, force
        Shape (N,) [m, N].
    valid
        Shape (N,); blocks with a tick that is not valid are left out.
    rate_hz
        [Hz].
    """
    size = round(_BLOCK_S * rate_hz)
    starts = [i for i in range(0, len(valid) - size + 1, size // 2) if np.all(valid[i : i + size])] if size >= 16 else []
    if len(starts) < _LEAST_BLOCKS:
        return []
    window = np.hanning(size)
    index = np.array(starts)[:, None] + np.arange(size)
    spectra = [np.fft.rfft(signal.detrend(v[index], axis=1, type="linear") * window, axis=1) for v in (deflection, force)]
    rms = np.sqrt(np.mean(signal.detrend(deflection[index], axis=1, type="constant") ** 2, axis=1))
    frequency = np.fft.rfftfreq(size, 1.0 / rate_hz)
    band = (frequency >= _BAND_HZ[0]) & (frequency <= min(_BAND_HZ[1], 0.4 * rate_hz))
    classes = min(_CLASSES, len(starts) // _LEAST_BLOCKS)
    found = []
    for members in np.array_split(np.argsort(rms), classes):
        x, f = spectra[0][members][:, band], spectra[1][members][:, band]
        auto, cross = np.sum(np.abs(x) ** 2, axis=0), np.sum(np.conj(x) * f, axis=0)
        power = auto * np.sum(np.abs(f) ** 2, axis=0)
        coherence = np.abs(cross) ** 2 / np.maximum(power, np.finfo(float).tiny)
        good = coherence >= _COHERENCE
        ratio = cross[good] / auto[good]
        amplitude = float(np.sqrt(np.mean(rms[members] ** 2)))
        found.append(StiffnessClass(amplitude, frequency[band][good], np.abs(ratio), np.angle(ratio), len(members)))
    return found


def stiffness_plot(name: str, classes: Sequence[StiffnessClass], unit_source: str) -> Figure:
    """Return dynamic stiffness and loss angle over frequency, one curve per amplitude.

    Parameters
    ----------
    name
        Mount and axis.
    classes
        From :func:`stiffness_by_amplitude`.
    unit_source
        Whose force it is, for the title.
    """
    figure = Figure(figsize=(11, 3.4))
    left, right = figure.subplots(1, 2)
    for i, one in enumerate(classes):
        label = f"{1e3 * one.amplitude:.2g} mm rms, {one.blocks} blocks"
        left.semilogx(one.frequency_hz, 1e-3 * one.stiffness, ".-", lw=0.8, ms=3, color=f"C{i}", label=label)
        right.semilogx(one.frequency_hz, np.degrees(one.loss_angle), ".-", lw=0.8, ms=3, color=f"C{i}")
    left.set_title(f"{name}, {unit_source}", fontsize=9)
    left.set_ylabel("dynamic stiffness [N/mm]")
    right.set_ylabel("loss angle [deg]")
    for axes in (left, right):
        frequency_axis(axes)
        axes.set_xlabel("frequency [Hz]")
        axes.grid(alpha=0.3)
    left.legend(fontsize=8)
    figure.subplots_adjust(left=0.07, right=0.99, bottom=0.16, top=0.91, wspace=0.2)
    return figure
