# Copyright 2026 ride_estimation contributors
"""``ride-estimation fleet``: every recording below a folder, one table and one summary."""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from ride_estimation.api.runs import require_layout
from ride_estimation.cli.fleet_task import FleetRow, FleetTask, failed_row, process_task
from ride_estimation.cli.pool import run_on_cluster, run_on_pool
from ride_estimation.cli.progress import Progress
from ride_estimation.cli.replay import ReplayJob
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.estimation.compile_ahead import compile_ahead
from ride_estimation.io.bag_source import SUFFIXES
from ride_estimation.io.files.suffixes import READ_SUFFIXES
from ride_estimation.io.results import output_folder
from ride_estimation.io.run_metrics import run_metrics
from ride_estimation.io.run_table import Cell, require_parquet, write_run_table


def run(options: argparse.Namespace) -> int:
    """Replay the fleet; 0 if at least one run gave results, 2 if none did."""
    if options.workers < 1:
        raise ConfigurationError(f"--workers {options.workers}; allowed: 1 or more")
    if options.table == "parquet":
        require_parquet()
    recordings = find_recordings(options.folder, (*SUFFIXES, *READ_SUFFIXES) if options.channels else SUFFIXES)
    job = ReplayJob.of(options, ("html",) if options.run_reports else ())
    require_layout(job.vehicle)
    out = output_folder(options.out)
    tasks = [
        FleetTask(name, str(path.resolve()), str((out / "runs" / folder_name(name)).resolve()), job)
        for name, path in recordings.items()
    ]
    rows = collect(tasks, options)
    write_summary(rows, out, f"Fleet of {len(rows)} runs in {options.folder}", "fleet", options.table)
    print(f"written to {out}: fleet.{options.table}, report.html, runs")
    say(rows)
    if not any(row.result for row in rows):
        raise InputDataError(f"{options.folder}: not one of {len(rows)} runs could be replayed; the reasons are above")
    return 0


def write_summary(rows: Sequence[FleetRow], out: Path, title: str, name: str, ending: str) -> None:
    """Write the table and the page over the runs.

    Parameters
    ----------
    rows
        One per run.
    out
        Folder; the results of every run are below its ``runs``.
    title
        Of the page.
    name, ending
        Of the table: ``csv`` or ``parquet``.
    """
    from ride_estimation.reporting.fleet_report import fleet_page
    from ride_estimation.reporting.formats import write_page

    columns, table = run_table(rows)
    write_run_table(out / f"{name}.{ending}", columns, table)
    write_page(fleet_page(title, rows), out, ("html",))


def say(rows: Sequence[FleetRow]) -> None:
    """Print how many runs came to what, and why the others failed."""
    failed = [row for row in rows if row.status == "failed"]
    kept = sum(row.status == "kept" for row in rows)
    print(f"{len(rows)} runs: {len(rows) - len(failed) - kept} replayed, {kept} kept from before, {len(failed)} failed")
    for row in failed:
        print(f"failed: {row.name}: {row.error}")


def find_recordings(folder: Path, suffixes: Sequence[str] = SUFFIXES) -> dict[str, Path]:
    """Return the recordings below a folder by their path in it; a rosbag2 folder is one recording.

    Parameters
    ----------
    folder
        Searched with all folders below it.
    suffixes
        Endings of recordings.

    Raises
    ------
    InputDataError
        No such folder, or nothing in it.
    """
    if not folder.is_dir():
        what = "is a file; 'replay' takes one recording" if folder.exists() else "no such folder"
        raise InputDataError(f"{folder}: {what}")
    found: dict[str, Path] = {}
    seen: set[tuple[int, int]] = set()
    _is_new(folder, seen)
    for place, folders, files in os.walk(folder, followlinks=True):
        here = Path(place)
        # symbolic links may lead back to where one came from, or twice to the same place
        folders[:] = sorted(name for name in folders if _is_new(here / name, seen))
        names = sorted(name for name in files if Path(name).suffix.lower() in suffixes and not name.endswith(".events.csv"))
        if "metadata.yaml" in files and any(Path(name).suffix in SUFFIXES for name in names):
            found[here.relative_to(folder).as_posix()] = here
            folders.clear()
            continue
        found.update({(here / name).relative_to(folder).as_posix(): here / name for name in names if _is_new(here / name, seen)})
    if not found:
        raise InputDataError(f"{folder}: no recording below it; looked for rosbag2 folders and {', '.join(suffixes)} files")
    return found


def _is_new(path: Path, seen: set[tuple[int, int]]) -> bool:
    """Return whether a file or folder was not met before by another name, and remember it; links to nothing count as new."""
    try:
        status = path.stat()
    except OSError:
        return True  # a replay says what is wrong with it
    key = (status.st_dev, status.st_ino)
    new = key not in seen
    seen.add(key)
    return new


def folder_name(name: str) -> str:
    """Return a folder name for a recording that no other recording has and that stays when others are added."""
    plain = re.sub(r"[^\w.-]+", "_", name.replace("/", "__"))
    if plain.replace("__", "/") == name and not plain.startswith("."):
        return plain
    # characters were replaced: another name might become the same
    return f"{plain.strip('._') or 'run'}_{hashlib.sha256(os.fsencode(name)).hexdigest()[:8]}"


def collect(tasks: Sequence[FleetTask], options: argparse.Namespace) -> list[FleetRow]:
    """Run all tasks with progress; return the rows in the order of the tasks."""
    if options.scheduler:
        outcomes = run_on_cluster(tasks, options.scheduler, process_task)
    else:
        outcomes = run_on_pool(tasks, options.workers, process_task)
    found: dict[str, FleetRow] = {}
    with Progress(f"{len(tasks)} runs", len(tasks), {"replaying": 1.0}) as progress:
        if not options.scheduler:
            # else every process compiles for itself
            compile_ahead(progress.begin)
        progress.begin("replaying")
        for outcome in outcomes:
            row = outcome.value or failed_row(outcome.item, outcome.error)
            found[row.name] = row
            progress.update(1.0)
            if not sys.stderr.isatty():
                print(f"{len(found)} of {len(tasks)}: {row.name} {row.status} ({row.seconds:.1f} s)", file=sys.stderr, flush=True)
    return [found[task.name] for task in tasks]


def run_table(rows: Sequence[FleetRow]) -> tuple[list[str], list[dict[str, Cell]]]:
    """Return headings and rows: one row per run, failed ones with the reason, unsure values left in with a column beside."""
    labels = list(dict.fromkeys(label for row in rows for label in row.labels))
    columns = ["run", *labels, "status", "error", "recording SHA-256", "digest"]
    table = []
    for row in rows:
        cells: dict[str, Cell] = {"run": row.name, **row.labels, "status": row.status, "error": row.error}
        if row.result:
            cells["recording SHA-256"] = str(row.result["run"].get("checksum", ""))
            cells["digest"] = str(row.result.get("digest", ""))
        for metric in run_metrics(row.result).values() if row.result else ():
            cells[metric.column] = metric.value
            if metric.std is not None:
                cells[f"{metric.name} std [{metric.unit}]"] = metric.std
                cells[f"{metric.name} usable"] = 1.0 if metric.sure else 0.0
        columns += [c for c in cells if c not in columns]
        table.append(cells)
    return columns, table
