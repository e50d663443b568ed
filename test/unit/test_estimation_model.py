# Copyright 2026 ride_estimation contributors
"""The stochastic model: transforms against simulation, a score of mean zero at the truth, coverage from both sides."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import yaml
from scipy import linalg, signal
from scipy.spatial.transform import Rotation
from worlds.adapters import vehicle_of_text
from worlds.cab import _second_derivative, bracket_motion, drive, random_sensors, random_vehicle, true_signal
from worlds.roads import Road
from worlds.vehicle_text import vehicle_yaml

from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.estimation.model import segments
from ride_estimation.estimation.model.bracket_shares import learn_shares
from ride_estimation.estimation.model.dynamics import dynamics
from ride_estimation.estimation.model.joint import JointEstimate
from ride_estimation.estimation.model.plant import Plant
from ride_estimation.estimation.model.second_order import load_of_carried, second_order, slopes_of_laws
from ride_estimation.estimation.model.spectral import Lines, response
from ride_estimation.estimation.model.states import SlowStates
from ride_estimation.sensors.installation import Installation
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.modes import linearise
from ride_estimation.vehicles.vehicle import Vehicle

DT = 0.008


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    rng = np.random.default_rng(5)
    cab = random_vehicle(rng, "air")
    sensors = random_sensors(cab, rng, displacement=(("front_left", "z"),))
    return vehicle_of_text(vehicle_yaml(cab, sensors))


def with_seat(text: str) -> Vehicle:
    """Return a vehicle whose cab carries a seat that moves along x and z and pitches."""
    found = yaml.safe_load(text)
    law = {"kind": "kelvin_voigt"}
    found["bodies"]["seat"] = {
        "mass_kg": {"value": 90.0, "std": 2.0}, "cg_m": [0.1, 0.3, 1.0], "degrees_of_freedom": ["x", "z", "pitch"],
        "inertia_kg_m2": {"ixx": 4.0, "iyy": 4.0, "izz": 3.0},
    }  # fmt: skip
    found["mounts"]["suspension"] = {
        "position_m": [0.1, 0.3, 0.5], "body": "seat", "base": "cab",
        "axes": {
            "x": {**law, "stiffness_n_per_m": 6e4, "damping_n_s_per_m": 400.0},
            "z": {**law, "stiffness_n_per_m": 6e3, "damping_n_s_per_m": {"value": 400.0, "relative_std": 0.1}},
            "pitch": {**law, "stiffness_n_m_per_rad": 6e3, "damping_n_m_s_per_rad": 40.0},
        },
    }  # fmt: skip
    return vehicle_of_text(yaml.safe_dump(found))


def shaped(rng: np.random.Generator, count: int, low: float, high: float) -> np.ndarray:
    """Return noise of rms one between two frequencies [Hz]."""
    sos = signal.butter(2, [low, high], "bandpass", fs=1.0 / DT, output="sos")
    x = signal.sosfiltfilt(sos, rng.normal(size=count))
    return np.asarray(x / x.std())


def linear_readings(vehicle: Vehicle, seed: int, duration: float, size: float) -> tuple[Plant, np.ndarray, np.ndarray]:
    """Return plant, readings and true slow states of :func:`linear_run`."""
    return linear_run(vehicle, seed, duration, size)[:3]


def linear_run(
    vehicle: Vehicle, seed: int, duration: float, size: float, height: float | None = None
) -> tuple[Plant, np.ndarray, np.ndarray, np.ndarray]:
    """Return plant, readings of its linear model with errors drawn from the priors, the true slow states, forces of the mounts.

    ``height`` [m]: the base only twists, about an axis so far below its mounts.

    The base moves in bands that the estimate does not know; integrated at eight times the rate. The motion is so small, and
    the noise with it, that second-order kinematics do not count.
    """
    rng = np.random.default_rng(seed)
    quiet = {n: dataclasses.replace(s, noise_std=0.01 * size) for n, s in vehicle.sensors.items()}
    plant = Plant(dataclasses.replace(vehicle, sensors=quiet))
    slow = plant.slow
    products = np.random.default_rng([seed, 1]).normal(size=3)
    theta = slow.mean + slow.std * np.insert(rng.normal(size=len(slow.std) - 3), slow.inertia_products.start, products)
    theta[slow.mean_accel] = slow.mean[slow.mean_accel]
    delays = [slow.sensors[s.name]["delay"].start for s in plant.sensors]
    theta[delays] = 0.0
    joint = JointEstimate(plant, [np.zeros((200, sum(3 if s.kind != "displacement" else 1 for s in plant.sensors)))], DT)
    model = joint.model(theta)
    fine, count = 8, round((duration + 2.0) / DT)
    inputs = plant.states.size - plant.states.motion.stop
    bands = [(0.4, 12.0)] * 6 + [(1.2, 20.0)] * (inputs - 6)
    drive = np.column_stack([shaped(rng, count, *band) for band in bands]) * size
    drive[:, 6:] *= 0.2
    if height is not None:
        moves = np.zeros((len(plant.mounts), 3))
        moves[:, 1:] = [(-height * m.position[0], m.position[0] * m.position[1]) for m in plant.mounts]
        # a frame returns: acceleration of a twist that begins at rest
        twist = shaped(rng, count, 0.4, 6.0) * np.minimum(np.arange(count) * DT, 1.0) ** 3
        drive[:, 6:] = np.outer(1e-2 * size * np.gradient(np.gradient(twist, DT), DT), moves.ravel() @ plant.patterns)
    smooth = signal.resample_poly(drive, fine, 1, axis=0)
    A, states = model.dynamics.A, plant.states.motion.stop
    step = linalg.expm(DT / fine * np.block([[A], [np.zeros((inputs, states + inputs))]]))
    x, out = np.zeros(states), np.empty((count, states))
    for k, w in enumerate(0.5 * (smooth[:-1] + smooth[1:])):
        if k % fine == 0:
            out[k // fine] = x
        x = step[:states, :states] @ x + step[:states, states:] @ w
    v = np.hstack([out, drive])[round(1.0 / DT) : round((1.0 + duration) / DT)]
    readings = v @ model.rows.T + model.constant
    white = np.repeat([s.noise_std for s in plant.sensors], [3 if s.kind != "displacement" else 1 for s in plant.sensors])
    force = v @ model.dynamics.force.T + model.still
    return plant, readings + white * rng.normal(size=readings.shape), theta, force.reshape(len(v), -1, 3)


def test_transforms_of_a_segment_obey_the_response_whatever_its_ends() -> None:
    rng = np.random.default_rng(1)
    A = np.array([[0.0, 1.0, 0.0], [-90.0, -1.0, 1.0]])
    fine, count = 40, 1000
    w = shaped(rng, count * fine, 0.01, 0.2)
    step = linalg.expm(DT / fine * np.vstack([A, np.zeros((1, 3))]))
    x, states = np.array([0.3, -1.0]), []
    for value in w:
        states.append(x)
        x = step[:2, :2] @ x + step[:2, 2] * value
    lines = Lines.of(count, DT)
    found = response(A, lines, slice(1, 2), 2)
    taken = np.array(states)[::fine]
    ends = (taken[0] - x) / np.sqrt(count)
    exact = lines.transform(taken)
    W = lines.transform(w[::fine, None])
    rebuilt = np.matmul(found.drive, W[:, :, None])[:, :, 0] + found.jump @ ends
    assert np.abs(rebuilt - exact).max() < 2e-3 * np.abs(exact).max()
    without = np.matmul(found.drive, W[:, :, None])[:, :, 0]
    assert np.abs(without - exact).max() > 0.1 * np.abs(exact).max()
    np.testing.assert_allclose(found.accel[:, :, 0], found.drive[:, :, 0])


def test_a_carried_body_moves_as_in_the_equations_of_the_whole_vehicle() -> None:
    rng = np.random.default_rng(5)
    cab = random_vehicle(rng, "air")
    vehicle = with_seat(vehicle_yaml(cab, random_sensors(cab, rng)))
    plant = Plant(vehicle)
    still = slice(0, plant.states.carried_rate.stop)
    own = np.linalg.eigvals(dynamics(plant, plant.constants(plant.slow.mean)).A[still, still])
    whole, _ = linearise(assemble(vehicle), 2.0, 5e-3).state_space()
    modes = [np.sort_complex(x[x.imag > 0.0]) for x in (own, np.linalg.eigvals(whole))]
    # forces at rest are shared out between mounts in another way, which the slowest mode feels
    assert np.abs(modes[0] / modes[1] - 1.0).max() < 0.06
    assert np.median(np.abs(modes[0] / modes[1] - 1.0)) < 0.002
    heavier = np.where(np.arange(len(plant.slow.mean)) == plant.slow.log_carried.start, 0.2, plant.slow.mean)
    weights = [plant.constants(theta).static.sum() for theta in (plant.slow.mean, heavier)]
    assert weights[1] - weights[0] == pytest.approx(90.0 * vehicle.gravity * np.expm1(0.2))


def test_the_basis_of_the_deformation_does_not_hang_on_the_processor(vehicle: Vehicle) -> None:
    """Eigenvectors of equal eigenvalues are arbitrary; spectra are per pattern and have to be those of the same patterns."""
    patterns, points = Plant(vehicle).patterns, Plant(vehicle).points(vehicle.bodies["cab"].cg)
    np.testing.assert_allclose(patterns.T @ patterns, np.eye(6), atol=1e-12)
    np.testing.assert_allclose(points.T @ patterns, 0.0, atol=1e-12)
    first = (np.eye(12) - points @ np.linalg.pinv(points))[:, 2]
    np.testing.assert_allclose(patterns[:, 0], first / np.linalg.norm(first), atol=1e-12)


def test_lines_end_where_the_low_pass_of_the_readings_begins() -> None:
    for rate in (50.0, 125.0):
        assert Lines.of(1000, 1.0 / rate).frequency[-1] == pytest.approx(0.36 * rate, abs=0.2)


def test_transform_and_back_are_inverse_in_the_band() -> None:
    lines = Lines.of(500, DT)
    t = np.arange(500) * DT
    x = np.column_stack([np.sin(2 * np.pi * 5.0 * t), np.cos(2 * np.pi * 2.5 * t)])
    np.testing.assert_allclose(lines.back(lines.transform(x)), x, atol=1e-9)


def test_a_segment_that_ends_unlike_it_begins_does_not_ring() -> None:
    lines = Lines.of(500, DT)
    time = np.arange(lines.count) * DT
    values = np.stack([0.01 * time, 0.02 * time + 0.003 * np.sin(2.0 * np.pi * 6.0 * time)], axis=1)
    spectrum, jump = lines.transform(values), -np.array([0.01, 0.02]) * lines.count * DT / np.sqrt(lines.count)
    wanted = values - values.mean(axis=0)
    assert np.abs(lines.back(spectrum) - wanted)[[0, -1]].max() > 0.005
    np.testing.assert_allclose(lines.back(spectrum) + lines.leap(jump), wanted, atol=1e-12)


def test_what_ends_abruptly_does_not_fill_quiet_lines() -> None:
    lines = Lines.of(2500, DT)
    t = np.arange(2500) * DT
    raw = lines.transform(np.sin(2.0 * np.pi * 8.027 * t)[:, None])
    power = segments.input_power(lines, raw, np.full((len(raw), 1), 1e-9))
    assert power[lines.frequency < 2.0].max() < 1e-5 * power.max()
    white = np.random.default_rng(1).normal(size=(2500, 1))
    whole, tapered = lines.transform(white), lines.taper(lines.transform(white))
    assert np.mean(np.abs(tapered) ** 2) == pytest.approx(np.mean(np.abs(whole) ** 2), rel=0.1)


@pytest.fixture(scope="module")
def linear(vehicle: Vehicle) -> tuple[Plant, np.ndarray, np.ndarray]:
    small = Installation(bias=1e-3, gain=1e-3, misalignment=1e-3, position=2e-3, delay=0.0)
    quiet = {n: dataclasses.replace(s, installation=small) for n, s in vehicle.sensors.items() if s.kind != "displacement"}
    return linear_readings(dataclasses.replace(vehicle, sensors=quiet), 3, 30.0, 0.002)


def at_truth(linear: tuple[Plant, np.ndarray, np.ndarray]) -> tuple[JointEstimate, np.ndarray]:
    """Return the estimate at the true values and the score of every free slow state over its standard deviation, no priors."""
    plant, readings, theta = linear
    joint = JointEstimate(plant, [readings], DT)
    joint.theta = theta.copy()
    information, gradient, _ = joint.normal_equations(joint.model())
    slow = plant.slow
    prior = slow.std[slow.free] ** -2.0
    gradient = gradient - (theta - slow.mean)[slow.free] * prior
    inverse = np.linalg.inv(information)
    spread = inverse @ (information - np.diag(prior)) @ inverse
    return joint, inverse @ gradient / np.sqrt(np.diag(spread))


def test_the_score_at_the_truth_has_mean_zero_and_its_stated_size(linear: tuple[Plant, np.ndarray, np.ndarray]) -> None:
    joint, score = at_truth(linear)
    assert joint.nis == pytest.approx(1.0, abs=0.03)
    assert 0.8 < np.sqrt(np.mean(score**2)) < 1.25
    assert abs(score.mean()) < 0.4


def test_the_gradient_is_the_derivative_of_the_cost(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where inputs are strong their shrinking vanishes and the score is the gradient at given noise and prior of the ends."""
    plant, readings, theta = linear_readings(vehicle, 4, 20.0, 1e-4)
    joint = JointEstimate(plant, [readings], DT)
    joint.theta = theta.copy()
    segment, offset = joint.segments[0], joint._offset
    white = offset(joint.model(), segment)[0]
    p = segments.project(joint.model(), segment)
    ends = segments.ends_std(plant, segments._inverted(p.basis, p.unroot, p.seen), segment.lines)
    monkeypatch.setattr(segments, "ends_std", lambda *_: ends)
    monkeypatch.setattr(joint, "_offset", lambda model, part: (white, offset(model, part)[1]))
    slow = plant.slow
    body = slow.sensors["cab_front_left"]
    base = slow.sensors["chassis_front_left"]
    _, gradient, _ = joint.normal_equations(joint.model())
    for i in (
        slow.log_stiffness.start + 2, slow.log_damping.start + 2, body["position"].start, body["misalignment"].start + 1,
        base["misalignment"].start + 1, slow.sensors["displacement_front_left_z"]["gain"].start,
    ):  # fmt: skip
        values = []
        h = 1e-3 * slow.std[i]
        for step in (h, -h):
            joint.theta = theta.copy()
            joint.theta[i] += step
            values.append(joint.cost(joint.model()))
        at = int(np.searchsorted(slow.free, i))
        size = np.sqrt(np.abs(gradient[at])) / slow.std[i] + 1.0 / slow.std[i]
        assert gradient[at] == pytest.approx((values[0] - values[1]) / (2 * h), rel=0.05, abs=2.0 * size), i


