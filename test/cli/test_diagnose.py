# Copyright 2026 ride_estimation contributors
"""The diagnose command end to end on bundled runs."""

from __future__ import annotations

import json

import pytest

from ride_estimation.cli.main import main
from ride_estimation.io.vehicle_file import load_vehicle

VEHICLE = "config/vehicles/truck_cab.yaml"


def test_a_standing_run_is_called_insufficient_and_everything_is_written(tmp_path, capsys):
    assert main(["diagnose", "bags/standing", "--vehicle", VEHICLE, "--out", str(tmp_path)]) == 0
    document = json.loads((tmp_path / "diagnosis.json").read_text())
    assert document["verdict"] == "insufficient_data"
    assert document["causes"] == []
    assert set(document) >= {"verdict", "causes", "gain", "residual", "warnings"}
    assert load_vehicle(tmp_path / "vehicle_extended.yaml").name == "truck_cab"
    assert "cannot tell" in (tmp_path / "report.html").read_text()
    assert "cannot tell" in capsys.readouterr().out


def test_a_band_upside_down_is_refused(tmp_path, capsys):
    arguments = ["diagnose", "bags/standing", "--vehicle", VEHICLE, "--out", str(tmp_path), "--band", "10", "1"]
    assert main(arguments) == 2
    assert "--band" in capsys.readouterr().err


def test_a_missing_run_is_refused(tmp_path, capsys):
    assert main(["diagnose", str(tmp_path / "nothing"), "--vehicle", VEHICLE, "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err


@pytest.mark.slow
def test_hidden_friction_is_found_at_its_mount_and_the_gain_is_measured_on_the_other_run(tmp_path):
    arguments = [
        "diagnose", "bags/hidden_friction", "--vehicle", VEHICLE, "--validate", "bags/hidden_friction_validation",
        "--out", str(tmp_path),
    ]  # fmt: skip
    assert main(arguments) == 0
    document = json.loads((tmp_path / "diagnosis.json").read_text())
    assert document["verdict"] == "explained"
    first = document["causes"][0]
    assert (first["id"], first["location"], first["axis"]) == ("coulomb_friction", "front_left", "z")
    level = next(p for p in first["parameters"] if p["name"] == "friction level")
    # recipe: 120 N kinetic, 140 N breakaway
    assert 105.0 < level["value"] < 145.0
    gain = document["gain"]["validation"][0]
    assert gain["extended"] < 0.5 * gain["baseline"]
    assert gain["ci95"][0] > 0.0
    extended = load_vehicle(tmp_path / "vehicle_extended.yaml")
    assert "stribeck" in str(extended.mounts["front_left"].elements["z"]) .lower() or "dahl" in str(
        extended.mounts["front_left"].elements["z"]
    ).lower()
