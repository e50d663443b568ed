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
from ride_estimation.vehicles.tangent import equivalent

Array = NDArray[np.float64]

MEASURED, ESTIMATED, LAW = "#57606a", "#0969da", "#bf8700"
#: length of the stretch loops are drawn for, and of the blocks that are sorted by amplitude [s]
_STRETCH_S, _BLOCK_S = 4.0, 2.0
#: blocks an amplitude class needs, classes, frequencies shown [Hz], coherence from which a point is shown
_LEAST_BLOCKS, _CLASSES, _BAND_HZ, _COHERENCE = 6, 3, (0.8, 25.0), 0.8


_CLASS_COLOURS, _CLASS_NAMES = ("#0969da", "#1a7f37", "#8250df"), ("small", "middle", "large")


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


def large_loop(run: OfflineRun, name: str, curves: MountCurves) -> Figure:
    """Return the loop of one mount where it moves most, and what the law leaves of the force over the rate.

    A friction or another damping than that of the law shows over the rate, a hardening in the loop.

    Parameters
    ----------
    run
        The replay.
    name
        Mount and axis.
    curves
        Of the mount.
    """
    figure = Figure(figsize=(11, 4.8))
    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    part = slice(*busiest_stretch(run.time_s, curves.deflection, _STRETCH_S))
    _loop(left, 1e3 * curves.deflection[part], curves, part)
    left.set_xlabel("deflection [mm]")
    left.set_title(name, fontsize=10)
    left.legend(fontsize=8, loc="lower right")
    if curves.law is not None:
        rate = 1e3 * np.gradient(curves.deflection) * tick_rate(run)
        for force, colour, label in ((curves.measured, MEASURED, "load cell"), (curves.estimated, ESTIMATED, "estimate")):
            if force is not None:
                rest = 1e-3 * (force - curves.law)
                right.plot(rate[part], rest[part], ".", color=colour, ms=3, label=f"{label} minus law")
        right.axhline(0.0, color=LAW, lw=1.2)
        right.set_title("what the law leaves", fontsize=10)
        right.legend(fontsize=8)
    right.set_xlabel("rate [mm/s]")
    right.set_ylabel("force [kN]")
    right.grid(alpha=0.3)
    figure.subplots_adjust(left=0.07, right=0.99, bottom=0.12, top=0.93, wspace=0.18)
    return figure


def loops(run: OfflineRun, mounts: Sequence[str], curves: Mapping[tuple[int, int], MountCurves], axis: int = 2) -> Figure:
    """Return force over deflection of every mount where it moves most, on one scale.

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
    height = 0.6 + 2.7 * rows
    figure = Figure(figsize=(11, height))
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for place, m in enumerate(shown):
        axes, one = panels[place // columns, place % columns], curves[m, axis]
        part = slice(*busiest_stretch(run.time_s, one.deflection, _STRETCH_S))
        _loop(axes, 1e3 * one.deflection[part], one, part)
        axes.set_xlabel("deflection [mm]", fontsize=8)
        axes.set_title(f"{mounts[m]} {AXES[axis]}", fontsize=9)
        if place == 0:
            axes.legend(fontsize=7, loc="lower right")
    for empty in range(len(shown), rows * columns):
        panels[empty // columns, empty % columns].set_axis_off()
    figure.subplots_adjust(left=0.07, right=0.99, bottom=0.55 / height, top=1.0 - 0.3 / height, wspace=0.3, hspace=0.5)
    return figure


def _loop(axes: Axes, over: Array, curves: MountCurves, part: slice) -> None:
    for values, colour, label in (
        (curves.measured, MEASURED, "load cell"), (curves.law, LAW, "law with found values"),
        (curves.estimated, ESTIMATED, "estimate"),
    ):  # fmt: skip
        if values is not None:
            axes.plot(over, 1e-3 * values[part], color=colour, lw=0.8, label=label)
    axes.set_ylabel("tension about mean [kN]", fontsize=8)
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
    relative_std
        Standard deviation of the magnitude over it, and of the angle [rad], from the coherence, shape (F,):
        ``sqrt((1 - g^2) / (2 n g^2))`` with n independent blocks (Bendat and Piersol).
    blocks
        Number of blocks averaged.
    """

    amplitude: float
    frequency_hz: Array
    stiffness: Array
    loss_angle: Array
    relative_std: Array
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
        # half-overlapping blocks hold half as much that is new
        spread = np.sqrt((1.0 - coherence[good]) / (len(members) * coherence[good]))
        found.append(StiffnessClass(amplitude, frequency[band][good], np.abs(ratio), np.angle(ratio), spread, len(members)))
    return found


