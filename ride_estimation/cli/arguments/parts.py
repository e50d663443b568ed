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


def add_time_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--time``, ``--time-unit`` and ``--rate`` of a table."""
    parser.add_argument("--time", default="", metavar="CHANNEL", help="column of the time, where its name does not say it")
    parser.add_argument("--time-unit", default="", metavar="UNIT", help="of that column: s, ms, us, ns")
    parser.add_argument("--rate", type=float, default=0.0, metavar="HZ", help="samples per second of a table without time")


def add_part_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--from``, ``--to`` and ``--events``."""
    parser.add_argument(
        "--from", dest="from_s", metavar="S|MARKER",
        help="use the run from here on: seconds since its first stamp, or a marker (NAME, or NAME#2 for the second)",
    )  # fmt: skip
    parser.add_argument("--to", dest="to_s", metavar="S|MARKER", help="use the run up to here; a marker counts after the begin")
    parser.add_argument(
        "--events", default="", metavar="CSV",
        help="table of markers (time, event); default: text topics or columns of the run, and RUN.events.csv beside it",
    )  # fmt: skip
