# Copyright 2026 ride_estimation contributors
"""Damping from a drop test by logarithmic decrement (document 001 section 3.1.2, eq. (3.8))."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ride_estimation.errors import InputDataError


@dataclasses.dataclass(frozen=True)
class DecayResult:
    """What a free decay says.

    Attributes
    ----------
    damping_ratio
        zeta, from the decrement over all peaks.
    frequency_hz
        Damped frequency [Hz].
    peaks
        Number of peaks used.
    spread
        Standard deviation of the decrement between successive peaks over its mean; above 0.2 the decay is not
        exponential (friction gives a linear decay).
    """

    damping_ratio: float
    frequency_hz: float
    peaks: int
    spread: float


def analyse_decay(values: ArrayLike, rate_hz: float) -> DecayResult:
    """Read damping ratio and frequency from a free decay about zero.

    ``delta = ln(x_i / x_{i+1})``, ``zeta = delta / sqrt(4 pi^2 + delta^2)``; both signs of the swing are used (half cycles),
    peaks are refined by a parabola, and only peaks above 2 % of the first count.

    Parameters
    ----------
    values
        Displacement, velocity or acceleration of the decay, shape (N,); the rest position must be zero.
    rate_hz
        [Hz].

    Raises
    ------
    InputDataError
        Fewer than three half-cycle peaks, values not finite.
    """
    y = np.asarray(values, dtype=float).ravel()
    if y.size < 8 or not np.all(np.isfinite(y)):
        raise InputDataError("a decay needs at least 8 finite samples")
    index, _ = scipy.signal.find_peaks(np.abs(y), height=0.02 * np.max(np.abs(y)))
    if index.size < 3:
        raise InputDataError(f"{index.size} peaks found; at least three half cycles above 2 % of the first are needed")
    times, heights = [], []
    for i in index:
        a, b, c = np.abs(y[i - 1 : i + 2])
        curvature = a - 2.0 * b + c
        shift = 0.5 * (a - c) / curvature if curvature < 0.0 else 0.0
        times.append((i + shift) / rate_hz)
        heights.append(b - 0.25 * (a - c) * shift)
    log_height = np.log(np.array(heights))
    order = np.arange(log_height.size)
    half_decrement = -float(np.polyfit(order, log_height, 1)[0])
    delta = 2.0 * half_decrement
    zeta = delta / math.sqrt(4.0 * math.pi**2 + delta**2)
    steps = -np.diff(log_height)
    spread = float(np.std(steps) / abs(np.mean(steps))) if np.mean(steps) != 0.0 else math.inf
    period = 2.0 * float(np.polyfit(order, np.array(times), 1)[0])
    return DecayResult(zeta, 1.0 / period, int(index.size), spread)


def effective_mass(pivot_inertia: float, arm: float) -> float:
    """Return the mass that a spring at ``arm`` from a pivot feels, ``I_pivot / l^2`` [kg].

    Document 001 uses the static load over g instead, 0.89 to 1.12 of this.
    """
    if pivot_inertia <= 0.0 or arm <= 0.0:
        raise InputDataError(f"pivot inertia {pivot_inertia:g} kg m^2 and arm {arm:g} m; allowed: both greater than zero")
    return pivot_inertia / arm**2


def damping_constant(damping_ratio: float, stiffness: float, mass: float) -> float:
    """Return ``c = 2 zeta sqrt(k m)`` [N s/m]."""
    if stiffness <= 0.0 or mass <= 0.0:
        raise InputDataError(f"stiffness {stiffness:g} N/m and effective mass {mass:g} kg; allowed: both greater than zero")
    return 2.0 * damping_ratio * math.sqrt(stiffness * mass)
