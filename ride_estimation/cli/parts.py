# Copyright 2026 ride_estimation contributors
"""What a command line says of a run: the part it asks for (``--from``, ``--to``), and the time of a table that says none."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.api.runs import read_run
from ride_estimation.cli.finite import require_finite
from ride_estimation.errors import ConfigurationError
from ride_estimation.io.files.channels import TIME_UNITS, TimeSource
from ride_estimation.signals.recording import Recording
from ride_estimation.vehicles.vehicle import Vehicle


def part_of_options(options: argparse.Namespace) -> tuple[float | str | None, float | str | None]:
    """Return begin and end of the part that was asked for: seconds, a marker, or None where the run itself begins or ends."""
    return limit_of("--from", options.from_s), limit_of("--to", options.to_s)


def time_of_options(options: argparse.Namespace) -> TimeSource:
    """Return where the time of a table comes from.

    Raises
    ------
    ConfigurationError
        A unit that is none, or a negative rate.
    """
    if options.time_unit not in ("", *TIME_UNITS):
        raise ConfigurationError(f"--time-unit {options.time_unit}; allowed: {', '.join(TIME_UNITS)}")
    if options.rate < 0.0:
        raise ConfigurationError(f"--rate {options.rate:g}; allowed: above 0 Hz")
    return TimeSource(options.time, options.time_unit, options.rate)


def limit_of(name: str, text: str | None) -> float | str | None:
    """Return a limit as number of seconds, or as the name of a marker."""
    if not text:
        return None
    try:
        seconds = float(text)
    except ValueError:
        return text.strip()
    require_finite(argparse.Namespace(**{name.lstrip("-"): seconds}))
    return seconds


def read_part(path: str | Path, vehicle: Vehicle, options: argparse.Namespace) -> Recording:
    """Return the part of a recorded run that a command line asks for."""
    begin, end = part_of_options(options)
    return read_run(path, vehicle, start_s=begin, end_s=end, channels=options.channels, events=options.events).recording
