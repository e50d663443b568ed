# Copyright 2026 ride_estimation contributors
"""Calibrates the linear model by simulation error before anything is called a discrepancy."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ride_estimation.diagnosis.calibration.baseline import (
    Adjustable,
    MeanTable,
    baseline_columns,
    mean_table,
    port_columns,
)
from ride_estimation.diagnosis.calibration.regression import Fit, Regression
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.model.bracket_tilts import TILT_KINDS
from ride_estimation.diagnosis.model.plant import Plant, build_plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.noise import temper_of
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.frames import AXES
from ride_estimation.vehicles.vehicle import Body

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

_STEP_LIMITS = (0.4, 2.5)  # smallest and largest factor of one Gauss-Newton step
_EXPLAINED = 1.5  # misfit per degree of freedom up to which CG and inertia are those of the body and not of a missing cause
_LIMIT = 3.0  # standard deviations of a tolerance beyond which an error is a fault
_OF_SENSORS = ("gain", "misalignment", "position", "delay")
BY_CHANCE = 0.01  # chance that a good installation lies beyond a limit: one of its errors, or all of them together
_HELD = 1e-3  # factor on the standard deviation of a coefficient that is held
_DAMPED_STD = 0.02  # standard deviation of a damped step of ln k and ln c
_TRUSTED = 3  # steps at full weight until they have to explain the run
_DAMPED = 3  # largest number of damped steps in which errors of sensors, tilts and bodies are found


@dataclasses.dataclass(frozen=True)
class Calibrated:
    """The best linear model of a run.

    Attributes
    ----------
    view
        The run seen through it.
    regression
        Residual against all adjustables at the solution.
    fit
        Last solution on the fit blocks.
    held
        CG coordinates at the limit of their tolerance, errors of sensors beyond it at none: index of the adjustable ->
        coefficient.
    """

    view: RunView
    table: MeanTable
    adjustables: tuple[Adjustable, ...]
    regression: Regression
    fit: Fit
    blocks: IntArray
    held: Mapping[int, float] = dataclasses.field(default_factory=dict)

    @property
    def penalty(self) -> float:
        """Return the squared deviations from priors and mean readings."""
        misfit = self.regression.misfit(self.regression.grams, self.blocks, self.fit.coefficients)
        return float(self.fit.objective - misfit) / self.regression.temper

    @property
    def strained(self) -> bool:
        """Return whether the tolerances hold more than a good installation has."""
        return strained(self.penalty, self.fit.expected_penalty)

    def log_std(self, kind: str) -> Array:
        """Return the standard deviation of ln k or ln c of every port, shape (P,)."""
        out = np.full(len(self.view.plant.ports), np.inf)
        for i, a in enumerate(self.adjustables):
            if a.kind == kind:
                out[self.view.port_index(a.place, a.axis)] = np.sqrt(max(self.fit.covariance[i, i], 0.0))
        return out


def strained(penalty: float, expected: float) -> bool:
    """Return whether squared deviations from priors and mean readings are more than a good installation has, chi-squared."""
    return bool(penalty > stats.chi2.isf(BY_CHANCE, expected))


def file_parameters(plant: Plant) -> tuple[Array, Array]:
    """Return stiffness and damping of the vehicle file, shape (P,) each."""
    return np.array([p.stiffness for p in plant.ports]), np.array([p.damping for p in plant.ports])


def build_regression(
    view: RunView, prior: tuple[Array, Array]
) -> tuple[MeanTable, tuple[Adjustable, ...], Regression]:
    """Return the regression of a view's residual on all adjustables."""
    table = mean_table(view)
    adjustables, rows, means = baseline_columns(view, table, prior)
    std = np.array([a.prior_std for a in adjustables])
    offset = np.array([a.offset for a in adjustables])
    return table, adjustables, Regression(view.residual, rows, table.residual, means, std, offset)


def _port_regression(view: RunView, prior: tuple[Array, Array]) -> tuple[tuple[Adjustable, ...], Regression]:
    """Return the regression of a view's residual on stiffness and damping alone."""
    adjustables, rows = port_columns(view, prior)
    std = np.array([a.prior_std for a in adjustables])
    offset = np.array([a.offset for a in adjustables])
    return adjustables, Regression(view.residual, rows, np.zeros(0), np.zeros((0, len(adjustables))), std, offset)


