# Copyright 2026 ride_estimation contributors
"""From fits to names: confidence, rivals, what would separate them, the sentence."""

from __future__ import annotations

import collections
import dataclasses
import math
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ride_estimation.diagnosis.answer.isolability import separation
from ride_estimation.diagnosis.answer.result import (
    EXPLAINED,
    INSUFFICIENT,
    NO_DISCREPANCY,
    Gain,
    NamedCause,
    Rival,
    ValidationGain,
)
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.wording import quantity, title
from ride_estimation.diagnosis.hypotheses.hypothesis import FORM, Fitted, Law, Reported
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.fitting import FullFit
from ride_estimation.diagnosis.search.free_law import NO_LAW, FreeLaw
from ride_estimation.diagnosis.search.selection import Candidate, Round, Selection
from ride_estimation.signals.recording import run_title

IntArray = NDArray[np.int64]

#: odds of a rival over the named cause from which on it is alive
ALIVE = 0.05
MISSED = 2.5  # error, in shares that count as right and over the noise floor, from which a model misses something
_LOUD = 0.2  # noise floor above which a clean verdict says that smaller effects would not show
_MOSTLY_NOISE = (
    " That much of the signal is noise because the vehicle hardly moves here: effects smaller than the noise would not show; "
    "drive over a rougher road."
)
_NEAR = 1.5  # error over noise floor above which a clean verdict does not claim to reach the noise
#: mean share that a law of general form explains beyond a right cause, over 57 cabs whose laws leave 5 % outside every family
#: (benchmarks/confusion_matrix.py --per-cause 3 --installation 1 --first-seed 88000)
_FORM_BEYOND = 0.013
_FORM_LEFT = 0.05  # mean share of the residual that the right cause leaves because the real law has another form
_TAIL = 3.0  # of what right causes leave: means that scatter by the factor 1.8 from one kind of mount to the next
_FITS_ANYTHING = 1.0 / 30.0  # share of what else a model misses that a law of general form at the best of all places fits
STRONG = 25.0  # deficit of a rival [nat] from which nothing is said that would separate it


def name_causes(
    selection: Selection, soft: Fitted | None, view: RunView, blocks: IntArray
) -> tuple[NamedCause, ...]:
    """Return the named causes, strongest first, each as sure as its last contest within the library makes it.

    Parameters
    ----------
    selection
        Rounds of forward selection.
    soft
        A mount out of line, from :mod:`outlier`.
    view
        The run seen through the extended model.
    blocks
        Blocks that fitted and selected.
    """
    out: list[tuple[float, NamedCause]] = []
    accepted = selection.accepted
    for fitted, contest in zip(accepted.fitted if accepted is not None else (), selection.contests):
        cause = library()[fitted.hypothesis.cause]
        confidence, rivals = _weigh(contest, blocks)
        axis = fitted.hypothesis.axis or _axis_of(view, fitted)
        named = NamedCause(
            fitted.hypothesis.cause, fitted.hypothesis.location, axis, weighed_sizes(cause.parameters(view, fitted), view),
            confidence, rivals, cause.WOULD_REFUTE, cause.MEASURE_NEXT, cause.QUESTION,
        )
        out.append((_strength(accepted, fitted, blocks), named))
    if soft is not None:
        cause = library()["one_soft_mount"]
        z = abs(float(soft.coefficients[0])) / max(soft.std(0), 1e-9)
        named = NamedCause(
            "one_soft_mount", soft.hypothesis.location, soft.hypothesis.axis, cause.parameters(view, soft),
            float(1.0 - np.exp(-0.5 * min(z, 20.0))), (),
            cause.WOULD_REFUTE, cause.MEASURE_NEXT, cause.QUESTION,
        )
        out.append((0.0, named))
    return tuple(named for _, named in sorted(out, key=lambda item: -item[0]))


