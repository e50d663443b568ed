# Copyright 2026 ride_estimation contributors
"""Staged identification of the jounce-bumper white box (document 004, parameterisation).

1. static record: static curve, hysteresis height and Dahl slopes, linear but for three slopes;
2. dynamic records: contact points from the envelope of what the static part leaves, then rates, entry and stiffnesses;
3. balance: all parameters on all records, objective the mean of the records' squared NRMSE while loaded.

In every stage the linear parameters are eliminated; stiffnesses and heights stay non-negative.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, lsq_linear

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.jounce_columns import (
    TravelBasis,
    contact_cell,
    friction_state,
    friction_travel,
    make_basis,
)
from ride_estimation.identification.bench.time_domain import PreparedRecord

Array = NDArray[np.float64]

CELLS = 5
#: a record counts as static below this share of the fastest record's speed, and below 20 mm/s
STATIC_SPEED_SHARE = 0.1
STATIC_SPEED = 0.02
#: samples per record in the search; longer records are thinned in the residual, never in the simulation
_RESIDUALS = 3000
#: price, in squared NRMSE, of a third difference of the static curve as large as its largest force
_SMOOTHNESS = 1.0e-7
#: price, in squared NRMSE, of a hysteresis height that departs by its reference from the constructed one
_HEIGHT_PRIOR = 1.0e-4
#: travel between two samples below which a record is thinned [m]
_TRAVEL_PER_SAMPLE = 5.0e-5
#: rate limit as a share of the stability limit of an explicit solver at the record's step
_RATE_SHARE = 1.0


@dataclasses.dataclass(frozen=True)
class Load:
    """One record seen from the bumper: travel and force positive in compression.

    Attributes
    ----------
    name, step_s
        Of the record.
    travel, friction
        Travel and the travel that drives friction [m], shape (N,).
    force
        Measured compression force [N], shape (N,).
    picked
        Samples used in residuals: loaded ones, thinned evenly.
    scale
        Standard deviation of the force while loaded [N].
    fitted, held_out
        Loaded samples that are fitted and that are kept for validation, shape (N,).
    """

    name: str
    step_s: float
    travel: Array
    friction: Array
    force: Array
    picked: NDArray[np.int64]
    scale: float
    fitted: NDArray[np.bool_]
    held_out: NDArray[np.bool_]


@dataclasses.dataclass(frozen=True)
class WhiteBox:
    """Parameters of the white box in SI, compression positive.

    Attributes
    ----------
    basis
        Travel basis of both curves.
    static, height
        Coefficients of static force and hysteresis height [N], shape (B,).
    slopes
        s_min, s_max [N/m], exponent.
    contacts, rates, stiffness
        Maxwell cells: contact points [m], rates [1/s], stiffnesses [N/m], shape (C,).
    smooth
        Half width of the entry [m].
    constructed
        Hysteresis height as constructed from the static loops, to which the fitted one is drawn where the records do not
        tell it (near the reference travel), shape (B,).
    """

    basis: TravelBasis
    static: Array
    height: Array
    slopes: Array
    contacts: Array
    rates: Array
    stiffness: Array
    smooth: float
    constructed: Array

    @property
    def reference_height(self) -> float:
        """Return w at the reference travel [N]."""
        return max(float(self.height[-1]), 0.2 * float(self.height.max()), 1.0)

    def force(self, load: Load) -> Array:
        """Return the compression force [N] over a record, shape (N,)."""
        spline = self.basis(load.travel)
        z = self.state(load)
        total = spline @ self.static + 0.5 * z * np.maximum(spline @ self.height, 0.0)
        for contact, rate, k in zip(self.contacts, self.rates, self.stiffness, strict=True):
            if k > 0.0:
                total = total + k * contact_cell(load.travel, load.step_s, contact, self.smooth, rate)
        total[load.travel <= 0.0] = 0.0
        return np.asarray(total, dtype=float)

    def state(self, load: Load, spline: Array | None = None) -> Array:
        """Return unit friction over a record; ``spline`` is the basis at its friction travel where already known."""
        known = self.basis(load.friction) if spline is None else spline
        return friction_state(load.friction, known @ self.height, self.reference_height, self.slopes)


def compression_side(prepared: Sequence[PreparedRecord]) -> float:
    """Return +1 where displacement and force of the records are positive in compression, -1 where negative.

    Raises
    ------
    InputDataError
        Force on both sides of zero: not a jounce bumper.
    """
    force = np.concatenate([p.force for p in prepared])
    low, high = float(-force.min()), float(force.max())
    if min(low, high) > 0.3 * max(low, high):
        raise InputDataError(
            f"the force runs from {-low:g} to {high:g} N: a jounce bumper only pushes; use another model, or correct the load-cell zero"
        )
    return 1.0 if high > low else -1.0


def as_load(item: PreparedRecord, side: float, *, hold_out: bool = False) -> Load:
    """Return a record as the bumper sees it; ``hold_out`` keeps every fourth load event for validation."""
    travel = side * item.motion.x
    speed = float(np.quantile(np.abs(np.diff(travel)), 0.999)) / item.motion.step_s
    factor = int(np.clip(_TRAVEL_PER_SAMPLE / max(speed * item.motion.step_s, 1e-12), 1, 20))
    if factor > 1:
        # slow records carry no more information at a high rate
        return _as_load(item.decimated(factor), side, hold_out) if factor * 500 < travel.size else _as_load(item, side, hold_out)
    return _as_load(item, side, hold_out)


def _as_load(item: PreparedRecord, side: float, hold_out: bool) -> Load:
    travel = side * item.motion.x
    usable = (travel > 0.0) & item.fitted
    held = np.zeros(travel.size, dtype=bool)
    if hold_out:
        event = np.cumsum(np.diff((travel > 0.0).astype(int), prepend=0) > 0)
        held = usable & (event % 4 == 3)
    fitted = usable & ~held
    loaded = np.flatnonzero(fitted)
    if loaded.size < 50:
        raise InputDataError(f"{item.record.name}: only {loaded.size} samples are loaded (travel above zero)")
    picked = loaded[np.unique(np.linspace(0, loaded.size - 1, min(loaded.size, _RESIDUALS)).astype(int))]
    force = side * item.force
    return Load(
        item.record.name, item.motion.step_s, np.ascontiguousarray(travel), friction_travel(item.motion, side), force, picked,
        float(np.std(force[loaded])), fitted, held,
    )


def loaded_nrmse(load: Load, force: Array, part: NDArray[np.bool_] | None = None) -> float:
    """Return NRMSE over loaded samples with the standard deviation as norm (document 004 eq. (2)); default the fitted ones."""
    use = load.fitted if part is None else part
    return float(np.sqrt(np.mean((force - load.force)[use] ** 2)) / np.std(load.force[use]))


def split_static(loads: Sequence[Load]) -> tuple[list[Load], list[Load]]:
    """Return the static and the dynamic records.

    Raises
    ------
    InputDataError
        No slow record.
    """
    speeds = []
    for load in loads:
        v = np.abs(np.diff(load.travel)) / load.step_s
        moving = v[v > 0.05 * np.quantile(v, 0.99)]
        speeds.append(float(np.quantile(moving, 0.9)))
    fastest = max(speeds)
    static = [load for load, v in zip(loads, speeds, strict=True) if v < STATIC_SPEED and v < STATIC_SPEED_SHARE * fastest]
    dynamic = [load for load in loads if load not in static] if static else list(loads)
    if not static or not dynamic:
        listed = ", ".join(f"{load.name} {1e3 * v:.3g} mm/s" for load, v in zip(loads, speeds, strict=True))
        raise InputDataError(
            f"staged jounce identification needs at least one slow record (below {1e3 * STATIC_SPEED:g} mm/s) and one fast one; "
            f"speeds: {listed}"
        )
    return static, dynamic


def identify_white_box(
    loads: Sequence[Load], *, progress: Callable[[float], None] | None = None
) -> tuple[WhiteBox, dict[str, dict[str, float]]]:
    """Run the three stages; return the white box and the NRMSE per record after each stage."""
    static, dynamic = split_static(loads)
    stages: dict[str, dict[str, float]] = {}
    box = fit_static(static, max(float(load.travel.max()) for load in loads))
    _note(stages, "static", box, loads, progress)
    box = pre_estimate(box, dynamic)
    _note(stages, "pre-estimate", box, loads, progress)
    box = fit_balance(box, static + dynamic, free="cells")
    _note(stages, "dynamic", box, loads, progress)
    box = balance(box, loads)
    _note(stages, "balance", box, loads, progress)
    return box, stages


def _note(
    stages: dict[str, dict[str, float]], name: str, box: WhiteBox, loads: Sequence[Load], progress: Callable[[float], None] | None
) -> None:
    stages[name] = {load.name: loaded_nrmse(load, box.force(load)) for load in loads}
    if progress is not None:
        progress(1.0)


# --- stage 1 ---------------------------------------------------------------------------------------------------------


def hysteresis_branches(load: Load, grid: Array) -> tuple[Array, Array]:
    """Return the mean force of loading and unloading of the largest cycle on a travel grid, shapes (G,)."""
    peak = int(np.argmax(load.travel))
    begin = peak - int(np.argmax(load.travel[peak::-1] <= 0.0)) if np.any(load.travel[: peak + 1] <= 0.0) else 0
    after = load.travel[peak:] <= 0.0
    end = peak + int(np.argmax(after)) if after.any() else load.travel.size - 1
    branches = []
    for part in (slice(begin, peak + 1), slice(peak, end + 1)):
        order = np.argsort(load.travel[part], kind="stable")
        u, f = load.travel[part][order], load.force[part][order]
        edges = np.concatenate([[-np.inf], 0.5 * (grid[1:] + grid[:-1]), [np.inf]])
        index = np.digitize(u, edges) - 1
        count = np.bincount(index, minlength=grid.size)
        mean = np.bincount(index, weights=f, minlength=grid.size) / np.maximum(count, 1)
        known = count > 0
        branches.append(np.interp(grid, grid[known], mean[known]))
    return branches[0], branches[1]


def fit_static(static: Sequence[Load], largest: float) -> WhiteBox:
    """Identify static curve, hysteresis height and Dahl slopes from slow records."""
    basis = make_basis(largest)
    main = max(static, key=lambda load: float(load.travel.max()))
    grid = np.linspace(0.0, float(main.travel.max()), 120)
    loading, unloading = hysteresis_branches(main, grid)
    middle, height = 0.5 * (loading + unloading), np.maximum(loading - unloading, 0.0)
    height = _continued(grid, middle, height)
    spline = basis(grid)
    penalty = 1e-2 * basis.roughness()
    design, zeros = np.vstack([spline, penalty]), np.zeros(penalty.shape[0])
    f = np.linalg.lstsq(design, np.concatenate([middle, zeros]), rcond=None)[0]
    w = np.maximum(np.linalg.lstsq(design, np.concatenate([height, zeros]), rcond=None)[0], 0.0)
    reference = max(float(w[-1]), 1.0)
    slope = 10.0 * reference / float(main.travel.max())
    none = np.zeros(0)
    box = WhiteBox(basis, f, w, np.array([slope, 4.0 * slope, 1.0]), none, none, none, 1e-3, w)
    # first the slopes with the constructed height, then the height may depart from it more and more
    for prior in (1e2, 1e-2, _HEIGHT_PRIOR):
        box = fit_balance(box, static, free="static", prior=prior)
    return box


def _continued(grid: Array, middle: Array, height: Array) -> Array:
    """Continue the height beyond its inflection by the scaled and shifted static curve, C1 (document 004)."""
    smooth = np.convolve(np.pad(height, 4, mode="edge"), np.ones(9) / 9, mode="valid")
    slope = np.gradient(smooth, grid)
    inflection = int(np.argmax(slope[5:-5])) + 5
    if inflection >= grid.size - 6:
        return smooth
    ratio = slope[inflection] / max(np.gradient(middle, grid)[inflection], 1e-9)
    continued = smooth.copy()
    continued[inflection:] = smooth[inflection] + ratio * (middle[inflection:] - middle[inflection])
    return np.maximum(continued, smooth)


# --- stage 2 ---------------------------------------------------------------------------------------------------------


def pre_estimate(box: WhiteBox, dynamic: Sequence[Load]) -> WhiteBox:
    """Place the contact points where the envelope of the dynamic stiffening bends (document 004, pre-identification)."""
    largest = float(box.basis.knots[-1])
    edges = np.linspace(0.0, largest, 41)
    centres = 0.5 * (edges[1:] + edges[:-1])
    envelope = np.zeros(centres.size)
    for load in dynamic:
        left = load.force - box.force(load)
        index = np.clip(np.digitize(load.travel, edges) - 1, 0, centres.size - 1)
        loaded = load.travel > 0.0
        for i in range(centres.size):
            values = left[loaded & (index == i)]
            if values.size > 20:
                envelope[i] = max(envelope[i], float(np.quantile(values, 0.99)))
    envelope = np.maximum.accumulate(envelope)
    shares = np.array([0.02, 0.25, 0.5, 0.7, 0.85])
    starts = [largest * shares, largest * np.linspace(0.02, 0.8, CELLS), largest * np.linspace(0.02, 0.95, CELLS) ** 1.0]
    best_points, best_cost = starts[0], np.inf

    def residual(points: Array) -> Array:
        hinges = np.maximum(centres[:, None] - np.sort(points)[None, :], 0.0)
        k = lsq_linear(hinges, envelope, bounds=(0.0, np.inf)).x
        return np.asarray(hinges @ k - envelope)

    for start in starts:
        found = least_squares(residual, start, bounds=(-1e-9, 0.97 * largest), x_scale=largest, diff_step=1e-3, max_nfev=40)
        if found.cost < best_cost:
            best_points, best_cost = np.sort(found.x), float(found.cost)
    spread = np.maximum(best_points, 0.0)
    hinges = np.maximum(centres[:, None] - spread[None, :], 0.0)
    k = lsq_linear(hinges, envelope, bounds=(0.0, np.inf)).x
    fastest = min(load.step_s for load in dynamic)
    # above the static excitation, below the fastest dynamic one
    rate = min(2.0 * np.pi * 5.0, 0.2 * _RATE_SHARE * 2.0 / fastest)
    return dataclasses.replace(
        box, contacts=spread, rates=np.full(CELLS, rate) * np.geomspace(0.7, 1.4, CELLS), stiffness=k, smooth=0.02 * largest
    )


# --- stages 1 to 3: one search with the linear parameters eliminated ----------------------------------------------------


@dataclasses.dataclass(frozen=True)
class _Pack:
    """Which nonlinear parameters are free and how they are scaled into one vector."""

    box: WhiteBox
    slopes: bool
    cells: bool
    contacts: bool
    rate_limit: float

    def start(self) -> tuple[Array, Array, Array]:
        """Return start, lower and upper bounds."""
        x: list[float] = []
        low: list[float] = []
        high: list[float] = []
        largest = float(self.box.basis.knots[-1])
        if self.slopes:
            scale = self.box.reference_height / largest
            x += [*np.log(self.box.slopes[:2]), self.box.slopes[2]]
            low += [np.log(0.5 * scale), np.log(0.5 * scale), 0.05]
            high += [np.log(5e3 * scale), np.log(5e3 * scale), 4.0]
        if self.cells:
            n = self.box.rates.size
            x += [*np.log(self.box.rates), np.log(self.box.smooth)]
            low += [np.log(0.5)] * n + [np.log(1e-3 * largest)]
            high += [np.log(self.rate_limit)] * n + [np.log(0.15 * largest)]
        if self.contacts:
            x += list(self.box.contacts / largest)
            low += [0.0] * self.box.contacts.size
            high += [0.97] * self.box.contacts.size
        lower, upper = np.array(low), np.array(high)
        return np.clip(np.array(x), lower + 1e-6, upper - 1e-6), lower, upper

    def box_at(self, x: Array) -> WhiteBox:
        """Return the white box with the nonlinear parameters of a vector."""
        at, box = 0, self.box
        if self.slopes:
            box = dataclasses.replace(box, slopes=np.array([np.exp(x[0]), np.exp(x[1]), x[2]]))
            at = 3
        if self.cells:
            n = box.rates.size
            box = dataclasses.replace(box, rates=np.exp(x[at : at + n]), smooth=float(np.exp(x[at + n])))
            at += n + 1
        if self.contacts:
            box = dataclasses.replace(box, contacts=x[at:] * float(box.basis.knots[-1]))
        return box


class _Linear:
    """The linear problem of one set of loads: Gram matrix and bounded solution."""

    def __init__(self, loads: Sequence[Load], basis: TravelBasis, curves: bool, cells: bool, prior: float) -> None:
        self._loads, self._curves, self._cells, self._prior = loads, curves, cells, prior
        self._splines = [basis(load.travel[load.picked]) for load in loads]
        self._friction_splines = [basis(load.friction) for load in loads]
        self._basis = basis

    def solve(self, box: WhiteBox) -> tuple[WhiteBox, Array]:
        """Return the box with its linear parameters at the optimum and the weighted residual."""
        rows, targets = [], []
        for load, spline, inner in zip(self._loads, self._splines, self._friction_splines, strict=True):
            z = box.state(load, inner)[load.picked]
            weight = 1.0 / (load.scale * np.sqrt(load.picked.size))
            columns: list[Array] = []
            known = np.zeros(load.picked.size)
            if self._curves:
                columns += [spline, 0.5 * z[:, None] * spline]
            else:
                known += spline @ box.static + 0.5 * z * np.maximum(spline @ box.height, 0.0)
            if self._cells:
                pairs = zip(box.contacts, box.rates, strict=True)
                columns += [contact_cell(load.travel, load.step_s, c, box.smooth, r)[load.picked, None] for c, r in pairs]
            else:
                for c, r, k in zip(box.contacts, box.rates, box.stiffness, strict=True):
                    known += k * contact_cell(load.travel, load.step_s, c, box.smooth, r)[load.picked]
            rows.append(weight * np.hstack(columns))
            targets.append(weight * (load.force[load.picked] - known))
        return self._bounded(box, np.vstack(rows), np.concatenate(targets))

    def _bounded(self, box: WhiteBox, design: Array, target: Array) -> tuple[WhiteBox, Array]:
        size = self._basis.size
        scale = np.maximum(np.sqrt(np.sum(design**2, axis=0)), 1e-12)
        gram, right = design.T @ design, design.T @ target
        if self._curves:
            rough = np.diff(np.eye(size), n=3, axis=0)
            largest = max(float(load.force.max()) for load in self._loads)
            gram[:size, :size] += _SMOOTHNESS / largest**2 * rough.T @ rough
            prior = self._prior / max(float(box.constructed.max()), 1.0) ** 2 * (np.eye(size) + 10.0 * rough.T @ rough)
            gram[size : 2 * size, size : 2 * size] += prior
            right[size : 2 * size] += prior @ box.constructed
        gram = gram / np.outer(scale, scale) + 1e-10 * np.eye(scale.size)
        right = right / scale
        free = np.ones(scale.size, dtype=bool)
        signed = np.zeros(scale.size, dtype=bool)
        if self._curves:
            signed[:size] = True
        for _ in range(scale.size):
            solution = np.zeros(scale.size)
            index = np.flatnonzero(free)
            solution[index] = np.linalg.solve(gram[np.ix_(index, index)], right[index])
            wrong = free & ~signed & (solution < 0.0)
            if not wrong.any():
                break
            free &= ~wrong
        solution = solution / scale
        at = 0
        if self._curves:
            box = dataclasses.replace(box, static=solution[:size], height=solution[size : 2 * size])
            at = 2 * size
        if self._cells:
            box = dataclasses.replace(box, stiffness=solution[at:])
        return box, design @ solution - target


def mean_nrmse(box: WhiteBox, loads: Sequence[Load]) -> float:
    """Return the mean NRMSE over records while loaded, the objective of document 004."""
    return float(np.mean([loaded_nrmse(load, box.force(load)) for load in loads]))


def balance(box: WhiteBox, loads: Sequence[Load], rounds: int = 4) -> WhiteBox:
    """Fit all parameters to all records in short rounds; a round that does not lower the mean NRMSE is undone.

    Between rounds the height that steers the friction slope is replaced by the fitted one.
    """
    best, score = box, mean_nrmse(box, loads)
    for free, prior in (("static", _HEIGHT_PRIOR), *([("all", _HEIGHT_PRIOR)] * rounds)):
        trial = fit_balance(best, loads, free=free, prior=prior, evaluations=5)
        trial_score = mean_nrmse(trial, loads)
        if trial_score < score:
            gained = 1.0 - trial_score / score
            best, score = trial, trial_score
            if gained < 0.01 and free == "all":
                break
    return best


def fit_balance(
    box: WhiteBox, loads: Sequence[Load], *, free: str, prior: float = _HEIGHT_PRIOR, evaluations: int = 12
) -> WhiteBox:
    """Fit part of the parameters; the height that steers the Dahl slope is taken from the step before and iterated.

    Parameters
    ----------
    box
        Start.
    loads
        Records; each weighs the same (mean of squared NRMSE).
    free
        ``static`` (curves and slopes), ``cells`` (rates, entry, stiffnesses; contact points held) or ``all``.
    prior
        Price of a height that departs from the constructed one.
    evaluations
        Limit of steps.
    """
    limit = _RATE_SHARE * 2.0 / max(load.step_s for load in loads)
    limit = max(limit, 20.0)
    has_cells = box.rates.size > 0
    pack = _Pack(box, free != "cells", free != "static" and has_cells, free == "all", limit)
    linear = _Linear(loads, box.basis, free != "cells", free != "static" and has_cells, prior)
    start, lower, upper = pack.start()

    def residual(x: Array) -> Array:
        return linear.solve(pack.box_at(x))[1]

    found = least_squares(
        residual, start, bounds=(lower, upper), diff_step=1e-4, max_nfev=evaluations, ftol=1e-5, xtol=1e-5,
    )
    result, _ = linear.solve(pack.box_at(found.x))
    for _ in range(2):
        # the height steers the slope of the friction it weighs: repeat until both are the same curve
        result, _ = linear.solve(result)
    return result
