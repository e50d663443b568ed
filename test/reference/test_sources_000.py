# Copyright 2026 ride_estimation contributors
"""Document 000 against the product, equation by equation: what is printed, what holds, which numbers come out."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.elements.berg_friction import BergFriction
from ride_estimation.elements.damping_filter import DampingFilter
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.errors import ConfigurationError
from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator
from ride_estimation.estimation.motion.loads import InertialLoads
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.layout import b_matrix
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.simulation.simulate import simulate
from ride_estimation.units import SUFFIXES
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.modes import frequency_response, linearise, undamped_modes
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

ROOT = Path(__file__).parents[2]
MASS, GRAVITY = 1200.0, 9.80665
INERTIA = np.array([[730.0, -8.0, -25.0], [-8.0, 540.0, 5.0], [-25.0, 5.0, 810.0]])
CORNERS = np.array([[0.8, 0.5, -0.7], [0.8, -0.5, -0.7], [-0.8, 0.5, -0.7], [-0.8, -0.5, -0.7]])
TABLE_4 = np.array([[7976e3, 4600e3, 52.1e3]] * 2 + [[7976e3, 4600e3, 41.7e3]] * 2)  # N/m
TABLE_4_ROTATIONAL = (572.9, 4018.1, 11.4)  # printed N/mm, taken as N m/rad
ALL_FREE = np.ones(6, dtype=bool)
NOISE = 0.02  # m/s^2


def corner_sensors(noise: float = NOISE) -> list[Sensor]:
    return [Sensor(f"s{i}", "accelerometer", f"/s{i}", "cab", position=p, noise_std=noise) for i, p in enumerate(CORNERS)]


def one_mass(law, mass: float = 300.0) -> Vehicle:
    body = Body("body", Prior(mass), np.zeros(3), np.eye(3), coordinates=("z",))
    return Vehicle("one", {"body": body}, {"m": Mount("m", np.zeros(3), "body", "base", {"z": law})}, {}, gravity=0.0)


# ------------------------------------------------------------------------------------------------ loads and motion, (1) to (5)


@pytest.fixture(scope="module")
def driven():
    cab = assemble(load_vehicle(ROOT / "config" / "vehicles" / "truck_cab.yaml"))
    rng = np.random.default_rng(3)
    t = np.arange(1000) / 200.0
    lines = rng.uniform(0.7, 9.0, 8)
    wave = np.sin(2 * np.pi * lines * t[:, None] + rng.uniform(0, 6.28, 8)) * 4e-3 * (1 - np.exp(-t * t))[:, None]
    mix = rng.standard_normal((8, 4, 3)) * np.array([0.2, 0.2, 1.0])
    return simulate(cab, BaseMotion.from_displacement(np.einsum("nk,kma->nma", wave, mix), 200.0))


def test_load_balance_holds_as_corrected_and_fails_as_printed(driven):
    """(1), (2): one inertial term and arms; printed, the inertial term stands inside the sum over the two mount rows."""
    force = driven.mount_force()
    load = driven.inertial_load("cab")
    weight = MASS * driven.assembly.vehicle.gravity
    sum_z = force[:, :, 2].sum(axis=1) - weight
    slope = float(load[:, 2] @ sum_z / (sum_z @ sum_z))
    assert slope == pytest.approx(1.0, abs=1e-4)
    assert np.sqrt(np.mean((load[:, 2] - sum_z) ** 2)) < 0.1  # N
    printed = 2.0 * load[:, 2] - sum_z
    assert np.sqrt(np.mean(printed**2)) == pytest.approx(np.sqrt(np.mean(load[:, 2] ** 2)), rel=1e-6)  # fails by the load itself
    arms = np.array([m.position for m in driven.assembly.vehicle.mounts.values()])
    arms = arms - driven.assembly.vehicle.bodies["cab"].cg
    moment = np.cross(arms, force - driven.assembly.static_force).sum(axis=1)
    # the static loads turn with the cab: weight times height times angle, in the model as geometric stiffness
    omega = driven.body_motion("cab", "rates")[:, 3:]
    inertia = driven.assembly.vehicle.bodies["cab"].inertia
    wanted = load[:, 3:] - np.cross(omega, omega @ inertia.T)
    angle = driven.body_motion("cab", "coordinates")
    gravity = angle @ driven.assembly.geometric_stiffness[3:].T
    scale = np.sqrt(np.mean(wanted**2, axis=0))
    assert np.all(np.sqrt(np.mean((moment - gravity - wanted) ** 2, axis=0)) < 1e-6 * scale)
    # without arms, as printed, no moment at all would come from the mounts, which have no rotational elements here
    assert np.all(scale > 1.0)  # N m


def channels(order, places):
    return [(places[number], axis) for number, axis in order]


PRINTED_ORDER = ((1, "x"), (1, "y"), (1, "z"), (2, "z"), (0, "z"), (2, "y"))  # a2x a2y a2z a3z a1z a3y


def test_twelve_channels_beat_six_and_their_noise_becomes_the_stated_loads():
    """Rows 0-3 and 0-4 with noise 0.02 m/s^2 at the four corners."""
    weights = CgMotionEstimator(corner_sensors(), np.zeros(3), ALL_FREE, GRAVITY).weights(np.ones(4, dtype=bool), 0.005)
    # the best six channels of document 000: sensors 2 and 3 at opposite ends
    six = np.linalg.inv(b_matrix(channels(PRINTED_ORDER, CORNERS[[1, 0, 2]])))
    gain = np.sqrt(np.diag(six @ six.T)) * NOISE / np.sqrt(np.diag(weights.covariance))
    assert (gain.min(), gain.max()) == pytest.approx((1.41, 1.89), abs=0.01)  # sqrt 2: twice the channels
    loads = InertialLoads(MASS, 0.0, INERTIA)
    std = np.sqrt(np.diag(loads.covariance(weights.covariance, np.zeros(6))))
    np.testing.assert_allclose(std, [15.9, 20.6, 12.0, 14.6, 6.8, 8.6], rtol=0.01)  # N, N m


def test_residual_shows_warp_and_the_motion_does_not_feel_it():
    """Row 0-5: residual RMS over the twelve channels 0.014 m/s^2 from noise alone, 0.174 with warp of 0.3 m/s^2.

    Without gyros residuals also tell the angular rate, and the centripetal terms of that feel the warp: by a hundred thousandth.
    """
    rng = np.random.default_rng(5)
    noise = NOISE * rng.standard_normal((4000, 12))
    quiet = np.tile([0.0, 0.0, GRAVITY], 4) + noise
    warped = quiet.copy()
    warped[:, 2::3] += 0.3 * rng.standard_normal(4000)[:, None] * np.array([1.0, -1.0, -1.0, 1.0])
    blocks, rms = [], []
    for samples in (quiet, warped):
        estimator = CgMotionEstimator(corner_sensors(), np.zeros(3), ALL_FREE, GRAVITY)
        blocks.append(estimator.observe(samples, np.zeros((4000, 0)), np.ones((4000, 4), dtype=bool), 0.005))
        rms.append(np.sqrt(np.mean((samples - estimator.predict(blocks[-1].motion, blocks[-1].rate)) ** 2)))
    assert rms[0] == pytest.approx(0.0141, abs=0.0003)
    assert rms[1] == pytest.approx(0.174, abs=0.004)
    np.testing.assert_allclose(blocks[1].motion, blocks[0].motion, atol=1e-5 * 0.3)


def test_moment_needs_products_of_inertia_and_the_gyroscopic_term():
    """(5): rate of change of angular momentum of a tumbling body, differentiated numerically, against the load formula."""
    h = 1e-5

    def turned(t):  # rotation vector -> rotation matrix, body to world, and the momentum it carries
        phi = np.array([0.3 * np.sin(4 * t), 0.2 * np.sin(5 * t + 1), 0.4 * np.sin(3 * t)])
        angle = np.linalg.norm(phi)
        k = np.cross(np.eye(3), phi / angle)
        return np.eye(3) - np.sin(angle) * k + (1 - np.cos(angle)) * k @ k

    def omega(t):
        skew = turned(t).T @ (turned(t + h) - turned(t - h)) / (2 * h)
        return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])

    def momentum(t):
        return turned(t) @ INERTIA @ omega(t)

    loads, step = InertialLoads(MASS, 0.0, INERTIA), 1e-3
    for t in (0.1, 0.37, 0.9):
        moment = turned(t).T @ (momentum(t + step) - momentum(t - step)) / (2 * step)
        alpha = (omega(t + step) - omega(t - step)) / (2 * step)
        rate = omega(t)
        found = loads.load(np.concatenate([np.zeros(3), alpha])[None], rate[None])[0, 3:]
        np.testing.assert_allclose(found, moment, atol=2e-3 * np.abs(moment).max())  # 0.2 %: difference quotients
        printed = np.diag(np.diag(INERTIA)) @ alpha  # principal moments only, no gyroscopic moment
        assert np.abs(printed - moment).max() > 10 * np.abs(found - moment).max()


# -------------------------------------------------------------------------------------------------- modes, (6) to (11), units


def table_4_cab(height: float, rotational: tuple[float, float, float], gravity: float = 0.0) -> Vehicle:
    arms = CORNERS * np.array([1.0, 1.0, 0.0]) + np.array([0.0, 0.0, height])
    mounts = {}
    for i, (place, row) in enumerate(zip(arms, TABLE_4)):
        values = {**dict(zip("xyz", row)), **dict(zip(("roll", "pitch", "yaw"), rotational))}
        mounts[f"m{i}"] = Mount(f"m{i}", place, "cab", "chassis", {a: KelvinVoigt(k, 0.0) for a, k in values.items() if k})
    body = Body("cab", Prior(MASS), np.zeros(3), np.diag([730.0, 540.0, 810.0]))
    return Vehicle("cab", {"cab": body}, mounts, {}, gravity=gravity)


def frequencies(vehicle: Vehicle) -> list[float]:
    return sorted(m.frequency_hz for m in undamped_modes(linearise(assemble(vehicle))))


def test_full_modes_with_mounts_below_the_cg_and_rotational_stiffness():
    """Row 0-8: the stated geometry, Table 4 with its rotational column as N m/rad."""
    found = frequencies(table_4_cab(-0.7, TABLE_4_ROTATIONAL))
    np.testing.assert_allclose(found, [0.97, 1.71, 2.02, 24.85, 26.5, 37.6], atol=0.06)
    np.testing.assert_allclose(found[:4], [0.97, 1.71, 2.02, 24.85], atol=0.005)  # Hz


def test_the_bundled_cab_of_table_4_has_the_modes_of_the_table():
    vehicle = dataclasses.replace(load_vehicle("document_000_cab"), gravity=0.0)
    body = dataclasses.replace(vehicle.bodies["cab"], inertia=np.diag([730.0, 540.0, 810.0]))
    found = frequencies(dataclasses.replace(vehicle, bodies={"cab": body}))
    np.testing.assert_allclose(found, frequencies(table_4_cab(-0.7, TABLE_4_ROTATIONAL)), rtol=1e-9)


def test_rotational_column_matters_little_as_n_m_per_rad_and_is_absurd_as_n_per_mm():
    plain, turned = (frequencies(table_4_cab(-0.7, r)) for r in ((0.0, 0.0, 0.0), TABLE_4_ROTATIONAL))
    assert (plain[0], turned[0]) == pytest.approx((0.949, 0.972), abs=0.001)  # Hz, roll
    assert 572.9 / math.degrees(1.0) == pytest.approx(10.0, abs=0.002)  # N m/deg: a round number in that unit only


def test_gravity_lowers_the_roll_mode_by_a_tenth():
    """17.6 % of the roll stiffness k_z b^2 at h = 0.7 m; equal corners of the mean stiffness: 0.949 -> 0.862 Hz."""
    mean = dataclasses.replace(table_4_cab(-0.7, (0.0, 0.0, 0.0)))
    equal = {(m, "z"): KelvinVoigt(46.9e3, 0.0) for m in mean.mounts}
    low = [frequencies(dataclasses.replace(mean, gravity=g).replace_elements(equal))[0] for g in (0.0, GRAVITY)]
    assert low == pytest.approx([0.949, 0.862], abs=0.001)
    share = MASS * GRAVITY * 0.7 / (4 * 46.9e3 * 0.25)
    assert share == pytest.approx(0.176, abs=0.001)


def test_units_of_table_1_are_told_by_the_bounce_mode():
    total = 2 * 50.0 + 2 * 40.0
    newton, kilogram = (math.sqrt(total * factor / MASS) / (2 * math.pi) for factor in (1e3, 1e3 * GRAVITY))
    assert (newton, kilogram) == pytest.approx((1.95, 6.1), abs=0.01)  # Hz: N/mm, not kgf/mm
    damping_ratio = 4 * 10.0e3 / (2 * math.sqrt(total * 1e3 * MASS))
    assert damping_ratio > 1.3  # 10 N s/mm a corner would be overdamped in bounce
    assert SUFFIXES["_n_per_mm"] == ("N/mm", 1e3)


def test_vehicle_file_with_the_printed_inertia_is_refused(tmp_path):
    text = (ROOT / "config" / "vehicles" / "truck_cab.yaml").read_text(encoding="utf-8")
    path = tmp_path / "printed.yaml"
    ours = "ixx: 730.0, iyy: 540.0, izz: 810.0"
    assert ours in text
    path.write_text(text.replace(ours, "ixx: 7.3e8, iyy: 5.4e8, izz: 8.1e8"), encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"radius of gyration.*kg mm\^2"):
        load_vehicle(path)


# ----------------------------------------------------------------------------------------------------- filters, (12) to (14)


def growth(shape: str, gain: float) -> float:
    """Return the largest real part of the poles of the cab's bounce (Table 4: 1.99 Hz) on four filters alone [1/s]."""
    law, stiffness = DampingFilter(gain, 12.6, 0.5, shape), TABLE_4[:, 2].sum()
    numerator = {"low": [12.6**2], "band": [12.6 / 0.5, 0.0], "high": [1.0, 0.0, 0.0]}[shape]
    denominator = [1.0, 12.6 / 0.5, 12.6**2]
    poles = np.roots(np.polyadd(np.polymul([MASS, 0.0, stiffness], denominator), 4 * gain * np.polymul([1.0, 0.0], numerator)))
    worst = poles[np.argmax(poles.real)]
    # the pole of the polynomial written here is one of the cab on the product's element
    assert abs(MASS * worst**2 + stiffness + 4 * worst * law.transfer(worst / 1j)) < 1e-6 * stiffness
    return float(worst.real)