def _damped(regression: Regression, adjustables: tuple[Adjustable, ...]) -> Regression:
    """Return the regression with stiffness and damping drawn to where they are instead of to the file."""
    std, offset = regression.prior_std * np.sqrt(regression.temper), regression.prior_offset.copy()
    ports = [i for i, a in enumerate(adjustables) if a.kind in ("stiffness", "damping")]
    std[ports], offset[ports] = _DAMPED_STD, 0.0
    return regression.with_prior(std, offset)


def _idle(
    regression: Regression, adjustables: tuple[Adjustable, ...], blocks: IntArray, fit: Fit, settings: Settings
) -> bool:
    """Return whether stiffness and damping could as well stay where they are: the run would hardly notice."""
    held = _damped(regression, adjustables)
    staying, moving = (
        regression.misfit(regression.grams, blocks, f.coefficients) for f in (held.fit(held.grams, blocks), fit)
    )
    return staying - moving < 2.0 * settings.significance * regression.temper


def step_factor(value: float) -> float:
    """Return the factor that a coefficient of a stiffness or damping column stands for: the force is linear in both."""
    return float(np.clip(1.0 + value, *_STEP_LIMITS))


def stepped(state: ModelState, view: RunView, adjustables: tuple[Adjustable, ...], coefficients: Array) -> ModelState:
    """Return the state after a Gauss-Newton step of stiffness and damping."""
    stiffness, damping = state.stiffness.copy(), state.damping.copy()
    for a, value in zip(adjustables, coefficients):
        if a.kind in ("stiffness", "damping"):
            factor = step_factor(value)
            target = stiffness if a.kind == "stiffness" else damping
            target[view.port_index(a.place, a.axis)] *= factor
    return dataclasses.replace(state, stiffness=stiffness, damping=damping)


def tilted(plant: Plant, adjustables: tuple[Adjustable, ...], coefficients: Array) -> Plant:
    """Return the plant whose brackets follow every tilt by the share that a step found, three standard deviations at most."""
    steps = {(a.kind, a.place, a.axis): (float(v), a) for a, v in zip(adjustables, coefficients) if a.kind in TILT_KINDS}
    share = []
    for now, tilt in zip(plant.tilt_share, plant.tilts):
        step, a = steps[tilt.kind, tilt.place, tilt.axis]
        share.append(np.clip(now + step, now + a.offset - 3.0 * a.prior_std, now + a.offset + 3.0 * a.prior_std))
    return dataclasses.replace(plant, tilt_share=np.array(share))


def put_right(plant: Plant, adjustables: tuple[Adjustable, ...], coefficients: Array) -> Plant:
    """Return the plant whose base readings are free of the errors that a step found, three standard deviations at most.

    Force laws and spring rates are judged along the deflections, and those of two mounts that move together differ mostly by
    such errors: left in the readings they would be taken for a difference of the mounts.
    """
    base = {s.sensor for s in plant.inputs}
    kinds = ("gain", "misalignment")
    step = {(a.kind, a.place, a.axis): (a, v) for a, v in zip(adjustables, coefficients) if a.kind in kinds and a.place in base}
    return dataclasses.replace(plant, reading_errors=_within_limits(plant.reading_errors, step))


def _within_limits(
    errors: Mapping[tuple[str, str, str], float], steps: Mapping[tuple[str, str, str], tuple[Adjustable, float]]
) -> dict[tuple[str, str, str], float]:
    """Return errors after a step, three prior standard deviations at most."""
    out = dict(errors)
    for key, (a, value) in steps.items():
        out[key] = float(np.clip(out.get(key, 0.0) + value, -3.0 * a.prior_std, 3.0 * a.prior_std))
    return out


def rebalanced(plant: Plant, adjustables: tuple[Adjustable, ...], coefficients: Array, settings: Settings) -> Plant:
    """Return the plant whose bodies have the CG and the inertia that a step found, three standard deviations at most."""
    kinds = ("cg", "inertia")
    step = {(a.kind, a.place, a.axis): (a, v) for a, v in zip(adjustables, coefficients) if a.kind in kinds}
    errors = _within_limits(plant.body_errors, step)
    bodies = dict(plant.vehicle.bodies)
    for name in dict.fromkeys(place for _, place, _ in errors):
        change = {(kind, entry): v - plant.body_errors.get((kind, name, entry), 0.0)
                  for (kind, place, entry), v in errors.items() if place == name}
        diagonal = np.sqrt(np.abs(np.diag(bodies[name].inertia)))
        shift = np.array([change.get(("cg", a), 0.0) for a in AXES])
        spread = np.zeros((3, 3))
        for i, a in enumerate(AXES):
            for j, b in enumerate(AXES[i:], start=i):
                spread[i, j] = spread[j, i] = change.get(("inertia", f"i{a}{b}"), 0.0) * diagonal[i] * diagonal[j]
        bodies[name] = dataclasses.replace(bodies[name], cg=bodies[name].cg + shift, inertia=bodies[name].inertia + spread)
    moved = _with_bodies(plant, bodies, settings)
    return plant if moved is None else dataclasses.replace(moved, body_errors=errors)


