# Copyright 2026 ride_estimation contributors
"""Arguments of the procedures on recorded runs: damping against frequency, operating range, road class, force of an element."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def add_run_procedures(kinds: Any) -> None:
    """Add the sub-commands to those of ``procedure``."""
    damping = kinds.add_parser("damping", help="damping against frequency and its band fit from accelerations of body and base")
    damping.add_argument("file", type=Path, help="CSV: time_s and the columns of body and base (m/s^2, along one axis)")
    damping.add_argument("--body", required=True, help="column of the body, without its unit suffix")
    damping.add_argument("--base", required=True, help="column of the base, without its unit suffix")
    damping.add_argument("--mass-kg", type=float, required=True, help="mass on the mounts")
    damping.add_argument("--stiffness-n-per-m", type=float, required=True, help="stiffness of all mounts at rest")
    damping.add_argument("--block", type=int, required=True, help="samples per block")
    damping.add_argument("--range-hz", nargs=2, type=float, default=(0.5, 10.0), metavar=("FROM", "TO"), help="default 0.5 to 10")
    damping.add_argument("--out", type=Path, metavar="CSV", help="table of damping and standard deviation by frequency")

    hull = kinds.add_parser("operating-range", help="travel and speed a bumper works in, and whether a programme covers it")
    hull.add_argument("files", nargs="+", type=Path, help="CSV: time_s, travel_mm (positive in compression, zero at contact)")
    hull.add_argument("--margin", type=float, help="excess of travel (default 0.1)")
    hull.add_argument("--programme", nargs="+", type=Path, default=[], metavar="CSV", help="drive files that should cover it")
    hull.add_argument("--out", type=Path, metavar="CSV", help="corners of the range")

    road = kinds.add_parser("road", help="ISO 8608 class, roughness and waviness of a measured road, and where long waves stand")
    road.add_argument("file", type=Path, help="CSV: distance_m (or time_s with --speed-m-per-s) and the column")
    road.add_argument("--column", default="height", help="height of the road, without its unit suffix (default height)")
    road.add_argument("--speed-m-per-s", type=float, help="constant speed of a recording over time")
    road.add_argument("--frequency-hz", type=float, nargs="+", default=[], metavar="HZ", help="modes the waves may excite")

    force = kinds.add_parser("force", help="force of an element on a recorded deflection, stepped as another program would")
    force.add_argument("file", type=Path, help="CSV: time_s, displacement_mm (extension positive); force_n if measured")
    force.add_argument("--element", type=Path, required=True, metavar="YAML", help="element.yaml of identify")
    force.add_argument("--out", type=Path, required=True, metavar="CSV", help="table of time_s and force_n (tension)")
    force.add_argument("--explicit-step-s", type=float, metavar="H", help="refuse a step an explicit Euler solver cannot take")
