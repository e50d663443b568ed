# Copyright 2026 ride_estimation contributors
"""An oscillator driven by a known excitation, as a diagnosis: is its spring linear, and which law does its mount have else.

The mass cannot be told from excitation and response, so everything is per unit mass and in units of the response. The ladder
of :mod:`ride_estimation.identification.bench.oscillator` is fitted by simulation error on one part of the record, chosen on a
second and judged on a third and on further records. Where it leaves more than noise, the laws of
:mod:`ride_estimation.identification.bench.law_oscillator` are fitted as well.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.adapters.bench import incoherent_noise
from ride_estimation.diagnosis.adapters.oscillator_law import law_element, law_parameters
from ride_estimation.diagnosis.answer.result import (
    EXPLAINED,
    INSUFFICIENT,
    NO_DISCREPANCY,
    UNEXPLAINED,
    Diagnosis,
    Gain,
    NamedCause,
    Rival,
    Step,
    ValidationGain,
)
from ride_estimation.diagnosis.answer.verdict import describe
from ride_estimation.diagnosis.hypotheses.hypothesis import Reported
from ride_estimation.diagnosis.search.prediction import bootstrap_interval
from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.cubic_spring import CubicSpring
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.law_oscillator import LawFit, fit_laws, simulate_law
from ride_estimation.identification.bench.oscillator import (
    OscillatorRecord,
    OscillatorRung,
    identify_oscillator,
    simulate_oscillator,
)
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Model = Callable[[OscillatorRecord], Array]

_UNKNOWN = 0.01  # probability that the cause is none of the ladder
_SETTLING_PERIODS = 30  # left out at the start of a simulation
_BLOCKS = 20  # resampled for intervals
_REMAINS = 0.25  # share of the linear model's squared error that may remain
_MOSTLY = 0.5  # share from which on naming the best rung would mislead
_ABOVE_NOISE = 2.0  # error over the noise floor from which on a model is not the whole truth
_LEAST_SAMPLES = 3000  # 1000 to fit and as many to choose and to judge
_BETTER = 0.8  # held-out squared error over that of the best nonlinear spring below which a law describes the mount better
_UNRELATED = 0.95  # error of every model, as a share of the response, from which on the excitation does not explain it
_METRIC = "NRMSE of the response simulated from the excitation alone (rms error over rms of the measured response)"


def default_fit(count: int) -> BoolArray:
    """Return the samples to fit of a record: its first half, shape (count,)."""
    return np.arange(count) < count // 2


def diagnose_oscillator(
    record: OscillatorRecord, fit: BoolArray | None = None, validation: Sequence[OscillatorRecord] = ()
) -> Diagnosis:
    """Compare the linear oscillator with nonlinear springs on data that were not fitted.

    Parameters
    ----------
    record
        Excitation and response.
    fit
        Samples that are fitted, shape (N,); of the others every second block of a twentieth chooses the model and the rest
        judges. The first half where None.
    validation
        Further records that only judge.

    Returns
    -------
    Diagnosis
        Never raises for poor data: the verdict is then ``insufficient_data`` with the reason.

    Raises
    ------
    InputDataError
        Values that are not finite, another sample rate.
    """
    for item in (record, *validation):
        _check(item, record)
    fit = default_fit(record.u.size) if fit is None else fit
    choose, judge = _held_out(fit)
    try:
        if record.u.size < _LEAST_SAMPLES:
            raise InputDataError(f"the record has {record.u.size} samples; at least {_LEAST_SAMPLES} are needed")
        rungs, index = identify_oscillator(record, fit, (), choose)
    except InputDataError as error:
        return _insufficient(str(error))
    linear, best = rungs[0], rungs[index]
    if best.mse**0.5 > _UNRELATED:
        return _insufficient(
            f"no oscillator explains the response of {record.name} from its excitation: the best one leaves "
            f"{100 * best.mse**0.5:.0f} % of what was not fitted"
        )
    floor = incoherent_noise(record.y, record.u) / float(np.std(record.y))
    if best.mse**0.5 > _ABOVE_NOISE * floor:
        laws = fit_laws(record, fit, choose)
        if laws and laws[0].mse < _BETTER * best.mse:
            return _with_law(record, judge, validation, rungs, best, laws)
    model = _recursion(best)
    gains = tuple(_gain(item, keep, linear, model) for item, keep in [(record, judge), *((v, _all(v)) for v in validation)])
    own = gains[0]
    remaining = _remaining(own)
    nonlinear = index > 0 and own.ci95[0] > 0.0
    missed = max(own.baseline, own.extended) > _ABOVE_NOISE * own.noise_floor
    verdict = (EXPLAINED if remaining < _REMAINS else UNEXPLAINED) if nonlinear else UNEXPLAINED if missed else NO_DISCREPANCY
    causes = (_cause(rungs, best, remaining),) if nonlinear and remaining < _MOSTLY else ()
    shown = (*gains[1:], own)
    gain = Gain(_METRIC, own.baseline, own.extended if nonlinear else own.baseline, own.noise_floor, shown)
    return Diagnosis(
        verdict, describe(verdict, causes, gain, remaining), causes, gain,
        {"words": _words(own, best, nonlinear, remaining), "share": remaining if nonlinear else 1.0},
        ("mass not identifiable from excitation and response: the vehicle file has a unit mass",),
        _vehicle(best if nonlinear else linear),
        tuple(Step(r.name.replace("_", " "), r.mse**0.5, float("nan"), -0.5 * (r.criterion - linear.criterion)) for r in rungs),
        remarks=_remarks(best) if nonlinear else (),
    )  # fmt: skip


def _with_law(
    record: OscillatorRecord, judge: BoolArray, validation: Sequence[OscillatorRecord], rungs: Sequence[OscillatorRung],
    nonlinear: OscillatorRung, laws: Sequence[LawFit],
) -> Diagnosis:
    """Return the diagnosis of an oscillator that a law of the library describes better than any nonlinear spring."""
    law, linear = laws[0], rungs[0]

    def model(item: OscillatorRecord) -> Array:
        return simulate_law(law, item)

    gains = tuple(_gain(item, keep, linear, model) for item, keep in [(record, judge), *((v, _all(v)) for v in validation)])
    own = gains[0]
    remaining = _remaining(own)
    verdict = EXPLAINED if remaining < _REMAINS else UNEXPLAINED
    # twenty blocks tell two models apart, however many samples they have
    others = {law.law.cause: law.mse} | {"stiffness_nonlinearity": nonlinear.mse} | {f.law.cause: f.mse for f in laws[:0:-1]}
    others[law.law.cause] = law.mse
    weights = {cause: (law.mse / mse) ** (0.5 * _BLOCKS) for cause, mse in others.items()}
    confidence = (1.0 - _UNKNOWN) * weights[law.law.cause] / sum(weights.values()) * (1.0 - remaining**2)
    rivals = tuple(
        Rival(name, "mount", "z", f"leaves {ratio**0.5:.1f} times the error on what chooses", 0.5 * _BLOCKS * np.log(ratio), "")
        for name, ratio in ((name, mse / law.mse) for name, mse in others.items()) if name != law.law.cause
    )
    cause = NamedCause(
        law.law.cause, "mount", "z", law_parameters(law), confidence, rivals, "loops that another law describes as well",
        "the same excitation at a tenth and at three times the level", "Which law does the mount have beside its spring?",
    )
    element, remarks = law_element(law)
    gain = Gain(_METRIC, own.baseline, own.extended, own.noise_floor, (*gains[1:], own))
    steps = [Step(r.name.replace("_", " "), r.mse**0.5, float("nan"), -0.5 * (r.criterion - linear.criterion)) for r in rungs]
    steps += [Step(f.law.name, f.mse**0.5, float("nan"), float("nan")) for f in laws]
    words = (
        f"The {law.law.name} leaves {100 * own.extended:.3g} % of the response, the linear oscillator "
        f"{100 * own.baseline:.3g} % (noise floor {100 * own.noise_floor:.2g} %)."
    )
    return Diagnosis(
        verdict, describe(verdict, (cause,), gain, remaining), (cause,), gain, {"words": words, "share": remaining},
        ("mass not identifiable from excitation and response: the vehicle file has a unit mass",), _unit_mass(element),
        tuple(steps), remarks=remarks,
    )  # fmt: skip


def _check(item: OscillatorRecord, record: OscillatorRecord) -> None:
    if not (np.all(np.isfinite(item.u)) and np.all(np.isfinite(item.y))):
        raise InputDataError(f"record {item.name}: values that are not finite")
    if abs(item.step_s / record.step_s - 1.0) > 1e-3:
        raise InputDataError(
            f"record {item.name}: sampled at {1.0 / item.step_s:g} Hz, {record.name} at {1.0 / record.step_s:g} Hz"
        )


def _held_out(fit: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Return what chooses and what judges of the samples that are not fitted."""
    choose, judge = np.zeros(fit.size, dtype=bool), np.zeros(fit.size, dtype=bool)
    for number, part in enumerate(np.array_split(np.flatnonzero(~fit), _BLOCKS)):
        (judge if number % 2 else choose)[part] = True
    return choose, judge


