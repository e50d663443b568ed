# Copyright 2026 ride_estimation contributors
"""Time-domain identification of the overlay models by variable projection (document 003 eq. (25), (26))."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.identification.bench import columns as columns_module
from ride_estimation.identification.bench.columns import Layout, numpy_columns, simulate
from ride_estimation.identification.bench.models import BenchModel
from ride_estimation.identification.bench.record import BenchRecord, clipped_samples
from ride_estimation.identification.bench.reversals import Motion, block_means, find_motion
from ride_estimation.identification.bench.variable_projection import (
    COST_TOLERANCE,
    VariableProjectionResult,
    eliminate_offset,
    minimise,
)

Array = NDArray[np.float64]
GramFunction = Callable[..., Array]

#: friction displacement is searched between these shares of the displacement range
LENGTH_BOUNDS = (1.0e-4, 5.0)
#: fewest samples of the decimated search, and the relative fall of its cost below which the full record goes on
_DECIMATED_SAMPLES, _DECIMATED_TOLERANCE = 4000, 1.0e-6
#: levels of a search, and samples of one that make a mean of the next
_LEVELS, _LEVEL_FACTOR = 3, 3
#: motion below this share of the whole stroke at the start of a record is rest
REST_SHARE = 2.0e-3
#: number of stretches a single record gives to validation
HELD_OUT_STRETCHES = 8
#: how often a start that ended at a negative stiffness is moved
_REPAIRS = 4


@dataclasses.dataclass(frozen=True)
class PreparedRecord:
    """A record with its branches, ready for passes.

    Attributes
    ----------
    record
        The checked record.
    motion
        Displacement with branches.
    force
        Measured force [N], contiguous.
    weight
        1 for samples that are fitted, 0 for clipped and held-out ones; None where all count.
    held_out
        Samples kept for validation, shape (N,); None where there are none.
    """

    record: BenchRecord
    motion: Motion
    force: Array
    weight: Array | None = None
    held_out: NDArray[np.bool_] | None = None

    @property
    def fitted(self) -> NDArray[np.bool_]:
        """Return which samples are fitted, shape (N,)."""
        return np.ones(self.force.size, dtype=bool) if self.weight is None else self.weight > 0.0

    def thinned(self, factor: int) -> PreparedRecord:
        """Return every ``factor``-th sample: slower, with the noise of the record, so that scores mean the same."""
        weight = None if self.weight is None else np.ascontiguousarray(self.weight[::factor])
        force = np.ascontiguousarray(self.force[::factor])
        held = None if self.held_out is None else self.held_out[::factor]
        return dataclasses.replace(self, motion=self.motion.thinned(factor), force=force, weight=weight, held_out=held)

    def decimated(self, factor: int) -> PreparedRecord:
        """Return means of ``factor`` samples at a time; one that holds a left-out sample is left out."""
        force = block_means(self.force, factor)
        weight, held = self.weight, self.held_out
        if weight is not None:
            weight = weight[: force.size * factor].reshape(-1, factor).min(axis=1)
        if held is not None:
            held = held[: force.size * factor].reshape(-1, factor).max(axis=1)
        return dataclasses.replace(self, motion=self.motion.decimated(factor), force=force, weight=weight, held_out=held)


@dataclasses.dataclass(frozen=True)
class TimeDomainFit:
    """Identified parameters of one model.

    Attributes
    ----------
    model
        The rung.
    values
        Reported parameters in SI, order of ``model.quantities``.
    theta, coefficients
        The searched form.
    result
        Outcome of the search (passes, bounds hit, Gram matrix).
    samples
        Number of fitted samples.
    """

    model: BenchModel
    values: Array
    theta: Array
    coefficients: Array
    result: VariableProjectionResult
    samples: int

    @property
    def residual_std(self) -> float:
        """Return the standard deviation of the residual [N]."""
        return float(np.sqrt(self.result.cost / max(self.samples - self.model.parameter_count - 1, 1)))

    def force(self, motion: Motion) -> Array:
        """Return the model force [N] over a motion, without offset."""
        return simulate(self.model.layout, motion, self.theta, self.coefficients)


def initial_rest(motion: Motion) -> int:
    """Return how many samples the record rests before it first moves; 0 where that is no more than 1 % of it.

    Friction stores a force from before the record that nothing tells, so rest is neither fitted nor scored.
    """
    threshold = max(motion.dead_band, REST_SHARE * motion.stroke)
    away = np.abs(motion.x[: motion.x.size // 100 + 1] - motion.x[0])
    if away.max() > threshold:
        return 0
    moved = np.abs(motion.x - motion.x[0]) > threshold
    return int(np.argmax(moved)) if moved.any() else 0


def held_out_stretches(samples: int, share: float) -> NDArray[np.bool_]:
    """Return which samples are held out: ``HELD_OUT_STRETCHES`` stretches spread evenly over the record, shape (N,)."""
    phase = np.arange(samples) * HELD_OUT_STRETCHES / samples % 1.0
    return phase >= 1.0 - share


def prepare(record: BenchRecord, *, held_out_share: float = 0.0, raw_reversals: bool = False) -> PreparedRecord:
    """Find branches and clipped samples of a record.

    Parameters
    ----------
    record
        A checked record.
    held_out_share
        Share of the record that is kept for validation.
    raw_reversals
        Use every sign change of the raw displacement (for comparison).
    """
    motion = find_motion(record.displacement, record.step_s, raw=raw_reversals)
    clipped = clipped_samples(record)
    held = held_out_stretches(record.samples, held_out_share) & ~clipped if held_out_share > 0.0 else None
    rest = initial_rest(motion)
    excluded = clipped.copy() if held is None else clipped | held
    excluded[:rest] = True
    if held is not None:
        held[:rest] = False
    weight = np.where(excluded, 0.0, 1.0) if excluded.any() else None
    return PreparedRecord(record, motion, np.ascontiguousarray(record.force, dtype=float), weight, held)


def total_gram(layout: Layout, prepared: Sequence[PreparedRecord], theta: Array, gram: GramFunction | None = None) -> Array:
    """Return the Gram matrix summed over records, each with its own force offset projected out."""
    function = columns_module.best_gram if gram is None else gram
    total: Array | None = None
    for item in prepared:
        one = eliminate_offset(function(layout, item.motion, theta, item.force, item.force.size, item.weight))
        total = one if total is None else total + one
    if total is None:
        raise ValueError("at least one record is needed")
    return total


def search_bounds(layout: Layout, prepared: Sequence[PreparedRecord]) -> tuple[Array, Array]:
    """Return bounds of the logarithms: rates the records can show, friction lengths within their strokes."""
    duration = max(p.force.size * p.motion.step_s for p in prepared)
    step = min(p.motion.step_s for p in prepared)
    stroke = max(p.motion.stroke for p in prepared)
    lower = [np.log(1.0 / duration)] * layout.cells
    upper = [np.log(2.0 / step)] * layout.cells
    if layout.friction:
        lower.append(np.log(LENGTH_BOUNDS[0] * stroke))
        upper.append(np.log(LENGTH_BOUNDS[1] * stroke))
    return np.asarray(lower), np.asarray(upper)


def start_points(layout: Layout, lower: Array, upper: Array, count: int) -> list[Array]:
    """Return spread start values: rates in ascending order over the middle of their range, lengths in turn."""
    if layout.nonlinear == 0:
        return [np.empty(0)]
    starts = []
    for n in range(count):
        shift = (n + 0.5) / count
        theta = np.empty(layout.nonlinear)
        for i in range(layout.cells):
            share = 0.25 + 0.6 * (i + shift) / layout.cells
            theta[i] = lower[i] + share * (upper[i] - lower[i])
        if layout.friction:
            theta[-1] = lower[-1] + (0.25 + 0.5 * ((n * 0.618) % 1.0)) * (upper[-1] - lower[-1])
        starts.append(theta)
    return starts


def fit_time_domain(
    model: BenchModel,
    prepared: Sequence[PreparedRecord],
    *,
    start: Array | None = None,
    starts: int = 6,
    gram: GramFunction | None = None,
    decimate: bool = True,
) -> TimeDomainFit:
    """Identify one model from one or several records.

    Parameters
    ----------
    model
        The rung of the ladder.
    prepared
        Records with branches.
    start
        Logarithms to start from; None: several spread starts.
    starts
        Number of spread starts of the decimated search.
    gram
        Pass to use; None: the compiled one where numba is installed.
    decimate
        Search on a decimated record first.

    Returns
    -------
    TimeDomainFit
        Cells in ascending order of their rates.
    """
    lower, upper = search_bounds(model.layout, prepared)
    points = start_points(model.layout, lower, upper, starts) if start is None else [np.asarray(start, dtype=float)]
    levels = decimated_levels(prepared) if decimate else [list(prepared)]
    passes, prediction_error = 0, 1.0
    # nested iteration: every level starts where the one before arrived, so the whole record is left one step or two
    for level in levels[::-1]:
        tolerance = COST_TOLERANCE if level is levels[0] else _DECIMATED_TOLERANCE
        found = [_search_physical(model, level, point, lower, upper, gram, tolerance, prediction_error) for point in points]
        best = min(found, key=lambda one: one.cost)
        passes += sum(one.passes for one in found)
        points, prediction_error = [best.theta], best.prediction_error
    theta, coefficients = _ascending(model, best)
    ordered = dataclasses.replace(
        best,
        theta=theta,
        coefficients=coefficients,
        gram=total_gram(model.layout, prepared, theta, gram) if not np.array_equal(theta, best.theta) else best.gram,
        passes=passes,
    )
    samples = sum(int(np.count_nonzero(p.fitted)) for p in prepared)
    return TimeDomainFit(model, model.physical(theta, coefficients), theta, coefficients, ordered, samples)


def decimated_levels(prepared: Sequence[PreparedRecord]) -> list[list[PreparedRecord]]:
    """Return the records, their means of three samples and of nine, as long as these have a few thousand samples."""
    levels = [list(prepared)]
    while len(levels) < _LEVELS and min(p.force.size for p in levels[-1]) >= _LEVEL_FACTOR * _DECIMATED_SAMPLES:
        levels.append([p.decimated(_LEVEL_FACTOR) for p in levels[-1]])
    return levels


def _search_physical(
    model: BenchModel,
    prepared: Sequence[PreparedRecord],
    start: Array,
    lower: Array,
    upper: Array,
    gram: GramFunction | None,
    tolerance: float,
    prediction_error: float,
) -> VariableProjectionResult:
    """Search without sign bounds first; move cells that end negative; hold what stays negative at zero."""
    free = np.zeros(model.layout.linear, dtype=bool)

    def evaluate(theta: Array) -> Array:
        return total_gram(model.layout, prepared, theta, gram)

    def run(theta: Array, positive: NDArray[np.bool_]) -> VariableProjectionResult:
        linear = model.layout.linear
        return minimise(
            evaluate, theta, lower, upper, linear, model.sensitivities, positive,
            cost_tolerance=tolerance, prediction_error=prediction_error,
        )  # fmt: skip

    found = run(start, free)
    repairs = 0
    while repairs < _REPAIRS and np.any(found.coefficients[model.with_memory] < 0.0):
        found = run(_moved(model, found, lower, upper, repairs), free)
        repairs += 1
    if np.any(found.coefficients[model.positive] < 0.0):
        found = run(found.theta, model.positive)
    return found


def _moved(model: BenchModel, found: VariableProjectionResult, lower: Array, upper: Array, turn: int) -> Array:
    """Return a start in which the cells with negative stiffness sit in the widest gap between the good rates."""
    theta = found.theta.copy()
    cells = model.layout.cells
    negative = [i for i in range(cells) if found.coefficients[model.layout.static + i] < 0.0]
    good = [theta[i] for i in range(cells) if i not in negative]
    for i in negative:
        edges = np.sort(np.concatenate([[lower[i], upper[i]], good]))
        widths = np.diff(edges)
        order = np.argsort(-widths)
        gap = order[turn % order.size]
        theta[i] = edges[gap] + 0.5 * widths[gap]
        good.append(theta[i])
    if model.layout.friction and found.coefficients[-1] < 0.0:
        theta[-1] = lower[-1] + (0.2 + 0.2 * turn) * (upper[-1] - lower[-1])
    return theta


def _ascending(model: BenchModel, found: VariableProjectionResult) -> tuple[Array, Array]:
    cells, static = model.layout.cells, model.layout.static
    order = np.argsort(found.theta[:cells])
    theta, coefficients = found.theta.copy(), found.coefficients.copy()
    theta[:cells] = found.theta[:cells][order]
    coefficients[static : static + cells] = found.coefficients[static : static + cells][order]
    return theta, coefficients


def full_jacobian(fit: TimeDomainFit, motion: Motion) -> Array:
    """Return dF/d(coefficients, theta) of a fit over a motion, shape (P + Q, N)."""
    return model_jacobian(fit.model, fit.theta, fit.coefficients, motion)


def model_jacobian(model: BenchModel, theta: Array, coefficients: Array, motion: Motion) -> Array:
    """Return dF/d(coefficients, theta) over a motion, shape (P + Q, N)."""
    layout = model.layout
    jacobian = numpy_columns(layout, motion, theta)
    jacobian[layout.linear :] *= coefficients[model.sensitivities][:, None]
    return jacobian
