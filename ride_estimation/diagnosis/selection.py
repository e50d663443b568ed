# Copyright 2026 ride_estimation contributors
"""From score tests to a set of causes: shortlist, full fits, forward selection with backward check."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration import Calibrated
from ride_estimation.diagnosis.fitting import FullFit, FullFitter
from ride_estimation.diagnosis.hypothesis import Fitted, Hypothesis
from ride_estimation.diagnosis.noise import temper_of
from ride_estimation.diagnosis.regression import Regression
from ride_estimation.diagnosis.scene import Scene
from ride_estimation.diagnosis.screening import Projector, Score, screen
from ride_estimation.diagnosis.settings import Settings
from ride_estimation.diagnosis.splits import Splits

Array = NDArray[np.float64]

#: causes that are a large value of what every installation has a little of
_TOLERATED = {
    "sensor_gain": "gain", "sensor_misalignment": "misalignment", "wrong_sensor_position": "position",
    "sensor_delay": "delay", "cg_offset": "cg",
}  # fmt: skip
Build = Callable[[Scene], Sequence[Hypothesis]]


@dataclasses.dataclass(frozen=True)
class Candidate:
    """A fully fitted set of hypotheses with its likelihood."""

    fit: FullFit
    log_likelihood: float


@dataclasses.dataclass(frozen=True)
class Round:
    """One round of forward selection.

    Attributes
    ----------
    candidates
        Best first, log-likelihoods on one temper.
    reference
        Log-likelihood of the model before the round on the same temper.
    temper
        The common temper.
    """

    candidates: tuple[Candidate, ...]
    reference: float
    temper: float


@dataclasses.dataclass(frozen=True)
class Selection:
    """Outcome: the accepted model (None: the calibrated one) and every round."""

    accepted: FullFit | None
    rounds: tuple[Round, ...]


class Selector:
    """Selects causes on the fit and select blocks.

    Parameters
    ----------
    calibrated
        Best linear model.
    splits
        Blocks.
    build
        Hypotheses of a scene.
    settings
        Thresholds.
    progress
        Called with the share of the work done.
    """

    def __init__(
        self, calibrated: Calibrated, splits: Splits, build: Build, settings: Settings,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        self._cal, self._splits, self._build, self._settings = calibrated, splits, build, settings
        self._blocks = splits.train
        self._dof = float(calibrated.scene.block_dof[self._blocks].sum())
        self._fitter = FullFitter(calibrated, splits, self._dof)
        self._progress = progress or (lambda share: None)
        fit, regression = calibrated.fit, calibrated.regression
        self.base_misfit = regression.misfit(regression.grams, self._blocks, fit.coefficients)
        alone = regression.fit(regression.grams, splits.fit)
        self._base_held_out = regression.misfit(regression.grams, splits.select, alone.coefficients)
        self._base_penalty = (fit.objective - self.base_misfit) / regression.temper

    @property
    def base_excess(self) -> float:
        """Return the misfit per degree of freedom of the calibrated model."""
        return self.base_misfit / self._dof

    def run(self) -> Selection:
        """Run forward selection with backward checks."""
        accepted: FullFit | None = None
        rounds: list[Round] = []
        for number in range(self._settings.maximum_causes):
            current = self._round(accepted)
            rounds.append(current)
            self._progress((number + 1) / self._settings.maximum_causes)
            if not current.candidates or not self._worthwhile(current, accepted):
                break
            accepted = self._without_idle(current.candidates[0].fit)
            if self._exhausted(accepted):
                break
        return Selection(accepted, tuple(rounds))

    def _exhausted(self, accepted: FullFit) -> bool:
        """Return whether too little is left, in the residual and in the mean readings, for any further cause to count."""
        if accepted.misfit < self._dof * (1.0 + 3.0 * np.sqrt(2.0 / self._dof)):
            return True
        left = (accepted.misfit - self._dof) / max(self.base_misfit - self._dof, 1e-9)
        return left < self._settings.relevance and accepted.penalty < 2.0 * self._settings.significance

    # ------------------------------------------------------------------ one round
    def _round(self, accepted: FullFit | None) -> Round:
        scene, regression = self._residual_problem(accepted)
        projector = Projector(regression, self._blocks)
        hypotheses = [h for h in self._build(scene) if accepted is None or not _taken(h, accepted)]
        scores = screen(scene, self._cal.table, projector, hypotheses, self._dof)
        short = shortlist(scores, self._settings.candidates if accepted is None else max(self._settings.candidates // 2, 3))
        start: list[Fitted] = list(accepted.fitted) if accepted is not None else []
        fits = [self._fitter.fit([*start, s], iterations=3) for s in short]
        fits = [f for f in fits if all(part.hypothesis.meaningful(part.coefficients) for part in f.fitted)]
        if accepted is not None:
            fits = [f for f in fits if beyond_tolerance(f)]
        tempers = [temper_of(f.misfit / self._dof, f.scene.inefficiency) for f in fits]
        temper = min(tempers, default=1.0)
        candidates = sorted(
            (Candidate(f, f.log_likelihood(temper)) for f in fits), key=lambda c: -c.log_likelihood
        )
        return Round(tuple(candidates), self._reference(accepted, temper), temper)

    def _residual_problem(self, accepted: FullFit | None) -> tuple[Scene, Regression]:
        cal = self._cal
        if accepted is None:
            return cal.scene, cal.regression
        base = accepted.regression
        used = [i for i in range(accepted.rows.shape[2]) if accepted.coefficients[base.count + i] != 0.0]
        columns = np.concatenate([base.columns, accepted.rows[:, :, used]], axis=2)
        root = np.sqrt(base.temper)
        means = np.hstack([base.mean_columns / root, np.zeros((len(base.mean_residual), len(used)))])
        return accepted.scene, Regression(
            base.residual, columns, base.mean_residual / root, means,
            np.concatenate([base.prior_std * root, np.full(len(used), 1e12)]),
            np.concatenate([base.prior_offset, np.zeros(len(used))]), base.temper,
        )

    def _reference(self, accepted: FullFit | None, temper: float) -> float:
        if accepted is None:
            return -0.5 * (self.base_misfit / temper + self._base_penalty)
        return accepted.log_likelihood(temper)

    def _worthwhile(self, current: Round, accepted: FullFit | None) -> bool:
        """Return whether the best candidate brings enough, in evidence and in share of the residual, and predicts.

        Predicts: with coefficients of the fit blocks alone it leaves less on the select blocks than the model before it.
        """
        best = current.candidates[0]
        if best.log_likelihood - current.reference < self._settings.significance:
            return False
        held_out = self._base_held_out if accepted is None else accepted.held_out
        if np.any(best.fit.rows) and best.fit.held_out >= held_out:
            return False
        before = self.base_misfit if accepted is None else accepted.misfit
        floor = min(self._dof, best.fit.misfit)
        removed = (before - best.fit.misfit) / max(before - floor, 1e-9)
        mean_only = best.fit.penalty + 2.0 * self._settings.significance < (
            self._base_penalty if accepted is None else accepted.penalty
        )
        # a second cause of a few per cent would be the part of the first that its law describes badly
        share_of_all = (before - best.fit.misfit) / max(self.base_misfit - floor, 1e-9)
        relevant = min(removed, share_of_all) > self._settings.relevance
        return relevant or mean_only

    def _without_idle(self, fit: FullFit) -> FullFit:
        """Return the fit without hypotheses that the others make unnecessary (backward check)."""
        while len(fit.fitted) > 1:
            temper = temper_of(fit.misfit / self._dof, fit.scene.inefficiency)
            trials = []
            for drop in range(len(fit.fitted)):
                rest = [f for i, f in enumerate(fit.fitted) if i != drop]
                trials.append(self._fitter.fit(rest, iterations=2))
            best = max(trials, key=lambda t: t.log_likelihood(temper))
            if fit.log_likelihood(temper) - best.log_likelihood(temper) > self._settings.significance:
                return fit
            fit = best
        return fit


def beyond_tolerance(fit: FullFit) -> bool:
    """Return whether the last hypothesis of a fit is more than an installation within its tolerance.

    Beside a cause whose law describes it badly, small errors of sensors and of the CG fit some of the rest; what three
    standard deviations of a good installation hold is calibration and no further cause.
    """
    last = fit.fitted[-1]
    kind, place, axis = _TOLERATED.get(last.hypothesis.cause), last.hypothesis.location, last.hypothesis.axis
    axis = {"roll": "x", "pitch": "y", "yaw": "z"}.get(axis, axis)
    limits = [
        a.prior_std for a in fit.adjustables
        if a.kind == kind and place in (a.place, "all") and axis in (a.axis, "")
    ]
    return not limits or abs(float(last.coefficients[0])) > 3.0 * max(limits)


def _taken(hypothesis: Hypothesis, accepted: FullFit) -> bool:
    return any(hypothesis.cause == f.hypothesis.cause and _same_place(hypothesis, f.hypothesis) for f in accepted.fitted)


def _same_place(a: Hypothesis, b: Hypothesis) -> bool:
    place = a.location == b.location or "all" in (a.location, b.location)
    return place and (a.axis == b.axis or not a.axis or not b.axis)


def shortlist(scores: Sequence[Score], count: int) -> list[Score]:
    """Return the best scores, at most two places of one cause, at least the best of three causes."""
    out: list[Score] = []
    per_cause: dict[str, int] = {}
    if not scores:
        return out
    leading = scores[0].gain
    for s in scores:
        if len(out) >= count or s.gain <= 0.0:
            break
        if per_cause.get(s.hypothesis.cause, 0) >= 2:
            continue
        if len(out) >= 3 and s.gain < 0.15 * leading:
            break
        per_cause[s.hypothesis.cause] = per_cause.get(s.hypothesis.cause, 0) + 1
        out.append(s)
    return out
