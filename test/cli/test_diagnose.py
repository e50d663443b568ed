# Copyright 2026 ride_estimation contributors
"""The diagnose command end to end on bundled runs."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from diagnosis_runs import GRAVITY, quarter_car, quarter_car_run

from ride_estimation.cli.main import main
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.vehicle_file import load_vehicle, save_vehicle
from ride_estimation.signals.recording import Channel, Recording

VEHICLE = "config/vehicles/truck_cab.yaml"


def test_a_standing_run_is_called_insufficient_and_everything_is_written(tmp_path, capsys):
    assert main(["diagnose", "bags/standing", "--vehicle", VEHICLE, "--out", str(tmp_path)]) == 0
    document = json.loads((tmp_path / "diagnosis.json").read_text())
    assert document["verdict"] == "insufficient_data"
    assert document["causes"] == []
    assert set(document) >= {"verdict", "causes", "gain", "residual", "warnings"}
    assert load_vehicle(tmp_path / "vehicle_extended.yaml").name == "truck_cab"
    assert "do not show whether" in (tmp_path / "report.html").read_text()
    said = capsys.readouterr().out
    assert "do not show whether" in said
    assert "vehicle_extended.yaml (as given" in said


def test_angular_rates_of_a_body_that_does_not_turn_are_said_not_to_be_used(tmp_path):
    vehicle, clean = quarter_car(), quarter_car_run(1, seconds=20.0)
    sensors = {**vehicle.sensors, "body": dataclasses.replace(vehicle.sensors["body"], kind="imu", gyro_noise_std=0.002)}
    save_vehicle(dataclasses.replace(vehicle, sensors=sensors), tmp_path / "vehicle.yaml")
    stamps = np.arange(clean.samples, dtype=np.int64) * 10_000_000 + 1_000_000_000
    values = {"body": np.hstack([clean.data["body"], np.zeros((clean.samples, 3))]), "base": clean.data["base"]}
    channels = {name: Channel(name, stamps, v, stamps) for name, v in values.items()}
    write_bag(tmp_path / "run", Recording("run", channels), sensors)
    arguments = ["diagnose", str(tmp_path / "run"), "--vehicle", str(tmp_path / "vehicle.yaml"), "--out", str(tmp_path / "out")]
    assert main([*arguments, "--no-report"]) == 0
    warnings = json.loads((tmp_path / "out" / "diagnosis.json").read_text())["warnings"]
    assert "the angular rates of body are not used: their body does not turn in the model" in warnings


def test_a_band_upside_down_is_refused(tmp_path, capsys):
    arguments = ["diagnose", "bags/standing", "--vehicle", VEHICLE, "--out", str(tmp_path), "--band", "10", "1"]
    assert main(arguments) == 2
    assert "--band" in capsys.readouterr().err


def test_a_missing_run_is_refused(tmp_path, capsys):
    assert main(["diagnose", str(tmp_path / "nothing"), "--vehicle", VEHICLE, "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err


def test_a_vehicle_run_without_vehicle_file_is_refused(tmp_path, capsys):
    assert main(["diagnose", "bags/standing", "--out", str(tmp_path)]) == 2
    assert "--vehicle" in capsys.readouterr().err


def test_friction_in_a_bench_record_is_named_and_the_element_loads_again(tmp_path):
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 30.0, 0.005)
    tones = [(0.7, 3.0, 0.1), (1.9, 1.5, 1.0), (4.3, 0.6, 2.0), (7.1, 0.3, 4.0)]  # Hz, mm, rad
    x = sum(a * np.sin(2 * np.pi * f * time + p) for f, a, p in tones)
    v = sum(2 * np.pi * f * a * np.cos(2 * np.pi * f * time + p) for f, a, p in tones)
    force = 120.0 * x + 2.0 * v + 40.0 * np.tanh(v / 2.0) + 0.5 * rng.standard_normal(time.size)
    table = tmp_path / "bench.csv"
    np.savetxt(table, np.stack([time, x, force], axis=1), delimiter=",", header="time_s,displacement_mm,force_n", comments="")
    out = tmp_path / "out"
    assert main(["diagnose", str(table), "--out", str(out)]) == 0
    document = json.loads((out / "diagnosis.json").read_text())
    assert document["verdict"] == "explained"
    assert [(c["id"], c["location"], c["axis"]) for c in document["causes"]] == [("coulomb_friction", "mount", "z")]
    mount = load_vehicle(out / "vehicle_extended.yaml").mounts["mount"]
    assert mount.elements["z"].KIND != "kelvin_voigt"
    assert mount.seen["z"].preload == pytest.approx((force.mean(),) * 2)
    assert mount.seen["z"].deflection == pytest.approx(np.abs(x).max() * 1e-3, rel=0.1)
    assert mount.seen["z"].frequency == pytest.approx((0.7, 7.1), abs=0.1)
    assert (out / "report.html").stat().st_size > 0


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
    seen = extended.mounts["front_left"].seen["z"]
    assert 0.001 < seen.deflection < 0.1 and 0.1 < seen.frequency[0] < seen.frequency[1] < 50.0
    assert 1500.0 < -seen.preload[0] < 5000.0, "the share of the weight, in compression"
    prior = extended.mounts["front_left"].priors["z", "elements[0].stiffness"]
    assert 0.0 < prior.std < 0.2 * prior.value
    assert "stribeck" in str(extended.mounts["front_left"].elements["z"]) .lower() or "dahl" in str(
        extended.mounts["front_left"].elements["z"]
    ).lower()


def _twin_sensor_run(folder, seed, late_s, gain):
    """Write a bag of a quarter car with a second body sensor that is late and reads its motion times a factor."""
    clean = quarter_car_run(seed, seconds=40.0, noise=0.0)
    rng = np.random.default_rng([seed, 1])
    vertical = {name: values[:, 2] for name, values in clean.data.items()}
    f = np.fft.rfftfreq(clean.samples, 1.0 / clean.rate_hz)
    moving = vertical["body"] - GRAVITY
    shifted = np.fft.irfft(np.fft.rfft(moving) * np.exp(-2j * np.pi * f * late_s), clean.samples)
    vertical["twin"] = gain * shifted + GRAVITY
    stamps = 1_000_000_000 + np.arange(clean.samples, dtype=np.int64) * 10_000_000
    channels = {}
    for name, z in vertical.items():
        values = 0.005 * rng.standard_normal((len(z), 3)) + np.stack([0.0 * z, 0.0 * z, z], axis=1)
        channels[name] = Channel(name, stamps, values, stamps)
    vehicle = quarter_car()
    twin = dataclasses.replace(vehicle.sensors["body"], name="twin", topic="/twin")
    vehicle = dataclasses.replace(vehicle, sensors={**vehicle.sensors, "twin": twin})
    save_vehicle(vehicle, folder / "vehicle.yaml")
    write_bag(folder / f"run{seed}", Recording(f"run{seed}", channels), vehicle.sensors)
    return str(folder / f"run{seed}")


@pytest.mark.slow
@pytest.mark.parametrize(("cause", "late_s", "gain"), [("sensor_delay", 0.008, 1.0), ("sensor_gain", 0.0, 1.08)])
def test_a_found_sensor_error_is_corrected_by_the_extended_file_on_the_next_run(tmp_path, cause, late_s, gain):
    first, second = (_twin_sensor_run(tmp_path, seed, late_s, gain) for seed in (1, 2))
    before, after = tmp_path / "before", tmp_path / "after"
    reading = ["--no-report", "--vehicle"]
    assert main(["diagnose", first, *reading, str(tmp_path / "vehicle.yaml"), "--out", str(before)]) == 0
    document = json.loads((before / "diagnosis.json").read_text())
    assert [(c["id"], c["location"]) for c in document["causes"]] == [(cause, "twin")]
    extended = load_vehicle(before / "vehicle_extended.yaml")
    correction = extended.sensors["twin"].correction
    # 40 s of motion 200 times the noise: both far better than a tenth of the error
    assert correction.delay == pytest.approx(late_s, abs=4e-4)
    assert correction.gains(3)[2] == pytest.approx(gain, abs=4e-3)
    # at rest the sensor reads what it read before
    assert correction.gains(3)[2] * GRAVITY + correction.biases(3)[2] == pytest.approx(GRAVITY, abs=1e-9)
    assert main(["diagnose", second, *reading, str(before / "vehicle_extended.yaml"), "--out", str(after)]) == 0
    again = json.loads((after / "diagnosis.json").read_text())
    assert (again["verdict"], again["causes"]) == ("no_discrepancy", [])
    assert Pipeline(extended).vehicle.sensors["twin"].correction == correction
