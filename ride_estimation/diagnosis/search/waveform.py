# Copyright 2026 ride_estimation contributors
"""Law forces along the deflection that they themselves bring about, by Newton steps on whole signals.

A hard stop feeds back so strongly that no plain iteration of forces and deflections settles. With the plant linear, the forces e
of the ports satisfy ``e = law(x_0 + G e) - held(x_0 + G e)``; Newton's method with the Jacobian applied by differences inside
GMRES (Saad, Schultz 1986, SIAM J. Sci. Stat. Comput. 7; Knoll, Keyes 2004, J. Comput. Phys. 193) needs no derivative of a law.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, gmres

from ride_estimation.diagnosis.common.effect import Effect, Where
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_view import RunView

Array = NDArray[np.float64]
Laws = Callable[[RunView], tuple[Effect, ...]]

_STEPS = 12  # Newton steps
_KRYLOV = 30  # directions of one step
_SHARES = (1.0, 0.5, 0.25, 0.1, 0.03)  # of a step that are tried
_ENOUGH = 0.01  # rms by which the forces still miss their laws, relative to them


def port_forces(view: RunView, laws: Laws) -> ModelState:
    """Return the state of a view with the port forces that the laws have along their own linear response.

    Parameters
    ----------
    view
        Run and model, where the steps begin; what the state holds of the laws stays held.
    laws
        Effects of the laws along the deflections of a view; those at other places than ports stay as they come out first.

    Returns
    -------
    ModelState
        With the nearest forces that were found.
    """
    first = laws(view)
    ports = sorted(e.index for e in first if e.where is Where.PORT)
    rest = tuple(e for e in first if e.where is not Where.PORT)
    linear = np.zeros((2, len(ports))) if view.state.held is None else view.state.held[:, ports]
    known = {(e.where, e.index): e.signal for e in view.state.effects}
    zero = np.zeros(view.grid.samples)
    start = np.stack([known.get((Where.PORT, p), zero) for p in ports], axis=1)

    def beyond(forces: Array) -> Array:
        """Return what the laws along these forces have beyond what is held."""
        moved = view.with_port_forces(ports, forces - start)
        signal = {e.index: e.signal for e in laws(moved) if e.where is Where.PORT}
        total = np.stack([signal.get(p, zero) for p in ports], axis=1)
        return np.asarray(total - linear[0] * moved.deflection[:, ports] - linear[1] * moved.deflection_rate[:, ports])

    forces = _solved(beyond, start)
    effects = (*rest, *(Effect(Where.PORT, p, forces[:, i]) for i, p in enumerate(ports)))
    return dataclasses.replace(view.state, effects=effects)


def _solved(function: Callable[[Array], Array], start: Array) -> Array:
    """Return a fixed point of a function of signals, or the nearest to one that the steps reach."""
    point, value = start, function(start)
    for _ in range(_STEPS):
        missed = value - point
        size = float(np.linalg.norm(missed))
        if not size > _ENOUGH * float(np.linalg.norm(value)):
            break

        def applied(direction: Array, point: Array = point, value: Array = value) -> Array:
            step = direction.reshape(point.shape)
            little = 1e-4 * max(float(np.std(value)), 1e-300) / max(float(np.std(step)), 1e-300)
            return np.asarray(step - (function(point + little * step) - value) / little).ravel()

        operator = LinearOperator((point.size, point.size), matvec=applied, dtype=float)
        newton = gmres(operator, missed.ravel(), restart=_KRYLOV, maxiter=1, atol=0.0)[0].reshape(point.shape)
        for share in _SHARES:
            trial = point + share * newton
            reached = function(trial)
            if float(np.linalg.norm(reached - trial)) < (1.0 - 0.1 * share) * size:
                point, value = trial, reached
                break
        else:
            break
    return point
