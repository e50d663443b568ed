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

from ride_estimation.diagnosis.fitting import FullFit
from ride_estimation.diagnosis.gain import in_range
from ride_estimation.diagnosis.noise import temper_of
from ride_estimation.diagnosis.prediction import Model, Prediction, predict
from ride_estimation.diagnosis.run_data import RunData
from ride_estimation.diagnosis.run_view import RunView
from ride_estimation.diagnosis.selection import Candidate, Elsewhere, Round, Selection
from ride_estimation.diagnosis.verdict import ALIVE, STRONG, rivals_of
from ride_estimation.diagnosis.work import Work, model_of

Array = NDArray[np.float64]

#: rivals of one cause that predict the validation runs: each takes a fit and a prediction of every run
_RIVALS = 2
#: passes of a fit that starts from the numbers of another
_PASSES = 2


def weighed(work: Work, runs: Sequence[RunData]) -> Work:
    """Return the work with what validation runs say of rivals that are alive.

    Parameters
    ----------
    work
        Of the run.
    runs
        Validation runs of the same plant.
    """
    selection = work.selection
    if not runs or selection.accepted is None:
        return work
    for place in range(len(selection.contests)):
        selection = _contested(dataclasses.replace(work, selection=selection), place, runs)
    return dataclasses.replace(work, selection=selection)


def _contested(work: Work, place: int, runs: Sequence[RunData]) -> Selection:
    """Return the selection with one contest weighed by validation runs, led by whichever is ahead on all of them."""
    selection, accepted = work.selection, work.selection.accepted
    contest = selection.contests[place]
    if accepted is None or accepted.fitted[place].hypothesis.run_bound:
        return selection
    first, rivals = contest.candidates[0], rivals_of(contest, work.splits.train)
    near = [c for c, odds in rivals if odds >= ALIVE or c.behind(first) < STRONG]
    alive = [c for c in near if not any(f.hypothesis.run_bound for f in c.fit.fitted)][:_RIVALS]
    if not alive:
        return selection
    fits = [work.selector.fitter.fit(c.fit.fitted, _PASSES) for c in alive]
    said = [_compared(data, work.baseline, [accepted, *fits]) for data in runs]
    total = [_sum([one[i] for one in said if one]) for i in range(len(alive))]
    known = {id(c): e for c, e in zip(alive, total)}
    candidates = [dataclasses.replace(c, elsewhere=known.get(id(c), c.elsewhere)) for c in contest.candidates]
    leader = candidates[0]
    ahead = min((c for c in candidates if c.elsewhere.spread > 0.0), key=lambda c: c.behind(leader), default=leader)
    if ahead.behind(leader) >= 0.0:
        return _with_contest(selection, place, dataclasses.replace(contest, candidates=tuple(candidates)))
    better = fits[next(i for i, c in enumerate(alive) if c.fit is ahead.fit)]
    return _with_leader(selection, place, contest, candidates, ahead, better)


def _with_contest(selection: Selection, place: int, contest: Round) -> Selection:
    contests = tuple(contest if i == place else c for i, c in enumerate(selection.contests))
    return dataclasses.replace(selection, contests=contests)


def _with_leader(
    selection: Selection, place: int, contest: Round, candidates: Sequence[Candidate], ahead: Candidate, fit: FullFit
) -> Selection:
    """Return the selection with another candidate in the place of one cause; a fit holds it behind the others."""
    def seen(c: Candidate) -> Candidate:
        if c is ahead:
            return dataclasses.replace(c, fit=fit, elsewhere=Elsewhere())
        own = ahead.elsewhere
        moved = Elsewhere(c.elsewhere.gap - own.gap, max(c.elsewhere.spread, own.spread), own.effect - own.gap)
        return dataclasses.replace(c, elsewhere=moved)

    order = [ahead, *(c for c in candidates if c is not ahead)]
    others = [c for i, c in enumerate(selection.contests) if i != place]
    led = dataclasses.replace(contest, candidates=tuple(seen(c) for c in order))
    return dataclasses.replace(selection, accepted=fit, contests=(*others, led))


def _compared(data: RunData, baseline: Model, fits: Sequence[FullFit]) -> list[Elsewhere]:
    """Return what a run says of every fit but the first against it, empty where the first does not predict it.

    Where laws go beyond the strokes and rates that they were fitted on no run has told how they go on: it says nothing there.
    """
    first = predict(data, model_of(fits[0]))
    if not first.settled:
        return []
    view, best = first.view, _misfit(first, first.view)
    del first
    plain = _misfit(predict(data, baseline), view)
    out = []
    for fit in fits[1:]:
        other = predict(data, model_of(fit))
        blocks = np.arange(view.blocks.count)
        for one, seen in ((fits[0], view), (fit, other.view)):
            blocks = in_range(one, seen, blocks)
        misfit = _misfit(other, view)
        per_dof = min(float(m[blocks].sum()) for m in (best, misfit)) / float(view.block_dof[blocks].sum())
        twice = 2.0 * temper_of(per_dof, view.inefficiency)
        gaps = (misfit - best)[blocks] / twice if other.settled else np.zeros(len(blocks))
        effect = float((plain - best)[blocks].sum()) / twice
        out.append(Elsewhere(float(gaps.sum()), float(np.sqrt(len(gaps)) * np.std(gaps, ddof=1)), max(effect, 0.0)))
    return out


def _misfit(prediction: Prediction, view: RunView) -> Array:
    """Return the sum of squares of every block of a prediction, whitened as another view of the run does, shape (B,)."""
    residual = prediction.view.data.output_spectrum - prediction.spectrum
    return np.asarray(np.sum(view.rows(residual[:, :, None])[:, :, 0] ** 2, axis=1))


def _sum(parts: Sequence[Elsewhere]) -> Elsewhere:
    """Return what several runs say together."""
    spread = float(np.linalg.norm([e.spread for e in parts]))
    return Elsewhere(sum(e.gap for e in parts), spread, sum(e.effect for e in parts))

