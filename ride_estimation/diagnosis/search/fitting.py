# Copyright 2026 ride_estimation contributors
"""Full fit of a set of hypotheses by simulation error: model, laws on the deflection it predicts, shapes, calibration."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.baseline import (
    Adjustable,
    balanced_columns,
    faulty_rows,
    mean_table,
    port_columns,
)
from ride_estimation.diagnosis.calibration.linear_model import (
    Calibrated,
    explains,
    file_parameters,
    hold,
    moved_plant,
    rebalanced,
    seen_from,
    step_factor,
    stepped,
    strained,
    with_named_cg,
)
from ride_estimation.diagnosis.calibration.regression import Regression, side_by_side, whole_rows
from ride_estimation.diagnosis.common.effect import Column, Effect, Where, combined_effects
from ride_estimation.diagnosis.common.splits import Splits
from ride_estimation.diagnosis.hypotheses.body_wrench import cg_column
from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted, Hypothesis, Shapes
from ride_estimation.diagnosis.model.bracket_tilts import TILT_KINDS
from ride_estimation.diagnosis.model.plant import Plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.noise import temper_of
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.screening import Projector, Score, mean_rows, price, solve_signed
from ride_estimation.diagnosis.search.shape_search import ShapeTrials, slopes_of

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: causes that are a large value of what every installation has a little of
_TOLERATED = {
    "sensor_gain": "gain", "sensor_misalignment": "misalignment", "wrong_sensor_position": "position",
    "sensor_delay": "delay", "cg_offset": "cg",
}  # fmt: skip
_MOVES = 0.03  # step of ln k or ln c from which a result is a linearisation of the model that it is a step to
_RUNAWAY = 1e6  # energy of the residual over that of the calibrated model from which a trial model means nothing
_MOST_HELD = 0.9  # share of a stiffness or damping that a law of the opposite sign may take away from the linear response


#: hypotheses with numbers and the effects that a model was simulated with
Simulated = tuple[tuple[Fitted, tuple[Effect, ...]], ...]


@dataclasses.dataclass(frozen=True)
class FullFit:
    """A model extended by some hypotheses, fitted on some blocks.

    Attributes
    ----------
    view
        Run seen through the extended model.
    fitted
        One entry per hypothesis.
    regression
        Baseline columns at the extended model with the residual that no effect is taken from.
    rows
        Whitened rows of the effect columns, shape (B, R, q).
    means
        Mean rows of the effect columns, shape (K, q).
    block_misfit
        Sum of squares of every block at the solution, shape (B,).
    misfit
        Sum of squares on the fit blocks.
    held_out
        Sum of squares on the select blocks with the coefficients of the fit blocks alone.
    inefficiency
        Nominal degrees of freedom per independent sample of what the model misses.
    penalty, expected_penalty
        Squared deviations from priors and mean readings, and their mean for a good installation.
    price
        Price of the hypotheses [nat].
    simulated
        What the model of the view was simulated with of hypotheses that say so, and with which numbers.
    """

    view: RunView
    fitted: tuple[Fitted, ...]
    regression: Regression
    adjustables: tuple[Adjustable, ...]
    rows: Array
    means: Array
    coefficients: Array
    covariance: Array
    block_misfit: Array
    misfit: float
    held_out: float
    inefficiency: float
    penalty: float
    expected_penalty: float
    price: float
    simulated: Simulated = ()

    @property
    def strained(self) -> bool:
        """Whether the tolerances hold more than a good installation has: they may make up for a cause that is not named."""
        return strained(self.penalty, self.expected_penalty)

    @property
    def meaningful(self) -> bool:
        """Whether every hypothesis has numbers with which it means something."""
        return all(f.hypothesis.meaningful(f.coefficients, f.shape) for f in self.fitted)

    def log_likelihood(self, temper: float) -> float:
        """Return the penalised log-likelihood of the fit blocks [nat], up to a constant common to all models."""
        return -0.5 * (self.misfit / temper + self.penalty) - self.price

    def slim(self, view: RunView, regression: Regression) -> FullFit:
        """Return what is kept of a fit that lost its round, on a view and a regression that are kept anyhow."""
        return dataclasses.replace(
            self, view=view, regression=regression, rows=self.rows[:, :, :0].copy(), means=self.means[:, :0].copy()
        )

    def part(self, place: int) -> slice:
        """Return which effect columns are those of one hypothesis."""
        counts = [len(f.coefficients) for f in self.fitted]
        return slice(sum(counts[:place]), sum(counts[: place + 1]))

    def misfit_without(self, place: int, blocks: IntArray) -> float:
        """Return the sum of squares on some blocks without one hypothesis, everything else fitted again along the trajectory."""
        part, count = self.part(place), self.regression.count
        used = [
            i for i in range(self.rows.shape[2]) if self.coefficients[count + i] != 0.0 and not part.start <= i < part.stop
        ]
        grams = self.regression.candidate_grams(self.rows[:, :, used])
        fit = self.regression.fit(grams, blocks, None, self.means[:, used])
        return self.regression.misfit(grams, blocks, fit.coefficients)

    def port_energies(self, place: int) -> Array:
        """Return the energy of the response to the law of every port of a hypothesis, shape (ports,)."""
        part, ports = self.part(place), self.fitted[place].hypothesis.ports
        per_port = (part.stop - part.start) // max(len(ports), 1)
        weights = self.coefficients[self.regression.count :]
        return np.array([
            float(np.sum((self.rows[:, :, i : i + per_port] @ weights[i : i + per_port]) ** 2))
            for i in range(part.start, part.stop, per_port)
        ])

    @property
    def in_band(self) -> bool:
        """Return whether some cause must show in the band, and not in mean readings or strained tolerances alone."""
        return any(
            np.any(self.rows[:, :, self.part(i)]) and not f.hypothesis.shows_in_means for i, f in enumerate(self.fitted)
        )

    @property
    def causes(self) -> tuple[str, ...]:
        """Return the cause ids."""
        return tuple(f.hypothesis.cause for f in self.fitted)


def tolerance_of(hypothesis: Hypothesis) -> tuple[str, str, str]:
    """Return kind, place and axis of the tolerance that a hypothesis is a large value of, an empty kind where of none."""
    axis = {"roll": "x", "pitch": "y", "yaw": "z"}.get(hypothesis.axis, hypothesis.axis)
    return _TOLERATED.get(hypothesis.cause, ""), hypothesis.location, axis


def _simulated(view: RunView, fitted: Sequence[Fitted]) -> Simulated:
    """Return what the next model is simulated with of hypotheses whose columns are others."""
    return tuple(
        (f, combined_effects(f.hypothesis.forces(view, f.shape), f.coefficients)) for f in fitted if f.hypothesis.simulated
    )


def _of_regression(view: RunView, simulated: Simulated) -> list[Effect]:
    """Return what the columns of the regression give more than what a model was simulated with, for the same numbers."""
    out: list[Effect] = []
    for f, effects in simulated:
        out += [dataclasses.replace(e, signal=-e.signal) for e in effects]
        out += combined_effects(f.hypothesis.columns(view, f.shape), f.coefficients)
    return out


def _loaded(hypotheses: Iterable[Hypothesis]) -> list[str]:
    """Return the bodies whose CG some hypotheses move."""
    return [*dict.fromkeys(h.location for h in hypotheses if h.moves_cg)]


def _faults(fitted: Iterable[Fitted]) -> dict[str, Array]:
    """Return what faulty sensors read over what they would read without their faults, sensor -> shape (6, 6)."""
    return {f.hypothesis.location: f.hypothesis.fault(f.coefficients) for f in fitted if f.hypothesis.fault is not None}


def held_effects(view: RunView, every: bool = False) -> list[Effect]:
    """Return what the linear response holds of law forces, along the deflection of a view.

    Parameters
    ----------
    every
        Also for ports of which nothing is held.
    """
    held = np.zeros((2, len(view.plant.ports))) if view.state.held is None else view.state.held
    return [
        Effect(Where.PORT, p, k * view.deflection[:, p] + c * view.deflection_rate[:, p])
        for p, (k, c) in enumerate(held.T) if every or k != 0.0 or c != 0.0
    ]


def with_effects(view: RunView, state: ModelState, effects: Sequence[Effect]) -> ModelState:
    """Return a state with effects, the equivalent linear part of those at ports in its linear response.

    Parameters
    ----------
    view
        Run whose deflections the equivalent stiffness and damping are taken along (least squares).
    state
        Stiffness and damping of the ports.
    effects
        One per entry point.
    """
    held = np.zeros((2, len(state.stiffness)))
    out = []
    for e in effects:
        if e.where is Where.PORT:
            pair = np.stack([view.deflection[:, e.index], view.deflection_rate[:, e.index]], axis=1)
            k, c = np.linalg.lstsq(pair, e.signal, rcond=None)[0]
            held[:, e.index] = max(k, -_MOST_HELD * state.stiffness[e.index]), max(c, -_MOST_HELD * state.damping[e.index])
            out.append(dataclasses.replace(e, signal=e.signal - pair @ held[:, e.index]))
        else:
            out.append(e)
    return dataclasses.replace(state, effects=tuple(out), held=held if np.any(held) else None)


def unsettled(fit: FullFit) -> float:
    """Return the largest step of an error of the installation that a plant can hold, in its standard deviations."""
    base = {s.sensor for s in fit.view.plant.inputs}
    return max(
        (
            abs(float(v)) / a.prior_std for a, v in zip(fit.adjustables, fit.coefficients)
            if a.kind in TILT_KINDS or a.kind in ("cg", "inertia") or (a.kind in ("gain", "misalignment") and a.place in base)
        ),
        default=0.0,
    )


def _held_cg(view: RunView) -> list[Effect]:
    """Return what the plant of a view holds of CGs that causes name, as wrenches along its motion."""
    return [
        dataclasses.replace(e, signal=offset * e.signal)
        for (body, axis), offset in view.plant.named_cg.items() for e in cg_column(view, body, axis)
    ]


def _named_cg(fitted: Iterable[Fitted]) -> dict[tuple[str, str], float]:
    """Return the CGs that some causes name, (body, axis) -> offset [m]."""
    return {(f.hypothesis.location, f.hypothesis.axis): float(f.coefficients[0]) for f in fitted if f.hypothesis.places_cg}


def _advanced(view: RunView, result: FullFit, plant: Plant) -> ModelState:
    """Return the state after one pass: a step of stiffness and damping, laws with their coefficients.

    What the limit of a step leaves of it stays a force, so that the trajectory is still the one that was fitted. So does what
    the next plant does not hold.
    """
    count = result.regression.count
    columns = [c for f in result.fitted for c in f.hypothesis.forces(view, f.shape)]
    weights = [w for f in result.fitted for w in f.beyond(plant)]
    for a, value in zip(result.adjustables, result.coefficients):
        left = 1.0 + value - step_factor(value)
        if a.kind in ("stiffness", "damping") and left != 0.0:
            p = view.port_index(a.place, a.axis)
            force = (
                view.state.stiffness[p] * view.deflection[:, p] if a.kind == "stiffness"
                else view.state.damping[p] * view.deflection_rate[:, p]
            )
            columns.append((Effect(Where.PORT, p, force),))
            weights.append(left)
    plain = ModelState(view.state.stiffness, view.state.damping)
    state = stepped(plain, view, result.adjustables, result.coefficients[:count])
    return with_effects(view, state, combined_effects(columns, np.array(weights)))


def inherent_misfit(fit: FullFit, blocks: IntArray, seed: int) -> float:
    """Return the sum of squares that a right model keeps because its laws see noisy deflections.

    Linear propagation of base noise is in the whitening; a law with a steep part (friction, clearance, stop) spreads it
    further. The difference of the law forces along the estimated deflection with and without one more realisation of its
    error measures how much.
    """
    noisy = fit.view.with_deflection_noise(seed)
    total: Array = np.zeros(fit.view.residual.shape)
    for f in fit.fitted:
        if not np.any(f.coefficients):
            continue
        pair = [s.push([combined_effects(f.hypothesis.columns(s, f.shape), f.coefficients)]) for s in (fit.view, noisy)]
        total += whole_rows(pair[1] - pair[0], total.shape[1])[:, :, 0]
    return float(np.sum(total[blocks] ** 2))


class FullFitter:
    """Fits sets of hypotheses against one calibrated model.

    Parameters
    ----------
    calibrated
        Best linear model; its whitening and tolerance columns are kept.
    splits
        Blocks; shapes and coefficients come from those of fit and select together.
    """

    def __init__(self, calibrated: Calibrated, splits: Splits) -> None:
        self._cal, self._splits = calibrated, splits
        self._blocks = blocks = splits.train
        #: effective number of samples of the fit
        self._dof = float(calibrated.view.block_dof[blocks].sum())
        self._prior = file_parameters(calibrated.view.plant)
        self._ports = [i for i, a in enumerate(calibrated.adjustables) if a.kind in ("stiffness", "damping")]

    def _regression(
        self, view: RunView, residual: Array, temper: float, hypotheses: Sequence[Hypothesis], faults: Mapping[str, Array]
    ) -> tuple[tuple[Adjustable, ...], Regression]:
        """Return the regression with port columns of this view and the tolerance columns of the calibrated model.

        A cause that is a large value of a tolerance takes its place: shared between both, the cause would be reported too small.
        So it would be where a load moves a CG that is held at its limit.
        """
        cal = self._cal
        adjustables, rows = port_columns(view, self._prior)
        everything = list(seen_from(view.plant, cal.adjustables))
        for i, a in zip(self._ports, adjustables):
            everything[i] = a
        replaced = {tolerance_of(h) for h in hypotheses}
        index, loaded = self._ports, _loaded(hypotheses)
        if loaded:
            # along another motion than that of the load they would tell the load from the CG that it moves
            bodies, further = balanced_columns(view, loaded)
            places = [i for i, a in enumerate(everything) if a.kind in ("cg", "inertia") and a.place in loaded]
            index, rows = [*index, *places], side_by_side(rows, further)
            for i, a in zip(places, bodies):
                everything[i] = a
        if faults:
            places, further = faulty_rows(view, everything, faults)
            index, rows = [*index, *places], side_by_side(rows, further)
        held = {
            i: v - cal.adjustables[i].offset + everything[i].offset for i, v in cal.held.items()
            if everything[i].kind != "cg" or everything[i].place not in loaded
        }
        held |= {i: a.offset for i, a in enumerate(everything) if (a.kind, a.place, a.axis) in replaced}
        prior = hold(np.array([a.prior_std for a in everything]), np.array([a.offset for a in everything]), held)
        # what the readings of the bases are free of is no part of their means, and no CG that a plant holds of weighed loads
        same = view.plant.reading_errors == cal.view.plant.reading_errors
        same &= not cal.table.weighed or view.plant.body_errors == cal.view.plant.body_errors
        means = None if same else mean_table(view).residual
        return tuple(everything), cal.regression.replaced(index, rows, residual, prior, temper, means)

    def fit(
        self, start: Sequence[Score | Fitted], iterations: int = 4, after: FullFit | None = None, settle: bool = False
    ) -> FullFit:
        """Fit hypotheses together, starting from screening scores or earlier fits.

        Parameters
        ----------
        start
            One per hypothesis.
        iterations
            Passes of simulation, shape search and regression.
        after
            A fit of similar hypotheses whose trajectory is the first estimate; that of the calibrated model where None.
        settle
            Move the plant to the errors of the installation that the model with the hypotheses has. Those of the model without
            them are bent by what the hypotheses explain, and what multiplies a large fault is no small error.
        """
        loaded = _loaded(s.hypothesis for s in start)
        view = self._cal.view if after is None else after.view
        if after is not None and not loaded and _loaded(f.hypothesis for f in after.fitted):
            view = RunView(self._cal.view.data, view.state, self._cal.view.noise)
        shapes = [dict(s.shape) for s in start]
        hypotheses = [s.hypothesis for s in start]
        fresh = [isinstance(s, Score) for s in start]
        temper = self._cal.regression.temper if after is None else temper_of(after.misfit / self._dof, view.inefficiency)
        best: FullFit | None = None
        best_moves = np.inf
        simulated = after.simulated if after is not None and loaded else ()
        faults = _faults(s for s in start if isinstance(s, Fitted))
        for iteration in range(iterations + 1):
            result = self._linearised(view, simulated, temper, hypotheses, shapes, faults, fresh, iteration)
            moves = float(np.max(np.abs(result.coefficients[self._ports]), initial=0.0))
            if settle:
                moves = max(moves, _MOVES * unsettled(result))
            settled = best is not None and iteration > 1 and moves < _MOVES and best.misfit - result.misfit < 2.0 * temper
            # a result whose stiffness and damping still move is a linearisation, not a model
            if best is None or result.misfit < best.misfit or (best_moves > _MOVES and moves < best_moves):
                best, best_moves = result, moves
            elif iteration > 2:
                settled = True
            if settled or iteration == iterations:
                break
            temper = temper_of(result.misfit / self._dof, view.inefficiency)
            faults = _faults(result.fitted) if settle else faults
            simulated = _simulated(view, result.fitted)
            plant, adjustables = view.plant, result.adjustables
            if settle:
                bodies = explains(result.misfit / self._dof)
                plant = moved_plant(plant, adjustables, result.coefficients[: result.regression.count], view.settings, bodies)
            elif loaded:
                own = [i for i, a in enumerate(adjustables) if a.place in loaded]
                plant = rebalanced(plant, tuple(adjustables[i] for i in own), result.coefficients[own], view.settings)
            named = _named_cg(result.fitted)
            if named or plant.named_cg:
                plant = with_named_cg(plant, named, view.settings)
            view = RunView(view.data.with_plant(plant), _advanced(view, result, plant), self._cal.view.noise)
            if not float(np.sum(view.residual**2)) < _RUNAWAY * float(np.sum(self._cal.view.residual**2)):
                break  # the step led where the motion of the model runs away: what was found before it stands
        if best is None:
            raise ValueError("at least one pass is needed")
        return best

    def _linearised(
        self, view: RunView, simulated: Simulated, temper: float, hypotheses: Sequence[Hypothesis],
        shapes: list[dict[str, float]], faults: Mapping[str, Array], fresh: Sequence[bool], iteration: int,
    ) -> FullFit:
        """Return the result of one pass along the motion of a view; shapes are searched from the second pass on, in place.

        Parameters
        ----------
        simulated
            Effects of a load that the motion of the view already has.
        faults
            Large faults of sensors, sensor -> what it reads over what it should.
        fresh
            Hypotheses that come from screening and not from another fit.
        iteration
            Number of the pass.
        """
        residual = view.residual
        given = [*view.state.effects, *held_effects(view), *_held_cg(view), *_of_regression(view, simulated)]
        if given:
            residual = residual + whole_rows(view.push([tuple(given)]), residual.shape[1])[:, :, 0]
        adjustables, regression = self._regression(view, residual, temper, hypotheses, faults)
        projector = Projector(regression, self._blocks)
        if iteration == 1:
            for trials, index in self._trials(view, projector, hypotheses, shapes, fresh):
                shapes[index] = trials.chosen(shapes[index])
        if iteration:
            self._search_shapes(view, projector, hypotheses, shapes, [f and iteration < 3 for f in fresh])
        result = self._solve(view, regression, adjustables, projector, hypotheses, shapes)
        if self._negative(result):
            regression, projector = self._grounded(regression, result)
            if iteration:
                self._search_shapes(view, projector, hypotheses, shapes, [False] * len(shapes))
            result = self._solve(view, regression, adjustables, projector, hypotheses, shapes)
        return dataclasses.replace(result, simulated=simulated)

    def _negative(self, result: FullFit) -> list[int]:
        """Return the stiffnesses and dampings that a result would have below nothing."""
        return [i for i in self._ports if result.coefficients[i] < -1.0]

    def _grounded(self, regression: Regression, result: FullFit) -> tuple[Regression, Projector]:
        """Return the regression whose negative springs and dampers stay at the limit of a step.

        A law beside a spring or a damper of negative sign may fit along a deflection that is given and is no model that could
        move by itself: the law has to do without it.
        """
        limits = {i: step_factor(result.coefficients[i]) - 1.0 for i in self._negative(result)}
        std = regression.prior_std * np.sqrt(regression.temper)
        grounded = regression.with_prior(*hold(std, regression.prior_offset, limits))
        return grounded, Projector(grounded, self._blocks)

    def _solve(
        self, view: RunView, regression: Regression, adjustables: tuple[Adjustable, ...], projector: Projector,
        hypotheses: Sequence[Hypothesis], shapes: Sequence[dict[str, float]],
    ) -> FullFit:
        counts, columns, signs = [], [], []
        for h, shape in zip(hypotheses, shapes):
            own = h.columns(view, shape)
            counts.append(len(own))
            columns += own
            signs += list(h.column_signs(len(own)))
        rows, means = view.push(columns), mean_rows(self._cal.table, columns)
        normal, right = projector.reduce(rows, means)
        coefficients, _ = solve_signed(normal, right, signs)
        used = [i for i, c in enumerate(coefficients) if c != 0.0]
        grams = regression.candidate_grams(rows[:, :, used])
        fit = regression.fit(grams, self._blocks, None, means[:, used])
        p = regression.count
        full = np.zeros(p + len(columns))
        covariance = np.zeros((p + len(columns), p + len(columns)))
        keep = np.array([*range(p), *(p + i for i in used)])
        full[keep] = fit.coefficients
        covariance[np.ix_(keep, keep)] = fit.covariance
        fitted, start, cost = [], p, 0.0
        for h, shape, count in zip(hypotheses, shapes, counts):
            part = slice(start, start + count)
            fitted.append(Fitted(h, full[part], covariance[part, part], dict(shape)))
            cost += price(h, int(np.count_nonzero(full[part])), self._dof, 1)
            start += count
        misfit = regression.block_misfit(grams, fit.coefficients)
        alone = regression.fit(grams, self._splits.fit, None, means[:, used])
        held_out = regression.misfit(grams, self._splits.select, alone.coefficients)
        on_fit = float(misfit[self._blocks].sum())
        penalty = (fit.objective - on_fit) / regression.temper
        return FullFit(
            view, tuple(fitted), regression, adjustables, rows, means, full, covariance, misfit, on_fit, held_out,
            view.inefficiency, penalty, fit.expected_penalty, cost,
        )  # fmt: skip

    def stated(self, fit: FullFit) -> FullFit:
        """Return a fit whose numbers have the standard deviations of all of them together, shape parameters included.

        A reach, a gap or a frequency that the run hardly tells leaves the force beside it as open.
        """
        view, count = fit.view, fit.regression.count
        used = [i for i in range(fit.rows.shape[2]) if fit.coefficients[count + i] != 0.0]
        slopes: list[Column] = []
        sizes: list[float] = []
        spread: list[float] = []
        for f in fit.fitted:
            columns, moves = slopes_of(f.hypothesis, view, f.shape, f.coefficients)
            slopes += columns
            sizes += [*moves]
            spread += [s.spread for s in f.hypothesis.shapes]
        if not slopes:
            return fit
        rows = side_by_side(fit.rows[:, :, used], view.push(slopes))
        means = np.concatenate([fit.means[:, used], mean_rows(self._cal.table, slopes)], axis=1)
        free = np.concatenate([np.full(len(used), np.inf), np.array(spread) / np.abs(sizes)]) / np.sqrt(fit.regression.temper)
        solved = fit.regression.fit(fit.regression.candidate_grams(rows), self._blocks, free, means)
        covariance = np.zeros_like(fit.covariance)
        keep = np.array([*range(count), *(count + i for i in used)])
        covariance[np.ix_(keep, keep)] = solved.covariance[: len(keep), : len(keep)]
        moved = np.sqrt(np.maximum(np.diag(solved.covariance)[len(keep) :], 0.0)) * np.abs(sizes)
        fitted, start = [], count
        for f in fit.fitted:
            part = slice(start, start + len(f.coefficients))
            names = [s.name for s in f.hypothesis.shapes]
            own, moved = dict(zip(names, moved.tolist())), moved[len(names) :]
            fitted.append(dataclasses.replace(f, covariance=covariance[part, part], shape_std=own))
            start = part.stop
        return dataclasses.replace(fit, fitted=tuple(fitted), covariance=covariance)

    def _trials(
        self, view: RunView, projector: Projector, hypotheses: Sequence[Hypothesis], shapes: Sequence[Shapes],
        wanted: Sequence[bool],
    ) -> Iterator[tuple[ShapeTrials, int]]:
        """Yield trials of every wanted hypothesis beside the others as they are by then, and its place."""
        for index, h in enumerate(hypotheses):
            if wanted[index]:
                others = [pair for i, pair in enumerate(zip(hypotheses, shapes)) if i != index]
                yield ShapeTrials(view, self._cal.table, projector, h, others), index

    def _search_shapes(
        self, view: RunView, projector: Projector, hypotheses: Sequence[Hypothesis], shapes: list[dict[str, float]],
        searched: Sequence[bool],
    ) -> None:
        """Improve shape parameters with the linear coefficients eliminated; changes ``shapes``.

        Parameters
        ----------
        searched
            Hypotheses whose shapes are searched one at a time before all of them are stepped together.
        """
        for trials, index in self._trials(view, projector, hypotheses, shapes, [bool(h.shapes) for h in hypotheses]):
            shapes[index] = trials.stepped(trials.searched(shapes[index]) if searched[index] else shapes[index])
