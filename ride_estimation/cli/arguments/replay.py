# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation replay``."""

from __future__ import annotations

import argparse

from ride_estimation.cli.arguments.parts import RUN_HELP, add_channels_argument, add_part_arguments

HELP = "estimate motion, loads, mount parameters and attachment forces from a recorded run"
EXAMPLES = """\
  ride-estimation replay bags/nominal/bag --vehicle truck_cab --out out/nominal
  ride-estimation replay run.mcap --vehicle my_truck.yaml --out out/run --slope 4 --daily-hours 6 --format html pdf
  ride-estimation replay run.mcap --vehicle my_truck.yaml --out out/run --without cab_rear_left   (a broken sensor)
"""
FORMATS = ("html", "pdf", "png", "none")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("recording", metavar="RUN", help=RUN_HELP)
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for result.json, signals.npz, report.html")
    add_replay_arguments(parser)
    parser.add_argument("--diagnosis", metavar="DIR", help="folder of a diagnosis of this run, to report its ladder of models")
    parser.add_argument(
        "--format", nargs="+", choices=FORMATS, default=["html"], metavar="F",
        help=f"of the report: {', '.join(FORMATS)} (default html; png writes one file per picture)",
    )  # fmt: skip
    parser.add_argument(
        "--mcap", action="store_true",
        help="write run.mcap too: inputs, what the node would have published live, and bounds; ride-estimation view shows it",
    )  # fmt: skip
    parser.add_argument("--no-report", action="store_true", help="write no report, as --format none")


def add_replay_arguments(parser: argparse.ArgumentParser, vehicle_required: bool = True) -> None:
    """Add the options that every command has that replays."""
    parser.add_argument(
        "--vehicle", required=vehicle_required, metavar="V.yaml", help="vehicle file, or the name of a bundled one"
    )
    parser.add_argument("--without", action="append", default=[], metavar="SENSOR", help="leave a sensor of the vehicle file out")
    add_channels_argument(parser)
    add_part_arguments(parser)
    add_estimation_arguments(parser)


def add_estimation_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how a run is estimated and judged, whichever run it is."""
    parser.add_argument("--rate", type=float, metavar="HZ", help="rate of the time base [Hz] (default: the fastest sensor)")
    parser.add_argument("--settings", metavar="P.yaml", help="parameter file of the node, to replay with what ran live")
    parser.add_argument(
        "--no-smoothing", "--no-hindsight", action="store_true", help="causal forces only, without the smoothed ones (faster)"
    )
    parser.add_argument("--salvage", action="store_true", help="use what is readable of a truncated or damaged file")
    parser.add_argument("--slope", type=float, metavar="K", help="S-N (Woehler) slope for pseudo-damage [-] (default 5)")
    parser.add_argument(
        "--daily-hours", type=float, default=8.0, metavar="H", help="hours a day of this vibration, for A(8) and VDV (default 8)"
    )
