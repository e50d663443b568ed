# Copyright 2026 ride_estimation contributors
"""A project: logger files go in as they are, each with its own load and part; what is finished is kept; one report."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ride_estimation.cli import fleet
from ride_estimation.cli.main import main
from ride_estimation.cli.pool import Outcome
from ride_estimation.errors import ConfigurationError
from ride_estimation.io.json_file import read_json
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.resources import shared_path
from ride_estimation.vehicles.payload import with_payload

FAST = ["--no-smoothing", "--no-run-reports"]


def in_this_process(items: Sequence[Any], workers: int, work: Any) -> Iterator[Outcome[Any, Any]]:
    """The pool without processes."""
    for item in items:
        yield Outcome(item, work(item))


@pytest.fixture(scope="module")
def logger_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two files as a logger writes them, and the map that says which column is which sensor."""
    folder = tmp_path_factory.mktemp("campaign")
    (folder / "recordings").mkdir()
    bag = str(shared_path("bags", "standing"))
    for name, begin, end in (("one", "1", "3"), ("two", "6", "8")):
        out = str(folder / "recordings" / f"{name}.csv")
        assert main(["export-file", bag, "--vehicle", "truck_cab", "--from", begin, "--to", end, "--out", out]) == 0
    for path in (folder / "recordings").iterdir():
        head, rest = path.read_text().split("\n", 1)
        path.write_text(head.replace("cab_front_left.x", "CH1") + "\n" + rest)
    names = [part.rpartition(" [")[0] for part in head.split(",")[1:]]
    lines = [f"  {name}: {'CH1' if name == 'cab_front_left.x' else name}" for name in names]
    (folder / "map.yaml").write_text("schema: ride_estimation/channels/1\nchannels:\n" + "\n".join(lines) + "\n")
    return folder


def table(project: Path) -> dict[str, dict[str, str]]:
    with (project / "out" / "project.csv").open(newline="") as stream:
        return {row["run"]: row for row in csv.DictReader(stream)}


def test_a_project_from_files_to_report(
    logger_files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet, "run_on_pool", in_this_process)
    project, files = tmp_path / "project", logger_files / "recordings"
    arguments = [str(project), str(files), "--vehicle", "truck_cab", "--channels", str(logger_files / "map.yaml")]
    assert main(["project", "init", *arguments, "--tags", "empty"]) == 0
    one = str(files / "one.csv")
    assert main(["project", "add", str(project), one, "--from", "0.5", "--payload-kg", "300", "--tags", "loaded"]) == 0
    assert main(["project", "run", str(project), *FAST]) == 0
    assert "3 runs: 3 replayed, 0 kept from before, 0 failed" in capsys.readouterr().out
    rows = table(project)
    (loaded,) = [row for row in rows.values() if row["tags"] == "loaded"]
    (same,) = [row for name, row in rows.items() if name.endswith("one.csv")]
    assert float(loaded["duration [s]"]) == pytest.approx(float(same["duration [s]"]) - 0.5, abs=0.05)
    results = {path.parent.name: read_json(path) for path in (project / "out" / "runs").glob("*/result.json")}
    assert len(results) == 3 and not any(name.startswith(".") for name in results)
    masses = sorted(p["value"] for r in results.values() for p in r["parameters"] if p["name"] == "cab.mass")
    assert masses == pytest.approx([1200.0, 1200.0, 1500.0])
    page = (project / "out" / "report.html").read_text()
    assert "By tag" in page and "loaded (1)" in page
    # again: nothing to do; another load of one run: that one only
    assert main(["project", "run", str(project), *FAST]) == 0
    assert "0 replayed, 3 kept" in capsys.readouterr().out
    runs = project / "runs.csv"
    runs.write_text(runs.read_text().replace(",300,", ",250,"))
    assert main(["project", "run", str(project), *FAST]) == 0
    assert "1 replayed, 2 kept" in capsys.readouterr().out
    assert main(["project", "report", str(project)]) == 0
    assert "3 of 3 runs are finished" in capsys.readouterr().out


def test_bad_projects_are_refused(
    logger_files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet, "run_on_pool", in_this_process)

    def told(*words: str) -> str:
        assert main(["project", *words]) == 2
        return capsys.readouterr().err

    project, one = str(tmp_path / "p"), str(logger_files / "recordings" / "one.csv")
    assert "no such project" in told("run", project)
    assert main(["project", "init", project, one, "--vehicle", "truck_cab"]) == 0
    assert "is a project already" in told("init", project, "--vehicle", "truck_cab")
    assert "in the table already" in told("add", project, one)
    assert "does not exist" in told("add", project, "absent.mf4")
    assert "not one of 1 runs" in told("run", project, "--workers", "1")  # a column of another name and no map
    table_ = Path(project) / "runs.csv"
    for row, words in (
        (",,,,,,,", "no file"), ("a,,,heavy,,,,", "'heavy' is not a number"), ("a,,,,1 2,,,", "three numbers"),
        ("a,,,-1190,,,,", "10 kg would be left"), ("a,absent.yaml,,,,,,", "absent.yaml"),
    ):  # fmt: skip
        table_.write_text("file,vehicle,channels,payload_kg,payload_position_m,tags,from,to\n" + row + "\n")
        assert words in told("run", project), row
    table_.write_text("file,colour\na,red\n")
    assert "'colour'" in told("run", project)


def test_a_load_changes_the_body_as_statics_says() -> None:
    vehicle = load_vehicle("truck_cab")
    body = vehicle.bodies["cab"]
    place = body.cg + np.array([0.4, -0.3, 0.5])
    loaded = with_payload(vehicle, "cab", 300.0, place).bodies["cab"]
    # the moments of inertia about the origin add up, whatever the CG
    def about_origin(mass: float, cg: np.ndarray[Any, Any], inertia: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        return np.asarray(inertia + mass * (cg @ cg * np.eye(3) - np.outer(cg, cg)))

    expected = about_origin(body.mass.value, body.cg, body.inertia) + about_origin(300.0, place, np.zeros((3, 3)))
    assert about_origin(loaded.mass.value, loaded.cg, loaded.inertia) == pytest.approx(expected)
    assert loaded.mass.value * loaded.cg == pytest.approx(body.mass.value * body.cg + 300.0 * place)
    # taken off again
    back = with_payload(with_payload(vehicle, "cab", 300.0, place), "cab", -300.0, place).bodies["cab"]
    assert back.inertia == pytest.approx(body.inertia) and back.cg == pytest.approx(body.cg)
    with pytest.raises(ConfigurationError, match="would be left"):
        with_payload(vehicle, "cab", -1190.0)
