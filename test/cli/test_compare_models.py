# Copyright 2026 ride_estimation contributors
"""End to end: ``ride-estimation compare-models`` on a quarter car recorded as bags."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from worlds.quarter_car import QuarterCar, drive_quarter_car, measure_quarter_car, one_mass_yaml, road_height
from worlds.roads import Road

from ride_estimation.cli.main import main
from ride_estimation.errors import InputDataError
from ride_estimation.identification.model_comparison import MeasuredRun
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.bags import read_recording
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.signals.alignment import align
from ride_estimation.signals.recording import Channel, Recording


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    folder = tmp_path_factory.mktemp("quarter")
    vehicle = folder / "vehicle.yaml"
    vehicle.write_text(one_mass_yaml(QuarterCar(), 0.02))
    sensors = load_vehicle(vehicle).sensors
    paths = []
    for seed in (1, 2):
        height, rate = road_height(Road(), 15.0, 1e-3, seed)
        data = measure_quarter_car(drive_quarter_car(QuarterCar(), height, rate, 1e-3), 100.0, seed, 0.02)
        stamps = (np.round(data["time"] * 1e9) + 1_000_000_000).astype(np.int64)
        channels = {n: Channel(n, stamps, data[n], stamps) for n in ("body", "axle")}
        write_bag(folder / f"run{seed}", Recording(f"run{seed}", channels), sensors)
        paths.append(str(folder / f"run{seed}"))
    return str(vehicle), paths


def test_compare_models_prints_and_writes_the_table(bags, tmp_path, capsys):
    vehicle, (first, second) = bags
    assert main(["compare-models", first, "--vehicle", vehicle, "--validate", second, "--out", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert "Voigt + Maxwell + friction" in text
    assert "cannot rank models" in text
    document = json.loads((tmp_path / "comparison.json").read_text())
    assert len(document["models"]) == 6
    assert document["models"][0]["scores"][1]["r_squared"] > 0.99
    # measured against simulated at every accelerometer of the body, on the unseen run (document 000 Figures 9 to 15)
    head, *rows = (tmp_path / "spectra.csv").read_text().splitlines()
    assert head.startswith("frequency [Hz],body measured [(m/s^2)^2/Hz],body Voigt [(m/s^2)^2/Hz]")
    table = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    ride = (table[:, 0] > 1) & (table[:, 0] < 10)
    assert np.median(np.abs(np.log(table[ride, 2] / table[ride, 1]))) < 0.1
    assert "measured and simulated" in (tmp_path / "report.html").read_text()


def test_models_are_fitted_to_a_part_of_a_logger_file(bags, tmp_path, capsys):
    """A table of a logger is as good as a bag, and a part of it as a shorter run."""
    vehicle, (first, _) = bags
    table = tmp_path / "run.csv"
    assert main(["export-file", first, "--vehicle", vehicle, "--out", str(table)]) == 0
    (tmp_path / "run.events.csv").write_text("time_s,name\n2.0,begin\n")
    capsys.readouterr()
    for run, begin in ((str(table), "begin"), (first, "2")):
        assert main(["compare-models", run, "--vehicle", vehicle, "--from", begin, "--to", "12"]) == 0
    ours, theirs = capsys.readouterr().out.split("error of the vertical")[1:]
    number = re.compile(r"Voigt, along z: .* ([\d.]+) N/m, ([\d.]+) N s/m")
    (one,), (other,) = (number.findall(text) for text in (ours, theirs))
    assert np.allclose([float(v) for v in one], [float(v) for v in other], rtol=1e-4)
    assert main(["compare-models", first, "--vehicle", vehicle, "--from", "900"]) == 2


def test_the_longest_segment_without_gaps_is_used(bags):
    vehicle = load_vehicle(bags[0])
    run = align(read_recording(bags[1][0], vehicle))
    whole = MeasuredRun(vehicle, run)
    valid = {name: np.ones(run.samples, dtype=bool) for name in run.data}
    valid["axle"][0] = valid["body"][200] = False  # one sensor begins later; a gap of the other at 2 s
    gappy = {name: np.where(valid[name][:, None], values, np.nan) for name, values in run.data.items()}
    part = MeasuredRun(vehicle, dataclasses.replace(run, data=gappy, valid=valid))
    assert part.used_s == pytest.approx((2.01, run.samples / run.rate_hz))
    assert part.left_out_s == pytest.approx(2.01)
    assert np.isfinite(part.measured).all() and len(part.measured) == len(whole.measured) - 201
    valid["body"][500::500] = False
    with pytest.raises(InputDataError, match="most gaps are those of body"):
        MeasuredRun(vehicle, dataclasses.replace(run, valid=valid))


@pytest.mark.slow
def test_laws_of_the_literature_join_the_table(bags, capsys):
    vehicle, (first, second) = bags
    assert main(["compare-models", first, "--vehicle", vehicle, "--validate", second, "--literature"]) == 0
    text = capsys.readouterr().out
    for name in ("Zener", "Voigt + two Maxwell", "Voigt + fractional", "Voigt + Bouc-Wen"):
        assert name in text


def test_a_vehicle_file_without_sensors_is_named_as_the_reason(bags, capsys):
    half_car = str(Path(__file__).parents[2] / "config" / "vehicles" / "half_car.yaml")
    assert main(["compare-models", bags[1][0], "--vehicle", half_car]) == 2
    assert "the vehicle file has no sensors, so nothing can be read; topics: /axle/accel" in capsys.readouterr().err


def test_a_missing_bag_ends_with_code_2(bags, tmp_path, capsys):
    assert main(["compare-models", str(tmp_path / "none"), "--vehicle", bags[0]]) == 2
    assert "none" in capsys.readouterr().err
