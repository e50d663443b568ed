# Copyright 2026 ride_estimation contributors
"""Runs side by side: the one that differs is named, similar ones are not, foreign folders are refused."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.cli import compare
from ride_estimation.cli.main import main
from ride_estimation.io.results import RESULT_SCHEMA
from ride_estimation.io.run_metrics import Metric
from ride_estimation.reporting.differences import differences


def finished(folder: Path, stiffness: float, std: float = 500.0, status: str = "valid") -> Path:
    """A replay as it lies on disk, written by hand."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    n = 2000
    np.savez(
        folder / "signals.npz", time_s=np.arange(n) / 200.0, valid=np.ones(n, bool), cg_accel=rng.normal(size=(n, 6)),
        mount_force=rng.normal(size=(n, 1, 3)), mount_names=np.array(["left"]),
    )  # fmt: skip
    parameter = {
        "name": "left.z.stiffness", "value": stiffness, "std": std, "unit": "N/m", "prior": 5e4, "status": status, "reason": "",
    }  # fmt: skip
    (folder / "result.json").write_text(
        json.dumps({
            "schema": RESULT_SCHEMA, "run": {"path": folder.name, "duration_s": 10.0}, "vehicle": {"name": "v"},
            "parameters": [parameter], "warnings": [], "digest": "0" * 64,
        })
    )  # fmt: skip
    return folder


