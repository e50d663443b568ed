# Copyright 2026 ride_estimation contributors
"""Thousands of random losses, stalls, late bursts, returns and clock jumps on several layouts and rates, against the truth.

    python benchmarks/loss_soak.py                          # 10 000 sequences, two processes
    python benchmarks/loss_soak.py --sequences 300 --processes 1

A sequence is a disturbance of a random subset of sensors (gaps of 0.05 to 5 s, single samples, bursts held back, clocks that
jump) and ten seconds of calm. A chain is a hundred of them, one after the other through one estimator, on a vehicle, a road and a
layout of its own. Every chain that ends adds a line; interrupted (Ctrl-C, SIGTERM) the totals are those of the chains that ended.

Prints per layout and per kind of disturbance: sequences; those with a number that is not finite; with a valid force of more than
ten and of more than three times the largest true one; the largest of those ratios; the share of sequences whose error over the
last two seconds of the calm is at most 1.5 times that without disturbance plus 2 % of the size of the forces; the share of the
truth inside two standard deviations from the first loss to the end of the calm (horizontal, vertical); processor time. Ends
with 1 if anything was not finite or more than ten times the truth.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import pathlib
import signal
import sys
import time
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test")]

from replay.loss_run import KINDS, LAYOUTS, Verdict, course, sequences, undisturbed  # noqa: E402

#: allowed error over that without disturbance, plus this share of the size of the forces
WORSE, UNSEEN = 1.5, 0.02
#: force over the largest true one that is absurd, and what a peak and its uncertainty explain
ABSURD, LARGE = 10.0, 3.0
#: drive of a chain [s], sequences of a chain
DRIVE, CHAIN = 60.0, 100
HEAD = "sequences | not finite | > 10 | > 3 | largest | recovered [%] | inside 2 sigma [%] | processor s each |"


def run(job: tuple[str, int, int]) -> tuple[str, int, list[Verdict], float]:
    """Return the verdicts on a chain, and the processor time it took for each sequence."""
    name, seed, count = job
    began = time.process_time()
    given = course.__wrapped__(name, seed, DRIVE)
    found = list(sequences(given, seed, count, undisturbed(given)))
    return name, seed, found, (time.process_time() - began) / count


def row(label: str, found: list[Verdict], spent: list[float]) -> str:
    """Return a line of the table."""
    recovered = np.mean([bool(np.all(v.error <= WORSE * v.allowed + UNSEEN)) for v in found])
    ticks = sum(v.ticks for v in found)
    inside = ", ".join(f"{100 * s / t:.1f}" if t else "-" for s, t in zip(sum(v.inside for v in found), ticks))
    sizes = np.array([v.largest for v in found])
    each = f"{np.mean(spent):.2f}" if spent else "-"
    return (
        f"| {label} | {len(found)} | {sum(not v.finite for v in found)} | {np.sum(sizes > ABSURD)} | {np.sum(sizes > LARGE)} | "
        f"{sizes.max():.2f} | {100 * recovered:.2f} | {inside} | {each} |"
    )


def interrupted(*_: object) -> None:
    """End as Ctrl-C does."""
    raise KeyboardInterrupt


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sequences", type=int, default=10_000, help="of all layouts together (default 10 000)")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--seed", type=int, default=100)
    given = parser.parse_args()
    names = list(LAYOUTS)
    chains = -(-given.sequences // CHAIN)
    # a layout less often than once in so many chains would not be seen at all
    each = CHAIN if chains >= len(names) else -(-given.sequences // len(names))
    jobs = [(names[n % len(names)], given.seed + n, each) for n in range(max(chains, len(names)))]
    found: dict[str, list[Verdict]] = {}
    spent: dict[str, list[float]] = {}
    print(f"| chain | {HEAD}\n{'|---' * 9}|", flush=True)
    signal.signal(signal.SIGTERM, interrupted)
    pool = ProcessPoolExecutor(given.processes)
    pending = {pool.submit(run, job) for job in jobs}
    try:
        while pending:
            done, pending = wait(pending, return_when=FIRST_COMPLETED)
            for name, seed, verdicts, took in (future.result() for future in done):
                found.setdefault(name, []).extend(verdicts)
                spent.setdefault(name, []).append(took)
                print(row(f"{name}, {seed}", verdicts, [took]), flush=True)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
        for child in multiprocessing.active_children():
            child.terminate()
    pool.shutdown(wait=False, cancel_futures=True)
    whole = [v for verdicts in found.values() for v in verdicts]
    if not whole:
        return 1
    print(f"\n| layout | {HEAD}\n{'|---' * 9}|")
    for name, own in found.items():
        print(row(name, own, spent[name]))
    for kind in KINDS:
        if own := [v for v in whole if v.kind == kind]:
            print(row(kind, own, []))
    print(row("all", whole, [s for part in spent.values() for s in part]), flush=True)
    return 0 if all(v.finite and v.largest < ABSURD for v in whole) else 1


if __name__ == "__main__":
    sys.exit(main())
