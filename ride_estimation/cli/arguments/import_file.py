# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation import-file``."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.cli.arguments.parts import add_channels_argument, add_part_arguments
from ride_estimation.io.files.suffixes import READ_SUFFIXES

HELP = "make a bag of an MDF4, TDMS, RPC III, LabVIEW (.lvm), CSV or Parquet file"
EXAMPLES = """\
  ride-estimation import-file run.mf4 --vehicle my_truck.yaml --channels channels.yaml --out run_bag
  ride-estimation import-file run.csv --vehicle my_truck.yaml --out run_bag     (columns named cab_front_left.x [m/s^2], ...)

CSV: comma, semicolon or tab; decimal comma beside the latter two; "name [unit]" or a second line of units; lines above the
header and text columns are skipped. Time: a column called time, t, timestamp, ... with its unit in the heading or the
name (Time_ms), seconds where that says nothing.

a channel map says which channel is which component of which sensor:
  schema: ride_estimation/channels/1
  channels:
    cab_front_left.x: AccFL_X                                      unit as the file states it
    cab_front_left.y: {channel: AccFL_Y, unit: g, factor: -1.0}    unit and sign said here
  time: {channel: Time_1, unit: ms}        only where the file does not say it; or {rate_hz: 500}
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("file", type=Path, metavar="FILE", help=f"measurement file: {', '.join(READ_SUFFIXES)}")
    parser.add_argument("--vehicle", required=True, metavar="V.yaml", help="vehicle file with the sensors")
    add_channels_argument(parser)
    add_part_arguments(parser)
    parser.add_argument("--out", required=True, type=Path, metavar="BAG", help="folder of the bag; never overwritten")
