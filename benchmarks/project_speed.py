# Copyright 2026 ride_estimation contributors
"""A campaign of logger files from folder to one report by two commands: time on one process and on several, memory per file.

    python benchmarks/project_speed.py                                    forty MDF4 files of ten minutes at 500 Hz, 24 channels
    python benchmarks/project_speed.py --files 4 --seconds 60             a small one
    python benchmarks/project_speed.py --files 1 --parts 1                memory of one file

The files are windows of one simulated drive on rough ground, each beginning half a second after the one before. With ``--work``
files and results stay in a folder. MDF4 needs the extra ``files``.

Other programs may share the machine: beside wall times the table has the processor time of the workers and of the command itself,
and the speed-up that these give on cores of one's own (the work of one process and its parent over an even share of the work of
several plus the parent). Parts are measured by turns.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from fleet_speed import STEP_S, VEHICLE, window

from ride_estimation.io.files.conversion import recording_groups
from ride_estimation.io.files.formats import write_measurement_file
from ride_estimation.io.scenario_file import load_scenario
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.resources import shared_path
from ride_estimation.simulation.field_run import run_scenario

#: runs a command and tells what it and its workers took: processor seconds, most memory of one worker [kB]
_MEASURED = """
import json, resource, sys
from ride_estimation.cli.main import main
code = main(sys.argv[1:])
own, workers = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
print(json.dumps([code, own.ru_utime + own.ru_stime, workers.ru_utime + workers.ru_stime, workers.ru_maxrss]))
"""


@dataclasses.dataclass(frozen=True)
class Measured:
    """What the two commands took: wall and processor times [s], most memory of a worker [GB], load of the machine."""

    wall: float
    parent: float
    workers: float
    memory: float
    load: float


def make_files(folder: Path, files: int, seconds: float, rate_hz: float) -> list[Path]:
    """Write the files; those that are there already stay."""
    paths = [folder / f"drive_{number:03d}.mf4" for number in range(files)]
    if all(path.is_file() for path in paths):
        return paths
    folder.mkdir(parents=True, exist_ok=True)
    vehicle = load_vehicle(VEHICLE)
    scenario = load_scenario(shared_path("bags", "rough_with_bumps", "recipe.yaml"))
    errors = dataclasses.replace(scenario.sensor_errors, rate=rate_hz, anti_alias=0.4 * rate_hz)
    scenario = dataclasses.replace(scenario, duration=seconds + STEP_S * files, sensor_errors=errors)
    drive = run_scenario(scenario, vehicle).recording
    first = min(int(channel.stamp_ns[0]) for channel in drive.channels.values())
    for number, path in enumerate(paths):
        start = first + round(1e9 * STEP_S * number)
        part = window(drive, start, start + round(1e9 * seconds))
        write_measurement_file(path, *recording_groups(part, vehicle.sensors, one_time_base=False))
    return paths


def command(*arguments: str) -> list[float]:
    """Run a command in a process of its own; return what :data:`_MEASURED` prints."""
    done = subprocess.run([sys.executable, "-c", _MEASURED, *arguments], capture_output=True, text=True, check=True)
    found: list[float] = json.loads(done.stdout.splitlines()[-1])
    if found[0] != 0:
        raise SystemExit(done.stderr)
    return found[1:]


def measure(paths: list[Path], project: Path, workers: int) -> Measured:
    """Go from files to the report by two commands."""
    shutil.rmtree(project, ignore_errors=True)
    start = time.perf_counter()
    made = command("project", "init", str(project), *map(str, paths), "--vehicle", VEHICLE)
    ran = command("project", "run", str(project), "--workers", str(workers))
    wall = time.perf_counter() - start
    if not (project / "out" / "report.html").is_file():
        raise SystemExit(f"{project}: no report")
    return Measured(wall, made[0] + ran[0], ran[1], ran[2] * 1024 / 1e9, os.getloadavg()[0])


def main() -> None:
    """Measure the parts by turns and print them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=40)
    parser.add_argument("--seconds", type=float, default=600.0, help="length of a file [s] (default 600)")
    parser.add_argument("--rate", type=float, default=500.0, help="samples per second of every channel [Hz] (default 500)")
    parser.add_argument("--parts", type=int, nargs="+", default=[1, 2], metavar="N", help="processes to compare (default 1 2)")
    parser.add_argument("--turns", type=int, default=1, help="repeats of all parts (default 1)")
    parser.add_argument("--work", type=Path, help="folder that keeps files and results")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = options.work or Path(place)
        what = f"{options.files} files of {options.seconds:g} s at {options.rate:g} Hz"
        paths = make_files(folder / what.replace(" ", "_"), options.files, options.seconds, options.rate)
        size = sum(path.stat().st_size for path in paths) / 1e6
        print(f"{what}, {size:.0f} MB, {os.cpu_count()} cores", flush=True)
        found: dict[int, list[Measured]] = {n: [] for n in options.parts}
        for _ in range(options.turns):
            for n in options.parts:
                m = measure(paths, folder / f"campaign_{n}", n)
                found[n].append(m)
                print(
                    f"{n} processes: wall {m.wall:.1f} s, processor {m.workers:.1f} s, command itself {m.parent:.1f} s, "
                    f"memory {m.memory:.2f} GB per process, load {m.load:.1f}", flush=True,
                )  # fmt: skip
    first, *others = options.parts
    one = found[first]
    for n in others:
        wall = statistics.median(a.wall / b.wall for a, b in zip(one, found[n]))
        own = statistics.median((a.workers / first + a.parent) / (b.workers / n + b.parent) for a, b in zip(one, found[n]))
        print(f"{n} processes against {first}: {wall:.2f} times faster by wall, {own:.2f} by processor time")


if __name__ == "__main__":
    main()
