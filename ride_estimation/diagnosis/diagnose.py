# Copyright 2026 ride_estimation contributors
"""The chain: calibrate, test the residual, name causes, extend the model, measure the gain, say what remains."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.answer.evidence import make_evidence, residual_summary
from ride_estimation.diagnosis.answer.gain import (
    FLOOR,
    ValidationRun,
    discrepancy,
    gain_over,
    judged_in_band,
    measured_gain,
    refusal,
    remaining_energy,
    usable_runs,
)
from ride_estimation.diagnosis.answer.isolability import confusions
from ride_estimation.diagnosis.answer.next_run import next_run
from ride_estimation.diagnosis.answer.result import (
    EXPLAINED,
    INSUFFICIENT,
    NO_DISCREPANCY,
    UNEXPLAINED,
    Calibration,
    Diagnosis,
    Gain,
    NamedCause,
    Step,
)
from ride_estimation.diagnosis.answer.stability import stability
from ride_estimation.diagnosis.answer.validation_evidence import weighed
from ride_estimation.diagnosis.answer.verdict import (
    causes_per_effect,
    describe,
    gained_nothing,
    left_elsewhere,
    name_causes,
    proven,
    right_elsewhere,
    share_left,
    unexplained_run,
    within_library,
)
from ride_estimation.diagnosis.answer.wiring import FoundMistake, found_mistakes, named_mistakes, put_right, without_mistakes
from ride_estimation.diagnosis.calibration.gyros import unused_rates, wrong_gyros
from ride_estimation.diagnosis.calibration.in_line import loss_without
from ride_estimation.diagnosis.calibration.initial_state import LEADING
from ride_estimation.diagnosis.calibration.installation import installation_remarks
from ride_estimation.diagnosis.calibration.linear_model import calibrate, file_parameters, with_held_faults
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.common.effect import Where, combined_effects
from ride_estimation.diagnosis.common.extension import set_linear, with_knowledge
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.splits import LEAST_BLOCKS, Splits, make_splits
from ride_estimation.diagnosis.common.wording import title
from ride_estimation.diagnosis.hypotheses.hypothesis import FORM, Fitted, Hypothesis, Law
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.fitting import FullFit
from ride_estimation.diagnosis.search.free_law import NO_LAW, FreeLaw
from ride_estimation.diagnosis.search.outlier import CALIBRATION, SOFT_MOUNT, soft_mount
from ride_estimation.diagnosis.search.prediction import Prediction, block_squares, pooled_nrmse, predict
from ride_estimation.diagnosis.search.selection import Selector
from ride_estimation.diagnosis.search.work import Work, plain_model
from ride_estimation.errors import InputDataError
from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.parameters.parameter_status import status_of
from ride_estimation.frames import AXES
from ride_estimation.signals.recording import UniformRun, run_title
from ride_estimation.vehicles.vehicle import Vehicle
from ride_estimation.vehicles.weighed_loads import contradiction

Array = NDArray[np.float64]
Report = Callable[[float], None]

_EVEN = 0.5  # probability of the library from which a run is explained
_MOSTLY_UNEXPLAINED = 0.5  # share of the residual energy above which naming the best candidate would mislead


def diagnose(
    vehicle: Vehicle,
    run: UniformRun,
    validation: Sequence[UniformRun] = (),
    settings: Settings | None = None,
    progress: Report | None = None,
    causes: Collection[str] | None = None,
) -> Diagnosis:
    """Compare a measured run with a vehicle's model and explain the difference.

    Parameters
    ----------
    vehicle
        Model.
    run
        Measured run; fits, selects and judges on separate blocks.
    validation
        Further runs that take no part in fits: they judge, and weigh rivals that the run leaves alive.
    settings
        Band, thresholds, tolerances.
    progress
        Called with the share of the work done, 0 to 1.
    causes
        Ids that are considered; all of the library where None.

    Returns
    -------
    Diagnosis
        Never raises for poor data: the verdict is then ``insufficient_data`` with the reason.
    """
    settings = settings or Settings()
    recorded = (run, *validation)
    mistakes, doubtful = found_mistakes(vehicle, recorded)
    if causes is not None and not {c.id for c in named_mistakes(vehicle, mistakes)} <= set(causes):
        mistakes = ()
    run, *validation = (put_right(r, mistakes) for r in recorded)
    report = progress or (lambda share: None)
    answer = _answered(vehicle, run, validation, settings, report, causes)
    report(1.0)
    if mistakes:
        answer = _with_mistakes(vehicle, recorded, answer, mistakes, settings)
    return dataclasses.replace(answer, warnings=(*doubtful, *answer.warnings))


def _with_mistakes(
    vehicle: Vehicle, recorded: Sequence[UniformRun], answer: Diagnosis, found: Sequence[FoundMistake], settings: Settings
) -> Diagnosis:
    """Return the answer on readings that were put right with what was wrong about them.

    Parameters
    ----------
    recorded
        The run and its validation runs as they were recorded.
    """
    named = named_mistakes(vehicle, found)
    words = " and ".join(f.mistake.words for f in found)
    extended, remarks = without_mistakes(answer.extended, found)
    if answer.gain is None:
        sentence = f"The recording has {words}. {answer.sentence}"
        remarks = (*remarks, *answer.remarks)
        return dataclasses.replace(answer, sentence=sentence, causes=named, extended=extended, remarks=remarks)
    gain = gain_over(answer.gain, _errors_as_recorded(vehicle, recorded, answer.gain, settings), settings)
    where, before, after = run_title(gain.validation[0].run), gain.validation[0].baseline, answer.gain.validation[0].baseline
    sentence = (
        f"The recording has {words}; put right, that reduces the error of the calibrated model on {where} from "
        f"{100 * before:.1f} % to {100 * after:.1f} %. {answer.sentence}"
    )
    return dataclasses.replace(
        answer, verdict=EXPLAINED if answer.verdict == NO_DISCREPANCY else answer.verdict, sentence=sentence,
        causes=(*named, *answer.causes), gain=gain, extended=extended, remarks=(*remarks, *answer.remarks),
    )


def _errors_as_recorded(
    vehicle: Vehicle, recorded: Sequence[UniformRun], gain: Gain, settings: Settings
) -> list[tuple[Array, Array]]:
    """Return squared errors and signal, shape (B,) each, of the model that is calibrated on the readings as they are."""
    data, splits = _prepare(vehicle, recorded[0], settings)
    calibrated = calibrate(data, splits.train)
    model, plant = plain_model(calibrated), calibrated.view.plant
    runs = {r.name: r for r in recorded}
    return [
        block_squares(predict(RunData(plant, measurement(plant, runs[b.run]), data.settings), model)) for b in gain.blocks
    ]


@dataclasses.dataclass(frozen=True)
class _Draft:
    """An answer without the fits that repeat it: how stable it is, how sure, and which run to drive next.

    Attributes
    ----------
    answer
        With the confidence of causes among their rivals alone, without a sentence.
    work
        What it was found with; None where the data were insufficient and the answer is final.
    remaining, known, law
        Share of the residual energy that remains, probability that the library explains the run, law without a name.
    alike
        Words on causes that cannot be told apart.
    """

    answer: Diagnosis
    work: Work | None = None
    remaining: float = 1.0
    known: float = 1.0
    law: FreeLaw = NO_LAW
    alike: str = ""

    def finished(self) -> Diagnosis:
        """Return the answer with what its repetition shows."""
        answer, work = self.answer, self.work
        if work is None:
            return answer
        stable = stability(work, answer.verdict) if work.settings.stability else None
        sure = self.known if stable is None else self.known * stable.factor
        causes = tuple(dataclasses.replace(c, confidence=c.confidence * sure) for c in answer.causes)
        further = next_run(work) if work.settings.plan_next and causes else None
        sentence = describe(answer.verdict, causes, answer.gain, self.remaining, self.law) + self.alike
        sentence += f" {stable.sentence}" if stable is not None else ""
        return dataclasses.replace(answer, sentence=sentence, causes=causes, stability=stable, next_run=further)


def _answered(
    vehicle: Vehicle, run: UniformRun, validation: Sequence[UniformRun], settings: Settings, report: Report,
    causes: Collection[str] | None,
) -> Diagnosis:
    """Return the diagnosis of a run, or of the validation run that the one of the run misses.

    Causes that the fitted run hardly shows (a stop that a rougher road hits) are told by the run that does.
    """
    draft = _diagnosed(vehicle, run, validation, settings, report, causes)
    found = draft.answer
    worst = "" if found.gain is None or found.verdict == EXPLAINED else unexplained_run(found.gain, settings)
    if draft.work is None or found.gain is None or not worst:
        return draft.finished()
    # what the blocks of the run that took no part in the fit show, a run that the answer cannot even predict may tell
    judged = {v.run for v in found.gain.validation} - {worst}
    other = next((v for v in validation if v.name not in judged), None)
    if other is None:
        dealt = _dealt_anew(draft.work)
        second = _diagnosed(vehicle, run, validation, settings, lambda share: None, causes, dealt)
        if second.answer.verdict != EXPLAINED:
            return _unexplained(draft.finished())
        del draft  # its trajectories take what the copies need
        answer = second.finished()
        warning = "what the calibrated model misses most was in blocks that judge and in few others: they were dealt anew"
        return dataclasses.replace(answer, warnings=(*answer.warnings, warning))
    rest = [run, *(v for v in validation if v is not other)]
    second = _diagnosed(vehicle, other, rest, settings, lambda share: None, causes)
    title_of = run_title(other.name)
    if found.causes:
        if second.answer.verdict != EXPLAINED:
            return draft.finished()
        words = f"What explains the fitted run misses {title_of}, what explains {title_of} holds for both."
        warning = f"the causes were found on the validation run {title_of}, which those of the fitted run miss"
    elif second.answer.causes:
        words = f"The fitted run shows no discrepancy, {title_of} does."
        warning = f"the causes were found on the validation run {title_of}, where the model of the fitted run misses most"
    else:
        return _unexplained(draft.finished())
    del draft  # its trajectories take what the copies of the other run need
    answer = second.finished()
    return dataclasses.replace(answer, sentence=f"{words} {answer.sentence}", warnings=(*answer.warnings, warning))


def _dealt_anew(work: Work) -> Splits:
    """Return the blocks of a run dealt by what the calibrated model misses in them.

    What a run shows in a few blocks only (a stop that is rarely hit) may be in blocks that judge and in no others.
    """
    view, regression = work.calibrated.view, work.calibrated.regression
    missed = regression.block_misfit(regression.grams, work.calibrated.fit.coefficients) / view.block_dof
    # the first blocks of a stretch tell its initial state
    leading = {b + n for b in view.blocks.begins for n in range(LEADING)}
    return make_splits(len(missed), leading, np.argsort(-missed, kind="stable").tolist())


def _unexplained(answer: Diagnosis) -> Diagnosis:
    """Return an answer without causes whose model misses something where nothing was fitted."""
    if answer.verdict != NO_DISCREPANCY:
        return answer
    return dataclasses.replace(answer, verdict=UNEXPLAINED, sentence=describe(UNEXPLAINED, (), answer.gain, 1.0))


def _diagnosed(
    vehicle: Vehicle, run: UniformRun, validation: Sequence[UniformRun], settings: Settings, report: Report,
    causes: Collection[str] | None, dealt: Splits | None = None,
) -> _Draft:
    """Return the diagnosis of one run, the others only judging; ``dealt`` are its blocks where not by their place."""
    try:
        data, splits = _prepare(vehicle, run, settings)
        splits = dealt or splits
        calibrated = with_held_faults(calibrate(data, splits.train))
        _check_excitation(calibrated.view, settings)
    except InputDataError as error:
        return _Draft(insufficient(vehicle, str(error)))
    report(0.15)

    def build(view: RunView) -> list[Hypothesis]:
        return [
            h for name, cause in library().items() if causes is None or name in causes for h in cause.hypotheses(view)
        ]

    selector = Selector(calibrated, splits, build, settings, lambda share: report(0.15 + 0.6 * share))
    selection = selector.run()
    report(0.8)
    work = Work(vehicle, calibrated, splits, selector, selection, settings)
    return _conclude(work, validation, causes is None or SOFT_MOUNT in causes)


def _prepare(vehicle: Vehicle, run: UniformRun, settings: Settings) -> tuple[RunData, Splits]:
    spoke = {
        s: np.asarray(v).shape[1] if np.asarray(v).ndim > 1 else 1
        for s, v in run.data.items()
        if s in vehicle.sensors and np.mean(run.valid[s]) > 0.5
    }
    tolerances = settings.tolerances
    plant = build_plant(vehicle, spoke, tolerances.stiffness, tolerances.damping)
    duration = run.samples / run.rate_hz
    if duration < settings.minimum_duration_s:
        raise InputDataError(
            f"the run {run.name} lasts {duration:.1f} s; at least {settings.minimum_duration_s:g} s are needed"
        )
    loads = (contradiction(vehicle, body) for body in dict.fromkeys(b for b, _ in plant.coordinates))
    words = (*unused_rates(plant, spoke), *filter(None, loads))
    if wrong := wrong_gyros(plant, run, settings):
        spoke |= dict.fromkeys(wrong, len(AXES))
        plant = build_plant(vehicle, spoke, tolerances.stiffness, tolerances.damping)
        words += tuple(f"the angular rates of {name} are not used: {reason}" for name, reason in wrong.items())
    plant = dataclasses.replace(plant, warnings=(*plant.warnings, *words))
    data = RunData(plant, measurement(plant, run), settings)
    if data.blocks.count < LEAST_BLOCKS:
        raise InputDataError(
            f"only {data.blocks.count} blocks of {settings.block_s:g} s without gaps remain; {LEAST_BLOCKS} are needed"
        )
    return data, make_splits(data.blocks.count, data.blocks.begins)


def require_testable(vehicle: Vehicle, run: UniformRun, settings: Settings | None = None) -> None:
    """Refuse a run that does not measure what the model needs to be tested.

    Raises
    ------
    InputDataError
        What is missing.
    """
    _prepare(vehicle, run, settings or Settings())


def _check_excitation(view: RunView, settings: Settings) -> None:
    signal = view.grid.signal(view.data.output_spectrum * view.grid.band_weight[:, None])
    ratio = max(
        float(np.std(signal[:, i])) / max(s.noise_std, 1e-12) for i, s in enumerate(view.plant.outputs)
    )
    if ratio < settings.minimum_signal_to_noise:
        raise InputDataError(
            f"the response is only {ratio:.1f} times the sensor noise in {settings.band_hz[0]:.3g}-{view.grid.upper_hz:.3g} Hz; "
            f"{settings.minimum_signal_to_noise:g} times are needed: a rougher road, or a longer stroke on a bench"
        )


def insufficient(vehicle: Vehicle, reason: str) -> Diagnosis:
    """Return the answer that the data cannot tell, with the reason; the vehicle stays as it is."""
    return Diagnosis(
        INSUFFICIENT,
        f"The data do not show whether the model is right: {reason}.",
        (),
        None,
        {"words": reason},
        (reason,),
        vehicle,
    )


def _conclude(work: Work, validation: Sequence[UniformRun], judge_mounts: bool) -> _Draft:
    settings, view = work.settings, work.calibrated.view
    base = predict(work.data, work.baseline)
    others, unused = usable_runs(work, validation)
    judged = _accepted_or_not(weighed(work, others), base, others)
    work, extended = judged.work.stated(), judged.extended
    accepted = work.selection.accepted
    state = work.extended.stepped_state({(p.mount, p.axis): i for i, p in enumerate(work.plant.ports)})
    log_std = _log_std(work)
    soft = _soft_mount(work, state, log_std[0]) if judge_mounts else None
    seen = view if accepted is None else accepted.view
    named = name_causes(work.selection, soft, seen, work.splits.train)
    verdict, remaining, known = _verdict(work, base, judged, named)
    residual = residual_summary(base, extended, remaining, accepted is not None)
    ladder, evidence = _ladder(work, base, extended), make_evidence(base, extended)
    warnings = [*work.plant.warnings, *filter(None, [judged.refused]), *_bound_warnings(work, state)]
    warnings += [data.gap_warning for data in (work.data, *(run.data for run in others)) if data.gap_warning]
    if work.selection.spent:
        warnings.append(
            f"the search ended at its budget of {settings.most_fits} full fits: causes or rivals of small effect may be missing"
        )
    if view.data.noise_scale > 1.25:
        warnings.append(
            f"the body accelerometers are {view.data.noise_scale:.2f} times as noisy as the vehicle file states; "
            "the measured noise is used"
        )
    warnings += [
        f"the angular rates of {sensor} are {scale:.2f} times as noisy as the vehicle file states; the measured noise is used"
        for sensor, scale in view.data.gyro_scale.items() if scale > 1.25
    ]
    alike = confusions(work.selection.contests)
    isolability = tuple(c.words for c in alike)
    warnings += isolability
    vehicle, remarks = _extended_vehicle(work, state, accepted, soft)
    remarks += _installation(work, {c.location for c in named})
    answer = Diagnosis(
        verdict=verdict,
        sentence="",
        causes=named,
        gain=judged.gain,
        residual=residual,
        warnings=(*warnings, *unused, *judged.warnings),
        extended=vehicle,
        ladder=ladder,
        parameters=_calibrations(work, state, log_std, verdict),
        remarks=remarks,
        evidence=evidence,
        isolability=isolability,
    )
    words = f" But {'; '.join(c.claim for c in alike)}." if named and alike else ""
    return _Draft(answer, work, remaining, known, judged.law, words)


@dataclasses.dataclass(frozen=True)
class _Judged:
    """The work with the accepted causes where nothing speaks against naming them, and else without.

    Attributes
    ----------
    law
        The law without a name that explains more.
    refused
        Why accepted causes are not named, empty where they are.
    refuted
        Whether another run refuted them: then all of the residual remains.
    """

    work: Work
    extended: Prediction
    gain: Gain
    warnings: list[str]
    law: FreeLaw = NO_LAW
    refused: str = ""
    refuted: bool = False


def _accepted_or_not(work: Work, base: Prediction, validation: Sequence[ValidationRun]) -> _Judged:
    """Return the accepted causes as judged where they were not fitted."""
    accepted, settings = work.selection.accepted, work.settings
    if accepted is None:
        return _Judged(work, base, *measured_gain(work, base, base, validation))
    extended = predict(work.data, work.extended)
    reason, refuted = refusal(work, base, extended), False
    if not reason:
        gain, warnings = measured_gain(work, base, extended, validation)
        law = work.selector.better_law(accepted)
        # what is no part of the band (offsets) gains nothing there and need not
        reason = gained_nothing(gain, settings) if accepted.in_band else ""
        refuted = bool(reason)
        _, remaining = remaining_energy(work, base, gain)
        known = within_library(causes_per_effect(accepted.fitted, work.plant.sensors), remaining, law, settings)
        # where nothing above the noise is left without them, or most of it with them, they need a gain beyond doubt
        if not reason and judged_in_band(work):
            gained = proven(gain, settings)
            if work.selector.base_excess <= 1.0 and (known < _EVEN or not gained):
                reason = "gained nothing beyond doubt over a model that leaves no more than noise"
            elif known < _EVEN and remaining > _MOSTLY_UNEXPLAINED and not (gained and discrepancy(work, base, gain)):
                reason = f"left {100 * remaining:.0f} % of the residual energy and gained nothing beyond doubt"
            elif work.selector.base_excess - 1.0 <= FLOOR and share_left(gain) > _MOSTLY_UNEXPLAINED:
                reason = "left most of what a model misses that explains the run"
        if not reason:
            return _Judged(work, extended, gain, warnings, law)
    refused = f"{', '.join(accepted.causes)} {reason}: not named"
    # one of several may stand, and a candidate that fails here makes room for the next
    several = len(accepted.fitted) > 1
    left = work.selector.without_weakest(work.selection, accepted) if several else work.selector.runner_up(work.selection)
    if left is not None:
        judged = _accepted_or_not(dataclasses.replace(work, selection=left), base, validation)
        if not judged.refused:
            return judged
    work = dataclasses.replace(work, selection=dataclasses.replace(work.selection, accepted=None))
    return _Judged(work, base, *measured_gain(work, base, base, validation), refused=refused, refuted=refuted)


def _verdict(work: Work, base: Prediction, judged: _Judged, named: tuple[NamedCause, ...]) -> tuple[str, float, float]:
    """Return the verdict, the share of the residual energy that remains and the probability that the library explains the run.

    A cause that leaves little where nothing was fitted explains the run even if its law has not the form of the real one, which a
    law of general form at its mounts shows: the mount is right, of the kind of its law the odds are even. Several that rather
    mimic one effect outside the library may predict as well, and so may one cause where a law at another mount explains more.
    """
    left, remaining = (1.0, 1.0) if judged.refuted else remaining_energy(work, base, judged.gain)
    # in the run every frequency weighs against its noise; what a prediction misses elsewhere weighs by what it is of the motion
    elsewhere = left_elsewhere(judged.gain, work.settings)
    share = remaining if left > FLOOR else 0.0
    if elsewhere is not None and not judged.refuted:
        share = 0.0 if right_elsewhere(judged.gain, work.settings) else elsewhere
    accepted = judged.work.selection.accepted
    soft = any(c.id == SOFT_MOUNT for c in named)
    counts = causes_per_effect(accepted.fitted if accepted is not None else (), work.plant.sensors, soft)
    known = within_library(counts, share, judged.law, work.settings)
    if not named:
        return (UNEXPLAINED if remaining > 0.0 else NO_DISCREPANCY), remaining, known
    ports = {p for f in accepted.fitted for p in f.hypothesis.ports} if accepted is not None else set()
    form = sum(counts) == 1 and not ports.isdisjoint(judged.law.ports)
    if form and elsewhere is not None and elsewhere < work.settings.unexplained:
        known = max(known, _EVEN)
    return (EXPLAINED if known >= _EVEN else UNEXPLAINED), remaining, known


def _soft_mount(work: Work, state: ModelState, log_std: Array) -> Fitted | None:
    """Return a mount out of line with its file and the others, None where there is none."""
    accepted = work.selection.accepted
    laws = [(f.hypothesis.cause, f.hypothesis.ports) for f in (accepted.fitted if accepted is not None else ())]
    nonlinear = {p for _, ports in laws for p in ports}
    curved = {p for cause, ports in laws if library()[cause].LAW is Law.ELASTIC for p in ports}
    soft = soft_mount(work.calibrated, state.stiffness, log_std, nonlinear, curved)
    seen = work.calibrated.view if accepted is None else accepted.view
    return soft if soft is not None and _elsewhere(soft, seen, work) >= work.settings.significance else None


def _elsewhere(soft: Fitted, view: RunView, work: Work) -> float:
    """Return what the run loses when a soft mount is held 15 % below what the other mounts of the axis imply [nat].

    They imply the file's value times the sum of their stiffnesses over the sum of the file's: how two of them share their
    force may be as uncertain as how much of it the soft one takes.
    """
    port = view.port_index(soft.hypothesis.location, soft.hypothesis.axis)
    stated = file_parameters(view.plant)[0]
    others = [i for i, p in enumerate(view.plant.ports) if p.axis == soft.hypothesis.axis and i != port]
    common = float(view.state.stiffness[others].sum() / stated[others].sum())
    factor = (1.0 - CALIBRATION) * common * float(stated[port] / view.state.stiffness[port])
    return loss_without(view, port, factor, work.splits.train) if factor > 1.0 else 0.0


def _log_std(work: Work) -> tuple[Array, Array]:
    """Return standard deviations of ln k and ln c of every port at the final model, shape (P,) each."""
    fit = work.selection.accepted
    adjustables = work.calibrated.adjustables if fit is None else fit.adjustables
    covariance = work.calibrated.fit.covariance if fit is None else fit.covariance
    out = []
    for kind, form in zip(("stiffness", "damping"), form_variance(fit, len(work.plant.ports))):
        std = np.full(len(work.plant.ports), np.inf)
        for i, a in enumerate(adjustables):
            if a.kind == kind:
                std[work.calibrated.view.port_index(a.place, a.axis)] = np.sqrt(max(covariance[i, i], 0.0))
        out.append(np.sqrt(std**2 + form))
    return out[0], out[1]


def form_variance(fit: FullFit | None, ports: int) -> Array:
    """Return what the form of the named laws leaves open in ln k and ln c of every port, shape (2, P).

    No law of a library is the real one: the share :data:`~hypothesis.FORM` of the energy of its force at a port is of another
    form. Nothing says whether that part is in phase with the travel or with the rate, where it is spring or damper of the same
    mount: half of it each, ``var(ln k) = FORM F^2 / (2 (k x)^2)`` and ``var(ln c) = FORM F^2 / (2 (c v)^2)`` with the standard
    deviations F of the force, x and v of travel and rate.
    """
    out = np.zeros((2, ports))
    if fit is None:
        return out
    view = fit.view
    for fitted in fit.fitted:
        for effect in combined_effects(fitted.hypothesis.columns(view, fitted.shape), fitted.coefficients):
            if effect.where is Where.PORT:
                travel, rate = view.scales[effect.index][:2]
                linear = np.array([view.state.stiffness[effect.index] * travel, view.state.damping[effect.index] * rate])
                force = float(np.std(effect.signal))
                out[:, effect.index] += np.divide(0.5 * FORM * force**2, linear**2, out=np.zeros(2), where=linear > 0.0)
    return out


def _calibrations(work: Work, state: ModelState, log_std: tuple[Array, Array], verdict: str) -> tuple[Calibration, ...]:
    out = []
    for p, port in enumerate(work.plant.ports):
        for name, value, std, unit, prior, prior_std in (
            ("stiffness", state.stiffness[p], log_std[0][p], "N/m", port.stiffness, port.stiffness_log_std),
            ("damping", state.damping[p], log_std[1][p], "N s/m", port.damping, port.damping_log_std),
        ):
            spread = float(value * std) if np.isfinite(std) else float("nan")
            status = status_of(float(std), prior_std)
            if status is Status.VALID and verdict == UNEXPLAINED:
                status = Status.SUSPECT
            out.append(Calibration(f"{port.name}.{name}", float(value), spread, unit, float(prior), status.value))
    return tuple(out)


def _bound_warnings(work: Work, state: ModelState) -> list[str]:
    """Return words on parameters far from their priors."""
    out = []
    for p, port in enumerate(work.plant.ports):
        for name, value, prior, std in (
            ("stiffness", state.stiffness[p], port.stiffness, port.stiffness_log_std),
            ("damping", state.damping[p], port.damping, port.damping_log_std),
        ):
            if prior > 0.0 and value > 0.0 and abs(np.log(value / prior)) > 3.0 * std:
                out.append(
                    f"{port.name}.{name}: calibrated {value:.4g} lies more than 3 standard deviations from its prior {prior:.4g}"
                )
    return out


def _installation(work: Work, named: Collection[str]) -> tuple[str, ...]:
    """Return words on errors of the installation at the edge of what counts as calibration."""
    fit = work.selection.accepted
    if fit is None:
        calibrated = work.calibrated
        return installation_remarks(calibrated.adjustables, calibrated.fit.coefficients, calibrated.fit.covariance, named)
    return installation_remarks(fit.adjustables, fit.coefficients, fit.covariance, named)


def _extended_vehicle(
    work: Work, state: ModelState, accepted: FullFit | None, soft: Fitted | None
) -> tuple[Vehicle, tuple[str, ...]]:
    ports = [(p.mount, p.axis) for p in work.plant.ports]
    vehicle = set_linear(work.vehicle, ports, state.stiffness, state.damping)
    remarks: list[str] = []
    for fitted in accepted.fitted if accepted is not None else ():
        cause = library()[fitted.hypothesis.cause]
        view = accepted.view if accepted is not None else work.calibrated.view
        vehicle, notes = cause.extend(vehicle, view, fitted)
        remarks += notes
    view = work.calibrated.view
    return with_knowledge(vehicle, ports, _log_std(work), view.deflection, view.grid.rate_hz), tuple(remarks)


def _ladder(work: Work, base: Prediction, extended: Prediction) -> tuple[Step, ...]:
    dof = float(work.calibrated.view.block_dof[work.splits.train].sum())
    errors, signal = block_squares(base)
    steps = [Step("calibrated linear model", pooled_nrmse(errors, signal, work.splits.judge), work.selector.base_excess, 0.0)]
    for current in work.selection.rounds:
        for candidate in current.candidates:
            named = (f.hypothesis for f in candidate.fit.fitted)
            label = " + ".join(title(h.cause, h.location, h.axis) for h in named)
            gain = candidate.log_likelihood - current.reference
            steps.append(Step(label, float("nan"), candidate.fit.misfit / dof, gain))
    return tuple(steps)
