# Copyright 2026 ride_estimation contributors
"""Runs side by side: the one that differs is named, similar ones are not, foreign folders are refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.cli.main import main
from ride_estimation.io.results import RESULT_SCHEMA


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
    assert "odd: left.z.stiffness is 6.5e+04 N/m" in printed and "r0:" not in printed
    text = (tmp_path / "out" / "report.html").read_text()
    assert "data:image/png;base64" in text and "6.5e+04" in text


@pytest.mark.parametrize(
    ("value", "std", "status"), [(6.5e4, 1e4, "valid"), (6.5e4, 500.0, "not_identifiable"), (5.06e4, 1.0, "valid")]
)
def test_uncertain_unidentified_and_hardly_different_values_do_not_stand_out(
    value: float, std: float, status: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folders = [finished(tmp_path / f"r{i}", 5e4 + 50.0 * i) for i in range(4)]
    odd = finished(tmp_path / "odd", value, std, status)
    assert main(["compare", *map(str, folders), str(odd), "--out", str(tmp_path / "out")]) == 0
    assert "no run stands out" in capsys.readouterr().out


def test_folders_without_results_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", str(tmp_path / "none"), "--out", str(tmp_path / "out")]) == 2
    foreign = finished(tmp_path / "foreign", 5e4)
    (foreign / "result.json").write_text('{"schema": "something else"}')
    assert main(["compare", str(foreign), "--out", str(tmp_path / "out")]) == 2
    assert "schema" in capsys.readouterr().err
