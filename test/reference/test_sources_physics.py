# Copyright 2026 ride_estimation contributors
"""Physics the documents leave out: gravity in forces, faults that cannot be placed, mass by least squares, warp forces."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy import optimize, signal, stats
from worlds.quarter_car import QuarterCar, drive_quarter_car, measure_quarter_car, road_height
from worlds.roads import Road

from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.maxwell import Maxwell
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator
from ride_estimation.estimation.parameters.rls import RecursiveLeastSquares
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.integration import acceleration_to_displacement, acceleration_to_velocity, high_pass, integrate
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.simulation.simulate import simulate
from ride_estimation.vehicles.assembly import assemble

TRUCK_CAB = Path(__file__).parents[2] / "config" / "vehicles" / "truck_cab.yaml"
CORNERS = {"FL": (0.8, 0.5, -0.7), "FR": (0.8, -0.5, -0.7), "RL": (-0.8, 0.5, -0.7), "RR": (-0.8, -0.5, -0.7)}
GRAVITY = 9.80665


def rough_bases(mounts, seconds=4.0, rate=200.0, scale=8e-3, seed=5):
    """Return independent smooth motion of every mount base, mostly vertical."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    lines = rng.uniform(0.7, 8.0, 12)
    wave = np.sin(2 * np.pi * lines * t[:, None] + rng.uniform(0, 6.28, 12)) * (1 - np.exp(-4 * t * t))[:, None] / np.sqrt(lines)
    mix = rng.standard_normal((12, mounts, 3)) * np.array([0.2, 0.2, 1.0])
    return BaseMotion.from_displacement(scale * np.einsum("nk,kma->nma", wave, mix), rate)


def test_sum_of_mount_forces_is_mass_times_specific_force():
    """4.1 (i): an accelerometer at the CG reads what the mounts carry, weight included; finite rotations."""
    vehicle = load_vehicle(TRUCK_CAB)
    body = vehicle.bodies["cab"]
    probe = Sensor("probe", "accelerometer", "/probe", "cab", position=body.cg)
    vehicle = dataclasses.replace(vehicle, sensors={**vehicle.sensors, "probe": probe})
    response = simulate(assemble(vehicle), rough_bases(4), full_rotation=True)
    felt = body.mass.value * response.specific_force("probe")
    total = response.mount_force().sum(axis=1)
    np.testing.assert_allclose(felt, total, atol=1e-6 * body.mass.value * GRAVITY)
    # and a mean is no gravity: 4.1 (ii), the de-meaned reading differs from the acceleration as the cab rolls and pitches
    lateral = response.specific_force("probe")[:, 1]
    true = response.cg_motion("cab")[:, 1]
    assert np.std(lateral - lateral.mean() - true) > 0.05 * np.std(true)


def parity(change):
    """Return the residual RMS per sensor for 20 s of rigid motion with a fault put into the readings by ``change``.

    ``change(name, values, at)`` returns the readings of one sensor; ``at(delay)`` are those of some seconds ago.
    """
    rng = np.random.default_rng(8)
    t = np.arange(4000) / 200.0
    lines = rng.uniform(0.8, 8.0, 10)
    phase = rng.uniform(0, 6.28, 10)

    def motion(delay):
        wave = np.sin(2 * np.pi * lines * (t - delay)[:, None] + phase)
        mix = np.random.default_rng(9).standard_normal((10, 6)) * np.array([0.2, 0.3, 0.6, 0.5, 0.6, 0.2])
        return wave @ mix

    readings = {}
    for name, place in CORNERS.items():
        def at(delay, place=place):
            late = motion(delay)
            return late[:, :3] + np.cross(late[:, 3:], np.array(place)) + np.array([0.0, 0.0, GRAVITY])

        readings[name] = change(name, at(0.0), at) + 0.02 * rng.standard_normal((4000, 3))
    sensors = [Sensor(n, "accelerometer", f"/{n}", "cab", position=np.array(p), noise_std=0.02) for n, p in CORNERS.items()]
    estimator = CgMotionEstimator(sensors, np.zeros(3), np.ones(6, dtype=bool), GRAVITY)
    samples = np.hstack(list(readings.values()))
    block = estimator.observe(samples, np.zeros((4000, 0)), np.ones((4000, 4), dtype=bool), 0.005)
    residual = samples - estimator.predict(block.motion, block.rate)
    rms = np.sqrt(np.mean(residual.reshape(-1, 4, 3) ** 2, axis=(0, 2)))
    return dict(zip(CORNERS, rms)), estimator.residual_test()


