# Copyright 2026 ride_estimation contributors
"""Pseudo-wrenches on a body along the motion of a scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.baseline import body_spectra
from ride_estimation.diagnosis.effect import Column, Effect, Where
from ride_estimation.diagnosis.scene import Scene

Array = NDArray[np.float64]


def six_of(scene: Scene, body: str) -> tuple[Array, Array]:
    """Return displacement and acceleration of the six coordinates of a body, (N, 6) each; fixed ones are zero."""
    q, a = body_spectra(scene, body)
    return scene.grid.signal(q), scene.grid.signal(a)


def wrench_column(scene: Scene, body: str, force: Array, moment: Array) -> Column:
    """Return force and moment (N, 3) on a body as one column; parts on fixed coordinates are left out."""
    six = np.concatenate([force, moment], axis=1)
    return tuple(
        Effect(Where.WRENCH, row, six[:, column])
        for row, column in scene.plant.coordinate_rows(body)
        if np.any(six[:, column])
    )
