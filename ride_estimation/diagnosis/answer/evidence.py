# Copyright 2026 ride_estimation contributors
"""Numbers about the residual: bands, lines, amplitude, time; and the arrays that the report draws."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.answer.result import Evidence
from ride_estimation.diagnosis.common.effect import Where
from ride_estimation.diagnosis.hypotheses.lines import residual_lines
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.prediction import Prediction

Array = NDArray[np.float64]

_UNITS = {"acceleration": "m/s^2", "displacement": "m", "rate": "rad/s"}
_EDGES_HZ = (0.4, 0.8, 1.5, 3.0, 6.0, 10.0, 15.0, 20.0, 30.0, 40.0)


def _white_power(prediction: Prediction) -> Array:
    """Return the whitened residual power per frequency and channel, one for a right model, shape (F, ny)."""
    view = prediction.view
    white = np.einsum("fij,fj->fi", view.noise.whitener, view.data.inside(view.data.output_spectrum - prediction.spectrum))
    weight = np.maximum(view.grid.band_weight[:, None] ** 2, 1e-6)
    return np.asarray(np.abs(white) ** 2 / view.grid.samples / weight)


def band_table(base: Prediction, extended: Prediction) -> tuple[tuple[str, float, float], ...]:
    """Return misfit per degree of freedom by band for both models."""
    f = base.view.grid.frequency
    p0, p1 = _white_power(base), _white_power(extended)
    inside = base.view.grid.band_weight > 0.5
    out = []
    for low, high in itertools.pairwise(_EDGES_HZ):
        pick = (f >= low) & (f < high) & inside
        if np.any(pick):
            out.append((f"{low:g}-{high:g} Hz", float(p0[pick].mean()), float(p1[pick].mean())))
    return tuple(out)


def residual_summary(base: Prediction, extended: Prediction, remaining: float, is_extended: bool) -> dict[str, Any]:
    """Return what remains, in numbers and in words."""
    view = extended.view
    bands = band_table(base, extended)
    lines = [{"frequency_hz": line.frequency_hz, "peak_over_median": line.ratio} for line in residual_lines(view)]
    error = extended.residual()
    inner = error[view.data.analysed_samples]
    kurtosis = float(np.mean(np.mean(inner**4, axis=0) / np.maximum(np.mean(inner**2, axis=0) ** 2, 1e-300)))
    ordered = np.sort(np.sum(inner[:, _pictured(view)] ** 2, axis=1))[::-1]
    top = float(ordered[: max(len(ordered) // 100, 1)].sum() / max(float(ordered.sum()), 1e-300))
    loudest = max(bands, key=lambda b: b[2]) if bands else ("", 1.0, 1.0)
    words = (
        f"{100 * remaining:.0f} % of the residual energy above the noise floor remains; "
        if is_extended else ""
    ) + f"largest in {loudest[0]} at {loudest[2]:.2f} times the noise; kurtosis {kurtosis:.1f}; " + (
        f"the largest 1 % of the residual samples carry {100 * top:.0f} % of the error energy; "
    ) + (f"{len(lines)} spectral lines" if lines else "no spectral line")
    return {
        "words": words,
        "remaining_share": float(remaining),
        "bands": [{"band": b, "baseline": p0, "extended": p1} for b, p0, p1 in bands],
        "lines": lines,
        "kurtosis": kurtosis,
        "top_one_percent_share": top,
    }


def make_evidence(base: Prediction, extended: Prediction) -> Evidence:
    """Return the arrays behind the pictures of the report."""
    view = base.view
    grid, n = view.grid, view.grid.samples
    residual = [np.abs(view.data.inside(view.data.output_spectrum - p.spectrum)) ** 2 for p in (base, extended)]
    noise = np.real(np.diagonal(view.noise.covariance, axis1=1, axis2=2))
    e0, e1, y = base.residual(), extended.residual(), base.measured()
    inner = view.data.analysed_samples
    rms = np.maximum(np.std(y[inner], axis=0), 1e-300)
    weight = grid.band_weight[:, None] ** 2
    floor = np.sqrt(np.sum(noise * weight, axis=0) * n) / np.maximum(
        np.sqrt(np.sum(np.abs(view.data.output_spectrum) ** 2 * weight, axis=0)), 1e-300
    )
    table = np.stack([np.std(e0[inner], axis=0) / rms, np.std(e1[inner], axis=0) / rms, floor], axis=1)
    part = _stretch(view, 6.0)
    time_s = view.data.time_s[part].copy()
    # copies: a view would keep the whole run for its six seconds
    signals = y[part].copy(), y[part] - e0[part], y[part] - e1[part]
    stretch = {
        s.name: (time_s, signals[0][:, i], signals[1][:, i], signals[2][:, i]) for i, s in enumerate(view.plant.outputs)
    }
    blocks = np.stack([_block_misfit(p) for p in (base, extended)], axis=1)
    shown = _pictured(view)
    return Evidence(
        grid.frequency, residual[0][:, shown].sum(axis=1) / n, residual[1][:, shown].sum(axis=1) / n, noise[:, shown].sum(axis=1),
        tuple(s.name for s in view.plant.outputs), table, band_table(base, extended), view.blocks.time_s, blocks,
        _loops(base, extended), stretch, _unit(view), tuple(s.name for s in view.plant.outputs if s.kind == "rate"),
    )


def _pictured(view: RunView) -> slice | list[int]:
    """Return the channels whose power is pooled in pictures: all without angular rates, where there are others."""
    others = [i for i, s in enumerate(view.plant.outputs) if s.kind != "rate"]
    return slice(None) if len(others) in (0, len(view.plant.outputs)) else others


def _unit(view: RunView) -> str:
    """Return the unit of the channels that are pooled."""
    kinds = {s.kind for s in view.plant.outputs}
    return " or ".join(_UNITS[k] for k in sorted(kinds) if k != "rate" or len(kinds) == 1)


def _block_misfit(prediction: Prediction) -> Array:
    view = prediction.view
    rows = view.rows((view.data.output_spectrum - prediction.spectrum)[:, :, None])[:, :, 0]
    return np.asarray((rows**2).sum(axis=1) / np.maximum(view.block_dof, 1e-9))


def _stretch(view: RunView, seconds: float) -> slice:
    """Return the first seconds that are analysed of the longest stretch between gaps."""
    begin, end = max(view.data.stretches, key=lambda s: s[1] - s[0])
    first = begin + round(view.settings.trim_s * view.grid.rate_hz)
    return slice(first, min(first + round(seconds * view.grid.rate_hz), end))


def _loops(base: Prediction, extended: Prediction) -> dict[str, tuple[Array, Array, Array, Array]]:
    """Return deflection, force of the calibrated and of the extended model and measured force of every port over ten seconds.

    Measured: the extended model and the forces that explain what it leaves of the readings; all along the deflection with these.
    """
    view, plain = extended.view, base.view.state
    part = _stretch(view, 10.0)
    extra = np.zeros_like(view.deflection)
    for effect in view.state.effects:
        if effect.where is Where.PORT:
            extra[:, effect.index] += effect.signal
    missed = view.grid.signal(view.missing_forces(view.residual_spectrum, 1.0))
    moved = view.with_port_forces(range(len(view.plant.ports)), missed)
    stiffness, damping = view.state.linear
    out = {}
    for p, port in enumerate(view.plant.ports):
        x, v = moved.deflection[part, p].copy(), moved.deflection_rate[part, p]
        total = stiffness[p] * x + damping[p] * v + extra[part, p]
        out[port.name] = (x, plain.stiffness[p] * x + plain.damping[p] * v, total, total + missed[part, p])
    return out