def vertical_gain(name, values, at):
    return values * np.array([1.0, 1.0, 1.03 if name == "FR" else 1.0])


def vertical_delay(name, values, at):
    return np.column_stack([values[:, :2], at(0.005)[:, 2] if name == "FR" else values[:, 2]])


@pytest.mark.parametrize("fault", [vertical_gain, vertical_delay])
def test_vertical_faults_look_alike_on_all_four_sensors(fault):
    """4.4: of six spare equations one is vertical, direction [1, -1, -1, 1]: its size tells that, never where.

    What it follows in time, the reading of FR and no other, may tell where: the culprit is named or among those named.
    """
    clean, _ = parity(lambda name, values, at: values)
    found, judged = parity(fault)
    assert min(found.values()) > 1.15 * max(clean.values())
    assert max(found.values()) < 1.05 * min(found.values())
    assert not judged.passed
    assert "FR" in {judged.sensor, *judged.rivals}


def test_a_sensor_that_is_late_in_all_axes_is_placed():
    found, judged = parity(lambda name, values, at: at(0.005) if name == "FR" else values)
    assert max(found, key=found.get) == "FR"
    assert judged.sensor == "FR"


def tilted(degrees):
    s, c = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    return lambda name, values, at: values @ turn.T if name == "FR" else values


def late(milliseconds):
    return lambda name, values, at: at(1e-3 * milliseconds) if name == "FR" else values


def scaled(*factors):
    return lambda name, values, at: values * np.array(factors) if name == "FR" else values


def swapped(name, values, at):
    return values[:, [1, 0, 2]] if name == "FR" else values


def warped(name, values, at):
    sign = {"FL": 1.0, "FR": -1.0, "RL": -1.0, "RR": 1.0}[name]
    wave = 0.3 * np.sqrt(2.0) * np.sin(2 * np.pi * 3.1 * np.arange(len(values)) / 200.0)
    return values + sign * wave[:, None] * np.array([0.0, 0.0, 1.0])


# FL FR RL RR; None: depends on the motion, which is not stated
FAULTS_4_4 = {
    "tilt 1 deg": (tilted(1.0), (0.048, 0.062, 0.020, 0.020)),
    "tilt 2 deg": (tilted(2.0), (None, 0.121, None, None)),
    "tilt 5 deg": (tilted(5.0), (None, 0.301, None, None)),
    "late 1 ms": (late(1.0), None),
    "late 10 ms": (late(10.0), None),
    "gain 3 %": (scaled(1.03, 1.03, 1.03), (0.049, 0.052, 0.047, 0.048)),
    "x, y swapped": (swapped, None),
    "z sign flipped": (scaled(1.0, 1.0, -1.0), None),
    "warp": (warped, (0.174, 0.174, 0.174, 0.174)),
}


