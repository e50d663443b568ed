# Copyright 2026 ride_estimation contributors
"""Predicts a run with the calibrated or the extended model from its initial state on, and scores the prediction."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri, stdtrit

from ride_estimation.diagnosis.calibration.baseline import Adjustable, baseline_spectra, mean_table
from ride_estimation.diagnosis.calibration.initial_state import found_motion
from ride_estimation.diagnosis.calibration.linear_model import build_regression, file_parameters, step_factor
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.common.effect import Effect, Where, combined_effects
from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted
from ride_estimation.diagnosis.model.plant import Plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.fitting import held_effects, with_effects
from ride_estimation.diagnosis.search.screening import Projector, screen
from ride_estimation.diagnosis.search.shape_search import ShapeTrials
from ride_estimation.diagnosis.search.waveform import port_forces

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]

_STRETCH = 2  # neighbouring blocks that are drawn together where an interval is estimated
_PASSES = 12
_HISTORY = 4  # passes a step is extrapolated from
_LOST = 4.0  # change over the smallest one at which the fixed point runs away
_NEWTON_PASSES = 3  # of Newton's method on whole signals, full rotation renewed after each
_GUESS = 0.5  # relative change of the law forces above which what came out is a guess
_SETTLED = 0.02  # relative change of the law forces at which the fixed point counts as reached


@dataclasses.dataclass(frozen=True)
class Model:
    """A model to predict with: port parameters, tolerances and found causes.

    Attributes
    ----------
    adjustables, coefficients
        Of the regression at ``state``; port entries are steps of logarithms.
    scales
        Of the fitted run.
    plant
        What the regression was made with, where that is not the plant of the data.
    """

    state: ModelState
    adjustables: tuple[Adjustable, ...]
    coefficients: Array
    fitted: tuple[Fitted, ...] = ()
    scales: dict[int, tuple[float, float]] | None = None
    plant: Plant | None = None

    def stepped_state(self, ports: dict[tuple[str, str], int]) -> ModelState:
        """Return stiffness and damping with the last step applied."""
        k, c = self.state.stiffness.copy(), self.state.damping.copy()
        for a, value in zip(self.adjustables, self.coefficients):
            if a.kind == "stiffness":
                k[ports[(a.place, a.axis)]] *= step_factor(value)
            elif a.kind == "damping":
                c[ports[(a.place, a.axis)]] *= step_factor(value)
        return ModelState(k, c)


@dataclasses.dataclass(frozen=True)
class Prediction:
    """A predicted run: view without accepted effects' tolerance part and the full predicted output spectrum (F, ny).

    Attributes
    ----------
    settled
        Whether the law forces are those along the predicted deflections, as far as a prediction can be told from a guess.
    fitted
        The causes, those that belong to one run only as they were fitted again.
    """

    view: RunView
    spectrum: ComplexArray
    settled: bool = True
    fitted: tuple[Fitted, ...] = ()

    def told(self, blocks: IntArray) -> IntArray:
        """Return the blocks without those in which something of this run alone sets in: no other stretch tells how it does.

        A load on a spring bounces for another block. All blocks where the others are fewer than half.
        """
        middle = self.view.blocks.time_s[blocks]
        length = self.view.blocks.index.shape[1] / self.view.grid.decimated_rate_hz
        quiet = np.ones(len(blocks), dtype=bool)
        for shape in (f.shape for f in self.fitted if f.hypothesis.run_bound and "at" in f.shape):
            reach = 0.5 * (length + shape.get("over", 0.0))
            quiet &= (middle < shape["at"] - reach) | (middle > shape["at"] + reach + length)
        return blocks[quiet] if 2 * np.count_nonzero(quiet) >= len(blocks) else blocks

    def residual(self) -> Array:
        """Return the in-band residual in measured units, shape (N, ny)."""
        view = self.view
        return view.grid.signal((view.data.output_spectrum - self.spectrum) * view.grid.band_weight[:, None])

    def measured(self) -> Array:
        """Return the in-band measured outputs, shape (N, ny)."""
        return self.view.grid.signal(self.view.data.output_spectrum * self.view.grid.band_weight[:, None])


def predict(data: RunData, model: Model, blocks: IntArray | None = None, at_rest: bool = False) -> Prediction:
    """Predict a run, from the initial state that its first blocks show.

    Parameters
    ----------
    data
        Run to predict.
    model
        What to predict with.
    blocks
        Blocks on which causes that belong to one run only (a disturbance, a change during the run) may be fitted again;
        None keeps their coefficients.
    at_rest
        The run begins at rest, and its outputs are not looked at.
    """
    data = data.with_plant(model.plant or data.plant)
    plant = data.plant
    ports = {(p.mount, p.axis): i for i, p in enumerate(plant.ports)}
    state = model.stepped_state(ports)
    fitted = list(model.fitted)
    # a law may carry most of its mount: without its equivalent of the fitted run the first deflections would be far too large
    start = dataclasses.replace(state, held=model.state.held) if fitted else state
    view, missed = RunView(data, start, scales=model.scales, sees_outputs=bool(fitted)), 0.0
    if fitted:
        if blocks is not None:
            fitted = [_refitted(view, f, np.asarray(blocks, dtype=int)) for f in fitted]
        view, missed = _settled(view, state, fitted)
    values = {a.name: v for a, v in zip(model.adjustables, model.coefficients) if a.kind not in ("stiffness", "damping")}
    adjusted = view.model.predicted_spectrum.copy()
    for a, spectrum, _ in baseline_spectra(view, mean_table(view), file_parameters(plant)):
        if values.get(a.name, 0.0) != 0.0:
            adjusted += values[a.name] * spectrum
    if not at_rest:
        adjusted += found_motion(view, data.output_spectrum - adjusted)
    return Prediction(view, adjusted, missed < _GUESS, tuple(fitted))


def _settled(seen: RunView, state: ModelState, fitted: list[Fitted]) -> tuple[RunView, float]:
    """Return the view whose effects are those of the laws along its own deflection, and by which share they still are not.

    ``seen`` is the run through the model the fixed point starts from, whose noise model all views share. Views that follow
    do not see the measured outputs.

    Fixed point: the equivalent linear part of every law force joins stiffness and damping of its port, only the remainder is
    iterated, each step extrapolated from the last few (Anderson 1965, J. ACM 12). Where the law is too stiff for that (a hard
    stop on a rougher road) Newton steps are taken; the view whose effects were nearest to its laws is returned.
    """
    def unseen(now: ModelState) -> RunView:
        return RunView(seen.data, now, seen.noise, seen.scales, sees_outputs=False)

    def laws(at: RunView) -> tuple[Effect, ...]:
        columns = [c for f in fitted for c in f.hypothesis.forces(at, f.shape)]
        return combined_effects(columns, np.concatenate([f.beyond(at.plant) for f in fitted]))

    before: tuple[Effect, ...] = ()
    view, nearest, best = seen, np.inf, seen.state
    tried: list[Array] = []
    missed: list[Array] = []
    for number in range(_PASSES):
        target = laws(view)
        if number:
            known = {(e.where, e.index): e.signal for e in before}
            target = tuple(e for e in target if (e.where, e.index) in known)
            change = _relative_change(target, known)
            if change < nearest:
                nearest, best = change, view.state
            if change < _SETTLED or not change < _LOST * nearest:
                break
            tried.append(np.concatenate([known[e.where, e.index] for e in target]))
            missed.append(np.concatenate([e.signal for e in target]) - tried[-1])
            step = _extrapolated(tried[-_HISTORY:], missed[-_HISTORY:])
            target = tuple(Effect(e.where, e.index, part) for e, part in zip(target, np.split(step, len(target))))
        before = target
        view = unseen(with_effects(view, state, target))
    if nearest >= _GUESS and any(e.where is Where.PORT for e in before):
        view = unseen(seen.state)
        for _ in range(_NEWTON_PASSES):
            view = unseen(port_forces(view, laws))
            change = _missed_laws(view, laws(view))
            if change < _SETTLED:
                return view, change
    return (view if view.state is best else unseen(best)), nearest


def _missed_laws(view: RunView, target: tuple[Effect, ...]) -> float:
    """Return the largest relative rms by which the port forces of a view miss their laws."""
    out = 0.0
    for e in (e for e in target if e.where is Where.PORT):
        held = next(f.signal for f in held_effects(view, every=True) if f.index == e.index)
        own = next((f.signal for f in view.state.effects if (f.where, f.index) == (e.where, e.index)), np.zeros(1))
        out = max(out, float(np.std(e.signal - held - own)) / max(float(np.std(e.signal)), 1e-300))
    return out


def _extrapolated(tried: list[Array], missed: list[Array]) -> Array:
    """Return the next trial of a fixed point from trials and what they missed it by: the mixture that would miss least."""
    if len(tried) < 2:
        return tried[-1] + missed[-1]
    trials, misses = np.diff(np.array(tried), axis=0), np.diff(np.array(missed), axis=0)
    share = np.linalg.lstsq(misses.T, missed[-1], rcond=1e-6)[0]
    return np.asarray(tried[-1] + missed[-1] - share @ (trials + misses))


def _relative_change(effects: tuple[Effect, ...], known: dict[tuple[Where, int], Array]) -> float:
    """Return the largest relative rms change of effects."""
    return max(
        (
            float(np.std(e.signal - known[e.where, e.index])) / max(float(np.std(known[e.where, e.index])), 1e-300)
            for e in effects
        ),
        default=0.0,
    )


def _refitted(view: RunView, fitted: Fitted, blocks: NDArray[np.int64]) -> Fitted:
    """Return a run-bound cause fitted again on some blocks of another run; other causes as they are."""
    if not fitted.hypothesis.run_bound:
        return fitted
    cause, wanted = library()[fitted.hypothesis.cause], fitted.hypothesis
    same = [
        h for h in cause.hypotheses(view)
        if h.run_bound and (h.location, h.axis) == (wanted.location, wanted.axis)
    ]
    if not same:
        return dataclasses.replace(fitted, coefficients=np.zeros_like(fitted.coefficients))
    table, _, regression = build_regression(view, file_parameters(view.plant))
    projector = Projector(regression, blocks)
    best = screen(view, table, projector, same, float(view.block_dof[blocks].sum()))[0]
    trials = ShapeTrials(view, table, projector, best.hypothesis)
    shape = trials.searched(dict(best.shape))
    return Fitted(best.hypothesis, trials.coefficients(shape), fitted.covariance, shape)


def _pooled_channels(view: RunView) -> tuple[list[int], Array | None]:
    """Return the channels that are pooled and, where gyros are among them, what their squares are multiplied by.

    Accelerations, and angular rates in units of them, for rad/s and m/s^2 cannot be added: made as large in the mean, but not so
    large that their noise would be more than that of the accelerations. The displacements where there are only those.
    """
    outputs, power = view.plant.outputs, np.sum(np.abs(view.data.output_spectrum * view.grid.band_weight[:, None]) ** 2, axis=0)
    moving = [i for i, s in enumerate(outputs) if s.kind != "displacement"]
    rates = np.array([outputs[i].kind == "rate" for i in moving], dtype=bool)
    if not np.any(rates):
        return moving or list(range(len(outputs))), None
    if np.all(rates):
        return moving, None
    weights = np.ones(len(moving))
    sizes = (x[moving] for x in (power, view.data.output_noise**2))
    weights[rates] = min(float(np.mean(x[~rates])) / max(float(np.mean(x[rates])), 1e-300) for x in sizes)
    return moving, weights


def block_squares(prediction: Prediction) -> tuple[Array, Array]:
    """Return residual and measured sums of squares of every block pooled over the channels of motion, shape (B,) each.

    In units of acceleration, see :func:`_pooled_channels`.
    """
    view = prediction.view
    used, weights = _pooled_channels(view)
    ratio = view.grid.rate_hz / view.grid.decimated_rate_hz
    first = np.round(view.blocks.index[:, 0] * ratio).astype(int)
    length = round(view.blocks.index.shape[1] * ratio)
    error, signal = prediction.residual()[:, used] ** 2, prediction.measured()[:, used] ** 2
    if weights is not None:
        error, signal = error * weights, signal * weights
    keep = view.data.measured.valid[:, None]
    return (
        np.array([float((error * keep)[i : i + length].sum()) for i in first]),
        np.array([float((signal * keep)[i : i + length].sum()) for i in first]),
    )


def noise_squares(view: RunView) -> Array:
    """Return the sums of squares of every block that the measurement alone leaves in the residual, shape (B,).

    Body sensors directly, errors of the base motion by the model; over the same channels as :func:`block_squares`. Noise is the
    same in quiet blocks and in rough ones.
    """
    used, weights = _pooled_channels(view)
    noise_y = view.data.output_noise[used]
    through = np.sum(np.abs(view.noise.output_transfer[:, used] * view.noise.disturbance[:, None, :]) ** 2, axis=2)
    weight = view.grid.band_weight[:, None] ** 2
    if weights is not None:
        weight = weight * weights
    # mean square per sample: bins are variances per sample, each stands for two of the padded transform
    power = 2.0 * float(np.sum((through + noise_y**2) * weight)) / view.grid.padded
    return np.asarray(power * view.blocks.weight.sum(axis=1) * view.grid.rate_hz / view.grid.decimated_rate_hz)


def bootstrap_interval(
    baseline: Array, extended: Array, signal: Array, blocks: IntArray, resamples: int, seed: int
) -> tuple[float, float]:
    """Return the 95 % bootstrap interval of the NRMSE difference.

    Stretches of two neighbouring blocks are drawn, on a circle (Politis and Romano 1992): a road changes slowly and a body
    remembers. Percentiles are expanded for the small number of stretches (Hesterberg 2015, The American Statistician 69).

    Parameters
    ----------
    baseline, extended, signal
        Sums of squares of the judged blocks, shape (B,).
    blocks
        Their places in the run: blocks that are no neighbours are drawn one by one, shape (B,).
    """
    count = len(signal)
    length = _STRETCH if 2 * np.count_nonzero(np.diff(blocks) == 1) > count else 1
    drawn = -(-count // length)
    rng = np.random.default_rng(seed)
    first = rng.integers(0, count, (resamples, drawn, 1))
    pick = ((first + np.arange(length)) % count).reshape(resamples, -1)
    total = np.maximum(signal[pick].sum(axis=1), 1e-300)
    difference = np.sqrt(baseline[pick].sum(axis=1) / total) - np.sqrt(extended[pick].sum(axis=1) / total)
    # percentiles are those of a normal with variance (n - 1) / n; further out by as much as the t distribution is wider
    reach = float(stdtrit(drawn - 1, 0.975)) * np.sqrt(drawn / (drawn - 1.0)) if drawn > 1 else float(ndtri(0.975))
    low, high = np.quantile(difference, [ndtr(-reach), ndtr(reach)])
    return float(low), float(high)


def pooled_nrmse(errors: Array, signal: Array, blocks: Sequence[int] | IntArray) -> float:
    """Return the pooled NRMSE of some blocks."""
    index = np.asarray(blocks, dtype=int)
    return float(np.sqrt(errors[index].sum() / max(float(signal[index].sum()), 1e-300)))
