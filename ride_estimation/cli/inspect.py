# Copyright 2026 ride_estimation contributors
"""``ride-estimation inspect``: what is in a recorded run, before a vehicle file exists."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ride_estimation.cli.finite import require_finite
from ride_estimation.cli.parts import part_of_options, time_of_options
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.io.bag_source import open_bag
from ride_estimation.io.bags import read_recording
from ride_estimation.io.channel_guess import best_match, guess_channels, sensor_words
from ride_estimation.io.files.channels import TimeSource
from ride_estimation.io.files.formats import read_measurement_file
from ride_estimation.io.messages import accepted_types
from ride_estimation.io.recorded_run import is_measurement_file
from ride_estimation.io.run_events import moment, run_events
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.sensor import SENSOR_KINDS, Sensor
from ride_estimation.signals.recording import Channel, part_of
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: kinds that one topic can feed by itself, the usual one of a message type first
_KINDS = ("imu", "accelerometer", "speed", "force")
#: an interval this much longer than the usual one is a gap: a sample is missing
_GAP = 1.5
_COMPONENTS = ("x", "y", "z", "rate x", "rate y", "rate z")


def run(options: argparse.Namespace) -> int:
    """Print one block per topic."""
    require_finite(options)
    begin, end = part_of_options(options)
    vehicle = load_vehicle(options.vehicle) if options.vehicle else None
    if is_measurement_file(Path(options.recording)):
        return _inspect_file(Path(options.recording), vehicle, options)
    if time_of_options(options) != TimeSource():
        raise ConfigurationError("--time, --time-unit, --rate: only for a measurement file; messages of a bag have stamps")
    source = open_bag(Path(options.recording))
    sensors = _sensors_of({topic: kind for topic, kind in source.types.items() if source.counts[topic]})
    for topic, kind in sorted(source.types.items()):
        if topic not in sensors:
            print(f"{topic} ({kind}): {source.counts[topic]} messages, not read")
    if not sensors:
        raise InputDataError(f"{options.recording}: no topic of a type that a sensor comes in")
    # a reader of sensors needs nothing else of a vehicle
    whole = read_recording(options.recording, Vehicle("", {}, {}, sensors))
    events = run_events(options.recording, whole.start_ns, table=options.events)
    first = moment(begin, events)
    recording = part_of(whole, first, moment(end, events, -np.inf if first is None else first))
    print(f"{recording.name}: {recording.duration_s:.3f} s")
    for topic, channel in recording.channels.items():
        print(f"{topic} ({source.types[topic]}): {_timing(channel)}{_proposal(topic, vehicle)}")
        units = SENSOR_KINDS[sensors[topic].kind][1].split(", ")
        for i in range(channel.values.shape[1]):
            name = _COMPONENTS[i] if channel.values.shape[1] > 1 else "value"
            print(_numbers(name, units[min(i // 3, len(units) - 1)], channel.values[:, i]))
    for event in events:
        print(f"marker {event.name} at {event.time_s:.3f} s")
    for reason, count in recording.ignored.items():
        print(f"not used: {reason}: {count}")
    return 0


def _inspect_file(path: Path, vehicle: Vehicle | None, options: argparse.Namespace) -> int:
    """Print one line per channel of a measurement file."""
    file = read_measurement_file(path, time_of_options(options))
    start = min(float(c.time_s[0]) for c in file.channels)
    texts = [(round(seconds * 1e9), text) for seconds, text in file.events]
    events = run_events(path, round(start * 1e9), texts, options.events)
    begin, end = part_of_options(options)
    after = moment(begin, events)
    before = moment(end, events, -np.inf if after is None else after)
    first, last = start + (after or 0.0), start + (np.inf if before is None else before)
    print(f"{path}: {max(float(c.time_s[-1]) for c in file.channels) - start:.3f} s, {len(file.channels)} channels")
    guesses = {} if vehicle is None else guess_channels(file.channels, vehicle.sensors, vehicle.gravity)
    meant = {guess.channel: name for name, guess in guesses.items()}
    for c in file.channels:
        inside = (c.time_s >= first) & (c.time_s <= last)
        stamps = np.round(c.time_s[inside] * 1e9).astype(np.int64)
        print(f"{c.name} [{c.unit or 'no unit'}]: {_timing(Channel(c.name, stamps, c.values[inside, None], stamps))}", end="")
        print(f"; perhaps {meant[c.name]}" if c.name in meant else "")
        print(_numbers("", "", c.values[inside]))
    for event in events:
        print(f"marker {event.name} at {event.time_s:.3f} s")
    for name, why in file.unreadable.items():
        print(f"{'texts are markers' if file.events else 'not read'}: column {name}, {why}")
    return 0


def _numbers(name: str, unit: str, values: Array) -> str:
    """Return a line of mean, std and range of one component, and how many values are not finite."""
    finite = values[np.isfinite(values)]
    head = f"  {name:<7}[{unit}]" if name else " "
    lost = f"  {len(values) - len(finite)} values are not finite" if len(finite) < len(values) else ""
    if not len(finite):
        return f"{head}{lost}"
    numbers = (finite.mean(), finite.std(), finite.min(), finite.max())
    return f"{head}  " + "  ".join(f"{word} {v:.5g}" for word, v in zip(("mean", "std", "min", "max"), numbers)) + lost


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
    close = best_match(topic, {name: sensor_words(sensor) for name, sensor in vehicle.sensors.items()})
    return f"; no sensor has this topic, perhaps {close}" if close else "; no sensor has this topic"
