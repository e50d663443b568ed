# Copyright 2026 ride_estimation contributors
"""Mistaken and hostile arguments to every command: exit code 2, one message that names what was given, nothing lost."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.cli.main import main, verb_helps
from ride_estimation.cli.terminal import printable_output
from ride_estimation.io.vehicle_file import load_vehicle

ROOT = Path(__file__).parents[2]
BAGS = ROOT / "bags"
MISTAKES = {
    "mass_kg: {value: 1200.0": "mass_kg: {value: -1200.0",
    "iyy: 540.0": "iyy: much",
    "kind: kelvin_voigt": "kind: kelvin_vogt",
    "noise_m_per_s2: 0.02": "noise_mm_per_s2: 20",
    "base: chassis": "base: chasis",
}
#: verb -> arguments that are right beside the vehicle file
WITH_VEHICLE = {
    "replay": [str(BAGS / "standing"), "--out", "out"],
    "diagnose": [str(BAGS / "standing"), "--out", "out"],
    "calibrate": [str(BAGS / "standing")],
    "compare": [str(BAGS / "standing"), "--out", "out"],
    "fleet": [str(BAGS), "--out", "out"],
    "project": ["init", "campaign", str(BAGS / "standing")],
    "plan": [],
    "inspect": [str(BAGS / "standing")],
    "map": ["table.csv"],
    "import-file": ["table.csv", "--out", "out"],
    "export-file": [str(BAGS / "standing"), "--out", "out.csv"],
    "compare-models": [str(BAGS / "standing")],
    "simulate": [str(BAGS / "standing" / "recipe.yaml"), "--out", "out"],
}


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a table, an empty folder, an empty file, and a vehicle file with five mistakes."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "nothing.mcap").touch()
    text = (ROOT / "config" / "vehicles" / "truck_cab.yaml").read_text(encoding="utf-8")
    for right, wrong in MISTAKES.items():
        assert right in text
        text = text.replace(right, wrong, 1)
    (tmp_path / "five.yaml").write_text(text, encoding="utf-8")
    time = np.arange(600) / 200.0
    columns = [time, 5.0 * np.sin(6.28 * time), 500.0 * np.sin(6.28 * time) + 50.0 * np.cos(6.28 * time)]
    np.savetxt("table.csv", np.stack(columns, axis=1), delimiter=",", header="time_s,displacement_mm,force_n", comments="")
    np.savetxt("unitless.csv", np.stack(columns, axis=1), delimiter=",", header="time_s,displacement,force", comments="")
    road = [time, 0.01 * columns[1], columns[1], columns[1]]
    header = "time_s,road_m,body_acceleration_m_per_s2,axle_acceleration_m_per_s2"
    np.savetxt("road.csv", np.stack(road, axis=1), delimiter=",", header=header, comments="")
    return tmp_path


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Run a command that must be refused; return the message."""
    try:
        code = main(list(words))
    except SystemExit as ended:  # argparse ends the program by itself
        code = int(str(ended.code))
    message = capsys.readouterr().err
    assert code == 2, f"{words}: exit code {code}"
    assert message.strip(), words
    return message


