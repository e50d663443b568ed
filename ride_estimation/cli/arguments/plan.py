# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation plan``."""

from __future__ import annotations

import argparse

HELP = "predict which parameters a sensor layout can identify, and which additional sensor helps most"
EXAMPLES = """\
  ride-estimation plan --vehicle truck_cab
  ride-estimation plan --vehicle truck_cab --unknown-mass --road B --speed 22 --duration 300       (a motorway, cab not weighed)
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "--vehicle", required=True, metavar="V.yaml", help="vehicle file with its sensors, or the name of a bundled one"
    )
    parser.add_argument("--road", default="C", choices=tuple("ABCDEFGH"), help="ISO 8608 class (default C)")
    parser.add_argument("--speed", default=15.0, type=float, help="vehicle speed [m/s] (default 15)")
    parser.add_argument("--duration", default=60.0, type=float, help="usable driving [s] (default 60)")
    parser.add_argument("--rate", default=200.0, type=float, help="sample rate [Hz] (default 200)")
    parser.add_argument("--rigid-frame", action="store_true", help="assume that the frame does not twist")
    parser.add_argument("--bounds-only", action="store_true", help="theoretical bounds only, without simulated drives (fast)")
    parser.add_argument("--unknown-mass", action="store_true", help="ignore the force references of the vehicle file")
