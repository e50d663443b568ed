# Copyright 2026 ride_estimation contributors
"""``ride-estimation export-file``: a recording or the results of a replay as CSV, Parquet or MDF4, with units."""

from __future__ import annotations

import argparse

from ride_estimation.cli.parts import part_of_options, read_part
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.io.bounded import read_arrays
from ride_estimation.io.files.conversion import recording_groups, replay_groups
from ride_estimation.io.files.formats import write_measurement_file
from ride_estimation.io.files.suffixes import WRITE_SUFFIXES
from ride_estimation.io.result_files import read_result
from ride_estimation.io.vehicle_file import load_vehicle


def run(options: argparse.Namespace) -> int:
    """Read, convert, write."""
    if options.out.suffix.lower() not in WRITE_SUFFIXES:
        raise InputDataError(f"{options.out}: cannot be written; allowed endings: {', '.join(WRITE_SUFFIXES)}")
    if (options.source / "signals.npz").is_file():
        if part_of_options(options) != (None, None):
            raise ConfigurationError("--from, --to: only for a recording, not for the results of a replay")
        read_result(options.source)
        groups, start = replay_groups(read_arrays(options.source / "signals.npz"))
    elif options.vehicle is None:
        what = "no signals.npz of a replay" if options.source.exists() else "does not exist"
        raise ConfigurationError(f"{options.source}: {what}; a recording needs --vehicle V.yaml")
    else:
        vehicle = load_vehicle(options.vehicle)
        recording = read_part(options.source, vehicle, options)
        groups, start = recording_groups(recording, vehicle.sensors, options.out.suffix.lower() != ".mf4")
    write_measurement_file(options.out, groups, start)
    count = sum(len(group) for group in groups)
    print(f"{options.out}: {count} channels, {max(len(group[0].time_s) for group in groups)} samples")
    return 0
