# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation export-model``."""

from __future__ import annotations

import argparse
from pathlib import Path

#: format -> ending of its file
FORMATS = {"fmi3": ".fmu", "fmi2": ".fmu", "modelica": ".mo", "adams": ".bus", "simscape": ".m", "table": ".csv"}

HELP = "write an identified element, a mount or a vehicle for other simulation programs (FMU, Modelica, Adams, Simscape, tables)"
EXAMPLES = """\
  ride-estimation export-model out/bushing/element.yaml --out bushing.fmu
  ride-estimation export-model out/nominal/vehicle_extended.yaml --mount front_left --format adams --out mount.bus
  ride-estimation export-model out/bushing/element.yaml --format table --frequencies 1 5 20 --amplitudes 2e-4 2e-3 --out map.csv

An FMU holds C source for model exchange and co-simulation, the binary for 64-bit Linux where a C compiler is at hand, and
resources/parameters.json with every value, its standard deviation and range. docs/export_model.md says what every format holds.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument("model", metavar="MODEL", help="element.yaml of identify, a vehicle file, or the name of a bundled one")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="file to write: .fmu, .mo, .bus, .m or .csv")
    parser.add_argument("--mount", default="", help="only this mount of the vehicle: deflection in, force out")
    parser.add_argument(
        "--format", choices=tuple(FORMATS), default="fmi3",
        help="fmi3, fmi2: C source; modelica: the laws as equations; adams: bushing property file of one mount; simscape: MATLAB "
        "script with lookup tables; table: stiffness and loss angle over frequency and amplitude (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--rate", type=float, default=1000.0, metavar="HZ",
        help="rate an FMU of a vehicle will be stepped at; sets the step of its integrator (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "--frequencies", nargs="+", type=float, default=[], metavar="HZ", help="of the tables (default: what the data showed)"
    )
    parser.add_argument(
        "--amplitudes", nargs="+", type=float, default=[], metavar="M",
        help="of the tables [m], about an axis [rad] (default: up to what the data showed)",
    )  # fmt: skip
    parser.add_argument("--source-only", action="store_true", help="no binary in an FMU, even where a C compiler is at hand")
