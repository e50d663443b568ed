# Copyright 2026 ride_estimation contributors
"""The ladder in the frequency domain: fit operating points, score points left out and held-out records.

Criterion: ``n ln(mean squared relative error of left-out points) + P ln(n)``, n the real numbers left out over all folds.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.columns import simulate
from ride_estimation.identification.bench.element_mapping import element_mapping
from ride_estimation.identification.bench.frequency_domain import (
    FrequencyDomainFit,
    fit_frequency_domain,
    relative_sigma,
)
from ride_estimation.identification.bench.harmonic_stiffness import complex_stiffness
from ride_estimation.identification.bench.ladder import RESOLUTION, HeldOut, residual_offset
from ride_estimation.identification.bench.models import BenchModel, ladder_for, model_by_name
from ride_estimation.identification.bench.steady_cycles import OperatingPoints
from ride_estimation.identification.bench.time_domain import PreparedRecord

Array = NDArray[np.float64]

CRITERION = "n ln(mean squared relative error of left-out operating points) + P ln(n); smallest wins"
#: folds in which operating points are left out in turn
FOLDS = 4


@dataclasses.dataclass(frozen=True)
class FrequencyRung:
    """One model of the frequency-domain ladder.

    Attributes
    ----------
    fit
        Fit to all operating points.
    fitted, left_out
        Root mean squared relative error of K* on fitted and on left-out points.
    criterion
        See the module.
    held_out
        Force over validation records.
    """

    fit: FrequencyDomainFit
    fitted: float
    left_out: float
    criterion: float
    held_out: tuple[HeldOut, ...]


@dataclasses.dataclass(frozen=True)
class FrequencyIdentification:
    """Everything the command reports of a frequency-domain identification."""

    points: OperatingPoints
    rungs: tuple[FrequencyRung, ...]
    chosen: int
    element: dict[str, Any]
    warnings: tuple[str, ...]

    @property
    def best(self) -> FrequencyRung:
        """Return the chosen rung."""
        return self.rungs[self.chosen]


def identify_operating_points(
    points: OperatingPoints,
    validation: Sequence[PreparedRecord],
    *,
    model: str = "auto",
    norm: str = "complex_modulus",
    progress: Callable[[float], None] | None = None,
) -> FrequencyIdentification:
    """Climb the ladder on operating points.

    Parameters
    ----------
    points
        Measured operating points.
    validation
        Records in the time domain that are not used for the fit.
    model
        ``auto``: all rungs, those with more parameters than the points carry are left out with a warning; else the rung that is
        wanted, beside the simpler ones.
    norm
        See :mod:`~ride_estimation.identification.bench.frequency_domain`.
    progress
        Called with 1 after each model.
    """
    rungs, warnings = [], []
    for candidate in ladder_for(model):
        if 2 * points.omega.size * (FOLDS - 1) // FOLDS <= candidate.parameter_count:
            warnings.append(f"{candidate.name} left out: {points.omega.size} operating points are too few for its parameters")
        else:
            rungs.append(_rung(candidate, points, validation, norm))
        if progress is not None:
            progress(1.0)
    if not rungs or model not in ("auto", rungs[-1].fit.model.name):
        wanted = "any model" if model == "auto" else f"the {model_by_name(model).parameter_count} parameters of {model}"
        raise InputDataError(f"{points.omega.size} operating points are too few for {wanted}")
    if np.any(points.stiffness.imag < 0.0):
        worst = int(np.argmin(points.stiffness.imag / np.abs(points.stiffness)))
        warnings.append(
            f"negative loss at {np.sum(points.stiffness.imag < 0.0)} of {points.omega.size} operating points, worst at "
            f"{points.omega[worst] / (2 * np.pi):.3g} Hz and {1e3 * points.amplitude[worst]:.3g} mm: "
            "force and displacement are skewed in time"
        )
    chosen = int(np.argmin([r.criterion for r in rungs])) if model == "auto" else len(rungs) - 1
    best = rungs[chosen]
    return FrequencyIdentification(points, tuple(rungs), chosen, element_mapping(best.fit), tuple(warnings))


def _subset(points: OperatingPoints, keep: NDArray[np.bool_]) -> OperatingPoints:
    return OperatingPoints(points.omega[keep], points.amplitude[keep], points.stiffness[keep], points.force_std[keep])


def _rung(model: BenchModel, points: OperatingPoints, validation: Sequence[PreparedRecord], norm: str) -> FrequencyRung:
    sigma = relative_sigma(points)
    order = np.lexsort((points.omega, points.amplitude))
    fold = np.empty(order.size, dtype=int)
    fold[order] = np.arange(order.size) % FOLDS
    left = np.empty(points.omega.size, dtype=complex)
    for k in range(FOLDS):
        out = fold == k
        if out.any():
            part = fit_frequency_domain(model, _subset(points, ~out), norm=norm, starts=4)
            left[out] = complex_stiffness(model.layout, part.theta, part.coefficients, points.omega[out], points.amplitude[out])
    fit = fit_frequency_domain(model, points, norm=norm)
    own = complex_stiffness(model.layout, fit.theta, fit.coefficients, points.omega, points.amplitude)
    weight = (sigma.min() / sigma) ** 2
    errors = [float(np.sqrt(np.average(np.abs(v / points.stiffness - 1.0) ** 2, weights=weight))) for v in (own, left)]
    n = 2 * points.omega.size
    criterion = n * float(np.log(max(errors[1], RESOLUTION) ** 2)) + model.parameter_count * float(np.log(n))
    held = []
    for item in validation:
        force = simulate(model.layout, item.motion, fit.theta, fit.coefficients)
        force += residual_offset(item.force, force)
        held.append(HeldOut(item.record.name, item.record.time_s, item.record.displacement, item.force, force))
    return FrequencyRung(fit, errors[0], errors[1], criterion, tuple(held))
