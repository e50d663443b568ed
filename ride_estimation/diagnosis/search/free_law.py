# Copyright 2026 ride_estimation contributors
"""Whether a force law without a name would explain more than the causes that were named.

The right cause in another functional form than the real law leaves little that any law could still explain. A cause that only
mimics the real one leaves more: the real law is a function of the motion of some mount, so a law of general form at that mount
takes over what the mimic misses, on stretches of road that fitted neither. Restoring-force surface and state-dependent
terms of this kind: Kristensen, Madsen, Jorgensen (2004), Automatica 40.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.baseline import MeanTable
from ride_estimation.diagnosis.calibration.regression import Regression
from ride_estimation.diagnosis.common.effect import Column
from ride_estimation.diagnosis.common.parallel import in_order
from ride_estimation.diagnosis.hypotheses.hypothesis import Law, Sign
from ride_estimation.diagnosis.hypotheses.operators import friction_level, relaxed
from ride_estimation.diagnosis.hypotheses.port_groups import PortGroup, force_columns, port_groups
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.screening import Projector, mean_rows, solve_signed

Array = NDArray[np.float64]

_BENDS = (0.5, 1.0, 1.8)  # of a piecewise linear law, over the rms of deflection or rate
_STOPS = (0.5, 1.0, 1.8, 2.6)  # of a law of that kind that may be a stop
_SLIDES = (0.03, 0.3, 1.0)  # reach of hysteresis, over the rms of the deflection
_CELLS_HZ = (0.2, 1.0, 4.0, 16.0)  # corners of relaxation
_FOLDS = 4
_ROUNDING = 0.1  # rate over its rms at which a force turns round with the motion


@dataclasses.dataclass(frozen=True)
class FreeLaw:
    """The law of general form that explains most of what named causes leave.

    Attributes
    ----------
    location, axis
        Mount and axis.
    share
        Energy it explains, on blocks that took no part in its fit too, over the energy that the named causes explain [-].
    left
        Energy above the noise floor that the named causes leave, over the same [-].
    ports
        The mounts as ports.
    alone
        Energy that a law of general form explains instead of named causes that are no force laws, over the energy that these
        explain [-].
    """

    location: str
    axis: str
    share: float
    left: float = 0.0
    ports: tuple[int, ...] = ()
    alone: float = 0.0


#: nothing explains more
NO_LAW = FreeLaw("", "", 0.0)


def free_law(view: RunView, table: MeanTable, problem: Regression, explained: float, left: float) -> FreeLaw:
    """Return the best law of general form on top of a model.

    Parameters
    ----------
    view
        Run seen through the model.
    table
        Mean readings.
    problem
        Residual against the columns of the calibration and of the named causes.
    explained, left
        Energy the named causes explain, in residual and tolerances, and what they leave above the noise floor.
    """
    projector = Projector(problem, np.arange(len(problem.grams)))
    places = port_groups(view)

    def along(axis: str) -> tuple[float, PortGroup | None, Array]:
        """Return what the best law along an axis explains, where it is, and its rows."""
        most, best, law = 0.0, None, np.zeros((0, 0, 0))
        groups = [s for s in places if s.axis == axis]
        ports = sorted({p for s in groups for p in s.ports})
        columns = force_columns(view, PortGroup("", axis, tuple(ports)), lambda *motion: _general(view, *motion))
        count = len(columns) // len(ports)
        rows = view.push(columns, single=True)
        normal, right = projector.reduce(rows, mean_rows(table, columns))
        for group in groups:
            used = [count * ports.index(p) + i for p in group.ports for i in range(count)]
            drop = solve_signed(normal[np.ix_(used, used)], right[used], [Sign.ANY] * len(used))[1]
            drop -= 2.0 * problem.temper * len(used)  # what as many columns of mere chance bring (Akaike 1974)
            if drop > most:
                most, best, law = drop, group, rows[:, :, used]
        return most, best, law

    axes = list(dict.fromkeys(s.axis for s in places))
    found = in_order(along, axes, view.settings.threads)
    most, best, law = max(found, key=lambda f: f[0], default=(0.0, None, np.zeros((0, 0, 0))))
    if best is None or explained <= 0.0:
        return NO_LAW
    # where one block holds most of the energy, folds without it are far off with any law: no more than in its own fit counts
    energy = min(_predicted(view, problem, law, best), most)
    return FreeLaw(best.location, best.axis, energy / explained, max(left, 0.0) / explained, tuple(best.ports))


def _general(view: RunView, x: Array, v: Array, x_rms: float, v_rms: float) -> list[Array]:
    """Return the columns of a law of general form: elastic, dissipative, mixed, with memory, inertial."""
    u, w = x / x_rms, v / v_rms
    bends = [np.maximum(sign * part - bend, 0.0) for part in (u, w) for bend in _BENDS for sign in (1.0, -1.0)]
    memory = [*(friction_level(x, reach * x_rms) for reach in _SLIDES), *_cells(view, u)]
    acceleration = view.grid.filtered(v, np.asarray(1j * view.grid.omega, dtype=np.complex128))
    return [
        *bends, np.tanh(w / _ROUNDING), u * w, u * np.abs(w), np.abs(u) * w, *memory,
        acceleration / max(float(np.std(acceleration)), 1e-12),
    ]


def form_columns(view: RunView, law: Law, axis: str, ports: tuple[int, ...]) -> list[Column]:
    """Return the columns of any law of a kind at some ports: what a named law of that kind may describe badly.

    Parameters
    ----------
    law
        What the force depends on.
    axis, ports
        Where it sits.
    """

    def forms(x: Array, v: Array, x_rms: float, v_rms: float) -> list[Array]:
        u, w = x / x_rms, v / v_rms
        turning = np.tanh(w / _ROUNDING)
        if law is Law.ELASTIC:
            bends = [np.maximum(sign * u - bend, 0.0) for bend in _STOPS for sign in (1.0, -1.0)]
            return [*bends, *(bend * w for bend in bends[-4:]), np.abs(u) * w]
        if law is Law.VISCOUS:
            return [np.maximum(sign * w - bend, 0.0) for bend in _BENDS for sign in (1.0, -1.0)]
        if law is Law.SLIDING:
            return [turning, *(friction_level(x, reach * x_rms) for reach in _SLIDES)]
        return _cells(view, u)

    return force_columns(view, PortGroup("", axis, ports), forms)


def _cells(view: RunView, u: Array) -> list[Array]:
    """Return Maxwell cells of unit stiffness along a deflection."""
    omega = view.grid.omega
    return [view.grid.filtered(u, relaxed(omega, np.ones(len(omega), np.complex128), corner)) for corner in _CELLS_HZ]


def _predicted(view: RunView, problem: Regression, rows: Array, group: PortGroup) -> float:
    """Return the energy that a law explains on blocks that took no part in its fit, four folds of the run."""
    stiffness, damping = view.state.linear
    # columns are of unit size: no unknown law carries more than the spring and the damper of its mount
    size = [float(np.hypot(stiffness[p] * view.scales[p][0], damping[p] * view.scales[p][1])) for p in group.ports]
    grams = problem.candidate_grams(rows.astype(float))
    std = np.repeat(size, rows.shape[2] // len(size))
    fold = np.arange(len(grams)) % _FOLDS
    drop = 0.0
    for number in range(_FOLDS):
        held, fitted = np.flatnonzero(fold == number), np.flatnonzero(fold != number)
        free, plain = problem.fit(grams, fitted, std), problem.fit(problem.grams, fitted)
        drop += problem.misfit(problem.grams, held, plain.coefficients) - problem.misfit(grams, held, free.coefficients)
    return max(drop, 0.0)