def test_second_order_of_a_carried_body_is_that_of_a_point_moving_in_a_turning_body() -> None:
    """Newton in fixed axes, differentiated numerically, less what the equations of first order contain."""
    rng = np.random.default_rng(11)
    cab = random_vehicle(rng, "air")
    plant = Plant(with_seat(vehicle_yaml(cab, random_sensors(cab, rng))))
    m, s, time = plant.constants(plant.slow.mean), plant.states, 3e-4 * np.array([-1.0, 0.0, 1.0])
    d, up = dynamics(plant, m), np.array([0.0, 0.0, plant.gravity])
    mass, arm, moved = (part[0] for part in (m.carried.masses, m.carried.arms, m.carried.moved))
    v, rate = 1e-4 * rng.normal(size=(1, s.size)), 3e-3 * rng.normal(size=(1, 3))
    accel, coordinates = v[0] @ d.accel.T, (v[0, s.carried], v[0, s.carried_rate], v[0] @ d.A[s.carried_rate].T)
    away, speed, pushed = (moved @ x for x in coordinates)
    place = []
    for t in time:
        turn = Rotation.from_rotvec(rate[0] * t + 0.5 * accel[3:] * t**2)
        place.append(0.5 * accel[:3] * t**2 + turn.apply(arm + away + speed * t + 0.5 * pushed * t**2))
    whole = (place[0] - 2.0 * place[1] + place[2]) / time[2] ** 2
    first = accel[:3] + np.cross(accel[3:], arm) + pushed
    linear = np.cross(arm, first + up) + np.cross(away, up)
    force, moment = -mass * (whole - first), -mass * (np.cross(arm + away, whole + up) - linear)
    found = load_of_carried(plant, m, d, v, rate)[0]
    expected = np.concatenate([force, moment, moved.T @ force])
    assert np.abs(expected[:6]).min() > 0.0
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


