# Copyright 2026 ride_estimation contributors
"""Field runs: what the truck does to the mount bases, and vehicles of other shapes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ride_estimation.errors import ConfigurationError
from ride_estimation.excitation.road import CLASS_ROUGHNESS
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.measurement import SensorErrors
from ride_estimation.simulation.field_run import run_scenario, true_vehicle
from ride_estimation.simulation.rotation import Payload
from ride_estimation.simulation.scenario import Disturbance, Engine, LaneChange, Obstacle, RoadSpec, Scenario
from ride_estimation.simulation.truck_drive import drive

VEHICLES = Path(__file__).parents[2] / "config" / "vehicles"
CAB = load_vehicle(VEHICLES / "truck_cab.yaml")
PERFECT = SensorErrors(rate=200.0, noise_scale=0.0, anti_alias=0.0, synchronous=True)


def scenario(**changes):
    values = {"name": "t", "seed": 3, "vehicle_file": "x", "duration": 6.0, "speed": ((0.0, 14.0),), "sensor_errors": PERFECT}
    return Scenario(**{**values, **changes})


def recorded(base_or_drive):
    base = base_or_drive.base
    return {n: getattr(base, n)[base_or_drive.lead :] for n in ("displacement", "velocity", "acceleration", "angle")}


def test_rough_road_moves_the_four_bases_independently():
    motion = recorded(drive(scenario(road=RoadSpec(CLASS_ROUGHNESS["C"]), duration=20.0), CAB))
    vertical = motion["displacement"][:, :, 2] - motion["displacement"][:, :, 2].mean(axis=0)
    warp = (vertical[:, 0] - vertical[:, 1] - vertical[:, 2] + vertical[:, 3]) / 4.0
    assert np.std(warp) > 1e-4  # m of frame twist between the mounts
    singular = np.linalg.svd(vertical, compute_uv=False)
    assert singular[-1] / singular[0] > 1e-3  # four independent vertical motions
    assert np.std(motion["displacement"][:, :, 1]) > 1e-4 and np.std(motion["angle"][:, :, 1]) > 1e-3


def test_base_velocity_and_acceleration_are_the_derivatives_of_the_displacement():
    d = drive(scenario(road=RoadSpec(CLASS_ROUGHNESS["C"]), lane_changes=(LaneChange(1.0, 3.0, 1.0),),
                       engine=Engine(((0.0, 10.0),), {3.0: 0.3})), CAB)
    rate = d.base.rate_hz
    for value, slope in (("displacement", "velocity"), ("velocity", "acceleration"), ("angle", "angular_rate")):
        numeric = np.gradient(getattr(d.base, value), 1.0 / rate, axis=0)[5:-5]
        stated = getattr(d.base, slope)[5:-5]
        scale = np.abs(stated).max()
        assert np.abs(numeric - stated).max() < 0.03 * scale, value  # second-order differences of 30 Hz lines at 1 kHz


def test_the_front_meets_a_bump_before_the_rear_and_one_side_rolls_the_frame():
    bump = Obstacle("cosine", 28.0, 1.5, 0.05, "left")
    d = drive(scenario(obstacles=(bump,)), CAB)
    motion = recorded(d)
    roll = motion["angle"][:, 0, 0]
    assert np.abs(roll).max() > 2e-3  # rad
    assert np.abs(roll[:1500]).max() < 1e-3 * np.abs(roll).max()  # nothing before 28 m at 14 m/s = 2 s
    first = np.argmax(np.abs(roll) > 0.05 * np.abs(roll).max()) / 1000.0
    assert 2.0 - 0.1 < first < 2.3  # s
    assert roll[2000:2300].max() > 0.0  # left side up is positive roll about x forward
    right = recorded(drive(scenario(obstacles=(Obstacle("cosine", 28.0, 1.5, 0.05, "right"),)), CAB))
    np.testing.assert_allclose(right["angle"][:, :, 0], -motion["angle"][:, :, 0], atol=1e-9)  # mirror image
    both = recorded(drive(scenario(obstacles=(Obstacle("cosine", 28.0, 1.5, 0.05),)), CAB))
    assert np.abs(both["angle"][:, :, 0]).max() < 1e-9  # a symmetric truck on a symmetric bump does not roll


def test_standing_still_on_any_road_only_the_engine_moves_the_bases():
    quiet = recorded(drive(scenario(speed=((0.0, 0.0),), road=RoadSpec(CLASS_ROUGHNESS["E"])), CAB))
    assert np.abs(quiet["acceleration"][2000:]).max() < 5e-3  # m/s^2: the run-up has died out
    idle = recorded(drive(scenario(speed=((0.0, 0.0),), engine=Engine(((0.0, 10.0),), {3.0: 0.5})), CAB))
    vertical = idle["acceleration"][1000:, :, 2]
    np.testing.assert_allclose(np.sqrt(2.0) * vertical.std(axis=0), 0.5, rtol=0.25)  # m/s^2, 20 % scatter between mounts
    frequency = np.fft.rfftfreq(len(vertical), 1e-3)
    assert frequency[np.argmax(np.abs(np.fft.rfft(vertical[:, 0])))] == pytest.approx(30.0, abs=0.3)


def test_braking_and_lane_change_reach_the_bases():
    d = drive(scenario(speed=((0.0, 14.0), (2.0, 14.0), (4.0, 8.0)), duration=8.0), CAB)
    motion = recorded(d)
    assert motion["acceleration"][3000, 0, 0] == pytest.approx(-3.0, rel=0.35)  # m/s^2
    assert motion["angle"][3200, 0, 1] > 0.002  # rad, nose down
    turned = recorded(drive(scenario(lane_changes=(LaneChange(1.0, 4.0, 1.0),)), CAB))
    assert turned["angle"][3000, 0, 2] == pytest.approx(1.0 * 4.0 / np.pi / 14.0, rel=0.25)  # rad, yaw at half way
    assert abs(turned["angle"][-1, 0, 2]) < 0.02


def test_a_lane_change_turns_the_frame_as_one_body_and_pulls_across_its_heading_alone():
    motion = recorded(drive(scenario(speed=((0.0, 7.0),), lane_changes=(LaneChange(1.0, 4.0, 1.5),)), CAB))
    yaw = motion["angle"][:, 0, 2]
    assert yaw.max() > 0.2  # rad
    places = np.array([m.position for m in CAB.mounts.values()])
    now = places + motion["displacement"]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        # a frame that twists, not brackets that pivot where they are
        apart = np.linalg.norm((now[:, i] - now[:, j])[:, :2], axis=1)
        np.testing.assert_allclose(apart, np.linalg.norm((places[i] - places[j])[:2]), atol=0.01)
    pull = motion["acceleration"].mean(axis=1)
    ahead, across = np.cos(yaw) * pull[:, 0] + np.sin(yaw) * pull[:, 1], np.cos(yaw) * pull[:, 1] - np.sin(yaw) * pull[:, 0]
    assert np.abs(across).max() > 1.4
    assert np.abs(ahead).max() < 0.05  # m/s^2: at constant speed nothing pulls along the heading


def test_cab_sensors_at_rest_read_gravity_up():
    run = run_scenario(scenario(speed=((0.0, 0.0),)), CAB)
    for channel in run.recording.channels.values():
        np.testing.assert_allclose(channel.values[-1], [0.0, 0.0, CAB.gravity], atol=2e-3)  # m/s^2
    np.testing.assert_allclose(run.truth.signals["mount_force"][-1].sum(axis=0), [0.0, 0.0, 1200.0 * CAB.gravity], atol=1.0)


def test_transducers_speed_gyro_and_load_cell_are_recorded():
    vehicle = load_vehicle(VEHICLES / "truck_cab_transducers.yaml")
    run = run_scenario(scenario(road=RoadSpec(CLASS_ROUGHNESS["B"])), vehicle)
    signals, channels = run.truth.signals, run.recording.channels
    assert set(channels) == set(vehicle.sensors)
    stamps = [channels[f"travel_{m}"].stamp_ns for m in vehicle.mount_names]
    assert all(np.array_equal(stamps[0], s) for s in stamps)  # one JointState message
    every = slice(None, None, 2)  # truth at 100 Hz, sensors at 200 Hz, both from 0
    for number, mount in enumerate(vehicle.mount_names):
        read = channels[f"travel_{mount}"].values[every, 0]
        np.testing.assert_allclose(read, signals["mount_deflection"][: len(read), number, 2], atol=1e-6)  # m
    gyro = channels["cab_rear_right"].values[every, 3:]
    np.testing.assert_allclose(gyro, signals["angular_rate"][: len(gyro)], atol=1e-5)  # rad/s
    force = channels["load_cell_front_left"].values[every]
    np.testing.assert_allclose(force, signals["mount_force"][: len(force), 0], rtol=1e-5, atol=0.01)  # N
    np.testing.assert_allclose(channels["vehicle_speed"].values, 14.0, atol=1e-9)


def test_a_payload_of_twenty_percent_is_added_and_stays():
    load = Payload("cab", 240.0, np.array([-0.2, 0.1, 0.0]), 2.0, 0.5)
    run = run_scenario(scenario(road=RoadSpec(CLASS_ROUGHNESS["B"]), payloads=(load,), duration=12.0), CAB)
    signals = run.truth.signals
    np.testing.assert_allclose(signals["mass"][[100, -1]], [1200.0, 1440.0])
    lifted = signals["mount_force"].sum(axis=1)[:, 2]
    np.testing.assert_allclose(lifted[600:].mean() - lifted[:190].mean(), 240.0 * CAB.gravity, rtol=0.1)  # N
    # inertial load is that of cab and payload: forces minus weight
    total = np.linalg.norm(signals["mount_force"].sum(axis=1)[-1] - signals["inertial_load"][-1, :3])
    assert total == pytest.approx(1440.0 * CAB.gravity, rel=1e-4)


def test_a_hidden_disturbance_is_a_line_at_its_frequency():
    hum = Disturbance("cab", np.array([0.6, 0.2, 0.0]), "z", 6.3, 100.0)
    run = run_scenario(scenario(speed=((0.0, 0.0),), disturbances=(hum,), duration=20.0), CAB)
    heave = run.truth.signals["cg_accel"][500:, 2]
    spectrum = np.abs(np.fft.rfft(heave * np.hanning(len(heave))))
    assert np.fft.rfftfreq(len(heave), 0.01)[np.argmax(spectrum)] == pytest.approx(6.3, abs=0.1)
    assert run.truth.parameters["kinematics"] == "full rotation"


@pytest.mark.parametrize("name", ["quarter_car", "planar_machine_set_b"])
def test_vehicles_with_locked_coordinates_run_with_small_rotations_on_the_road(name):
    vehicle = load_vehicle(VEHICLES / f"{name}.yaml")
    run = run_scenario(scenario(road=RoadSpec(CLASS_ROUGHNESS["B"])), vehicle)
    assert run.truth.parameters["kinematics"] == "small rotations"
    assert 0.02 < np.std(run.truth.signals["cg_accel"][:, 2]) < 10.0  # m/s^2
    force = run.truth.signals["mount_force"]
    assert np.all(np.isfinite(force))
    weight = sum(b.mass.value for b in vehicle.bodies.values()) * vehicle.gravity
    on_road = [i for i, m in enumerate(vehicle.mounts.values()) if m.base == "road"]
    assert force[:, on_road, 2].sum(axis=1).mean() == pytest.approx(weight, rel=0.02)  # N


def test_a_payload_on_locked_coordinates_is_refused():
    vehicle = load_vehicle(VEHICLES / "quarter_car.yaml")
    load = Payload("body", 100.0, np.zeros(3), 1.0)
    with pytest.raises(ConfigurationError, match=r"payloads: need a vehicle whose bodies have .*; body, axle cannot carry any"):
        run_scenario(scenario(payloads=(load,)), vehicle)


def test_true_vehicle_differs_only_where_the_scenario_says():
    changed = scenario(true_factors={("rear_left", "x", "damping"): 0.5}, true_bodies={"cab": {"mass": 1300.0}})
    real = true_vehicle(changed, CAB)
    assert real.mounts["rear_left"].elements["x"].damping == pytest.approx(900.0)
    assert real.mounts["rear_right"].elements["x"].damping == CAB.mounts["rear_right"].elements["x"].damping
    assert real.bodies["cab"].mass.value == 1300.0
    np.testing.assert_allclose(real.bodies["cab"].inertia, CAB.bodies["cab"].inertia * 1300.0 / 1200.0)
