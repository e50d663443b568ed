# Copyright 2026 ride_estimation contributors
"""Bracket tilt that no sensor sees, noise beside a faulty sensor, readings cut at a level: against planted truth."""

from __future__ import annotations

import dataclasses
import functools
import types

import numpy as np
import pytest
from diagnosis_runs import quarter_car, quarter_car_run

from ride_estimation.diagnosis.calibration.linear_model import file_parameters
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.hypotheses.characteristic import Family, odd_form
from ride_estimation.diagnosis.hypotheses.declipping import missing_readings
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import Plant, build_plant
from ride_estimation.diagnosis.runs.frame import local_motion, null_directions, own_sensor, plate_motion, unseen_tilt
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.noise import excess_inefficiency, noise_scale
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.outlier import soft_mount
from ride_estimation.diagnosis.search.prediction import Model as PredictionModel
from ride_estimation.diagnosis.search.prediction import block_squares, noise_squares, pooled_nrmse, predict
from ride_estimation.frames import point_motion_matrix
from ride_estimation.io.vehicle_file import load_vehicle

BINS = 3000


@functools.cache
def cab_plant() -> Plant:
    vehicle = load_vehicle("config/vehicles/truck_cab.yaml")
    return build_plant(vehicle, dict.fromkeys(vehicle.sensors, 3))


def base_motion(plant: Plant, local: float, rng: np.random.Generator) -> np.ndarray:
    """Return base spectra of a plate that moves, turns and twists, and brackets with motion of their own, (F, nb)."""
    def white(columns: int) -> np.ndarray:
        return (rng.normal(size=(BINS, columns)) + 1j * rng.normal(size=(BINS, columns))) / np.sqrt(2.0)

    positions = np.array([plant.vehicle.mounts[m].position for m in plant.mounts])
    return white(7) @ plate_motion(positions).T + local * white(3 * len(plant.mounts))


def test_every_bracket_of_the_cab_has_its_own_sensor():
    own = own_sensor(cab_plant(), "chassis")
    assert len(own) == 4
    assert len(set(own.values())) == 4


def test_a_rigid_twisting_frame_has_no_local_motion():
    plant = cab_plant()
    spectrum = base_motion(plant, 0.0, np.random.default_rng(1))
    silent = np.zeros((BINS, spectrum.shape[1], len(plant.inputs)))
    assert np.max(local_motion(plant, spectrum, silent, 1, 3)) < 1e-12


def test_local_motion_is_found_at_its_level_without_the_noise():
    plant = cab_plant()
    rng = np.random.default_rng(2)
    spectrum = base_motion(plant, 0.3, rng)
    noise = np.broadcast_to(0.1 * np.eye(len(plant.inputs)), (BINS, len(plant.inputs), len(plant.inputs)))
    found = local_motion(plant, spectrum, noise, 1, 101).mean(axis=0)
    # 0.3^2 less noise 0.1^2; smallest of five estimates of 3000 bins x at least 2 directions: 2 % each
    np.testing.assert_allclose(found, 0.3**2 - 0.1**2, rtol=0.1)


def test_a_faulty_base_sensor_is_no_local_motion():
    plant = cab_plant()
    rng = np.random.default_rng(3)
    spectrum = base_motion(plant, 0.05, rng)
    spectrum[:, 3:6] += rng.normal(size=(BINS, 3)) + 1j * rng.normal(size=(BINS, 3))
    silent = np.zeros((BINS, spectrum.shape[1], len(plant.inputs)))
    # the fault has 400 times the power of the local motion; the brackets without it still say 0.05^2
    assert np.mean(local_motion(plant, spectrum, silent, 1, 101)) == pytest.approx(0.05**2, rel=0.15)


def displaced_plant(shift: tuple[float, float, float], without: str = "") -> Plant:
    """Return the cab with every base sensor a stretch from its mount, without one of them."""
    vehicle = load_vehicle("config/vehicles/truck_cab.yaml")
    sensors = {
        n: dataclasses.replace(s, position=vehicle.mounts[s.mount].position + np.array(shift)) if s.body == "chassis" else s
        for n, s in vehicle.sensors.items() if s.mount != without or not without
    }
    return build_plant(dataclasses.replace(vehicle, sensors=sensors), dict.fromkeys(sensors, 3))


def readings(plant: Plant, motion: np.ndarray) -> np.ndarray:
    """Return what base sensors without gravity read of the acceleration of a rigid base, (nu,)."""
    sensors = plant.vehicle.sensors
    at = {n: sensors[n].rotation.T @ point_motion_matrix(sensors[n].position) @ motion for n in {s.sensor for s in plant.inputs}}
    return np.array([at[s.sensor][s.component] for s in plant.inputs])