def weighed_sizes(sizes: Sequence[Reported], view: RunView) -> tuple[Reported, ...]:
    """Return sizes whose standard deviations hold that of the mass of the vehicle file.

    Accelerations tell forces and masses in proportion to the mass of the body, ``var(F) += F^2 var(m) / m^2``; of several bodies
    that of the one least known counts.
    """
    masses = [body.mass for body in view.plant.vehicle.bodies.values()]
    shares = [mass.std / mass.value for mass in masses if mass.std is not None and math.isfinite(mass.std)]
    share = max(shares, default=0.0)
    return tuple(
        dataclasses.replace(r, std=math.hypot(r.std, share * r.value)) if r.unit in ("N", "N m", "kg") else r for r in sizes
    )


def within_library(counts: Sequence[int], remaining: float, law: FreeLaw, settings: Settings) -> float:
    """Return the probability that the named causes, and not one effect that no library lists, explain the run.

    One effect outside the library rivals every set of causes that it could stand for: those that act by forces, or those of one
    sensor; where there are others, they are right beside it. A further cause has its prior, so an unknown effect that takes
    several causes to describe gets the likelier the more they are. Two shares tell a cause that only mimics the real one: what
    remains, and what a law of general form explains beyond the cause. Both are small on average for a right cause, the second a
    share of whatever else the model misses on top; a mimic leaves anything up to all of it. They are no independent evidence: the
    one that says more counts. How far real laws are from those of a library is known as an average over mounts at best, and that
    differs from one kind of mount to the next: the shares of a right cause are exponential with an unknown mean, which is the
    distribution of Lomax (1954). Causes that are no force laws have one more rival: a law of general form at one mount that
    explains without them nearly as much as they do.

    Parameters
    ----------
    counts
        Numbers of named causes that one effect could stand for, see :func:`causes_per_effect`.
    remaining
        Share of the residual energy above the noise floor that they leave.
    law
        The law without a name that explains most of that.
    """
    odds = settings.unknown_probability / (1.0 - settings.unknown_probability)
    odds *= sum(settings.further_cause ** (1 - count) for count in counts) if counts else 1.0
    left = 1.0 / _right(min(remaining, 1.0), _FORM_LEFT)
    beyond = 1.0 / _right(min(law.share, 1.0), _FORM_BEYOND + _FITS_ANYTHING * law.left)
    instead = max(_right(max(1.0 - law.alone, 0.0), _FORM_LEFT), 1.0)
    return 1.0 / (1.0 + odds * max(left, beyond) * instead)


def _right(share: float, mean: float) -> float:
    """Return the probability density of a share that a right cause leaves, Lomax with a mean and :data:`_TAIL`.

    Averaged over shares that differ from it by the mean at most: that is as fine as it is known of mimics. Of 42 effects outside
    the library (``benchmarks/confusion_matrix.py --outside``) two left less than 5 %, as many as of shares that may be anything.
    """
    scale, least, most = (_TAIL - 1.0) * mean, max(share - mean, 0.0), share + mean
    exceeded = [math.pow(1.0 + x / scale, -_TAIL) for x in (least, most)]
    return (exceeded[0] - exceeded[1]) / (most - least)


def _axis_of(view: RunView, fitted: Fitted) -> str:
    """Return the axis of the strongest reported coordinate of causes without an axis of their own."""
    if fitted.hypothesis.cause != "harmonic_disturbance":
        return ""
    names = [p.name.split()[-1] for p in library()[fitted.hypothesis.cause].parameters(view, fitted) if "amplitude" in p.name]
    return names[0] if names else ""


def _strength(accepted: FullFit | None, fitted: Fitted, blocks: IntArray) -> float:
    """Return the misfit that the model would have without one fitted cause."""
    if accepted is None:
        return 0.0
    place = next(i for i, other in enumerate(accepted.fitted) if other is fitted)
    return accepted.misfit_without(place, blocks)


