# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation diagnose``."""

from __future__ import annotations

import argparse

from ride_estimation.cli.arguments.identify import add_reading_arguments
from ride_estimation.cli.arguments.parts import add_channels_argument, add_part_arguments

HELP = "find what the simulation of a recorded run gets wrong, name the cause, extend the model, measure the gain"
EXAMPLES = """\
  ride-estimation diagnose bags/hidden_friction/bag --vehicle truck_cab \\
      --validate bags/hidden_friction_validation/bag --out out/diagnosis
  ride-estimation diagnose bench.csv --out out/mount             (columns time_s, displacement_mm, force_kn of one mount)
  ride-estimation diagnose record.csv --oscillator V1,V2 --rate 610 --out out/oscillator
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "recording", metavar="RUN",
        help="rosbag2 folder, .mcap, .db3 or ROS 1 .bag file; or a bench record (.csv, .txt, .tsv, .npz, .mat, or a bag without "
        "--vehicle) of the displacement and force of one mount, or with --oscillator of the excitation and response of one mass",
    )
    parser.add_argument(
        "--vehicle", metavar="V.yaml", help="vehicle file, or the name of a bundled one; not used for a bench record"
    )
    parser.add_argument(
        "--validate", nargs="+", action="extend", default=[], metavar="RUN2",
        help="independent validation runs: they judge, and weigh causes that RUN cannot distinguish (nothing is fitted there)",
    )
    parser.add_argument(
        "--out", required=True, metavar="DIR", help="folder for diagnosis.json, vehicle_extended.yaml, report.html"
    )
    parser.add_argument("--band", nargs=2, type=float, metavar=("LOW", "HIGH"), help="analysis band [Hz] (default: 0.4 40)")
    parser.add_argument(
        "--oscillator", default="", metavar="INPUT,OUTPUT",
        help="RUN is a record of a driven oscillator: columns of excitation and response (any units)",
    )
    parser.add_argument(
        "--fit-range", nargs=2, type=float, metavar=("FROM", "TO"),
        help="seconds of an --oscillator record that are fitted (default: the first half); the rest chooses and judges",
    )
    add_channels_argument(parser)
    add_part_arguments(parser)
    parser.add_argument(
        "--quick", action="store_true", help="ask no perturbed copies of the run whether they give the same answer"
    )
    parser.add_argument(
        "--next-run", action="store_true",
        help="where a rival of a cause is alive, simulate with both which run separates them (minutes; see known_limits.md)",
    )  # fmt: skip
    parser.add_argument("--no-report", action="store_true", help="write no report.html")
    # --rate of this group is also the rate of the common time base of a vehicle run (default: the fastest sensor, 400 at most)
    add_reading_arguments(parser)
