# Copyright 2026 ride_estimation contributors
"""What turned base sensors leave uncertain: as large as the error they make in a least-squares split, nothing for z."""

from __future__ import annotations

import dataclasses
import pathlib

import numpy as np

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.parameters.balance_kernel import high_pass_block, integrate_block
from ride_estimation.estimation.sensor_errors.installation_uncertainty import InstallationUncertainty
from ride_estimation.io.vehicle_file import load_vehicle

GEOMETRY = geometry_of(load_vehicle(pathlib.Path(__file__).parents[2] / "config/vehicles/truck_cab.yaml"))
CORNER, DT = 2.0 * np.pi * 0.4, 0.005
K, C = np.full((4, 3), 3e5), np.full((4, 3), 1e4)
PRIOR = np.full((2, 4, 3), 0.3)


def stated(x: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Standard deviations for deflections and rates (K, 4, 3)."""
    uncertainty = InstallationUncertainty(GEOMETRY, CORNER)
    uncertainty.observe(x.reshape(len(x), 12), rate.reshape(len(x), 12), DT)
    return uncertainty.std(K, C, PRIOR)


def motion(rng: np.random.Generator, deformation: float, vertical: float = 5e-3, rigid: float = 3e-4) -> np.ndarray:
    """Deflections (K, 4, 3): lateral rigid motion and deformation, vertical motion that goes along with the deformation."""
    x = np.zeros((20000, 4, 3))
    own = rng.standard_normal((20000, 4))
    x[:, :, 2] = vertical * own
    x[:, :, 1] = rigid * rng.standard_normal((20000, 1)) + deformation * own
    return x


def test_std_covers_the_split_that_turned_sensors_make_wrong():
    rng = np.random.default_rng(1)
    x = motion(rng, 2e-4)
    expected = stated(x, 30.0 * x)[0, :, 1]
    # every mount its own force, all seen through their sum and their first moment: what turned sensors do to the fit
    k = np.array([3e5, 3e5, 2.8e5, 2.8e5])
    errors = []
    for _ in range(200):
        turned = x.copy()
        turned[:, :, 1] += np.radians(0.1) * rng.standard_normal(4) * x[:, :, 2]
        arm = GEOMETRY.arms[:, 0]
        force = np.concatenate([x[:, :, 1] @ k, (x[:, :, 1] * arm) @ k])
        found = np.linalg.lstsq(np.concatenate([turned[:, :, 1], turned[:, :, 1] * arm]), force, rcond=None)[0]
        errors.append(found / k - 1.0)
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    # vertical motion along with the deformation is the worst case, which the stated value is made for
    assert np.all(rms < 2.0 * expected) and np.all(expected < 3.0 * rms)


def test_a_constant_reading_permits_a_larger_misalignment():
    x = motion(np.random.default_rng(7), 2e-4)
    usual = stated(x, 30.0 * x)
    ticks = np.zeros((1000, 4, 3))
    # one of four bases leans by half a degree in y; the others as usual
    one, body = ticks.copy(), ticks.copy()
    one[:, 0, 1] = np.radians(0.5) * 9.80665
    body[:, :, 1] = np.radians(0.5) * 9.80665
    found = []
    for relative in (ticks, one, body):
        uncertainty = InstallationUncertainty(GEOMETRY, CORNER)
        uncertainty.observe(x.reshape(len(x), 12), 30.0 * x.reshape(len(x), 12), DT)
        uncertainty.weigh(relative, np.zeros(len(relative)), DT)
        found.append(uncertainty.std(K, C, PRIOR))
        again = InstallationUncertainty(GEOMETRY, CORNER)
        again.load(uncertainty.save())
        assert np.array_equal(again.std(K, C, PRIOR), found[-1])
    assert np.array_equal(found[0], usual)
    # by hand: less their mean they read 0.375 and three times 0.125 degrees, rms 0.2165, of which a bias of 0.02 m/s^2 and an
    # angle of 0.004 rad leave 0.7936 to the angle, known to 0.1041 degrees: 0.2009 degrees; the mean of four against that of four
    # sensors of the body by sqrt(1/4 + 1/4) of that, more than the 0.125 that gravity shows
    assert np.allclose(found[1][0, :, 1] / usual[0, :, 1], 0.2009 / 0.1041, rtol=0.03)
    # all alike is the body: the sum is off by 0.5 instead of 0.07 degrees, the split as before
    vertical, rigid, deforming = (np.sqrt(np.mean(p**2)) for p in _parts(x))
    common, split = np.radians([0.5, 0.1041]) * vertical / np.array([rigid, deforming])
    assert np.allclose(found[2][0, :, 1], np.hypot(common, split), rtol=0.05)
    assert np.array_equal(found[1][:, :, 0], usual[:, :, 0]) and np.array_equal(found[1][:, :, 2], usual[:, :, 2])


def test_the_angle_between_body_and_bases_is_what_the_sensors_of_both_leave():
    """The sum of the lateral stiffness is as uncertain as sensors of body and bases at random angles make it."""
    rng = np.random.default_rng(3)
    x = motion(rng, 2e-4)
    vertical, rigid, _ = (np.sqrt(np.mean(p**2)) for p in _parts(x))
    angle = np.radians(0.1041)
    leans = angle * (rng.standard_normal((4000, 4)).mean(axis=1) - rng.standard_normal((4000, 4)).mean(axis=1))
    uncertainty = InstallationUncertainty(GEOMETRY, CORNER)
    uncertainty.observe(x.reshape(len(x), 12), 30.0 * x.reshape(len(x), 12), DT)
    own, together = uncertainty._angles()
    assert np.allclose(own, angle, rtol=1e-3) and np.allclose(together, leans.std(), rtol=0.05)
    assert np.all(uncertainty.std(K, C, PRIOR)[0, :, 1] > leans.std() * vertical / rigid)


def _parts(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertical deflections, and what a rigid motion explains of the lateral ones and what not."""
    flat, wrench = x.reshape(len(x), 12), GEOMETRY.wrench
    rigid = flat @ np.linalg.lstsq(wrench.T, np.eye(12), rcond=None)[0].T @ wrench
    return flat[:, 2::3], rigid[:, 1::3], (flat - rigid)[:, 1::3]


def test_before_any_motion_the_split_is_as_uncertain_as_in_the_file():
    uncertainty = InstallationUncertainty(GEOMETRY, CORNER).std(K, C, PRIOR)
    assert np.all(uncertainty[:, :, :2] == PRIOR[:, :, :2]) and np.all(uncertainty[:, :, 2] == 0.0)


def test_less_deformation_leaves_more_uncertainty_and_vertical_parameters_have_none():
    less, more = (stated(x, x) for x in (motion(np.random.default_rng(2), deformation) for deformation in (1e-4, 1e-3)))
    assert np.all(less[:, :, 1] > 2.0 * more[:, :, 1])
    assert np.all(more[:, :, 2] == 0.0) and np.all(np.isfinite(less))


def test_gains_matter_more_where_body_and_base_move_far_more_than_the_mount_gives():
    rng = np.random.default_rng(11)
    x = 1e-3 * rng.standard_normal((2000, 12))
    common, relative = rng.standard_normal(len(x)), np.zeros((len(x), 4, 3))
    relative[:, :, 2] = 0.02 * rng.standard_normal((len(x), 4))
    stds = []
    for lifted in (0.01 * common, common):
        uncertainty = InstallationUncertainty(GEOMETRY, CORNER)
        uncertainty.observe(x, 30.0 * x, DT)
        uncertainty.weigh(relative, lifted, DT)
        stds.append(uncertainty.std(K, C, PRIOR)[0, :, 2])
    # a base that reads g too much makes a deflection of g times its motion: fifty times that of the mount
    np.testing.assert_allclose(stds[1] / stds[0], 50.0, rtol=0.05)


def test_a_split_that_only_noise_shows_is_as_uncertain_as_the_vehicle_file():
    # relative acceleration that is nothing but noise of the base sensors, through the filters of the force balance
    rng = np.random.default_rng(4)
    noise = np.array([s.noise_std for s in GEOMETRY.base_sensors])
    relative = np.repeat(noise, 3) * rng.standard_normal((40000, 12))
    passed, x, v = (np.empty_like(relative) for _ in range(3))
    high_pass_block(relative, CORNER, DT, np.zeros((3, 12)), passed)
    integrate_block(passed, CORNER, DT, np.zeros((9, 12)), x, v)
    uncertainty = InstallationUncertainty(GEOMETRY, CORNER)
    uncertainty.observe(x, v, DT)
    # 200 s at 0.4 Hz and above hold about a hundred independent values of every mount
    assert np.all(uncertainty.std(K, C, PRIOR)[:, :, :2] > 0.8 * 0.3)


def test_chance_correlation_of_vertical_motion_is_worse_for_the_damping_of_stiff_mounts():
    x = motion(np.random.default_rng(5), 1e-4)
    uncertainty = InstallationUncertainty(GEOMETRY, CORNER)
    uncertainty.observe(x.reshape(len(x), 12), 10.0 * x.reshape(len(x), 12), 30.0 / len(x))
    soft, stiff = uncertainty.std(0.0 * K, C, PRIOR), uncertainty.std(100.0 * K, C, PRIOR)
    assert np.all(stiff[1, :, 1] > 3.0 * soft[1, :, 1]) and np.array_equal(stiff[0], soft[0])


def test_a_saved_state_continues_alike():
    uncertainty = InstallationUncertainty(GEOMETRY, CORNER)
    x = motion(np.random.default_rng(3), 1e-4).reshape(-1, 12)
    uncertainty.observe(x, x, DT)
    other = InstallationUncertainty(GEOMETRY, CORNER)
    other.load(uncertainty.save())
    assert np.array_equal(other.std(K, C, PRIOR), uncertainty.std(K, C, PRIOR))


def test_six_mounts_leave_a_vertical_split_that_only_the_deformation_tells():
    vehicle = load_vehicle(pathlib.Path(__file__).parents[2] / "config/vehicles/truck_cab.yaml")
    first = next(iter(vehicle.mounts.values()))
    place = [(x, y) for x in (1.0, 0.0, -1.0) for y in (0.6, -0.6)]
    mounts = {
        f"m{n}": dataclasses.replace(first, name=f"m{n}", position=np.array([x, y, -0.4])) for n, (x, y) in enumerate(place)
    }
    sensors = {n: s for n, s in vehicle.sensors.items() if s.body == "cab"}
    six = geometry_of(dataclasses.replace(vehicle, mounts=mounts, sensors=sensors))
    rng = np.random.default_rng(6)
    heave = 10e-3 * rng.standard_normal((20000, 1))
    # a bending that goes along with the heave is the worst case, which the stated value is made for
    bend = 0.1 * heave * np.array([x * x for x, _ in place])
    x = np.zeros((20000, 6, 3))
    x[:, :, 2] = heave + bend
    uncertainty = InstallationUncertainty(six, CORNER)
    uncertainty.observe(x.reshape(len(x), 18), 30.0 * x.reshape(len(x), 18), DT)
    found = uncertainty.std(np.full((6, 3), 3e5), np.full((6, 3), 1e4), np.full((2, 6, 3), 0.3))[0, :, 2]
    # by hand: y (1, -2, 1) is orthogonal to 1, x, y, x^2, x y (y^2 is constant); its shares are 1 / sqrt(12) and 2 / sqrt(12)
    assert np.allclose(found / found[0], [1.0, 1.0, 2.0, 2.0, 1.0, 1.0])
    # drawn errors of angle and gain in the roll equation, against what the split u = y (1, -2, 1) does there
    u = np.array([y * (1.0 if x else -2.0) for x, y in place])
    signal = x[:, :, 2] @ (u * np.array([y for _, y in place]))
    errors = []
    for _ in range(200):
        wrong = 0.005 * np.sqrt(2.0 / 3.0) * rng.standard_normal(6)
        moment = (x[:, :, 2] * wrong) @ np.array([y for _, y in place])
        errors.append(float(moment @ signal) / float(signal @ signal) * u[0])
    assert 0.3 < found[0] / np.sqrt(np.mean(np.square(errors))) < 3.0
