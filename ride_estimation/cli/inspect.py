# Copyright 2026 ride_estimation contributors
"""``ride-estimation inspect``: what is in a recorded run, before a vehicle file exists."""

from __future__ import annotations

import argparse
import difflib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ride_estimation.cli.parts import part_of_options
from ride_estimation.errors import InputDataError
from ride_estimation.io.bag_source import open_bag
from ride_estimation.io.bags import read_recording
from ride_estimation.io.messages import accepted_types
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.sensor import SENSOR_KINDS, Sensor
from ride_estimation.signals.recording import Channel, part_of
from ride_estimation.vehicles.vehicle import Vehicle

#: kinds that one topic can feed by itself, the usual one of a message type first
_KINDS = ("imu", "accelerometer", "speed", "force")
#: an interval this much longer than the usual one is a gap: a sample is missing
_GAP = 1.5
#: likeness of two names from which on one is proposed for the other, 0 to 1: more than half of the letters agree in order
_ALIKE = 0.6
_COMPONENTS = ("x", "y", "z", "rate x", "rate y", "rate z")


def run(options: argparse.Namespace) -> int:
    """Print one block per topic."""
    begin, end = part_of_options(options)
    vehicle = load_vehicle(options.vehicle) if options.vehicle else None
    source = open_bag(Path(options.recording))
    sensors = _sensors_of({topic: kind for topic, kind in source.types.items() if source.counts[topic]})
    for topic, kind in sorted(source.types.items()):
        if topic not in sensors:
            print(f"{topic} ({kind}): {source.counts[topic]} messages, not read")
    if not sensors:
        raise InputDataError(f"{options.recording}: no topic of a type that a sensor comes in")
    # a reader of sensors needs nothing else of a vehicle
    recording = part_of(read_recording(options.recording, Vehicle("", {}, {}, sensors)), begin, end)
    print(f"{recording.name}: {recording.duration_s:.3f} s")
    for topic, channel in recording.channels.items():
        print(f"{topic} ({source.types[topic]}): {_timing(channel)}{_proposal(topic, vehicle)}")
        units = SENSOR_KINDS[sensors[topic].kind][1].split(", ")
        for i in range(channel.values.shape[1]):
            values = channel.values[np.isfinite(channel.values[:, i]), i]
            name = _COMPONENTS[i] if channel.values.shape[1] > 1 else "value"
            if len(values):
                numbers = (values.mean(), values.std(), values.min(), values.max())
                words = "  ".join(f"{word} {v:.5g}" for word, v in zip(("mean", "std", "min", "max"), numbers))
                print(f"  {name:<7}[{units[min(i // 3, len(units) - 1)]}]  {words}")
            if len(values) < len(channel.values):
                print(f"  {name:<7}{len(channel.values) - len(values)} values are not finite")
    for reason, count in recording.ignored.items():
        print(f"not used: {reason}: {count}")
    return 0


def _sensors_of(types: Mapping[str, str]) -> dict[str, Sensor]:
    """Return a sensor for every topic that can feed one by itself, named as the topic."""
    found = {}
    for topic, message_type in sorted(types.items()):
        kind = next((k for k in _KINDS if message_type in accepted_types(k)), None)
        if kind is not None:
            found[topic] = Sensor(topic, kind, topic, "", trust_despite_minus_one=True)
    return found


def _timing(channel: Channel) -> str:
    """Return samples, rate and gaps in words."""
    steps = np.asarray(np.diff(np.sort(channel.stamp_ns)), dtype=np.float64) * 1e-9
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual <= 0.0:
        return f"{len(channel.stamp_ns)} samples, no rate (equal stamps)"
    gaps = steps[steps > _GAP * usual]
    words = f"{len(channel.stamp_ns)} samples, {1.0 / usual:.4g} Hz, {len(gaps)} gaps"
    return words + (f", longest {gaps.max():.3g} s" if len(gaps) else "")


def _proposal(topic: str, vehicle: Vehicle | None) -> str:
    """Return which sensor of the vehicle the topic feeds or may be meant for."""
    if vehicle is None:
        return ""
    own = [s.name for s in vehicle.sensors.values() if s.topic == topic]
    if own:
        return f"; sensor {', '.join(own)}"
    names = {name.replace("_", "/"): name for name in vehicle.sensors}
    close = difflib.get_close_matches(topic.strip("/"), list(names), n=1, cutoff=_ALIKE)
    return f"; no sensor has this topic, perhaps {names[close[0]]}" if close else "; no sensor has this topic"
