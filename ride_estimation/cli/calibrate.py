# Copyright 2026 ride_estimation contributors
"""``ride-estimation calibrate``: noise, bias and orientation of the sensors from a recording at standstill."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.assessment.standstill import calibrate, summary_lines
from ride_estimation.cli.parts import add_part_arguments, read_part
from ride_estimation.errors import InputDataError
from ride_estimation.io.results import output_folder
from ride_estimation.io.vehicle_file import find_vehicle_file, load_vehicle, save_vehicle

HELP = "noise, bias and orientation of the sensors from a recording at standstill, written to a vehicle file"
EXAMPLES = """\
  ride-estimation calibrate bags/standing/bag --vehicle truck_cab --out truck_calibrated.yaml

Park, engine off, nobody in the cab, ten seconds or more. One standstill cannot tell a bias across gravity from a mounting
angle: up to 0.15 m/s^2 it is taken for bias, above for an angle. Heading of a sensor cannot be seen at rest.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("recording", metavar="RUN", help="recording of the standing vehicle")
    parser.add_argument("--vehicle", required=True, metavar="V.yaml", help="vehicle file, or the name of a bundled one")
    add_part_arguments(parser)
    parser.add_argument("--out", type=Path, metavar="V2.yaml", help="vehicle file to write; without it the table is only printed")


def run(options: argparse.Namespace) -> int:
    """Calibrate, print, write."""
    vehicle = load_vehicle(options.vehicle)
    if options.out is not None and options.out.suffix not in (".yaml", ".yml"):
        raise InputDataError(f"{options.out}: a vehicle file is written as .yaml or .yml")
    if options.out is not None and options.out.exists() and options.out.samefile(find_vehicle_file(options.vehicle)):
        raise InputDataError(f"{options.out}: is the vehicle file that is read; its comments would be lost: write another file")
    found = calibrate(read_part(options.recording, vehicle, options), vehicle)
    print("\n".join(summary_lines(found)))
    if options.out is not None:
        output_folder(options.out.parent)
        try:
            save_vehicle(found.vehicle(vehicle), options.out)
        except OSError as error:
            raise InputDataError(f"{options.out}: cannot be written: {error.strerror or error}") from error
        print(f"written: {options.out}")
    return 0
