# Copyright 2026 ride_estimation contributors
"""``inspect``: topics, rates and ranges of a run without a vehicle file, and the sensors they belong to with one."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from ride_estimation.cli.main import main
from ride_estimation.io.vehicle_file import load_vehicle, save_vehicle
from ride_estimation.resources import shared_path

STANDING = str(Path(__file__).parents[2] / "bags" / "standing")


def test_rates_and_gravity_are_shown_without_a_vehicle_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["inspect", STANDING]) == 0
    said = capsys.readouterr().out
    assert said.count("200 Hz") == 8 and "/cab/front_left/accel" in said
    upward = [line for line in said.splitlines() if line.startswith("  z")]
    assert len(upward) == 8 and all(9.5 < float(line.split("mean ")[1].split()[0]) < 10.1 for line in upward)


def test_a_part_is_inspected_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["inspect", STANDING, "--from", "1", "--to", "2"]) == 0
    assert "(1 s to 2 s): " in capsys.readouterr().out
    assert main(["inspect", STANDING, "--from", "3", "--to", "2"]) == 2


def test_the_sensor_of_a_topic_is_named_and_a_renamed_topic_gets_a_proposal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vehicle = load_vehicle("truck_cab")
    other = dataclasses.replace(vehicle.sensors["cab_front_left"], topic="/sensor_7")
    save_vehicle(dataclasses.replace(vehicle, sensors={**vehicle.sensors, other.name: other}), tmp_path / "v.yaml")
    assert main(["inspect", STANDING, "--vehicle", str(tmp_path / "v.yaml")]) == 0
    said = capsys.readouterr().out
    assert "sensor cab_front_right" in said
    line = next(line for line in said.splitlines() if line.startswith("/cab/front_left/accel"))
    assert line.endswith("no sensor has this topic, perhaps cab_front_left")


def test_a_file_that_is_no_run_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "x.mcap").touch()
    assert main(["inspect", str(tmp_path / "x.mcap")]) == 2
    assert capsys.readouterr().err


def test_a_table_without_a_column_of_time_is_inspected_with_its_rate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "run.csv").write_text("ticks,a [g]\n" + "".join(f"{2 * k},1\n" for k in range(50)))
    run = str(tmp_path / "run.csv")
    assert main(["inspect", run]) == 2
    assert "--rate" in capsys.readouterr().err
    assert main(["inspect", run, "--rate", "500"]) == 0
    assert "a [g]: 50 samples, 500 Hz, 0 gaps" in capsys.readouterr().out
    assert main(["inspect", run, "--time", "ticks", "--time-unit", "ms"]) == 0
    assert "0.098 s, 1 channels" in capsys.readouterr().out
    for wrong in (["--rate", "nan"], ["--rate", "-1"], ["--time-unit", "hours"]):
        assert main(["inspect", run, *wrong]) == 2
    assert main(["inspect", str(shared_path("bags", "standing", "bag")), "--rate", "500"]) == 2
    assert "messages of a bag have stamps" in capsys.readouterr().err