def with_named_cg(plant: Plant, named: Mapping[tuple[str, str], float], settings: Settings) -> Plant:
    """Return the plant whose CGs lie off the file where causes name it, (body, axis) -> [m], and nowhere else.

    A wrench along the motion about another point is first order in the offset: five centimetres change static loads, inertia
    and levers to second order, too.
    """
    bodies, errors = dict(plant.vehicle.bodies), dict(plant.body_errors)
    for name, axis in {*named, *plant.named_cg}:
        change = named.get((name, axis), 0.0) - plant.named_cg.get((name, axis), 0.0)
        if (name, axis) in named:
            # all of the offset is the cause and nothing of it a tolerance
            change -= errors.pop(("cg", name, axis), 0.0)
        bodies[name] = dataclasses.replace(bodies[name], cg=bodies[name].cg + change * np.eye(3)[AXES.index(axis)])
    moved = _with_bodies(plant, bodies, settings)
    return plant if moved is None else dataclasses.replace(moved, body_errors=errors, named_cg=dict(named))


def _with_bodies(plant: Plant, bodies: Mapping[str, Body], settings: Settings) -> Plant | None:
    """Return a plant with other bodies, all else that calibration found kept; None where its channels or ports change."""
    tolerances = settings.tolerances
    moved = build_plant(
        dataclasses.replace(plant.vehicle, bodies=bodies), plant.columns, tolerances.stiffness, tolerances.damping
    )
    # a moved CG gives levers to channels and mounts that had none: the data are those of the channels that had
    keys = [(s.sensor, s.component) for s in moved.outputs]
    wanted = [(s.sensor, s.component) for s in plant.outputs]
    if moved.ports != plant.ports or not set(wanted) <= set(keys):
        return None
    rows = [keys.index(k) for k in wanted]
    return dataclasses.replace(
        moved, outputs=plant.outputs, out_acceleration=moved.out_acceleration[rows], out_rate=moved.out_rate[rows],
        out_displacement=moved.out_displacement[rows], out_base=moved.out_base[rows], tilt_share=plant.tilt_share,
        reading_errors=plant.reading_errors, body_errors=plant.body_errors, named_cg=plant.named_cg, warnings=plant.warnings
    )


def with_held_faults(calibrated: Calibrated) -> Calibrated:
    """Return the model whose CG and sensors are no further off than a good installation is.

    What lies beyond is a fault and not calibration; what the run says about it is then left in the residual, for causes to
    explain. Only where the model explains the run: else what it misses bends the tolerances.
    """
    if not _explains(calibrated):
        return calibrated
    held = beyond_limits(calibrated.adjustables, calibrated.fit.coefficients, calibrated.fit.covariance)
    if not held:
        return calibrated
    regression, used = calibrated.regression, calibrated.blocks
    dof, temper = float(calibrated.view.block_dof[used].sum()), regression.temper
    prior = hold(regression.prior_std * np.sqrt(temper), regression.prior_offset, held)
    for _ in range(2):
        regression = regression.with_temper(temper).with_prior(*prior)
        fit = regression.fit(regression.grams, used)
        misfit = regression.misfit(regression.grams, used, fit.coefficients) / dof
        temper = temper_of(misfit, calibrated.view.inefficiency)
    return dataclasses.replace(calibrated, regression=regression, fit=fit, held=held)


def beyond_limits(adjustables: Sequence[Adjustable], coefficients: Array, covariance: Array) -> dict[int, float]:
    """Return the errors that no good installation has and the coefficient that each is held at, index -> coefficient.

    Parameters
    ----------
    adjustables, coefficients, covariance
        Of a fit; only the first ``len(adjustables)`` coefficients are used.
    """
    held: dict[int, float] = {}
    for i, (a, limit) in enumerate(zip(adjustables, tolerance_limits(adjustables))):
        off, std = float(coefficients[i]) - a.offset, float(np.sqrt(max(covariance[i, i], 0.0)))
        if abs(off) > limit * (a.prior_std + std):
            # a CG stays at its limit, from which its cause counts; the cause of a sensor states the whole error
            held[i] = a.offset + (0.0 if a.kind in _OF_SENSORS else float(np.copysign(limit * a.prior_std, off)))
    return held


