# Copyright 2026 ride_estimation contributors
"""From score tests to a set of causes: shortlist, full fits, forward selection with backward check."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.linear_model import Calibrated, beyond_limits
from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.splits import Splits
from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted, Hypothesis, Sign
from ride_estimation.diagnosis.runs.noise import temper_of
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.candidates import (
    Identity,
    at_bounds,
    beyond_tolerance,
    identity,
    same_model,
    same_place,
    shortlist,
    taken,
    within,
)
from ride_estimation.diagnosis.search.fits import Fits
from ride_estimation.diagnosis.search.fitting import FullFit, FullFitter, tolerance_of, unsettled
from ride_estimation.diagnosis.search.free_law import NO_LAW, FreeLaw, form_columns, free_law
from ride_estimation.diagnosis.search.refinement import Refinement
from ride_estimation.diagnosis.search.screening import Projector, Score, mean_rows, screen, solve_signed

Array = NDArray[np.float64]

#: other hypotheses at the places of known causes that stand for what their laws describe badly
_SLACK = 6
#: multiple of the significance above which a cause needs no fit without it to be called necessary
_CLEARLY = 4.0
#: misfit per degree of freedom above which a model is far from the measurement noise
_FAR = 1.1
#: share of its evidence that a further cause must not owe to badly described ones, and its least share of the residual
_OWN, _MINOR = 0.5, 0.02
#: share of the original residual that a further cause removes at least, also where that is all that is left
_LEAST = 0.01
#: standard deviations by which a plant may be from the installation that the accepted causes leave
_BENT = 0.5
#: share of the best score of a round from which a hypothesis is a rival of the cause that it names: without (with) it the longest
#: search of `confusion_matrix.py --pairs 12 --installation 1 --first-seed 1000000` takes 123 (93) s, answers are the same
_RIVAL = 0.02
#: log odds for a fault that shows in mean readings alone [nat]: a thousand to one, for two dozen channels are asked; no model of
#: anything that moves errs there. Offset and gain of an axis at three standard deviations each stay below
_IN_MEANS = 7.0

Build = Callable[[RunView], Sequence[Hypothesis]]


@dataclasses.dataclass(frozen=True)
class Elsewhere:
    """What validation runs say of a candidate against the first one of its round.

    Attributes
    ----------
    gap
        Log-likelihood by which it predicts them worse [nat].
    spread
        Standard deviation of the gap over other stretches of road [nat].
    effect
        Log-likelihood that the first one gains there over the model without it [nat].
    """

    gap: float = 0.0
    spread: float = 0.0
    effect: float = 0.0


@dataclasses.dataclass(frozen=True)
class Candidate:
    """A fully fitted set of hypotheses with its likelihood.

    Attributes
    ----------
    contested
        Position of the hypothesis that the candidates of a round differ in.
    elsewhere
        Evidence of validation runs, none where they were not asked.
    """

    fit: FullFit
    log_likelihood: float
    contested: int = -1
    elsewhere: Elsewhere = Elsewhere()

    def behind(self, leader: Candidate) -> float:
        """Return the log-likelihood by which it is worse than the first of its round, on the run and elsewhere [nat]."""
        return leader.log_likelihood - self.log_likelihood + self.elsewhere.gap

    @property
    def hypothesis(self) -> Hypothesis:
        """Return the hypothesis that the candidates of a round differ in."""
        return self.fit.fitted[self.contested].hypothesis


@dataclasses.dataclass(frozen=True)
class Round:
    """Rivals for one place in a model, everything else equal.

    Attributes
    ----------
    candidates
        Best first, log-likelihoods on one temper.
    reference
        Log-likelihood of the model without any of them on the same temper.
    temper
        The common temper.
    own
        Share of the evidence for the best candidate that stays when everything else the library can say about the places of
        the other causes is in the model as well.
    rivals
        Hypotheses that a score test gave a share of what it gave the best one; all where None.
    """

    candidates: tuple[Candidate, ...]
    reference: float
    temper: float
    own: float = 1.0
    rivals: frozenset[Identity] | None = None


@dataclasses.dataclass(frozen=True)
class Selection:
    """Outcome.

    Attributes
    ----------
    accepted
        The accepted model, None for the calibrated one.
    rounds
        Every comparison, in the order it was made.
    contests
        For every accepted cause its last comparison with its rivals, the other causes in the model.
    spent
        Whether the search ended because its budget of full fits was used up.
    """

    accepted: FullFit | None
    rounds: tuple[Round, ...]
    contests: tuple[Round, ...] = ()
    spent: bool = False


def required_evidence(fit: FullFit, place: int, settings: Settings) -> float:
    """Return the gain in penalised log-likelihood that the hypothesis at a place of a fit must bring [nat]."""
    own = fit.part(place % len(fit.fitted))
    moves = np.any(fit.rows[:, :, own]) if fit.rows.size else not fit.fitted[place].hypothesis.shows_in_means
    return settings.significance if moves else min(_IN_MEANS, settings.significance)


class Selector:
    """Selects causes on the fit and select blocks.

    Parameters
    ----------
    calibrated
        Best linear model.
    splits
        Blocks.
    build
        Hypotheses of a view.
    settings
        Thresholds.
    progress
        Called with the share of the work done.
    """

    def __init__(
        self, calibrated: Calibrated, splits: Splits, build: Build, settings: Settings,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        self._build, self._settings = build, settings
        self._fits = Fits(calibrated, splits, settings)
        self._refine = Refinement(self._fits, build)
        self._progress = progress or (lambda share: None)
        self._rounds: list[Round] = []
        fit, regression = calibrated.fit, calibrated.regression
        self.base_misfit = regression.misfit(regression.grams, self._fits.blocks, fit.coefficients)
        alone = regression.fit(regression.grams, splits.fit)
        self._base_held_out = regression.misfit(regression.grams, splits.select, alone.coefficients)
        self._base_penalty = calibrated.penalty

    @property
    def fitter(self) -> FullFitter:
        """Return what fits a given set of hypotheses on the same blocks."""
        return self._fits.fitter

    @property
    def _cal(self) -> Calibrated:
        return self._fits.calibrated

    @property
    def base_excess(self) -> float:
        """Return the misfit per degree of freedom of the calibrated model."""
        return self.base_misfit / self._fits.dof

    def run(self) -> Selection:
        """Run forward selection; after every further cause the earlier ones are contested again."""
        accepted: FullFit | None = None
        families: FullFit | None = None
        contests: dict[Identity, Round] = {}
        for number in range(self._settings.maximum_causes):
            held, bounded = self._cal, self._bounded(accepted)
            current = self._round(bounded)
            if bounded is not accepted and not (current.candidates and self._worthwhile(current, bounded)):
                self._fits.hold(held)
                current = self._round(accepted)
            elif bounded is not accepted:
                accepted = bounded
            record = self._recorded(current)
            self._progress((number + 1) / self._settings.maximum_causes)
            if not current.candidates:
                break
            worthwhile = self._worthwhile(current, accepted)
            split = None if worthwhile or accepted is None else self._split(current.candidates[0].fit, accepted)
            worthwhile |= split is not None
            if not worthwhile and (accepted is None or not self._puzzling(accepted)):
                break
            before, known = accepted, dict(contests)
            accepted = self._refine.narrowed(current.candidates[0].fit) if split is None else split
            contests[identity(accepted.fitted[-1].hypothesis)] = record
            if number and worthwhile:
                accepted = self._contested(self._without_idle(accepted), contests)
            elif number:
                accepted = self._without_idle(self._contested(accepted, contests))
            if not worthwhile and before is not None and not self._solved(before, accepted):
                accepted, contests = before, known
                break
            newest = identity(accepted.fitted[-1].hypothesis)
            accepted = self._without_tolerated(self._settled(accepted))
            dropped = newest not in [identity(f.hypothesis) for f in accepted.fitted]
            # what is the form of a law is no further cause; rivals are of families, so contests are between families
            families, of_any_form = accepted, self._refine.with_corners(accepted)
            if dropped or self._exhausted(of_any_form) or self._fits.spent:
                break
        if accepted is not None:
            accepted = of_any_form if accepted is families else self._refine.with_corners(accepted)
            accepted = self._refine.converged(self._refine.widened(accepted, contests))
        kept = accepted.fitted if accepted is not None else ()
        found = (contests.get(identity(f.hypothesis)) for f in kept)
        return Selection(
            accepted, tuple(self._rounds), tuple(r if r is not None else self._rounds[0] for r in found), self._fits.spent
        )

    def _split(self, further: FullFit, accepted: FullFit) -> FullFit | None:
        """Return the model with the last cause of a fit in the place of a law at the mounts that both share, None where worse.

        One law at two mounts and two laws at one mount each say as much: a law at a group that stands at one of its mounts for
        another law takes most of what is evidence for that one.
        """
        last = further.fitted[-1]
        for place, f in enumerate(accepted.fitted):
            rest = set(f.hypothesis.ports) - set(last.hypothesis.ports)
            if not rest or len(rest) == len(f.hypothesis.ports) or last.hypothesis.cause == f.hypothesis.cause:
                continue
            fewer = next((h for h in self._build(accepted.view) if within(h, f.hypothesis) and set(h.ports) == rest), None)
            if fewer is None:
                continue
            others = [other for i, other in enumerate(accepted.fitted) if i != place]
            trial = self._fits.one([*others, Score(fewer, f.shape, np.zeros(0), 0.0, 0.0), last], 2, accepted)
            temper = self._fits.temper([accepted, trial])
            gain = trial.log_likelihood(temper) - accepted.log_likelihood(temper)
            if gain > self._settings.significance and trial.held_out < accepted.held_out:
                return trial
        return None

    def _settled(self, accepted: FullFit) -> FullFit:
        """Return accepted causes in a model whose installation is calibrated with them.

        A fault that nothing named yet bends all tolerances that can make up for a part of it, beyond what a good installation
        has: readings of other sensors of the same body, of the bases, the CG. They are free again once it is named. Where they
        leave what a good installation has even then, they make up for a cause that is not named yet; where the plant that they
        lead to explains the run clearly worse, they were none of the installation. A load is balanced with the CG and the
        readings of the bases in every fit already.
        """
        loaded = any(f.hypothesis.moves_cg for f in accepted.fitted)
        if loaded or (not self._cal.held and unsettled(accepted) < _BENT):
            return accepted
        held = self._cal
        self._fits.hold(dataclasses.replace(held, held={}))
        settled = self._fits.one(accepted.fitted, 3, accepted, settle=True)
        temper = self._fits.temper([accepted, settled])
        worse = settled.log_likelihood(temper) < accepted.log_likelihood(temper) - self._settings.significance
        if not worse and not settled.strained:
            return settled
        self._fits.hold(held)
        return accepted

    def _without_tolerated(self, fit: FullFit) -> FullFit:
        """Return the fit without causes that shrank, beside the others, to what an installation in its tolerance has."""
        kept = [f for i, f in enumerate(fit.fitted) if beyond_tolerance(fit, i)]
        return fit if not kept or len(kept) == len(fit.fitted) else self._fits.one(kept, 2, fit)

    def _bounded(self, accepted: FullFit | None) -> FullFit | None:
        """Return the accepted model with errors that no good installation has held where their causes count from.

        What a cause left unseen the tolerances of the calibrated model were too wide for; a model that explains the run shows it.
        """
        if accepted is None or not self._fits.explained(accepted):
            return accepted
        count = len(accepted.adjustables)
        beyond = beyond_limits(accepted.adjustables, accepted.coefficients[:count], accepted.covariance[:count, :count])
        own, first = accepted.adjustables, self._cal.adjustables
        fresh = {i: v - own[i].offset + first[i].offset for i, v in beyond.items() if i not in self._cal.held}
        if not fresh:
            return accepted
        self._fits.hold(dataclasses.replace(self._cal, held={**self._cal.held, **fresh}))
        return self._fits.one(accepted.fitted, 2, accepted)

    def better_law(self, accepted: FullFit | None) -> FreeLaw:
        """Return the law without a name that explains more than accepted causes; of causes that show in means only, none."""
        if accepted is None or not accepted.in_band:
            return NO_LAW
        view, problem = self._fits.residual_problem(accepted)
        plain = self._cal.regression.block_misfit(self._cal.regression.grams, self._cal.fit.coefficients)
        relieved = accepted.regression.temper * max(self._base_penalty - accepted.penalty, 0.0)
        explained = float((plain - accepted.block_misfit).sum()) + relieved
        # a stop that is hit in one block has no force without it: folds of the run may change a named law, not forget it
        count = accepted.regression.count
        named = accepted.coefficients[count:][accepted.coefficients[count:] != 0.0]
        spread = np.concatenate([np.sqrt(problem.temper) * problem.prior_std[:count], np.abs(named)])
        problem = problem.with_prior(spread, np.concatenate([problem.prior_offset[:count], named]))
        law = free_law(view, self._cal.table, problem, explained, float((accepted.block_misfit - view.block_dof).sum()))
        if any(f.hypothesis.ports for f in accepted.fitted):
            return law
        instead = free_law(self._cal.view, self._cal.table, self._cal.regression, explained, 0.0)
        return dataclasses.replace(law, alone=instead.share)

    def without_weakest(self, selection: Selection, accepted: FullFit) -> Selection:
        """Return a selection of several accepted causes without the one that the others need least."""
        places = range(len(accepted.fitted))
        trials = self._fits.all([[f for i, f in enumerate(accepted.fitted) if i != drop] for drop in places], 2, accepted)
        temper = temper_of(accepted.misfit / self._fits.dof, accepted.inefficiency)
        drop = max(places, key=lambda i: trials[i].log_likelihood(temper))
        contests = tuple(c for i, c in enumerate(selection.contests) if i != drop)
        return dataclasses.replace(selection, accepted=trials[drop], contests=contests)

    def runner_up(self, selection: Selection) -> Selection | None:
        """Return the selection of the next worthwhile candidate of the first round, None where there is none."""
        first = selection.rounds[0]
        if len(first.candidates) < 2:
            return None
        rest = dataclasses.replace(first, candidates=first.candidates[1:])
        fit = self._fits.one(rest.candidates[0].fit.fitted, 3, None)
        best = Candidate(fit, fit.log_likelihood(first.temper))
        rest = dataclasses.replace(rest, candidates=(best, *rest.candidates[1:]))
        further = dataclasses.replace(selection, accepted=fit, rounds=(rest, *selection.rounds[1:]), contests=(rest,))
        return further if self._worthwhile(rest, None) else self.runner_up(further)

    def compared(self, fits: Sequence[FullFit], place: int, before: FullFit | None = None) -> Round:
        """Return fits that differ in the hypothesis at ``place`` as rivals, ``before`` the model without any of those."""
        temper = min(temper_of(f.misfit / self._fits.dof, f.inefficiency) for f in fits)
        candidates = sorted((Candidate(f, f.log_likelihood(temper), place) for f in fits), key=lambda c: -c.log_likelihood)
        return Round(tuple(candidates), self._reference(before, temper), temper)

    def names(self, current: Round) -> bool:
        """Return whether the best candidate of a first round is evident enough to be a cause."""
        return self._worthwhile(current, None)

    def _lightened(self, found: list[tuple[FullFit, int]], kept: FullFit | None) -> list[tuple[FullFit, int]]:
        """Return the fits of a round so far, all but the best and the accepted one without their trajectories.

        Trajectories take a hundred megabytes each.
        """
        temper = self._fits.temper(f for f, _ in found)
        best = max((f for f, _ in found), key=lambda f: f.log_likelihood(temper))
        return [
            (f if f is best or f is kept else f.slim(self._cal.view, self._cal.regression), place) for f, place in found
        ]

    def _without_trajectory(self, candidate: Candidate) -> Candidate:
        return dataclasses.replace(candidate, fit=candidate.fit.slim(self._cal.view, self._cal.regression))

    def _recorded(self, current: Round) -> Round:
        """Put the numbers of a round on record and return them; the trajectory of its winner lives as long as it is accepted."""
        record = dataclasses.replace(current, candidates=tuple(map(self._without_trajectory, current.candidates)))
        self._rounds.append(record)
        return record

    def _puzzling(self, accepted: FullFit) -> bool:
        """Return whether so much is left that the accepted causes may be wrong ones that stand for several others.

        Evidence is then weak whatever is added, because most of the residual counts as model error.
        """
        left = (accepted.misfit - self._fits.dof) / max(self.base_misfit - self._fits.dof, 1e-9)
        return left > self._settings.unexplained and accepted.misfit > _FAR * self._fits.dof

    def _solved(self, before: FullFit, after: FullFit) -> bool:
        """Return whether a further cause tried on trust, with the earlier ones contested, explains what was left."""
        temper = temper_of(after.misfit / self._fits.dof, after.inefficiency)
        gain = after.log_likelihood(temper) - before.log_likelihood(temper)
        excess = max(before.misfit - self._fits.dof, 1e-9)
        return (
            gain > self._settings.significance * len(after.fitted) and after.held_out < before.held_out
            and before.misfit - after.misfit > (1.0 - self._settings.unexplained) * excess
        )

    def _contested(self, accepted: FullFit, contests: dict[Identity, Round]) -> FullFit:
        """Return the model after every cause but the last was compared with its rivals, the others in the model.

        A cause chosen before the others were known was chosen on a residual full of them.
        """
        pending = [identity(f.hypothesis) for f in accepted.fitted[:-1]]
        for _ in range(2 * len(accepted.fitted)):
            if not pending or self._fits.spent:
                break
            wanted = pending.pop(0)
            place = next((i for i, f in enumerate(accepted.fitted) if identity(f.hypothesis) == wanted), None)
            if place is None:
                continue
            known = contests.get(wanted)
            current = self._round(accepted, place, None if known is None else known.rivals)
            record, best = self._recorded(current), current.candidates[0]
            contests[identity(best.hypothesis)] = record
            if best.fit is not accepted:
                accepted = self._refine.narrowed(best.fit)
                contests[identity(accepted.fitted[-1].hypothesis)] = record
                others = [identity(f.hypothesis) for f in accepted.fitted[:-1]]
                pending = [*pending, *(i for i in others if i not in pending)]
        return accepted

    def _exhausted(self, accepted: FullFit) -> bool:
        """Return whether too little is left, in residual, priors and mean readings, for any further cause to count.

        Small faults of sensors hide in tolerances that leave their prior and not in the residual.
        """
        if accepted.strained:
            return False
        left = (accepted.misfit - self._fits.dof) / max(self.base_misfit - self._fits.dof, 1e-9)
        return left < _MINOR or accepted.misfit < self._fits.dof * (1.0 + 3.0 * np.sqrt(2.0 / self._fits.dof))

    # ------------------------------------------------------------------ one round
    def _round(
        self, accepted: FullFit | None, place: int | None = None, rivals: frozenset[Identity] | None = None
    ) -> Round:
        """Compare candidates for a further cause, or with ``place`` for that of one accepted cause among its ``rivals``."""
        view, regression = self._fits.residual_problem(accepted, place)
        projector = Projector(regression, self._fits.blocks)
        kept = [f for i, f in enumerate(accepted.fitted) if i != place] if accepted is not None else []
        hypotheses = [h for h in self._possible(view, kept) if rivals is None or identity(h) in rivals]
        scores = screen(view, self._cal.table, projector, hypotheses, self._fits.dof)
        if rivals is None:
            leading = max((s.gain for s in scores), default=0.0)
            rivals = frozenset(identity(s.hypothesis) for s in scores if s.gain > _RIVAL * leading)
        if accepted is None:
            short = shortlist(scores, self._settings.candidates)
        else:
            short = shortlist(scores, max(self._settings.candidates // 2, 3), least=1)
        found: list[tuple[FullFit, int]] = []
        if accepted is not None and place is not None:
            found.append((accepted, place))
            short = [s for s in short if not same_model(s, accepted.fitted[place])]
        passes = 3 if accepted is None else 2
        starts: list[Sequence[Score | Fitted]] = [[*kept, s] for s in short]
        tried: list[Sequence[Score | Fitted]] = [()] * len(found)
        for start, fit in zip(starts, self._fits.each(starts, passes, accepted)):
            if fit.meaningful and (accepted is None or (beyond_tolerance(fit) and not at_bounds(fit.fitted[-1]))):
                found, tried = self._lightened([*found, (fit, len(kept))], accepted), [*tried, start]
        temper = self._fits.temper(f for f, _ in found)
        order = sorted(range(len(found)), key=lambda i: -found[i][0].log_likelihood(temper))
        if order and not found[order[0]][0].rows.shape[2]:
            # it was behind when its trajectory was given up: a common temper falls with further fits
            found[order[0]] = self._fits.one(tried[order[0]], passes, accepted), len(kept)
        candidates = [Candidate(f, f.log_likelihood(temper), i) for f, i in (found[n] for n in order)]
        candidates = [*candidates[:1], *map(self._without_trajectory, candidates[1:])]
        own = 1.0
        if candidates and kept and place is None:
            own = self._own_share(view, projector, scores, kept, candidates[0])
        reference = self._reference(accepted, temper)
        if accepted is not None and place is not None:
            reference -= (accepted.misfit_without(place, self._fits.blocks) - accepted.misfit) / (2.0 * temper)
        return Round(tuple(candidates), reference, temper, own, rivals)

    def _possible(self, view: RunView, kept: Sequence[Fitted]) -> list[Hypothesis]:
        """Return the hypotheses that may join accepted ones: a load that nothing weighs if the CG is off beyond its limit."""
        everything = self._cal.adjustables
        off = {everything[i].place for i in self._cal.held if everything[i].kind == "cg"}
        moved = {f.hypothesis.location for f in kept if f.hypothesis.moves_cg}
        return [
            h for h in self._build(view)
            if not taken(h, kept) and not (kept and h.only_alone and not (h.moves_cg and h.location in off))
            and not (tolerance_of(h)[0] == "cg" and h.location in moved)
        ]

    def _own_share(
        self, view: RunView, projector: Projector, scores: Sequence[Score], kept: Sequence[Fitted], best: Candidate
    ) -> float:
        """Return the share of a candidate's gain that nothing else at the places of the other causes can bring.

        A law that describes a cause badly leaves a residual that other causes fit to some extent. Whatever the library can say
        about the places of the known causes, and any law there that depends on what theirs depend on, stands for that; what
        these take over is no evidence for one more cause.
        """
        mine = best.hypothesis
        near = [
            s for s in scores
            if any(same_place(s.hypothesis, k.hypothesis) for k in kept) and not same_place(s.hypothesis, mine)
        ][:_SLACK]
        parts = [s.hypothesis.columns(view, s.shape) for s in near]
        slack = [c for columns in parts for c in columns]
        signs = [sign for s, columns in zip(near, parts) for sign in s.hypothesis.column_signs(len(columns))]
        for k in kept:
            if (law := library()[k.hypothesis.cause].LAW) is not None:
                slack += form_columns(view, law, k.hypothesis.axis, k.hypothesis.ports)
        signs += [Sign.ANY] * (len(slack) - len(signs))
        if not slack:
            return 1.0
        own = mine.columns(view, best.fit.fitted[best.contested].shape)
        everything, own_signs = [*slack, *own], mine.column_signs(len(own))
        normal, right = projector.reduce(view.push(everything, single=True), mean_rows(self._cal.table, everything))
        n = len(slack)
        without = solve_signed(normal[:n, :n], right[:n], signs)[1]
        together = solve_signed(normal, right, [*signs, *own_signs])[1]
        alone = solve_signed(normal[n:, n:], right[n:], own_signs)[1]
        return float(np.clip((together - without) / max(alone, 1e-9), 0.0, 1.0))

    def _reference(self, accepted: FullFit | None, temper: float) -> float:
        if accepted is None:
            return -0.5 * (self.base_misfit / temper + self._base_penalty)
        return accepted.log_likelihood(temper)

    def _worthwhile(self, current: Round, accepted: FullFit | None) -> bool:
        """Return whether the best candidate brings enough, in evidence and in share of the residual, and predicts.

        Predicts: with coefficients of the fit blocks alone it leaves less on the select blocks than the model before it, or as
        much where the evidence is that no installation is as far off as the tolerances of that model would have it.
        """
        best = current.candidates[0]
        significance = required_evidence(best.fit, best.contested, self._settings)
        if current.own * (best.log_likelihood - current.reference) < significance:
            return False
        before = self.base_misfit if accepted is None else accepted.misfit
        floor = min(self._fits.dof, best.fit.misfit)
        removed = (before - best.fit.misfit) / max(before - floor, 1e-9)
        # what shows in mean readings and strained tolerances alone leaves no residual to be relevant in
        relieved = 0.5 * ((self._base_penalty if accepted is None else accepted.penalty) - best.fit.penalty)
        fitted = 0.5 * (before - best.fit.misfit) / current.temper
        mean_only = relieved > max(significance, fitted)
        held_out = self._base_held_out if accepted is None else accepted.held_out
        # a tolerance strained far beyond its prior predicts as well as the fault does: what is lost there must only not outweigh
        # that no installation is so far off
        slack = 2.0 * current.temper * (relieved - significance) if mean_only else 0.0
        if np.any(best.fit.rows) and best.fit.held_out >= held_out + slack:
            return False
        # a further cause of a few per cent at the mount of another may be the part of that one that its law describes badly
        share_of_all = (before - best.fit.misfit) / max(self.base_misfit - floor, 1e-9)
        apart = accepted is None or not any(same_place(best.hypothesis, f.hypothesis) for f in accepted.fitted)
        its_own = apart and current.own > _OWN
        # what a badly described law leaves is not explained down to the noise by a cause at another place
        whole = its_own and removed > 1.0 - self._settings.unexplained and share_of_all > _LEAST
        least = _MINOR if its_own else self._settings.relevance
        # beside another cause, strained tolerances are evidence for errors of what is tolerated and for no law
        tolerated = best.hypothesis.moves_cg or bool(tolerance_of(best.hypothesis)[0])
        hidden = best.hypothesis.shows_in_means or tolerated
        relieves = mean_only and (accepted is None or hidden)
        # where errors are held at the limit of what a good installation has, what takes their place is a finding of its own
        relieves |= hidden and its_own and bool(self._cal.held) and relieved > self._settings.significance
        return relieves or whole or (removed > self._settings.relevance and share_of_all > least)

    def _without_idle(self, fit: FullFit) -> FullFit:
        """Return the fit without hypotheses that the others make unnecessary (backward check)."""
        while len(fit.fitted) > 1:
            temper = temper_of(fit.misfit / self._fits.dof, fit.inefficiency)
            # a fit along the trajectory of the full model is a lower bound of what the others reach on their own
            needed = 2.0 * temper * (_CLEARLY * self._settings.significance) + fit.misfit
            drops = [i for i in range(len(fit.fitted)) if fit.misfit_without(i, self._fits.blocks) <= needed]
            rests = [[f for i, f in enumerate(fit.fitted) if i != drop] for drop in drops]
            trials = self._fits.all(rests, 2, fit)
            idle = [
                t.log_likelihood(temper) + required_evidence(fit, drop, self._settings) for drop, t in zip(drops, trials)
            ]
            if not idle or max(idle) < fit.log_likelihood(temper):
                return fit
            fit = trials[int(np.argmax(idle))]
        return fit

