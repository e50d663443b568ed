# Copyright 2026 ride_estimation contributors
"""The chain: calibrate, test the residual, name causes, extend the model, measure the gain, say what remains."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.baseline import Adjustable
from ride_estimation.diagnosis.calibration import Calibrated, calibrate, file_parameters, with_held_cg
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.evidence import make_evidence, residual_summary
from ride_estimation.diagnosis.extension import set_linear
from ride_estimation.diagnosis.fitting import FullFit, inherent_misfit, tolerance_of
from ride_estimation.diagnosis.hypothesis import Fitted, Hypothesis
from ride_estimation.diagnosis.in_line import loss_without
from ride_estimation.diagnosis.installation import installation_remarks
from ride_estimation.diagnosis.isolability import confusions
from ride_estimation.diagnosis.outlier import CALIBRATION, soft_mount
from ride_estimation.diagnosis.plant import Plant, build_plant
from ride_estimation.diagnosis.prediction import (
    Model,
    Prediction,
    block_squares,
    bootstrap_interval,
    noise_floor,
    pooled_nrmse,
    predict,
)
from ride_estimation.diagnosis.result import (
    EXPLAINED,
    INSUFFICIENT,
    NO_DISCREPANCY,
    UNEXPLAINED,
    Calibration,
    Diagnosis,
    Gain,
    NamedCause,
    Step,
    ValidationGain,
)
from ride_estimation.diagnosis.scene import Measurement, ModelState, Scene, measurement
from ride_estimation.diagnosis.selection import Selection, Selector
from ride_estimation.diagnosis.settings import Settings
from ride_estimation.diagnosis.splits import Splits, make_splits
from ride_estimation.diagnosis.verdict import MISSED, describe, gained_nothing, name_causes, shows_elsewhere, within_library
from ride_estimation.diagnosis.wording import title
from ride_estimation.errors import InputDataError
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]
Report = Callable[[float], None]

_METRIC = "pooled NRMSE of the sensors of the body within the band (rms error over rms of the measured signal)"
_LEAST_BLOCKS = 4
_FLOOR = 0.1  # share to which the noise floor itself is known: less above it is nothing that remains
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
        Further runs that only judge.
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
    report = progress or (lambda share: None)
    try:
        plant, data, splits = _prepare(vehicle, run, settings)
        calibrated = with_held_cg(calibrate(plant, data, settings, splits.train))
        _check_excitation(calibrated.scene, settings)
    except InputDataError as error:
        return insufficient(vehicle, str(error))
    report(0.15)

    def build(scene: Scene) -> list[Hypothesis]:
        return [
            h for name, cause in library().items() if causes is None or name in causes for h in cause.hypotheses(scene)
        ]

    selector = Selector(calibrated, splits, build, settings, lambda share: report(0.15 + 0.6 * share))
    selection = selector.run()
    report(0.8)
    work = _Work(vehicle, calibrated.scene.plant, data, calibrated, splits, selector, selection, settings)
    answer = _conclude(work, validation)
    report(1.0)
    return answer


def within_tolerance(adjustables: Sequence[Adjustable], coefficients: Array) -> Array:
    """Return coefficients with installation tolerances cut at three standard deviations.

    What lies beyond is a fault and not calibration: the plain model that the gain is measured against may not hide it.
    """
    limit = np.array([
        3.0 * a.prior_std if a.kind in ("gain", "misalignment", "position", "delay", "bandwidth", "cg", "inertia") else np.inf
        for a in adjustables
    ])
    # a coefficient is what comes on top of the part that the plant already holds, its offset with the sign turned
    held = np.array([a.offset if np.isfinite(b) else 0.0 for a, b in zip(adjustables, limit)])
    return np.asarray(np.clip(coefficients, held - limit, held + limit))


@dataclasses.dataclass(frozen=True)
class _Work:
    """Everything the conclusion needs."""

    vehicle: Vehicle
    plant: Plant
    data: Measurement
    calibrated: Calibrated
    splits: Splits
    selector: Selector
    selection: Selection
    settings: Settings

    @property
    def baseline(self) -> Model:
        """Return the calibrated model."""
        scene = self.calibrated.scene
        state = ModelState(scene.state.stiffness, scene.state.damping)
        adjustables = self.calibrated.adjustables
        return Model(state, adjustables, within_tolerance(adjustables, self.calibrated.fit.coefficients))

    @property
    def extended(self) -> Model:
        """Return the extended model, the calibrated one where nothing was accepted."""
        fit = self.selection.accepted
        if fit is None:
            return self.baseline
        state = ModelState(fit.scene.state.stiffness, fit.scene.state.damping, held=fit.scene.state.held)
        return Model(state, fit.adjustables, fit.coefficients[: fit.regression.count], fit.fitted, fit.scene.scales)


def _prepare(vehicle: Vehicle, run: UniformRun, settings: Settings) -> tuple[Plant, Measurement, Splits]:
    duration = run.samples / run.rate_hz
    if duration < settings.minimum_duration_s:
        raise InputDataError(
            f"the run {run.name} lasts {duration:.1f} s; at least {settings.minimum_duration_s:g} s are needed"
        )
    spoke = {
        s: np.asarray(v).shape[1] if np.asarray(v).ndim > 1 else 1
        for s, v in run.data.items()
        if s in vehicle.sensors and np.mean(run.valid[s]) > 0.5
    }
    tolerances = settings.tolerances
    plant = build_plant(vehicle, spoke, tolerances.stiffness, tolerances.damping)
    data = measurement(plant, run)
    probe = Scene(plant, data, ModelState(*file_parameters(plant)), settings)
    if probe.blocks.count < _LEAST_BLOCKS:
        raise InputDataError(
            f"only {probe.blocks.count} blocks of {settings.block_s:g} s without gaps remain; {_LEAST_BLOCKS} are needed"
        )
    return plant, data, make_splits(probe.blocks.count)


def _check_excitation(scene: Scene, settings: Settings) -> None:
    signal = scene.grid.signal(scene.measured_spectrum * scene.grid.band_weight[:, None])
    ratio = max(
        float(np.std(signal[:, i])) / max(s.noise_std, 1e-12) for i, s in enumerate(scene.plant.outputs)
    )
    if ratio < settings.minimum_signal_to_noise:
        raise InputDataError(
            f"the response is only {ratio:.1f} times the sensor noise in {settings.band_hz[0]:.3g}-{scene.grid.upper_hz:.3g} Hz; "
            f"{settings.minimum_signal_to_noise:g} times are needed: a rougher road, or a longer stroke on a bench"
        )


def insufficient(vehicle: Vehicle, reason: str) -> Diagnosis:
    """Return the answer that the data cannot tell, with the reason; the vehicle stays as it is."""
    return Diagnosis(
        INSUFFICIENT,
        f"The data cannot tell whether the model is right: {reason}.",
        (),
        None,
        {"words": reason},
        (reason,),
        vehicle,
    )


def _conclude(work: _Work, validation: Sequence[UniformRun]) -> Diagnosis:
    settings, scene = work.settings, work.calibrated.scene
    base = predict(scene, work.data, work.baseline, settings)
    extended = base
    refused: list[str] = []
    refuted, gained = "", None
    if work.selection.accepted is not None:
        extended = predict(scene, work.data, work.extended, settings)
        reason = _refusal(work, base, extended)
        if not reason:
            gained = _gain(work, base, extended, validation)
            # what is no part of the band (offsets) gains nothing there and need not
            refuted = gained_nothing(gained[0], settings) if np.any(work.selection.accepted.rows) else ""
            reason = refuted
        if reason:
            refused.append(f"{', '.join(work.selection.accepted.causes)} {reason}: not named")
            work = dataclasses.replace(work, selection=dataclasses.replace(work.selection, accepted=None))
            extended = base
    gain, gain_warnings = _gain(work, base, base, validation) if refused or gained is None else gained
    accepted = work.selection.accepted
    state = work.extended.stepped_state({(p.mount, p.axis): i for i, p in enumerate(work.plant.ports)})
    log_std = _log_std(work)
    laws = [(f.hypothesis.cause, f.hypothesis.ports) for f in (accepted.fitted if accepted is not None else ())]
    bent = {p for _, ports in laws for p in ports}
    curved = {p for cause, ports in laws if library()[cause].BENDS_SPRING for p in ports}
    soft = soft_mount(work.calibrated, state.stiffness, log_std[0], bent, curved)
    seen = scene if accepted is None else accepted.scene
    if soft is not None and _elsewhere(soft, seen, work) < settings.significance:
        soft = None
    named = name_causes(work.selection, soft, seen, work.splits.train)
    law = work.selector.better_law(accepted)
    left, remaining = (1.0, 1.0) if refuted else _remaining(work, base, gain)
    known = within_library(len(named), remaining if left > _FLOOR else 0.0, law, settings)
    verdict = EXPLAINED if known >= 0.5 else UNEXPLAINED
    if not named:
        verdict = UNEXPLAINED if remaining > 0.0 else NO_DISCREPANCY
    causes = _tempered(named, verdict, remaining, known)
    warnings = [*work.plant.warnings, *refused, *_bound_warnings(work, state)]
    if work.selection.spent:
        warnings.append(
            f"the search ended at its budget of {settings.most_fits} full fits: causes or rivals of small effect may be missing"
        )
    if scene.noise_scale > 1.25:
        warnings.append(
            f"the body accelerometers are {scene.noise_scale:.2f} times as noisy as the vehicle file states; "
            "the measured noise is used"
        )
    alike = confusions(work.selection.contests)
    isolability = tuple(c.words for c in alike)
    warnings += isolability
    vehicle, remarks = _extended_vehicle(work, state, accepted, soft)
    remarks += _installation(work, {c.location for c in causes})
    residual = residual_summary(base, extended, remaining, accepted is not None)
    doubt = f" But {'; '.join(c.claim for c in alike)}." if causes and alike else ""
    sentence = describe(verdict, causes, gain, remaining, law) + doubt
    return Diagnosis(
        verdict=verdict,
        sentence=sentence,
        causes=causes,
        gain=gain,
        residual=residual,
        warnings=(*warnings, *gain_warnings),
        extended=vehicle,
        ladder=_ladder(work, base, extended),
        parameters=_calibrations(work, state, log_std),
        remarks=remarks,
        evidence=make_evidence(base, extended),
        isolability=isolability,
    )


def _tempered(causes: tuple[NamedCause, ...], verdict: str, remaining: float, known: float) -> tuple[NamedCause, ...]:
    """Return the causes as sure as the library can hold the answer; none where most of the residual remains."""
    if verdict == UNEXPLAINED and remaining > _MOSTLY_UNEXPLAINED:
        return ()
    return tuple(dataclasses.replace(c, confidence=c.confidence * known) for c in causes)


def _refusal(work: _Work, base: Prediction, extended: Prediction) -> str:
    """Return why causes that were accepted are not named, empty where nothing speaks against them."""
    if not _confirmed(work, base, extended):
        return "fitted the run but did not predict the judge blocks better"
    if not _noticeable(work, base, extended):
        return (
            f"fitted the run better, by less than the {100 * work.settings.adequacy:.1f} % of any channel that count as right"
        )
    return ""


def _confirmed(work: _Work, base: Prediction, extended: Prediction) -> bool:
    """Return whether the extended model predicts the judge blocks better; offsets are not in the band and pass."""
    accepted = work.selection.accepted
    if accepted is None or not np.any(accepted.rows):
        return True
    judge = work.splits.judge
    (before, signal), (after, _) = block_squares(base), block_squares(extended)
    return pooled_nrmse(after, signal, judge) < pooled_nrmse(before, signal, judge)


def _elsewhere(soft: Fitted, scene: Scene, work: _Work) -> float:
    """Return what the run loses when a soft mount is held 15 % below what the other mounts of the axis imply [nat].

    They imply the file's value times the sum of their stiffnesses over the sum of the file's: how two of them share their
    force may be as uncertain as how much of it the soft one takes.
    """
    port = scene.port_index(soft.hypothesis.location, soft.hypothesis.axis)
    stated = file_parameters(scene.plant)[0]
    others = [i for i, p in enumerate(scene.plant.ports) if p.axis == soft.hypothesis.axis and i != port]
    common = float(scene.state.stiffness[others].sum() / stated[others].sum())
    factor = (1.0 - CALIBRATION) * common * float(stated[port] / scene.state.stiffness[port])
    return loss_without(scene, port, factor, work.splits.train) if factor > 1.0 else 0.0


def _noticeable(work: _Work, base: Prediction, extended: Prediction) -> bool:
    """Return whether the accepted causes explain more of some channel than a model that counts as right may miss.

    With little noise and a long run the score tests see errors of a thousandth, which every model has. Judged where nothing
    was fitted.
    """
    accepted = work.selection.accepted
    if accepted is None or not np.any(accepted.rows):
        return True
    inside = base.scene.block_window(work.splits.judge)[:, None]
    parts = (base.residual(), extended.residual(), base.measured())
    before, after, signal = (np.sum((part * inside) ** 2, axis=0) for part in parts)
    # a channel near a node is the small difference of two motions, each of which the model may miss by so much
    return bool(np.any(before - after > work.settings.adequacy**2 * base.scene.gross_ratio * signal))


def _remaining(work: _Work, base: Prediction, gain: Gain) -> tuple[float, float]:
    """Return the residual energy above the floor that remains, per degree of freedom, and its share of what there was.

    Without causes both are zero unless the calibrated model misses more than one that counts as right, here and elsewhere.
    """
    dof = float(work.calibrated.scene.block_dof[work.splits.train].sum())
    excess = max(work.selector.base_misfit / dof - 1.0, 0.0)
    accepted = work.selection.accepted
    if accepted is None:
        errors, signal = block_squares(base)
        nrmse = pooled_nrmse(errors, signal, work.splits.train)
        floor = noise_floor(base.scene, signal, work.splits.train)
        missed = float(np.sqrt(max(nrmse**2 - floor**2, 0.0)))
        wrong = excess > _FLOOR and missed > MISSED * work.settings.adequacy and shows_elsewhere(gain, work.settings)
        return (excess, 1.0) if wrong else (0.0, 0.0)
    # a calibration strained far beyond a tolerance hides the fault and leaves no residual that the cause could remove
    excess = max(_misfit_within_tolerance(work, accepted) / dof - 1.0, excess)
    inherent = inherent_misfit(accepted, work.splits.train, work.settings.seed) / dof
    left = max(accepted.misfit / dof - 1.0 - inherent, 0.0)
    return left, (left / max(excess - inherent, left, 1e-9) if excess > 0.02 else 0.0)


def _misfit_within_tolerance(work: _Work, accepted: FullFit) -> float:
    """Return the misfit of the calibrated model whose tolerances that the accepted causes stand for are cut at their limits."""
    cal = work.calibrated
    named = {tolerance_of(f.hypothesis) for f in accepted.fitted}
    stands = [(a.kind, a.place, a.axis) in named for a in cal.adjustables]
    coefficients = np.where(stands, within_tolerance(cal.adjustables, cal.fit.coefficients), cal.fit.coefficients)
    return cal.regression.misfit(cal.regression.grams, work.splits.train, coefficients)


def _log_std(work: _Work) -> tuple[Array, Array]:
    """Return standard deviations of ln k and ln c of every port at the final model, shape (P,) each."""
    fit = work.selection.accepted
    adjustables = work.calibrated.adjustables if fit is None else fit.adjustables
    covariance = work.calibrated.fit.covariance if fit is None else fit.covariance
    out = []
    for kind in ("stiffness", "damping"):
        std = np.full(len(work.plant.ports), np.inf)
        for i, a in enumerate(adjustables):
            if a.kind == kind:
                std[work.calibrated.scene.port_index(a.place, a.axis)] = np.sqrt(max(covariance[i, i], 0.0))
        out.append(std)
    return out[0], out[1]


def _calibrations(work: _Work, state: ModelState, log_std: tuple[Array, Array]) -> tuple[Calibration, ...]:
    out = []
    for p, port in enumerate(work.plant.ports):
        for name, value, std, unit, prior in (
            ("stiffness", state.stiffness[p], log_std[0][p], "N/m", port.stiffness),
            ("damping", state.damping[p], log_std[1][p], "N s/m", port.damping),
        ):
            spread = float(value * std) if np.isfinite(std) else float("nan")
            out.append(Calibration(f"{port.name}.{name}", float(value), spread, unit, float(prior)))
    return tuple(out)


def _bound_warnings(work: _Work, state: ModelState) -> list[str]:
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


def _installation(work: _Work, named: Collection[str]) -> tuple[str, ...]:
    """Return words on errors of the installation at the edge of what counts as calibration."""
    fit = work.selection.accepted
    if fit is None:
        calibrated = work.calibrated
        return installation_remarks(calibrated.adjustables, calibrated.fit.coefficients, calibrated.fit.covariance, named)
    return installation_remarks(fit.adjustables, fit.coefficients, fit.covariance, named)


def _gain(
    work: _Work, base: Prediction, extended: Prediction, validation: Sequence[UniformRun]
) -> tuple[Gain, list[str]]:
    settings, scene = work.settings, work.calibrated.scene
    warnings: list[str] = []
    base_squares, ext_squares = block_squares(base), block_squares(extended)
    results = []
    for other in validation:
        try:
            data = measurement(work.plant, other)
        except KeyError as error:
            warnings.append(f"validation run {other.name}: sensor {error} is missing; not used")
            continue
        probe = predict(scene, data, work.baseline, settings)
        count = probe.scene.blocks.count
        if count < _LEAST_BLOCKS:
            warnings.append(f"validation run {other.name}: too short; not used")
            continue
        bound = any(library()[f.hypothesis.cause].RUN_BOUND for f in work.extended.fitted)
        refit = np.arange(0, count, 2, dtype=np.int64) if bound else None
        judged = np.arange(1 if bound else 0, count, 2 if bound else 1, dtype=np.int64)
        better = predict(scene, data, work.extended, settings, refit) if work.extended.fitted else probe
        if not better.settled:
            warnings.append(
                f"validation run {other.name}: the found law is so stiff there that its prediction did not settle; not used"
            )
            continue
        (e0, s0), (e1, _) = block_squares(probe), block_squares(better)
        if work.extended.fitted and pooled_nrmse(e1, s0, judged) > 1.02 * pooled_nrmse(e0, s0, judged):
            warnings.append(
                f"validation run {other.name}: the extended model is worse there than the calibrated one; "
                "its law was fitted on this run and may not hold beyond the strokes and speeds of it"
            )
        before, left = (pooled_nrmse(e, s0, judged) for e in (e0, e1))
        results.append(ValidationGain(
            other.name, before, left, bootstrap_interval(e0[judged], e1[judged], s0[judged], settings.bootstrap, settings.seed),
            min(noise_floor(probe.scene, s0, judged), before, left),
        ))
    judge = work.splits.judge
    baseline, after = (pooled_nrmse(e, base_squares[1], judge) for e in (base_squares[0], ext_squares[0]))
    # what is unknown of the tilt of brackets is an upper limit: where a model leaves less, it was less
    floor = min(noise_floor(base.scene, base_squares[1], judge), baseline, after)
    if not results:
        results.append(ValidationGain(
            f"{work.data.name} (judge blocks)", baseline, after,
            bootstrap_interval(
                base_squares[0][judge], ext_squares[0][judge], base_squares[1][judge], settings.bootstrap, settings.seed
            ), floor,
        ))
    if after > baseline * 1.02 and work.extended.fitted:
        warnings.append("the extended model is worse than the calibrated one on the judge blocks of the run")
    return Gain(_METRIC, baseline, after, floor, tuple(results)), warnings


def _extended_vehicle(
    work: _Work, state: ModelState, accepted: FullFit | None, soft: Fitted | None
) -> tuple[Vehicle, tuple[str, ...]]:
    ports = [(p.mount, p.axis) for p in work.plant.ports]
    vehicle = set_linear(work.vehicle, ports, state.stiffness, state.damping)
    remarks: list[str] = []
    for fitted in accepted.fitted if accepted is not None else ():
        cause = library()[fitted.hypothesis.cause]
        scene = accepted.scene if accepted is not None else work.calibrated.scene
        vehicle, notes = cause.extend(vehicle, scene, fitted)
        remarks += notes
    return vehicle, tuple(remarks)


def _ladder(work: _Work, base: Prediction, extended: Prediction) -> tuple[Step, ...]:
    dof = float(work.calibrated.scene.block_dof[work.splits.train].sum())
    errors, signal = block_squares(base)
    steps = [Step("calibrated linear model", pooled_nrmse(errors, signal, work.splits.judge), work.selector.base_excess, 0.0)]
    for current in work.selection.rounds:
        for candidate in current.candidates:
            named = (f.hypothesis for f in candidate.fit.fitted)
            label = " + ".join(title(h.cause, h.location, h.axis) for h in named)
            gain = candidate.log_likelihood - current.reference
            steps.append(Step(label, float("nan"), candidate.fit.misfit / dof, gain))
    return tuple(steps)
