# Copyright 2026 ride_estimation contributors
"""Data quality of raw samples, before anything is estimated: rate, gaps, clipping, flat line, spikes, gravity, units.

Every finding is a sentence with numbers that ends with what is done about it; thresholds are relative to the signal itself, none
belongs to a vehicle.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.signals.clipping import clipping_levels
from ride_estimation.signals.column_checks import derived_findings, drift_findings
from ride_estimation.signals.recording import Channel
from ride_estimation.signals.streams import LARGEST

Array = NDArray[np.float64]

#: periods without a sample that make a gap
GAP_PERIODS = 3.5
#: steps back that are more than messages overtaking each other [periods]
FAR_PERIODS = 10.0
#: time without any change that makes a flat line [s]
FLAT_SECONDS = 1.0
#: distance of a sample from its neighbours, in robust standard deviations of that distance, that makes a spike
SPIKE_RATIO = 15.0
#: what is done about samples that say nothing, and about what only a person can put right
LEFT_OUT = "left out and counted"
NOTHING = "none: used as it is; check wiring, driver and vehicle file"
_AXES = "xyz"
#: standard gravity in the units loggers write
GRAVITY_IN = {"g": 1.0, "ft/s^2": 32.174, "in/s^2": 386.09, "cm/s^2": 980.665, "milli-g": 1000.0, "mm/s^2": 9806.65}
#: rates at which ride is measured [Hz]: slower shows no cab, faster is a unit of the time that was taken for another
SLOWEST_HZ, FASTEST_HZ = 10.0, 20_000.0
#: units the time may be in instead -> factor on the rate
_TIMES = {"ms": 1e3, "us": 1e6, "s instead of ms": 1e-3, "s instead of us": 1e-6}
#: travel that no mount of a cab, seat or axle has [m]
LONGEST_TRAVEL_M = 0.5
#: force on one mount in weights of all bodies together that no drive brings about
LARGEST_FORCE_WEIGHTS = 20.0


@dataclasses.dataclass(frozen=True)
class ChannelQuality:
    """What one sensor delivered.

    Attributes
    ----------
    samples
        Samples in the run.
    rate_hz, jitter_s
        Samples per time outside gaps, single lost ones counted in, and the robust standard deviation of the distance of stamps.
    duplicates, backwards
        Stamps equal to and before the stamp received just before (a few backwards are messages that overtook each other).
    gaps, longest_gap_s
        Holes longer than :data:`GAP_PERIODS` periods.
    clipped
        Samples at the full scale, or resting at an extreme value below it.
    flat_s
        Longest time without any change [s].
    spikes
        Isolated samples far from both neighbours.
    not_finite
        Samples with NaN or infinity.
    beyond
        Samples larger than any sensor of the kind can give.
    mean, std
        Per value, of the samples that a sensor can give.
    findings
        Sentences about what is not well, each with what is done about it behind an arrow.
    signal_to_noise_db
        Standard deviation of the samples over the stated noise of one [dB]; not finite where either is not known.
    """

    samples: int
    rate_hz: float
    jitter_s: float
    duplicates: int
    backwards: int
    gaps: int
    longest_gap_s: float
    clipped: int
    flat_s: float
    spikes: int
    not_finite: int
    beyond: int
    mean: Array
    std: Array
    findings: tuple[str, ...]
    signal_to_noise_db: float = math.nan


def judge_channel(
    channel: Channel,
    full_scale: float = float("inf"),
    left_out: Mapping[str, int] | None = None,
    *,
    largest: Sequence[float] = (),
) -> ChannelQuality:
    """Judge the samples of one sensor.

    Parameters
    ----------
    channel
        Samples in order of arrival.
    full_scale
        Largest magnitude the first three values can have [unit of the sensor].
    left_out
        Ticks at which the estimator did not use the sensor, by reason; None where nothing was estimated from it.
    largest
        Largest magnitude any sensor of the kind can give, per value; empty: :data:`~ride_estimation.signals.streams.LARGEST`.
    """
    width = channel.values.shape[1]
    finite = np.all(np.isfinite(channel.values), axis=1)
    good = finite & np.all(np.abs(channel.values) <= (tuple(largest[:width]) or LARGEST), axis=1)
    values, stamps = channel.values[good], channel.stamp_ns[good]
    raw_steps = np.diff(channel.stamp_ns)
    steps = np.diff(_ascending(stamps[stamps > 0])[0]).astype(np.float64) * 1e-9
    period = float(np.median(steps)) if steps.size else 0.0
    jitter = 1.4826 * float(np.median(np.abs(steps - period))) if steps.size else 0.0
    long = steps[steps > GAP_PERIODS * period] if period else steps[:0]
    clipped = _clipped(values[:, :3], full_scale)
    spikes = _spikes(values)
    flat = _longest_flat(values, period)
    quality = ChannelQuality(
        samples=len(channel.stamp_ns),
        rate_hz=_rate(steps[steps <= GAP_PERIODS * period], period) if period else 0.0,
        jitter_s=jitter,
        duplicates=int(np.sum(raw_steps == 0)),
        backwards=int(np.sum(raw_steps < 0)),
        gaps=len(long),
        longest_gap_s=float(long.max()) if len(long) else 0.0,
        clipped=clipped,
        flat_s=flat,
        spikes=spikes,
        not_finite=int(np.sum(~finite)),
        beyond=int(np.sum(finite & ~good)),
        mean=values.mean(axis=0) if len(values) else np.zeros(width),
        std=values.std(axis=0) if len(values) else np.zeros(width),
        findings=(),
    )
    return dataclasses.replace(quality, findings=tuple(_findings(quality, channel, good, period, _done(left_out))))


def _findings(q: ChannelQuality, channel: Channel, good: NDArray[np.bool_], period: float, done: str) -> list[str]:
    found: list[tuple[str, str]] = []
    if q.not_finite:
        found.append((f"{q.not_finite} samples are not finite", LEFT_OUT))
    if q.beyond:
        found.append((f"{q.beyond} samples are larger than any sensor of this kind can give", LEFT_OUT))
    if np.any(channel.stamp_ns <= 0):
        found.append((f"{int(np.sum(channel.stamp_ns <= 0))} stamps are zero", LEFT_OUT))
    if q.duplicates:
        found.append((f"{q.duplicates} stamps are repeated", "the later samples are left out and counted"))
    back = np.diff(channel.stamp_ns)
    far = back[back < -FAR_PERIODS * period * 1e9] if period else back[back < 0]
    if len(far):
        text = f"stamps run backwards {len(far)} times, the farthest by {-float(far.min()) * 1e-9:.3g} s"
        found.append((text, "left out, until most sensors follow: then the time base begins anew"))
    if q.gaps:
        text = f"{q.gaps} gaps of more than {GAP_PERIODS:g} periods, the longest {q.longest_gap_s:.3g} s"
        found.append((text, "the sensor is not used inside them, the others carry on"))
    if period and q.jitter_s > 0.1 * period:
        text = f"stamps jitter by {1e3 * q.jitter_s:.2g} ms at a period of {1e3 * period:.3g} ms"
        found.append((text, "samples are interpolated at their own stamps"))
    if q.clipped:
        text = f"{q.clipped} samples ({100.0 * q.clipped / q.samples:.2g} %) are clipped"
        found.append((text, done))
    if q.flat_s > FLAT_SECONDS:
        found.append((f"no change at all during {q.flat_s:.3g} s (flat line)", done))
    if q.spikes:
        found.append((f"{q.spikes} isolated spikes", done))
    stamps, places = _ascending(channel.stamp_ns[good])
    values = channel.values[good][places]
    if len(stamps):
        found += [(t, "none: used as it is") for t in drift_findings(values, (stamps - stamps[0]) * 1e-9)]
    found += [(t, NOTHING) for t in derived_findings(values)]
    return [with_action(text, done) for text, done in found]


def _done(left_out: Mapping[str, int] | None) -> str:
    """Return what the estimator did with a sensor, in words."""
    if left_out is None:
        return "none: nothing was estimated from it"
    if not left_out:
        return "none: used as it is"
    return "not used during " + ", ".join(f"{ticks} ticks ({reason})" for reason, ticks in sorted(left_out.items()))


def _rate(steps: Array, period: float) -> float:
    """Return the rate of a clock from its steps [s]: the median alone is a whole number of its resolution."""
    return float(np.sum(np.maximum(np.round(steps / period), 1.0)) / np.sum(steps))


def _ascending(stamps: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64] | slice]:
    """Return the different stamps in ascending order, and where each stands first."""
    if np.all(stamps[1:] > stamps[:-1]):
        return stamps, slice(None)
    return np.unique(stamps, return_index=True)


def with_action(finding: str, done: str) -> str:
    """Return a finding with what is done about it."""
    return f"{finding} -> {done}"


def _clipped(values: Array, full_scale: float) -> int:
    """Return the number of samples at full scale, or resting on an extreme value below it."""
    if not len(values):
        return 0
    low, high = clipping_levels(values)
    return int(np.sum(np.any((np.abs(values) >= 0.999 * full_scale) | (values <= low) | (values >= high), axis=1)))


def _spikes(values: Array) -> int:
    """Return the number of single samples that leave their two neighbours, both on the same side, by far."""
    if len(values) < 16:
        return 0
    before, behind = values[1:-1] - values[:-2], values[1:-1] - values[2:]
    away = np.where(before * behind > 0.0, np.minimum(np.abs(before), np.abs(behind)), 0.0)
    typical = 1.4826 * np.median(np.abs(np.diff(values, axis=0)), axis=0)
    spread = np.std(values, axis=0)
    limit = np.maximum(SPIKE_RATIO * typical, 3.0 * spread)
    return int(np.sum(np.any((away > limit) & (limit > 0.0), axis=1)))


def _longest_flat(values: Array, period: float) -> float:
    """Return the longest time in which one of the values does not change although it does elsewhere [s]."""
    if len(values) < 2 or not period:
        return 0.0
    longest = 0
    for column in values.T:
        changes = np.flatnonzero(np.diff(column) != 0.0)
        edges = np.concatenate([[-1], changes, [len(column) - 1]])
        longest = max(longest, int(np.max(np.diff(edges))))
    return longest * period


def gravity_findings(mean_body: Array, gravity: float) -> tuple[str, ...]:
    """Return what the mean specific force of an accelerometer in body axes says about axes and units.

    Parameters
    ----------
    mean_body
        Mean over the run in body axes, shape (3,) [m/s^2]; +g on z where everything is right (REP-145).
    gravity
        [m/s^2].
    """
    size = float(np.linalg.norm(mean_body))
    largest = int(np.argmax(np.abs(mean_body)))
    share = abs(mean_body[largest]) / size if size > 0.0 else 0.0
    like = [name for name, unit in GRAVITY_IN.items() if abs(size - unit) < 0.1 * unit]
    if like:
        return (f"the mean magnitude is {size:.4g}: the values look like {' or '.join(like)}, not m/s^2",)
    if size < 0.3 * gravity:
        return (f"the mean magnitude is {size:.3g} m/s^2: no gravity in the signal (ac coupled, or removed by the driver)",)
    found = []
    if abs(size - gravity) > 0.05 * gravity:
        found.append(f"the mean magnitude is {size:.4g} m/s^2 instead of {gravity:.4g}: wrong scale or offset")
    if share > 0.8 and largest == 2 and mean_body[2] > 0.0:
        angle = np.degrees(np.arccos(min(share, 1.0)))
        if angle > 10.0:
            found.append(f"gravity is {angle:.0f} deg off the z axis: the sensor's rotation in the vehicle file, or a slope")
    elif share > 0.8:
        sign = "+" if mean_body[largest] > 0.0 else "-"
        found.append(
            f"gravity lies on {sign}{_AXES[largest]} ({mean_body[largest]:.2f} m/s^2), not on +z: the sensor's axes are not "
            "those the vehicle file states (its rotation)"
        )
    else:
        direction = ", ".join(f"{v / size:.2f}" for v in mean_body)
        found.append(f"gravity points along ({direction}), not along z: check the sensor's rotation in the vehicle file")
    return tuple(found)


def plausibility_findings(kind: str, rate_hz: float, values: Array, weight: float) -> tuple[str, ...]:
    """Return what cannot be in rate, travel and force, with the unit it would be right in.

    Parameters
    ----------
    kind
        Of the sensor.
    rate_hz
        [Hz].
    values
        Finite samples, shape (N, C) [SI].
    weight
        Of all bodies of the vehicle together [N]; zero where it is not known.
    """
    found = []
    if rate_hz and not SLOWEST_HZ <= rate_hz <= FASTEST_HZ:
        right = [name for name, factor in _TIMES.items() if SLOWEST_HZ <= factor * rate_hz <= FASTEST_HZ]
        guess = f": is the time in {' or '.join(right)}?" if right else ""
        given = f"{rate_hz:.3g} Hz" if rate_hz < 1e3 else f"{rate_hz / 1e3:.3g} kHz"
        found.append(f"{given} is outside {SLOWEST_HZ:g} Hz to {FASTEST_HZ / 1e3:g} kHz, where ride is measured{guess}")
    if kind == "displacement" and len(values):
        travel = float(np.max(np.ptp(values, axis=0)))
        if travel > LONGEST_TRAVEL_M:
            guess = ": the values look like mm" if travel <= 1e3 * LONGEST_TRAVEL_M else ""
            found.append(f"the travel is {travel:.3g} m, more than the {LONGEST_TRAVEL_M:g} m of any mount{guess}")
    if kind == "force" and len(values) and weight > 0.0:
        force = float(np.max(np.abs(values)))
        if force > LARGEST_FORCE_WEIGHTS * weight:
            guess = ": are the values N that were taken as kN?" if force <= 1e3 * LARGEST_FORCE_WEIGHTS * weight else ""
            found.append(f"the force reaches {force:.3g} N, {force / weight:.3g} times the weight of the vehicle's bodies{guess}")
    return tuple(found)
