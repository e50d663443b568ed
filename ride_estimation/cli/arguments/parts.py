# Copyright 2026 ride_estimation contributors
"""The options of every command that reads a run: which channel is which sensor, and the part that is used."""

from __future__ import annotations

import argparse

#: what a run may be
RUN_HELP = "rosbag2 folder, .mcap, .db3 or ROS 1 .bag file, or a measurement file (MDF4, TDMS, RPC III, LabVIEW, CSV, Parquet)"


def add_channels_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--channels``."""
    parser.add_argument(
        "--channels", default="", metavar="MAP.yaml",
        help="channel map of a measurement file; 'map' proposes one (default: names as an export writes them)",
    )  # fmt: skip


def add_part_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--from`` and ``--to``."""
    parser.add_argument(
        "--from", type=float, dest="from_s", metavar="S", help="use the run from this time on [s since its first stamp]"
    )
    parser.add_argument(
        "--to", type=float, dest="to_s", metavar="S", help="use the run up to this time [s since its first stamp]"
    )
