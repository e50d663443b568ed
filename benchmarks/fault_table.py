# Copyright 2026 ride_estimation contributors
"""Print the tables of faults (test/replay/fault_table.py, layout_faults.py) with measured figures: time to the right sentence,
recovery, bounds.

    python benchmarks/fault_table.py --seeds 11,12
    python benchmarks/fault_table.py --only "tilt|late"

Columns: worst over the worlds. Targets: flagged within 0.5 s (constant faults 10 s of motion), recovery within 5 s, no number
published that is none, force errors within three times the clean run's largest plus five stated standard deviations (ratio at
most 1), parameters that claim to be valid within 1 % of the clean run (those that the clean run itself knows to 0.5 %, the others
within three of its standard deviations) and within five stated standard deviations of the truth (a number called valid is not
that wrong); the share of force errors inside two standard deviations, at least 90 %; of what is harmless nothing is said. On
other layouts what counts is that a fault is named in time, that no parameter called valid is off the truth by more than three
stated standard deviations, and 85 % of the force errors inside two, from the fault on to the end. QoS that does not match is a
matter of the middleware: test/ros/test_estimator_node.py.
"""

from __future__ import annotations

import argparse
import os
import pathlib
import re
import sys
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test")]

from replay.fault_run import LENGTH, clean, judged  # noqa: E402
from replay.fault_table import TABLE, run_fault  # noqa: E402
from replay.layout_faults import LARGEST_ERROR, LAYOUT_TABLE, LAYOUTS, LEAST_INSIDE  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="11,12", help="worlds (default 11,12)")
    parser.add_argument("--only", default="", help="regular expression of names")
    given = parser.parse_args()
    seeds = [int(s) for s in given.seeds.split(",")]
    started, missed = time.monotonic(), 0
    print(
        "| fault | flagged [s] | recovered [s] | not finite | force ratio | known parameters [%] | others [std] "
        "| off truth [std] | inside 2 std [%] | misses | said |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for seed in seeds:
        usual = judged((seed, ""), clean((seed, "")), 5.0, LENGTH)
        print(
            f"| clean run, world {seed} | | | {usual.not_finite} | {usual.force_ratio:.2f} | {usual.parameter_words} | "
            f"| {usual.wrong_stds:.1f} | {100 * usual.inside:.0f} | | |",
            flush=True,
        )
    for fault in (*TABLE, *LAYOUT_TABLE):
        if not re.search(given.only, fault.name):
            continue
        runs = [run_fault(fault, seed) for seed in seeds]
        found = [outcome for outcome, _ in runs]
        blamed = "" if fault.expected else next((t for _, behaviour in runs for t in behaviour.texts), "")
        to_flag = max(o.to_flag_s for o in found) if fault.expected else 0.0
        recovery = max(o.to_recover_s for o in found)
        finite, ratio = sum(o.not_finite for o in found), max(o.force_ratio for o in found)
        worst = max(found, key=lambda o: o.parameter)
        parameter, inside = worst.parameter, min(o.inside for o in found)
        others, wrong = max(o.parameter_stds for o in found), max(o.wrong_stds for o in found)
        wide = fault.kind not in LAYOUTS
        misses = [
            word
            for word, bad in (
                ("flag", to_flag > fault.limit_s),
                ("recovery", wide and recovery > 5.0),
                ("finite", finite > 0),
                ("force", wide and ratio > 1.0),
                ("parameters", wide and (parameter > 0.01 or others > 3.0)),
                ("truth", wrong > (5.0 if wide else LARGEST_ERROR)),
                ("coverage", inside < (0.9 if wide else LEAST_INSIDE)),
                ("harmless, but blamed", bool(blamed)),
            )
            if bad
        ]
        missed += len(misses)
        said = found[0].said or blamed
        flag = "harmless" if not fault.expected else "never" if not np.isfinite(to_flag) else f"{to_flag:.2f}"
        print(
            f"| {fault.name} | {flag} | {'' if fault.constant else f'{recovery:.1f}'} | {finite} | {ratio:.2f} "
            f"| {100 * parameter:.2f} ({worst.parameter_words}) | {others:.1f} | {wrong:.1f} | {100 * inside:.0f} "
            f"| {', '.join(misses)} | {said[:90]} |",
            flush=True,
        )
    count = len(TABLE) + len(LAYOUT_TABLE)
    print(f"{count} faults, worlds {given.seeds}, {missed} targets missed, {time.monotonic() - started:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