@pytest.mark.parametrize("fault", FAULTS_4_4)
def test_residuals_of_a_fault_are_its_projection_and_the_figures_of_the_table(fault):
    """4.4: own projector on the spare equations; figures of the table where gravity makes them, not its unstated motion."""
    change, printed = FAULTS_4_4[fault]
    seen = {}

    def noted(name, values, at):
        seen[name] = change(name, values, at) - values
        return values + seen[name]

    found, _ = parity(noted)
    rows = np.vstack([np.hstack([np.eye(3), np.cross(np.array(p), np.eye(3)).T]) for p in CORNERS.values()])
    spare = np.eye(12) - rows @ np.linalg.pinv(rows)
    left = (np.hstack([seen[n] for n in CORNERS]) @ spare.T).reshape(-1, 4, 3)
    noise = 0.02**2 * np.diag(spare).reshape(4, 3).mean(axis=1)
    wanted = np.sqrt(np.mean(left**2, axis=(0, 2)) + noise)
    if fault == "z sign flipped":
        # twice gravity on one axis also spins the rates the centripetal terms need, across the diagonal of
        # the fault: more than the projection, and corners that lie opposite each other alike
        assert min(found.values()) > 2.8
        assert found["FL"] == pytest.approx(found["RR"], rel=0.03)
        assert found["FR"] == pytest.approx(found["RL"], rel=0.03)
        return
    # 4000 samples of noise; a constant fault leans on the rates too, a tenth of it
    np.testing.assert_allclose(list(found.values()), wanted, rtol=0.12)
    for value, figure in zip(found.values(), printed or ()):
        assert figure is None or value == pytest.approx(figure, rel=0.15)
    if printed is None:
        assert max(found, key=found.get) == "FR"


def test_mass_with_known_stiffness_follows_a_load_of_400_kg():
    """4.6: ``-k z = m a_s + c zdot`` recursively, k known, same filters on all; class C at 10 m/s, noise 0.02 m/s^2."""
    rate, step, corner = 200.0, 1e-3, 0.4
    car = QuarterCar(mass_after=(40.0, 2900.0))
    height, slope = road_height(dataclasses.replace(Road(), roughness=256e-6, speed=10.0), 80.0, step, 2)
    data = measure_quarter_car(drive_quarter_car(car, height, slope, step), rate, 2, 0.02)
    body, axle = (data[n][:, 2] - GRAVITY for n in ("body", "axle"))
    z = acceleration_to_displacement(body - axle, rate, corner)
    v = high_pass(acceleration_to_velocity(body - axle, rate, corner), rate, corner)
    a = high_pass(high_pass(body - body.mean(), rate, corner), rate, corner)
    rows, target = np.column_stack([a, v]) / 100.0, -car.stiffness * z / 100.0  # about 100 N of residual
    batch = 200
    estimator = RecursiveLeastSquares(np.array([1800.0, 1e4]), np.array([2000.0, 2e4]), forgetting=0.999**batch)
    history = []
    for k in range(0, len(rows) - batch + 1, batch):
        phi, y = rows[k : k + batch], target[k : k + batch]
        estimator.update(phi.T @ phi, phi.T @ (y - phi @ estimator.theta))
        history.append(estimator.theta[0])
    assert history[37] == pytest.approx(2500.0, rel=0.01)  # kg; noise in the regressors alone costs 0.3 to 0.4 %
    # forgetting no faster than news arrives makes the memory longer than 1 / (1 - lambda): 2 % after 25 s, not after 9 s
    assert history[69] == pytest.approx(2900.0, rel=0.02)
    without = np.linalg.lstsq(np.column_stack([a, v])[4000:7600], -z[4000:7600], rcond=None)[0]
    loaded = np.linalg.lstsq(np.column_stack([a, v])[12000:15600], -z[12000:15600], rcond=None)[0]
    # without k only the ratios m/k and c/k: mass up by 16 % shows in m/k, c/k stays
    assert loaded[0] / without[0] == pytest.approx(1.16, abs=0.01)
    assert loaded[1] / without[1] == pytest.approx(1.0, abs=0.01)


