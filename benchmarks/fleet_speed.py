# Copyright 2026 ride_estimation contributors
"""How much faster a fleet of runs is on several processes, or on a Dask cluster, than on one process.

``python benchmarks/fleet_speed.py [RUNS] [WORKERS] [--seconds S] [--rate HZ] [--work FOLDER] [--parts one several cluster]``

The runs are windows of S seconds of one simulated drive on rough ground, each beginning half a second after the one before, so
that no two are the same. With ``--work`` the runs and what was measured stay in a folder, and parts can be measured one by one.

Prints wall times and, because other programs may share the machine, what the processor times say: work of the one process over
an even share of the work of the several plus what the parent does, the speed-up to expect on cores of one's own.
"""

from __future__ import annotations

import argparse
import collections
import dataclasses
import json
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

from ride_estimation.cli.fleet import find_recordings
from ride_estimation.cli.fleet_task import FleetTask, process_task
from ride_estimation.cli.pool import run_on_cluster, run_on_pool
from ride_estimation.cli.replay import ReplayJob
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.scenario_file import load_scenario
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.resources import shared_path
from ride_estimation.signals.recording import Recording
from ride_estimation.simulation.field_run import run_scenario

VEHICLE = "truck_cab"
STEP_S = 0.5
PARTS = {"one": "1 process", "several": "{} processes", "cluster": "Dask, {} workers"}


def timed(task: FleetTask) -> tuple[int, float, str]:
    """Run a task; return process, processor time of the process so far, digest."""
    row = process_task(task)
    return os.getpid(), time.process_time(), row.result.get("digest", row.error)


def window(recording: Recording, start_ns: int, end_ns: int) -> Recording:
    """Return the samples of a recording between two stamps."""
    channels = {}
    for name, channel in recording.channels.items():
        keep = (channel.stamp_ns >= start_ns) & (channel.stamp_ns < end_ns)
        variance = None if channel.variance is None else channel.variance[keep]
        channels[name] = dataclasses.replace(
            channel, stamp_ns=channel.stamp_ns[keep], arrival_ns=channel.arrival_ns[keep], values=channel.values[keep],
            variance=variance,
        )  # fmt: skip
    return dataclasses.replace(recording, channels=channels)


def make_runs(folder: Path, runs: int, seconds: float, rate_hz: float) -> None:
    """Write the runs as bags; those that are there already stay."""
    vehicle = load_vehicle(VEHICLE)
    missing = [number for number in range(runs) if not (folder / f"run{number:03d}" / "metadata.yaml").is_file()]
    if not missing:
        return
    scenario = load_scenario(shared_path("bags", "rough_with_bumps", "recipe.yaml"))
    # the anti-alias filter of the recipe is at 0.4 of its rate
    errors = dataclasses.replace(scenario.sensor_errors, rate=rate_hz, anti_alias=0.4 * rate_hz)
    scenario = dataclasses.replace(scenario, duration=seconds + STEP_S * runs, sensor_errors=errors)
    drive = run_scenario(scenario, vehicle).recording
    first = min(int(channel.stamp_ns[0]) for channel in drive.channels.values())
    for number in missing:
        place = folder / f"run{number:03d}"
        shutil.rmtree(place, ignore_errors=True)
        start = first + round(1e9 * STEP_S * number)
        write_bag(place, window(drive, start, start + round(1e9 * seconds)), vehicle.sensors)


def measure(recordings: dict[str, Path], out: Path, workers: int, scheduler: str) -> dict[str, object]:
    """Run the fleet once and return times and digests."""
    job = ReplayJob(load_vehicle(VEHICLE), PipelineSettings(), formats=())
    tasks = [FleetTask(name, str(path), str(out / name.replace("/", "__")), job) for name, path in recordings.items()]
    start, own = time.perf_counter(), time.process_time()
    outcomes = run_on_cluster(tasks, scheduler, timed) if scheduler else run_on_pool(tasks, workers, timed)
    spent: dict[int, float] = collections.defaultdict(float)
    digests = {}
    for outcome in outcomes:
        process, used, digests[outcome.item.name] = outcome.value or (0, 0.0, outcome.error)
        spent[process] = max(spent[process], used)
        if sys.stderr.isatty():
            print(f"\r{len(digests)} of {len(tasks)}", end="", file=sys.stderr)
    return {
        "wall": time.perf_counter() - start, "parent": time.process_time() - own, "processes": dict(spent), "digests": digests,
        "load": os.getloadavg()[0],
    }  # fmt: skip


def measure_part(part: str, recordings: dict[str, Path], out: Path, options: argparse.Namespace) -> dict[str, object]:
    """Measure one of :data:`PARTS`; a Dask cluster of this machine is started where no scheduler is given."""
    if part != "cluster" or options.scheduler:
        return measure(recordings, out, 1 if part == "one" else options.workers, options.scheduler if part == "cluster" else "")
    import distributed

    with distributed.LocalCluster(n_workers=options.workers, threads_per_worker=1, dashboard_address=None) as cluster:
        return measure(recordings, out, options.workers, cluster.scheduler_address)


def report(found: dict[str, dict[str, object]], options: argparse.Namespace) -> None:
    """Print times, speed-ups and whether all parts gave the same."""
    print(f"{options.runs} runs of {options.seconds:g} s at {options.rate:g} Hz, {os.cpu_count()} cores")
    for part, result in found.items():
        work = sum(result["processes"].values())
        label = PARTS[part].format(options.workers)
        print(
            f"{label:<18} wall {result['wall']:7.1f} s   processor {work:7.1f} s   parent {result['parent']:5.1f} s   "
            f"load {result['load']:.1f}"
        )
    one = found.get("one")
    for part in [p for p in found if p != "one" and one]:
        alone = sum(one["processes"].values()) + one["parent"]
        share = sum(found[part]["processes"].values()) / options.workers + found[part]["parent"]
        print(f"{part}: speed-up by wall {one['wall'] / found[part]['wall']:.2f}, by processor time {alone / share:.2f}")
    digests = [result["digests"] for result in found.values()]
    distinct = len(set(digests[0].values()))
    print(f"digests {'equal' if all(d == digests[0] for d in digests) else 'DIFFER'} in all parts, {distinct} distinct")


def main() -> None:
    """Measure the parts that are not measured yet and compare the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="?", type=int, default=20)
    parser.add_argument("workers", nargs="?", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=30.0, help="length of a run [s] (default 30)")
    parser.add_argument("--rate", type=float, default=200.0, help="samples per second of every sensor [Hz] (default 200)")
    parser.add_argument("--work", type=Path, help="folder that keeps runs and measurements")
    parser.add_argument("--parts", nargs="*", choices=list(PARTS), default=["one", "several"], help="none: only make the runs")
    parser.add_argument("--scheduler", default="", help="of an existing Dask cluster for the part 'cluster'")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = options.work or Path(place)
        make_runs(folder / "in", options.runs, options.seconds, options.rate)
        recordings = dict(list(find_recordings(folder / "in").items())[: options.runs])
        # compiles the kernels, which is no work of a fleet
        measure(dict([next(iter(recordings.items()))]), folder / "warm", 1, "")
        found = {}
        for part in options.parts:
            kept = folder / f"{part}_{options.runs}_{options.workers}.json"
            if not kept.is_file():
                shutil.rmtree(folder / part, ignore_errors=True)
                kept.write_text(json.dumps(measure_part(part, recordings, folder / part, options)), encoding="utf-8")
                shutil.rmtree(folder / part, ignore_errors=True)
            found[part] = json.loads(kept.read_text(encoding="utf-8"))
    if found:
        report(found, options)


if __name__ == "__main__":
    main()
