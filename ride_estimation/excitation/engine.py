# Copyright 2026 ride_estimation contributors
"""Engine order lines: vibration at multiples of the crankshaft speed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError

Array = NDArray[np.float64]


def crank_angle(time_s: Array, speed_hz: Array | float) -> Array:
    """Return the crank angle ``phi = 2 pi integral n dt`` [rad], shape (N,), trapezoidal, zero at the start.

    Parameters
    ----------
    time_s
        Shape (N,) [s], increasing.
    speed_hz
        Crankshaft speed [rev/s], one value or shape (N,).
    """
    time = np.asarray(time_s, dtype=float)
    speed = np.broadcast_to(np.asarray(speed_hz, dtype=float), time.shape)
    if np.any(speed < 0.0) or not np.all(np.isfinite(speed)):
        raise ConfigurationError("engine speed: negative or not finite; allowed: 0 or more")
    steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(time)
    return 2.0 * np.pi * np.concatenate([[0.0], np.cumsum(steps)])


def order_lines(angle: Array, amplitudes: Mapping[float, float], phases: Mapping[float, float] | None = None) -> Array:
    """Return ``sum_k A_k sin(k phi + psi_k)`` in the unit of the amplitudes, shape (N,).

    Parameters
    ----------
    angle
        Crank angle [rad], shape (N,).
    amplitudes
        Order k (a six-cylinder four-stroke fires at order 3) -> amplitude.
    phases
        Order -> phase [rad], zero where not given.
    """
    given = phases or {}
    result = np.zeros(len(angle))
    for order, amplitude in amplitudes.items():
        if not order > 0.0:
            raise ConfigurationError(f"engine order: {order:g}; allowed: greater than zero")
        result += amplitude * np.sin(order * np.asarray(angle) + given.get(order, 0.0))
    return result
