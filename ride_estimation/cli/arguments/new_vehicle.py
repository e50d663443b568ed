# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation new-vehicle``."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.io.vehicle_template import Template

HELP = "write a vehicle file to start from, for a number of mounts and sensors"
EXAMPLES = """\
  ride-estimation new-vehicle --mounts 4 --sensors 4 --out my_vehicle.yaml
  ride-estimation new-vehicle --mounts 3 --sensors 3 --mass-kg 480 --name tractor --out tractor.yaml
  ride-estimation new-vehicle --parts cab_parts.csv --about 0.9 0 0.4 --out cab.yaml
  ride-estimation new-vehicle --out my_vehicle.yaml                 (on a terminal: asks for what is not given)
"""


_DEFAULT = Template()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("--out", required=True, metavar="V.yaml", help="vehicle file to write; an existing file is not replaced")
    parser.add_argument("--mounts", type=int, metavar="N", help=f"number of mounts (default {_DEFAULT.mounts})")
    parser.add_argument(
        "--sensors", type=int, metavar="N", help=f"number of three-axis accelerometers on the body (default {_DEFAULT.sensors})"
    )
    parser.add_argument("--no-base-sensors", action="store_true", help="no accelerometers at the bases of the mounts")
    parser.add_argument("--mass-kg", type=float, metavar="M", help=f"mass of the body [kg] (default {_DEFAULT.mass:g})")
    parser.add_argument(
        "--parts", type=Path, metavar="CSV",
        help="mass, CG and inertia from parts: mass_kg, x_m, y_m, z_m, ixx_kg_m2, iyy_kg_m2, izz_kg_m2 (or _kg_mm2), ixy, ...",
    )  # fmt: skip
    parser.add_argument(
        "--about", nargs=3, type=float, metavar=("X", "Y", "Z"), help="print the inertia of the parts about this point too [m]"
    )
    parser.add_argument("--name", metavar="NAME", help=f"name of the vehicle (default {_DEFAULT.name})")
    parser.add_argument("--body", default=_DEFAULT.body, metavar="NAME", help=f"name of the body (default {_DEFAULT.body})")