def test_where_a_base_deforms_too_slowly_to_show_it_the_share_of_twist_is_that_of_the_octave_above(vehicle: Vehicle) -> None:
    plant, lines = Plant(vehicle), Lines.of(3000, DT)
    slow = lines.frequency < segments.DEFORMS_HZ
    octave = ~slow & (lines.frequency < 2.0 * segments.DEFORMS_HZ)
    power = np.random.default_rng(4).uniform(0.5, 1.5, (len(slow), plant.patterns.shape[1]))
    twist = plant.twist / np.linalg.norm(plant.twist)
    power += 5.0 * lines.frequency[:, None] * twist**2
    share = segments._twisting(plant, lines, power)
    np.testing.assert_allclose(share[slow], share[octave].mean())
    assert share[octave].mean() > 0.1
    power[slow] *= 1e9 * np.arange(1, slow.sum() + 1)[:, None] ** np.arange(power.shape[1])
    np.testing.assert_allclose(segments._twisting(plant, lines, power), share)


def test_slopes_of_the_second_order_are_its_derivative(vehicle: Vehicle) -> None:
    plant = Plant(vehicle)
    slow, rng = plant.slow, np.random.default_rng(3)
    v = rng.normal(size=(7, plant.states.size)) * 0.01
    base_rate = rng.normal(size=(7, 3)) * 0.1
    m = plant.constants(slow.mean)

    def accel(law: str, place: int, step: float) -> np.ndarray:
        values = getattr(m, law).copy()
        values[place] *= np.exp(step)
        other = dataclasses.replace(m, **{law: values})
        return second_order(plant, other, dynamics(plant, other), slow.mean, v, base_rate).accel

    found = slopes_of_laws(plant, m, dynamics(plant, m), v)
    for place in range(12):
        for law, column in (("stiffness", place), ("damping", 12 + place)):
            slope = (accel(law, place, 1e-3) - accel(law, place, -1e-3)) / 2e-3
            np.testing.assert_allclose(found[:, :, column], slope, atol=1e-5 * np.abs(found).max())


