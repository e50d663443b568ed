# Copyright 2026 ride_estimation contributors
"""Pseudo-wrenches on a body along the motion of a view."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.baseline import body_spectra
from ride_estimation.diagnosis.effect import Column, Effect, Where
from ride_estimation.diagnosis.run_view import RunView

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def six_of(view: RunView, body: str) -> tuple[Array, Array]:
    """Return displacement and acceleration of the six coordinates of a body, shared ones included, (N, 6) each."""
    q, a = body_spectra(view, body)
    return view.grid.signal(q), view.grid.signal(a)


def balanced_acceleration(view: RunView, body: str) -> Array:
    """Return the acceleration of the six coordinates of a body that the forces along the estimated deflections cause, (N, 6).

    ``M q'' = -D^T ((k + i w c) x + law forces) - K_g q + T theta_base + wrenches``. Deflections are cleared of the noise of the
    base sensors; a load that stiffer mounts would hide must be compared with what they do along the same deflections.
    """
    plant, grid = view.plant, view.grid
    stiffness, damping = view.state.linear
    force = (stiffness + 1j * grid.omega[:, None] * damping) * view.deflection_spectrum
    wrench = -force @ plant.port_map - view.coordinate_spectrum @ plant.gravity_stiffness
    wrench += (view.data.input_spectrum / (-grid.omega**2)[:, None]) @ plant.static_tilt().T
    for e in view.state.effects:
        if e.where is Where.PORT:
            wrench -= np.outer(grid.spectrum(e.signal), plant.port_map[e.index])
        elif e.where is Where.WRENCH:
            wrench[:, e.index] += grid.spectrum(e.signal)
    acceleration: ComplexArray = np.asarray(wrench @ np.linalg.inv(plant.mass) @ plant.body_map(body).T, dtype=complex)
    return grid.signal(acceleration)


def wrench_column(view: RunView, body: str, force: Array, moment: Array) -> Column:
    """Return force and moment (N, 3) on a body as one column; what its guides carry acts on its carrier, else nowhere."""
    wrench = np.concatenate([force, moment], axis=1) @ view.plant.body_map(body)
    return tuple(Effect(Where.WRENCH, i, wrench[:, i]) for i in range(wrench.shape[1]) if np.any(wrench[:, i]))
