# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation inspect``."""

from __future__ import annotations

import argparse

from ride_estimation.cli.arguments.parts import RUN_HELP, add_part_arguments, add_time_arguments

HELP = "show what is in a recorded run: topics, types, rates, gaps, ranges, mean, std, and the sensor each may belong to"
EXAMPLES = """\
  ride-estimation inspect bags/standing
  ride-estimation inspect run.mcap --vehicle my_vehicle.yaml --from 10 --to 70
  ride-estimation inspect logger.csv --rate 500                             (a table without a column of time)
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("recording", metavar="RUN", help=RUN_HELP)
    parser.add_argument("--vehicle", metavar="V.yaml", help="vehicle file: says which topic belongs to which of its sensors")
    add_time_arguments(parser)
    add_part_arguments(parser)
