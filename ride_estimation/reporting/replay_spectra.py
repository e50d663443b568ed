# Copyright 2026 ride_estimation contributors
"""Frequency-domain pictures of a replay: power spectra, spectrogram, transmissibility of the mounts with coherence."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import signal, stats

from ride_estimation.estimation.offline import OfflineRun
from ride_estimation.frames import AXES
from ride_estimation.reporting.replay_plots import frequency_axis
from ride_estimation.signals.spectra import TransferFunction, transfer_function, welch_spectrum

Array = NDArray[np.float64]

#: block of spectra and transfer functions [s]; the resolution is its inverse
BLOCK_S = 4.0
#: fewest half-overlapping blocks that give a transfer function; with fewer the coherence is near one by construction
LEAST_AVERAGES = 6
#: coherence below which a phase means nothing and is not drawn
LEAST_COHERENCE = 0.5
#: frequencies shown [Hz]: the ride band; above are noise and structure
LOWEST_HZ, HIGHEST_HZ = 0.4, 60.0
_COLOURS = ("#0969da", "#cf222e", "#1a7f37", "#8250df", "#bf8700", "#57606a")


def tick_rate(run: OfflineRun) -> float:
    """Return the ticks per second of a replay [Hz]."""
    return 1.0 / max(float(np.median(np.diff(run.stamp_ns))) * 1e-9, 1e-9) if len(run.stamp_ns) > 1 else 0.0


def block_of(run: OfflineRun) -> int:
    """Return the samples per block for spectra of this run, 0 where the run is too short."""
    block = min(round(BLOCK_S * tick_rate(run)), int(np.sum(run.valid)))
    return block if block >= 8 else 0


def power_spectra(run: OfflineRun) -> Figure:
    """Return the power spectral densities of the CG acceleration, translation and rotation."""
    figure = Figure(figsize=(11, 3.6))
    rate, block = tick_rate(run), block_of(run)
    for place, (start, names, unit) in enumerate(
        ((0, AXES, "(m/s²)²/Hz"), (3, ("roll", "pitch", "yaw"), "(rad/s²)²/Hz")), start=1
    ):
        axes = figure.add_subplot(1, 2, place)
        for i, name in enumerate(names):
            found = welch_spectrum(run.signals["cg_accel"][run.valid, start + i], rate, block)
            shown = _band(found.frequency_hz)
            largest = float(np.max(found.density[shown], initial=0.0))
            if largest > 0.0:  # a planar body does not move along every axis
                density = np.maximum(found.density[shown], 1e-12 * largest)
                # 95 % of a chi-square variable with two degrees of freedom a block; half-overlapping blocks hold half as much
                freedom = max(found.averages, 1)
                low, high = (density * freedom / stats.chi2.ppf(p, freedom) for p in (0.975, 0.025))
                axes.fill_between(found.frequency_hz[shown], low, high, color=_COLOURS[i], alpha=0.15, lw=0.0)
                axes.loglog(found.frequency_hz[shown], density, lw=0.9, color=_COLOURS[i], label=name)
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel(f"power spectral density [{unit}]")
        axes.grid(alpha=0.3, which="major")
        if axes.lines:
            frequency_axis(axes)
            axes.legend(fontsize=8)
    figure.subplots_adjust(left=0.07, right=0.99, bottom=0.15, top=0.97, wspace=0.2)
    return figure


def spectrum_words(run: OfflineRun) -> str:
    """Return resolution and averages of the spectra, as belongs beside them."""
    return welch_spectrum(run.signals["cg_accel"][run.valid, 2], tick_rate(run), block_of(run)).describe()


def spectrogram(run: OfflineRun) -> Figure:
    """Return the spectrogram of the vertical acceleration of the CG over the whole run."""
    rate = tick_rate(run)
    block = max(min(round(2.0 * rate), len(run.stamp_ns) // 2), 8)
    frequency, _, density = signal.spectrogram(
        run.signals["cg_accel"][:, 2], fs=rate, nperseg=block, noverlap=block // 2, detrend="constant"
    )
    shown = frequency <= HIGHEST_HZ
    level = 10.0 * np.log10(np.maximum(density[shown], 1e-12))
    figure = Figure(figsize=(11, 3.4))
    axes = figure.add_subplot()
    low, high = np.percentile(level, (5.0, 99.5))
    mesh = axes.imshow(
        level, origin="lower", aspect="auto", interpolation="nearest", cmap="viridis", vmin=low, vmax=max(high, low + 1.0),
        extent=(0.0, len(run.stamp_ns) / rate, float(frequency[shown][0]), float(frequency[shown][-1])),
    )  # fmt: skip
    figure.colorbar(mesh, ax=axes, label="density [dB re 1 (m/s²)²/Hz]", pad=0.01)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("frequency [Hz]")
    figure.subplots_adjust(left=0.06, right=1.02, bottom=0.16, top=0.97)
    return figure


def motion_at(run: OfflineRun, offset: Array) -> Array:
    """Return the acceleration of a point of the body, shape (N, 3) [m/s^2], gravity removed.

    ``a + alpha x r + omega x (omega x r)``.

    Parameters
    ----------
    offset
        Point minus CG, body axes [m], shape (3,).
    """
    accel, omega = run.signals["cg_accel"], run.signals["angular_rate"]
    return np.asarray(accel[:, :3] + np.cross(accel[:, 3:], offset) + np.cross(omega, np.cross(omega, offset)))


def transmissibilities(run: OfflineRun, offsets: Mapping[str, Array], base: Mapping[str, Array]) -> dict[str, TransferFunction]:
    """Return the vertical transfer function from base to body at every mount whose base motion was measured.

    Parameters
    ----------
    run
        The replay.
    offsets
        Mount -> attachment point minus CG [m].
    base
        Mount -> acceleration of its base, body axes, shape (N, 3) [m/s^2].

    Returns
    -------
    dict
        Mount -> H1 with coherence, and ``heave``: mean of all bases to the CG. Empty where the run is too short.
    """
    rate, block = tick_rate(run), block_of(run)
    samples = int(np.sum(run.valid))
    if not base or not block or 1 + (samples - block) // (block - block // 2) < LEAST_AVERAGES:
        return {}
    found = {
        mount: transfer_function(table[run.valid, 2], motion_at(run, offsets[mount])[run.valid, 2], rate, block)
        for mount, table in base.items()
    }
    if len(base) > 1:
        mean = np.mean([table[run.valid, 2] for table in base.values()], axis=0)
        found["heave"] = transfer_function(mean, run.signals["cg_accel"][run.valid, 2], rate, block)
    return found


def transmissibility_plot(functions: Mapping[str, TransferFunction]) -> Figure:
    """Return magnitude, phase and coherence over frequency."""
    figure = Figure(figsize=(11, 6.4))
    panels = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 2))
    for i, (name, found) in enumerate(functions.items()):
        shown = _band(found.frequency_hz)
        frequency, colour = found.frequency_hz[shown], _COLOURS[i % len(_COLOURS)]
        width = 1.8 if name == "heave" else 0.9
        coherence = found.coherence[shown]
        size = np.maximum(np.abs(found.h1[shown]), 1e-4)
        known = coherence >= LEAST_COHERENCE
        # sqrt((1 - g^2) / (2 n g^2)) with n = half of the half-overlapping blocks (Bendat and Piersol)
        spread = 2.0 * np.sqrt((1.0 - np.minimum(coherence, 1.0)) / (found.averages * np.maximum(coherence, 1e-3)))
        panels[0].loglog(frequency, size, color=colour, lw=0.5, alpha=0.25)
        panels[0].loglog(frequency, np.where(known, size, np.nan), color=colour, lw=width, label=name)
        low, high = (np.where(known, size * np.maximum(1.0 + sign * spread, 1e-3), np.nan) for sign in (-1.0, 1.0))
        panels[0].fill_between(frequency, low, high, color=colour, alpha=0.15, lw=0.0)
        phase = np.where(known, np.degrees(np.angle(found.h1[shown])), np.nan)
        # a turn from 180 to -180 degrees is no change: the line breaks there
        phase[1:][np.abs(np.diff(phase)) > 180.0] = np.nan
        panels[1].semilogx(frequency, phase, color=colour, lw=width)
        panels[2].semilogx(frequency, found.coherence[shown], color=colour, lw=width)
    panels[0].axhline(1.0, color="k", lw=0.6, ls=":")
    panels[0].set_ylabel("magnitude [-]")
    panels[1].set_ylabel("phase [deg]")
    panels[1].set_yticks((-180, -90, 0, 90, 180))
    panels[2].set_ylabel("coherence [-]")
    panels[2].set_ylim(0.0, 1.05)
    frequency_axis(panels[2])
    panels[2].set_xlabel("frequency [Hz]")
    panels[0].legend(fontsize=8, ncols=3)
    for axes in panels:
        axes.grid(alpha=0.3)
    figure.subplots_adjust(left=0.07, right=0.99, bottom=0.08, top=0.98, hspace=0.08)
    return figure


def _band(frequency: Array) -> NDArray[np.bool_]:
    return np.asarray((frequency >= LOWEST_HZ) & (frequency <= HIGHEST_HZ))
