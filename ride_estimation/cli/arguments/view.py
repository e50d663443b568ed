# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation view``."""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "open the report of a replay, and serve its run.mcap to Lichtblick or Foxglove on this machine"
EXAMPLES = """\
  ride-estimation replay run.mcap --vehicle my_truck.yaml --out out/run --mcap
  ride-estimation view out/run                                       (ends with Ctrl-C)
  ride-estimation view out/run --viewer http://localhost:9090        (Lichtblick somewhere else)
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("folder", type=Path, metavar="OUT", help="folder of a replay")
    parser.add_argument(
        "--viewer", default="http://localhost:8080", metavar="URL", help="where Lichtblick runs (default http://localhost:8080)"
    )
    parser.add_argument("--port", type=int, default=0, metavar="N", help="port to serve at (default: a free one)")
    parser.add_argument("--no-browser", action="store_true", help="print the links and open nothing")
