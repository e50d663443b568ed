# Copyright 2026 ride_estimation contributors
"""Pseudo-wrenches on a body along the motion of a view."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.calibration.baseline import body_spectra, cg_shift_wrench
from ride_estimation.diagnosis.common.effect import Column, Effect, Where
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.frames import AXES

Array = NDArray[np.float64]


def six_of(view: RunView, body: str) -> tuple[Array, Array]:
    """Return displacement and acceleration of the six coordinates of a body, shared ones included, (N, 6) each."""
    q, a = body_spectra(view, body)
    return view.grid.signal(q), view.grid.signal(a)


def wrench_column(view: RunView, body: str, force: Array, moment: Array) -> Column:
    """Return force and moment (N, 3) on a body as one column; what its guides carry acts on its carrier, else nowhere."""
    wrench = np.concatenate([force, moment], axis=1) @ view.plant.body_map(body)
    return tuple(Effect(Where.WRENCH, i, wrench[:, i]) for i in range(wrench.shape[1]) if np.any(wrench[:, i]))


def cg_column(view: RunView, body: str, axis: str) -> Column:
    """Return what a CG does that lies one metre from where the model has it, along an axis."""
    force, moment = cg_shift_wrench(view, body, np.eye(3)[AXES.index(axis)], body_spectra(view, body)[1])
    return wrench_column(view, body, view.grid.signal(force), view.grid.signal(moment))