def reversal_odds(leader: Candidate, other: Candidate, temper: float, blocks: IntArray, effect: float = 0.0) -> float:
    """Return the odds that other stretches of road would rank two fits the other way round.

    The difference of two log-likelihoods scatters from block to block; its sum over B blocks has the standard deviation
    ``sqrt(B) s`` (Vuong 1989, Econometrica 57, for models neither of which need be right). On top of that no law of a library
    is the real one: the share of the effect that the form of a law misses does not average out over the road.

    Parameters
    ----------
    effect
        What the leader gains over the model without it [nat].
    """
    gap = other.behind(leader)
    per_block = (other.fit.block_misfit - leader.fit.block_misfit)[blocks] / (2.0 * temper)
    sampled = float(np.sqrt(len(blocks)) * np.std(per_block, ddof=1)) if len(blocks) > 1 else 0.0
    form = FORM * (max(effect, 0.0) + max(other.elsewhere.effect, 0.0))
    spread = float(np.linalg.norm([sampled, other.elsewhere.spread, form]))
    if spread <= 0.0 or gap <= 0.0:
        return 0.0
    below = float(ndtr(-gap / spread))
    return below / (1.0 - below)


def rivals_of(contest: Round, blocks: IntArray) -> list[tuple[Candidate, float]]:
    """Return the best candidate of every other cause with its odds over the one that leads, likeliest first."""
    leader = contest.candidates[0]
    effect = leader.log_likelihood - contest.reference
    best = {leader.hypothesis.cause: leader}
    for c in sorted(contest.candidates[1:], key=lambda c: c.behind(leader)):
        best.setdefault(c.hypothesis.cause, c)

    def odds(other: Candidate) -> float:
        alike = float(np.exp(-max(other.behind(leader), 0.0)))
        return max(alike, reversal_odds(leader, other, contest.temper, blocks, effect))

    return sorted(((c, odds(c)) for c in best.values() if c is not leader), key=lambda pair: -pair[1])


def _weigh(contest: Round, blocks: IntArray) -> tuple[float, tuple[Rival, ...]]:
    """Return confidence and rivals of the cause that won a comparison, everything else equal."""
    leader = contest.candidates[0]
    named = leader.hypothesis.cause
    values = np.array([leader.log_likelihood - c.behind(leader) for c in contest.candidates] + [contest.reference])
    weights = np.exp(np.clip(values - values.max(), -700.0, 0.0))
    for i, c in enumerate(contest.candidates):
        effect = leader.log_likelihood - contest.reference
        weights[i] = max(weights[i], weights.max() * reversal_odds(leader, c, contest.temper, blocks, effect))
    same = sum(w for w, c in zip(weights, contest.candidates) if c.hypothesis.cause == named)
    rivals: dict[str, Rival] = {}
    for c in contest.candidates:
        h = c.hypothesis
        if h.cause == named or h.cause in rivals:
            continue
        deficit = c.behind(leader)
        ratio = float(np.sqrt(c.fit.misfit / max(leader.fit.misfit, 1e-9)))
        words = f"log-likelihood {deficit:.0f} nat lower; leaves {ratio:.2f} times the residual of the named cause"
        hint = separation(named, h.cause) if deficit < STRONG else ""
        rivals[h.cause] = Rival(h.cause, h.location, h.axis, words, float(deficit), hint)
    return float(same / weights.sum()), tuple(sorted(rivals.values(), key=lambda r: r.log_likelihood_deficit))


def gained_nothing(gain: Gain, settings: Settings) -> str:
    """Return on which run found causes gain nothing, empty if on none.

    Nothing: the error is above the noise floor, and of what could be gained less than a share that is relevant is, the interval
    of the gain includes zero and excludes half. Of a run that goes beyond the strokes and rates of the fitted one, what is within
    them counts: how a law goes on beyond them no run has told.
    """
    for other in gain.validation:
        if other.in_range is not None:
            before, after, floor = other.in_range
            if before - after >= settings.relevance * (before - floor):
                continue
        removable = other.baseline - other.noise_floor
        nothing = other.ci95[0] <= 0.0 and other.baseline - other.extended < settings.relevance * removable
        little = other.ci95[1] < 0.5 * removable
        if _missed(other) > MISSED * settings.adequacy and nothing and little:
            return (
                f"fitted the run but gained nothing on {run_title(other.run)} (error {100 * other.baseline:.1f} % to "
                f"{100 * other.extended:.1f} %, noise floor {100 * other.noise_floor:.1f} %)"
            )
    return ""


