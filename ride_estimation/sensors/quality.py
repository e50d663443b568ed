# Copyright 2026 ride_estimation contributors
"""Data quality of the sensors of a vehicle: each one by itself, against gravity, and against the others."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.quality import ChannelQuality, gravity_findings, judge_channel
from ride_estimation.signals.recording import Channel, Recording


def judge_sensors(recording: Recording, sensors: Mapping[str, Sensor], gravity: float) -> dict[str, ChannelQuality]:
    """Judge every channel of a recording.

    Parameters
    ----------
    recording
        The run.
    sensors
        By the names of the channels.
    gravity
        [m/s^2].
    """
    judged: dict[str, ChannelQuality] = {}
    twins = _twins(recording.channels)
    for name, channel in recording.channels.items():
        sensor = sensors[name]
        quality = judge_channel(channel, sensor.full_scale)
        extra = list(twins.get(name, ()))
        if sensor.kind in ("accelerometer", "imu") and sensor.coupling == "dc" and quality.samples:
            extra += gravity_findings(sensor.rotation @ quality.mean[:3], gravity)
        judged[name] = dataclasses.replace(quality, findings=(*quality.findings, *extra))
    return judged


def _twins(channels: Mapping[str, Channel]) -> Mapping[str, Sequence[str]]:
    """Return a finding for sensors that deliver the same numbers."""
    found: dict[str, list[str]] = {}
    for (a, first), (b, second) in itertools.combinations(channels.items(), 2):
        n = min(len(first.values), len(second.values), 1000)
        same_kind = first.values.shape[1] == second.values.shape[1] >= 3
        if n >= 16 and same_kind and np.array_equal(first.values[:n], second.values[:n]) and np.ptp(first.values[:n]) > 0.0:
            found.setdefault(b, []).append(f"delivers the same numbers as {a}: one topic recorded twice?")
    return found
