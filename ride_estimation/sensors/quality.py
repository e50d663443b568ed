# Copyright 2026 ride_estimation contributors
"""Data quality of the sensors of a vehicle: each one by itself, against gravity, and against the others."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.quality import (
    NOTHING,
    SLOWEST_HZ,
    ChannelQuality,
    gravity_findings,
    judge_channel,
    plausibility_findings,
    with_action,
)
from ride_estimation.signals.recording import Channel, Recording

#: rate of an accelerometer below which part of the ride motion cannot be in the signal [Hz]
LOW_RATE_HZ = 60.0


def judge_sensors(
    recording: Recording, sensors: Mapping[str, Sensor], gravity: float, *, weight: float = 0.0,
    left_out: Mapping[str, Mapping[str, int]] | None = None,
) -> dict[str, ChannelQuality]:  # fmt: skip
    """Judge every channel of a recording.

    Parameters
    ----------
    recording
        The run.
    sensors
        By the names of the channels.
    gravity
        [m/s^2].
    weight
        Of all bodies together [N]; zero where it is not known.
    left_out
        Per sensor the ticks at which the estimator did not use it, by reason; None where nothing was estimated.
    """
    judged: dict[str, ChannelQuality] = {}
    twins = _twins(recording.channels)
    spans = _span_findings(recording.channels)
    for name, channel in recording.channels.items():
        sensor = sensors[name]
        quality = judge_channel(
            channel, sensor.full_scale, None if left_out is None else left_out.get(name), largest=sensor.largest
        )
        extra = [*spans[name], *twins.get(name, ())]
        finite = channel.values[np.all(np.abs(channel.values) <= sensor.largest[: channel.values.shape[1]], axis=1)]
        extra += plausibility_findings(sensor.kind, quality.rate_hz, finite, weight)
        if sensor.kind in ("accelerometer", "imu") and SLOWEST_HZ <= quality.rate_hz < LOW_RATE_HZ:
            seen = 0.4 * quality.rate_hz
            extra.append(f"{quality.rate_hz:.3g} Hz shows motion below {seen:.2g} Hz only; wheel hop is at 10 to 15 Hz")
        if sensor.kind in ("accelerometer", "imu") and sensor.coupling == "dc" and quality.samples:
            extra += gravity_findings(sensor.rotation @ quality.mean[:3], gravity)
        judged[name] = dataclasses.replace(quality, findings=(*quality.findings, *(with_action(f, NOTHING) for f in extra)))
    return judged


def _span_findings(channels: Mapping[str, Channel]) -> dict[str, list[str]]:
    """Return a finding for sensors that begin later or end earlier than the run by more than half a second."""
    bounds = {}
    for name, channel in channels.items():
        stamps = channel.stamp_ns[channel.stamp_ns > 0]
        if len(stamps):
            # percentiles, so that one wild stamp does not stretch the run
            bounds[name] = (float(np.percentile(stamps, 0.5)), float(np.percentile(stamps, 99.5)))
    start, end = min((b[0] for b in bounds.values()), default=0.0), max((b[1] for b in bounds.values()), default=0.0)
    found: dict[str, list[str]] = {name: [] for name in channels}
    for name, (first, last) in bounds.items():
        if first - start > 0.5e9 + 0.01 * (end - start):
            found[name].append(f"begins {(first - start) * 1e-9:.2g} s after the run")
        if end - last > 0.5e9 + 0.01 * (end - start):
            found[name].append(f"ends {(end - last) * 1e-9:.2g} s before the run")
    return found


def _twins(channels: Mapping[str, Channel]) -> Mapping[str, Sequence[str]]:
    """Return a finding for sensors that deliver the same numbers."""
    found: dict[str, list[str]] = {}
    for (a, first), (b, second) in itertools.combinations(channels.items(), 2):
        n = min(len(first.values), len(second.values), 1000)
        same_kind = first.values.shape[1] == second.values.shape[1] >= 3
        if n < 16 or np.all(first.values[:n] == first.values[0, 0]):
            continue
        if same_kind and np.array_equal(first.values[:n], second.values[:n]):
            found.setdefault(b, []).append(f"delivers the same numbers as {a}: one topic recorded twice?")
        elif same_kind and np.array_equal(first.values[:n], -second.values[:n]):
            found.setdefault(b, []).append(f"delivers the numbers of {a} with opposite sign: one of the two is no measurement")
    return found
