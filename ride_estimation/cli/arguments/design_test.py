# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation design-test``."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.identification.bench.choices import JOUNCE_MODELS, LONGEST_S, MODELS, TESTS

HELP = "write drive files of bench tests, chosen for the wanted accuracy of each parameter of a model"
EXAMPLES = """\
  ride-estimation design-test --model kelvin_voigt --expect stiffness=2e5 damping=900 --stroke-mm 5 --out out/drive
  ride-estimation design-test --like out/bushing/identification.json --percent 2 --stroke-mm 10 --format mf4 --out out/drive
  ride-estimation design-test --model jounce_bumper --reference-mm 75 --out out/drive

The record that comes back (time, displacement, force) goes into: ride-estimation identify RECORD ... --validate V1 V2 V3
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument("--model", help=f"model to identify: {', '.join((*MODELS, JOUNCE_MODELS[0]))}")
    parser.add_argument("--expect", nargs="+", default=[], metavar="NAME=VALUE", help="expected parameters, SI, rough is enough")
    parser.add_argument("--like", type=Path, metavar="JSON", help="identification.json of a similar element")
    parser.add_argument("--percent", type=float, default=5.0, help="wanted standard deviation of each parameter (default 5 %%)")
    parser.add_argument(
        "--wanted", nargs="+", default=[], metavar="NAME=PERCENT", help="another standard deviation for single parameters"
    )
    parser.add_argument(
        "--tests", nargs="+", choices=TESTS, default=TESTS, metavar="TEST",
        help=f"tests to choose from (default all): {', '.join(TESTS)}",
    )
    parser.add_argument("--stroke-mm", type=float, default=10.0, help="largest displacement from rest (default 10)")
    parser.add_argument("--highest-hz", type=float, default=40.0, help="highest frequency (default 40)")
    parser.add_argument("--speed-m-per-s", type=float, default=1.0, help="largest speed of the machine (default 1)")
    parser.add_argument("--force-noise-n", type=float, default=5.0, help="noise of the load cell (default 5)")
    parser.add_argument("--longest-s", type=float, default=LONGEST_S, help=f"longest time of all tests (default {LONGEST_S:g})")
    parser.add_argument("--rate-hz", type=float, default=1000.0, help="sampling rate of the drive files (default 1000)")
    parser.add_argument("--reference-mm", type=float, help="travel of a jounce bumper at 9000 N")
    parser.add_argument("--static-curve", type=Path, metavar="CSV", help="travel_mm, force_n to read that travel off")
    parser.add_argument("--format", choices=("csv", "rpc", "mf4"), default="csv", help="kind of drive file (default csv)")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the drive files")