def left_elsewhere(gain: Gain, settings: Settings) -> float | None:
    """Return the share of the energy above the noise floor that named causes leave where nothing was fitted.

    Of a run that goes beyond the strokes and rates of the fitted one, what is within them counts. None where there is less to
    remove than a right model may leave: a fault that shows in mean readings or strained tolerances.
    """
    least = MISSED * settings.adequacy
    judged = [run for run in _missed_within_range(gain) if run[0] ** 2 > 2.0 * least**2]
    return _share_left(judged) if judged else None


def right_elsewhere(gain: Gain, settings: Settings) -> bool:
    """Return whether named causes leave nowhere more than a model that counts as right, with causes or without, may miss."""
    return all(after <= MISSED * settings.adequacy for _, after in _missed_within_range(gain))


def share_left(gain: Gain) -> float:
    """Return the share of the energy above the noise floor that named causes leave, however little a right model may leave."""
    return _share_left(_missed_within_range(gain))


def _share_left(judged: Sequence[tuple[float, float]]) -> float:
    before, after = (sum(missed**2 for missed in model) for model in zip(*judged))
    return float(after / max(before, 1e-300))


def _missed_within_range(gain: Gain) -> list[tuple[float, float]]:
    """Return what both models miss of every run beyond the noise, within the strokes that causes were fitted on."""
    judged = [v.in_range or (v.baseline, v.extended, v.noise_floor) for v in gain.validation]
    return [(_beyond(before, floor), _beyond(after, floor)) for before, after, floor in judged]


def causes_per_effect(fitted: Sequence[Fitted], sensors: Collection[str], soft: bool = False) -> tuple[int, ...]:
    """Return how many of the named causes one effect could stand for: those that act by forces, and those of every sensor.

    Parameters
    ----------
    soft
        Whether a mount out of line is named beside the fitted causes.
    """
    of_sensors = collections.Counter(f.hypothesis.location for f in fitted if f.hypothesis.location in sensors)
    forces = force_laws([f for f in fitted if f.hypothesis.location not in sensors]) + soft
    return (*([forces] if forces else []), *of_sensors.values())


def force_laws(fitted: Sequence[Fitted]) -> int:
    """Return the number of causes; force laws of one kind at mounts that they share are one law, described in parts."""
    found: list[tuple[Law | None, set[int]]] = []
    for f in fitted:
        law, ports = library()[f.hypothesis.cause].LAW, set(f.hypothesis.ports)
        same = [part for part in found if law is not None and part[0] is law and part[1] & ports]
        found = [part for part in found if part not in same]
        found.append((law, ports.union(*(part[1] for part in same))))
    return len(found)


def proven(gain: Gain, settings: Settings) -> bool:
    """Return whether the gain of named causes is beyond doubt and relevant on every run that took no part."""
    return all(
        v.ci95[0] > 0.0 and v.baseline - v.extended > settings.relevance * (v.baseline - v.noise_floor) for v in gain.validation
    )


def unexplained_run(gain: Gain, settings: Settings) -> str:
    """Return the validation run that a model, with its named causes if any, misses most beyond its floor, empty where none."""
    enough = MISSED * settings.adequacy
    missed = {v.run: v.extended / v.noise_floor for v in gain.validation if _beyond(v.extended, v.noise_floor) > enough}
    worst = max(missed, key=lambda run: missed[run], default="")
    return worst if worst and missed[worst] > MISSED else ""


