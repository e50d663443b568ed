# Copyright 2026 ride_estimation contributors
"""What an extended model gains where nothing was fitted, and what it leaves."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.answer.result import Gain, JudgedBlocks, ValidationGain
from ride_estimation.diagnosis.answer.verdict import MISSED, shows_elsewhere
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.common.parallel import in_order
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.splits import LEAST_BLOCKS
from ride_estimation.diagnosis.hypotheses.hypothesis import Law
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.fitting import FullFit, inherent_misfit, tolerance_of
from ride_estimation.diagnosis.search.prediction import (
    Model,
    Prediction,
    block_squares,
    bootstrap_interval,
    noise_squares,
    pooled_nrmse,
    predict,
)
from ride_estimation.diagnosis.search.work import Work, within_tolerance
from ride_estimation.signals.recording import UniformRun

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]

_METRIC = "pooled NRMSE of the sensors of the body within the band (rms error over rms of the measured signal)"
_WITH_RATES = "; angular rates in units of acceleration, by their power or their noise"
#: share to which the noise floor itself is known: less above it is nothing that remains
FLOOR = 0.1
_AS_GOOD = 1.02  # error over another one up to which both count as the same


def refusal(work: Work, base: Prediction, extended: Prediction) -> str:
    """Return why causes that were accepted are not named, empty where nothing speaks against them."""
    if not _confirmed(work, base, extended):
        return "fitted the run but did not predict the judge blocks better"
    if not noticeable(work, base, extended):
        return (
            f"fitted the run better, by less than the {100 * work.settings.adequacy:.1f} % of any channel that count as right"
        )
    return ""


def judged_in_band(work: Work) -> bool:
    """Return whether accepted causes have to show in the residual of the band.

    Not those that show in mean readings, and not those without which the model needs more than a good installation has.
    """
    accepted = work.selection.accepted
    relieved = work.calibrated.strained and accepted is not None and not accepted.strained
    return _in_band(accepted) and not relieved


def _in_band(accepted: FullFit | None) -> bool:
    return accepted is not None and accepted.in_band


def _confirmed(work: Work, base: Prediction, extended: Prediction) -> bool:
    """Return whether the extended model predicts the judge blocks better, or no worse where means are the evidence."""
    judge = extended.told(work.splits.judge)
    (before, signal), (after, _) = block_squares(base), block_squares(extended)
    tolerated = 1.0 if _in_band(work.selection.accepted) else _AS_GOOD
    return pooled_nrmse(after, signal, judge) < tolerated * pooled_nrmse(before, signal, judge)


def noticeable(work: Work, base: Prediction, extended: Prediction) -> bool:
    """Return whether the accepted causes explain more of some channel than a model that counts as right may miss.

    With little noise and a long run the score tests see errors of a thousandth, which every model has. Judged where nothing
    was fitted. A model that explains the run with more than a good installation has says nothing about what the causes explain.
    """
    if not judged_in_band(work):
        return True
    inside = base.view.data.block_window(extended.told(work.splits.judge))[:, None]
    parts = (base.residual(), extended.residual(), base.measured())
    before, after, signal = (np.sum((part * inside) ** 2, axis=0) for part in parts)
    # a channel near a node is the small difference of two motions, each of which the model may miss by so much
    return bool(np.any(before - after > work.settings.adequacy**2 * base.view.noise.power_ratio * signal))


@dataclasses.dataclass(frozen=True)
class ValidationRun:
    """A run that takes no part in fits.

    Attributes
    ----------
    data
        The run.
    residual
        Spectrum of what the calibrated model misses, shape (F, ny).
    errors, signal, noise
        Sums of squares of every block, shape (B,) each: of that residual, of the measured signal, of what the measurement alone
        leaves.
    """

    data: RunData
    residual: ComplexArray
    errors: Array
    signal: Array
    noise: Array

    @classmethod
    def of(cls, data: RunData, calibrated: Model) -> ValidationRun:
        """Return a run as the calibrated model predicts it."""
        plain = predict(data, calibrated)
        return cls(data, data.output_spectrum - plain.spectrum, *block_squares(plain), noise_squares(plain.view))

    @property
    def name(self) -> str:
        """Return the name of the run."""
        return self.data.measured.name

    def nrmse(self, errors: Array, blocks: IntArray) -> float:
        """Return the NRMSE of a model over some blocks from its squared errors of all, shape (B,)."""
        return pooled_nrmse(errors, self.signal, blocks)


def usable_runs(work: Work, validation: Sequence[UniformRun]) -> tuple[list[ValidationRun], list[str]]:
    """Return the validation runs that measure what the model needs, and warnings about the others."""
    usable, warnings = [], []
    for other in validation:
        try:
            data = RunData(work.plant, measurement(work.plant, other), work.settings)
        except KeyError as error:
            warnings.append(f"validation run {other.name}: sensor {error} is missing; not used")
            continue
        if data.blocks.count < LEAST_BLOCKS:
            warnings.append(f"validation run {other.name}: too short; not used")
            continue
        usable.append(data)
    runs = in_order(lambda data: ValidationRun.of(data, work.baseline), usable, work.settings.threads)
    return list(runs), warnings


@dataclasses.dataclass(frozen=True)
class _Predicted:
    """What the extended model leaves of a validation run.

    Attributes
    ----------
    errors
        Squared errors of every block, shape (B,).
    judged, known
        Blocks that judge, and those of them that do not go beyond what its laws were fitted on.
    """

    errors: Array
    judged: IntArray
    known: IntArray


def _predicted(work: Work, run: ValidationRun) -> _Predicted | None:
    """Return what the extended model leaves of a validation run, None where its prediction did not settle."""
    count = run.data.blocks.count
    if not work.extended.fitted:
        every = np.arange(count, dtype=np.int64)
        return _Predicted(run.errors, every, every)
    bound = any(f.hypothesis.run_bound for f in work.extended.fitted)
    refit = np.arange(0, count, 2, dtype=np.int64) if bound else None
    better = predict(run.data, work.extended, refit)
    if not better.settled:
        return None
    judged = better.told(np.arange(1 if bound else 0, count, 2 if bound else 1, dtype=np.int64))
    return _Predicted(block_squares(better)[0], judged, in_range(work.selection.accepted, better.view, judged))


def measured_gain(
    work: Work, base: Prediction, extended: Prediction, validation: Sequence[ValidationRun]
) -> tuple[Gain, list[str]]:
    """Return the errors of the calibrated and the extended model where nothing was fitted, and warnings.

    On the validation runs, on the judge blocks of the run itself where there are none.
    """
    settings = work.settings
    warnings: list[str] = []
    (base_errors, signal), (ext_errors, _) = block_squares(base), block_squares(extended)
    judge = work.splits.judge if not work.extended.fitted else extended.told(work.splits.judge)
    baseline, after = (pooled_nrmse(e, signal, judge) for e in (base_errors, ext_errors))
    # what is unknown of the tilt of brackets is an upper limit: where a model leaves less, it was less
    floor = min(pooled_nrmse(noise_squares(base.view), signal, judge), baseline, after)
    results: list[ValidationGain] = []
    blocks: list[JudgedBlocks] = []
    predictions = in_order(lambda run: _predicted(work, run), validation, settings.threads)
    for run, found in zip(validation, predictions):
        if found is None:
            warnings.append(
                f"validation run {run.name}: the found law is so stiff there that its prediction did not settle; not used"
            )
            continue
        judged, known = found.judged, found.known
        before, left = (run.nrmse(e, judged) for e in (run.errors, found.errors))
        if left > _AS_GOOD * before:
            warnings.append(
                f"validation run {run.name}: the extended model is worse there than the calibrated one; "
                "its law was fitted on this run and may not hold beyond the strokes and speeds of it"
            )
        inside = None
        if len(known) < len(judged):
            # too few to judge a law by: the blocks of the run itself that fitted nothing
            inside = (baseline, after, floor)
            if enough_in_range(known, judged):
                there = [run.nrmse(e, known) for e in (run.errors, found.errors)]
                inside = (there[0], there[1], min(run.nrmse(run.noise, known), *there))
        results.append(ValidationGain(
            run.name, before, left, _interval(run.errors, found.errors, run.signal, judged, settings),
            min(run.nrmse(run.noise, judged), before, left), inside,
        ))
        blocks.append(JudgedBlocks(run.name, judged, found.errors[judged], run.signal[judged]))
    if not results:
        results.append(ValidationGain(
            f"{work.data.measured.name} (judge blocks)", baseline, after,
            _interval(base_errors, ext_errors, signal, judge, settings), floor,
        ))
        blocks.append(JudgedBlocks(work.data.measured.name, judge, ext_errors[judge], signal[judge]))
    if after > baseline * _AS_GOOD and work.extended.fitted:
        warnings.append("the extended model is worse than the calibrated one on the judge blocks of the run")
    metric = _METRIC + (_WITH_RATES if any(s.kind == "rate" for s in work.plant.outputs) else "")
    return Gain(metric, baseline, after, floor, tuple(results), tuple(blocks)), warnings


def _interval(baseline: Array, extended: Array, signal: Array, judged: IntArray, settings: Settings) -> tuple[float, float]:
    """Return the interval of the difference of two NRMSE on the judged ones of all blocks, shape (B,)."""
    return bootstrap_interval(
        baseline[judged], extended[judged], signal[judged], judged, settings.bootstrap, settings.seed
    )


def gain_over(gain: Gain, recorded: Sequence[tuple[Array, Array]], settings: Settings) -> Gain:
    """Return a gain whose baseline is the calibrated model of readings that were not put right.

    Parameters
    ----------
    recorded
        Squared errors of that model and squared signal of every block, of the runs of ``gain.blocks``, shape (B,) each.
    """
    results = []
    for v, judged, (errors, read) in zip(gain.validation, gain.blocks, recorded):
        # an error in g instead of m/s^2 scales the signal, too
        before = errors[judged.index] * float(judged.signal.sum()) / max(float(read[judged.index].sum()), 1e-300)
        results.append(dataclasses.replace(
            v, baseline=pooled_nrmse(before, judged.signal, np.arange(len(before))), in_range=None,
            ci95=bootstrap_interval(before, judged.errors, judged.signal, judged.index, settings.bootstrap, settings.seed),
        ))
    return dataclasses.replace(gain, baseline=results[0].baseline, validation=tuple(results))


def in_range(accepted: FullFit | None, view: RunView, blocks: IntArray) -> IntArray:
    """Return the blocks of another run in which the laws stay within what they were fitted on.

    A stop that the other road hits twice as deep is the same stop, and what it does there no run has told.
    """
    if accepted is None:
        return blocks
    inside = np.ones(len(blocks), dtype=bool)
    for law, name in ((Law.ELASTIC, "deflection"), (Law.VISCOUS, "deflection_rate")):
        laws = [f.hypothesis.ports for f in accepted.fitted if library()[f.hypothesis.cause].LAW is law]
        ports = sorted({p for group in laws for p in group})
        if ports:
            seen = _extremes(accepted.view, getattr(accepted.view, name)[:, ports], np.arange(accepted.view.blocks.count))
            here = _extremes(view, getattr(view, name)[:, ports], blocks)
            inside &= np.all((here[0] >= seen[0].min(axis=0)) & (here[1] <= seen[1].max(axis=0)), axis=1)
    return blocks[inside]


def enough_in_range(inside: IntArray, blocks: IntArray) -> bool:
    """Return whether the blocks inside of what laws were fitted on are enough of a run to judge them by."""
    return len(inside) >= max(LEAST_BLOCKS, len(blocks) // 4)


def _extremes(view: RunView, signals: Array, blocks: IntArray) -> tuple[Array, Array]:
    """Return the smallest and largest values of signals (N, q) in some blocks, shape (blocks, q) each."""
    parts = [signals[view.data.block_window(blocks[i : i + 1]) > 0.0] for i in range(len(blocks))]
    # both scatter about zero, which stands for blocks without samples
    least, most = ([f(part, axis=0, initial=0.0) for part in parts] for f in (np.min, np.max))
    shape = len(blocks), signals.shape[1]
    return np.reshape(least, shape), np.reshape(most, shape)


def remaining_energy(work: Work, base: Prediction, gain: Gain) -> tuple[float, float]:
    """Return the residual energy above the floor that remains, per degree of freedom, and its share of what there was.

    Without causes both are zero unless the calibrated model misses more than one that counts as right, here and elsewhere.
    """
    excess = max(work.selector.base_excess - 1.0, 0.0)
    accepted = work.selection.accepted
    if accepted is None:
        return (excess, 1.0) if discrepancy(work, base, gain) else (0.0, 0.0)
    dof = float(work.calibrated.view.block_dof[work.splits.train].sum())
    # a calibration strained far beyond a tolerance hides the fault and leaves no residual that the cause could remove
    excess = max(_misfit_within_tolerance(work, accepted) / dof - 1.0, excess)
    inherent = inherent_misfit(accepted, work.splits.train, work.settings.seed) / dof
    left = max(accepted.misfit / dof - 1.0 - inherent, 0.0)
    return left, (left / max(excess - inherent, left, 1e-9) if excess > 0.02 else 0.0)


def discrepancy(work: Work, base: Prediction, gain: Gain) -> bool:
    """Return whether the calibrated model misses more than one that counts as right, in the run and elsewhere."""
    errors, signal = block_squares(base)
    nrmse = pooled_nrmse(errors, signal, work.splits.train)
    floor = pooled_nrmse(noise_squares(base.view), signal, work.splits.train)
    missed = float(np.sqrt(max(nrmse**2 - floor**2, 0.0)))
    wrong = work.selector.base_excess - 1.0 > FLOOR and missed > MISSED * work.settings.adequacy
    return wrong and shows_elsewhere(gain, work.settings)


def _misfit_within_tolerance(work: Work, accepted: FullFit) -> float:
    """Return the misfit of the calibrated model whose tolerances that the accepted causes stand for are cut at their limits."""
    cal = work.calibrated
    named = {tolerance_of(f.hypothesis) for f in accepted.fitted}
    stands = [(a.kind, a.place, a.axis) in named for a in cal.adjustables]
    coefficients = np.where(stands, within_tolerance(cal.adjustables, cal.fit.coefficients), cal.fit.coefficients)
    return cal.regression.misfit(cal.regression.grams, work.splits.train, coefficients)
