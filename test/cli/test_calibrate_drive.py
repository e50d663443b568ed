# Copyright 2026 ride_estimation contributors
"""Calibration from a drive: hidden gain, misalignment, position and delay come back; a bad recording is refused in one line."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from worlds.adapters import believed_vehicle, recording, vehicle_of_text
from worlds.cab import Measurement, drive, measure, random_sensors, random_vehicle
from worlds.roads import Road
from worlds.vehicle_text import vehicle_yaml

from ride_estimation.cli import calibrate as command
from ride_estimation.cli.main import main
from ride_estimation.errors import InputDataError
from ride_estimation.estimation.model import drive_calibration
from ride_estimation.estimation.model.drive_calibration import DriveCalibration, calibrate_drive, summary_lines
from ride_estimation.io.bags import read_recording
from ride_estimation.io.vehicle_file import load_vehicle, save_vehicle
from ride_estimation.sensors.installation import Installation
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.vehicles.vehicle import Vehicle

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))

from drive_calibration import scores, world  # noqa: E402

TURN, MOVED = np.array([0.0, 0.0, np.radians(1.0)]), np.array([0.0, 0.02, 0.0])


@pytest.fixture(scope="module")
def data() -> Measurement:
    """A rough road; one sensor with a gain, one turned, one misplaced, one late."""
    rng = np.random.default_rng(7)
    cab = random_vehicle(rng, "air")
    sensors = list(random_sensors(cab, rng))
    sensors[0] = dataclasses.replace(sensors[0], gain=np.array([1.0, 1.02, 1.0]))
    sensors[1] = dataclasses.replace(sensors[1], true_rotation=Rotation.from_rotvec(TURN).as_matrix())
    sensors[2] = dataclasses.replace(sensors[2], true_position=sensors[2].position + MOVED)
    sensors[5] = dataclasses.replace(sensors[5], delay_s=0.001)
    run = drive(cab, Road(follow=(0.6, 0.6)), 40.0, 7)
    return measure(run, tuple(sensors), 200.0, 7, noise_share=0.01, anti_alias=0.0)


@pytest.fixture(scope="module")
def vehicle(data: Measurement) -> Vehicle:
    """The vehicle file, installed less well than usual."""
    found = believed_vehicle(data)
    worse = Installation(gain=0.01, misalignment=0.01, position=0.01, delay=0.0005)
    return dataclasses.replace(found, sensors={n: dataclasses.replace(s, installation=worse) for n, s in found.sensors.items()})


@pytest.fixture(scope="module")
def found(data: Measurement, vehicle: Vehicle) -> DriveCalibration:
    return calibrate_drive(recording(data), vehicle)


@pytest.mark.slow
def test_hidden_errors_come_back(found: DriveCalibration) -> None:
    sensors = list(found.sensors.values())
    assert sensors[0].errors["gain"][1] == pytest.approx(0.02, abs=0.004)
    assert sensors[1].errors["misalignment"][2] == pytest.approx(TURN[2], abs=np.radians(0.15))
    assert sensors[2].errors["position"][1] == pytest.approx(MOVED[1], abs=0.005)
    delays = np.array([c.errors["delay"][0] for c in sensors])
    assert delays[5] - np.mean(np.delete(delays, 5)) == pytest.approx(0.001, abs=1e-4)
    assert sensors[0].determined["gain"].all() and found.usable and found.nis == pytest.approx(1.0, abs=0.1)
    assert found.covariance.shape == (len(found.names),) * 2
    assert "relative to the mean of all sensors" in "\n".join(summary_lines(found))


@pytest.mark.slow
def test_what_was_found_is_not_found_again(data: Measurement, vehicle: Vehicle, found: DriveCalibration) -> None:
    calibrated = found.vehicle(vehicle)
    samples = recording(data)
    channels = {
        n: dataclasses.replace(c, correction=calibrated.sensors[n].correction) for n, c in samples.channels.items()
    }
    again = calibrate_drive(Recording("again", channels), calibrated)
    for name, c in again.sensors.items():
        for kind in ("gain", "misalignment", "position", "delay"):
            assert np.all(np.abs(c.errors[kind]) < 2.0 * found.sensors[name].stds[kind] + 1e-12), (name, kind)


@pytest.mark.slow
def test_errors_of_installed_sensors_are_inside_as_often_as_stated() -> None:
    """Fresh cabs on fresh roads, every error drawn from the usual installation: neither too few nor all inside two std."""
    errors = [e for seed in range(7000, 7006) for row in scores(*world(seed, 40.0)).values() for e in row]
    assert 0.90 <= np.mean([abs(error) < 2.0 * std for error, std, _ in errors]) <= 0.985


@pytest.fixture(scope="module")
def plain() -> Vehicle:
    """A vehicle that nobody drove."""
    rng = np.random.default_rng(8)
    cab = random_vehicle(rng, "air")
    found = vehicle_of_text(vehicle_yaml(cab, random_sensors(cab, rng)))
    gains = np.linspace(0.01, 0.02, len(found.sensors)).tolist()
    stated = {n: dataclasses.replace(s, installation=Installation(gain=g)) for (n, s), g in zip(found.sensors.items(), gains)}
    return dataclasses.replace(found, sensors=stated)


def shaken(vehicle: Vehicle, size: float = 1.0) -> Recording:
    """All sensors shake at random for 22 s, 200 Hz."""
    rng = np.random.default_rng(9)
    stamps = 10**18 + np.arange(4400) * 5_000_000
    return Recording("shaken", {n: Channel(n, stamps, size * rng.normal(size=(4400, 3)), stamps) for n in vehicle.sensors})


def test_a_calibrated_vehicle_is_written_and_read(plain: Vehicle, tmp_path: Path) -> None:
    save_vehicle(plain, tmp_path / "v.yaml")
    again = load_vehicle(tmp_path / "v.yaml")
    assert {n: s.installation for n, s in again.sensors.items()} == {n: s.installation for n, s in plain.sensors.items()}


def lost(channel: Channel, keep: np.ndarray | slice) -> Channel:
    values, stamps = channel.values[keep], channel.stamp_ns[keep]
    return dataclasses.replace(channel, values=values, stamp_ns=stamps, arrival_ns=stamps)


def refused(channels: dict[str, Channel], vehicle: Vehicle, words: str) -> None:
    with pytest.raises(InputDataError, match=words) as caught:
        calibrate_drive(Recording("drive", channels), vehicle)
    assert "\n" not in str(caught.value)


def test_a_recording_that_cannot_be_used_is_refused_in_one_line(plain: Vehicle) -> None:
    good = dict(shaken(plain).channels)
    refused({n: lost(c, slice(0, 2000)) for n, c in good.items()}, plain, "at least 20 s are needed")
    refused({n: c for n, c in good.items() if n != "cab_front_left"}, plain, "no samples of cab_front_left")
    worn = good["cab_rear_left"]
    refused({**good, "cab_rear_left": lost(worn, np.arange(4400) % 800 > 100)}, plain, "without a gap")
    broken = dataclasses.replace(worn, values=np.full((4400, 3), np.nan))
    refused({**good, "cab_rear_left": broken}, plain, "cab_rear_left has 0 good samples")
    refused(dict(shaken(plain, 0.02).channels), plain, "times its noise")


@pytest.mark.slow
def test_friction_is_said_and_nothing_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "v.yaml"
    bag = str(ROOT / "bags/hidden_friction/bag")
    assert main(["calibrate", "--drive", bag, "--vehicle", "truck_cab", "--out", str(out)]) != 0
    said = capsys.readouterr()
    assert "do not use this" in said.out and "not written" in said.err and not out.exists()


@pytest.mark.slow
def test_a_drive_that_leaves_the_numbers_is_refused_in_one_line() -> None:
    vehicle = load_vehicle("truck_cab")
    with pytest.raises(InputDataError, match="does not fit this drive"):
        calibrate_drive(read_recording(ROOT / "bags/faulty_sensor/bag", vehicle), vehicle)


@pytest.mark.slow
def test_an_elastic_frame_does_not_pass_for_gains() -> None:
    """Whatever moves the bases is an unknown input: the good sensors of the example stay good."""
    vehicle = load_vehicle("truck_cab")
    found = calibrate_drive(read_recording(ROOT / "bags/nominal/bag", vehicle), vehicle)
    assert found.usable and found.nis == pytest.approx(1.0, abs=0.1)
    gains = np.array([c.errors["gain"] / c.stds["gain"] for c in found.sensors.values() if "gain" in c.errors])
    assert np.all(np.abs([c.errors["gain"] for c in found.sensors.values()]) < 0.006) and np.mean(np.abs(gains) < 2.0) > 0.85


@pytest.mark.slow
def test_the_command_writes_a_vehicle_file_that_loads(
    vehicle: Vehicle, found: DriveCalibration, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_vehicle(vehicle, tmp_path / "v.yaml")
    monkeypatch.setattr(command, "read_part", lambda *_: None)
    monkeypatch.setattr(drive_calibration, "calibrate_drive", lambda *_: found)
    out = tmp_path / "calibrated.yaml"
    assert main(["calibrate", "--drive", "run", "--vehicle", str(tmp_path / "v.yaml"), "--out", str(out)]) == 0
    sensors = load_vehicle(out).sensors
    for name, c in found.sensors.items():
        np.testing.assert_allclose(sensors[name].position, c.sensor.position, atol=1e-6)
        assert sensors[name].installation is not None and sensors[name].installation.gain < 0.01