def _all(record: OscillatorRecord) -> BoolArray:
    return np.ones(record.u.size, dtype=bool)


def _remaining(gain: ValidationGain) -> float:
    """Return the share of the linear model's squared error above the noise that the best model leaves."""
    above = max(gain.baseline**2 - gain.noise_floor**2, 1e-300)
    return float(np.clip((gain.extended**2 - gain.noise_floor**2) / above, 0.0, 1.0))


def _recursion(rung: OscillatorRung) -> Model:
    """Return the simulation of a rung of the ladder."""
    return lambda item: simulate_oscillator(rung.coefficients, item.u, item.y[0], item.y[1], np.zeros(0, dtype=np.int64))[0]


def _gain(item: OscillatorRecord, keep: BoolArray, linear: OscillatorRung, best: Model) -> ValidationGain:
    """Return the gain on samples that were not fitted, with the interval of resampled blocks."""
    settled = keep.copy()
    settled[: int(_SETTLING_PERIODS / (linear.physical["frequency_hz"] * item.step_s))] = False
    parts = np.array_split(np.flatnonzero(settled), _BLOCKS)
    squares = []
    for model in (_recursion(linear), best):
        error = np.nan_to_num(item.y - model(item), posinf=1e6, neginf=-1e6) ** 2
        squares.append(np.array([float(error[part].sum()) for part in parts]))
    signal = (item.y - np.mean(item.y[settled])) ** 2
    power = np.array([float(signal[part].sum()) for part in parts])
    before, after = (float(np.sqrt(s.sum() / power.sum())) for s in squares)
    floor = incoherent_noise(item.y, item.u) / float(np.sqrt(power.sum() / np.count_nonzero(settled)))
    name = item.name if np.all(keep) else f"{item.name} (part that judges)"
    interval = bootstrap_interval(squares[0], squares[1], power, np.arange(len(parts)), 400, 1)
    return ValidationGain(name, before, after, interval, floor)