def shows_elsewhere(gain: Gain, settings: Settings) -> bool:
    """Return whether what the model misses on a run shows where nothing was fitted.

    On another run, or clearly on the judge blocks; as a named cause has to gain there, an unnamed one has to be missed there.
    """
    clear = gain.baseline > _NEAR * gain.noise_floor
    return clear or any(_missed(other) > MISSED * settings.adequacy for other in gain.validation)


def _missed(run: ValidationGain) -> float:
    """Return the error of the baseline without what the noise makes of it."""
    return _beyond(run.baseline, run.noise_floor)


def _beyond(error: float, floor: float) -> float:
    """Return an error without what the noise makes of it."""
    return math.sqrt(max(error**2 - floor**2, 0.0))


def describe(verdict: str, causes: Sequence[NamedCause], gain: Gain | None, remaining: float, law: FreeLaw = NO_LAW) -> str:
    """Return the verdict in words, numbers first."""
    if verdict == INSUFFICIENT or gain is None:
        return "The data do not show whether the model is right."
    judged, where = gain.validation[0], run_title(gain.validation[0].run)
    floor = 100.0 * judged.noise_floor
    if verdict == NO_DISCREPANCY:
        how = "down to the measurement noise"
        if judged.baseline > _NEAR * judged.noise_floor:
            how = "so well that what it misses beyond the measurement noise is too little to name a cause"
        return (
            f"The calibrated model explains the run {how}: error {100 * judged.baseline:.1f} % "
            f"against a noise floor of {floor:.1f} %." + (_MOSTLY_NOISE if judged.noise_floor > _LOUD else "")
        )
    named = "; ".join(_phrase(c) for c in causes)
    does = "reduces" if judged.extended < judged.baseline else "changes"
    effect = (
        f"extending the model {does} the error on {where} from {100 * judged.baseline:.1f} % to "
        f"{100 * judged.extended:.1f} % (noise floor {floor:.1f} %)"
    )
    if judged.in_range is not None:
        plain, better, _ = judged.in_range
        effect += f", within the strokes and rates of the fitted run from {100 * plain:.1f} % to {100 * better:.1f} %"
    rest = ""
    if judged.extended > _NEAR * judged.noise_floor and _FORM_LEFT < _energy(judged) < 1.0:
        rest = f"; {100 * _energy(judged):.0f} % of the error energy above the noise floor remain unexplained{_left_to(law)}"
    if verdict == EXPLAINED:
        if all(c.id == "one_soft_mount" for c in causes):  # it is in the calibrated model: nothing is extended
            left = 100.0 * judged.extended
            effect = f"the model calibrated with it leaves {left:.1f} % on {where} (noise floor {floor:.1f} %)"
        return f"{named[0].upper()}{named[1:]}; {effect}{rest}."
    if causes:
        return (
            f"The model misses something that the library does not name: the best candidate ({named}) leaves "
            f"{100 * remaining:.0f} % of the residual energy above the noise floor{_left_to(law)}; {effect}."
        )
    return (
        f"The model misses something that the library does not name: error {100 * judged.baseline:.1f} % on {where} against a "
        f"noise floor of {floor:.1f} %."
    )


def _energy(run: ValidationGain) -> float:
    """Return the share of the error energy above the noise floor that an extended model leaves on a run."""
    before = run.baseline**2 - run.noise_floor**2
    return (run.extended**2 - run.noise_floor**2) / max(before, 1e-12)


def _left_to(law: FreeLaw) -> str:
    """Return where a force of another form explains more, empty where none does."""
    if law.share <= FORM:
        return ""
    place = f"{law.location} {law.axis}".strip()
    return f" and a force of another form at {place} explains {100 * law.share:.1f} % more than it does"


def _phrase(cause: NamedCause) -> str:
    reported = [p for p in cause.parameters if p.value != 0.0 or p.std > 0.0]
    numbers = ", ".join(_number(p) for p in reported[:2])
    return f"{title(cause.id, cause.location, cause.axis)} ({numbers}; confidence {100 * cause.confidence:.0f} %)"


def _number(p: Reported) -> str:
    return quantity(p.name, p.value, p.std, p.unit)