def test_exact_states_and_second_order_are_what_ideal_sensors_read() -> None:
    """A cab on a rigid base that rolls and pitches by a degree: what the linear model leaves of the readings is explained."""
    rng = np.random.default_rng(9506)
    cab = random_vehicle(rng, "air")
    sensors = random_sensors(cab, rng)
    run = drive(cab, dataclasses.replace(Road.random(rng), follow=(0.0, 0.0), twist=0.0, local=0.0), 12.0, 9506)
    plant = Plant(vehicle_of_text(vehicle_yaml(cab, sensors)))
    slow, states, theta = plant.slow, plant.states, plant.slow.mean.copy()
    theta[slow.log_stiffness], theta[slow.log_damping] = np.log(cab.stiffness.ravel()), np.log(cab.damping.ravel())
    model = segments.Model.of(plant, theta)
    place, attitude, _ = (x[:, 0] for x in bracket_motion(run.base, np.zeros((1, 3))))
    moved = np.einsum("nji,nj->ni", attitude, run.state[:, :3] - place) - cab.cg
    turned = Rotation.from_matrix(np.einsum("nji,njk->nik", attitude, run.rotation)).as_rotvec()
    v = np.zeros((len(run.time), states.size))
    v[:, states.relative] = np.hstack([moved, turned])
    v[:, states.relative_rate] = np.gradient(v[:, states.relative], run.step, axis=0)
    base_rate = run.angular_rate - v[:, states.relative_rate][:, 3:]
    first, relative = v @ model.dynamics.A[states.relative_rate].T, _second_derivative(v[:, states.relative], run.step)
    for _ in range(2):  # what the base does is what moves the body as it moves
        second = second_order(plant, model.constants, model.dynamics, theta, v, base_rate)
        v[:, states.base_accel] = first + second.accel - relative
    linear = v @ model.rows.T + model.constant
    whole = linear + second.readings + second.accel @ model.direct.T
    brackets, inside = bracket_motion(run.base, cab.mounts), slice(2000, -2000)
    true = np.hstack([true_signal(run, sensor, brackets) for sensor in sensors])
    left, missing = (np.sqrt(np.mean((x - true)[inside] ** 2, axis=0)).reshape(-1, 3) for x in (whole, linear))
    assert np.all(np.sum(missing[:, [0, 2]], axis=1) > 0.02)
    np.testing.assert_array_less(left.max(axis=0), 0.02 * missing.max(axis=0))


