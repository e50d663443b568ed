# Copyright 2026 ride_estimation contributors
"""The bench programme of a jounce bumper, scaled to its reference travel, and the operating range it must cover."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ride_estimation.errors import ConfigurationError, InputDataError

Array = NDArray[np.float64]

#: force at which the reference travel is read off [N] (document 004)
REFERENCE_FORCE = 9000.0
#: safety margin on travel (document 004)
MARGIN = 0.1


@dataclasses.dataclass(frozen=True)
class Excitation:
    """One part of the programme: name, times [s], travel into the bumper [m] (positive in compression)."""

    name: str
    time_s: Array
    travel: Array


def reference_travel(travels: Array, forces: Array, force: float = REFERENCE_FORCE) -> float:
    """Return the travel [m] at which a rising static curve reaches a force [N].

    Raises
    ------
    InputDataError
        The curve does not reach the force.
    """
    order = np.argsort(travels)
    rising = np.maximum.accumulate(np.asarray(forces)[order])
    if not rising[-1] >= force:
        raise InputDataError(f"the static curve ends at {rising[-1]:g} N; the reference travel is read off at {force:g} N")
    k = int(np.searchsorted(rising, force))
    if k == 0:
        return float(travels[order][0])
    x0, x1 = travels[order][k - 1], travels[order][k]
    return float(x0 + (force - rising[k - 1]) / (rising[k] - rising[k - 1]) * (x1 - x0))


def jounce_programme(
    reference_m: float, *, peak_speed: float = 2.0, rate_hz: float = 1000.0, dwell_s: float = 2.0,
    static_shares: Sequence[float] = (0.2, 0.4, 0.6, 0.8, 0.9, 1.0), static_time_s: float = 60.0,
    speed_shares: Sequence[float] = (0.05, 0.1, 0.25, 0.5, 1.0), sweep_steps: int = 12,
    roads: Mapping[str, tuple[Array, Array]] | None = None,
) -> tuple[Excitation, ...]:
    """Return the excitations: static ramps, dynamic ramps, amplitude sweep, and recorded roads.

    Everything scales with the reference travel, so bumpers of any length and stiffness get the same programme.

    Parameters
    ----------
    reference_m
        Reference travel [m], :func:`reference_travel`.
    peak_speed
        Largest rate of the travel [m/s].
    rate_hz
        Sampling rate [Hz].
    dwell_s
        Rest after every load [s], for relaxation.
    static_shares
        Turnaround points of the static ramps over the reference travel.
    static_time_s
        Time of one static stroke over the whole reference travel [s].
    speed_shares
        Rates of the dynamic ramps over the peak rate.
    sweep_steps
        Amplitudes of the half sines; their common frequency gives the largest one the peak rate.
    roads
        Recorded travels by name: times [s] and travel [m], taken as they are.

    Notes
    -----
    Source: document 004, Table 2 and Figure 8. The shares are this project's; the document shows them in pictures only.
    """
    if not (reference_m > 0.0 and peak_speed > 0.0 and rate_hz > 0.0 and sweep_steps >= 1):
        raise ConfigurationError(
            f"jounce programme: reference travel {reference_m:g} m, peak rate {peak_speed:g} m/s, rate {rate_hz:g} Hz and "
            f"{sweep_steps} steps must be positive"
        )
    slow = reference_m / static_time_s
    statics = [_ramp(share * reference_m, slow, rate_hz) for share in static_shares]
    dynamics = [_ramp(reference_m, share * peak_speed, rate_hz) for share in speed_shares]
    omega = peak_speed / reference_m
    sweep = [_half_sine(reference_m * (k + 1) / sweep_steps, omega, rate_hz) for k in range(sweep_steps)]
    parts = [
        _joined("static_ramps", statics, rate_hz, dwell_s), _joined("dynamic_ramps", dynamics, rate_hz, dwell_s),
        _joined("amplitude_sweep", sweep, rate_hz, dwell_s),
    ]
    parts += [Excitation(name, time_s, travel) for name, (time_s, travel) in (roads or {}).items()]
    return tuple(parts)


def _joined(name: str, pieces: list[Array], rate_hz: float, dwell_s: float) -> Excitation:
    """Join loads with a rest out of contact after each, during which the travel moves to the start of the next."""
    parts: list[Array] = []
    for k, piece in enumerate(pieces):
        following = pieces[min(k + 1, len(pieces) - 1)][0]
        parts += [piece, np.linspace(piece[-1], following, max(round(dwell_s * rate_hz), 2))]
    travel = np.concatenate(parts)
    return Excitation(name, np.arange(travel.size) / rate_hz, travel)


def _ramp(peak: float, speed: float, rate_hz: float) -> Array:
    """Return a triangle at constant rate; the run-up starts out of contact so that contact is met at full rate."""
    run_up = 0.05 * peak
    t = np.arange(0.0, 2.0 * (peak + run_up) / speed, 1.0 / rate_hz)
    return np.minimum(speed * t - run_up, 2.0 * peak + run_up - speed * t)


def _half_sine(peak: float, omega: float, rate_hz: float) -> Array:
    """Return a half sine that meets contact at its full rate, out of a run-up at constant acceleration."""
    run_up_s = 1.0 / omega
    # time from the middle of the stroke: sine while in contact, parabola from rest at -peak / 2 before and after
    away = np.abs(np.arange(0.0, 2.0 * run_up_s + np.pi / omega, 1.0 / rate_hz) - run_up_s - 0.5 * np.pi / omega)
    left = np.maximum(run_up_s - (away - 0.5 * np.pi / omega), 0.0)
    parabola = 0.5 * peak * omega**2 * left**2 - 0.5 * peak
    return np.where(away <= 0.5 * np.pi / omega, peak * np.cos(omega * away), parabola)


@dataclasses.dataclass(frozen=True)
class OperatingHull:
    """Convex hull of travel and rate, ``normals @ (x, v) <= offsets``; vertices in order, shape (K, 2)."""

    vertices: Array
    normals: Array
    offsets: Array

    def contains(self, travel: Array, rate: Array, tolerance: float = 1e-9) -> NDArray[np.bool_]:
        """Return for each point whether it lies inside (tolerance relative to the size of the hull)."""
        points = np.column_stack([travel, rate]) / np.ptp(self.vertices, axis=0)
        return np.asarray(np.all(points @ self.normals.T <= self.offsets + tolerance, axis=1))


def operating_hull(travel: Array, rate: Array, margin: float = MARGIN) -> OperatingHull:
    """Return the operating range of a bumper: the hull of its phase portrait with a margin on travel.

    Parameters
    ----------
    travel, rate
        Travel [m] and its rate [m/s], shape (N,); samples out of contact (travel < 0) are left out,
        but for those next to contact.
    margin
        Excess of travel; the rate is taken as it is.

    Raises
    ------
    InputDataError
        Fewer than three points in contact, or all on a line.

    Notes
    -----
    Source: document 004, Figure 6 and the margin of 10 %.
    """
    loaded = np.asarray(travel >= 0.0)
    # the samples next to contact belong to it, at travel zero: contact is met between two samples
    beside = loaded | np.append(loaded[1:], False) | np.append(False, loaded[:-1])
    measured = np.column_stack([np.maximum(travel[beside], 0.0), rate[beside]])
    points = np.concatenate([measured, measured * (1.0 + margin, 1.0)])
    span = np.ptp(points, axis=0) if np.any(loaded) else np.zeros(2)
    if not np.all(span > 0.0) or np.linalg.matrix_rank((measured - measured[0]) / span, tol=1e-9) < 2:
        raise InputDataError(f"{int(np.sum(loaded))} samples in contact do not span a range of travel and rate")
    try:
        hull = scipy.spatial.ConvexHull(points / span)
    except scipy.spatial.QhullError as error:
        raise InputDataError(f"travel and rate do not span an operating range: {error}") from error
    return OperatingHull(points[hull.vertices], hull.equations[:, :2], -hull.equations[:, 2])