def tolerance_limits(adjustables: Sequence[Adjustable]) -> list[float]:
    """Return the standard deviations beyond which each adjustable is a fault, infinite for what is none.

    Of a hundred errors of good sensors one lies beyond three standard deviations in a fourth of all runs; the limit is where one
    of all does so in a hundredth of them.
    """
    count = sum(a.kind in _OF_SENSORS for a in adjustables)
    of_many = float(stats.norm.isf(0.5 * BY_CHANCE / max(count, 1)))
    return [_LIMIT if a.kind == "cg" else max(of_many, _LIMIT) if a.kind in _OF_SENSORS else np.inf for a in adjustables]


def hold(std: Array, offset: Array, held: Mapping[int, float]) -> tuple[Array, Array]:
    """Return prior standard deviations and offsets with some coefficients held at a value."""
    std, offset = std.copy(), offset.copy()
    for i, value in held.items():
        std[i], offset[i] = _HELD * std[i], value
    return std, offset


def calibrate(data: RunData, blocks: IntArray | None = None, iterations: int = 10) -> Calibrated:
    """Fit stiffness and damping of every port by output error, all tolerances free within their priors.

    Parameters
    ----------
    blocks
        Blocks of the fit; all where None.
    iterations
        Largest number of Gauss-Newton steps.

    Notes
    -----
    How mounts that move together share their force is bilinear with the errors of their base sensors and the tilt of their
    brackets. Steps are damped (Levenberg 1944) until those are found: what the run determines well moves all the same, the
    rest stays near the file and does not run into a minimum of its own.

    In a rough run two centimetres of CG matter to second order. Where much is left, CG and inertia are taken to all orders
    only if every step with them explains half of it: else the cause of it bends them, and no fit of that cause could take
    it back.

    What a model misses weighs less the more it misses (:func:`temper_of`), and with so little weight nothing may move that would
    explain it: weight and misfit agree with each other at more than one place. Where the first that is found leaves much, steps
    at full weight are taken from there; where those end at what noise and a good installation leave, that is the model.
    """
    found = _gauss_newton(data, blocks, iterations)
    if not _explains(found) and (trusted := _at_full_weight(data, found)) is not None:
        return _gauss_newton(data, blocks, iterations, trusted)
    moved = found
    while not _explains(moved):
        further = _gauss_newton(data, blocks, 1, moved)
        if _excess(further) > 0.5 * _excess(moved):
            return found
        moved = further
    return found if moved is found else _gauss_newton(data, blocks, iterations, moved)


def _at_full_weight(data: RunData, start: Calibrated) -> Calibrated | None:
    """Return the model that some steps at full weight lead to, None where it does not explain the run."""
    prior = file_parameters(data.plant)
    for _ in range(_TRUSTED):
        plant, state = _advanced(start, data.settings, _explains(start))
        view = RunView(data.with_plant(plant), state)
        table, adjustables, regression = build_regression(view, prior)
        fit = regression.fit(regression.grams, start.blocks)
        start = Calibrated(view, table, adjustables, regression, fit, start.blocks)
        if _explains(start):
            return None if start.strained else start
    return None


def calibrated_at(view: RunView, blocks: IntArray) -> Calibrated:
    """Return the model of a view whose plant and state another run of the vehicle has calibrated: one linear step."""
    table, adjustables, regression = build_regression(view, file_parameters(view.plant))
    regression, fit = _tempered_fit(regression, view, blocks)
    return with_held_faults(Calibrated(view, table, adjustables, regression, fit, blocks))


def explains(misfit: float) -> bool:
    """Return whether so small a misfit per degree of freedom is left that CG and inertia are those of the body."""
    return misfit < _EXPLAINED


def _explains(calibrated: Calibrated) -> bool:
    return explains(1.0 + _excess(calibrated))


def _excess(calibrated: Calibrated) -> float:
    """Return the misfit per degree of freedom beyond that of a right model."""
    regression, used = calibrated.regression, calibrated.blocks
    misfit = regression.misfit(regression.grams, used, calibrated.fit.coefficients)
    return misfit / float(calibrated.view.block_dof[used].sum()) - 1.0


def moved_plant(
    plant: Plant, adjustables: tuple[Adjustable, ...], coefficients: Array, settings: Settings, bodies: bool
) -> Plant:
    """Return the plant with the errors that a step found, CG and inertia among them where ``bodies``."""
    plant = put_right(tilted(plant, adjustables, coefficients), adjustables, coefficients)
    return rebalanced(plant, adjustables, coefficients, settings) if bodies else plant