@pytest.mark.parametrize(("shape", "small", "large"), [("low", 0.0023, 17.6), ("high", 0.0053, 1.14)])
def test_low_and_high_filters_put_poles_in_the_right_half_plane(shape, small, large):
    assert growth(shape, 270.0) == pytest.approx(small, rel=0.03)  # 1/s, K of Table 5 as N s/m
    assert growth(shape, 270e3) == pytest.approx(large, rel=0.01)  # 1/s, as N s/mm
    assert growth("band", 270.0) < 0.0


def test_a_low_filter_drives_a_simulated_mass_and_the_band_filter_stops_it():
    base = np.zeros((2400, 1, 3))
    base[:40, 0, 2] = 0.01 * np.sin(np.pi * np.arange(40) / 40) ** 2
    late, early = slice(2000, 2400), slice(200, 600)
    stiffness = 300.0 * (2 * np.pi * 5.0) ** 2
    ratio = {}
    for shape in ("low", "band"):
        law = SumOfElements((KelvinVoigt(stiffness, 0.0), DampingFilter(2700.0, 12.6, 0.5, shape)))
        z = simulate(assemble(one_mass(law)), BaseMotion.from_displacement(base, 200.0)).coordinates[:, 0]
        ratio[shape] = np.std(z[late]) / np.std(z[early])
    assert ratio["low"] > 1.1
    assert ratio["band"] < 0.5


