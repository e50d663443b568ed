# Copyright 2026 ride_estimation contributors
"""``ride-estimation map``: a channel map to start from."""

from __future__ import annotations

import argparse
import json

from ride_estimation.cli.finite import require_finite
from ride_estimation.cli.parts import time_of_options
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.io.atomic import write_atomically
from ride_estimation.io.channel_guess import Guess, guess_channels
from ride_estimation.io.files.channel_map import SCHEMA, components
from ride_estimation.io.files.channels import MeasurementFile, TimeSource
from ride_estimation.io.files.formats import read_measurement_file
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.vehicles.vehicle import Vehicle


def run(options: argparse.Namespace) -> int:
    """Guess, print, write."""
    require_finite(options)
    time = time_of_options(options)
    if options.out is not None and options.out.exists():
        raise ConfigurationError("exists already and is not replaced; give another name or remove it", where=str(options.out))
    vehicle = load_vehicle(options.vehicle)
    file = read_measurement_file(options.file, time)
    found = guess_channels(file.channels, vehicle.sensors, vehicle.gravity)
    if not found and options.out is None:
        there = ", ".join(f"{c.name} [{c.unit or 'no unit'}]" for c in file.channels)
        raise InputDataError(
            f"{options.file}: no channel looks like one of a sensor of {vehicle.name}; --out writes a map to fill in. "
            f"Channels: {there}"
        )
    for name, guess in found.items():
        print(f"{name:<32} {guess.channel:<28} {guess.why}")
    missing = [name for sensor in vehicle.sensors.values() for name, _ in components(sensor) if name not in found]
    if missing:
        print(f"not found: {', '.join(missing)}")
    used = {guess.channel for guess in found.values()}
    rest = [f"{c.name} [{c.unit or 'no unit'}]" for c in file.channels if c.name not in used]
    if rest:
        print(f"channels not used: {', '.join(rest)}")
    if options.out is not None:
        write_atomically(options.out, _text(file, vehicle, time, found))
        what = "look at every line" if found else "no channel looks like one of a sensor: fill it in"
        print(f"written: {options.out}; {what}")
    return 0


def _text(file: MeasurementFile, vehicle: Vehicle, time: TimeSource, found: dict[str, Guess]) -> str:
    """Return the map as text with comments: a sensor that is not complete as a whole, and channels that are not used."""
    lines = [f"# proposed from the names, units and gravity of {file.name}: look at every line", f"schema: {SCHEMA}"]
    said: dict[str, str | float] = {"channel": time.channel, "unit": time.unit, "rate_hz": time.rate_hz}
    if any(said.values()):
        lines.append(f"time: {_flow({key: value for key, value in said.items() if value})}")
    lines.append("channels:")
    for sensor in vehicle.sensors.values():
        names = [name for name, _ in components(sensor)]
        off = "" if all(name in found for name in names) else "# "
        for name in names:
            guess = found.get(name)
            if guess is None:
                lines.append(f"  {off}{name}: ???")
                continue
            factor = guess.factor if guess.factor != 1.0 else 0.0
            entry: dict[str, str | float] = {"channel": guess.channel, "unit": guess.unit, "factor": factor}
            plain = not guess.unit and guess.factor == 1.0
            value = json.dumps(guess.channel, ensure_ascii=False) if plain else _flow({k: v for k, v in entry.items() if v})
            lines.append(f"  {off}{name}: {value}  # {guess.why}")
    used = {guess.channel for guess in found.values()}
    rest = [c for c in file.channels if c.name not in used]
    lines += [f"# not used: {json.dumps(c.name, ensure_ascii=False)} [{c.unit or 'no unit'}]" for c in rest]
    return "\n".join(lines) + "\n"


def _flow(entry: dict[str, str | float]) -> str:
    """Return a mapping as YAML in one line."""
    return "{" + ", ".join(f"{key}: {json.dumps(value, ensure_ascii=False)}" for key, value in entry.items()) + "}"
