# Copyright 2026 ride_estimation contributors
"""``new-vehicle``: what it writes loads, stands, and goes into ``plan``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ride_estimation.cli.main import main
from ride_estimation.io.channel_guess import guess_channels
from ride_estimation.io.files.channels import FileChannel
from ride_estimation.io.vehicle_file import body_layout, load_vehicle


@pytest.mark.parametrize(("mounts", "sensors"), [(1, 3), (2, 4), (3, 5), (4, 4), (7, 9), (8, 24)])
def test_the_file_loads_with_the_numbers_asked_for(mounts: int, sensors: int, tmp_path: Path) -> None:
    path = tmp_path / "v.yaml"
    assert main(["new-vehicle", "--mounts", str(mounts), "--sensors", str(sensors), "--out", str(path)]) == 0
    vehicle = load_vehicle(path)
    assert len(vehicle.mounts) == mounts
    assert sum(s.body == "cab" for s in vehicle.sensors.values()) == sensors
    assert {s.mount for s in vehicle.sensors.values() if s.body == "chassis"} == set(vehicle.mounts)
    assert body_layout(vehicle, "cab").complete


@pytest.mark.parametrize(("mounts", "sensors", "mass"), [(4, 4, 1000.0), (2, 3, 0.5), (3, 0, 4e4)])
def test_plan_runs_on_it_and_the_vehicle_stands(
    mounts: int, sensors: int, mass: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(tmp_path / "v.yaml")
    numbers = ["--mounts", str(mounts), "--sensors", str(sensors), "--mass-kg", str(mass)]
    assert main(["new-vehicle", *numbers, "--out", path]) == 0
    assert main(["plan", "--vehicle", path, "--bounds-only"]) == 0
    said = capsys.readouterr().out
    assert "undamped modes" in said and "does not stand" not in said


def test_an_existing_file_and_impossible_numbers_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "v.yaml"
    path.write_text("mine", encoding="utf-8")
    assert main(["new-vehicle", "--out", str(path)]) == 2
    assert path.read_text(encoding="utf-8") == "mine" and "exists already" in capsys.readouterr().err
    new = str(tmp_path / "new.yaml")
    wrong = ["--mounts", "0", "--sensors", "999", "--mass-kg", "-3", "--name", "a: b"]
    assert main(["new-vehicle", *wrong, "--out", new]) == 2
    message = capsys.readouterr().err
    assert all(word in message for word in ("0 mounts", "999 sensors", "-3 kg", "'a: b'")) and not Path(new).exists()
    assert main(["new-vehicle", "--out", str(tmp_path / "no" / "v.yaml")]) == 2


def test_a_terminal_is_asked_for_what_is_not_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def answer(question: str) -> str:
        asked.append(question)
        return {"number of mounts": "3"}.get(question.partition(" [")[0], "")

    monkeypatch.setattr("ride_estimation.cli.new_vehicle.at_terminal", lambda: True)
    monkeypatch.setattr("builtins.input", answer)
    assert main(["new-vehicle", "--sensors", "5", "--out", str(tmp_path / "v.yaml")]) == 0
    vehicle = load_vehicle(tmp_path / "v.yaml")
    assert len(vehicle.mounts) == 3 and len(asked) == 3


PARTS = "mass_kg,x_m,y_m,z_m,ixx_kg_mm2,iyy_kg_mm2,izz_kg_mm2,ixz_kg_mm2\n"


def test_mass_cg_and_inertia_come_from_a_table_of_parts(tmp_path, capsys):
    """Two half boxes of 50 kg make a box of 2 x 0.6 x 0.4 m; about a point beside it the parallel axes come on top."""
    half = ",".join(f"{50 * 1e6 * (u**2 + w**2) / 12:.9g}" for u, w in ((0.6, 0.4), (1.0, 0.4), (1.0, 0.6)))
    parts, out = tmp_path / "parts.csv", tmp_path / "v.yaml"
    parts.write_text(f"{PARTS}50,0.5,0.1,0.2,{half},0\n50,1.5,0.1,0.2,{half},0\n")
    assert main(["new-vehicle", "--parts", str(parts), "--about", "0", "0.1", "0.2", "--out", str(out)]) == 0
    assert "about (0, 0.1, 0.2) m (parallel axes): Ixx 4.3333, Iyy 134.67, Izz 136.33 kg m^2" in capsys.readouterr().out
    body = load_vehicle(out).bodies["cab"]
    assert body.mass.value == 100.0
    assert np.asarray(body.cg) == pytest.approx([1.0, 0.1, 0.2])
    assert np.asarray(body.inertia) == pytest.approx(np.diag([100 * 0.52, 100 * 4.16, 100 * 4.36]) / 12, rel=1e-5)


@pytest.mark.parametrize(
    ("rows", "more", "said"),
    [
        ("1200,0,0,0,7.3e14,5.4e14,8.1e14,0", [], "row 2: inertia ixx"),
        ("-3,0,0,0,1e6,1e6,1e6,0", [], "row 2: mass -3 kg"),
        ("3,0,0,0,1e6,1e6,1e6,0", ["--mass-kg", "3"], "use one"),
    ],
)
def test_parts_that_cannot_be_are_refused(tmp_path, capsys, rows, more, said):
    parts, out = tmp_path / "parts.csv", tmp_path / "v.yaml"
    parts.write_text(PARTS + rows + "\n")
    assert main(["new-vehicle", "--parts", str(parts), *more, "--out", str(out)]) == 2
    assert said in capsys.readouterr().err
    assert not out.exists()


def test_a_point_without_parts_is_refused(tmp_path, capsys):
    assert main(["new-vehicle", "--about", "0", "0", "0", "--out", str(tmp_path / "v.yaml")]) == 2
    assert "--parts" in capsys.readouterr().err


def test_channels_of_a_logger_are_assigned_by_the_corners_in_their_names(tmp_path: Path) -> None:
    assert main(["new-vehicle", "--out", str(tmp_path / "v.yaml")]) == 0
    vehicle = load_vehicle(tmp_path / "v.yaml")
    time, corners = np.arange(4.0), {"FL": "front_left", "FR": "front_right", "RL": "rear_left", "RR": "rear_right"}
    names = [f"Acc{place}{corner}_{axis}" for place in ("Cab", "Frame") for corner in corners for axis in "XYZ"]
    channels = [FileChannel(name, "mg", time, np.full(4, 1e3 * (name[-1] == "Z"))) for name in names]
    found = guess_channels(channels, vehicle.sensors, vehicle.gravity)
    bodies = {"Cab": "cab", "Frame": "chassis"}
    assert {g.channel: name for name, g in found.items()} == {
        name: f"{bodies[name[3:-4]]}_{corners[name[-4:-2]]}.{name[-1].lower()}" for name in names
    }
