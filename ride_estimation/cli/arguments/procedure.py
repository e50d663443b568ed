# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation procedure``."""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.cli.arguments.run_procedures import add_run_procedures

HELP = "classical procedures: loop, lift, weighing, drop test, leaf spring, velocity, seat, spectrum, modes, damping, road, ..."
EXAMPLES = """\
  ride-estimation procedure axle-loads --weight-n 120000 --cg-from-rear-m 2.1 --wheelbase-m 3.8
  ride-estimation procedure leaf-spring --span-m 1.4 --width-m 0.08 --thickness-m 0.012 --leaves 6
  ride-estimation procedure modes --vehicle truck_cab --measured bounce=2.1 lateral=5.5 fore-aft=6.8
  ride-estimation procedure loop loop_1hz.csv loop_10hz.csv --frequency 1 10      (columns time_s, displacement_mm, force_n)

'ride-estimation procedure PROCEDURE --help' says which columns and numbers a procedure needs.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add one sub-command per procedure."""
    kinds = parser.add_subparsers(dest="procedure", required=True, metavar="PROCEDURE", help="one of")

    loop = kinds.add_parser("loop", help="stiffness and equivalent damping from force-displacement loops")
    loop.add_argument("files", nargs="+", type=Path, help="CSV: time_s, displacement_mm, force_n, one file per frequency")
    loop.add_argument("--frequency", nargs="+", type=float, required=True, help="test frequency of each file [Hz]")

    lift = kinds.add_parser("tyre-lift", help="tyre stiffness from lifting an axle")
    lift.add_argument("file", type=Path, help="CSV: rise_mm and unloading_n, or lift_n with both arms")
    lift.add_argument("--lift-arm-m", type=float, help="distance of the lifting force from the other axle")
    lift.add_argument("--axle-arm-m", type=float, help="distance of the lifted axle from the other axle")
    lift.add_argument("--tyres", type=int, default=2, help="tyres on the axle (default 2)")

    axles = kinds.add_parser("axle-loads", help="static axle loads from weight and CG")
    axles.add_argument("--weight-n", type=float, required=True)
    axles.add_argument("--cg-from-rear-m", type=float, required=True)
    axles.add_argument("--wheelbase-m", type=float, required=True)

    drop = kinds.add_parser("drop-test", help="damping from a free decay")
    drop.add_argument("file", type=Path, help="CSV: time_s and motion_m or acceleration_m_per_s2, resting at zero")
    drop.add_argument("--stiffness-n-per-m", type=float, required=True, help="stiffness at the spring")
    drop.add_argument("--pivot-inertia-kg-m2", type=float, required=True, help="inertia about the pivot")
    drop.add_argument("--arm-m", type=float, required=True, help="distance of the spring from the pivot")

    leaf = kinds.add_parser("leaf-spring", help="spring rate from geometry or from a load test")
    leaf.add_argument("--span-m", type=float, help="distance of the eyes")
    leaf.add_argument("--width-m", type=float, help="width of a leaf")
    leaf.add_argument("--thickness-m", type=float, help="thickness of a leaf")
    leaf.add_argument("--leaves", type=int, default=1, help="number of leaves (default 1)")
    leaf.add_argument("--force-n", type=float, help="load of a test instead of the geometry")
    leaf.add_argument("--deflection-m", type=float, help="deflection under that load")

    velocity = kinds.add_parser("velocity", help="velocity from a measured acceleration (high-passed) or displacement (smoothed)")
    velocity.add_argument("file", type=Path, help="CSV: time_s and the column")
    velocity.add_argument("--column", required=True, help="column without its unit suffix")
    velocity.add_argument("--of-displacement", action="store_true", help="the column is a displacement: it is differentiated")
    velocity.add_argument("--kernel-ms", type=float, default=5.0, help="Gauss kernel before that, standard deviation (default 5)")
    velocity.add_argument("--corner-hz", type=float, default=0.3, help="corner of the high-pass (default 0.3)")
    velocity.add_argument("--noise-m-per-s2", type=float, default=0.02, help="noise of the accelerometer (default 0.02)")
    velocity.add_argument("--out", type=Path, required=True, metavar="CSV", help="table of time_s and velocity_m_per_s")

    pad = kinds.add_parser("seat", help="seat pad: separation of the occupant, signal to noise, exposure")
    pad.add_argument("file", type=Path, help="CSV: time_s and the column, gravity removed, up positive")
    pad.add_argument("--column", required=True, help="vertical acceleration, without its unit suffix")
    pad.add_argument("--standstill", type=Path, default=None, help="CSV with the same column, vehicle at rest, engine off")

    peaks = kinds.add_parser("peaks", help="distinguish peaks of modes from spectral lines of the input")
    peaks.add_argument("file", type=Path, help="CSV: time_s, input and output columns")
    peaks.add_argument("--input", required=True, help="input column without its unit suffix (axle, chassis)")
    peaks.add_argument("--output", required=True, help="output column without its unit suffix (cab, seat)")
    peaks.add_argument("--block", type=int, required=True, help="samples per block")
    peaks.add_argument("--vehicle", metavar="V.yaml", help="vehicle file, or the name of a bundled one, whose modes count")
    peaks.add_argument("--modes-hz", type=float, nargs="+", default=[], help="natural frequencies instead of a vehicle file")

    spectrum = kinds.add_parser("spectrum", help="Welch spectrum with its true resolution")
    spectrum.add_argument("file", type=Path, help="CSV: time_s and the column")
    spectrum.add_argument("--column", required=True, help="column without its unit suffix")
    spectrum.add_argument("--block", type=int, required=True, help="samples per block")
    spectrum.add_argument("--claimed-resolution-hz", type=float, default=None, help="refused unless true")

    modes = kinds.add_parser("modes", help="modes of a vehicle file; mount stiffness from measured modes of the cab")
    modes.add_argument("--vehicle", metavar="V.yaml", required=True, help="vehicle file, or the name of a bundled one")
    modes.add_argument(
        "--measured", nargs="+", default=[], metavar="MODE=HZ", help="fit the stiffness to these, for example bounce=2.6 roll=2.4"
    )
    modes.add_argument("--front-rear", action="store_true", help="factors of their own for front and rear mounts")
    modes.add_argument("--closed-form", action="store_true", help="also the closed form of document 000, and where it fails")

    modes.add_argument("--matrices", type=Path, metavar="JSON", help="write A and B, states and inputs named")

    limits = kinds.add_parser("voigt-limits", help="error of a spring and damper tuned at one frequency at the other resonances")
    limits.add_argument("--vehicle", metavar="V.yaml", required=True, help="vehicle file, or the name of a bundled one")
    limits.add_argument("--tuned-hz", type=float, required=True, help="frequency at which spring and damper are taken")
    limits.add_argument("--amplitude-mm", type=float, default=1.0, help="deflection amplitude (default 1)")
    add_run_procedures(kinds)
