# Copyright 2026 ride_estimation contributors
"""Measured against simulated spectra at the accelerometers of a body, model by model (document 000 Figures 9 to 15)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ride_estimation.io.atomic import write_atomically
from ride_estimation.reporting.page import Page
from ride_estimation.signals.spectra import Spectrum, welch_spectrum

Array = NDArray[np.float64]

#: frequencies shown [Hz]: the ride band; below it the compared signals are high-passed
LOWEST_HZ, HIGHEST_HZ = 0.4, 60.0


def write_model_spectra(
    folder: Path, run: str, places: Sequence[str], measured: Array, modelled: Mapping[str, Array], rate_hz: float, block: int
) -> None:
    """Write ``spectra.csv`` and ``report.html``: vertical acceleration measured and by every model at every place.

    Parameters
    ----------
    folder
        Where to.
    run
        Name of the run.
    places
        Accelerometers on the body, C of them.
    measured
        Vertical accelerations [m/s^2], shape (N, C).
    modelled
        Model -> the same, simulated.
    rate_hz, block
        Sample rate [Hz], samples a block.
    """
    page = Page(f"Measured against simulated spectra, {run}")
    columns: list[tuple[str, Array]] = []
    frequency = np.zeros(0)
    for column, place in enumerate(places):
        found = {"measured": welch_spectrum(measured[:, column], rate_hz, block)}
        found |= {name: welch_spectrum(values[:, column], rate_hz, block) for name, values in modelled.items()}
        frequency = found["measured"].frequency_hz
        if column == 0:
            page.text(found["measured"].describe())
        page.figure(_overlay(found), f"Vertical acceleration at {place}: measured and simulated")
        columns += [(f"{place} {name}", spectrum.density) for name, spectrum in found.items()]
    page.write(folder / "report.html")
    header = ["frequency [Hz]", *(f"{name} [(m/s^2)^2/Hz]" for name, _ in columns)]
    rows = np.column_stack([frequency, *(values for _, values in columns)])
    lines = [",".join(header), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    write_atomically(folder / "spectra.csv", "\n".join(lines) + "\n")


def _overlay(found: Mapping[str, Spectrum]) -> Figure:
    figure = Figure(figsize=(10, 4.2))
    axes = figure.add_subplot()
    for number, (name, spectrum) in enumerate(found.items()):
        shown = (spectrum.frequency_hz >= LOWEST_HZ) & (spectrum.frequency_hz <= HIGHEST_HZ)
        style = {"color": "black", "lw": 1.8} if number == 0 else {"lw": 0.9}
        axes.loglog(spectrum.frequency_hz[shown], spectrum.density[shown], label=name, **style)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("power spectral density [(m/s²)²/Hz]")
    axes.grid(alpha=0.3, which="major")
    axes.legend(fontsize=8)
    return figure