@dataclasses.dataclass(frozen=True)
class LawStiffness:
    """Dynamic stiffness of the law of a mount with the values found, one column per frequency.

    Attributes
    ----------
    frequency_hz
        Shape (F,).
    stiffness
        Complex [N/m], shape (F,).
    std
        Of its magnitude, from the standard deviations of stiffness and damping [N/m], shape (F,).
    angle_std
        Of its angle [rad], shape (F,).
    """

    frequency_hz: Array
    stiffness: NDArray[np.complex128]
    std: Array
    angle_std: Array


def law_stiffness(element: ForceElement, relative_std: Mapping[str, float], amplitude: float) -> LawStiffness:
    """Return the dynamic stiffness of a law over the shown frequencies.

    Parameters
    ----------
    element
        With the values found.
    relative_std
        Role of a parameter (``stiffness``, ``damping``) -> its standard deviation over its value; others count as known.
    amplitude
        Of the deflection, for laws that depend on it [m].
    """
    frequency = np.geomspace(*_BAND_HZ, 60)
    exact = _complex_stiffness(element, frequency, amplitude)
    square = np.zeros((2, len(frequency)))
    for role, spread in relative_std.items():
        moved = _complex_stiffness(element.scaled(role, 1.0 + spread), frequency, amplitude)
        square += (np.abs(moved) - np.abs(exact)) ** 2, (np.angle(moved) - np.angle(exact)) ** 2
    return LawStiffness(frequency, exact, np.sqrt(square[0]), np.sqrt(square[1]))


def _complex_stiffness(element: ForceElement, frequency_hz: Array, amplitude: float) -> NDArray[np.complex128]:
    pairs = [equivalent(element, float(f), amplitude) for f in frequency_hz]
    return np.array([k + 2j * np.pi * f * c for f, (k, c) in zip(frequency_hz, pairs)], dtype=np.complex128)


def stiffness_plot(mounts: Mapping[str, tuple[Sequence[StiffnessClass], LawStiffness]]) -> Figure:
    """Return dynamic stiffness and loss angle over frequency with two-sigma bands, one curve per amplitude, and the law.

    All mounts have one scale.

    Parameters
    ----------
    mounts
        Name -> classes from :func:`stiffness_by_amplitude` and the law.
    """
    columns = min(len(mounts), 4)
    rows = -(-len(mounts) // columns)
    height = 0.7 + 5.0 * rows
    figure = Figure(figsize=(11, height))
    panels = figure.subplots(2 * rows, columns, squeeze=False, sharey="row")
    for place, (name, (classes, law)) in enumerate(mounts.items()):
        upper, lower = panels[2 * (place // columns) : 2 * (place // columns) + 2, place % columns]
        angle, angle_std = np.degrees(np.angle(law.stiffness)), np.degrees(law.angle_std)
        _with_band(upper, law.frequency_hz, 1e-3 * np.abs(law.stiffness), 1e-3 * law.std, LAW, "law with found values")
        _with_band(lower, law.frequency_hz, angle, angle_std, LAW, "law with found values")
        for number, one in enumerate(classes):
            colour, size = _CLASS_COLOURS[number], 1e-3 * one.stiffness
            label = f"{_CLASS_NAMES[number]} amplitudes" if len(classes) == _CLASSES else f"amplitudes, class {number + 1}"
            _with_band(upper, one.frequency_hz, size, size * one.relative_std, colour, label, ".")
            angle, angle_std = np.degrees(one.loss_angle), np.degrees(one.relative_std)
            _with_band(lower, one.frequency_hz, angle, angle_std, colour, label, ".")
        rms = ", ".join(f"{1e3 * one.amplitude:.2g}" for one in classes)
        upper.set_title(f"{name}: {rms} mm rms", fontsize=9)
        for axes in (upper, lower):
            frequency_axis(axes)
            axes.grid(alpha=0.3)
        lower.set_xlabel("frequency [Hz]")
        upper.set_xlabel("frequency [Hz]")
        upper.set_ylabel("dynamic stiffness [N/mm]")
        lower.set_ylabel("loss angle [deg]")
        if place == 0:
            upper.legend(fontsize=7)
    for empty in range(len(mounts), rows * columns):
        for row in (0, 1):
            panels[2 * (empty // columns) + row, empty % columns].set_axis_off()
    figure.subplots_adjust(left=0.07, right=0.99, bottom=0.55 / height, top=1.0 - 0.3 / height, wspace=0.36, hspace=0.34)
    return figure


def _with_band(axes: Axes, frequency: Array, values: Array, std: Array, colour: str, label: str, marker: str = "") -> None:
    """Draw a curve over frequency with its two-sigma band; a law has no marks and a thicker line."""
    axes.fill_between(frequency, values - 2.0 * std, values + 2.0 * std, color=colour, alpha=0.18, lw=0.0)
    axes.semilogx(frequency, values, color=colour, lw=0.8 if marker else 1.6, marker=marker, ms=3, label=label)
