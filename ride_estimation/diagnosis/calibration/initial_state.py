# Copyright 2026 ride_estimation contributors
"""Free motion that a run begins with: initial displacement and velocity of every mode, as unknowns of each run.

A recording rarely begins at rest, nobody knows what happened in a gap, and the fading of its ends moves a body as well. All of it
ends within a second; what the body keeps of it is a free motion of the model, ``M q'' + C q' + K q = 0``, from an unknown state.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.common.spectra import FADE_S
from ride_estimation.diagnosis.common.splits import make_splits
from ride_estimation.diagnosis.runs.run_view import RunView

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

LEADING = 2  # blocks of a stretch that the initial state of a prediction is found in; none that judge a run that is fitted


def initial_motions(view: RunView) -> tuple[list[tuple[str, str]], Array, ComplexArray]:
    """Return the free motions that the analysed stretch of a run has not forgotten.

    Modes of the band whose free motion is down to what counts as right when that stretch begins are left out.

    Returns
    -------
    names
        Mode and ``displacement`` or ``velocity``.
    std
        What the state may be off: as large as the difference of two motions of the run, in modal coordinates
        [m kg^0.5], [m kg^0.5/s], shape (p,).
    spectra
        Outputs from one unit of each at the end of the fading, shape (F, ny, p).
    """
    plant, grid, settings = view.plant, view.grid, view.settings
    stiffness, damping = view.state.linear
    square, shape = plant.modes(stiffness)
    decay = 0.5 * damping @ (plant.port_map @ shape) ** 2
    # beyond critical damping a mode creeps back at the slower of two rates
    decay = decay - np.sqrt(np.maximum(decay**2 - np.maximum(square, 0.0), 0.0))
    frequency = np.sqrt(np.maximum(square, 0.0)) / (2.0 * np.pi)
    kept = np.exp(-decay * max(settings.trim_s - FADE_S, 0.0)) > settings.adequacy
    modes = np.flatnonzero((frequency > grid.lower_hz) & (frequency < grid.upper_hz) & kept)
    iw = 1j * grid.omega
    # what the springs do to a mode says how far it is deflected, whatever the bases do
    moved = (view.deflection_spectrum * stiffness) @ plant.port_map @ shape[:, modes] / square[modes]
    power = np.stack([np.sum(np.abs(moved) ** 2, axis=0), np.sum(np.abs(iw[:, None] * moved) ** 2, axis=0)], axis=1)
    std = 2.0 * np.sqrt(power / (grid.padded * grid.samples))
    # a blow as soft as the mode is slow: the overtones of a hard one end at the edge of the band and ring there
    blow = np.exp(0.5 * (1.0 - (grid.omega**2)[:, None] / square[modes]))
    velocity = (view.response.output_from_wrench @ (plant.mass @ shape[:, modes])) * blow[:, None, :]
    free = np.stack([iw[:, None, None] * velocity, velocity], axis=3).reshape(*velocity.shape[:2], -1)
    names: list[tuple[str, str]] = []
    spectra = [np.zeros((*velocity.shape[:2], 0), dtype=complex)]
    for number, block in enumerate(view.blocks.begins):
        first, _ = view.data.stretches[view.blocks.stretch[block]]
        after = f"_after_gap_{number}" if number else ""
        names += [(f"mode_{mode + 1}{after}", name) for mode in modes for name in ("displacement", "velocity")]
        spectra.append(grid.rate_hz * np.exp(-iw * (first / grid.rate_hz + FADE_S))[:, None, None] * free)
    return names, np.tile(std.ravel(), len(view.blocks.begins)), np.concatenate(spectra, axis=2)


def found_motion(view: RunView, residual: ComplexArray) -> ComplexArray:
    """Return the free motion in the outputs that the leading blocks of a residual show, spectra of shape (F, ny) both.

    Least squares with the standard deviations of the state; what a model misses in the other blocks is the noise of the first.
    """
    _, std, spectra = initial_motions(view)
    count, begins = view.blocks.count, np.array(view.blocks.begins, dtype=int)
    number = np.arange(count)
    leading = number - begins[np.searchsorted(begins, number, side="right") - 1] < LEADING
    leading[make_splits(count, view.blocks.begins).judge] = False
    if not len(std) or np.all(leading):
        return np.zeros_like(residual)
    weight, grid = view.grid.band_weight, view.grid
    # channels of different units: each in units of what it measures
    size = np.sqrt(np.sum(np.abs(view.data.output_spectrum * weight[:, None]) ** 2, axis=0))
    signals = np.concatenate([spectra * std, residual[:, :, None]], axis=2) / np.maximum(size, 1e-300)[:, None]
    signals = grid.decimated_signal(signals * weight[:, None, None])[view.blocks.index] * view.blocks.weight[:, :, None, None]
    noise = max(float(np.mean(signals[~leading, :, :, -1] ** 2)), 1e-300)
    rows = signals[leading].reshape(-1, len(std) + 1)
    normal = rows[:, :-1].T @ rows[:, :-1] / noise + np.eye(len(std))
    return np.asarray(spectra @ (std * np.linalg.solve(normal, rows[:, :-1].T @ rows[:, -1] / noise)))
