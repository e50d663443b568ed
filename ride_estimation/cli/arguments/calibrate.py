# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation calibrate``."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.cli.arguments.parts import RUN_HELP, add_channels_argument, add_part_arguments

HELP = "noise, bias and orientation of the sensors at standstill, or all their errors from a drive, to a vehicle file"
EXAMPLES = """\
  ride-estimation calibrate bags/standing/bag --vehicle truck_cab --out truck_calibrated.yaml

Standstill: park, engine off, nobody in the cab, ten seconds or more. One standstill cannot distinguish a bias across gravity
from a mounting angle: up to 0.15 m/s^2 it is taken for bias, above for an angle. Heading of a sensor cannot be seen at rest.
--drive: a minute over a rough road with accelerometers on the body and at the base of every mount. Gain, misalignment,
position, delay and bias of every sensor are estimated together with stiffness and damping; in brackets what the drive does not
determine. Priors: `installation` of every sensor in the vehicle file. A drive that the model does not describe writes nothing.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("recording", metavar="RUN", help=f"recording of the standing vehicle, or of a drive: {RUN_HELP}")
    parser.add_argument("--vehicle", required=True, metavar="V.yaml", help="vehicle file, or the name of a bundled one")
    parser.add_argument("--drive", action="store_true", help="RUN is a drive: gain, misalignment, position, delay and bias")
    add_channels_argument(parser)
    add_part_arguments(parser)
    parser.add_argument("--out", type=Path, metavar="V2.yaml", help="vehicle file to write; without it the table is only printed")
