# Copyright 2026 ride_estimation contributors
"""Draw layouts and faults that no table lists: which are named in time with the right place, and what harm they do.

A layout is a cab on air springs or rubber with three or four mounts, four to six sensors on it, with or without transducers, the
sensors turned or not. A fault is of one sensor there or at a base, one axis, the vertical or all, of a kind and size that are
drawn, from the start or while driving. A fault counts as named where a sentence that the clean run does not show names its
sensor (on the body also one that says nothing tells which) within the time of ``test/replay/layout_faults.py``; harm is judged
as there. Faults that need not be seen because they harm nothing are counted apart.

    python benchmarks/random_faults.py --layouts 100:120 --faults 12
"""

from __future__ import annotations

import argparse
import collections
import os
import pathlib
import sys
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test")]

from replay.fault_run import BEGIN, LENGTH, MOVING, World, beginning, behaviour, clean, judged, world  # noqa: E402
from replay.layout_faults import LARGEST_ERROR, LEAST_INSIDE, WITHIN  # noqa: E402
from replay.signal_faults import SignalFault  # noqa: E402

#: kinds and their sizes
KINDS = {
    "stuck": (0.0,),
    "gain": (0.6, 0.7, 0.8, 1.2, 1.3, 1.4, 1.8, -1.0),
    "inverted": (0.0,),
    "saturated": (0.7, 1.0, 1.3),
    "spikes": (20.0, 50.0),
    "noise": (20.0, 40.0),
    "hum": (0.7, 1.0, 2.0),
    "late": (0.01, 0.015, 0.025),
    "offset": (2.0, 4.0),
    "turned": (15.0, 30.0, 90.0),
    "swapped": (0.0,),
    "exchanged": (0.0,),
}
#: how often a kind is drawn: the gain of a base is what is hardest to see
SHARES = {"gain": 4}


def draw(w: World, rng: np.random.Generator) -> tuple[SignalFault, bool, str]:
    """Return a fault, whether it is there from the start, and its name."""
    kinds = [k for k in KINDS for _ in range(SHARES.get(k, 1))]
    sensors = [s for s in w.measurement.sensors if s.kind != "displacement"]
    groups = [[s for s in sensors if (s.place == "cab") == on_cab] for on_cab in (True, False)]
    group = groups[int(rng.integers(2))]
    victim = group[int(rng.integers(len(group)))]
    kind = str(rng.choice(kinds))
    size = float(rng.choice(KINDS[kind]))
    up = int(np.argmax(np.abs(victim.rotation[2])))
    along = (up + int(rng.integers(1, 3))) % 3
    axes = {"one": (along,), "vertical": (up,), "all": (0, 1, 2)}
    which = str(rng.choice(list(axes)))
    if kind in ("turned", "swapped"):
        which = "one"
    if kind == "inverted" and which == "all":
        which = "vertical"
    partner = str(rng.choice([s.name for s in group if s is not victim])) if kind == "exchanged" else ""
    start = bool(rng.random() < 0.4) and kind != "stuck"
    fault = SignalFault(kind, victim.name, axes[which], size, partner, float(rng.uniform(20.0, 48.0)))
    place = "cab" if victim.place == "cab" else "base"
    words = f"{place}: {kind} {size:g}{'' if kind == 'exchanged' else f', {which} axis' if which != 'all' else ', all axes'}"
    return fault, start, f"{words}{', from the start' if start else ''} ({victim.name}{' and ' + partner if partner else ''})"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--layouts", default="100:110", help="seeds FIRST:END of the layouts")
    parser.add_argument("--faults", type=int, default=10, help="faults per layout")
    parser.add_argument("--only", default="", help="kinds, comma separated")
    parser.add_argument("--place", default="", choices=("", "cab", "base"))
    given = parser.parse_args()
    first, end = (int(v) for v in given.layouts.split(":"))
    only = given.only.split(",") if given.only else list(KINDS)
    found: dict[str, list[tuple[bool, bool, bool]]] = collections.defaultdict(list)
    blamed, began = 0, time.monotonic()
    print("| layout | fault | named after [s] | off truth [std] | inside 2 std [%] | misses | said |")
    print("|---|---|---|---|---|---|---|")
    for seed in range(first, end):
        key = (seed, "random")
        w, rng = world(key), np.random.default_rng([seed, 7])
        usual = clean(key)
        names = [s.name for s in w.measurement.sensors]
        false = [t for t in usual.texts if any(n in t for n in names)]
        blamed += bool(false)
        bases = sum(s.place != "cab" and s.kind != "displacement" for s in w.measurement.sensors)
        layout = f"{seed}: {len(names)} sensors, {bases} mounts"
        base = judged(key, usual, 5.0, LENGTH)
        words = "; ".join(false)[:120]
        print(f"| {layout} | clean | | {base.wrong_stds:.1f} | {100 * base.inside:.0f} | {words} | |", flush=True)
        for _ in range(given.faults):
            fault, start, name = draw(w, rng)
            if fault.kind not in only or (given.place and not name.startswith(given.place)):
                continue
            begin = MOVING if start else BEGIN
            messages = fault.plant(0.0 if start else BEGIN)(w, list(w.messages), np.random.default_rng([seed, 99]))
            places = "|".join(n for n in (fault.victim, fault.partner) if n)
            expected = f"{places}|one of .*|no single sensor" if name.startswith("cab") else places
            if any(n in t for n in (fault.victim, fault.partner) if n for t in usual.texts):
                continue
            shown = behaviour(w.vehicle, messages, expected, begin, lambda t: t, beginning(key))
            outcome = judged(key, shown, begin, LENGTH)
            named = outcome.to_flag_s <= WITHIN
            good = outcome.not_finite == 0 and outcome.wrong_stds <= LARGEST_ERROR and not outcome.inside < LEAST_INSIDE
            harmless = good and outcome.inside >= base.inside - 0.03 and outcome.wrong_stds <= max(1.0, base.wrong_stds)
            found[f"{name.split(':')[0]}: {fault.kind}"].append((named, good, harmless))
            misses = [] if named else ["not named" if outcome.to_flag_s == np.inf else "late"]
            misses += [] if good else ["harm"]
            print(
                f"| {layout} | {name} | {outcome.to_flag_s:.2f} | {outcome.wrong_stds:.1f} | {100 * outcome.inside:.0f} "
                f"| {', '.join(misses)} | {outcome.said[:110]} |",
                flush=True,
            )
    print("\n| fault | drawn | named in time | harm within bounds | neither named nor harmless |\n|---|---|---|---|---|")
    rows = {**dict(sorted(found.items())), "all": [r for part in found.values() for r in part]}
    for name, part in rows.items():
        named, good, harmless = np.array(part).reshape(-1, 3).T
        print(f"| {name} | {len(part)} | {named.sum()} | {good.sum()} | {int((~named & ~harmless).sum())} |")
    print(f"{blamed} of {end - first} clean runs name a sensor; {time.monotonic() - began:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
