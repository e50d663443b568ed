# Copyright 2026 ride_estimation contributors
"""Voigt against the damping filter of document 000 on two truths: fitted on one class C run, scored on unseen C, B and D roads.

Run: ``python benchmarks/voigt_comparison.py [--seconds 60]``. The quarter car that makes the runs is the independent one of
``test/worlds`` (one relaxing cell and a chain of slipping elements for the rubber), noise 0.02 m/s^2 on body and axle.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "test"))

from worlds import laws  # noqa: E402
from worlds.quarter_car import (  # noqa: E402
    QuarterCar,
    drive_quarter_car,
    measure_quarter_car,
    one_mass_yaml,
    road_height,
)
from worlds.roads import Road  # noqa: E402

from ride_estimation.cli.compare_models import compare  # noqa: E402
from ride_estimation.identification.model_comparison import MeasuredRun, fit_candidates  # noqa: E402
from ride_estimation.io.vehicle_file import load_vehicle  # noqa: E402
from ride_estimation.signals.recording import UniformRun  # noqa: E402

RATE, STEP, NOISE, SPEED = 200.0, 1e-3, 0.02, 10.0
#: name, Gd(n0) [m^3], seed; B has half and D double the amplitude of C
RUNS = (("train C", 256e-6, 1), ("C", 256e-6, 2), ("B", 64e-6, 3), ("D", 1024e-6, 4))
FRICTION_PER_KG = 0.12  # N/kg


def truths() -> dict[str, QuarterCar]:
    """Return the two plants."""
    plain = QuarterCar()
    friction = FRICTION_PER_KG * plain.sprung
    rubber = (
        (laws.MANY_CELLS, (50.0 / 156.0 * plain.stiffness, 0.04, 0.04, 1.0, 0.0)),
        (laws.JENKINS, (friction / 0.75e-3, friction, 8.0, 20.0)),
    )
    return {"plain Voigt": plain, "rubber": dataclasses.replace(plain, laws=rubber)}


def record(car: QuarterCar, name: str, roughness: float, seed: int, seconds: float) -> UniformRun:
    """Drive one road and measure."""
    road = dataclasses.replace(Road(), roughness=roughness, speed=SPEED)
    height, rate = road_height(road, seconds, STEP, seed)
    data = measure_quarter_car(drive_quarter_car(car, height, rate, STEP), RATE, seed, NOISE)
    valid = np.ones(len(data["time"]), dtype=bool)
    return UniformRun(name, RATE, 0, {n: data[n] for n in ("body", "axle")}, {n: valid for n in ("body", "axle")})


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Voigt against the damping filter on held-out roads")
    parser.add_argument("--seconds", type=float, default=60.0)
    seconds = parser.parse_args().seconds
    print(f"error in % of the signal's standard deviation; {seconds:g} s a run; spectrum-r, damage ratio (m = 5) on the unseen C")
    print(f"{'truth':<13}{'model':<28}{'train':>8}{'C':>8}{'B':>8}{'D':>8}{'spectrum-r':>12}{'damage':>9}  bounds")
    for truth, car in truths().items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "quarter.yaml"
            path.write_text(one_mass_yaml(car, NOISE), encoding="utf-8")
            vehicle = load_vehicle(path)
        runs = [MeasuredRun(vehicle, record(car, name, roughness, seed, seconds)) for name, roughness, seed in RUNS]
        for model in compare(vehicle, runs, fit_candidates(vehicle, runs[0]))["models"]:
            scores = model["scores"]
            errors = "".join(f"{s['rmse_percent']:>8.1f}" for s in scores)
            damage = scores[1]["damage_ratio"]
            ratio = "-" if damage is None else f"{damage:.2f}"
            bounds = ", ".join(model["on_bounds"])
            print(f"{truth:<13}{model['name']:<28}{errors}{scores[1]['spectrum_r']:>12.4f}{ratio:>9}  {bounds}", flush=True)


if __name__ == "__main__":
    main()
