# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation calibrate``."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.cli.arguments.parts import RUN_HELP, add_channels_argument, add_part_arguments

HELP = "noise, bias and orientation of the sensors from a recording at standstill, written to a vehicle file"
EXAMPLES = """\
  ride-estimation calibrate bags/standing/bag --vehicle truck_cab --out truck_calibrated.yaml

Park, engine off, nobody in the cab, ten seconds or more. One standstill cannot tell a bias across gravity from a mounting
angle: up to 0.15 m/s^2 it is taken for bias, above for an angle. Heading of a sensor cannot be seen at rest.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("recording", metavar="RUN", help=f"recording of the standing vehicle: {RUN_HELP}")
    parser.add_argument("--vehicle", required=True, metavar="V.yaml", help="vehicle file, or the name of a bundled one")
    add_channels_argument(parser)
    add_part_arguments(parser)
    parser.add_argument("--out", type=Path, metavar="V2.yaml", help="vehicle file to write; without it the table is only printed")