@pytest.mark.parametrize("verb", sorted(WITH_VEHICLE))
def test_all_mistakes_of_a_vehicle_file_at_once(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    message = refused(capsys, verb, *WITH_VEHICLE[verb], "--vehicle", "five.yaml")
    assert "5 mistakes" in message
    for field in ("mass_kg", "iyy", "kelvin_vogt", "noise_mm_per_s2", "chasis"):
        assert field in message


@pytest.mark.parametrize("verb", sorted(WITH_VEHICLE))
def test_a_vehicle_that_is_none(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert "there are backhoe_loader_cab" in refused(capsys, verb, *WITH_VEHICLE[verb], "--vehicle", "truk_cab")
    assert "truk.yaml: the file does not exist" in refused(capsys, verb, *WITH_VEHICLE[verb], "--vehicle", "truk.yaml")
    assert "Is a directory" in refused(capsys, verb, *WITH_VEHICLE[verb], "--vehicle", "empty")


@pytest.mark.parametrize("verb", ["replay", "diagnose", "calibrate", "compare", "export-file", "compare-models", "inspect"])
@pytest.mark.parametrize(("run", "words"), [("absent", "does not exist"), ("empty", "contains no"), ("nothing.mcap", "empty")])
def test_a_run_that_is_none(verb: str, run: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    out = [] if verb in ("calibrate", "compare-models", "inspect") else ["--out", "out.csv" if verb == "export-file" else "out"]
    message = refused(capsys, verb, run, "--vehicle", "truck_cab", *out)
    assert words in message and run in message


@pytest.mark.parametrize("command", [
    ["replay", str(BAGS / "standing"), "--vehicle", "truck_cab"],
    ["diagnose", str(BAGS / "standing"), "--vehicle", "truck_cab"],
    ["compare-models", str(BAGS / "standing"), "--vehicle", "truck_cab"],
    ["simulate", str(BAGS / "standing" / "recipe.yaml")],
    ["fleet", str(BAGS), "--vehicle", "truck_cab"],
    ["identify", "table.csv"],
    ["design-test", "--model", "kelvin_voigt", "--expect", "stiffness=2e5", "damping=900"],
    ["quarter-car", "road.csv", "--sprung-mass-kg", "3000", "--unsprung-mass-kg", "300"],
])  # fmt: skip
def test_output_that_cannot_be_written_is_refused_before_the_work(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert "cannot be made" in refused(capsys, *command, "--out", "five.yaml/below")


@pytest.mark.parametrize(("command", "words"), [
    (["replay", str(BAGS / "standing"), "--vehicle", "truck_cab", "--out", ""], "an empty argument after --out"),
    (["replay", str(BAGS / "standing"), "--vehicle", "truck_cab", "--out", "o", "--format", "html", "none"], "none stands alone"),
    (["replay", str(BAGS / "standing"), "--vehicle", "truck_cab", "--out", "o", "--without", "nobody"], "no such sensor"),
    (["replay", str(BAGS / "standing"), "--vehicle", "truck_cab", "--out", "o", "--rate", "nan"], "allowed: 20 to 20000"),
    (["fleet", "table.csv", "--vehicle", "truck_cab", "--out", "o"], "is a file"),
    (["fleet", "empty", "--vehicle", "truck_cab", "--out", "o"], "no recording below it"),
    (["plan", "--vehicle", "truck_cab", "--speed", "1e9", "--rate", "1"], "2 mistakes"),
    (["calibrate", str(BAGS / "nominal"), "--vehicle", "truck_cab"], "m/s^2 (at rest below"),
    (["export-file", str(BAGS / "standing"), "--vehicle", "truck_cab", "--out", "o.xlsx"], "allowed endings"),
    (["import-file", "unitless.csv", "--vehicle", "truck_cab", "--out", "o"], "a channel map is needed"),
    (["identify", "unitless.csv", "--out", "o"], "pass --displacement-unit"),
    (["identify", "table.csv", "--out", "o", "--rate", "nan"], "--rate nan"),
    (["design-test", "--model", "kelvin_voigt", "--expect", "stiffness=2e5", "damping=nan", "--out", "o"], "--expect"),
    (["design-test", "--model", "kelvin_voigt", "--expect", "stiffness=2e5", "damping=9", "--stroke-mm", "nan", "--out", "o"],
     "--stroke-mm nan"),
    (["procedure", "force", "table.csv", "--element", "absent.yaml", "--out", "o.csv"], "does not exist"),
    (["procedure", "damping", "road.csv", "--body", "body_acceleration", "--base", "axle_acceleration", "--mass-kg", "-3",
      "--stiffness-n-per-m", "1e4", "--block", "64"], "above 0"),
    (["procedure", "operating-range", "table.csv"], "no column 'travel'"),
    (["quarter-car", "table.csv", "--sprung-mass-kg", "3000", "--unsprung-mass-kg", "300"], "no column 'road' (such as road_m)"),
    (["quarter-car", "road.csv", "--sprung-mass-kg", "3000", "--unsprung-mass-kg", "300", "--speed-m-per-s", "-1"], "0 or more"),
    (["procedure", "loop", "unitless.csv", "--frequency", "1"], "has no unit in its name; needed is m"),
    (["procedure", "loop", "table.csv", "--frequency", "0"], "above 0 Hz"),
    (["procedure", "seat", "road.csv", "--column", "road"], "is in m; needed is m/s^2"),
    (["procedure", "velocity", "road.csv", "--column", "body_acceleration", "--out", "five.yaml/v.csv"], "cannot be made"),
    (["diagnose", str(BAGS / "standing"), "--vehicle", "truck_cab", "--out", "o", "--validate", str(BAGS / "standing")],
     "is the run that is fitted"),
    (["diagnose", str(BAGS / "standing"), "--vehicle", "truck_cab", "--out", "o", "--mount", "fl"], "are for bench records"),
    (["diagnose", str(BAGS / "standing"), "--out", "o", "--oscillator", "u,x"], "--oscillator reads records (.csv"),
    (["calibrate", str(BAGS / "standing"), "--vehicle", "truck_cab", "--out", "v.docx"], "is written as .yaml or .yml"),
    (["import-file", "absent.mf4", "--vehicle", "truck_cab", "--out", "o"], "does not exist"),
    (["import-file", "empty", "--vehicle", "truck_cab", "--out", "o"], "is a folder"),
    (["replay", str(BAGS), "--vehicle", "truck_cab", "--out", "o"], "'fleet' takes them all"),
    (["view", "empty"], "neither report.html nor run.mcap"),
    (["replay"], "replay: the following arguments are required: RUN, --out, --vehicle; see 'ride-estimation replay --help'"),
    (["compare-models", str(BAGS / "standing"), "--vehicle", "truck_cab", "--validate", str(BAGS / "standing")],
     "is the run that is fitted"),
])  # fmt: skip
def test_one_message_names_what_was_given(command: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert words in refused(capsys, *command)


def test_the_table_above_knows_every_command() -> None:
    others = {"identify", "design-test", "quarter-car", "procedure", "completion", "demo", "new-vehicle", "export-model", "view"}
    assert set(WITH_VEHICLE) | others == set(verb_helps())


def test_a_long_and_foreign_name_goes_in_and_out(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (ROOT / "config" / "vehicles" / "truck_cab.yaml").read_text(encoding="utf-8")
    vehicle = place / f"Führerhaus_駕駛室_{'n' * 150}.yaml"
    vehicle.write_text(text.replace("cab_front_left:", "käbin_前_左:"), encoding="utf-8")
    found = place / f"Größe {'m' * 150}.yaml"
    assert main(["calibrate", str(BAGS / "standing"), "--vehicle", str(vehicle), "--out", str(found)]) == 0
    assert "käbin_前_左" in capsys.readouterr().out
    assert "käbin_前_左" in load_vehicle(found).sensors


def test_calibrate_does_not_overwrite_the_file_it_reads(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vehicle = place / "mine.yaml"
    vehicle.write_text((ROOT / "config" / "vehicles" / "truck_cab.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    before = vehicle.read_bytes()
    assert "comments would be lost" in refused(
        capsys, "calibrate", str(BAGS / "standing"), "--vehicle", str(vehicle), "--out", str(vehicle)
    )
    assert vehicle.read_bytes() == before


def test_the_reader_of_the_output_may_leave() -> None:
    command = f"{sys.executable} -m ride_estimation.cli.main plan --vehicle truck_cab --bounds-only"
    piped = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {command} | true"], capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )  # fmt: skip
    assert "Traceback" not in piped.stderr and "Exception ignored" not in piped.stderr


def test_a_terminal_that_closed_before_the_end_of_the_program_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """From Python 3.13 on the interpreter reports what a stream raises as it is deleted."""
    written = io.BytesIO()
    target = io.TextIOWrapper(written, encoding="utf-8")
    monkeypatch.setattr(sys, "stdout", target)
    with printable_output():
        stream = sys.stdout
        print("text", flush=True)
    assert written.getvalue() == b"text\n"
    target.close()
    stream.flush()
    stream.close()
