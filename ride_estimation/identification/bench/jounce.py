# Copyright 2026 ride_estimation contributors
"""Staged identification of the jounce-bumper white box (document 004, parameterisation).

1. static record: static curve, hysteresis height and Dahl slopes, linear but for three slopes;
2. dynamic records: contact points from the envelope of what the static part leaves, then rates, entry and stiffnesses;
3. balance: all parameters on all records, objective the mean of the records' squared NRMSE while loaded.

In every stage the linear parameters are eliminated; stiffnesses and heights stay non-negative.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.identification.bench.jounce_consistent import fit_consistent
from ride_estimation.identification.bench.jounce_model import Load, WhiteBox, loaded_nrmse, split_static
from ride_estimation.identification.bench.jounce_search import RATE_SHARE, fit_balance, mean_nrmse
from ride_estimation.identification.bench.jounce_static import fit_static
from ride_estimation.identification.bench.reversals import noise_level
from ride_estimation.identification.bench.variable_projection import solve_linear

Array = NDArray[np.float64]

CELLS = 5
#: most rounds of the balance, and the share of the error beyond the noise that a round has to take away to be followed by another
ROUNDS, WORTHWHILE = 4, 0.05


def identify_white_box(
    loads: Sequence[Load], *, progress: Callable[[float], None] | None = None
) -> tuple[WhiteBox, dict[str, dict[str, float]]]:
    """Run the three stages; return the white box and the NRMSE per record after each stage."""
    static, dynamic = split_static(loads)
    stages: dict[str, dict[str, float]] = {}
    box = fit_static(static, max(float(load.travel.max()) for load in loads))
    _note(stages, "static", box, loads, progress)
    box = pre_estimate(box, dynamic)
    _note(stages, "pre-estimate", box, loads, progress)
    box = fit_balance(box, static + dynamic, free="cells")
    _note(stages, "dynamic", box, loads, progress)
    box = balance(box, loads)
    _note(stages, "balance", box, loads, progress)
    return box, stages


def balance(box: WhiteBox, loads: Sequence[Load]) -> WhiteBox:
    """Fit all parameters to all records in short rounds, as long as a round lowers the mean NRMSE beyond the noise floor.

    A round that does not lower the mean NRMSE is undone and is the last.
    """
    noise = float(np.mean([(noise_level(load.force) / load.scale) ** 2 for load in loads]))
    best, score = box, mean_nrmse(box, loads)
    for _ in range(ROUNDS):
        trial = fit_consistent(best, loads)
        trial_score = mean_nrmse(trial, loads)
        if trial_score >= score:
            break
        beyond, before = (max(value**2 - noise, 1e-12) for value in (trial_score, score))
        best, score = trial, trial_score
        if beyond > (1.0 - WORTHWHILE) ** 2 * before:
            break
    return best


def _note(
    stages: dict[str, dict[str, float]], name: str, box: WhiteBox, loads: Sequence[Load], progress: Callable[[float], None] | None
) -> None:
    stages[name] = {load.name: loaded_nrmse(load, box.force(load)) for load in loads}
    if progress is not None:
        progress(1.0)


def pre_estimate(box: WhiteBox, dynamic: Sequence[Load]) -> WhiteBox:
    """Place the contact points where the envelope of the dynamic stiffening bends (document 004, pre-identification)."""
    largest = float(box.basis.knots[-1])
    edges = np.linspace(0.0, largest, 41)
    centres = 0.5 * (edges[1:] + edges[:-1])
    envelope = np.zeros(centres.size)
    for load in dynamic:
        left = load.force - box.force(load)
        index = np.clip(np.digitize(load.travel, edges) - 1, 0, centres.size - 1)
        loaded = load.travel > 0.0
        for i in range(centres.size):
            values = left[loaded & (index == i)]
            if values.size > 20:
                envelope[i] = max(envelope[i], float(np.quantile(values, 0.99)))
    envelope = np.maximum.accumulate(envelope)
    shares = np.array([0.02, 0.25, 0.5, 0.7, 0.85])
    starts = [largest * shares, largest * np.linspace(0.02, 0.8, CELLS), largest * np.linspace(0.02, 0.95, CELLS) ** 1.0]
    best_points, best_cost = starts[0], np.inf

    def residual(points: Array) -> Array:
        hinges = np.maximum(centres[:, None] - np.sort(points)[None, :], 0.0)
        return np.asarray(hinges @ _not_negative(hinges, envelope) - envelope)

    for start in starts:
        found = scipy.optimize.least_squares(
            residual, start, bounds=(-1e-9, 0.97 * largest), x_scale=largest, diff_step=1e-3, max_nfev=40
        )
        if found.cost < best_cost:
            best_points, best_cost = np.sort(found.x), float(found.cost)
    spread = np.maximum(best_points, 0.0)
    hinges = np.maximum(centres[:, None] - spread[None, :], 0.0)
    k = _not_negative(hinges, envelope)
    fastest = min(load.step_s for load in dynamic)
    # above the static excitation, below the fastest dynamic one
    rate = min(2.0 * np.pi * 5.0, 0.2 * RATE_SHARE * 2.0 / fastest)
    return dataclasses.replace(
        box, contacts=spread, rates=np.full(CELLS, rate) * np.geomspace(0.7, 1.4, CELLS), stiffness=k, smooth=0.02 * largest
    )


def _not_negative(columns: Array, target: Array) -> Array:
    """Return the coefficients, none below zero, whose combination of columns is nearest to the target."""
    return solve_linear(columns.T @ columns, columns.T @ target, np.ones(columns.shape[1], dtype=bool))[0]