def test_rates_of_a_segment_that_ends_unlike_it_begins_are_those_of_the_motion() -> None:
    time = DT * np.arange(1700)
    # half a period over: at the end the rate is the opposite of that at the beginning
    angle = 2.0 * np.pi * (np.array([12.5, 19.5, 36.5]) * time[:, None] / (DT * len(time)))
    rate, lines = np.cos(angle), Lines.of(len(time), DT)
    found = lines.back(segments.rates(lines, lines.transform(np.gradient(rate, DT, axis=0))))
    inside = slice(10, -10)
    assert np.all(np.std((found - rate)[inside], axis=0) < 0.15 * np.std(rate, axis=0))


def test_a_faulty_sensor_reads_the_second_order_as_it_reads_the_first(vehicle: Vehicle) -> None:
    rng, plant = np.random.default_rng(8), Plant(vehicle)
    slow, count = plant.slow, 50
    v, base_rate = 0.01 * rng.normal(size=(count, plant.states.size)), 0.1 * rng.normal(size=(count, 3))
    gain, turn = np.array([-0.3, 0.1, 0.2]), np.array([0.3, -0.1, 0.2])
    bent = slow.mean.copy()
    for sensor in plant.sensors[:2] + plant.base_sensors[:2]:
        bent[slow.sensors[sensor.name]["gain"]], bent[slow.sensors[sensor.name]["misalignment"]] = gain, turn
    models = [segments.Model.of(plant, theta) for theta in (slow.mean, bent)]
    right, wrong = (second_order(plant, m.constants, m.dynamics, m.theta, v, base_rate).readings for m in models)
    rotation = Rotation.from_rotvec(turn).as_matrix()
    for n, sensor in enumerate(plant.sensors):
        at = slice(3 * n, 3 * n + 3)
        if sensor in plant.transducers or not np.any(bent[slow.sensors[sensor.name]["gain"]]):
            np.testing.assert_allclose(wrong[:, at], right[:, at], rtol=1e-9)
            continue
        np.testing.assert_allclose(wrong[:, at], (1.0 + gain) * (right[:, at] @ rotation), rtol=1e-9)
        for name in ("direct", "lean"):
            before, after = (getattr(m, name)[at] for m in models)
            np.testing.assert_allclose(after, (1.0 + gain)[:, None] * (rotation.T @ before), rtol=1e-9, atol=1e-12)