def test_six_equations_leave_six_directions_one_of_them_pure_warp():
    """4.7: rank 6 of 12; corner forces +-1 vertical make no wrench on symmetric corners; splitting by stiffness misses them."""
    vehicle = load_vehicle(TRUCK_CAB)
    geometry = geometry_of(vehicle)
    g = geometry.wrench
    assert np.linalg.matrix_rank(g) == 6
    vertical = g[:, 2::3]
    _, singular, directions = np.linalg.svd(vertical)
    assert singular[3] < 1e-9 * singular[0]
    warp = directions[-1]
    assert np.all(np.sign(warp * warp[0]) == np.array([1, -1, -1, 1]))
    response = simulate(assemble(vehicle), rough_bases(4))
    force = response.mount_force() - response.assembly.static_force
    wrench = force.reshape(len(force), 12) @ g.T
    stiffness = np.diag([vehicle.mounts[m].elements[a].stiffness for m in vehicle.mount_names for a in "xyz"])
    split = (wrench @ np.linalg.inv(g @ stiffness @ g.T) @ g @ stiffness).reshape(force.shape)
    error = np.std(split[:, :, 2] - force[:, :, 2], axis=0) / np.std(force[:, :, 2], axis=0)
    assert np.all(error > 0.2)  # independent bases, half of the motion is warp: unknowable from cab accelerometers
    doubled = wrench @ np.linalg.inv(g @ (2 * stiffness) @ g.T) @ g @ (2 * stiffness)
    np.testing.assert_allclose(doubled.reshape(force.shape), split, rtol=1e-9, atol=1e-6)  # only ratios of stiffness matter


def regressed(noise, corner, seed):
    """Return errors of k/m and of the mass with known k by plain least squares on integrated, high-passed signals."""
    rate, step = 200.0, 1e-3
    car = QuarterCar()
    height, slope = road_height(dataclasses.replace(Road(), roughness=64e-6, speed=5.0), 60.0, step, seed)
    data = measure_quarter_car(drive_quarter_car(car, height, slope, step), rate, seed, noise)
    body, axle = (data[n][:, 2] - GRAVITY for n in ("body", "axle"))
    z = acceleration_to_displacement(body - axle, rate, corner)
    v = high_pass(acceleration_to_velocity(body - axle, rate, corner), rate, corner)
    a = high_pass(high_pass(body - body.mean(), rate, corner), rate, corner)
    inner = slice(1000, -1000)
    ratio = np.linalg.lstsq(np.column_stack([-z, -v])[inner], a[inner], rcond=None)[0][0]
    mass = np.linalg.lstsq(np.column_stack([a, v])[inner], -car.stiffness * z[inner], rcond=None)[0][0]
    return ratio / (car.stiffness / car.sprung) - 1.0, mass / car.sprung - 1.0


def test_noise_in_the_regressors_biases_least_squares_and_a_higher_corner_cures_it():
    """4.8, class B at 5 m/s, with the product's integration, which passes its high-pass twice and so is biased less.

    On this quarter car, seeds 1 to 4: k/m -0.3, -11.5 and -0.2 %; mass with known k -0.9 % at 0.02 m/s^2. Judged on other seeds.
    The figures of the table are those of one zero-phase Butterworth filter: the next tests.
    """
    means = {
        key: np.mean([regressed(*key, seed) for seed in range(11, 15)], axis=0) for key in ((0.02, 0.3), (0.1, 0.3), (0.1, 0.7))
    }
    assert abs(means[0.02, 0.3][0]) < 0.01
    assert -0.25 < means[0.1, 0.3][0] < -0.06
    assert abs(means[0.1, 0.7][0]) < 0.02
    assert abs(means[0.02, 0.3][1]) < 0.02


#: noise [m/s^2], corner [Hz], low-pass [Hz] or None; k/m and mass in percent as table 4.8 prints them, None where it prints none
TABLE_4_8 = {
    (0.02, 0.3, None): (-0.9, None),
    (0.1, 0.3, None): (-22.0, None),
    (0.1, 0.7, None): (-1.7, None),
    (0.02, 0.3, 15.0): (None, -0.4),
    (0.1, 0.3, 15.0): (None, -2.5),
}


