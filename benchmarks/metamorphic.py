# Copyright 2026 ride_estimation contributors
"""Tell recorded runs in other ways (later, in another order, in other axes, heavier, noisier) and see what moves.

Where nothing may move estimates stay within 1e-6 of their standard deviation; where noise differs, within it; a verdict stays.

    python benchmarks/metamorphic.py --estimator 0 1 2
    python benchmarks/metamorphic.py --diagnosis quarter:coulomb_friction:3 cab:none:1 --foreign FOLDER --only cab_05 quarter_18
    python benchmarks/metamorphic.py --perturbed --worlds 20 --first 3

``--perturbed`` repeats the whole diagnosis on what an engineer would call the same runs: 1 % more noise, 10 % shorter, a spare
sensor less, another time base. ``--worlds`` draws quarter cars with one hidden effect each.
"""

from __future__ import annotations

import argparse
import pathlib
import sys
import time
from collections.abc import Iterator, Sequence

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test"), str(ROOT / "test" / "metamorphic"), str(ROOT / "benchmarks")]

from estimates import changed_run, continued_run, estimates, movement  # noqa: E402
from judging import make_measurement  # noqa: E402
from relations import Relation, perturbations, relations  # noqa: E402
from verdicts import as_recording, diagnosed  # noqa: E402
from worlds.adapters import believed_vehicle, plane_inputs, product_inputs, recording  # noqa: E402
from worlds.plane_scenario import CAUSES as QUARTER_CAUSES  # noqa: E402
from worlds.plane_scenario import quarter_car_case  # noqa: E402
from worlds.scenario import make_scenario  # noqa: E402

from ride_estimation.diagnosis.answer.stability import spare_sensor  # noqa: E402
from ride_estimation.diagnosis.model.plant import build_plant  # noqa: E402
from ride_estimation.estimation.offline import run_offline  # noqa: E402
from ride_estimation.estimation.pipeline import Pipeline  # noqa: E402
from ride_estimation.io.bags import read_recording  # noqa: E402
from ride_estimation.io.vehicle_file import load_vehicle  # noqa: E402
from ride_estimation.signals.recording import Recording  # noqa: E402
from ride_estimation.vehicles.vehicle import Vehicle  # noqa: E402

#: time the filters need after a start [s]
SETTLED = 5.0


def estimator_rows(name: str, vehicle: Vehicle, run: Recording) -> Iterator[str]:
    """Yield one line per relation: movement in standard deviations."""
    before = estimates(run_offline(run, Pipeline(vehicle), smoothing=False), vehicle)
    for relation in relations():
        after = changed_run(vehicle, run, relation)
        yield _row(name, relation.name, relation.exact, movement(before, after, 0.0 if relation.exact else SETTLED))
    yield _row(name, "cut in two and continued", False, movement(before, continued_run(vehicle, run), SETTLED))


def _row(name: str, relation: str, exact: bool, moved: object) -> str:
    values = vars(moved)
    good = max(values["largest"], values["parameters"]) < 1e-6 if exact else max(values["rms"], values["parameters"]) < 1.0
    return (
        f"{'ok' if good else '--'} | {name} | {relation} | {values['largest']:.1e} | {values['rms']:.1e} | "
        f"{values['parameters']:.1e} | {values['spread']:.1e} | {values['statuses']}"
    )


def own_case(text: str) -> tuple[Vehicle, list[Recording]]:
    """Return the vehicle and the runs of ``quarter|cab:CAUSE:SEED``."""
    plant, cause, seed = text.split(":")
    if plant == "quarter":
        vehicle, run, others = plane_inputs(quarter_car_case(cause, int(seed)))
    else:
        vehicle, run, others = product_inputs(make_scenario((cause,), int(seed)))
    return vehicle, [as_recording(r) for r in (run, *others)]


def foreign_case(folder: pathlib.Path) -> tuple[Vehicle, list[Recording]]:
    """Return the vehicle and both runs of a folder with ``vehicle.yaml``, ``run`` and ``run2``."""
    vehicle = load_vehicle(folder / "vehicle.yaml")
    return vehicle, [read_recording(folder / name, vehicle) for name in ("run", "run2")]


def verdict_rows(name: str, vehicle: Vehicle, runs: Sequence[Recording], perturbed: bool) -> Iterator[tuple[bool, bool, str]]:
    """Yield per relation whether the verdict and whether the whole answer stayed, and a line."""
    first = diagnosed(vehicle, runs, Relation("none", True))
    spare = spare_sensor(build_plant(vehicle, dict.fromkeys(runs[0].channels, 3)), {place for _, place, _ in first.causes})
    for relation in perturbations(spare) if perturbed else relations():
        began = time.process_time()
        other = diagnosed(vehicle, runs, relation)
        same, whole = other.verdict == first.verdict, other == first
        words = "as before" if whole else f"{first} -> {other}"
        used = time.process_time() - began
        yield same, whole, f"{'ok' if same else '--'} | {name} | {relation.name} | {words} | {used:.0f} s"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--estimator", nargs="*", type=int, default=[], metavar="SEED", help="cabs of the worlds")
    parser.add_argument("--duration", type=float, default=25.0, help="length of their runs [s]")
    parser.add_argument("--diagnosis", nargs="*", default=[], metavar="PLANT:CAUSE:SEED", help="plant: quarter or cab")
    parser.add_argument("--foreign", type=pathlib.Path, help="folder of recordings by another program")
    parser.add_argument("--only", nargs="*", default=[], help="names in that folder")
    parser.add_argument("--perturbed", action="store_true", help="diagnose perturbed copies instead of runs told in other ways")
    parser.add_argument("--worlds", type=int, default=0, help="quarter cars, the causes in turn")
    parser.add_argument("--first", type=int, default=0, help="seed of the first of them")
    options = parser.parse_args()
    drawn = [f"quarter:{QUARTER_CAUSES[i % len(QUARTER_CAUSES)]}:{options.first + i}" for i in range(options.worlds)]
    foreign = [] if options.foreign is None else [p.parent for p in sorted(options.foreign.glob("*/vehicle.yaml"))]
    foreign = [p for p in foreign if not options.only or p.name in options.only]
    print("estimator: run | relation | largest, rms, parameters [std] | change of std | changed status")
    for seed in options.estimator:
        data = make_measurement(seed, duration=options.duration)
        for line in estimator_rows(f"world {seed}", believed_vehicle(data, seed=seed), recording(data)):
            print(line, flush=True)
    for folder in foreign:
        vehicle, runs = foreign_case(folder)
        for line in estimator_rows(folder.name, vehicle, runs[0]):
            print(line, flush=True)
    print("diagnosis: run | relation | answer")
    same: list[tuple[bool, bool]] = []
    makers = [(text, own_case, text) for text in (*options.diagnosis, *drawn)] + [(p.name, foreign_case, p) for p in foreign]
    for name, made, where in makers:
        for verdict, whole, line in verdict_rows(name, *made(where), options.perturbed):
            same.append((verdict, whole))
            print(line, flush=True)
    if same:
        verdicts, answers = np.mean(same, axis=0)
        print(
            f"{len(same)} repeats: verdict unchanged in {100.0 * verdicts:.1f} %, verdict and causes in {100.0 * answers:.1f} %"
        )


if __name__ == "__main__":
    main()
