# Copyright 2026 ride_estimation contributors
"""Angular rates as outputs of the model: what they show that accelerometers do not, and gyros that are in no good order.

The body that heaves and pitches is solved in the frequency domain by its own equations; the cab is that of the worlds.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from worlds.adapters import believed_vehicle, uniform_run
from worlds.cab import measure, simulate
from worlds.hidden_cab import NOISE, RATE_HZ, SEED, cab_on_roads, reference
from worlds.vehicle_text import Belief

from ride_estimation.diagnosis.answer.result import NO_DISCREPANCY
from ride_estimation.diagnosis.answer.wiring import found_mistakes, named_mistakes, put_right
from ride_estimation.diagnosis.calibration.baseline import sensor_error_spectra
from ride_estimation.diagnosis.calibration.gyros import unused_rates, wrong_gyros
from ride_estimation.diagnosis.calibration.linear_model import calibrate, file_parameters
from ride_estimation.diagnosis.common.effect import Effect, Where
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.hypotheses.sensor_column import turned_column
from ride_estimation.diagnosis.model.body_trajectories import BodyMotion, Trajectories
from ride_estimation.diagnosis.model.kinematics import output_correction
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.noise import gyro_noise_scale
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.prediction import Model, block_squares, predict
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.frames import rotation_from_rpy
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

RATE, SECONDS = 100.0, 30.0
MASS, INERTIA, HALF = 800.0, 900.0, 1.2
STIFFNESS, DAMPING = 60e3, 2.5e3
NOISE_STD, GYRO_STD = 0.01, 0.001
IMU = "imu"


def beam() -> Vehicle:
    """Return a body that heaves and pitches on two equal mounts, with an IMU at its CG that does not show gravity."""
    inertia = np.diag([400.0, INERTIA, INERTIA])
    body = Body("body", Prior(MASS), np.zeros(3), inertia, coordinates=("z", "pitch"))
    places = {"front": HALF, "rear": -HALF}
    mounts = {
        name: Mount(name, np.array([x, 0.0, 0.0]), "body", "chassis", {"z": KelvinVoigt(stiffness=55e3, damping=3e3)})
        for name, x in places.items()
    }
    sensors = {
        f"base_{name}": Sensor(
            f"base_{name}", "accelerometer", f"/{name}", "chassis", name, position=mounts[name].position, noise_std=NOISE_STD,
            coupling="ac",
        )
        for name in places
    }
    sensors[IMU] = Sensor(IMU, "imu", "/imu", "body", noise_std=NOISE_STD, gyro_noise_std=GYRO_STD, coupling="ac")
    return Vehicle("beam", {"body": body}, mounts, sensors)


def ride(seed: int, moment: float = 0.0, hertz: float = 5.3) -> UniformRun:
    """Return a run of the beam over two random bases that differ, with a periodic pitching moment [N m] that nobody measures."""
    rng = np.random.default_rng(seed)
    n = int(SECONDS * RATE)
    f = np.fft.rfftfreq(n, 1.0 / RATE)
    omega = 2.0 * np.pi * f
    shape = np.where((f > 0.3) & (f < 30.0), 1.0 / np.maximum(f, 0.5) ** 1.5, 0.0)
    spectrum = shape * np.exp(2j * np.pi * rng.random((2, len(f))))
    spectrum *= 0.006 / np.std(np.fft.irfft(spectrum[0], n))
    force = STIFFNESS + 1j * omega * DAMPING
    tone = np.fft.rfft(moment * np.sin(2.0 * np.pi * hertz * np.arange(n) / RATE))
    heave = force * (spectrum[0] + spectrum[1]) / (2.0 * force - MASS * omega**2)
    # a body that pitches by theta goes down by x theta at x
    pitch = (tone - HALF * force * (spectrum[0] - spectrum[1])) / (2.0 * HALF**2 * force - INERTIA * omega**2)

    def column(values: np.ndarray, derivative: int) -> np.ndarray:
        return np.fft.irfft(values * (1j * omega) ** derivative, n)

    data = {IMU: np.zeros((n, 6)), "base_front": np.zeros((n, 3)), "base_rear": np.zeros((n, 3))}
    data[IMU][:, 2], data[IMU][:, 4] = column(heave, 2), column(pitch, 1)
    data["base_front"][:, 2], data["base_rear"][:, 2] = column(spectrum[0], 2), column(spectrum[1], 2)
    for values in data.values():
        values[:, :3] += NOISE_STD * rng.standard_normal((n, 3))
        values[:, 3:] += GYRO_STD * rng.standard_normal(values[:, 3:].shape)
    # a gyro has a bias
    data[IMU][:, 3:] += (0.02, -0.05, 0.01)
    return UniformRun(f"beam_{seed}", RATE, 0, data, {name: np.ones(n, dtype=bool) for name in data})


def without_rates(run: UniformRun) -> UniformRun:
    return dataclasses.replace(run, data={name: values[:, :3] for name, values in run.data.items()})


def with_rates(run: UniformRun, change) -> UniformRun:
    """Return a run whose angular rates are changed."""
    changed = {name: np.hstack([v[:, :3], change(v[:, 3:])]) for name, v in run.data.items() if v.shape[1] == 6}
    return dataclasses.replace(run, data={**run.data, **changed})


def data_of(vehicle: Vehicle, run: UniformRun) -> RunData:
    plant = build_plant(vehicle, {name: values.shape[1] for name, values in run.data.items()})
    return RunData(plant, measurement(plant, run), Settings())


@functools.cache
def cab(angle: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[Vehicle, UniformRun, UniformRun]:
    """Return file and two runs of the healthy cab of the worlds with one IMU, turned by angles about its axes [rad]."""
    vehicle, sensors, roads = cab_on_roads()
    turned = dataclasses.replace(sensors[3], kind="imu", true_rotation=sensors[3].rotation @ rotation_from_rpy(*angle))
    sensors = tuple(turned if s.name == turned.name else s for s in sensors)
    fit = measure(reference().run, sensors, RATE_HZ, SEED, noise_share=NOISE)
    other = measure(simulate(vehicle, roads[1]), fit.sensors, RATE_HZ, SEED + 1)
    return believed_vehicle(fit, Belief(), SEED), uniform_run(fit, "fit"), uniform_run(other, "other")


def test_rates_of_a_healthy_body_are_predicted_down_to_their_noise():
    answer = diagnose(beam(), ride(1), [ride(2)])
    assert (answer.verdict, answer.causes) == (NO_DISCREPANCY, ())
    row = answer.evidence.channel_names.index("imu.rate_y")
    base, _, floor = answer.evidence.channel_nrmse[row]
    assert 0.9 * floor < base < 1.1 * floor
    assert answer.evidence.rates == ("imu.rate_y",)
    assert answer.evidence.unit == "m/s^2"
    assert "angular rates" in answer.gain.metric
    assert not [w for w in answer.warnings if "angular" in w]


def test_a_moment_that_no_accelerometer_shows_is_found_by_the_gyro():
    # about the CG of a body on equal mounts: its pitching moves no accelerometer there
    runs = ride(3, moment=150.0), ride(4, moment=150.0)
    answer = diagnose(beam(), runs[0], runs[1:])
    assert [c.id for c in answer.causes] == ["harmonic_disturbance"]
    found = {p.name: p for p in answer.causes[0].parameters}
    assert found["frequency"].value == pytest.approx(5.3, abs=0.02)
    judged = answer.gain.validation[0]
    assert judged.baseline > 2.0 * judged.noise_floor > 1.8 * judged.extended
    blind = diagnose(beam(), without_rates(runs[0]), [without_rates(runs[1])])
    assert (blind.verdict, blind.causes) == (NO_DISCREPANCY, ())


FAULTS = {
    "deg/s": np.degrees,
    "mrad/s": lambda w: 1e3 * w,
    "inverted": lambda w: w * [1.0, -1.0, 1.0],
    "exchanged": lambda w: w[:, [1, 0, 2]],
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_gyro_in_another_unit_or_along_other_axes_is_left_out(fault):
    # one IMU: nothing but the model shows how the body turns
    vehicle, runs = beam(), [with_rates(ride(seed), FAULTS[fault]) for seed in (5, 6)]
    answer = diagnose(vehicle, runs[0], runs[1:])
    assert (answer.verdict, answer.causes) == (NO_DISCREPANCY, ())
    assert answer.evidence.channel_names == ("imu.z",)
    assert [w for w in answer.warnings if w.startswith("the angular rates of imu are not used")]


@pytest.mark.parametrize("fault", FAULTS)
def test_accelerometers_that_show_how_a_body_turns_judge_its_gyro(fault):
    vehicle, run, _ = cab()
    plant = data_of(vehicle, run).plant
    (gyro,) = {s.sensor for s in plant.outputs if s.kind == "rate"}
    assert wrong_gyros(plant, run, Settings()) == {}
    assert list(wrong_gyros(plant, with_rates(run, FAULTS[fault]), Settings())) == [gyro]


def test_a_gyro_of_half_the_rate_is_named_and_no_mechanical_cause():
    runs = [with_rates(ride(seed), lambda w: 0.5 * w) for seed in (7, 8)]
    answer = diagnose(beam(), runs[0], runs[1:])
    assert [(c.id, c.location, c.axis) for c in answer.causes] == [("sensor_gain", IMU, "rate_y")]
    # a rotation about yaw would only shorten this reading, by the cosine of 60 degrees: it must not halve the confidence
    assert answer.causes[0].confidence > 0.9
    assert ("sensor_misalignment", IMU) not in {(r.id, r.location) for r in answer.causes[0].rivals}
    (error,) = answer.causes[0].parameters
    assert error.name == "gain error of the angular rate"
    assert error.value == pytest.approx(-0.5, abs=max(3.0 * error.std, 0.005))
    # a vehicle file has no key for it
    assert answer.extended.sensors[IMU].correction.empty
    assert any("vehicle file has no gain of angular rates" in r for r in answer.remarks)


def test_a_cut_gyro_is_left_out():
    run = ride(9)
    limits = np.tile([[-np.inf], [np.inf]], 6)
    assert wrong_gyros(data_of(beam(), run).plant, run, Settings()) == {}
    limits[1, 4] = 0.1
    cut = dataclasses.replace(run, clipped_at={IMU: limits})
    assert "cut" in wrong_gyros(data_of(beam(), cut).plant, cut, Settings())[IMU]


def test_the_rates_of_an_imu_that_was_bolted_on_turned_by_a_right_angle_are_turned_back_too():
    vehicle, run, _ = cab()

    def bolted(values: np.ndarray) -> np.ndarray:
        return np.hstack([values[:, first : first + 3][:, [1, 0, 2]] * [1.0, -1.0, 1.0] for first in (0, 3)])

    turned = dataclasses.replace(run, data={**run.data, "cab_rear_right": bolted(run.data["cab_rear_right"])})
    found, _ = found_mistakes(vehicle, [turned])
    assert [(c.id, c.location, c.axis) for c in named_mistakes(vehicle, found)] == [
        ("sensor_misalignment", "cab_rear_right", "yaw")
    ]
    again = put_right(turned, found)
    np.testing.assert_allclose(again.data["cab_rear_right"], run.data["cab_rear_right"], rtol=1e-12)
    plant = data_of(vehicle, again).plant
    assert wrong_gyros(plant, again, Settings()) == {}
    assert list(wrong_gyros(plant, turned, Settings())) == ["cab_rear_right"]


def test_gyros_on_bases_and_of_bodies_that_do_not_turn_are_said_not_to_be_used():
    vehicle = beam()
    sensors = {**vehicle.sensors, "base_front": dataclasses.replace(vehicle.sensors["base_front"], kind="imu")}
    at_base = dataclasses.replace(vehicle, sensors=sensors)
    columns = dict.fromkeys(sensors, 3) | {IMU: 6, "base_front": 6}
    (words,) = unused_rates(build_plant(at_base, columns), columns)
    assert words.startswith("the angular rates of base_front are not used: base motion")
    still = dataclasses.replace(vehicle.bodies["body"], coordinates=("z",))
    plant = build_plant(dataclasses.replace(vehicle, bodies={"body": still}), columns)
    assert [s.kind for s in plant.outputs] == ["acceleration"]
    assert unused_rates(plant, columns)[-1].endswith("their body does not turn in the model")


def test_a_run_without_the_angular_rates_of_a_plant_does_not_judge_it():
    plant = data_of(beam(), ride(1)).plant
    with pytest.raises(KeyError, match=r"imu \(angular rates\)"):
        measurement(plant, without_rates(ride(1)))


def test_what_small_rotations_leave_out_of_rates_falls_with_the_third_power_of_the_motion():
    vehicle, run, _ = cab()
    plant = data_of(vehicle, run).plant
    rng = np.random.default_rng(4)
    q, v = rng.standard_normal((2, 1, len(plant.coordinates)))
    rows = [i for i, s in enumerate(plant.outputs) if s.kind == "rate"]
    rotation = vehicle.sensors[plant.outputs[rows[0]].sensor].rotation
    error, step, six = {}, 1e-6, plant.body_map("cab")
    for share in (0.2, 0.02):
        motion = BodyMotion(share * q, share * v, np.zeros_like(q))
        turns = [Rotation.from_rotvec((share * (q[0] + t * v[0])) @ six[3:].T) for t in (-step, step)]
        true = (turns[0].inv() * turns[1]).as_rotvec() / (2.0 * step) @ rotation
        stated = plant.out_rate[rows] @ motion.velocity[0] + output_correction(plant, Trajectories(plant, motion).bodies)[0, rows]
        error[share] = np.linalg.norm(stated - true)
    assert error[0.2] < 0.03 * np.linalg.norm(0.2 * v @ six[3:].T)
    assert error[0.2] / error[0.02] == pytest.approx(1000.0, rel=0.1)


@functools.cache
def cab_view() -> RunView:
    vehicle, run, _ = cab()
    data = data_of(vehicle, run)
    return RunView(data, ModelState(*file_parameters(data.plant)))


def of_the_imu(view: RunView) -> dict[int, int]:
    rated = {s.sensor for s in view.plant.outputs if s.kind == "rate"}
    return {s.component: i for i, s in enumerate(view.plant.outputs) if s.sensor in rated}


def test_rotation_and_delay_of_an_imu_are_one_error_of_its_six_channels_and_gain_is_of_one():
    view = cab_view()
    rows, ideal = of_the_imu(view), view.model.ideal_spectrum
    assert sorted(rows) == [0, 1, 2, 3, 4, 5]
    sensor = view.plant.outputs[rows[0]].sensor
    angle = 0.2
    turn = rotation_from_rpy(0.0, angle, 0.0)
    read = {e.index: view.grid.spectrum(e.signal) for e in turned_column(view, sensor, 1, angle) if e.where is Where.OUTPUT}
    for first in (0, 3):
        own = [rows[first + c] for c in range(3)]
        expected = view.grid.spectrum(view.grid.signal(ideal[:, own] @ turn - ideal[:, own]))
        found = np.stack([angle * read[i] if i in read else np.zeros(len(ideal)) for i in own], axis=1)
        assert np.abs(found - expected).max() < 1e-9 * np.abs(ideal[:, own]).max()
    late, _ = sensor_error_spectra(view, sensor, "delay", 0)
    assert sorted(late) == sorted(rows.values())
    moved, _ = sensor_error_spectra(view, sensor, "position", 0)
    assert sorted(moved) == sorted(rows[c] for c in range(3))
    for component, channel in rows.items():
        gained, _ = sensor_error_spectra(view, sensor, "gain", component)
        assert list(gained) == [channel]


def test_forces_are_pushed_into_the_whitened_channels_that_they_reach_and_no_others():
    view = cab_view()
    plant, grid = view.plant, view.grid
    basis, silent = plant.output_basis
    # accelerometers of a rigid body show six accelerations, a gyro three rates
    assert silent == len(plant.outputs) - 9 == view.noise.silent(plant) > 0
    assert np.linalg.matrix_rank(basis) == len(plant.outputs)
    # the covariance is that of the outputs whatever the basis
    white = view.noise.whitener @ view.noise.covariance @ np.conj(view.noise.whitener.swapaxes(1, 2))
    expected = np.eye(len(plant.outputs)) * (grid.band_weight**2)[:, None, None]
    assert np.abs(white - expected).max() < 1e-6
    rng = np.random.default_rng(5)
    signal = rng.standard_normal(grid.samples)
    reading = Effect(Where.OUTPUT, 1, signal)
    port, wrench = Effect(Where.PORT, 2, signal), Effect(Where.WRENCH, 4, signal)
    spectrum = grid.spectrum(signal)[:, None]
    moved = view.response.output_from_port[:, :, 2], view.response.output_from_wrench[:, :, 4]
    whole = view.rows(np.stack(moved, axis=2) * spectrum[:, :, None])
    forces = view.push([(port,), (wrench,)])
    assert forces.shape[1] * len(plant.outputs) == 9 * whole.shape[1]
    left, size = whole.shape[1] - forces.shape[1], np.abs(whole).max()
    assert np.abs(whole[:, :left]).max() < 1e-7 * size
    np.testing.assert_allclose(forces, whole[:, left:], atol=1e-7 * size)
    # beside a reading, and where many columns are pushed part by part, all rows are there
    mixed = view.push([*[(port,)] * 40, (port, reading)])
    np.testing.assert_allclose(mixed[:, left:, :40], np.repeat(whole[:, left:, :1], 40, axis=2), atol=1e-7 * size)
    both = view.push([(reading,)]) + whole[:, :, :1]
    np.testing.assert_allclose(mixed[:, :, 40:], both, atol=1e-7 * np.abs(both).max())
    # another plant, of which a sensor sits elsewhere, reaches every channel
    moved = plant.out_acceleration.copy()
    moved[0, 4] += 0.1
    assert view.noise.silent(dataclasses.replace(plant, out_acceleration=moved)) == 0


def test_the_gain_of_a_rate_has_a_tolerance_of_its_own_and_no_mean_reading():
    vehicle, run, _ = cab()
    found = calibrate(data_of(vehicle, run), iterations=1)
    gains = {a.axis: a for a in found.adjustables if a.kind == "gain" and a.place == "cab_rear_right"}
    assert list(gains) == ["x", "y", "z", "rate_x", "rate_y", "rate_z"]
    assert gains["rate_y"].prior_std == Settings().tolerances.gyro_gain != gains["y"].prior_std
    assert not any(s.kind == "rate" for s in found.table.signals)


def test_noise_of_a_gyro_is_measured_against_the_accelerometers():
    view = cab_view()
    vehicle, run, _ = cab()
    assert view.data.gyro_scale == {"cab_rear_right": pytest.approx(1.0, abs=0.1)}
    noisy = with_rates(run, lambda w: w + 0.004 * np.random.default_rng(2).standard_normal(w.shape))
    data = data_of(vehicle, noisy)
    assert data.gyro_scale == {"cab_rear_right": pytest.approx(np.hypot(4.0, 1.0), rel=0.1)}
    assert data.noise_scale == view.data.noise_scale
    rows = of_the_imu(view)
    assert data.output_noise[rows[4]] / view.data.output_noise[rows[4]] > 3.0
    assert data.output_noise[rows[0]] == view.data.output_noise[rows[0]]
    # an accelerometer beside the axis of a rotation shows nothing of it
    blind = np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
    spectra = tuple(np.ones((50, 1), dtype=complex) for _ in range(2))
    assert gyro_noise_scale(spectra, blind, (np.ones(1), np.ones(1)), np.arange(1.0, 51.0), 100) == 1.0


def test_errors_are_pooled_in_units_of_acceleration():
    # rates of a hundred times the size, in another unit, would count as much
    squares = {}
    for factor in (1.0, 100.0):
        vehicle, run = beam(), with_rates(ride(1), lambda w, f=factor: f * w)
        vehicle = dataclasses.replace(
            vehicle, sensors={**vehicle.sensors, IMU: dataclasses.replace(vehicle.sensors[IMU], gyro_noise_std=factor * GYRO_STD)}
        )
        data = data_of(vehicle, run)
        data = data.with_plant(dataclasses.replace(data.plant, out_rate=factor * data.plant.out_rate))
        squares[factor] = block_squares(predict(data, _file_model(data)))
    for one, other in zip(*squares.values()):
        np.testing.assert_allclose(one, other, rtol=1e-6)
    plain = data_of(beam(), without_rates(ride(1)))
    alone = block_squares(predict(plain, _file_model(plain)))
    # beside one channel of accelerations one of rates adds as much as that at most
    assert np.all(alone[1] < squares[1.0][1])
    assert squares[1.0][1].sum() <= 2.1 * alone[1].sum()


def _file_model(data: RunData) -> Model:
    return Model(ModelState(*file_parameters(data.plant)), (), np.zeros(0))


@pytest.mark.slow
def test_a_turned_imu_is_named_once_with_its_angle():
    angle = np.radians(6.0)
    vehicle, run, other = cab((angle, 0.0, 0.0))
    answer = diagnose(vehicle, run, [other])
    assert [(c.id, c.location, c.axis) for c in answer.causes] == [("sensor_misalignment", "cab_rear_right", "roll")]
    (found,) = answer.causes[0].parameters
    assert abs(found.value - 6.0) < 3.0 * max(found.std, 0.02)
    rates = [i for i, name in enumerate(answer.evidence.channel_names) if "rate" in name]
    base, extended, floor = answer.evidence.channel_nrmse[rates].T
    assert np.all(extended < 1.1 * floor)
    assert np.any(base > 1.5 * floor)