def expected_bias(noise, corner, low_pass, rate=200.0):
    """Return the bias [%] of k/m and of the mass with known k: normal equations of transfer functions and white noise.

    Zero-phase Butterworth of fourth order (magnitude squared) on all channels; displacement and rate of the noise are its exact
    integrals.
    """
    car = QuarterCar()
    f = np.arange(1, 1 << 15) * rate / (1 << 16)
    s = 2j * np.pi * f
    ground = 64e-6 * 0.1**2 * 5.0 / f**2 * ((f > 0.2) & (f < 60.0))  # m^2/Hz, class B at 5 m/s
    strut, tyre = car.stiffness + s * car.damping, car.tyre_stiffness + s * car.tyre_damping
    axle = tyre / (car.unsprung * s**2 + strut + tyre - strut**2 / (car.sprung * s**2 + strut))
    body = strut / (car.sprung * s**2 + strut) * axle
    weight = 1.0 / (1.0 + (corner / f) ** 8)
    if low_pass is not None:
        weight = weight / (1.0 + (f / low_pass) ** 4)
    white = 2.0 * noise**2 / rate  # m^2/s^4/Hz of one sensor
    true = {"z": body - axle, "v": s * (body - axle), "a": s**2 * body}
    # columns: noise of the body, noise of the axle
    noisy = {"z": (1 / s**2, -1 / s**2), "v": (1 / s, -1 / s), "a": (np.ones(f.size), np.zeros(f.size))}

    def moment(p, q):
        own = (true[p] * true[q].conj()).real * ground
        own = own + white * sum((x * np.conj(y)).real for x, y in zip(noisy[p], noisy[q]))
        return float(np.sum(own * weight**2))

    def regression(target, first):
        normal = [[moment(first, first), moment(first, "v")], [moment(first, "v"), moment("v", "v")]]
        return -float(np.linalg.solve(normal, [moment(target, first), moment(target, "v")])[0])

    ratio = car.stiffness / car.sprung
    return 100.0 * (regression("a", "z") / ratio - 1.0), 100.0 * (regression("z", "a") * ratio - 1.0)


@pytest.mark.parametrize("case", TABLE_4_8)
def test_figures_of_the_noise_table_follow_from_its_filter(case):
    """4.8: k/m -0.9, -22, -1.7 % full band; mass -0.4 and -2.5 % only if all channels are cut at 15 Hz (full band -0.6, -13 %).

    0.3 % is what trapezoids at 200 Hz and one run of 60 s leave open, a tenth of the large figure its scatter over seeds.
    """
    for found, printed in zip(expected_bias(*case), TABLE_4_8[case]):
        assert printed is None or found == pytest.approx(printed, abs=0.3 + 0.1 * abs(printed)), case
    noise, corner, _ = case
    full = expected_bias(noise, corner, None)[1]
    assert full < (-0.5 if noise < 0.05 else -12.0)


@pytest.mark.slow
@pytest.mark.parametrize("case", TABLE_4_8)
def test_simulated_runs_have_the_bias_of_the_noise_table(case):
    """The same by simulation, seeds 31 to 36; Student's t of six runs at one in 500, and what trapezoids cost (0.2 %)."""
    noise, corner, low_pass = case
    rate, step, car = 200.0, 1e-3, QuarterCar()
    band = signal.butter(4, corner, "high", fs=rate, output="sos")
    smooth = None if low_pass is None else signal.butter(2, low_pass, fs=rate, output="sos")

    def passed(values):
        values = signal.sosfiltfilt(band, values)
        return values if smooth is None else signal.sosfiltfilt(smooth, values)

    found = []
    for seed in range(31, 37):
        height, slope = road_height(dataclasses.replace(Road(), roughness=64e-6, speed=5.0), 60.0, step, seed)
        data = measure_quarter_car(drive_quarter_car(car, height, slope, step), rate, seed, noise)
        body, axle = (data[n][:, 2] - GRAVITY for n in ("body", "axle"))
        rate_raw = signal.detrend(integrate(signal.detrend(body - axle, type="constant"), rate))
        travel = integrate(rate_raw, rate)
        t = np.arange(travel.size) / rate
        travel = travel - np.polyval(np.polyfit(t, travel, 2), t)
        z, v, a = (passed(x)[1000:-1000] for x in (travel, rate_raw, body))
        ratio = np.linalg.lstsq(np.column_stack([-z, -v]), a, rcond=None)[0][0] * car.sprung / car.stiffness
        mass = np.linalg.lstsq(np.column_stack([a, v]), -car.stiffness * z, rcond=None)[0][0] / car.sprung
        found.append((100.0 * (ratio - 1.0), 100.0 * (mass - 1.0)))
    error = np.std(found, axis=0, ddof=1) / np.sqrt(len(found))
    difference = np.mean(found, axis=0) - np.array(expected_bias(*case))
    assert np.all(np.abs(difference) < stats.t.ppf(0.999, 5) * error + 0.2), difference


