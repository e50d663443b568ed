# Copyright 2026 ride_estimation contributors
"""``ride-estimation plan``: what a sensor set will be able to tell, before the truck is instrumented."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from ride_estimation.errors import InputDataError
from ride_estimation.identification.fisher import Excitation
from ride_estimation.identification.sensor_plan import plan
from ride_estimation.io.vehicle_file import load_vehicle

HELP = "tell which parameters a vehicle file's sensors can identify and which addition would help most"

#: G_d(n0) at the geometric middle of each ISO 8608 class [m^3]
ROAD_CLASSES = {name: 16e-6 * 4.0**i for i, name in enumerate("ABCDEFGH")}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("--vehicle", required=True, type=Path, metavar="V.yaml", help="vehicle file with its sensors")
    parser.add_argument("--road", default="C", choices=sorted(ROAD_CLASSES), help="ISO 8608 class (default C)")
    parser.add_argument("--speed", default=15.0, type=float, help="vehicle speed [m/s] (default 15)")
    parser.add_argument("--duration", default=60.0, type=float, help="usable driving [s] (default 60)")
    parser.add_argument("--rate", default=200.0, type=float, help="sample rate [Hz] (default 200)")
    parser.add_argument("--rigid-frame", action="store_true", help="assume that the frame does not twist")
    parser.add_argument("--unknown-mass", action="store_true", help="ignore the force references of the vehicle file")


def run(options: argparse.Namespace) -> int:
    """Print what is identifiable, what is not and why, and the ranked additions."""
    vehicle = load_vehicle(options.vehicle)
    if not (options.speed > 0.0 and options.duration > 0.0 and options.rate > 0.0):
        raise InputDataError("--speed, --duration and --rate must be positive")
    excitation = Excitation(
        roughness=ROAD_CLASSES[options.road],
        speed=options.speed,
        duration_s=options.duration,
        rate_hz=options.rate,
        twist_share=0.0 if options.rigid_frame else 0.3,
    )
    result = plan(vehicle, excitation, known=() if options.unknown_mass else None)
    present = result.present
    print(
        f"{vehicle.name}: class {options.road} road, {options.speed:g} m/s, {options.duration:g} s at {options.rate:g} Hz, "
        f"{'rigid' if options.rigid_frame else 'twisting'} frame"
    )
    print(f"known beforehand: {', '.join(result.known) or 'nothing (forces are then ratios only)'}")
    print(f"rank {present.rank} of {len(present.names)} parameters")
    print(f"\n{'parameter':<34}{'best relative std (Cramer-Rao, perfect model)':>46}")
    for name, std in zip(present.names, present.relative_std):
        print(f"{name:<34}{f'{100 * std:.2g} %' if math.isfinite(std) else 'not identifiable':>46}")
    for words in present.null_directions:
        print(f"not identifiable: {words}")
    print("\nadditions, best first:")
    for option in result.options:
        median = f"{100 * option.median_relative_std:.2g} %" if math.isfinite(option.median_relative_std) else "none"
        gained = f"; gains {len(option.gained)} parameters" if option.gained else ""
        print(f"  {option.name}: {option.identifiable} known or identifiable, median {median}{gained}")
    return 0
