# Copyright 2026 ride_estimation contributors
"""One run of a fleet: replayed, kept from an earlier call, or failed with the reason; never an exception."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import time
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ride_estimation.cli.replay import ReplayJob, replay_run
from ride_estimation.errors import InputDataError, RideEstimationError
from ride_estimation.io.json_file import jsonable, read_json, write_json
from ride_estimation.io.recorded_run import checksum_of_run
from ride_estimation.io.result_files import read_result
from ride_estimation.io.results import sha256_of, software
from ride_estimation.io.run_events import table_beside
from ride_estimation.io.vehicle_file import vehicle_to_mapping

#: what a finished run was made with; another one is not taken for it
MARK = "fleet_job.json"


@dataclasses.dataclass(frozen=True)
class FleetTask:
    """One run of a fleet.

    Attributes
    ----------
    name
        Path of the recording below the fleet folder.
    recording, folder
        Where it is read and where its results go; a cluster needs both on a shared disk.
    job
        What to do.
    labels
        What is said of the run in tables: vehicle, payload, tags.
    """

    name: str
    recording: str
    folder: str
    job: ReplayJob
    labels: Mapping[str, str] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class FleetRow:
    """What became of one run.

    Attributes
    ----------
    name
        Of the task.
    status
        ``done``, ``kept`` (was finished before with the same data and settings) or ``failed``.
    error
        Why it failed.
    result
        Content of ``result.json``, empty for a failed run.
    seconds
        Time it took.
    labels
        Of the task.
    report
        Its report, seen from the folder of the fleet; empty where none was written.
    """

    name: str
    status: str
    error: str
    result: dict[str, Any]
    seconds: float
    labels: Mapping[str, str] = dataclasses.field(default_factory=dict)
    report: str = ""


def fingerprint(task: FleetTask) -> dict[str, Any]:
    """Return everything the results of a task depend on.

    Raises
    ------
    InputDataError
        The recording is missing or no bag.
    """
    job = dataclasses.asdict(dataclasses.replace(task.job, vehicle=None))  # type: ignore[arg-type]
    beside = [task.job.channels, task.job.events or table_beside(Path(task.recording))]
    found = {
        "recording": checksum_of_run(Path(task.recording)), "vehicle": vehicle_to_mapping(task.job.vehicle), "job": job,
        "beside": [sha256_of(Path(path)) if path and Path(path).is_file() else "" for path in beside], "software": software(),
    }  # fmt: skip
    # as it comes back from the file
    return dict(json.loads(json.dumps(jsonable(found))))


def process_task(task: FleetTask) -> FleetRow:
    """Replay one run, or keep what an earlier call with the same data and settings left; never raises."""
    started = time.monotonic()
    try:
        folder = Path(task.folder)
        wanted = fingerprint(task)
        mark = folder / MARK
        kept = _kept(folder, wanted)
        if kept is not None:
            return _row(task, "kept", "", kept, started)
        mark.unlink(missing_ok=True)
        folder.mkdir(parents=True, exist_ok=True)
        document, _, _ = replay_run(task.recording, task.job, folder)
        write_json(mark, wanted)
        return _row(task, "done", "", dict(jsonable(document)), started)
    except RideEstimationError as error:
        return _failed(task, " ".join(str(error).split()), started)
    except Exception as error:
        # a fault of this program in one run: the table keeps it with its place, the other runs go on
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}:{place.lineno}"
        return _failed(task, f"{type(error).__name__} at {where}: {error}", started)


def _failed(task: FleetTask, why: str, started: float) -> FleetRow:
    with contextlib.suppress(OSError):  # a folder that holds nothing is no run to whoever names them all
        Path(task.folder).rmdir()
    return _row(task, "failed", why, {}, started)


def failed_row(task: FleetTask, why: str) -> FleetRow:
    """Return the row of a run whose process did not come back."""
    return _failed(task, why, time.monotonic())


def finished_row(name: str, folder: Path, labels: Mapping[str, str]) -> FleetRow:
    """Return the row of a run from what an earlier call left in its folder, without any work."""
    try:
        return FleetRow(name, "kept", "", read_result(folder), 0.0, labels, _report_of(folder))
    except InputDataError:
        return FleetRow(name, "failed", "not replayed yet", {}, 0.0, labels)


def _row(task: FleetTask, status: str, error: str, result: dict[str, Any], started: float) -> FleetRow:
    report = _report_of(Path(task.folder)) if result else ""
    return FleetRow(task.name, status, error, result, time.monotonic() - started, task.labels, report)


def _report_of(folder: Path) -> str:
    """Return where the report of a run is, seen from the folder above ``runs``; empty where there is none."""
    return f"{folder.parent.name}/{folder.name}/report.html" if (folder / "report.html").is_file() else ""


def _kept(folder: Path, wanted: dict[str, Any]) -> dict[str, Any] | None:
    """Return the results of an earlier call where they are complete and of the same data and settings."""
    try:
        return read_result(folder) if read_json(folder / MARK) == wanted else None
    except InputDataError:
        return None