class Lines:
    """A mass of 2500 kg on a Maxwell mount (k, c, k_M, tau) on base acceleration lines for 60 s at 200 Hz, noise 0.02 m/s^2."""

    MASS, NOISE, SAMPLES = 2500.0, 0.02, 60.0 * 200.0

    def __init__(self, branch, lines):
        self.theta = np.log([3e5, 2e4, branch * 3e5, 0.05])
        self.lines = lines

    def response(self, log_parameters):
        """Return the complex amplitude of the body at each line [m/s^2]."""
        k, c, branch, tau = np.exp(log_parameters)
        element = SumOfElements((KelvinVoigt(k, c), Maxwell(branch, branch * tau)))
        s = 2j * np.pi * np.array(list(self.lines))
        stiff = np.array([element.dynamic_stiffness(abs(w), 1e-3) for w in s])
        return np.array(list(self.lines.values())) * stiff / (stiff + self.MASS * s**2)

    def jacobian(self):
        columns = [
            (self.response(self.theta + 1e-5 * e) - self.response(self.theta - 1e-5 * e)) / 2e-5 for e in np.eye(len(self.theta))
        ]
        sensitivity = np.column_stack(columns)
        return np.vstack([sensitivity.real, sensitivity.imag])

    def information(self):
        return self.jacobian().T @ self.jacobian() * self.SAMPLES / 2.0 / self.NOISE**2

    def bounds(self):
        return np.sqrt(np.diag(np.linalg.inv(self.information())))


def test_one_sinusoid_identifies_two_of_four_parameters_of_a_maxwell_mount_two_identify_all():
    """4.10: rank 2 of 4 at 1.5 Hz, 4 of 4 with 6 Hz more; bounds of 0.06 to 0.24 % with a branch as stiff as the spring."""
    one, two = Lines(1.0, {1.5: 1.0}).information(), Lines(1.0, {1.5: 1.0, 6.0: 2.4})
    assert np.linalg.matrix_rank(one, tol=1e-8 * np.abs(one).max()) == 2
    assert np.linalg.matrix_rank(two.information(), tol=1e-8 * np.abs(two.information()).max()) == 4
    bound = two.bounds()
    assert bound.min() == pytest.approx(0.0006, rel=0.1)
    assert bound.max() == pytest.approx(0.0024, rel=0.1)
    # the size of the lines is not stated: with the branch of 0.3 k used elsewhere no size gives bounds so alike
    spread = [np.ptp(np.log(Lines(0.3, {1.5: 1.0, 6.0: a}).bounds())) for a in np.geomspace(0.1, 100.0, 25)]
    assert np.exp(min(spread)) > 3.0 * 0.24 / 0.06


def test_bounds_of_two_sinusoids_are_the_scatter_of_the_estimates():
    """4.10: two lines are four numbers for four unknowns: solved for 200 draws of noise, scatter 5 % sure."""
    case = Lines(1.0, {1.5: 1.0, 6.0: 2.4})
    truth, rng = case.response(case.theta), np.random.default_rng(17)
    std = case.NOISE * np.sqrt(2.0 / case.SAMPLES)
    found = []
    for _ in range(200):
        measured = truth + std * (rng.standard_normal(2) + 1j * rng.standard_normal(2))

        def misfit(log_parameters, measured=measured):
            error = case.response(log_parameters) - measured
            return np.concatenate([error.real, error.imag]) / std

        found.append(optimize.root(misfit, case.theta).x)
    np.testing.assert_allclose(np.std(found, axis=0), case.bounds(), rtol=0.2)
