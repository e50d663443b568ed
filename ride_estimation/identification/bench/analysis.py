# Copyright 2026 ride_estimation contributors
"""From bench records to a chosen model: prepare, climb the ladder, uncertainty, what stays unexplained."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.element_mapping import element_mapping
from ride_estimation.identification.bench.ladder import Rung, climb
from ride_estimation.identification.bench.models import ladder_for
from ride_estimation.identification.bench.record import BenchRecord, clipped_samples
from ride_estimation.identification.bench.reversals import noise_level
from ride_estimation.identification.bench.time_domain import PreparedRecord, TimeDomainFit, fit_time_domain, initial_rest, prepare
from ride_estimation.identification.bench.uncertainty import Uncertainty, uncertainty

Array = NDArray[np.float64]

#: share of a single record that is kept for validation
HELD_OUT_SHARE = 0.3


#: NRMSE of the chosen model from which force and displacement have hardly anything to do with each other
UNRELATED = 0.9
#: relative accuracy of the estimated noise of a force (median over four orders of differences)
NOISE_ACCURACY = 0.1


@dataclasses.dataclass(frozen=True)
class BenchIdentification:
    """Everything the command reports.

    Attributes
    ----------
    rungs
        The ladder.
    chosen
        Index of the chosen rung.
    fit
        The chosen model on all samples of the records to fit.
    uncertainty
        Of ``fit``.
    element
        YAML form of the element.
    prepared, validation
        The records used.
    noise
        Per record: estimated white noise of displacement [m] and force [N], dead band [m], reversals.
    unexplained
        What remains, in words.
    warnings
        All warnings of reading, preparing and fitting.
    """

    rungs: tuple[Rung, ...]
    chosen: int
    fit: TimeDomainFit
    uncertainty: Uncertainty
    element: dict[str, Any]
    prepared: tuple[PreparedRecord, ...]
    validation: tuple[PreparedRecord, ...]
    noise: tuple[dict[str, float | str], ...]
    unexplained: str
    warnings: tuple[str, ...]

    @property
    def best(self) -> Rung:
        """Return the chosen rung."""
        return self.rungs[self.chosen]


def identify_records(
    records: Sequence[BenchRecord],
    validation: Sequence[BenchRecord],
    *,
    model: str = "auto",
    progress: Callable[[float], None] | None = None,
) -> BenchIdentification:
    """Identify one element from bench records in the time domain.

    Parameters
    ----------
    records
        Checked records to fit.
    validation
        Checked records that are not fitted; empty: the last 30 % of each record is held out.
    model
        ``auto`` or a rung of the ladder.
    progress
        Called with 1 after each fitted model.
    """
    if not records:
        raise InputDataError("no record was given")
    share = 0.0 if validation else HELD_OUT_SHARE
    prepared = tuple(prepare(r, held_out_share=share) for r in records)
    held = tuple(prepare(r) for r in validation)
    models = ladder_for(model)
    rungs, chosen = climb(models, prepared, held, progress=progress)
    if model != "auto":
        chosen = len(rungs) - 1
    if not validation:
        # scores come from the fit that did not see the held-out stretches, the reported parameters from all samples
        prepared = tuple(prepare(r) for r in records)
    final = fit_time_domain(rungs[chosen].fit.model, prepared) if not validation else rungs[chosen].fit
    spread = uncertainty(final, prepared)
    element = element_mapping(final, max(p.motion.dead_band for p in prepared))
    warnings = [w for r in (*records, *validation) for w in r.warnings] + _coverage_warnings(prepared, held)
    if rungs[chosen].fitted["std"] > UNRELATED:
        warnings.append(
            f"{rungs[chosen].fit.model.name} explains hardly anything: its NRMSE on the fitted records is "
            f"{100 * rungs[chosen].fitted['std']:.0f} %: a wrong column, or no force of this displacement"
        )
    return BenchIdentification(
        rungs,
        chosen,
        final,
        spread,
        element,
        prepared,
        held,
        tuple(_noise(p) for p in prepared),
        unexplained(final, rungs[chosen], spread, prepared),
        tuple(dict.fromkeys(warnings)),
    )


def _noise(item: PreparedRecord) -> dict[str, float | str]:
    return {
        "record": item.record.name,
        "displacement_noise_m": item.motion.noise_std,
        "force_noise_n": noise_level(item.force),
        "dead_band_m": item.motion.dead_band,
        "low_pass_hz": item.motion.corner_hz,
        "reversals": float(item.motion.directions.size),
        "rest_left_out_s": initial_rest(item.motion) * item.motion.step_s,
        "clipped_left_out": float(clipped_samples(item.record).sum()),
    }


def _coverage_warnings(prepared: Sequence[PreparedRecord], held: Sequence[PreparedRecord]) -> list[str]:
    """Warn where validation goes beyond what was fitted."""
    widest = max(p.motion.stroke for p in prepared)
    pairs = [(h.record.name, h.motion.stroke) for h in held]
    return [
        f"{name}: its stroke of {1e3 * stroke:.3g} mm exceeds the fitted {1e3 * widest:.3g} mm: the score there is extrapolation"
        for name, stroke in pairs
        if stroke > 1.05 * widest
    ] + [
        f"{name}: its stroke of {1e3 * stroke:.3g} mm is only {100 * stroke / widest:.2g} % of the fitted {1e3 * widest:.3g} mm: "
        "the score there says nothing about large strokes"
        for name, stroke in pairs
        if stroke < 0.1 * widest
    ]


def unexplained(fit: TimeDomainFit, rung: Rung, spread: Uncertainty, prepared: Sequence[PreparedRecord]) -> str:
    """Say what the chosen model leaves unexplained, against the noise of the load cell."""
    noise = float(np.sqrt(np.mean([noise_level(item.force) ** 2 for item in prepared])))
    residual = fit.residual_std
    total = float(np.sqrt(np.mean([np.var(item.force) for item in prepared])))
    held = max(h.scores()["std"] for h in rung.held_out)
    head = (
        f"The residual on the fitted data is {residual:.3g} N rms ({100 * residual / total:.2g} % of the force's standard "
        f"deviation); the white noise of the force is estimated at {noise:.2g} N. "
    )
    chi_square = (residual / max(noise, 1e-12)) ** 2
    if chi_square < 1.0 + 2.0 * NOISE_ACCURACY + 3.0 * float(np.sqrt(2.0 / spread.effective_samples)):
        return head + f"Nothing beyond the noise is left unexplained in the fitted data (chi-square a degree {chi_square:.2g})."
    correlated = fit.samples / max(spread.effective_samples, 1.0)
    words = (
        f"What remains is {residual / max(noise, 1e-12):.2g} times that noise and correlated over "
        f"about {correlated:.0f} samples: "
        "a part of the force law (or of the bench: offset drift, skew between the channels, inertia of the fixture) is not "
        f"in the model. The worst held-out NRMSE is {100 * held:.2g} %."
    )
    return head + words
