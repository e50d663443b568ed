# Copyright 2026 ride_estimation contributors
"""End to end: ``ride-estimation quarter-car`` on the fire truck of document 002."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from worlds.quarter_car import FireTruck

from ride_estimation.cli.main import main

TRUCK = FireTruck(duration=3.0, start=0.8)
MASSES = ["--sprung-mass-kg", str(TRUCK.car.sprung), "--unsprung-mass-kg", str(TRUCK.car.unsprung)]
DRIVE = ["--speed-m-per-s", str(TRUCK.speed), "--wheel-radius-m", "0.5"]


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    time, hub, y = dataclasses.replace(TRUCK, disturbance=(1500.0, 6.3)).record()
    path = tmp_path_factory.mktemp("run") / "truck.csv"
    header = "time_s,road_mm,body_acceleration_m_per_s2,axle_acceleration_m_per_s2"
    np.savetxt(path, np.column_stack([time, 1000 * hub, y]), delimiter=",", header=header, comments="")
    return str(path)


def test_six_models_are_fitted_and_written(table, tmp_path, capsys):
    rows = np.loadtxt(table, delimiter=",", skiprows=1)
    path = tmp_path / "slow.csv"
    # a quarter of the samples: the motion ends at 15 Hz
    np.savetxt(path, rows[: 4 * (len(rows) // 5) : 4], delimiter=",", header=Path(table).read_text().splitlines()[0], comments="")
    assert main(["quarter-car", str(path), *MASSES, *DRIVE, "--starts", "0", "--out", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    for number in range(1, 7):
        assert f"model {number}," in text
    assert "the input is the problem" not in text
    assert re.search(r"best fit: model [56],", text)
    assert re.search(r"(best fit|as much): model 5,", text)  # springs and damper of the truth are straight
    assert re.search(r"sinusoid +1[45]\d\d N at 6\.(29|30)\d Hz", text)
    assert "half car" not in text
    document = json.loads((tmp_path / "quarter_car.json").read_text())
    sums = [m["sum_of_squares"] for m in document["models"]]
    assert sums[1] <= sums[0]
    assert sums[2] <= sums[1]
    assert sums[5] <= sums[4]


def test_the_step_is_warned_of(table, tmp_path, capsys):
    rows = np.loadtxt(table, delimiter=",", skiprows=1)
    rows[:, 1] = np.where(rows[:, 1] > 50, 100.0, 0.0)
    path = tmp_path / "step.csv"
    header = "time_s,road_mm,body_acceleration_m_per_s2,axle_acceleration_m_per_s2"
    np.savetxt(path, rows[::2], delimiter=",", header=header, comments="")
    assert main(["quarter-car", str(path), *MASSES, *DRIVE, "--models", "2", "--starts", "0"]) == 0
    assert "the input is the problem" in capsys.readouterr().out


def test_a_missing_rear_axle_is_offered(tmp_path, capsys):
    time, hub, y = dataclasses.replace(TRUCK, duration=8.0, rear=True).record(100.0)
    path = tmp_path / "rear.csv"
    header = "time_s,road_m,body_acceleration_m_per_s2,axle_acceleration_m_per_s2"
    np.savetxt(path, np.column_stack([time, hub, y]), delimiter=",", header=header, comments="")
    assert main(["quarter-car", str(path), *MASSES, *DRIVE, "--models", "1", "--starts", "0"]) == 0
    assert "use a half car" in capsys.readouterr().out


def test_masses_must_be_positive(table, capsys):
    assert main(["quarter-car", table, "--sprung-mass-kg", "-2500", "--unsprung-mass-kg", "310"]) == 2
    assert "masses -2500 kg" in capsys.readouterr().err


def test_unequal_time_steps_end_with_code_2(tmp_path, capsys):
    path = tmp_path / "bad.csv"
    path.write_text("time_s,road_m,body_acceleration_m_per_s2,axle_acceleration_m_per_s2\n0,0,0,0\n0.1,0,0,0\n0.5,0,0,0\n")
    assert main(["quarter-car", str(path), *MASSES]) == 2
    assert "equal steps" in capsys.readouterr().err
