# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation map``."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.cli.arguments.parts import add_time_arguments
from ride_estimation.io.files.suffixes import READ_SUFFIXES

HELP = "propose a channel map for a logger file: which channel is which component of which sensor, by name, unit and gravity"
EXAMPLES = """\
  ride-estimation map run.mf4 --vehicle my_truck.yaml --out channels.yaml
  ride-estimation map run.csv --vehicle my_truck.yaml                             (only shows the proposal)

The map is a proposal: look at every line. What is not found stands in it as a comment, to be filled in.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("file", type=Path, metavar="FILE", help=f"measurement file: {', '.join(READ_SUFFIXES)}")
    parser.add_argument("--vehicle", required=True, metavar="V.yaml", help="vehicle file with the sensors")
    add_time_arguments(parser)
    parser.add_argument("--out", type=Path, metavar="MAP.yaml", help="channel map to write; an existing file is not replaced")
