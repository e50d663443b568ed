# Copyright 2026 ride_estimation contributors
"""A project: a folder with a vehicle, a channel map and a table of runs, so that many recordings are evaluated alike.

``project.yaml`` names what holds for every run, ``runs.csv`` has one line per run::

    schema: ride_estimation/project/1
    vehicle: vehicle.yaml
    channels: channels.yaml

    file,vehicle,channels,payload_kg,payload_position_m,tags,from,to
    ../recordings/belgian_block_01.mf4,,,250,1.2 0 1.4,loaded belgian,12,480

An empty cell means what the project says. Paths are relative to the folder of the project.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import os
from collections.abc import Sequence
from pathlib import Path

import yaml

from ride_estimation.errors import ConfigurationError
from ride_estimation.io.atomic import write_atomically
from ride_estimation.io.document import Section, as_number, read_yaml, shown
from ride_estimation.io.text_table import read_text_table

SCHEMA = "ride_estimation/project/1"
COLUMNS = ("file", "vehicle", "channels", "payload_kg", "payload_position_m", "tags", "from", "to")
PROJECT, RUNS = "project.yaml", "runs.csv"


@dataclasses.dataclass(frozen=True)
class PlannedRun:
    """One line of the table of runs.

    Attributes
    ----------
    file
        Recording, as the table writes it.
    vehicle, channels
        Instead of those of the project; empty: those.
    payload_kg
        Load on the body that the vehicle file does not know [kg].
    payload_position_m
        Where it is [m], vehicle-file axes; None: at the CG.
    tags
        Words to group runs by.
    begin, end
        Part that is used: seconds since the first stamp, a marker, or empty.
    """

    file: str
    vehicle: str = ""
    channels: str = ""
    payload_kg: float = 0.0
    payload_position_m: tuple[float, float, float] | None = None
    tags: tuple[str, ...] = ()
    begin: str = ""
    end: str = ""

    @property
    def name(self) -> str:
        """Return what tells the run from others: the file and the part of it."""
        part = f" {self.begin or 'begin'} to {self.end or 'end'}" if self.begin or self.end else ""
        return f"{self.file}{part}"


@dataclasses.dataclass(frozen=True)
class Project:
    """A project folder.

    Attributes
    ----------
    folder
        Where ``project.yaml`` is.
    vehicle, channels
        For every run that says nothing else; paths in the folder, or the name of a bundled vehicle; channels may be empty.
    runs
        Lines of the table.
    """

    folder: Path
    vehicle: str
    channels: str = ""
    runs: tuple[PlannedRun, ...] = ()

    def place(self, path: str) -> str:
        """Return a path of the project as seen from here; the name of a bundled vehicle stays."""
        inside = self.folder / path
        return str(inside) if path and inside.exists() else path

    def file_of(self, run: PlannedRun) -> Path:
        """Return where the recording of a run is."""
        return self.folder / run.file

    def written(self, path: str | Path) -> str:
        """Return a path as the table writes it: relative where it is near the project, so that both can be moved together."""
        return Path(os.path.relpath(Path(path).resolve(), self.folder.resolve())).as_posix()


def load_project(folder: Path) -> Project:
    """Load a project.

    Raises
    ------
    ConfigurationError
        No project there, or mistakes in its files, all of them at once.
    """
    path = folder / PROJECT
    if not path.is_file():
        raise ConfigurationError("no such project: there is no project.yaml; 'project init' makes one", where=str(folder))
    problems: list[str] = []
    top = Section(read_yaml(path), "", problems)
    top.text("schema", None, allowed=(SCHEMA,), meaning=f"must be {SCHEMA}")
    vehicle = top.text("vehicle", None, meaning="vehicle file, or the name of a bundled one") or ""
    channels = top.text("channels", "") or ""
    top.finish()
    if problems:
        raise ConfigurationError(problems, where=str(path))
    return Project(folder, vehicle, channels, _read_runs(folder / RUNS))


def _read_runs(path: Path) -> tuple[PlannedRun, ...]:
    if not path.is_file():
        raise ConfigurationError("the table of runs is missing", where=str(path))
    table = read_text_table(path)
    head = [cell.strip().lower() for cell in table.rows[0]] if table.rows else []
    unknown = [name for name in head if name not in COLUMNS]
    if "file" not in head or unknown:
        what = f"unknown column {', '.join(map(shown, unknown))}" if unknown else "the column 'file' is missing"
        raise ConfigurationError(f"{what}; columns: {', '.join(COLUMNS)}", where=str(path))
    problems: list[str] = []
    runs: list[PlannedRun] = []
    for line, row in zip(table.lines[1:], table.rows[1:]):
        cells = {name: cell.strip() for name, cell in zip(head, row)}
        payload, place = as_number(cells.get("payload_kg") or 0.0), cells.get("payload_position_m", "")
        position = [as_number(word) for word in place.replace(",", " ").replace(";", " ").split()]
        wrong = []
        if not cells["file"]:
            wrong.append("no file")
        if payload is None:
            wrong.append(f"payload_kg: {shown(cells['payload_kg'])} is not a number")
        if place and (len(position) != 3 or None in position):
            wrong.append(f"payload_position_m: {shown(place)}; three numbers are needed")
        problems += [f"row {line}: {words}" for words in wrong]
        if not wrong and payload is not None:
            at = None if not place else (float(position[0] or 0.0), float(position[1] or 0.0), float(position[2] or 0.0))
            tags = tuple(cells.get("tags", "").replace(",", " ").replace(";", " ").split())
            vehicle, channels, begin, end = (cells.get(name, "") for name in ("vehicle", "channels", "from", "to"))
            run = PlannedRun(cells["file"], vehicle, channels, payload, at, tags, begin, end)
            if any(other.name == run.name for other in runs):
                problems.append(f"row {line}: {run.name} is there already; give the parts of one file different from and to")
            runs.append(run)
    if problems:
        raise ConfigurationError(problems, where=str(path))
    return tuple(runs)


def save_project(project: Project) -> None:
    """Write ``project.yaml`` and ``runs.csv``."""
    document = {"schema": SCHEMA, "vehicle": project.vehicle}
    if project.channels:
        document["channels"] = project.channels
    write_atomically(project.folder / PROJECT, yaml.safe_dump(document, sort_keys=False, allow_unicode=True))
    save_runs(project)


def save_runs(project: Project) -> None:
    """Write ``runs.csv``."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(_line(run) for run in project.runs)
    write_atomically(project.folder / RUNS, stream.getvalue())


def _line(run: PlannedRun) -> Sequence[str]:
    place = "" if run.payload_position_m is None else " ".join(f"{v:g}" for v in run.payload_position_m)
    payload = f"{run.payload_kg:g}" if run.payload_kg else ""
    return (run.file, run.vehicle, run.channels, payload, place, " ".join(run.tags), run.begin, run.end)
