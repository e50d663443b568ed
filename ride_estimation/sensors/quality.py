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
from ride_estimation.signals.spectral_checks import hum_findings, undersampled_findings, unipolar_findings

#: rate of an accelerometer below which part of the ride motion cannot be in the signal [Hz]
LOW_RATE_HZ = 60.0
#: fewest accelerometers on a body of which one can stand out, and the factor from which on no place on a body explains it
LEAST_PEERS, PEER_FACTOR = 4, 10.0
#: signal to noise below which nothing is to be had from a sensor, and of the middle sensor of a run that is not at rest [dB]
LEAST_DB, DRIVEN_DB = 3.0, 15.0


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
    peers = _peer_findings(recording.channels, sensors)
    for name, whole in recording.channels.items():
        sensor = sensors[name]
        channel = _measured_part(whole, sensor)
        quality = judge_channel(
            channel, sensor.full_scale, None if left_out is None else left_out.get(name), largest=_largest(sensor)
        )
        extra = [*spans[name], *twins.get(name, ())]
        finite = channel.values[np.all(np.abs(channel.values) <= _largest(sensor)[: channel.values.shape[1]], axis=1)]
        extra += plausibility_findings(sensor.kind, quality.rate_hz, finite, weight)
        if sensor.kind != "speed":  # which is of one sign and slow
            extra += unipolar_findings(finite)
            extra += undersampled_findings(finite[:, :3], quality.rate_hz, sensor.noise_std)
            extra += hum_findings(finite[:, :3], quality.rate_hz)
        if sensor.kind in ("accelerometer", "imu") and SLOWEST_HZ <= quality.rate_hz < LOW_RATE_HZ:
            seen = 0.4 * quality.rate_hz
            extra.append(f"{quality.rate_hz:.3g} Hz shows motion below {seen:.2g} Hz only; wheel hop is at 10 to 15 Hz")
        if sensor.kind in ("accelerometer", "imu") and sensor.coupling == "dc" and sensor.triaxial and quality.samples:
            extra += gravity_findings(sensor.rotation @ quality.mean[:3], gravity)
        extra += peers.get(name, ())
        judged[name] = dataclasses.replace(quality, findings=(*quality.findings, *(with_action(f, NOTHING) for f in extra)))
    ratios = _signal_to_noise(judged, sensors)
    driven = float(np.median(list(ratios.values()))) > DRIVEN_DB if ratios else False
    for name, ratio in ratios.items():
        findings = judged[name].findings
        if driven and ratio < LEAST_DB:  # at rest nobody has any signal
            said = f"signal to noise of {ratio:.2g} dB while the others have plenty: hardly a signal"
            findings += (with_action(said, NOTHING),)
        judged[name] = dataclasses.replace(judged[name], findings=findings, signal_to_noise_db=ratio)
    return judged


def _measured_part(channel: Channel, sensor: Sensor) -> Channel:
    """Return the values that a sensor measures: what it does not measure has no quality."""
    return channel if sensor.triaxial else dataclasses.replace(channel, values=channel.values[:, sensor.measured])


def _largest(sensor: Sensor) -> tuple[float, ...]:
    return tuple(itertools.compress(sensor.largest, sensor.measured.tolist()))


def _peer_findings(channels: Mapping[str, Channel], sensors: Mapping[str, Sensor]) -> dict[str, list[str]]:
    """Return a finding for accelerometers that are far quieter or louder than the others on the same body.

    On a rigid body readings differ by place, but by less than tenfold in all axes together; the spread of the peers counts too.
    """
    groups: dict[tuple[str, tuple[str, ...]], dict[str, float]] = {}
    for name, channel in channels.items():
        sensor = sensors[name]
        values = channel.values[np.all(np.abs(channel.values) <= sensor.largest[: channel.values.shape[1]], axis=1), :3]
        if sensor.kind in ("accelerometer", "imu") and len(values) > 1:
            # a body shakes up and down more than sideways: only sensors of the same axes compare
            groups.setdefault((sensor.body, sensor.axes), {})[name] = float(np.sqrt(np.sum(np.var(values, axis=0)) + 1e-24))
    found: dict[str, list[str]] = {}
    for (body, _), sizes in groups.items():
        noise = max(sensors[name].noise_std for name in sizes)
        levels = {name: float(np.log(size)) for name, size in sizes.items()}
        middle = float(np.median(list(levels.values())))
        spread = 1.4826 * float(np.median([abs(level - middle) for level in levels.values()]))
        if len(sizes) < LEAST_PEERS or np.exp(middle) < 3.0 * noise:
            continue  # too few to judge by, or nothing but noise
        for name, level in levels.items():
            if abs(level - middle) > max(np.log(PEER_FACTOR), 4.0 * spread):
                times = np.exp(abs(level - middle))
                than = f"{'louder' if level > middle else 'quieter'} than the median of the {len(sizes)} accelerometers on {body}"
                found[name] = [f"{times:.3g} times {than}: gain or unit?"]
    return found


def _signal_to_noise(judged: Mapping[str, ChannelQuality], sensors: Mapping[str, Sensor]) -> dict[str, float]:
    """Return the signal to the stated noise of a sample per sensor [dB], the first three columns together."""
    found = {}
    for name, quality in judged.items():
        columns = min(3, len(quality.std))
        size = float(np.sqrt(np.mean(quality.std[:columns] ** 2))) if quality.samples else 0.0
        if size > 0.0 and sensors[name].noise_std > 0.0 and sensors[name].kind != "speed":  # which may well be constant
            found[name] = 20.0 * float(np.log10(size / sensors[name].noise_std))
    return found


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
            found.setdefault(b, []).append(f"delivers the numbers of {a} with opposite sign: one of the two is not a measurement")
    return found
