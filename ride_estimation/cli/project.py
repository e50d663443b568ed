# Copyright 2026 ride_estimation contributors
"""``ride-estimation project``: many recordings of one campaign, each with its own vehicle, load and part, in one report."""

from __future__ import annotations

import argparse
import dataclasses
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ride_estimation.api.runs import require_layout
from ride_estimation.cli.finite import require_finite
from ride_estimation.cli.fleet import collect, find_recordings, folder_name, say, write_summary
from ride_estimation.cli.fleet_task import FleetRow, FleetTask, finished_row
from ride_estimation.cli.replay import ReplayJob
from ride_estimation.errors import ConfigurationError, InputDataError, RideEstimationError
from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.io.bag_source import SUFFIXES
from ride_estimation.io.files.channel_map import load_channel_map
from ride_estimation.io.files.suffixes import READ_SUFFIXES
from ride_estimation.io.project_file import PROJECT, PlannedRun, Project, load_project, save_project, save_runs
from ride_estimation.io.results import output_folder
from ride_estimation.io.vehicle_file import find_vehicle_file, load_vehicle
from ride_estimation.vehicles.payload import with_payload


def run(options: argparse.Namespace) -> int:
    """Do one step."""
    require_finite(options)
    return {"init": _init, "add": _add, "run": _run, "report": _report}[options.step](options)


def _init(options: argparse.Namespace) -> int:
    if (options.folder / PROJECT).exists():
        raise ConfigurationError("is a project already; 'project add' adds runs to it", where=str(options.folder))
    vehicle = load_vehicle(options.vehicle)
    if options.channels:
        load_channel_map(Path(options.channels), vehicle.sensors)
    project = Project(options.folder, "vehicle.yaml", "channels.yaml" if options.channels else "")
    options.vehicle, given, options.channels, channels = "", options.vehicle, "", options.channels
    project = _with_runs(project, options) if options.files else project
    folder = output_folder(options.folder)
    shutil.copyfile(find_vehicle_file(given), folder / project.vehicle)
    if channels:
        shutil.copyfile(channels, folder / project.channels)
    save_project(project)
    print(f"{folder}: project.yaml, {', '.join(filter(None, (project.vehicle, project.channels)))}, runs.csv")
    print(f"{len(project.runs)} runs; next: ride-estimation project {'run' if project.runs else 'add'} {folder}")
    return 0


def _add(options: argparse.Namespace) -> int:
    project = load_project(options.folder)
    before = len(project.runs)
    if options.vehicle:
        load_vehicle(options.vehicle)
    project = _with_runs(project, options)
    save_runs(project)
    print(f"{options.folder}: {len(project.runs) - before} runs added, {len(project.runs)} in all")
    return 0


def _with_runs(project: Project, options: argparse.Namespace) -> Project:
    """Return the project with the runs that a command line names."""
    files: list[Path] = []
    for path in options.files:
        if not path.exists():
            raise InputDataError(f"{path}: does not exist")
        is_run = path.is_file() or (path / "metadata.yaml").exists()
        files += [path] if is_run else find_recordings(path, (*SUFFIXES, *READ_SUFFIXES)).values()
    place = None if options.payload_position_m is None else tuple(options.payload_position_m)
    bundled = options.vehicle and not Path(options.vehicle).exists()
    vehicle = options.vehicle if bundled or not options.vehicle else project.written(options.vehicle)
    channels = project.written(options.channels) if options.channels else ""
    new = [
        PlannedRun(
            project.written(file), vehicle, channels, options.payload_kg, place, tuple(options.tags), options.from_s, options.to_s
        )
        for file in files
    ]
    twice = {run.name for run in project.runs} & {run.name for run in new}
    if twice:
        raise ConfigurationError(f"{', '.join(sorted(twice))}: in the table already; parts of one file need --from and --to")
    return dataclasses.replace(project, runs=(*project.runs, *new))


def _run(options: argparse.Namespace) -> int:
    if options.workers < 1:
        raise ConfigurationError(f"--workers {options.workers}; allowed: 1 or more")
    project = load_project(options.folder)
    tasks = _tasks(project, options)
    rows = collect(tasks, options)
    _summarise(project, rows)
    say(rows)
    if not any(row.result for row in rows):
        raise InputDataError(f"{options.folder}: not one of {len(rows)} runs could be replayed; the reasons are above")
    return 0


def _report(options: argparse.Namespace) -> int:
    project = load_project(options.folder)
    rows = [finished_row(run.name, _folder(project, run), _labels(project, run)) for run in project.runs]
    _summarise(project, rows)
    finished = sum(bool(row.result) for row in rows)
    print(f"{finished} of {len(rows)} runs are finished; 'project run' replays the others")
    return 0


def _summarise(project: Project, rows: Sequence[FleetRow]) -> None:
    out = output_folder(project.folder / "out")
    write_summary(rows, out, f"{project.folder.resolve().name}: {len(rows)} runs", "project", "csv")
    print(f"written to {out}: project.csv, report.html, runs")


def _tasks(project: Project, options: argparse.Namespace) -> list[FleetTask]:
    """Return what is to be done for every run.

    Raises
    ------
    ConfigurationError
        No runs, or mistakes in vehicle files, channel maps and limits, all of them at once.
    """
    if not project.runs:
        raise ConfigurationError("no runs yet; 'project add' adds some", where=str(project.folder))
    problems: list[str] = []
    tasks = []
    for planned in project.runs:
        try:
            tasks.append(
                FleetTask(
                    planned.name, str(project.file_of(planned).resolve()), str(_folder(project, planned)),
                    _job(project, planned, options), _labels(project, planned),
                )
            )  # fmt: skip
        except RideEstimationError as error:
            words = str(error)
            problems += [words] if words not in problems else []
    if problems:
        raise ConfigurationError(problems, where=str(project.folder))
    return tasks


def _folder(project: Project, planned: PlannedRun) -> Path:
    return (project.folder / "out" / "runs" / folder_name(planned.name)).resolve()


def _labels(project: Project, planned: PlannedRun) -> dict[str, str]:
    """Return what is said of a run in tables."""
    vehicle = Path(planned.vehicle or project.vehicle).stem
    return {"vehicle": vehicle, "payload [kg]": f"{planned.payload_kg:g}", "tags": " ".join(planned.tags)}


def _job(project: Project, planned: PlannedRun, options: argparse.Namespace) -> ReplayJob:
    """Return how a run is replayed: with its own vehicle, load, channel map and part."""
    chosen = argparse.Namespace(**vars(options))
    chosen.vehicle = project.place(planned.vehicle or project.vehicle)
    measured = Path(planned.file).suffix.lower() in READ_SUFFIXES
    chosen.channels = project.place(planned.channels or project.channels) if measured else ""
    chosen.events = ""
    chosen.without, chosen.from_s, chosen.to_s = [], planned.begin, planned.end
    job = ReplayJob.of(chosen, () if options.no_run_reports else ("html",))
    if chosen.channels:
        load_channel_map(Path(chosen.channels), job.vehicle.sensors)
    if planned.payload_kg:
        place = None if planned.payload_position_m is None else np.array(planned.payload_position_m)
        loaded = with_payload(job.vehicle, geometry_of(job.vehicle).body.name, planned.payload_kg, place)
        job = dataclasses.replace(job, vehicle=loaded)
    require_layout(job.vehicle)
    return job
