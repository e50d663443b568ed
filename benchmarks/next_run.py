# Copyright 2026 ride_estimation contributors
"""Does the next run that a diagnosis names decide between rivals? Worlds with hidden laws whose first run leaves a rival alive.

Quarter cars integrated here with laws of forms the library does not have, small enough that a rival of the named cause stays
alive after a first run. The run that is named is driven in the same world, and diagnosed with the first one as validation run.
It decides where the right cause is then named and the odds of the other of the two are below one to four, the 80 % from which on
a run is recommended. The same run once more, with other noise, is driven for comparison. Worlds where the right cause is neither
of the two are counted apart: no run decides between two wrong ones.

Run: ``python benchmarks/next_run.py [--seeds N] [--first SEED]``
"""

from __future__ import annotations

import argparse
import pathlib
import sys
import time

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "test"))

from diagnosis_runs import FINE, RATE_HZ, hiding_law, quarter_car, quarter_car_run, ridden

from ride_estimation.diagnosis.answer.next_run import candidate_runs
from ride_estimation.diagnosis.answer.result import DECIDES, Diagnosis, NextRun
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Vehicle

NOISE, SECONDS = 0.02, 30.0
#: odds of a rival below which it is beaten
BEATEN = 0.25
#: form of the hidden law, its cause, and sizes that leave rivals alive
WORLDS = [
    ("hollow_rubber", "stiffness_nonlinearity", (0.03, 0.06, 0.1)),
    ("foam_both_sides", "bump_stop", (0.02, 0.05)),
    ("relief_valve", "damping_nonlinearity", (0.06, 0.08, 0.12)),
    ("jenkins_chain", "coulomb_friction", (0.04, 0.06, 0.1)),
    ("fractional", "viscoelasticity", (0.15, 0.25, 0.4)),
    ("soft_play", "backlash", (0.25, 0.4)),
]


def driven(car: Vehicle, run: UniformRun, words: str, form: str, size: float, seed: int) -> UniformRun:
    """Drive a candidate run, named in words, in the world of a run."""
    plant = build_plant(car, {"body": 3, "base": 3}, 0.5, 0.7)
    data = dict(candidate_runs(plant, measurement(plant, run)))[words]
    column = next(i for i, s in enumerate(plant.inputs) if s.component == 2)
    moving = data.inputs[:, column] - data.inputs[:, column].mean()
    spectrum, frequency = np.fft.rfft(moving), np.fft.rfftfreq(len(moving), 1.0 / RATE_HZ)
    spectrum[(frequency < 0.4) | (frequency > 25.0)] = 0.0
    n = len(moving) * FINE
    w = 2j * np.pi * np.maximum(frequency, 0.4)
    base = tuple(FINE * np.fft.irfft(spectrum * w**power, n) for power in (-2, -1, 0))
    return ridden(words, base, np.random.default_rng(seed), law=hiding_law(form, size), noise=NOISE)


def decided(answer: Diagnosis, cause: str, plan: NextRun) -> bool:
    """Return whether the right cause is named first and the other one of a plan is beaten."""
    right = cause.replace("_", " ")
    other = plan.second if plan.first.startswith(right) else plan.first
    left = answer.next_run
    beaten = left is None or other != left.second or left.odds < BEATEN
    return bool(answer.causes) and answer.causes[0].id == cause and beaten


def main() -> None:
    """Drive the worlds and print the share that is decided."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=5000)
    parser.add_argument("--most-s", type=float, default=float("inf"), help="begin no world after these seconds")
    options = parser.parse_args()
    settings, car, begin = Settings(plan_next=True), quarter_car(NOISE), time.monotonic()
    alive = right = again = offered = neither = runs = before = 0
    cases = [(f, c, s, options.first + k) for k in range(options.seeds) for f, c, sizes in WORLDS for s in sizes]
    for form, cause, size, seed in cases:
        if time.monotonic() - begin > options.most_s:
            break
        runs += 1
        run = quarter_car_run(seed, SECONDS, law=hiding_law(form, size), noise=NOISE)
        first = diagnose(car, run, settings=settings)
        plan = first.next_run
        if plan is None:
            continue
        if not any(one.startswith(cause.replace("_", " ")) for one in (plan.first, plan.second)):
            neither += 1
            continue
        alive += 1
        if plan.best.worse < DECIDES:
            continue
        offered += 1
        before += decided(first, cause, plan)
        repeated, other = (driven(car, run, words, form, size, seed + 1) for words in (plan.tried[0].words, plan.best.words))
        once = decided(diagnose(car, repeated, [run], settings=settings), cause, plan)
        after = diagnose(car, other, [run], settings=settings)
        good = decided(after, cause, plan)
        again, right = again + once, right + good
        named = after.causes[0].id if after.causes else after.verdict
        print(
            f"{form} {size:g} seed {seed}: {plan.first} or {plan.second}; {plan.best.words} (expected "
            f"{100 * plan.best.first:.0f} / {100 * plan.best.second:.0f} %): {named}, {'decided' if good else 'not decided'}; "
            f"this run once more: {'decided' if once else 'not decided'}",
            flush=True,
        )
    print(
        f"{runs} worlds; two rivals of which one is right in {alive} (both wrong in {neither}), a separating run named in "
        f"{offered}; decided rightly by the first run {before}, by the run that is named {right}, by the same run once more "
        f"{again}"
    )


if __name__ == "__main__":
    main()
