# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation fleet``."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from ride_estimation.cli.arguments.replay import add_replay_arguments

HELP = "replay all recordings below a folder: one table, one summary, resumable, on all cores or a Dask cluster"
EXAMPLES = """\
  ride-estimation fleet recordings/ --vehicle my_truck.yaml --out out/fleet
  ride-estimation fleet recordings/ --vehicle my_truck.yaml --out out/fleet             (again: only what is new or failed)
  ride-estimation fleet recordings/ --vehicle my_truck.yaml --out out/fleet --table parquet --scheduler tcp://host:8786
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "folder", type=Path, metavar="FOLDER",
        help="searched for rosbag2 folders, .mcap, .db3 and .bag files; with --channels for measurement files too",
    )  # fmt: skip
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for the table, report.html and runs/NAME")
    add_replay_arguments(parser)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, metavar="N", help="processes (default: one per core)")
    parser.add_argument("--scheduler", metavar="tcp://HOST:PORT", help="Dask scheduler to use instead (extra 'fleet')")
    parser.add_argument("--table", choices=("csv", "parquet"), default="csv", help="format of the table (default csv)")
    parser.add_argument("--run-reports", action="store_true", help="write report.html for every run too (more time and disk)")
