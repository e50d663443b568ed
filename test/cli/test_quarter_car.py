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


def test_a_half_car_brings_pitch_inertia_and_both_axles_back(tmp_path, capsys):
    time, hub, y = dataclasses.replace(TRUCK, duration=4.0, rear=True).record()
    path = tmp_path / "rear.csv"
    header = "time_s,road_m,body_acceleration_m_per_s2,axle_acceleration_m_per_s2"
    np.savetxt(path, np.column_stack([time, hub, y]), delimiter=",", header=header, comments="")
    # the truth: 5000 kg with 16200 kg m^2 on axles 2 m before and 1.8 m behind, 300 and 360 kN/m
    front = ["--sprung-mass-kg", str(5000 * 1.8 / 3.8), "--unsprung-mass-kg", "310"]
    rear = ["--wheelbase-m", "3.8", "--rear-sprung-mass-kg", str(5000 * 2.0 / 3.8), "--rear-unsprung-mass-kg", "310"]
    arguments = ["quarter-car", str(path), *front, *DRIVE, "--models", "1", "--starts", "0"]
    assert main([*arguments, *rear, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    half = json.loads((tmp_path / "quarter_car.json").read_text())["half_car"]
    truth = {
        "pitch_inertia": 16200, "front_spring_rate": 3e5, "front_damping": 2e4, "front_tyre_rate": 1e6, "rear_spring_rate": 3.6e5,
    }  # fmt: skip
    for name, value in truth.items():
        assert half["values"][name] == pytest.approx(value, rel=0.02), name
        assert abs(half["values"][name] - value) < 4.0 * half["std"][name], name
    assert half["nrmse"]["body"] < 0.03
    assert float(re.search(r"leaves ([\d.]+) % of the squared error of model 1", said)[1]) < 20.0
    assert main([*arguments, *rear[:2]]) == 2
    assert "a half car needs --wheelbase-m" in capsys.readouterr().err


def test_masses_must_be_positive(table, capsys):
    assert main(["quarter-car", table, "--sprung-mass-kg", "-2500", "--unsprung-mass-kg", "310"]) == 2
    assert "masses -2500 kg" in capsys.readouterr().err


def test_unequal_time_steps_end_with_code_2(tmp_path, capsys):
    path = tmp_path / "bad.csv"
    path.write_text("time_s,road_m,body_acceleration_m_per_s2,axle_acceleration_m_per_s2\n0,0,0,0\n0.1,0,0,0\n0.5,0,0,0\n")
    assert main(["quarter-car", str(path), *MASSES]) == 2
    assert "equal steps" in capsys.readouterr().err
