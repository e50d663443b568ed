# Copyright 2026 ride_estimation contributors
"""Readings that a chassis-side sensor could not show, estimated from what the model misses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.effect import Where
from ride_estimation.diagnosis.run_view import RunView

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_ITERATIONS = 40
_SETTLED = 1e-3  # residual of the linear system, relative


def missing_readings(view: RunView, index: int, cut: NDArray[np.bool_], side: float, spread: float) -> tuple[Array, float]:
    """Return what is missing from an input where it was cut, and how many numbers the data determine of it.

    Least squares over the cut samples alone, ``min |W (r - T e)|^2 + |e|^2 / spread^2`` by conjugate gradients: r the
    residual, T the transfer of the input to the outputs, W the whitening, e zero where nothing was cut. Parts of the wrong
    sign are dropped.

    Parameters
    ----------
    index
        Input channel.
    cut
        Samples at the level, shape (N,).
    side
        +1 where the upper peaks are cut, -1 where the lower ones are.
    spread
        Expected size of the missing part [m/s^2].

    Returns
    -------
    tuple
        Missing part, shape (N,), and its effective number of free values: two per hertz of the bandwidth of T and second
        of cut signal.
    """
    grid = view.grid
    transfer = view.response.output_from_input[:, :, index]
    white = np.einsum("fij,fj->fi", view.noise.whitener, transfer)
    power = np.sum(np.abs(white) ** 2, axis=1)
    bandwidth = float(power.sum() ** 2 / max(float(np.sum(power**2)), 1e-300)) * grid.rate_hz / grid.padded
    free = 2.0 * bandwidth * float(cut.sum()) / grid.rate_hz
    residual = view.residual_spectrum + _already(view, index)
    seen = np.einsum("fi,fi->f", np.conj(white), np.einsum("fij,fj->fi", view.noise.whitener, residual))
    mask = cut.astype(float)
    right = grid.signal(seen) * mask
    missing = np.zeros(grid.samples)
    rest = right.copy()
    direction = rest.copy()
    energy = first = float(rest @ rest)
    for _ in range(_ITERATIONS):
        if energy <= _SETTLED**2 * first:
            break
        image = (grid.signal(power * grid.spectrum(direction)) + direction / spread**2) * mask
        step = energy / float(direction @ image)
        missing += step * direction
        rest -= step * image
        energy, before = float(rest @ rest), energy
        direction = rest + (energy / before) * direction
    return side * np.maximum(side * missing, 0.0), free


def domes(cut: NDArray[np.bool_]) -> Array:
    """Return a parabola of unit height over every run of cut samples, shape (N,).

    For predictions, which may not look at what the outputs say about the cut samples. How far a Gaussian signal exceeds a
    level on average hardly depends on how long it stays above it, as long as fast ripple rides on slow motion.
    """
    out = np.zeros(len(cut))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], cut.astype(int), [0]])))
    for first, last in zip(edges[0::2], edges[1::2]):
        u = (np.arange(last - first) + 0.5) / (last - first)
        out[first:last] = 4.0 * u * (1.0 - u)
    return out


def _already(view: RunView, index: int) -> ComplexArray:
    """Return what the model already knows of the input, as outputs, shape (F, ny)."""
    out: ComplexArray = np.zeros_like(view.residual_spectrum)
    for effect in view.state.effects:
        if effect.where is Where.INPUT and effect.index == index:
            out = out + view.response.output_from_input[:, :, index] * view.grid.spectrum(effect.signal)[:, None]
    return out