def test_brackets_that_follow_the_frame_carry_the_lever_to_their_mounts():
    plant = displaced_plant((0.05, -0.03, 0.04))
    motion = np.array([0.3, -0.2, 1.1, 0.7, -0.5, 0.4])
    reading = readings(plant, motion)
    found = plant.base_direct @ reading + plant.lever_motion(plant.slope) @ reading
    expected = np.concatenate([point_motion_matrix(plant.vehicle.mounts[m].position) @ motion for m in plant.mounts])
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_brackets_that_stay_level_move_their_mounts_as_their_sensors():
    plant = displaced_plant((0.05, -0.03, 0.04))
    level = dataclasses.replace(plant, tilt_share=np.zeros(len(plant.tilts)))
    reading = readings(plant, np.array([0.0, 0.0, 1.0, 0.7, -0.5, 0.0]))
    still = level.lever_motion(level.slope) @ reading
    np.testing.assert_allclose(still, 0.0, atol=1e-12)
    own = {s.mount: s.position for s in plant.vehicle.sensors.values() if s.body == "chassis"}
    expected = np.concatenate([point_motion_matrix(own[m]) @ [0.0, 0.0, 1.0, 0.7, -0.5, 0.0] for m in plant.mounts])
    np.testing.assert_allclose(level.base_direct @ reading, expected, rtol=1e-9, atol=1e-12)


def test_bending_that_no_sensor_shows_grows_to_the_first_mode_and_twist_is_unknown_of_three_brackets():
    omega = 2.0 * np.pi * np.linspace(1.0, 16.0, 16)
    motion = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    heave, roll = (displaced_plant((0.0, 0.0, 0.0), without) for without in ("", "rear_left"))
    spectrum = np.tile(motion[:3], len(heave.mounts)) * np.ones((16, 1), dtype=complex)
    power = unseen_tilt(heave, spectrum, readings(heave, motion) * np.ones((16, 1), dtype=complex), omega, 1, 1)
    np.testing.assert_allclose(power[:4] / power[7], ((np.arange(4) + 1.0) / 8.0)[:, None] ** 4 * np.ones(power.shape[1]))
    np.testing.assert_allclose(power[8:], power[7] * np.ones((8, 1)))
    turn = readings(roll, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])) * np.ones((16, 1), dtype=complex)
    unknown = unseen_tilt(roll, np.zeros((16, 3 * len(roll.mounts)), dtype=complex), turn, omega, 1, 1)
    # half of the slope that the three show, of roll alone
    np.testing.assert_allclose(np.sqrt(unknown[:, ::2]), 0.5, rtol=1e-9)
    np.testing.assert_allclose(unknown[:, 1::2], 0.0, atol=1e-12)


def test_three_brackets_each_follow_the_tilt_they_show_by_a_share_of_their_own():
    four, three = (displaced_plant((0.05, -0.03, 0.04), without) for without in ("", "rear_left"))
    assert {(t.kind, t.place) for t in four.tilts if t.kind == "tilt"} == {("tilt", "frame")}
    assert {(t.kind, t.place) for t in three.tilts} == {("tilt", m) for m in three.mounts}
    # together they are the tilt of the rigid frame
    motion = np.array([0.0, 0.0, 1.0, 0.7, -0.5, 0.0])
    turned = (three.slope - three.base_yaw) @ readings(three, motion)
    np.testing.assert_allclose(turned.reshape(-1, 3), np.tile([0.7, -0.5, 0.0], (len(three.mounts), 1)), atol=1e-9)


def test_null_directions_are_orthogonal_to_the_motion():
    motion = np.random.default_rng(4).normal(size=(12, 7)) * np.array([1.0, 1.0, 1e3, 1.0, 1e-3, 1.0, 1.0])
    null = null_directions(motion)
    assert null.shape == (12, 5)
    np.testing.assert_allclose(null.T @ (motion / np.linalg.norm(motion, axis=0)), 0.0, atol=1e-12)


def test_a_trial_model_without_finite_motion_is_judged_and_raises_nothing():
    white = np.random.default_rng(6).normal(size=(600, 4)) + 0j
    assert excess_inefficiency(3.0 * white, 1) >= 1.0
    white[100, 2] = np.nan
    assert excess_inefficiency(white, 1) == 1.0


def test_one_faulty_body_sensor_does_not_count_as_noise():
    rng = np.random.default_rng(5)
    motion, samples = rng.normal(size=(12, 6)), 4000
    data = 0.02 * rng.normal(size=(samples, 12)) + rng.normal(size=(samples, 6)) @ motion.T
    data[:, :3] += 0.2 * rng.normal(size=(samples, 3))
    spectrum = np.fft.rfft(data, axis=0)[1:-1]
    frequency = np.fft.rfftfreq(samples, 0.005)[1:-1]
    stated = np.full(12, 0.02)
    sensors = [f"s{i // 3}" for i in range(12)]
    assert noise_scale(spectrum, motion, stated, frequency, samples) > 2.0
    assert noise_scale(spectrum, motion, stated, frequency, samples, sensors) == pytest.approx(1.0, abs=0.05)