def test_absolute_rate_of_figure_13_is_a_skyhook_and_moves_the_body_1_9_times_less():
    """Body acceleration at 8 Hz, bounce 1.98 Hz, damping ratio 0.2: product (relative rate) over the skyhook's closed form."""
    mass, w0 = 300.0, 2 * np.pi * 1.98
    k, c = mass * w0**2, 2 * 0.2 * mass * w0
    relative = frequency_response(assemble(one_mass(KelvinVoigt(k, c), mass)), np.array([8.0]))[0, 0, 0]
    s = 2j * np.pi * 8.0
    skyhook = k / (mass * s * s + c * s + k)
    assert abs(relative) / abs(skyhook) == pytest.approx(1.9, abs=0.02)


def test_friction_has_loss_at_zero_frequency_and_softens_with_amplitude():
    """Row 0-18, Figure 1: phase stays as f -> 0, c_eq falls as 1/f, stiffness falls and phase rises with amplitude."""
    law = SumOfElements((KelvinVoigt(1e5, 0.0), BergFriction(200.0, 1e-3)))
    slow = [law.dynamic_stiffness(2 * np.pi * f, 1e-3) for f in (0.001, 0.01, 0.1)]
    phase = [np.angle(value) for value in slow]
    assert min(phase) > 0.05  # rad
    damping = [value.imag / (2 * np.pi * f) for value, f in zip(slow, (0.001, 0.01, 0.1))]
    np.testing.assert_allclose(np.array(damping[:-1]) / np.array(damping[1:]), 10.0, rtol=1e-9)
    grown = [law.dynamic_stiffness(1.0, a) for a in (0.05e-3, 0.2e-3, 0.8e-3)]
    assert np.all(np.diff(np.abs(grown)) < 0.0)
    assert np.all(np.diff(np.angle(grown)) > 0.0)
