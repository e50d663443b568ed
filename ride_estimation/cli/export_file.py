# Copyright 2026 ride_estimation contributors
"""``ride-estimation export-file``: a recording or the results of a replay as CSV, Parquet or MDF4, with units."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.cli.parts import add_part_arguments, part_of_options, read_part
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.io.bounded import read_arrays
from ride_estimation.io.files.conversion import recording_groups, replay_groups
from ride_estimation.io.files.formats import WRITE_SUFFIXES, write_measurement_file
from ride_estimation.io.result_files import read_result
from ride_estimation.io.vehicle_file import load_vehicle

HELP = "write a recording or the results of a replay as CSV, Parquet or MDF4"
EXAMPLES = """\
  ride-estimation export-file out/nominal --out nominal.parquet                               (results of a replay)
  ride-estimation export-file bags/nominal/bag --vehicle truck_cab --out nominal.mf4          (sensors of a recording)

MDF4 keeps the time base of every sensor and gives the recording back bit for bit; CSV and Parquet have one time column, to which
the samples of a recording are interpolated. 'import-file' reads all three.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("source", type=Path, metavar="RUN", help="output folder of a replay, or a recording with --vehicle")
    parser.add_argument("--vehicle", metavar="V.yaml", help="vehicle file, for a recording")
    add_part_arguments(parser)
    parser.add_argument("--out", required=True, type=Path, metavar="FILE", help=f"file to write: {', '.join(WRITE_SUFFIXES)}")


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