def seen_from(plant: Plant, adjustables: Sequence[Adjustable]) -> tuple[Adjustable, ...]:
    """Return adjustables with their offsets from the errors that a plant holds already."""
    errors = {**plant.reading_errors, **plant.body_errors}
    tilts = {(t.kind, t.place, t.axis): t.usual - float(share) for t, share in zip(plant.tilts, plant.tilt_share)}
    out = []
    for a in adjustables:
        key = (a.kind, a.place, a.axis)
        offset = tilts.get(key, a.offset) if a.kind in TILT_KINDS else -errors.get(key, 0.0)
        out.append(a if a.kind in ("stiffness", "damping") else dataclasses.replace(a, offset=offset))
    return tuple(out)


def _advanced(calibrated: Calibrated, settings: Settings, bodies: bool) -> tuple[Plant, ModelState]:
    """Return plant and state after the step that a model asks for, CG and inertia where ``bodies``."""
    adjustables, values = calibrated.adjustables, calibrated.fit.coefficients
    plant = moved_plant(calibrated.view.plant, adjustables, values, settings, bodies)
    return plant, stepped(calibrated.view.state, calibrated.view, adjustables, values)


def _tempered_fit(regression: Regression, view: RunView, used: IntArray) -> tuple[Regression, Fit]:
    """Return the regression with the weight that its own misfit asks for, and its solution."""
    dof = float(view.block_dof[used].sum())
    fit = regression.fit(regression.grams, used)
    for _ in range(2):
        misfit = regression.misfit(regression.grams, used, fit.coefficients) / dof
        regression = regression.with_temper(temper_of(misfit, view.inefficiency))
        fit = regression.fit(regression.grams, used)
    return regression, fit


def _gauss_newton(data: RunData, blocks: IntArray | None, iterations: int, start: Calibrated | None = None) -> Calibrated:
    """Return the model after some steps from the file, or from where the step of ``start`` with CG and inertia leads."""
    plant, settings = data.plant, data.settings
    prior = file_parameters(plant)
    state = ModelState(prior[0].copy(), prior[1].copy())
    if start is not None:
        plant, state = _advanced(start, settings, True)
    found: Calibrated | None = None
    used = np.arange(data.blocks.count) if blocks is None else blocks
    # tolerances join once stiffness and damping are near: they must not soak up a linearisation error
    frozen, damped = (True, _DAMPED) if start is None else (False, 0)
    before = np.inf, 0.0
    for number in range(iterations):
        if number == iterations - 1:
            frozen, damped = False, 0
        found = None  # the rows of two models at once take twice the memory
        found = _linearised(RunView(data.with_plant(plant), state), prior, used, frozen, damped > 0)
        adjustables, fit = found.adjustables, found.fit
        moves = _largest(adjustables, fit.coefficients, ("stiffness", "damping"))
        if frozen:
            frozen, state = moves > 0.1, stepped(state, found.view, adjustables, fit.coefficients)
            continue
        small = moves < 0.02 and _largest(adjustables, fit.coefficients, TILT_KINDS) < 0.1
        if not damped:
            # a step may leave nothing to gain along its own columns, and the next one halve what sensors are strained by
            level = found.regression.misfit(found.regression.grams, used, fit.coefficients), found.penalty
            temper = found.regression.temper
            gained = before[0] - level[0] + temper * (before[1] - level[1])
            settled = gained < 2.0 * settings.significance * temper
            if small or (settled and _idle(found.regression, adjustables, used, fit, settings)):
                break
            before = level
        damped = 0 if small else max(damped - 1, 0)
        plant, state = _advanced(found, settings, _explains(found))
    if found is None:
        raise ValueError("at least one step is needed")
    return found


def _linearised(view: RunView, prior: tuple[Array, Array], used: IntArray, frozen: bool, damped: bool) -> Calibrated:
    """Return one linear step from a view, of stiffness and damping alone where ``frozen``, short ones where ``damped``."""
    if frozen:
        table, (adjustables, regression) = mean_table(view), _port_regression(view, prior)
    else:
        table, adjustables, regression = build_regression(view, prior)
    if damped:
        regression = _damped(regression, adjustables)
    regression, fit = _tempered_fit(regression, view, used)
    return Calibrated(view, table, adjustables, regression, fit, used)


def _largest(adjustables: tuple[Adjustable, ...], coefficients: Array, kinds: Collection[str]) -> float:
    """Return the largest step of the adjustables of some kinds."""
    return max((abs(float(v)) for a, v in zip(adjustables, coefficients) if a.kind in kinds), default=0.0)
