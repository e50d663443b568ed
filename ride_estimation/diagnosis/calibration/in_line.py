# Copyright 2026 ride_estimation contributors
"""Asks whether a run needs a mount to be soft, or whether it is explained as well by a mount that is not.

Mounts that move together share their force: of two stiffnesses along one axis at equal deflections only the sum is
observable, and the calibration splits it by what little else there is. The estimate of one of them may then be far off its
file and certain by its own account. What counts is what the run loses when that mount is held where the others are.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.baseline import Adjustable
from ride_estimation.diagnosis.calibration.linear_model import build_regression, file_parameters, stepped
from ride_estimation.diagnosis.calibration.regression import Regression
from ride_estimation.diagnosis.runs.noise import temper_of
from ride_estimation.diagnosis.runs.run_view import RunView

IntArray = NDArray[np.int64]

_FIXED = 1e-4  # standard deviation of ln k of the mount that is held
_PASSES = 3


def loss_without(view: RunView, port: int, factor: float, blocks: IntArray) -> float:
    """Return the log-likelihood that a run loses when one stiffness is held elsewhere [nat].

    The other mounts of the axis start with what keeps the sum of the stiffnesses, and everything else is calibrated again.

    Parameters
    ----------
    view
        The run seen through the final model.
    port
        Row of the stiffness.
    factor
        Where it is held, as a multiple of its calibrated value.
    blocks
        Blocks of the fit.
    """
    prior = file_parameters(view.plant)
    own, temper = _misfit(view, build_regression(view, prior)[2], blocks)
    held = view.plant.ports[port]
    others = [i for i, p in enumerate(view.plant.ports) if p.axis == held.axis and i != port]
    values = []
    for now in (view.state.stiffness, view.state.damping):
        new = now.copy()
        new[port] *= factor
        rest = float(now[others].sum())
        new[others] *= max(1.0 - (new[port] - now[port]) / max(rest, 1e-12), 0.3)
        values.append(new)
    state = dataclasses.replace(view.state, stiffness=values[0], damping=values[1])
    best = np.inf
    for _ in range(_PASSES):
        other = RunView(view.data, state, view.noise)
        _, adjustables, regression = build_regression(other, prior)
        fixed = _held(regression, adjustables, held.mount, held.axis)
        best = min(best, _misfit(other, fixed, blocks)[0])
        state = stepped(state, other, adjustables, fixed.with_temper(temper).fit(fixed.grams, blocks).coefficients)
    return float(0.5 * (best - own) / temper)


def _misfit(view: RunView, regression: Regression, blocks: IntArray) -> tuple[float, float]:
    """Return the sum of squares after calibration and its temper."""
    dof = float(view.block_dof[blocks].sum())
    fit = regression.fit(regression.grams, blocks)
    temper = temper_of(regression.misfit(regression.grams, blocks, fit.coefficients) / dof, view.inefficiency)
    fit = regression.with_temper(temper).fit(regression.grams, blocks)
    return regression.misfit(regression.grams, blocks, fit.coefficients), temper


def _held(regression: Regression, adjustables: tuple[Adjustable, ...], mount: str, axis: str) -> Regression:
    """Return the regression with one stiffness held where it is."""
    std, offset = regression.prior_std * np.sqrt(regression.temper), regression.prior_offset.copy()
    row = next(i for i, a in enumerate(adjustables) if (a.kind, a.place, a.axis) == ("stiffness", mount, axis))
    std[row], offset[row] = _FIXED, 0.0
    return regression.with_prior(std, offset)
