# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation simulate``."""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "simulate a field run from a scenario file: writes a bag and its truth"
EXAMPLES = """\
  ride-estimation simulate bags/standing/recipe.yaml --out out/standing

The bag is read by every other command; truth.json and truth.npz beside it hold what the estimates should find.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "scenario", type=Path, metavar="SCENARIO.yaml", help="scenario file; config/scenarios/every_key.yaml explains all keys"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for bag, recipe and truth")
    parser.add_argument(
        "--vehicle", metavar="V.yaml", help="vehicle file, or the name of a bundled one, instead of the one the scenario names"
    )
