# Copyright 2026 ride_estimation contributors
"""Accelerometers that measure one or two axes: what they do not measure is a row of no equation, nowhere."""

from __future__ import annotations

import dataclasses
import functools
import math
from types import SimpleNamespace

import numpy as np
import pytest
from worlds.adapters import START_NS, believed_vehicle, vehicle_of_text
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.roads import Road
from worlds.vehicle_text import vehicle_yaml

from ride_estimation.assessment.standstill import calibrate
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator
from ride_estimation.estimation.offline import EstimateDigest
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.channel_guess import guess_channels
from ride_estimation.io.files.channel_map import components, load_channel_map
from ride_estimation.io.files.channels import FileChannel, MeasurementFile
from ride_estimation.io.files.conversion import recording_from_file
from ride_estimation.io.messages import make_converter
from ride_estimation.io.vehicle_file import load_vehicle, save_vehicle
from ride_estimation.sensors.layout import check_layout, motion_rows
from ride_estimation.sensors.quality import judge_sensors
from ride_estimation.signals.recording import Channel, Recording

#: seven channels that determine the motion of the body
SEVEN = {"cab_front_left": "xyz", "cab_front_right": "xz", "cab_rear_left": "z", "cab_rear_right": "z"}


@functools.cache
def measured_world():
    rng = np.random.default_rng(8090)
    cab = random_vehicle(rng, "air")
    sensors = random_sensors(cab, rng, turned=True)
    data = measure(drive(cab, Road.random(rng), 4.0, 8090, step=1e-3), sensors, 250.0, 8090, noise_share=0.01, anti_alias=0.0)
    return data, with_axes(believed_vehicle(data, seed=8090), SEVEN)


def with_axes(vehicle, axes):
    return dataclasses.replace(
        vehicle, sensors={n: dataclasses.replace(s, axes=tuple(axes.get(n, "xyz"))) for n, s in vehicle.sensors.items()}
    )


def recording(data, vehicle):
    channels = {}
    for name, sensor in vehicle.sensors.items():
        stamps = START_NS + np.round(data.stamps[name] * 1e9).astype(np.int64)
        channels[name] = Channel(name, stamps, sensor.only_measured(np.asarray(data.data[name])), stamps)
    return Recording("world", channels)


def file_text(extra: str) -> str:
    data, _ = measured_world()
    text = vehicle_yaml(data.run.vehicle, data.sensors, None, 8090)
    changed = text.replace("  cab_rear_left: {", f"  cab_rear_left: {{{extra}, ", 1)
    assert changed != text
    return changed


def test_the_file_names_the_axes_and_keeps_them(tmp_path):
    sensor = vehicle_of_text(file_text("axes: [z, x]")).sensors["cab_rear_left"]
    assert sensor.axes == ("x", "z")
    save_vehicle(dataclasses.replace(measured_world()[1]), tmp_path / "v.yaml")
    again = load_vehicle(tmp_path / "v.yaml")
    assert {n: "".join(s.axes) for n, s in again.sensors.items() if s.name in SEVEN} == SEVEN


@pytest.mark.parametrize("wrong", ["[]", "[w]", "[x, x]", "z", "[[x]]"])
def test_other_axes_are_a_mistake(wrong):
    with pytest.raises(ConfigurationError, match="one to three of x, y, z"):
        vehicle_of_text(file_text(f"axes: {wrong}"))


def test_gain_and_bias_of_an_axis_that_is_not_measured_do_nothing():
    sensor = vehicle_of_text(file_text("axes: [z], gain: 1.02, bias_m_per_s2: 0.3")).sensors["cab_rear_left"]
    assert sensor.correction.apply(np.array([[0.0, 0.0, 1.32]])) == pytest.approx(np.array([[0.0, 0.0, 1.0]]))


def test_a_message_may_hold_anything_on_the_other_axes():
    sensor = measured_world()[1].sensors["cab_rear_left"]
    convert = make_converter("geometry_msgs/msg/Vector3Stamped", [sensor])
    header = SimpleNamespace(stamp=SimpleNamespace(sec=1, nanosec=2))
    message = SimpleNamespace(header=header, vector=SimpleNamespace(x=math.nan, y=1e30, z=9.5))
    assert convert(message)[0].values == (0.0, 0.0, 9.5)


def test_a_logger_file_has_one_channel_for_one_axis(tmp_path):
    vehicle = measured_world()[1]
    sensor = vehicle.sensors["cab_rear_left"]
    assert components(sensor) == (("cab_rear_left.z", "m/s^2"),)
    time, values = np.arange(50) / 100.0, 1.0 + 0.01 * np.arange(50)
    channel = FileChannel("ACC_RL", "g", time, values)
    assert guess_channels([channel], {sensor.name: sensor}, 9.81)["cab_rear_left.z"].channel == "ACC_RL"
    (tmp_path / "map.yaml").write_text("schema: ride_estimation/channels/1\nchannels: {cab_rear_left.z: ACC_RL}\n")
    chosen = load_channel_map(tmp_path / "map.yaml", {sensor.name: sensor})
    found = recording_from_file(MeasurementFile("run.csv", 0, (channel,)), {sensor.name: sensor}, chosen)
    assert found.channels[sensor.name].values[:, 2] == pytest.approx(9.80665 * values)
    assert not found.channels[sensor.name].values[:, :2].any()


def test_layout_counts_what_is_measured():
    _, vehicle = measured_world()
    sensors = [s for s in vehicle.sensors.values() if s.body == "cab"]
    check = check_layout(sensors, vehicle.bodies["cab"].cg)
    assert (check.channels, check.rank) == (7, 6)
    assert check_layout(sensors[1:], vehicle.bodies["cab"].cg).rank == 4