def test_shares_of_bracket_tilt_are_learned_from_a_frame_that_twists_about_another_height(vehicle: Vehicle) -> None:
    learned = []
    for seed in range(6, 12):
        plant, readings, theta, _ = linear_run(vehicle, seed, 30.0, 1e-2, height=0.3)
        joint = JointEstimate(plant, [readings], DT)
        slow, shares = plant.slow, plant.slow.tilt_shares
        # the shares as uncertain as before the run, all else known
        joint.theta, std = theta.copy(), 1e-6 * slow.std
        joint.theta[shares], std[shares] = slow.mean[shares], slow.std[shares]
        joint.covariance = np.diag(std**2)
        joint.renew()
        learn_shares(joint)
        found = np.sqrt(np.diag(joint.covariance)[shares])
        assert np.all(found[::2] < 0.7 * slow.std[shares][::2])
        assert np.all(found < slow.std[shares])
        learned.append((theta[shares] - joint.theta[shares]) / found)
    assert 0.5 < np.sqrt(np.mean(np.square(learned))) < 1.5


def test_shares_that_cannot_be_computed_are_refused(linear: tuple[Plant, np.ndarray, np.ndarray]) -> None:
    plant, readings, _ = linear
    joint = JointEstimate(plant, [readings], DT)
    joint.covariance = np.zeros_like(joint.covariance)
    with pytest.raises(InputDataError, match="tilt of the brackets"):
        learn_shares(joint)


def test_whitening_leaves_unit_covariance_where_brackets_lean_by_their_own_motion() -> None:
    rng = np.random.default_rng(3)
    std, lean, wandering = rng.uniform(0.5, 2.0, (2, 6)), rng.normal(size=(6, 4)), np.array([0.0, 0.7])
    white = segments.Whitening.of(std, wandering, lean)
    for line in range(2):
        covariance = np.diag(std[line] ** 2) + wandering[line] * lean @ lean.T
        root = np.zeros((2, 6, 6), dtype=complex)
        root[line] = np.linalg.cholesky(covariance)
        found = white.whiten(root)[line]
        np.testing.assert_allclose(found @ found.conj().T, np.eye(6), atol=1e-12)
    rows, values = rng.normal(size=(2, 3, 6)) + 0j, rng.normal(size=(2, 6, 1)) + 0j
    np.testing.assert_allclose(white.transform(rows) @ values, rows @ white.whiten(values), atol=1e-12)


