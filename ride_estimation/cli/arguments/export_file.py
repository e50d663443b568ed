# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation export-file``."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.cli.arguments.parts import add_channels_argument, add_part_arguments
from ride_estimation.io.files.suffixes import WRITE_SUFFIXES

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
    add_channels_argument(parser)
    add_part_arguments(parser)
    parser.add_argument("--out", required=True, type=Path, metavar="FILE", help=f"file to write: {', '.join(WRITE_SUFFIXES)}")
