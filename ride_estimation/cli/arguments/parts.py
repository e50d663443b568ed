# Copyright 2026 ride_estimation contributors
"""The options ``--from`` and ``--to`` of every command that reads a run."""

from __future__ import annotations

import argparse


def add_part_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--from`` and ``--to``."""
    parser.add_argument(
        "--from", type=float, dest="from_s", metavar="S", help="use the run from this time on [s since its first stamp]"
    )
    parser.add_argument(
        "--to", type=float, dest="to_s", metavar="S", help="use the run up to this time [s since its first stamp]"
    )