def twisting_frame(rng: np.random.Generator, samples: int = 6000) -> np.ndarray:
    """Return vertical readings of four corners, shape (N, 4): heave, pitch, roll and a third as much twist, 0.5 to 8 Hz."""
    frequency = np.fft.rfftfreq(samples, 0.005)[:, None]
    band = (frequency > 0.5) & (frequency < 8.0)
    motion = np.fft.irfft(band * np.fft.rfft(rng.normal(size=(samples, 4)), axis=0), samples, axis=0)
    motion /= motion.std(axis=0)
    modes = np.array([[1.0, 1.0, 1.0, 1.0], [1.0, 1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0], [1.0, -1.0, -1.0, 1.0]])
    return np.asarray(9.81 + motion @ (modes * [[1.0], [0.6], [0.5], [0.3]]) + 0.01 * rng.normal(size=(samples, 4)))


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("channels", "left"), [([0, 1, 2, 3], 0.35), ([0], 0.7)])
def test_cut_readings_come_back_from_the_channels_beside_them(side, channels, left):
    readings = twisting_frame(np.random.default_rng(4))[:, channels]
    true = readings[:, 0].copy()
    level = 9.81 + side * 1.2 * np.std(true)
    cut = side * (true - level) >= 0.0
    readings[cut, 0] = level
    missing = missing_readings(readings, 0, cut, side, 200.0)
    assert np.all(side * missing >= 0.0)
    assert np.all(missing[~cut] == 0.0)
    assert np.std((true - readings[:, 0]) - missing) < left * np.std(true - readings[:, 0])


def test_nothing_comes_back_where_nearly_every_reading_is_cut():
    readings = twisting_frame(np.random.default_rng(4), 200)
    cut = np.arange(200) > 6
    assert not np.any(missing_readings(readings, 0, cut, 1.0, 200.0))


@pytest.mark.parametrize("family", [Family.SATURATING, Family.GROWING, Family.BULGE])
def test_characteristic_forms_are_odd_and_start_with_unit_slope(family):
    u = np.linspace(-2.0, 2.0, 41)
    y = odd_form(u, {"family": float(family), "scale": 0.8})
    np.testing.assert_allclose(y, -y[::-1], atol=1e-14)
    small = odd_form(np.array([1e-5]), {"family": float(family), "scale": 0.8})
    assert small[0] == pytest.approx(1e-5, rel=1e-8)


def test_a_nonlinear_spring_is_not_called_a_soft_mount_for_its_rate_at_rest():
    plant = cab_plant()
    prior = file_parameters(plant)[0]
    ports = [(p.mount, p.axis) for p in plant.ports]
    index = ports.index(("rear_left", "z"))
    view = types.SimpleNamespace(plant=plant, state=ModelState(prior.copy(), file_parameters(plant)[1].copy()))
    calibrated = types.SimpleNamespace(view=view, adjustables=(), fit=types.SimpleNamespace(coefficients=np.zeros(0)))
    soft = prior.copy()
    soft[index] *= 0.6
    log_std = np.full(len(prior), 0.005)
    named = soft_mount(calibrated, soft, log_std)
    assert named is not None
    assert (named.hypothesis.location, named.hypothesis.axis) == ("rear_left", "z")
    assert soft_mount(calibrated, soft, log_std, {index}) is None
    # softer at rest and on the average, as a curved spring is: friction does not do that, a spring that bends does
    view.state = ModelState(soft.copy(), view.state.damping)
    assert soft_mount(calibrated, soft, log_std, {index}) is not None
    assert soft_mount(calibrated, soft, log_std, {index}, {index}) is None


def test_the_noise_floor_of_quiet_blocks_is_higher_than_that_of_loud_ones():
    vehicle, run = quarter_car(), quarter_car_run(seed=5)
    plant = build_plant(vehicle, {"body": 3, "base": 3})
    data = RunData(plant, measurement(plant, run), Settings())
    view = RunView(data, ModelState(np.array([44e3]), np.array([2e3])))
    model = PredictionModel(ModelState(np.array([44e3]), np.array([2e3])), (), np.zeros(0))
    prediction = predict(data, model)
    errors, signal = block_squares(prediction)
    order = np.argsort(signal)
    noise = noise_squares(view)
    quiet, loud = (pooled_nrmse(noise, signal, blocks) for blocks in (order[:3], order[-3:]))
    assert quiet > loud
    everything = np.arange(len(signal))
    # a right model leaves the floor: chi-square of some thousand samples, and 0.4 % tolerated model error
    nrmse = np.sqrt(errors.sum() / signal.sum())
    assert pooled_nrmse(noise, signal, everything) == pytest.approx(nrmse, rel=0.15)
