# Copyright 2026 ride_estimation contributors
"""How much faster a fleet of runs is on several processes than on one: the same recording many times, each its own run.

``python benchmarks/fleet_speed.py [RUNS] [WORKERS] [--bag BAG] [--vehicle V] [--scheduler tcp://HOST:PORT]``

Prints wall times and, because other programs may share the machine, what the processor times say: work of the one process over
an even share of the work of the several plus what the parent does, the speed-up to expect on cores of one's own.
"""

from __future__ import annotations

import argparse
import collections
import json
import os
import shutil
import tempfile
import time
from pathlib import Path

from ride_estimation.cli.fleet import find_recordings
from ride_estimation.cli.fleet_task import FleetTask, process_task
from ride_estimation.cli.pool import run_on_cluster, run_on_pool
from ride_estimation.cli.replay import ReplayJob, vehicle_file
from ride_estimation.estimation.settings import PipelineSettings
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.resources import shared_path


def timed(task: FleetTask) -> tuple[int, float, str]:
    """Run a task; return process, processor time of the process so far, digest."""
    row = process_task(task)
    return os.getpid(), time.process_time(), row.result.get("digest", row.error)


def measure(recordings: dict[str, Path], out: Path, vehicle: str, workers: int, scheduler: str) -> dict[str, object]:
    """Run the fleet once and return times and digests."""
    job = ReplayJob(load_vehicle(vehicle_file(vehicle)), PipelineSettings(), formats=())
    tasks = [FleetTask(name, str(path), str(out / name.replace("/", "__")), job) for name, path in recordings.items()]
    start, own = time.perf_counter(), time.process_time()
    outcomes = run_on_cluster(tasks, scheduler, timed) if scheduler else run_on_pool(tasks, workers, timed)
    spent: dict[int, float] = collections.defaultdict(float)
    digests = {}
    for outcome in outcomes:
        process, used, digests[outcome.item.name] = outcome.value or (0, 0.0, outcome.error)
        spent[process] = max(spent[process], used)
    return {
        "wall": time.perf_counter() - start, "parent": time.process_time() - own, "processes": dict(spent), "digests": digests,
    }


def main() -> None:
    """Measure one and several workers and compare the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="?", type=int, default=20)
    parser.add_argument("workers", nargs="?", type=int, default=2)
    parser.add_argument("--bag", type=Path, default=shared_path("bags", "rough_with_bumps", "bag"))
    parser.add_argument("--vehicle", default="truck_cab")
    parser.add_argument("--scheduler", default="")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for number in range(options.runs):
            shutil.copytree(options.bag, folder / "in" / f"run{number:03d}", copy_function=os.link)
        recordings = find_recordings(folder / "in")
        first = next(iter(recordings.items()))
        # compiles the kernels, which is no work of a fleet
        measure(dict([first]), folder / "warm", options.vehicle, 1, "")
        one = measure(recordings, folder / "one", options.vehicle, 1, "")
        more = measure(recordings, folder / "more", options.vehicle, options.workers, options.scheduler)
        seconds = json.loads(next((folder / "one").glob("*/result.json")).read_text())["run"]["duration_s"]
    work = sum(one["processes"].values()) + one["parent"]
    several = sum(more["processes"].values())
    share = several / options.workers + more["parent"]
    where = options.scheduler or f"{options.workers} processes"
    print(f"{options.runs} runs of {seconds:.0f} s, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print(f"1 process     wall {one['wall']:7.1f} s   processor {work:7.1f} s   parent {one['parent']:.1f} s")
    print(f"{where:<13} wall {more['wall']:7.1f} s   processor {several:7.1f} s   parent {more['parent']:.1f} s")
    print(f"speed-up      wall {one['wall'] / more['wall']:.2f}      by processor time {work / share:.2f}")
    same = one["digests"] == more["digests"]
    print(f"digests of all runs {'equal' if same else 'DIFFER'} ({len(set(one['digests'].values()))} distinct)")


if __name__ == "__main__":
    main()
