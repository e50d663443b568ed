# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation compare``."""

from __future__ import annotations

import argparse

from ride_estimation.cli.arguments.replay import add_replay_arguments

HELP = "several runs side by side, with outliers; of two runs or two diagnoses what changed, in standard deviations"
EXAMPLES = """\
  ride-estimation compare out/run1 out/run2 out/run3 --out out/comparison            (folders of finished replays)
  ride-estimation compare out/before out/after --out out/change                      (two replays, or two diagnoses)
  ride-estimation compare run1.mcap run2.mcap --vehicle my_truck.yaml --out out/comparison
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("runs", nargs="+", metavar="RUN", help="output folder of a replay, or a recording (then with --vehicle)")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for the report, and for replays of recordings")
    parser.add_argument(
        "--format", nargs="+", choices=("html", "pdf", "png"), default=["html"], metavar="F",
        help="of the report: html, pdf, png (default html)",
    )  # fmt: skip
    add_replay_arguments(parser, vehicle_required=False)