def test_own_motion_of_the_mounts_is_measured_and_counts_as_noise(linear: tuple[Plant, np.ndarray, np.ndarray]) -> None:
    plant, readings, theta = linear
    joint = JointEstimate(plant, [readings], DT)
    joint.theta = theta.copy()
    joint.renew()
    segment = joint.segments[0]
    p = segments.project(joint.model(), segment)
    raw = np.linalg.solve(p.root, np.matmul(p.basis.conj().transpose(0, 2, 1), p.seen[:, :, None]))[:, 6:, 0]
    moved = np.abs(raw / segment.lines.laplace[:, None] ** 2) ** 2
    moves = (segment.lines.frequency > 1.0) & (segment.lines.frequency < 10.0)
    assert 0.2 < segment.wandering[moves].sum() / np.median(moved[moves].sum(axis=0)) < 2.0


def test_inputs_that_are_noise_are_shrunk_to_nothing(linear: tuple[Plant, np.ndarray, np.ndarray]) -> None:
    plant, readings, theta = linear
    rng = np.random.default_rng(8)
    noise = np.repeat([s.noise_std for s in plant.sensors], 3)
    joint = JointEstimate(plant, [noise * rng.normal(size=readings.shape)], DT)
    joint.theta = theta.copy()
    segment, model = joint.segments[0], joint.model()
    p = segments.project(model, segment)
    raw = np.linalg.solve(p.root, np.matmul(p.basis.conj().transpose(0, 2, 1), p.seen[:, :, None]))[:, :, 0]
    states, _ = segments.states_of(model, segment, p)
    fast = segment.lines.frequency > 2.0
    assert np.linalg.norm(states[fast][:, plant.states.drive]) < 0.4 * np.linalg.norm(raw[fast])


def test_a_gain_that_all_sensors_share_moves_nothing(linear: tuple[Plant, np.ndarray, np.ndarray]) -> None:
    """Without gravity the readings of a gain of all sensors are those of a livelier drive."""
    plant, readings, theta = linear
    joint = JointEstimate(plant, [readings], DT)
    joint.theta = theta.copy()
    information, _, _ = joint.normal_equations(joint.model())
    slow = plant.slow
    together, alone = np.zeros(len(theta)), 0.0
    gains = [slow.sensors[sensor.name]["gain"] for sensor in plant.sensors]
    for gain in gains:
        together[gain] = 1.0
        one = np.zeros(len(theta))
        one[gain.start] = 1.0
        alone += learned(slow, information, one)
    seen = (joint.model(theta + 1e-6 * together).constant - joint.model(theta).constant) / 1e-6
    for sensor, part in zip(plant.sensors, seen.reshape(-1, 3)):
        together[slow.sensors[sensor.name]["bias"]] = -part
    assert learned(slow, information, together) < 0.01 * alone


def test_a_delay_of_all_sensors_is_a_shift_of_time(vehicle: Vehicle) -> None:
    plant, readings, theta = linear_readings(vehicle, 5, 10.0, 0.002)
    joint = JointEstimate(plant, [readings], DT)
    joint.theta = theta.copy()
    information, _, _ = joint.normal_equations(joint.model())
    slow = plant.slow
    delays = [slow.sensors[s.name]["delay"].start for s in plant.sensors]
    together, one = np.zeros((2, len(theta)))
    together[delays], one[delays[0]] = 1.0, 1.0
    assert abs(learned(slow, information, together)) < 1e-6 * learned(slow, information, one)


def learned(slow: SlowStates, information: np.ndarray, direction: np.ndarray) -> float:
    """Return what a run tells of a direction of the slow states beyond the prior."""
    free = direction[slow.free]
    return float(free @ information @ free - np.sum((free / slow.std[slow.free]) ** 2))


def test_a_vehicle_the_model_does_not_describe_is_refused_in_one_line(vehicle: Vehicle) -> None:
    sensors = {n: s for n, s in vehicle.sensors.items() if n not in ("chassis_front_left", "cab_front_left", "cab_front_right")}
    with pytest.raises(ConfigurationError, match=r"front_left") as caught:
        Plant(dataclasses.replace(vehicle, sensors=sensors))
    assert "at least 3" in str(caught.value)
