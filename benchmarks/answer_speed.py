# Copyright 2026 ride_estimation contributors
"""Processor time of help and of mistakes: what one waits for before any work is done.

``python benchmarks/answer_speed.py [--most SECONDS]``
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from ride_estimation.cli.main import verb_helps

ROOT = Path(__file__).resolve().parents[1]
RUN = str(ROOT / "bags" / "standing")


def mistakes(folder: Path) -> list[list[str]]:
    """Return command lines with one mistake each."""
    (folder / "broken.yaml").write_text("schema: ride_estimation/vehicle/1\nbodies: 7\n", encoding="utf-8")
    (folder / "broken.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(40))
    (folder / "broken.csv").write_text("a,b\n1,x\n", encoding="utf-8")
    broken, bag, table, out = (str(folder / name) for name in ("broken.yaml", "broken.mcap", "broken.csv", "out"))
    return [
        ["replay", RUN],
        ["replay", "absent.mcap", "--vehicle", "truck_cab", "--out", out],
        ["replay", bag, "--vehicle", "truck_cab", "--out", out],
        ["replay", RUN, "--vehicle", broken, "--out", out],
        ["replay", RUN, "--vehicle", "truck_cab", "--out", out, "--rate", "-3"],
        ["replay", RUN, "--vehicle", "truck_cab", "--out", out, "--from", "900"],
        ["diagnose", "absent.mcap", "--vehicle", "truck_cab", "--out", out],
        ["diagnose", RUN, "--vehicle", broken, "--out", out],
        ["diagnose", table, "--out", out],
        ["compare", "absent", "--out", out],
        ["fleet", str(folder / "absent"), "--vehicle", "truck_cab", "--out", out],
        ["calibrate", "absent.mcap", "--vehicle", "truck_cab"],
        ["inspect", "absent.mcap"],
        ["import-file", table, "--vehicle", "truck_cab", "--out", out],
        ["export-file", "absent", "--out", str(folder / "out.csv")],
        ["export-model", broken, "--out", str(folder / "out.fmu")],
        ["identify", table, "--out", out],
        ["design-test", "--model", "none", "--out", out],
        ["procedure", "velocity", table, "--column", "a", "--out", str(folder / "out.csv")],
        ["quarter-car", table, "--sprung-mass-kg", "1", "--unsprung-mass-kg", "1"],
        ["plan", "--vehicle", broken],
        ["simulate", "absent.yaml", "--out", out],
        ["new-vehicle", "--mounts", "99", "--out", str(folder / "v.yaml")],
    ]


def processor_time(arguments: list[str]) -> tuple[float, int, str]:
    """Return processor seconds, exit code and what is said of one command in a fresh process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "ride_estimation.cli.main", *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    said = done.stderr.decode("utf-8", "replace").strip().splitlines()
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.returncode, said[-1] if said else ""


def main() -> int:
    """Print a line per command; 1 where one takes longer than allowed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--most", type=float, default=0.5, help="allowed processor time [s] (default 0.5)")
    options = parser.parse_args()
    slow = 0
    with tempfile.TemporaryDirectory() as name:
        for arguments in [*([verb, "--help"] for verb in verb_helps()), *mistakes(Path(name))]:
            seconds, code, said = processor_time(arguments)
            wanted = 0 if "--help" in arguments else 2
            slow += seconds > options.most
            flag = "SLOW " if seconds > options.most else "" if code == wanted else f"EXIT CODE {code} "
            print(f"{seconds:6.2f} s  {flag}{' '.join(Path(a).name if '/' in a else a for a in arguments)[:70]:<70} {said[:90]}")
    print(f"{slow} slower than {options.most:g} s")
    return int(slow > 0)


if __name__ == "__main__":
    sys.exit(main())