def test_the_run_that_differs_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folders = [finished(tmp_path / f"r{i}", 5e4 + 200.0 * i) for i in range(4)]
    odd = finished(tmp_path / "odd", 6.5e4)
    assert main(["compare", *map(str, folders), str(odd), "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert "odd: left.z.stiffness is 65000 N/m" in printed and "r0:" not in printed
    text = (tmp_path / "out" / "report.html").read_text()
    assert '<figure class="chart">' in text and "65000" in text


@pytest.mark.parametrize(
    ("value", "std", "status"), [(6.5e4, 1e4, "valid"), (6.5e4, 500.0, "not_identifiable"), (5.06e4, 1.0, "valid")]
)
def test_uncertain_unidentified_and_hardly_different_values_do_not_stand_out(
    value: float, std: float, status: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folders = [finished(tmp_path / f"r{i}", 5e4 + 50.0 * i) for i in range(4)]
    odd = finished(tmp_path / "odd", value, std, status)
    assert main(["compare", *map(str, folders), str(odd), "--out", str(tmp_path / "out")]) == 0
    assert "no outlier" in capsys.readouterr().out


def test_a_warning_that_one_run_has_is_shown_and_is_no_outlier(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folders = [finished(tmp_path / f"r{i}", 5e4 + 50.0 * i) for i in range(4)]
    result = json.loads((folders[2] / "result.json").read_text())
    (folders[2] / "result.json").write_text(json.dumps(result | {"warnings": ["gyro <none>"]}))
    assert main(["compare", *map(str, folders), "--out", str(tmp_path / "out")]) == 0
    assert "no outlier" in capsys.readouterr().out
    assert "<td>r2</td><td>gyro &lt;none&gt;</td>" in (tmp_path / "out" / "report.html").read_text()


def test_folders_without_results_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", str(tmp_path / "none"), "--out", str(tmp_path / "out")]) == 2
    foreign = finished(tmp_path / "foreign", 5e4)
    (foreign / "result.json").write_text('{"schema": "something else"}')
    assert main(["compare", str(foreign), "--out", str(tmp_path / "out")]) == 2
    assert "schema" in capsys.readouterr().err


def test_damage_and_comfort_are_compared_and_an_outlier_is_marked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folders = []
    for i, amplitude in enumerate((100.0, 102.0, 98.0, 101.0, 400.0)):
        folder = finished(tmp_path / f"r{i}", 5e4)
        result = json.loads((folder / "result.json").read_text())
        entry = {
            "mount": "left", "axis": "z", "equivalent_amplitude_n": amplitude, "equivalent_lower_n": 0.8 * amplitude,
            "equivalent_upper_n": 1.2 * amplitude,
        }  # fmt: skip
        place = {"location": "cab at <b>a</b>", "z": {"a_w_m_per_s2": 0.5 + 0.001 * i}, "a8_m_per_s2": 0.4}
        result |= {"durability": {"slope": 5.0, "mounts": [entry]}, "comfort": {"places": [place]}}
        (folder / "result.json").write_text(json.dumps(result))
        folders.append(str(folder))
    assert main(["compare", *folders, "--out", str(tmp_path / "out"), "--format", "html", "pdf"]) == 0
    printed = capsys.readouterr().out
    assert "r4: left.z equivalent amplitude (slope 5) is 400 N, the median of 5 runs is 101 N" in printed
    assert "a_w" not in printed  # 0.1 % apart
    text = (tmp_path / "out" / "report.html").read_text()
    assert "400 ± 40 *" in text and "100 ± 10<" in text
    assert "<b>" not in text and "&lt;b&gt;" in text
    assert (tmp_path / "out" / "report.pdf").read_bytes().startswith(b"%PDF")


def test_a_recording_needs_a_vehicle_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "run").mkdir()
    assert main(["compare", str(tmp_path / "run"), "--out", str(tmp_path / "out")]) == 2
    assert "--vehicle" in capsys.readouterr().err


def test_recordings_are_replayed_first_and_names_are_kept_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = finished(tmp_path / "done", 5e4)
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "run.mcap").write_text("")

    def replay(path: Path, job: object, folder: Path) -> None:
        for file in ("result.json", "signals.npz"):
            shutil.copy(made / file, folder / file)

    monkeypatch.setattr(compare, "replay_run", replay)
    runs = [str(tmp_path / "a" / "run.mcap"), str(made), str(tmp_path / "b" / "run.mcap")]
    assert main(["compare", *runs, "--vehicle", "truck_cab", "--out", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out" / "report.html").read_text()
    assert all(name in text for name in ("001_run", "done", "003_run"))


def test_before_and_after_name_what_changed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before, after, same = (finished(tmp_path / n, v) for n, v in (("before", 5e4), ("after", 6e4), ("same", 5.05e4)))
    assert main(["compare", str(before), str(after), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    # 10000 / sqrt(2) / 500
    assert "1 of 1 parameters changed: left.z.stiffness 50000 -> 60000 N/m (+20 %), +14.1 std" in said
    assert "Before and after" in (tmp_path / "out" / "report.html").read_text()
    assert main(["compare", str(before), str(same), "--out", str(tmp_path / "out")]) == 0
    assert "none of 1 parameters changed beyond chance" in capsys.readouterr().out
    unsure = finished(tmp_path / "unsure", 6e4, status="not_identifiable")
    assert main(["compare", str(before), str(unsure), "--out", str(tmp_path / "out")]) == 0
    assert "no parameters are sure enough" in capsys.readouterr().out


def test_chance_alone_changes_nothing_and_a_change_is_found() -> None:
    rng = np.random.default_rng(8)

    def run(shift: float = 0.0) -> dict[str, Metric]:
        values = rng.normal(size=24)
        values[3] += shift
        return {f"p{i}": Metric(f"p{i}", float(v), 1.0, "N/m") for i, v in enumerate(values)}

    alarms = sum(any(d.changed for d in differences(run(), run())) for _ in range(600))
    assert alarms <= 14  # 1 % of 600 is 6; more than 14 have a probability of 0.2 %
    found = [[d.before.name for d in differences(run(), run(9.0)) if d.changed] for _ in range(100)]
    assert sum("p3" in names for names in found) >= 97


def diagnosed(folder: Path, causes: list[tuple[str, float]], damping: float) -> Path:
    """A diagnosis as it lies on disk, written by hand."""
    folder.mkdir()
    listed = [
        {"id": name, "location": "left", "axis": "z", "confidence": 0.9,
         "parameters": [{"name": "level", "value": level, "std": 5.0, "unit": "N"}]} for name, level in causes
    ]  # fmt: skip
    (folder / "diagnosis.json").write_text(
        json.dumps({
            "schema": "ride_estimation/diagnosis/1", "verdict": "explained", "sentence": "", "causes": listed,
            "gain": {"baseline": 0.1, "extended": 0.02, "noise_floor": 0.01}, "run": {"path": folder.name}, "vehicle": {},
            "parameters": [{"name": "left.z.damping", "value": damping, "std": 10.0, "unit": "N s/m", "prior": 1e3}],
        })
    )  # fmt: skip
    return folder


def test_two_diagnoses_are_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = diagnosed(tmp_path / "before", [("coulomb_friction", 120.0), ("bump_stop", 3.0)], 1000.0)
    after = diagnosed(tmp_path / "after", [("coulomb_friction", 60.0), ("backlash", 1.0)], 1005.0)
    assert main(["compare", str(before), str(after), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "gone: bump stop at left z; new: backlash at left z; in both: coulomb friction at left z" in said
    assert "1 of 2 parameters changed: coulomb friction at left z: level 120 -> 60 N (-50 %), -8.5 std" in said
    assert main(["compare", str(before), str(finished(tmp_path / "run", 5e4)), "--out", str(tmp_path / "out")]) == 2
    assert "compare takes two diagnoses" in capsys.readouterr().err
    (after / "diagnosis.json").write_text('{"schema": "ride_estimation/diagnosis/1", "causes": 7}')
    assert main(["compare", str(before), str(after), "--out", str(tmp_path / "out")]) == 2
    assert "does not have the form" in capsys.readouterr().err


def test_a_difference_that_rounds_to_nothing_has_no_sign(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folders = [finished(tmp_path / name, value, 1e3) for name, value in (("before", 5e4), ("after", 5e4 - 1.0))]
    assert main(["compare", *map(str, folders), "--out", str(tmp_path / "out")]) == 0
    assert ", 0.0 std" in capsys.readouterr().out
    assert not re.search(r"[-+]0\.0(?!\d)", (tmp_path / "out" / "report.html").read_text())
