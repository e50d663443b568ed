# Copyright 2026 ride_estimation contributors
"""Is the input what the wheel felt, and does the residual show the rear axle? (document 002 sections 3, 4.1)."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.excitation.obstacles import rolled_envelope

Array = NDArray[np.float64]

#: a road that differs by more than this share of its height from the nearest hub path below it is no hub path
_FOLLOWED = 0.05
#: share of the body residual the delayed front axle must explain before a half car is offered
_PITCH_SHARE = 0.3
#: filter between axle motion and residual: from before (the wheelbase is searched in steps) to when the body has rung down [s]
_TAPS_S = (-0.05, 1.0, 0.025)
#: zero padding of the search for a line: eight points a bin
_PADDING = 8
#: time-bandwidth product and number of the tapers of the test for a line (Thomson 1982)
_BANDWIDTH, _TAPERS = 4.0, 7
#: chance at which a line of this size counts as one
_CHANCE = 0.01


@dataclasses.dataclass(frozen=True)
class RoadCheck:
    """Whether a wheel can follow the road given to a fit.

    Attributes
    ----------
    envelope
        What the hub of the wheel rolling over the road follows [m], shape (N,).
    difference
        Largest distance of the road from a hub path over the height of the road.
    objection
        Empty where the road can be followed.
    """

    envelope: Array
    difference: float
    objection: str


def check_road(road: ArrayLike, rate_hz: float, speed: float, wheel_radius: float) -> RoadCheck:
    """Say whether a road signal can be the path of the hub of a rolling wheel.

    A hub path is what remains when the profile is eroded and dilated again by the wheel circle. The step of document 002
    is no input a wheel can follow: it makes the spring run to its bound and the tyre three times too soft.

    Parameters
    ----------
    road
        Road height under the wheel centre [m], shape (N,).
    rate_hz, speed, wheel_radius
        [Hz], [m/s], [m].
    """
    u = np.asarray(road, dtype=float).ravel()
    if speed <= 0.0 or wheel_radius <= 0.0 or rate_hz <= 0.0:
        raise InputDataError("speed, wheel radius and sample rate must be positive")
    envelope = np.asarray(rolled_envelope(u, speed / rate_hz, wheel_radius))
    height = float(np.ptp(u))
    ground = -rolled_envelope(-u, speed / rate_hz, wheel_radius)
    hub = rolled_envelope(ground, speed / rate_hz, wheel_radius)
    difference = float(np.max(np.abs(hub - u))) / height if height > 0.0 else 0.0
    if difference <= _FOLLOWED:
        return RoadCheck(envelope, difference, "")
    return RoadCheck(
        envelope,
        difference,
        f"the input is the problem: no wheel of {wheel_radius:g} m radius moves its hub like this, it is up to "
        f"{100 * difference:.0f} % of the road height off; fit with the rolled envelope instead of the profile",
    )


@dataclasses.dataclass(frozen=True)
class PitchEvidence:
    """Whether the body residual repeats the front axle a wheelbase later.

    Attributes
    ----------
    delay_s
        Delay that explains most.
    wheelbase
        The delay times the speed [m].
    share
        Share of the energy the delayed axle explains of what the front axle does not explain at once.
    line_share
        Share of the energy of the residual that one lone sinusoid explains.
    offer
        What to do about it; empty where the share is below 30 % or below that of the sinusoid.
    """

    delay_s: float
    wheelbase: float
    share: float
    line_share: float
    offer: str


def pitch_evidence(
    residual: ArrayLike, axle_acceleration: ArrayLike, rate_hz: float, speed: float,
    wheelbase_range: tuple[float, float] = (2.0, 7.0),
) -> PitchEvidence:
    """Look for the rear axle in the residual of a quarter car.

    What the front axle explains at once is removed first (wrong parameters do that too). The rest is regressed on the front
    axle acceleration delayed by wheelbase over speed, through a filter long enough for the body to ring. A lone sinusoid
    explains 15 to 40 % of the residual of a missing axle, and nearly all of that of a true disturbance, which the filter
    explains in part: what explains more decides.

    Parameters
    ----------
    residual
        Body acceleration not explained by the quarter car [m/s^2], shape (N,).
    axle_acceleration
        Measured front axle acceleration [m/s^2], shape (N,).
    rate_hz, speed
        [Hz], [m/s].
    wheelbase_range
        Wheelbases considered [m].
    """
    e, a = np.asarray(residual, dtype=float).ravel(), np.asarray(axle_acceleration, dtype=float).ravel()
    if e.size != a.size or speed <= 0.0:
        raise InputDataError(f"residual and axle signal must be of equal length ({e.size}, {a.size}), speed positive")
    step = max(1, round(_TAPS_S[2] * rate_hz))
    taps = range(round(_TAPS_S[0] * rate_hz), round(_TAPS_S[1] * rate_hz) + 1, step)
    rest = _unexplained(e, a, 0, taps)
    freedom = e.size - 2 * len(taps)  # residuals left after both regressions
    energy = float(rest @ rest)
    best = (0.0, 0)
    for lag in range(math.ceil(wheelbase_range[0] / speed * rate_hz), math.floor(wheelbase_range[1] / speed * rate_hz) + 1, step):
        if lag + taps[-1] >= e.size or freedom <= 0 or energy == 0.0:
            break
        left = float(np.sum(_unexplained(rest, a, lag, taps) ** 2))
        best = max(best, (1.0 - left / energy * e.size / freedom, lag))
    delay = best[1] / rate_hz
    line, offer = _line_share(e), ""
    if best[0] > max(_PITCH_SHARE, line):
        offer = (
            f"{100 * best[0]:.0f} % of what the front axle does not explain of the body repeats it {delay:.2f} s later, "
            f"{delay * speed:.1f} m of road (the wheelbase, where the road is one obstacle): pitch and rear axle "
            "are missing; use a half car before calling it a disturbance"
        )
    return PitchEvidence(delay, delay * speed, best[0], line, offer)


def _line_share(residual: Array) -> float:
    """Return the share of the energy that the best sinusoid of two periods or more explains."""
    count, energy = residual.size, float(residual @ residual)
    if energy == 0.0:
        return 0.0
    spectrum = np.abs(np.fft.rfft(residual * np.hanning(count), _PADDING * count))
    spectrum[: 2 * _PADDING] = 0.0
    top = int(np.argmax(spectrum))
    left = energy
    for line in np.linspace(top - 1.0, top + 1.0, 9):
        phase = 2.0 * math.pi * line / (_PADDING * count) * np.arange(count)
        design = np.column_stack([np.sin(phase), np.cos(phase)])
        solution, *_ = np.linalg.lstsq(design, residual, rcond=None)
        left = min(left, float(np.sum((residual - design @ solution) ** 2)))
    return 1.0 - left / energy


def _unexplained(residual: Array, cause: Array, lag: int, taps: range) -> Array:
    """Return what a filter of the delayed cause leaves of the residual."""
    design = np.column_stack([_delayed(cause, lag + tap) for tap in taps])
    solution, *_ = np.linalg.lstsq(design, residual, rcond=1e-8)
    return np.asarray(residual - design @ solution)


def _delayed(values: Array, lag: int) -> Array:
    shifted = np.zeros_like(values)
    if lag <= 0:
        shifted[: values.size + lag] = values[-lag:]
    else:
        shifted[lag:] = values[:-lag]
    return shifted


@dataclasses.dataclass(frozen=True)
class LineTest:
    """Whether a residual holds a sinusoid.

    Attributes
    ----------
    frequency_hz
        Where the test stands out most, near the frequency asked for [Hz].
    chance
        Probability that a residual without any line shows one like this somewhere in the range searched.
    """

    frequency_hz: float
    chance: float

    @property
    def statement(self) -> str:
        """Return the result in words."""
        if self.chance < _CHANCE:
            return f"the residual holds a sinusoid at {self.frequency_hz:.3f} Hz (by chance: {self.chance:.1g})"
        return (
            f"the residual contains no sinusoid near {self.frequency_hz:.3f} Hz: one like the fitted comes up by chance with "
            f"probability {self.chance:.2g}; it stands for something else that is missing"
        )


def line_test(residual: ArrayLike, rate_hz: float, frequency_hz: float, searched_hz: tuple[float, float]) -> LineTest:
    """Tell a sinusoid from noise, a burst or a step by Thomson's harmonic F-test.

    A line has the same amplitude and phase through every taper; whatever else peaks at a frequency has not. The search over
    frequencies counts: of ``n`` independent ones the best is compared, ``1 - (1 - p)^n``.

    Parameters
    ----------
    residual
        What the model without a sinusoid leaves, shape (N,), N at least 64.
    rate_hz, frequency_hz
        Sample rate and frequency of the fitted sinusoid [Hz].
    searched_hz
        Range in which it was searched for [Hz].

    Notes
    -----
    D. J. Thomson, Spectrum estimation and harmonic analysis, Proc. IEEE 70 (1982) 1055, eq. (13.10).
    """
    e = np.asarray(residual, dtype=float).ravel()
    e = e - e.mean()
    count = e.size
    if count < 64:
        raise InputDataError(f"{count} samples are too few to detect a spectral line; at least 64 are needed")
    tapers = np.asarray(scipy.signal.windows.dpss(count, _BANDWIDTH, _TAPERS))
    spectra = np.fft.rfft(tapers * e, _PADDING * count, axis=1)
    at_zero = tapers.sum(axis=1)
    line = (at_zero @ spectra) / float(at_zero @ at_zero)
    rest = np.sum(np.abs(spectra - at_zero[:, None] * line) ** 2, axis=0)
    strength = (_TAPERS - 1) * np.abs(line) ** 2 * float(at_zero @ at_zero) / np.maximum(rest, np.finfo(float).tiny)
    frequency = np.fft.rfftfreq(_PADDING * count, 1.0 / rate_hz)
    near = np.flatnonzero(np.abs(frequency - frequency_hz) <= rate_hz / count)
    best = int(near[np.argmax(strength[near])])
    alone = float(scipy.stats.f.sf(strength[best], 2, 2 * _TAPERS - 2))
    independent = max((min(searched_hz[1], 0.5 * rate_hz) - searched_hz[0]) * count / rate_hz, 1.0)
    return LineTest(float(frequency[best]), float(-np.expm1(independent * np.log1p(-min(alone, 1.0 - 1e-16)))))
