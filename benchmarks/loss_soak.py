# Copyright 2026 ride_estimation contributors
"""Thousands of random losses, stalls, late bursts, returns and clock jumps on several layouts and rates, against the truth.

    python benchmarks/loss_soak.py                          # 10 000 sequences, one process per layout, two at a time
    python benchmarks/loss_soak.py --sequences 300 --processes 1

A sequence is a disturbance of a random subset of sensors (gaps of 0.05 to 5 s, single samples, bursts held back, clocks that
jump) and ten seconds of calm; one estimator per layout takes them one after the other. Prints per layout: sequences whose
numbers were all finite, the largest force over the largest true one, the share of sequences whose error over the last two seconds
of the calm is at most 1.5 times that without disturbance plus 2 % of the size of the forces, and the share of the truth inside
two standard deviations from the first loss to the end of the calm (horizontal, vertical). Ends with 1 if anything was not finite
or larger than ten times the truth.
"""

from __future__ import annotations

import argparse
import os
import pathlib
import sys
import time
from concurrent.futures import ProcessPoolExecutor

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test")]

from replay.loss_run import KINDS, LAYOUTS, Verdict, course, sequences, undisturbed  # noqa: E402

#: allowed error over that without disturbance, plus this share of the size of the forces
WORSE, UNSEEN = 1.5, 0.02
#: force over the largest true one that is absurd
ABSURD = 10.0
#: drive of a layout [s]
DRIVE = 100.0


def run(job: tuple[str, int, int]) -> tuple[str, list[Verdict], float]:
    """Return the verdicts on a number of sequences of a layout, and the processor time they took."""
    name, seed, count = job
    began = time.process_time()
    given = course(name, seed, DRIVE)
    found = list(sequences(given, seed, count, undisturbed(given)))
    return name, found, time.process_time() - began


def row(label: str, found: list[Verdict], spent: float) -> str:
    recovered = np.mean([bool(np.all(v.error <= WORSE * v.allowed + UNSEEN)) for v in found])
    inside = sum(v.inside for v in found) / max(sum(v.ticks for v in found), 1)
    largest = max(v.largest for v in found)
    finite = sum(v.finite for v in found)
    return (
        f"| {label} | {len(found)} | {finite} | {largest:.2f} | {100 * recovered:.1f} | {100 * inside[0]:.1f}, "
        f"{100 * inside[1]:.1f} | {spent / len(found):.2f} |"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sequences", type=int, default=10_000, help="of all layouts together (default 10 000)")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--seed", type=int, default=100)
    given = parser.parse_args()
    each = -(-given.sequences // len(LAYOUTS))
    jobs = [(name, given.seed + n, each) for n, name in enumerate(LAYOUTS)]
    print("| layout | sequences | finite | largest force | recovered [%] | inside 2 sigma [%] | processor s each |")
    print("|---|---|---|---|---|---|---|")
    found: list[Verdict] = []
    with ProcessPoolExecutor(given.processes) as pool:
        for name, verdicts, spent in pool.map(run, jobs):
            print(row(name, verdicts, spent), flush=True)
            found += verdicts
    for kind in KINDS:
        own = [v for v in found if v.kind == kind]
        if own:
            print(row(kind, own, 0.0))
    print(row("all", found, 0.0))
    return 0 if all(v.finite and v.largest < ABSURD for v in found) else 1


if __name__ == "__main__":
    sys.exit(main())
