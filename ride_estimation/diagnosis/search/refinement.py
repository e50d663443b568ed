# Copyright 2026 ride_estimation contributors
"""Chosen causes made exact: the mounts at which they sit, the form of their laws, numbers that have settled."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, MutableMapping, Sequence
from typing import TypeVar

import numpy as np

from ride_estimation.diagnosis.hypotheses.characteristic import CORNERS
from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted, Hypothesis
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.candidates import MOSTLY, Identity, identity, within
from ride_estimation.diagnosis.search.fits import Fits
from ride_estimation.diagnosis.search.fitting import FullFit
from ride_estimation.diagnosis.search.screening import Projector, Score, mean_rows, price, solve_signed

#: rounds of further passes of accepted causes, and the share of the misfit that each has to remove
_ROUNDS, _LESS = 3, 0.02

_Contest = TypeVar("_Contest")


class Refinement:
    """Refits accepted causes.

    Parameters
    ----------
    fits
        Full fits of the search.
    build
        Hypotheses of a view.
    """

    def __init__(self, fits: Fits, build: Callable[[RunView], Sequence[Hypothesis]]) -> None:
        self._fits, self._build = fits, build

    def narrowed(self, fit: FullFit) -> FullFit:
        """Return the fit with its last hypothesis at the mounts of a group that carry it where the others hardly matter.

        Small laws at every mount soak up some of what the law of one mount, or of an axle, describes badly. All mounts are named
        only where the others together remove a relevant share of what the hypothesis removes.
        """
        last = fit.fitted[-1]
        if len(last.hypothesis.ports) < 2:
            return fit
        energy = dict(zip(last.hypothesis.ports, fit.port_energies(len(fit.fitted) - 1)))
        carrying = [
            h for h in self._build(fit.view)
            if within(h, last.hypothesis) and sum(energy[p] for p in h.ports) > MOSTLY * sum(energy.values())
        ]
        removed = fit.misfit_without(len(fit.fitted) - 1, self._fits.blocks) - fit.misfit
        for h in sorted(carrying, key=lambda h: (len(h.ports), -sum(energy[p] for p in h.ports))):
            fewer = self._fits.one([*fit.fitted[:-1], Score(h, last.shape, np.zeros(0), 0.0, 0.0)], 2, fit)
            if fewer.misfit - fit.misfit < self._fits.settings.relevance * removed:
                return fewer
        return fit

    def with_corners(self, accepted: FullFit) -> FullFit:
        """Return accepted causes with corners where families leave what a characteristic of any form explains.

        Families tell causes apart by few numbers; none holds a real law to a few per cent of a large effect.
        """
        for place, f in enumerate(accepted.fitted):
            if not f.hypothesis.cornered or CORNERS in f.shape or self._fits.explained(accepted) or self._fits.spent:
                continue
            start: list[Score | Fitted] = [*accepted.fitted]
            start[place] = Score(_of_any_form(f.hypothesis), {**f.shape, CORNERS: 1.0}, np.zeros(0), 0.0, 0.0)
            trial = self._fits.one(start, 3, accepted)
            temper = self._fits.temper([accepted, trial])
            gain = trial.log_likelihood(temper) - accepted.log_likelihood(temper)
            if gain > self._fits.settings.significance and trial.held_out < accepted.held_out:
                accepted = trial
        return accepted

    def widened(self, accepted: FullFit, contests: MutableMapping[Identity, _Contest]) -> FullFit:
        """Return accepted causes at more mounts of their axis where these show the same law when it leaves nothing else.

        Of mounts that move alike fewer of them bring nearly as much, and while a law is described badly small ones at every mount
        soak up some of what it leaves (:meth:`narrowed`). Where a law at more mounts leaves no more than noise, or nearly so,
        neither holds: likelihood decides. One law in place of several at mounts that it covers only must not be worse.
        """
        for own in [identity(f.hypothesis) for f in accepted.fitted]:
            f = next((f for f in accepted.fitted if identity(f.hypothesis) == own), None)
            if f is None or not f.hypothesis.ports or self._fits.spent:
                continue
            groups = [h for h in self._build(accepted.view) if within(f.hypothesis, h)]
            covered = [h for h in groups if any(o is not f and within(o.hypothesis, h) for o in accepted.fitted)]
            # likely mounts are found by score tests: nothing is fitted where none of them shows the law
            wider = covered[0] if covered else self._shown_at(accepted, f, groups)
            if wider is None:
                continue
            others = [o for o in accepted.fitted if o is not f and not within(o.hypothesis, wider)]
            new = Score(_of_any_form(wider) if CORNERS in f.shape else wider, f.shape, np.zeros(0), 0.0, 0.0)
            trial = self._fits.one([*others, new], 3, accepted)
            temper = self._fits.temper([accepted, trial])
            gain = trial.log_likelihood(temper) - accepted.log_likelihood(temper)
            excess = [max(fit.misfit - self._fits.dof, 0.0) for fit in (accepted, trial)]
            clear = self._fits.explained(trial) or excess[1] < self._fits.settings.unexplained * excess[0]
            energy = trial.port_energies(len(others))
            # what the form of the law at one mount leaves the others fit with hardly any force
            clear &= bool(energy.min() > self._fits.settings.relevance * energy.mean())
            better = gain > self._fits.settings.significance and trial.held_out < accepted.held_out
            if clear and (better or (covered and gain > -self._fits.settings.significance)):
                if own in contests:
                    contests[identity(wider)] = contests[own]
                accepted = trial
        return accepted

    def _shown_at(self, accepted: FullFit, f: Fitted, groups: Sequence[Hypothesis]) -> Hypothesis | None:
        """Return the group at whose other mounts an accepted law gains most by a score test, None where it gains too little."""
        view, regression = self._fits.residual_problem(accepted)
        projector = Projector(regression, self._fits.blocks)

        def gain(wider: Hypothesis) -> float:
            columns = wider.columns(view, f.shape)
            per_port = len(columns) // len(wider.ports)
            places = [i for i, p in enumerate(wider.ports) if p not in f.hypothesis.ports]
            further = [c for i in places for c in columns[per_port * i : per_port * (i + 1)]]
            normal, right = projector.reduce(view.push(further, single=True), mean_rows(self._fits.calibrated.table, further))
            drop = solve_signed(normal, right, wider.column_signs(len(further)))[1]
            cost = price(wider, len(further), self._fits.dof, 1) - price(wider, 0, self._fits.dof, 1)
            return 0.5 * drop / regression.temper - cost

        gains = [gain(h) for h in groups]
        if max(gains, default=0.0) < self._fits.settings.significance:
            return None
        return groups[int(np.argmax(gains))]

    def converged(self, accepted: FullFit) -> FullFit:
        """Return accepted causes after more passes where they leave much and every round of passes leaves less.

        Candidates are compared after few passes; along a law of hard corners, stiffness and shape move for longer.
        """
        for _ in range(_ROUNDS):
            if self._fits.explained(accepted) or self._fits.spent:
                break
            again = self._fits.one(accepted.fitted, 4, accepted)
            if not again.misfit < (1.0 - _LESS) * accepted.misfit:
                break
            accepted = again
        return accepted


def _of_any_form(hypothesis: Hypothesis) -> Hypothesis:
    """Return a law of a family with its numbers as they were found: they move no more, their price stays."""
    return dataclasses.replace(
        hypothesis, grid=(), shapes=(), complexity=hypothesis.complexity + len(hypothesis.shapes)
    )
