# Copyright 2026 ride_estimation contributors
"""Recordings made by others (one IMU each) through the same replay; skipped where the data are not at hand.

``RIDE_ESTIMATION_REAL_DATA`` names the folder, by default ``../shared/data`` beside the checkout.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from ride_estimation.cli.main import main
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.signals.recording import Channel, Recording

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("RIDE_ESTIMATION_REAL_DATA", ROOT.parent / "shared" / "data"))
ROBOTS = DATA / "ros1_bags_husky_jackal_robot_localization"
CAR = DATA / "car_highway_imu_can_comma2k19" / "segment_40" / "processed_log"
SINGLE = ROOT / "config" / "vehicles" / "single_imu.yaml"

needs_robots = pytest.mark.skipif(not ROBOTS.is_dir(), reason=f"real recordings not found in {DATA}")
needs_car = pytest.mark.skipif(not CAR.is_dir(), reason=f"real recordings not found in {DATA}")


def replay(run: Path, vehicle: Path, out: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    assert main(["replay", str(run), "--vehicle", str(vehicle), "--out", str(out), "--no-report"]) == 0
    with np.load(out / "signals.npz") as s:
        signals = {name: s[name] for name in s.files}
    assert all(np.isfinite(v).all() for v in signals.values() if v.dtype.kind == "f")
    return json.loads((out / "result.json").read_text()), signals


@needs_robots
def test_husky_with_gravity_on_y_is_noticed(tmp_path: Path) -> None:
    result, signals = replay(ROBOTS / "test1.bag", SINGLE, tmp_path)
    imu = result["run"]["channels"]["imu"]
    assert imu["samples"] == 11865 and imu["rate_hz"] == pytest.approx(30.0, rel=1e-3)
    assert any("gravity lies on +y (9.79" in f for f in imu["findings"])
    assert result["run"]["duration_s"] == pytest.approx(395.0, abs=1.0)
    assert np.sum(signals["valid"]) > 0.99 * len(signals["valid"])
    assert any("nothing checks one channel against another" in text for text in result["layout"])
    assert any("/fix" in reason for reason in result["run"]["ignored"])


@needs_robots
def test_jackal_is_fine_on_z_and_its_motion_comes_out(tmp_path: Path) -> None:
    result, signals = replay(ROBOTS / "test2.bag", SINGLE, tmp_path)
    imu = result["run"]["channels"]["imu"]
    assert imu["samples"] == imu["used"] == 3061 and imu["rate_hz"] == pytest.approx(50.0, rel=1e-3)
    assert not any("gravity" in f for f in imu["findings"])
    force = signals["cg_specific_force"]
    # the IMU's own mean is 9.75 m/s^2; the lever arm of 0.14 m moves a mean by far less
    assert np.mean(force[:, 2]) == pytest.approx(9.75, abs=0.05)
    # a robot that begins and ends on flat ground has no mean vertical acceleration beyond scale error and bias
    assert abs(np.mean(signals["cg_accel"][:, 2])) < 0.15


@needs_robots
def test_what_one_sensor_leaves_unobservable_is_reported(tmp_path: Path) -> None:
    result, _ = replay(ROBOTS / "test2.bag", SINGLE, tmp_path)
    mounts = [p for p in result["parameters"] if p["name"].startswith(("front_", "rear_"))]
    assert len(mounts) == 24
    assert {p["status"] for p in mounts} == {"not_identifiable"}
    assert all("accelerometers at all mount bases" in p["reason"] for p in mounts)
    assert any("below 20 Hz only" in f for f in result["run"]["channels"]["imu"]["findings"])


def array(name: str) -> np.ndarray:
    with (CAR / name).open("rb") as file:
        return np.asarray(np.load(file), dtype=float)


def car(folder: Path, kind: str, turned: bool) -> tuple[Path, Path]:
    """The car's IMU as a bag, and a vehicle file for it; the device has z down."""
    document = yaml.safe_load(SINGLE.read_text())
    document["bodies"]["cab"]["mass_kg"] = {"value": 1700.0, "relative_std": 0.1}
    document["bodies"]["cab"]["inertia_kg_m2"] = {"ixx": 600.0, "iyy": 2800.0, "izz": 3000.0, "relative_std": 0.3}
    axis = {"kind": "kelvin_voigt", "stiffness_n_per_m": 3e4, "damping_n_s_per_m": 2e3}
    for mount in document["mounts"].values():
        mount["position_m"] = [5.2 * mount["position_m"][0], 3.75 * mount["position_m"][1], -0.3]
        mount["axes"] = {"x": axis, "y": axis, "z": axis}
    sensor = document["sensors"]["imu"]
    sensor.update(kind=kind, topic="/imu", position_m=[0.8, 0.0, 0.6])
    if kind == "accelerometer":
        del sensor["gyro_noise_rad_per_s"]
    if turned:
        sensor["rotation_deg"] = [180.0, 0.0, 0.0]
    vehicle = folder / "car.yaml"
    vehicle.write_text(yaml.safe_dump(document))
    time, accel = array("IMU/accelerometer/t"), array("IMU/accelerometer/value")
    gyro_time, gyro = array("IMU/gyro/t"), array("IMU/gyro/value")
    stamps = np.round(time * 1e9).astype(np.int64)
    values = accel
    if kind == "imu":
        values = np.column_stack([accel, *(np.interp(time, gyro_time, column) for column in gyro.T)])
    channel = Channel("imu", stamps, values, stamps)
    write_bag(folder / "car", Recording("car", {"imu": channel}), load_vehicle(vehicle).sensors)
    return folder / "car", vehicle


@needs_car
def test_car_imu_goes_through_the_same_replay(tmp_path: Path) -> None:
    result, signals = replay(*car(tmp_path, "imu", turned=True), tmp_path / "out")
    imu = result["run"]["channels"]["imu"]
    assert imu["samples"] == 6256 and imu["rate_hz"] == pytest.approx(104.4, rel=0.01)
    assert not any("gravity lies" in f for f in imu["findings"])
    # the car's speed from the CAN bus over the minute against the integral of the longitudinal acceleration: slope and tilt
    # of the road are in the signal, so only the short term is comparable: changes over 2 s, correlation
    speed_time, speed = array("CAN/speed/t"), array("CAN/speed/value").ravel()
    time = signals["stamp_ns"] * 1e-9
    on_ticks = np.interp(time, speed_time, speed)
    step = round(2.0 / float(np.median(np.diff(time))))
    integral = np.cumsum(signals["cg_specific_force"][:, 0]) * float(np.median(np.diff(time)))
    change, expected = integral[step:] - integral[:-step], on_ticks[step:] - on_ticks[:-step]
    assert np.corrcoef(change, expected)[0, 1] > 0.8


@needs_car
def test_upside_down_car_imu_is_noticed(tmp_path: Path) -> None:
    result, _ = replay(*car(tmp_path, "imu", turned=False), tmp_path / "out")
    assert any("gravity lies on -z" in f for f in result["run"]["channels"]["imu"]["findings"])


@needs_car
def test_accelerometer_without_gyro_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run, vehicle = car(tmp_path, "accelerometer", turned=True)
    assert main(["replay", str(run), "--vehicle", str(vehicle), "--out", str(tmp_path / "out")]) == 2
    text = capsys.readouterr().err
    assert "determine 3 of 6" in text and "at least three" in text
