# Copyright 2026 ride_estimation contributors
"""Calibrates the linear model by simulation error before anything is called a discrepancy."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.baseline import TILT_KINDS, Adjustable, MeanTable, baseline_columns, mean_table, port_columns
from ride_estimation.diagnosis.noise import temper_of
from ride_estimation.diagnosis.plant import Plant
from ride_estimation.diagnosis.regression import Fit, Regression
from ride_estimation.diagnosis.scene import Measurement, ModelState, Scene
from ride_estimation.diagnosis.settings import Settings

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

_STEP_LIMITS = (0.4, 2.5)  # smallest and largest factor of one Gauss-Newton step


@dataclasses.dataclass(frozen=True)
class Calibrated:
    """The best linear model of a run.

    Attributes
    ----------
    scene
        The run seen through it.
    regression
        Residual against all adjustables at the solution.
    fit
        Last solution on the fit blocks.
    """

    scene: Scene
    table: MeanTable
    adjustables: tuple[Adjustable, ...]
    regression: Regression
    fit: Fit
    blocks: IntArray

    def log_std(self, kind: str) -> Array:
        """Return the standard deviation of ln k or ln c of every port, shape (P,)."""
        out = np.full(len(self.scene.plant.ports), np.inf)
        for i, a in enumerate(self.adjustables):
            if a.kind == kind:
                out[self.scene.port_index(a.place, a.axis)] = np.sqrt(max(self.fit.covariance[i, i], 0.0))
        return out


def file_parameters(plant: Plant) -> tuple[Array, Array]:
    """Return stiffness and damping of the vehicle file, shape (P,) each."""
    return np.array([p.stiffness for p in plant.ports]), np.array([p.damping for p in plant.ports])


def build_regression(
    scene: Scene, prior: tuple[Array, Array]
) -> tuple[MeanTable, tuple[Adjustable, ...], Regression]:
    """Return the regression of a scene's residual on all adjustables."""
    table = mean_table(scene)
    adjustables, rows, means = baseline_columns(scene, table, prior)
    std = np.array([a.prior_std for a in adjustables])
    offset = np.array([a.offset for a in adjustables])
    return table, adjustables, Regression(scene.residual, rows, table.residual, means, std, offset)


def _port_regression(scene: Scene, prior: tuple[Array, Array]) -> tuple[tuple[Adjustable, ...], Regression]:
    """Return the regression of a scene's residual on stiffness and damping alone."""
    adjustables, rows = port_columns(scene, prior)
    std = np.array([a.prior_std for a in adjustables])
    offset = np.array([a.offset for a in adjustables])
    return adjustables, Regression(scene.residual, rows, np.zeros(0), np.zeros((0, len(adjustables))), std, offset)


def step_factor(value: float) -> float:
    """Return the factor that a coefficient of a stiffness or damping column stands for: the force is linear in both."""
    return float(np.clip(1.0 + value, *_STEP_LIMITS))


def stepped(state: ModelState, scene: Scene, adjustables: tuple[Adjustable, ...], coefficients: Array) -> ModelState:
    """Return the state after a Gauss-Newton step of stiffness and damping."""
    stiffness, damping = state.stiffness.copy(), state.damping.copy()
    for a, value in zip(adjustables, coefficients):
        if a.kind in ("stiffness", "damping"):
            factor = step_factor(value)
            target = stiffness if a.kind == "stiffness" else damping
            target[scene.port_index(a.place, a.axis)] *= factor
    return dataclasses.replace(state, stiffness=stiffness, damping=damping)


def tilted(plant: Plant, adjustables: tuple[Adjustable, ...], coefficients: Array) -> Plant:
    """Return the plant whose brackets follow every tilt by the share that a step found."""
    steps = {(a.kind, a.place, a.axis): float(v) for a, v in zip(adjustables, coefficients) if a.kind in TILT_KINDS}
    share = [s + steps[t.kind, t.place, t.axis] for s, t in zip(plant.tilt_share, plant.tilts)]
    return dataclasses.replace(plant, tilt_share=np.array(share))


def calibrate(
    plant: Plant, data: Measurement, settings: Settings, blocks: IntArray | None = None, iterations: int = 8
) -> Calibrated:
    """Fit stiffness and damping of every port by output error, all tolerances free within their priors.

    Parameters
    ----------
    blocks
        Blocks of the fit; all where None.
    iterations
        Largest number of Gauss-Newton steps.
    """
    prior = file_parameters(plant)
    state = ModelState(prior[0].copy(), prior[1].copy())
    best: Calibrated | None = None
    frozen = True  # tolerances join once stiffness and damping are near: they must not soak up a linearisation error
    for number in range(iterations):
        scene = Scene(plant, data, state, settings)
        if number == iterations - 1:
            frozen = False
        if frozen:
            adjustables, regression = _port_regression(scene, prior)
        else:
            table, adjustables, regression = build_regression(scene, prior)
        used = np.arange(scene.blocks.count) if blocks is None else blocks
        dof = float(scene.block_dof[used].sum())
        fit = regression.fit(regression.grams, used)
        for _ in range(2):
            temper = temper_of(regression.misfit(regression.grams, used, fit.coefficients) / dof, scene.inefficiency)
            regression = regression.with_temper(temper)
            fit = regression.fit(regression.grams, used)
        moves = [abs(v) for a, v in zip(adjustables, fit.coefficients) if a.kind in ("stiffness", "damping")]
        if not frozen:
            best = Calibrated(scene, table, adjustables, regression, fit, used)
            turns = [abs(v) for a, v in zip(adjustables, fit.coefficients) if a.kind in TILT_KINDS]
            if max(moves, default=0.0) < 0.02 and max(turns, default=0.0) < 0.1:
                break
            plant = tilted(plant, adjustables, fit.coefficients)
        frozen = frozen and max(moves, default=0.0) > 0.1
        state = stepped(state, scene, adjustables, fit.coefficients)
    if best is None:
        raise ValueError("at least one step is needed")
    return best