def test_motion_is_least_squares_of_the_measured_rows():
    data, vehicle = measured_world()
    sensors = [s for s in vehicle.sensors.values() if s.body == "cab"]
    cg = vehicle.bodies["cab"].cg
    samples = np.hstack([s.only_measured(np.asarray(data.data[s.name])[:40]) for s in sensors])
    keep = np.concatenate([s.measured for s in sensors])
    whole = motion_rows([dataclasses.replace(s, axes=("x", "y", "z")) for s in sensors], cg)
    weights = np.linalg.pinv(whole[keep] / 0.02) / 0.02
    estimator = CgMotionEstimator(
        [dataclasses.replace(s, noise_std=0.02) for s in sensors], cg, np.ones(6, dtype=bool), 9.81, PipelineSettings()
    )
    found = estimator.observe(samples[:1], np.zeros((1, 0)), np.ones((1, 4), dtype=bool), 0.004)
    assert found.motion[0] == pytest.approx(weights @ samples[0, keep], abs=1e-4)
    assert not found.predicted[:, ~keep].any()


@functools.cache
def replayed():
    data, vehicle = measured_world()
    pipeline, digest, blocks = Pipeline(vehicle), EstimateDigest(), []
    for found, _ in pipeline.replay(recording(data, vehicle)):
        blocks += found
    blocks += pipeline.finish()
    for block in blocks:
        digest.update(block)
    return pipeline, blocks, digest.hexdigest()


def test_live_and_replay_are_the_same_and_no_sensor_is_refused():
    data, vehicle = measured_world()
    pipeline, blocks, digest = replayed()
    live, other = Pipeline(vehicle), EstimateDigest()
    for index, stamp, values, variance in recording(data, vehicle).in_order():
        for block in live.observe(list(vehicle.sensors)[index], stamp, values, variance):
            other.update(block)
    for block in live.finish():
        other.update(block)
    assert other.hexdigest() == digest
    assert all(block.valid.all() for block in blocks)
    assert not [m for m in pipeline.health().messages if "cab_" in m]


def test_acceleration_of_the_cg_follows_the_truth():
    data, _ = measured_world()
    _, blocks, _ = replayed()
    stamps = np.concatenate([b.stamp_ns for b in blocks])
    found = np.concatenate([b.cg_accel for b in blocks])
    std = np.sqrt(np.concatenate([np.broadcast_to(np.diag(b.cg_accel_covariance), (len(b.stamp_ns), 6)) for b in blocks]))
    right = np.column_stack([np.interp((stamps - START_NS) * 1e-9, data.time, data.truth["cg_accel"][:, i]) for i in range(6)])
    moving = stamps - START_NS > 2e9
    error = (found - right)[moving]
    assert np.sqrt(np.mean(error[:, 2] ** 2)) < 0.1 * right[moving, 2].std()
    assert np.mean(np.abs(error[:, 2:]) <= 2.5 * std[moving, 2:]) > 0.9


def test_a_stuck_single_axis_is_refused_and_one_that_is_not_measured_is_not():
    data, vehicle = measured_world()
    channels = dict(recording(data, vehicle).channels)
    values = channels["cab_rear_left"].values.copy()
    values[500:, 2] = values[500, 2]
    channels["cab_rear_left"] = dataclasses.replace(channels["cab_rear_left"], values=values)
    pipeline = Pipeline(vehicle)
    for _ in pipeline.replay(Recording("stuck", channels)):
        pass
    told = [m for m in pipeline.health().messages if "cab_" in m]
    assert any("cab_rear_left was not used" in m for m in told)
    assert not [m for m in told if "cab_rear_right" in m or "cab_front" in m]


def test_quality_judges_measured_axes_only():
    data, vehicle = measured_world()
    judged = judge_sensors(recording(data, vehicle), vehicle.sensors, vehicle.gravity)
    assert len(judged["cab_rear_left"].mean) == 1
    words = [f for n in SEVEN for f in judged[n].findings]
    assert not [f for f in words if "flat" in f or "gravity" in f or "median" in f]


def test_diagnosis_leaves_out_what_a_body_sensor_does_not_measure_and_refuses_half_a_base():
    _, vehicle = measured_world()
    channels = {n: 3 for n in vehicle.sensors}
    plant = build_plant(vehicle, channels)
    assert {(s.sensor, s.component) for s in plant.outputs if s.sensor == "cab_rear_left"} == {("cab_rear_left", 2)}
    base = with_axes(vehicle, {"chassis_front_left": "z"})
    with pytest.raises(InputDataError, match="chassis_front_left does not measure all three axes"):
        build_plant(base, channels)


def test_standstill_zeroes_the_axis_that_is_measured():
    _, vehicle = measured_world()
    rng, channels = np.random.default_rng(3), {}
    stamps = START_NS + np.arange(3000, dtype=np.int64) * 4_000_000
    for name, sensor in vehicle.sensors.items():
        reading = sensor.rotation.T @ (0.0, 0.0, vehicle.gravity) + 0.02 * rng.standard_normal((3000, 3))
        reading[:, 2] += 0.05 if name == "cab_rear_left" else 0.0
        channels[name] = Channel(name, stamps, sensor.only_measured(reading), stamps)
    found = calibrate(Recording("standing", channels), vehicle).vehicle(vehicle).sensors["cab_rear_left"]
    assert found.correction.bias == pytest.approx((0.0, 0.0, 0.05), abs=0.003)
    assert found.noise_std == pytest.approx(0.02, rel=0.1)
