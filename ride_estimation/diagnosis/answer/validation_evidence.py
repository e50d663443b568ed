# Copyright 2026 ride_estimation contributors
"""What validation runs say of rivals that the fitted run leaves alive.

Each rival predicts the validation runs with the numbers that the fitted run gave it; nothing is fitted there. The difference of
the tempered log-likelihoods of two predictions adds to that of the fits, its scatter from block to block to their scatter (Vuong
1989, Econometrica 57). A rival that is ahead on all runs together takes the place of the named cause.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.answer.gain import ValidationRun, enough_in_range, in_range
from ride_estimation.diagnosis.answer.verdict import ALIVE, STRONG, rivals_of
from ride_estimation.diagnosis.runs.noise import temper_of
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.fitting import FullFit
from ride_estimation.diagnosis.search.prediction import predict
from ride_estimation.diagnosis.search.selection import Candidate, Elsewhere, Selection
from ride_estimation.diagnosis.search.work import Work, model_of

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: rivals of one cause that predict the validation runs: each takes a fit and a prediction of every run
_RIVALS = 2
#: passes of a fit that starts from the numbers of another
_PASSES = 2


def weighed(work: Work, runs: Sequence[ValidationRun]) -> Work:
    """Return the work with what validation runs say of rivals that are alive.

    Parameters
    ----------
    work
        Of the run.
    runs
        Validation runs of the same plant.
    """
    accepted = work.selection.accepted
    # what belongs to one run only has no numbers on another
    if not runs or accepted is None or any(f.hypothesis.run_bound for f in accepted.fitted):
        return work
    for place in range(len(accepted.fitted)):
        work = dataclasses.replace(work, selection=_contested(work, accepted, place, runs))
        accepted = work.selection.accepted or accepted
    return work


def _contested(work: Work, accepted: FullFit, place: int, runs: Sequence[ValidationRun]) -> Selection:
    """Return the selection with one contest weighed by validation runs, led by whichever is ahead on all of them."""
    selection, contest = work.selection, work.selection.contests[place]
    leader = contest.candidates[0]
    near = [c for c, odds in rivals_of(contest, work.splits.train) if odds >= ALIVE or c.behind(leader) < STRONG]
    near = [c for c in near if not c.hypothesis.run_bound][:_RIVALS]
    if not near:
        return selection
    before, after = accepted.fitted[:place], accepted.fitted[place + 1 :]
    fits = [work.selector.fitter.fit([*before, c.fit.fitted[c.contested], *after], _PASSES) for c in near]
    said = [_compared(run, [accepted, *fits]) for run in runs]
    asked = [dataclasses.replace(c, elsewhere=_sum([one[i] for one in said if one])) for i, c in enumerate(near)]
    candidates = [next((a for a, n in zip(asked, near) if n is c), c) for c in contest.candidates]
    ahead, fit = min(zip(asked, fits), key=lambda pair: pair[0].behind(leader))
    if ahead.behind(leader) < 0.0:
        accepted, others = fit, [c for c in candidates if c is not ahead]
        candidates = _seen_from(dataclasses.replace(ahead, fit=fit, contested=place), others)
    contests = list(selection.contests)
    contests[place] = dataclasses.replace(contest, candidates=tuple(candidates))
    return dataclasses.replace(selection, accepted=accepted, contests=tuple(contests))


def _seen_from(ahead: Candidate, others: Sequence[Candidate]) -> list[Candidate]:
    """Return a candidate that leads from now on, and the others as validation runs have them against it."""
    own = ahead.elsewhere

    def moved(e: Elsewhere) -> Elsewhere:
        return Elsewhere(e.gap - own.gap, max(e.spread, own.spread), own.effect - own.gap)

    return [
        dataclasses.replace(ahead, elsewhere=Elsewhere()),
        *(dataclasses.replace(c, elsewhere=moved(c.elsewhere)) for c in others),
    ]


def _compared(run: ValidationRun, fits: Sequence[FullFit]) -> list[Elsewhere]:
    """Return what a run says of every fit but the first against it, empty where the first does not predict it.

    Where laws go beyond the strokes and rates that they were fitted on no run has told how they go on: it says nothing there.
    """
    data = run.data
    first = predict(data, model_of(fits[0]))
    if not first.settled:
        return []
    view, best = first.view, _misfit(data.output_spectrum - first.spectrum, first.view)
    del first
    plain = _misfit(run.residual, view)
    out = []
    for fit in fits[1:]:
        other = predict(data, model_of(fit))
        every = blocks = np.arange(view.blocks.count)
        for one, seen in ((fits[0], view), (fit, other.view)):
            blocks = in_range(one, seen, blocks)
        # of two laws that are both extrapolated, the one that goes on better is the likelier one
        blocks = blocks if enough_in_range(blocks, every) else every
        misfit = _misfit(data.output_spectrum - other.spectrum, view)
        per_dof = min(float(m[blocks].sum()) for m in (best, misfit)) / float(view.block_dof[blocks].sum())
        twice = 2.0 * temper_of(per_dof, view.inefficiency)
        gaps = (misfit - best)[blocks] / twice if other.settled else np.zeros(len(blocks))
        effect = float((plain - best)[blocks].sum()) / twice
        out.append(Elsewhere(float(gaps.sum()), float(np.sqrt(len(gaps)) * np.std(gaps, ddof=1)), max(effect, 0.0)))
    return out


def _misfit(residual: ComplexArray, view: RunView) -> Array:
    """Return the sum of squares of every block of a residual spectrum (F, ny), whitened as a view of the run does, shape (B,)."""
    return np.asarray(np.sum(view.rows(residual[:, :, None])[:, :, 0] ** 2, axis=1))


def _sum(parts: Sequence[Elsewhere]) -> Elsewhere:
    """Return what several runs say together."""
    spread = float(np.linalg.norm([e.spread for e in parts]))
    return Elsewhere(sum(e.gap for e in parts), spread, sum(e.effect for e in parts))

