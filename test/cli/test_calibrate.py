# Copyright 2026 ride_estimation contributors
"""Calibration from a standstill: planted noise, bias and angle come back, on a slope too; a moving vehicle is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ride_estimation.assessment.standstill import BIAS_LIMIT, calibrate
from ride_estimation.cli.arguments.calibrate import EXAMPLES
from ride_estimation.cli.main import main
from ride_estimation.errors import InputDataError
from ride_estimation.frames import rotation_from_rpy
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.resources import shared_path
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.correction import Correction
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.vehicles.vehicle import Vehicle

RATE, SECONDS = 200.0, 12.0
SLOPE = rotation_from_rpy(np.radians(2.0), np.radians(-3.0), 0.0)
SHARED = np.array([0.0, 0.0, 9.80665])


def vehicle() -> Vehicle:
    """Six accelerometers and an IMU on the cab, a transducer."""
    sensors = {f"a{i}": Sensor(f"a{i}", "accelerometer", f"/a{i}", "cab") for i in range(5)}
    sensors["turned"] = Sensor("turned", "accelerometer", "/t", "cab", rotation=rotation_from_rpy(0.0, 0.0, np.pi / 2))
    sensors["imu"] = Sensor("imu", "imu", "/imu", "cab")
    sensors["travel"] = Sensor("travel", "displacement", "/d", "cab", mount="m", axis="z", element="m_z", noise_std=1e-4)
    return Vehicle("v", {}, {}, sensors)


def standing(
    noise: float = 0.03,
    bias: dict[str, np.ndarray] | None = None,
    angle: dict[str, np.ndarray] | None = None,
    motion: float = 0.0,
) -> Recording:
    """What the sensors read at rest on the slope."""
    rng = np.random.default_rng(3)
    n = round(RATE * SECONDS)
    stamps = 10**9 + np.round(np.arange(n) / RATE * 1e9).astype(np.int64)
    channels = {}
    up = SLOPE.T @ SHARED
    for name, sensor in vehicle().sensors.items():
        if sensor.kind == "displacement":
            values = 0.004 + 5e-5 * rng.normal(size=(n, 1))
        else:
            true = (angle or {}).get(name, np.eye(3)) @ sensor.rotation
            values = true.T @ up + noise * rng.normal(size=(n, 3)) + (bias or {}).get(name, np.zeros(3))
            values[:, 0] += motion * np.sin(2 * np.pi * 0.3 * np.arange(n) / RATE)
            if sensor.kind == "imu":
                values = np.hstack([values, [0.01, -0.02, 0.005] + 0.002 * rng.normal(size=(n, 3))])
        channels[name] = Channel(name, stamps, values, stamps)
    return Recording("standing", channels)


def test_noise_of_every_sensor() -> None:
    found = calibrate(standing(noise=0.05), vehicle())
    # standard deviation of the estimate: 0.05 / sqrt(2 * 3 * 2400) = 0.8 %; five of them
    for name in ("a0", "turned", "imu"):
        assert found.sensors[name].noise == pytest.approx(0.05, rel=0.05)
    assert found.sensors["imu"].gyro_noise == pytest.approx(0.002, rel=0.05)
    assert found.sensors["imu"].gyro_bias == pytest.approx([0.01, -0.02, 0.005], abs=3e-4)
    assert found.sensors["travel"].noise == pytest.approx(5e-5, rel=0.1)
    assert found.slope_deg == pytest.approx(np.degrees(np.arccos(SLOPE[2, 2])), abs=0.02)


def test_bias_along_and_across_gravity() -> None:
    planted = {"a1": np.array([0.05, -0.04, 0.3]), "turned": np.array([-0.06, 0.0, -0.2])}
    found = calibrate(standing(bias=planted), vehicle())
    for name, bias in planted.items():
        # the vehicle stands 3.6 deg off level, so a bias along z has a small part across; noise 0.03 / sqrt(2400)
        assert found.sensors[name].bias == pytest.approx(bias, abs=0.01)
        assert found.sensors[name].angle_deg == 0.0
    assert found.sensors["a0"].bias == pytest.approx([0.0, 0.0, 0.0], abs=0.01)
    assert found.sensors["travel"].sensor.correction.bias == pytest.approx([0.004], abs=1e-5)


def test_mounting_angle_becomes_a_rotation_that_reads_gravity_right() -> None:
    turn = rotation_from_rpy(np.radians(3.0), np.radians(1.0), 0.0)
    found = calibrate(standing(angle={"a2": turn, "turned": turn}), vehicle())
    for name in ("a2", "turned"):
        c = found.sensors[name]
        assert c.angle_deg == pytest.approx(np.degrees(np.arccos(turn[2, 2])), abs=0.15)  # 3.6 deg of slope at right angles
        expected = turn @ vehicle().sensors[name].rotation
        left = c.sensor.rotation.T @ expected
        up = SLOPE.T @ SHARED
        assert np.degrees(np.arccos((left @ up) @ up / (up @ up))) < 0.3
        assert np.max(np.abs(c.bias)) < 0.02


def test_calibrated_twice_there_is_nothing_left() -> None:
    planted, turn = {"a1": np.array([0.05, -0.04, 0.3])}, {"a2": rotation_from_rpy(0.05, 0.0, 0.0)}
    recording = standing(bias=planted, angle=turn)
    once = calibrate(recording, vehicle()).vehicle(vehicle())
    twice = calibrate(recording, once)
    for c in twice.sensors.values():
        assert np.max(np.abs(c.bias)) < 1e-3 and c.angle_deg == 0.0
    assert isinstance(once.sensors["a1"].correction, Correction)


def test_an_engine_is_no_noise_and_is_reported() -> None:
    recording = standing(noise=0.02)
    channel = recording.channels["a0"]
    channel.values[:] += 0.3 * np.sin(2 * np.pi * 30.0 * np.arange(len(channel.values)) / RATE)[:, None]
    c = calibrate(recording, vehicle()).sensors["a0"]
    assert c.noise == pytest.approx(0.02, rel=0.15)
    assert any("engine off" in finding for finding in c.findings)


@pytest.mark.parametrize(
    ("recording", "message"),
    [
        (standing(motion=0.5), "did not stand still"),
        (standing(angle={"a0": rotation_from_rpy(np.pi / 2, 0.0, 0.0)}), "the vehicle file is wrong"),
        (standing(bias={"a0": np.array([0.0, 0.0, -8.0])}), "unit, range or fault"),
    ],
)
def test_what_cannot_be_calibrated_is_refused(recording: Recording, message: str) -> None:
    with pytest.raises(InputDataError, match=message):
        calibrate(recording, vehicle())


def test_the_limit_between_bias_and_angle_is_that_of_the_documentation() -> None:
    assert f"{BIAS_LIMIT:g} m/s^2" in EXAMPLES


def test_the_command_writes_a_vehicle_file_that_loads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = shared_path("bags", "standing", "bag")
    assert main(["calibrate", str(run), "--vehicle", "truck_cab", "--out", str(tmp_path / "v.yaml")]) == 0
    assert "engine off" in capsys.readouterr().out  # the bundled run idles
    calibrated = load_vehicle(tmp_path / "v.yaml")
    # the simulated sensors have the noise of the vehicle file, 0.02 m/s^2; engine vibration reaches a part of the floor
    assert all(0.015 < s.noise_std < 0.03 for s in calibrated.sensors.values())
    assert main(["calibrate", str(shared_path("bags", "nominal", "bag")), "--vehicle", "truck_cab"]) == 2
    assert "did not stand still" in capsys.readouterr().err
    assert main(["calibrate", str(run), "--vehicle", "truck_cab", "--out", str(tmp_path / "v.yaml" / "x.yaml")]) == 2
