# Copyright 2026 ride_estimation contributors
"""Full fit of a set of hypotheses by simulation error: model, laws on the deflection it predicts, shapes, calibration."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.baseline import Adjustable, port_columns
from ride_estimation.diagnosis.calibration import Calibrated, file_parameters, stepped
from ride_estimation.diagnosis.effect import Column, Effect, Where
from ride_estimation.diagnosis.hypothesis import Fitted, Hypothesis, Sign
from ride_estimation.diagnosis.noise import temper_of
from ride_estimation.diagnosis.regression import Regression
from ride_estimation.diagnosis.scene import ModelState, Scene
from ride_estimation.diagnosis.screening import Projector, Score, mean_rows, price, solve_signed
from ride_estimation.diagnosis.splits import Splits

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclasses.dataclass(frozen=True)
class FullFit:
    """A model extended by some hypotheses, fitted on some blocks.

    Attributes
    ----------
    scene
        Run seen through the extended model.
    fitted
        One entry per hypothesis.
    regression
        Baseline columns at the extended model with the residual that no effect is taken from.
    rows
        Whitened rows of the effect columns, shape (B, R, q).
    block_misfit
        Sum of squares of every block at the solution, shape (B,).
    misfit
        Sum of squares on the fit blocks.
    held_out
        Sum of squares on the select blocks with the coefficients of the fit blocks alone.
    penalty
        Squared deviations from priors and mean readings.
    price
        Price of the hypotheses [nat].
    """

    scene: Scene
    fitted: tuple[Fitted, ...]
    regression: Regression
    adjustables: tuple[Adjustable, ...]
    rows: Array
    coefficients: Array
    covariance: Array
    block_misfit: Array
    misfit: float
    held_out: float
    penalty: float
    price: float

    def log_likelihood(self, temper: float) -> float:
        """Return the penalised log-likelihood of the fit blocks [nat], up to a constant common to all models."""
        return -0.5 * (self.misfit / temper + self.penalty) - self.price

    @property
    def causes(self) -> tuple[str, ...]:
        """Return the cause ids."""
        return tuple(f.hypothesis.cause for f in self.fitted)


def combined_effects(columns: Sequence[Column], coefficients: Array) -> tuple[Effect, ...]:
    """Return one effect per entry point with the coefficients applied; mean readings are left out."""
    total: dict[tuple[Where, int], Array] = {}
    for column, value in zip(columns, coefficients):
        if value == 0.0:
            continue
        for effect in column:
            if effect.where is not Where.MEAN:
                key = (effect.where, effect.index)
                total[key] = total.get(key, 0.0) + value * effect.signal
    return tuple(Effect(where, index, signal) for (where, index), signal in total.items())


def inherent_misfit(fit: FullFit, blocks: IntArray, seed: int) -> float:
    """Return the sum of squares that a right model keeps because its laws see noisy deflections.

    Linear propagation of base noise is in the whitening; a law with a steep part (friction, clearance, stop) spreads it
    further. The difference of the law forces along the estimated deflection with and without one more realisation of its
    error measures how much.
    """
    noisy = fit.scene.with_deflection_noise(seed)
    total = np.zeros(fit.rows.shape[:2])
    for f in fit.fitted:
        if not np.any(f.coefficients):
            continue
        pair = [s.push([combined_effects(f.hypothesis.columns(s, f.shape), f.coefficients)])[:, :, 0] for s in (fit.scene, noisy)]
        total += pair[1] - pair[0]
    return float(np.sum(total[blocks] ** 2))


class FullFitter:
    """Fits sets of hypotheses against one calibrated model.

    Parameters
    ----------
    calibrated
        Best linear model; its whitening and tolerance columns are kept.
    splits
        Blocks; shapes and coefficients come from those of fit and select together.
    samples
        Effective number of samples of the fit, for prices.
    """

    def __init__(self, calibrated: Calibrated, splits: Splits, samples: float) -> None:
        self._cal, self._splits, self._samples = calibrated, splits, samples
        self._blocks = blocks = splits.train
        self._dof = float(calibrated.scene.block_dof[blocks].sum())
        self._prior = file_parameters(calibrated.scene.plant)
        self._ports = [i for i, a in enumerate(calibrated.adjustables) if a.kind in ("stiffness", "damping")]

    def _regression(self, scene: Scene, residual: Array, temper: float) -> tuple[tuple[Adjustable, ...], Regression]:
        """Return the regression with port columns of this scene and the tolerance columns of the calibrated model."""
        cal = self._cal
        adjustables, rows = port_columns(scene, self._prior)
        everything = list(cal.adjustables)
        for i, a in zip(self._ports, adjustables):
            everything[i] = a
        std = np.array([a.prior_std for a in everything])
        offset = np.array([a.offset for a in everything])
        return tuple(everything), cal.regression.replaced(self._ports, rows, residual, (std, offset), temper)

    def fit(self, start: Sequence[Score | Fitted], iterations: int = 4) -> FullFit:
        """Fit hypotheses together, starting from screening scores or earlier fits.

        Parameters
        ----------
        start
            One per hypothesis.
        iterations
            Passes of simulation, shape search and regression.
        """
        cal = self._cal
        scene = cal.scene
        shapes = [dict(s.shape) for s in start]
        hypotheses = [s.hypothesis for s in start]
        effects: tuple[Effect, ...] = ()
        state = ModelState(scene.state.stiffness, scene.state.damping)
        temper = cal.regression.temper
        best: FullFit | None = None
        best_moves = np.inf
        for iteration in range(iterations + 1):
            if iteration:
                scene = Scene(
                    cal.scene.plant, cal.scene.data, dataclasses.replace(state, effects=effects), cal.scene.settings,
                    cal.scene,
                )
            residual = scene.residual
            if effects:
                residual = residual + scene.push([effects])[:, :, 0]
            adjustables, regression = self._regression(scene, residual, temper)
            projector = Projector(regression, self._blocks)
            if iteration in (1, 2):
                self._search_shapes(scene, projector, hypotheses, shapes)
            result = self._solve(scene, regression, adjustables, projector, hypotheses, shapes)
            moves = np.max(np.abs(result.coefficients[self._ports]), initial=0.0)
            settled = best is not None and iteration > 1 and moves < 0.03 and best.misfit - result.misfit < 2.0 * temper
            # a result whose stiffness and damping still move is a linearisation, not a model
            if best is None or result.misfit < best.misfit or (best_moves > 0.1 and moves < best_moves):
                best, best_moves = result, float(moves)
            elif iteration > 2:
                settled = True
            if settled:
                break
            temper = temper_of(result.misfit / self._dof, scene.inefficiency)
            p = regression.count
            state = stepped(state, scene, adjustables, result.coefficients[:p])
            columns = [c for h, s in zip(hypotheses, shapes) for c in h.columns(scene, s)]
            effects = combined_effects(columns, result.coefficients[p:])
        if best is None:
            raise ValueError("at least one pass is needed")
        return best

    def _solve(
        self, scene: Scene, regression: Regression, adjustables: tuple[Adjustable, ...], projector: Projector,
        hypotheses: Sequence[Hypothesis], shapes: Sequence[dict[str, float]],
    ) -> FullFit:
        counts, columns, signs = [], [], []
        for h, shape in zip(hypotheses, shapes):
            own = h.columns(scene, shape)
            counts.append(len(own))
            columns += own
            signs += list(h.column_signs(len(own)))
        rows, means = scene.push(columns), mean_rows(self._cal.table, columns)
        normal, right = projector.reduce(rows, means)
        coefficients, _ = solve_signed(normal, right, signs)
        used = [i for i, c in enumerate(coefficients) if c != 0.0]
        grams = regression.candidate_grams(rows[:, :, used])
        fit = regression.fit(grams, self._blocks, None, means[:, used])
        p = regression.count
        full = np.zeros(p + len(columns))
        covariance = np.zeros((p + len(columns), p + len(columns)))
        keep = np.array([*range(p), *(p + i for i in used)])
        full[keep] = fit.coefficients
        covariance[np.ix_(keep, keep)] = fit.covariance
        fitted, start, cost = [], p, 0.0
        for h, shape, count in zip(hypotheses, shapes, counts):
            part = slice(start, start + count)
            fitted.append(Fitted(h, full[part], covariance[part, part], dict(shape)))
            cost += price(h, int(np.count_nonzero(full[part])), self._samples, 1)
            start += count
        misfit = regression.block_misfit(grams, fit.coefficients)
        alone = regression.fit(grams, self._splits.fit, None, means[:, used])
        held_out = regression.misfit(grams, self._splits.select, alone.coefficients)
        on_fit = float(misfit[self._blocks].sum())
        penalty = (fit.objective - on_fit) / regression.temper
        return FullFit(
            scene, tuple(fitted), regression, adjustables, rows, full, covariance, misfit, on_fit, held_out, penalty, cost
        )

    def _search_shapes(
        self, scene: Scene, projector: Projector, hypotheses: Sequence[Hypothesis], shapes: list[dict[str, float]]
    ) -> None:
        """Improve shape parameters one at a time with the linear coefficients eliminated; changes ``shapes``."""
        for index, h in enumerate(hypotheses):
            if not h.shapes:
                continue
            others = [c for i, (o, s) in enumerate(zip(hypotheses, shapes)) if i != index for c in o.columns(scene, s)]
            other_signs = [
                sign for i, (o, s) in enumerate(zip(hypotheses, shapes)) if i != index
                for sign in o.column_signs(len(o.columns(scene, s)))
            ]

            def drop(
                trial: dict[str, float],
                h: Hypothesis = h,
                others: list[Column] = others,
                signs: list[Sign] = other_signs,
            ) -> float:
                own = h.columns(scene, trial)
                columns = own + others
                normal, right = projector.reduce(scene.push(columns, single=True), mean_rows(self._cal.table, columns))
                return solve_signed(normal, right, [*h.column_signs(len(own)), *signs])[1]

            current = drop(shapes[index])
            for shape in h.shapes:
                for number in range(len(shape.moves(shapes[index][shape.name]))):
                    for value in shape.moves(shapes[index][shape.name])[number]:
                        trial = {**shapes[index], shape.name: value}
                        gained = drop(trial) if value != shapes[index][shape.name] else current
                        if gained <= current + 0.5:
                            break
                        current, shapes[index] = gained, trial
