# Copyright 2026 ride_estimation contributors
"""How the vehicle is driven: speed over time, distance, wheelbase delay, single manoeuvres."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError

Array = NDArray[np.float64]


def speed_profile(time_s: Array, points: Sequence[tuple[float, float]], smoothing_s: float = 1.0) -> Array:
    """Return the speed [m/s] through (time [s], speed [m/s]) points, corners rounded by a running mean, shape (N,).

    Parameters
    ----------
    time_s
        Uniform, shape (N,) [s].
    points
        Times increasing, speeds 0 or more; held constant outside.
    smoothing_s
        Width of the running mean [s].
    """
    times = np.array([p[0] for p in points], dtype=float)
    speeds = np.array([p[1] for p in points], dtype=float)
    if len(points) < 1 or np.any(np.diff(times) <= 0.0) or np.any(speeds < 0.0) or not np.all(np.isfinite(speeds)):
        raise ConfigurationError("speed: points need increasing times and speeds of 0 or more")
    raw = np.interp(time_s, times, speeds)
    step = float(time_s[1] - time_s[0])
    half = max(0, round(0.5 * smoothing_s / step))
    # three passes make a smooth acceleration
    for _ in range(3):
        padded = np.pad(raw, half, mode="edge")
        total = np.concatenate([[0.0], np.cumsum(padded)])
        raw = (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)
    return np.asarray(np.maximum(raw, 0.0), dtype=float)


def travelled(time_s: Array, speed: Array) -> Array:
    """Return the distance [m] travelled since the start, trapezoidal, shape (N,)."""
    steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(time_s)
    return np.concatenate([[0.0], np.cumsum(steps)])


def wheelbase_delay(wheelbase: float, speed: float) -> float:
    """Return the time ``L / v`` [s] by which the rear axle meets what the front axle met (document 001, Ch. 6)."""
    if not speed > 0.0:
        raise ConfigurationError(f"speed: {speed:g} m/s; allowed: greater than zero for a wheelbase delay")
    return wheelbase / speed


def lane_change(time_s: Array, begin: float, duration: float, peak: float) -> Array:
    """Return the lateral acceleration of a lane change, one sine period [m/s^2], shape (N,)."""
    s = (np.asarray(time_s, dtype=float) - begin) / duration
    return np.where((s >= 0.0) & (s <= 1.0), peak * np.sin(2.0 * math.pi * s), 0.0)
