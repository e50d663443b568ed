# Copyright 2026 ride_estimation contributors
"""An oscillator driven by a known excitation, as a diagnosis: is its spring linear.

The mass cannot be told from excitation and response, so everything is per unit mass and in units of the response. The ladder
of :mod:`ride_estimation.identification.bench.oscillator` is fitted by simulation error and compared on held-out samples.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.hypothesis import Reported
from ride_estimation.diagnosis.prediction import bootstrap_interval
from ride_estimation.diagnosis.result import (
    EXPLAINED,
    NO_DISCREPANCY,
    UNEXPLAINED,
    Diagnosis,
    Gain,
    NamedCause,
    Step,
    ValidationGain,
)
from ride_estimation.elements.cubic_spring import CubicSpring
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.identification.bench.oscillator import (
    OscillatorRecord,
    OscillatorRung,
    identify_oscillator,
    simulate_oscillator,
)
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

_UNKNOWN = 0.01  # probability that the cause is none of the ladder
_SETTLING_PERIODS = 30  # left out at the start of a simulation
_BLOCKS = 20  # resampled for intervals
_REMAINS = 0.25  # share of the linear model's squared error that may remain


def diagnose_oscillator(
    record: OscillatorRecord, fit: NDArray[np.bool_], validation: Sequence[OscillatorRecord] = ()
) -> Diagnosis:
    """Compare the linear oscillator with bent springs on data that were not fitted.

    Parameters
    ----------
    record
        Excitation and response.
    fit
        Samples that are fitted; the others judge, shape (N,).
    validation
        Further records that only judge.

    Raises
    ------
    InputDataError
        What :func:`identify_oscillator` refuses.
    """
    rungs, index = identify_oscillator(record, fit, validation)
    linear, best = rungs[0], rungs[index]
    remaining = best.mse / max(linear.mse, 1e-300)
    weights = np.exp(np.clip(-0.5 * np.array([r.criterion - best.criterion for r in rungs]), -700.0, 0.0))
    confidence = (1.0 - _UNKNOWN) * float(weights[1:].sum() / weights.sum()) * (1.0 - remaining)
    bent = index > 0
    verdict = NO_DISCREPANCY if not bent else EXPLAINED if remaining < _REMAINS else UNEXPLAINED
    judged = [(record, ~fit)] if np.any(~fit) else []
    judged += [(other, np.ones(other.u.size, dtype=bool)) for other in validation]
    gains = tuple(_gain(item, keep, linear, best) for item, keep in judged)
    causes = (_cause(best, max(confidence, 0.0)),) if bent else ()
    words = (
        f"The best oscillator ({best.name}) leaves {100 * best.mse**0.5:.2f} % of the held-out response, the linear one "
        f"{100 * linear.mse**0.5:.2f} %."
    )
    return Diagnosis(
        verdict,
        f"The spring is {'not ' if bent else ''}linear. {words}",
        causes,
        Gain("NRMSE of the simulated response", linear.mse**0.5, best.mse**0.5, 0.0, gains),
        {"words": words, "share": remaining},
        ("noise floor not known: one response channel", "mass not identifiable: unit mass assumed"),
        _vehicle(best),
        tuple(Step(r.name, r.mse**0.5, float("nan"), -0.5 * (r.criterion - linear.criterion)) for r in rungs),
    )


def _gain(record: OscillatorRecord, keep: NDArray[np.bool_], linear: OscillatorRung, best: OscillatorRung) -> ValidationGain:
    """Return the gain on samples that were not fitted, with the interval of resampled blocks."""
    settled = keep.copy()
    settled[: int(_SETTLING_PERIODS / (best.physical["frequency_hz"] * record.step_s))] = False
    parts = np.array_split(np.flatnonzero(settled), _BLOCKS)
    squares = []
    for rung in (linear, best):
        model, _ = simulate_oscillator(rung.coefficients, record.u, record.y[0], record.y[1], np.zeros(0, dtype=np.int64))
        error = np.nan_to_num(record.y - model, posinf=1e6, neginf=-1e6) ** 2
        squares.append(np.array([float(error[part].sum()) for part in parts]))
    signal = (record.y - np.mean(record.y[settled])) ** 2
    power = np.array([float(signal[part].sum()) for part in parts])
    before, after = (float(np.sqrt(s.sum() / power.sum())) for s in squares)
    return ValidationGain(record.name, before, after, bootstrap_interval(squares[0], squares[1], power, 400, 1), 0.0)


def _cause(best: OscillatorRung, confidence: float) -> NamedCause:
    p = best.physical
    return NamedCause(
        "stiffness_nonlinearity", "mount", "z",
        (
            Reported("cubic over linear rate", p["cubic"] / p["stiffness"], float("nan"), "per squared response"),
            Reported("quadratic over linear rate", p["quadratic"] / p["stiffness"], float("nan"), "per response"),
        ),
        confidence, (), "the same resonance frequency at a tenth and at ten times the level",
        "a sine sweep at two levels: a bent spring moves the resonance", "Does the restoring force bend with the response?",
    )  # fmt: skip


def _vehicle(best: OscillatorRung) -> Vehicle:
    """Return a unit mass on the found spring; the quadratic part has no element and is left out."""
    p = best.physical
    omega = 2.0 * np.pi * p["frequency_hz"]
    spring = CubicSpring(omega**2, omega**2 * p["cubic"] / p["stiffness"])
    element = SumOfElements((spring, KelvinVoigt(0.0, 2.0 * max(p["damping_ratio"], 0.0) * omega)))
    body = Body("head", Prior(1.0), np.zeros(3), np.eye(3), coordinates=("z",))
    return Vehicle("oscillator", {"head": body}, {"mount": Mount("mount", np.zeros(3), "head", "base", {"z": element})}, {})
