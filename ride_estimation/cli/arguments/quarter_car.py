# Copyright 2026 ride_estimation contributors
"""Arguments of ``ride-estimation quarter-car``."""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "fit the six quarter-car models of document 002 with bounds, multi-start and a plausibility gate"
EXAMPLES = """\
  ride-estimation quarter-car run.csv --sprung-mass-kg 4500 --unsprung-mass-kg 550 --speed-m-per-s 4.2 --out out/quarter
  ride-estimation quarter-car run.csv --sprung-mass-kg 4500 --unsprung-mass-kg 550 --models 1 3 --spring-rate-n-per-m 230000

  ride-estimation quarter-car run.csv --sprung-mass-kg 2368 --unsprung-mass-kg 310 --speed-m-per-s 4.2 \\
    --wheelbase-m 3.8 --rear-sprung-mass-kg 2632 --rear-unsprung-mass-kg 310

run.csv has the columns time_s, road_m (or _mm), body_acceleration_m_per_s2 (or _g), axle_acceleration_m_per_s2 (or _g).
A half car also takes rear_body_acceleration and rear_axle_acceleration, above and on the rear axle, where they are there.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("table", type=Path, help="CSV: time_s, road_m, body_acceleration_m_per_s2, axle_acceleration_m_per_s2")
    parser.add_argument("--sprung-mass-kg", type=float, required=True, metavar="KG", help="above the suspension, at this wheel")
    parser.add_argument("--unsprung-mass-kg", type=float, required=True, metavar="KG", help="wheel and its share of the axle")
    parser.add_argument(
        "--speed-m-per-s", type=float, default=0.0, metavar="V", help="vehicle speed, to check that a wheel can follow the road"
    )
    parser.add_argument("--wheel-radius-m", type=float, default=0.5, metavar="R", help="for that check (default 0.5)")
    parser.add_argument("--noise-m-per-s2", type=float, default=0.02, metavar="A", help="of the accelerometers (default 0.02)")
    parser.add_argument("--spring-rate-n-per-m", type=float, metavar="K", help="known spring rate (leaf geometry), held")
    parser.add_argument("--roll-envelope", action="store_true", help="fit with the rolled envelope of the road")
    parser.add_argument(
        "--models", type=int, nargs="+", choices=range(1, 7), default=range(1, 7), metavar="N",
        help="which of the six (default all)",
    )
    parser.add_argument("--starts", type=int, default=4, metavar="N", help="random starts per model (default 4)")
    half = parser.add_argument_group("half car (all three and --speed-m-per-s: body with pitch and the rear axle as well)")
    half.add_argument("--wheelbase-m", type=float, metavar="L", help="the rear axle meets the road so much later")
    half.add_argument("--rear-sprung-mass-kg", type=float, metavar="KG", help="above the rear suspension, at one wheel")
    half.add_argument("--rear-unsprung-mass-kg", type=float, metavar="KG", help="rear wheel and its share of the axle")
    parser.add_argument("--out", type=Path, default=None, metavar="DIR", help="write quarter_car.json")
