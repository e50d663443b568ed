# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation compare-models``."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.cli.arguments.parts import RUN_HELP, add_channels_argument, add_part_arguments

HELP = "compare Voigt, damping filter, Maxwell and friction mounts on one run and score them on unseen runs"
EXAMPLES = """\
  ride-estimation compare-models bags/nominal/bag --vehicle truck_cab --validate bags/rough_with_bumps/bag --out out/models
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("run", type=Path, metavar="RUN", help=f"run the models are fitted to: {RUN_HELP}")
    parser.add_argument("--vehicle", required=True, metavar="V.yaml", help="vehicle file, or the name of a bundled one")
    parser.add_argument("--validate", nargs="+", type=Path, default=[], metavar="RUN2", help="runs not used for fitting")
    add_channels_argument(parser)
    add_part_arguments(parser)
    parser.add_argument(
        "--literature", action="store_true", help="also Zener, two Maxwell cells, fractional and Bouc-Wen (takes longer)"
    )
    parser.add_argument("--out", type=Path, default=None, metavar="DIR", help="write comparison.json, spectra.csv, report.html")