def _words(own: ValidationGain, best: OscillatorRung, nonlinear: bool, remaining: float) -> str:
    floor = f"(noise floor {100 * own.noise_floor:.2f} %)"
    if not nonlinear:
        return f"The linear oscillator leaves {100 * own.baseline:.2f} % of the response {floor}."
    return (
        f"The {best.name.replace('_', ' ')} leaves {100 * own.extended:.2f} % of the response, the linear oscillator "
        f"{100 * own.baseline:.2f} % {floor}: {100 * remaining:.1f} % of the energy above the noise remains."
    )


def _remarks(best: OscillatorRung) -> tuple[str, ...]:
    out = ["the quadratic part of the spring has no element and is left out of the vehicle file"] if best.coefficients[6] else []
    if best.coefficients[8]:
        out.append("the damping grows or falls with the square of the response; that part is left out of the vehicle file")
    return tuple(out)


def _cause(rungs: Sequence[OscillatorRung], best: OscillatorRung, remaining: float) -> NamedCause:
    weights = np.exp(np.clip(-0.5 * np.array([r.criterion - best.criterion for r in rungs]), -700.0, 0.0))
    confidence = (1.0 - _UNKNOWN) * float(weights[1:].sum() / weights.sum()) * (1.0 - remaining**2)
    # per linear rate: the input coefficients cancel
    rest = abs(1.0 - best.coefficients[0] - best.coefficients[1])
    reported = [
        Reported(f"{name} over linear rate", float(-best.coefficients[i] / rest), float(best.std[i] / rest), unit)
        for name, i, unit in (("cubic", 7, "per squared response"), ("quadratic", 6, "per response"))
        if best.coefficients[i]
    ]
    frequency = Reported("natural frequency", best.physical["frequency_hz"], _frequency_std(best), "Hz")
    return NamedCause(
        "stiffness_nonlinearity", "mount", "z", (*reported, frequency), max(confidence, 0.0), (),
        "the same resonance frequency at a tenth and at ten times the level",
        "a sine sweep at two levels: a nonlinear spring moves the resonance", "Is the restoring force nonlinear in the response?",
    )  # fmt: skip


def _frequency_std(rung: OscillatorRung) -> float:
    """Return the standard deviation of the natural frequency [Hz]: ``a1 = 2 exp(-zeta w h) cos(w_d h)`` for light damping."""
    p = rung.physical
    step = np.arccos(np.clip(rung.coefficients[0] / (2.0 * np.sqrt(-rung.coefficients[1])), -1.0, 1.0))
    return float(p["frequency_hz"] * rung.std[0] / max(2.0 * abs(np.sin(step)) * step, 1e-12))


def _vehicle(best: OscillatorRung) -> Vehicle:
    """Return a unit mass on the found spring; the quadratic part has no element and is left out."""
    p = best.physical
    omega = 2.0 * np.pi * p["frequency_hz"]
    damper = KelvinVoigt(0.0, 2.0 * max(p["damping_ratio"], 0.0) * omega)
    if p["cubic"] == 0.0:
        return _unit_mass(dataclasses.replace(damper, stiffness=omega**2))
    return _unit_mass(SumOfElements((CubicSpring(omega**2, omega**2 * p["cubic"] / p["stiffness"]), damper)))


def _unit_mass(element: ForceElement) -> Vehicle:
    body = Body("head", Prior(1.0), np.zeros(3), np.eye(3), coordinates=("z",))
    return Vehicle("oscillator", {"head": body}, {"mount": Mount("mount", np.zeros(3), "head", "base", {"z": element})}, {})


def _insufficient(reason: str) -> Diagnosis:
    sentence = f"The data do not show whether the model is right: {reason}."
    return Diagnosis(
        INSUFFICIENT, sentence, (), None, {"words": reason}, (reason,), _unit_mass(KelvinVoigt((2.0 * np.pi) ** 2, 0.0))
    )
