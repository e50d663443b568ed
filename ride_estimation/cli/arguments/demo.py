# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation demo``."""

from __future__ import annotations

import argparse

HELP = "replay and diagnose the bundled recordings and compare what is found with the truth"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("--out", default="out/demo", metavar="DIR", help="folder for all results (default out/demo)")
    parser.add_argument("--no-diagnosis", action="store_true", help="only the estimation, without the diagnosis")
