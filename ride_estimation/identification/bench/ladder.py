# Copyright 2026 ride_estimation contributors
"""Which model of the ladder the records support: fit each, score it on data it did not see, choose by a stated criterion.

Criterion: ``N_eff ln(mse) + P ln(N_eff)`` with the mean squared error on held-out data, P parameters, and N_eff the number
of independent samples of the best model's held-out residual (Schwarz' criterion with the sample size that correlated
residuals really carry). The smallest wins.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.identification.bench.models import BenchModel
from ride_estimation.identification.bench.time_domain import PreparedRecord, TimeDomainFit, fit_time_domain
from ride_estimation.identification.bench.uncertainty import effective_samples
from ride_estimation.metrics import nrmse

Array = NDArray[np.float64]

CRITERION = "N_eff ln(held-out mean squared error) + P ln(N_eff), N_eff from the residual's autocorrelation; smallest wins"
#: share of the force's standard deviation below which errors do not count: no bench resolves less
RESOLUTION = 1.0e-4
NORMS = ("std", "max", "range")
#: blocks of the paired resampling of the held-out data
_BLOCKS = 40


@dataclasses.dataclass(frozen=True)
class HeldOut:
    """Measured and modelled force of one stretch that was not fitted."""

    name: str
    time_s: Array
    displacement: Array
    measured: Array
    modelled: Array

    def scores(self) -> dict[str, float]:
        """Return NRMSE in the three named norms."""
        return {norm: nrmse(self.measured, self.modelled, norm) for norm in NORMS}


@dataclasses.dataclass(frozen=True)
class Rung:
    """One fitted model of the ladder with its held-out results.

    Attributes
    ----------
    fit
        Identified parameters.
    fitted
        NRMSE on the fitted data, three norms.
    held_out
        Held-out stretches with the model's force.
    mse
        Mean squared error over all held-out samples, each record scaled by its variance.
    criterion
        See the module.
    gain, gain_over
        Fall of the held-out root mean squared error, 1 - ratio, against the best rung with fewer parameters; NaN for the
        simplest.
    gain_ci95
        95 % interval of the gain by paired resampling of blocks.
    """

    fit: TimeDomainFit
    fitted: dict[str, float]
    held_out: tuple[HeldOut, ...]
    mse: float
    criterion: float = np.nan
    gain: float = np.nan
    gain_ci95: tuple[float, float] = (np.nan, np.nan)
    gain_over: str = ""


def residual_offset(measured: Array, modelled: Array) -> float:
    """Return the force offset of a stretch, the mean of its residual [N] (load-cell zero and preload)."""
    return float(np.mean(measured - modelled))


def evaluate(fit: TimeDomainFit, prepared: Sequence[PreparedRecord], validation: Sequence[PreparedRecord]) -> Rung:
    """Score a fit on what it was fitted to and on what it was not."""
    measured, modelled, held = [], [], []
    for item in prepared:
        force = fit.force(item.motion)
        keep = item.fitted
        offset = residual_offset(item.force[keep], force[keep])
        measured.append(item.force[keep])
        modelled.append(force[keep] + offset)
        if item.held_out is not None:
            held.append(_held_out(item, force + offset, item.held_out, " (held-out stretches)"))
    for item in validation:
        force = fit.force(item.motion)
        keep = item.fitted
        held.append(_held_out(item, force + residual_offset(item.force[keep], force[keep]), keep, ""))
    all_measured, all_modelled = np.concatenate(measured), np.concatenate(modelled)
    fitted = {norm: nrmse(all_measured, all_modelled, norm) for norm in NORMS}
    errors = np.concatenate([(h.measured - h.modelled) / np.std(h.measured) for h in held])
    return Rung(fit, fitted, tuple(held), float(np.mean(errors**2)))


def _held_out(item: PreparedRecord, force: Array, keep: NDArray[np.bool_], suffix: str) -> HeldOut:
    return HeldOut(
        item.record.name + suffix, item.record.time_s[keep], item.record.displacement[keep], item.force[keep], force[keep]
    )


def climb(
    models: Sequence[BenchModel],
    prepared: Sequence[PreparedRecord],
    validation: Sequence[PreparedRecord],
    *,
    progress: Callable[[float], None] | None = None,
) -> tuple[tuple[Rung, ...], int]:
    """Fit every model of the ladder; return the rungs and the index of the chosen one."""
    rungs: list[Rung] = []
    for model in models:
        rungs.append(evaluate(fit_time_domain(model, prepared), prepared, validation))
        if progress is not None:
            progress(1.0)
    best = int(np.argmin([r.mse for r in rungs]))
    independent = sum(effective_samples(h.measured - h.modelled) for h in rungs[best].held_out)
    scored = []
    for i, rung in enumerate(rungs):
        criterion = independent * np.log(max(rung.mse, RESOLUTION**2)) + rung.fit.model.parameter_count * np.log(independent)
        base = simpler(rungs, i)
        gain, interval = (np.nan, (np.nan, np.nan)) if base is None else paired_gain(base, rung)
        over = "" if base is None else base.fit.model.name
        scored.append(dataclasses.replace(rung, criterion=float(criterion), gain=gain, gain_ci95=interval, gain_over=over))
    return tuple(scored), int(np.argmin([r.criterion for r in scored]))


def simpler(rungs: Sequence[Rung], index: int) -> Rung | None:
    """Return the rung with fewer parameters that does best on held-out data, or None for the simplest."""
    fewer = [r for r in rungs if r.fit.model.parameter_count < rungs[index].fit.model.parameter_count]
    return min(fewer, key=lambda r: r.mse, default=None)


def paired_gain(before: Rung, after: Rung, seed: int = 0, draws: int = 400) -> tuple[float, tuple[float, float]]:
    """Return ``1 - rmse_after / rmse_before`` on held-out data and its 95 % interval by resampling blocks of time."""
    sums = []
    for a, b in zip(before.held_out, after.held_out, strict=True):
        n = a.measured.size
        edges = np.linspace(0, n, min(_BLOCKS, max(2, n // 20)) + 1).astype(int)[:-1]
        scale = float(np.var(a.measured))
        sums.append(np.stack([np.add.reduceat((h.measured - h.modelled) ** 2 / scale, edges) for h in (a, b)], axis=1))
    blocks = np.concatenate(sums)
    total = blocks.sum(axis=0)
    rng = np.random.default_rng(seed)
    picks = rng.integers(0, blocks.shape[0], size=(draws, blocks.shape[0]))
    drawn = blocks[picks].sum(axis=1)
    gains = 1.0 - np.sqrt(drawn[:, 1] / np.maximum(drawn[:, 0], 1e-300))
    gain = float(1.0 - np.sqrt(total[1] / max(total[0], 1e-300)))
    return gain, (float(np.quantile(gains, 0.025)), float(np.quantile(gains, 0.975)))
