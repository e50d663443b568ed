# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation export-model``."""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "write an identified element, a mount or a vehicle as an FMU for other simulation programs"
EXAMPLES = """\
  ride-estimation export-model out/bushing/element.yaml --out bushing.fmu
  ride-estimation export-model out/nominal/vehicle_extended.yaml --mount front_left --out mount.fmu
  ride-estimation export-model truck_cab --fmi 2 --out truck_cab.fmu

The unit holds C source for model exchange and co-simulation, the binary for 64-bit Linux where a C compiler is at hand, and
resources/parameters.json with every value, its standard deviation and range. docs/export_model.md says what goes in and out.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument("model", metavar="MODEL", help="element.yaml of identify, a vehicle file, or the name of a bundled one")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.fmu", help="file to write")
    parser.add_argument("--mount", default="", help="only this mount of the vehicle: deflection in, force out")
    parser.add_argument("--fmi", choices=("3", "2"), default="3", help="version of the interface (default: %(default)s)")
    parser.add_argument(
        "--rate", type=float, default=1000.0, metavar="HZ",
        help="rate a vehicle will be stepped at; sets the step of its integrator (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument("--source-only", action="store_true", help="no binary, even where a C compiler is at hand")
