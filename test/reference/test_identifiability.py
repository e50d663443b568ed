# Copyright 2026 ride_estimation contributors
"""Identifiability of mount parameters (ride_models 4.5): ranks, the scale symmetry, bounds against an independent estimate."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from scipy import optimize

from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.errors import InputDataError
from ride_estimation.identification.fisher import identifiability, judge
from ride_estimation.identification.sensitivities import AddedMass, Excitation, sensitivities
from ride_estimation.identification.sensor_plan import plan
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

ROOT = Path(__file__).parents[2]
KNOWN = ("cab.mass", "cab.inertia")


@pytest.fixture(scope="module")
def truck():
    return load_vehicle(ROOT / "config" / "vehicles" / "truck_cab.yaml")


def accelerometers(vehicle, *bodies):
    return [s for s in vehicle.sensors.values() if s.kind == "accelerometer" and s.body in bodies]


def test_independent_mount_bases_identify_every_stiffness_and_damping(truck):
    result = identifiability(truck, accelerometers(truck, "cab", "chassis"), Excitation(), KNOWN)
    assert (result.rank, len(result.names)) == (24, 24)
    assert np.all(np.isfinite(result.relative_std))


def test_a_rigid_frame_leaves_horizontal_stiffness_as_sums_only(truck):
    result = identifiability(truck, accelerometers(truck, "cab", "chassis"), Excitation(twist_share=0.0), KNOWN)
    assert result.rank == 18
    bound = dict(zip(result.names, result.relative_std))
    for mount in truck.mounts:
        assert math.isfinite(bound[f"{mount}.z.stiffness"])
        assert math.isinf(bound[f"{mount}.x.stiffness"])


def test_without_a_scale_reference_only_the_common_scale_is_unobservable(truck):
    result = identifiability(truck, accelerometers(truck, "cab", "chassis"), Excitation())
    assert result.rank == len(result.names) - 1
    assert len(result.null_directions) == 1
    assert "scale together" in result.null_directions[0]
    for word in ("mass", "inertia", "stiffness", "damping"):
        assert word in result.null_directions[0]


def test_cab_accelerometers_alone_identify_nothing_without_the_base_motion(truck):
    result = identifiability(truck, accelerometers(truck, "cab"), Excitation(), KNOWN)
    assert result.rank == 0


def test_the_plan_names_what_would_be_a_scale_reference(truck):
    chosen = plan(truck, Excitation(), known=())
    gaining = [o.name for o in chosen.options if o.gained]
    assert any("load cell" in name for name in gaining)
    assert any("weigh" in name for name in gaining)
    assert not any("displacement" in name for name in gaining)


def one_mass(k=300_000.0, c=20_000.0, m=2500.0):
    body = Body("body", Prior(m), np.zeros(3), np.eye(3), coordinates=("z",))
    mount = Mount("spring", np.zeros(3), "body", "axle", {"z": KelvinVoigt(k, c)})
    sensors = {
        "body": Sensor("body", "accelerometer", "/b", "body", noise_std=0.02),
        "axle": Sensor("axle", "accelerometer", "/a", "axle", "spring", noise_std=1e-9),
    }
    return Vehicle("quarter", {"body": body}, {"spring": mount}, sensors, gravity=9.80665)


def test_bounds_equal_the_scatter_of_an_independent_frequency_domain_fit():
    """Second route: fit k/m and c/m to synthetic spectra (own formula, lstsq) and look at the scatter of 300 fits."""
    vehicle = one_mass()
    excitation = Excitation(roughness=64e-6, speed=10.0, duration_s=60.0, rate_hz=100.0, band_hz=(0.5, 20.0))
    result = identifiability(vehicle, list(vehicle.sensors.values()), excitation, ("body.mass",))
    bound = dict(zip(result.names, result.relative_std))
    rng = np.random.default_rng(3)
    f = np.arange(0.5, 20.0, 1 / 60.0)
    w = 2 * np.pi * f
    psd_u = 64e-6 * (f / 10.0 / 0.1) ** -2 / 10.0
    # complex line amplitudes with E|u|^2 = S T / 2 in the convention of a Fourier sum scaled by sqrt(dt)
    noise = math.sqrt(2 * 0.02**2 / 100.0)
    errors = []
    for _ in range(300):
        u = np.sqrt(psd_u / 2) * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)) * math.sqrt(60.0 * (1 / 60.0))

        def response(k, c, u=u):
            z = k + 1j * w * c
            return -(w**2) * z / (z - w**2 * 2500.0) * u

        y = response(3e5, 2e4) + noise / math.sqrt(2) * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size))
        base = response(3e5, 2e4)
        jac = np.column_stack([(response(3e5 * 1.0001, 2e4) - base) / 1e-4, (response(3e5, 2e4 * 1.0001) - base) / 1e-4])
        stacked = np.vstack([jac.real, jac.imag])
        errors.append(np.linalg.lstsq(stacked, np.concatenate([(y - base).real, (y - base).imag]), rcond=None)[0])
    scatter = np.std(errors, axis=0)
    assert bound["spring.z.stiffness"] == pytest.approx(scatter[0], rel=0.15)  # 300 fits: 4 % scatter, grid of 60 lines
    assert bound["spring.z.damping"] == pytest.approx(scatter[1], rel=0.15)


def test_bounds_equal_the_scatter_of_output_error_fits_to_simulated_runs():
    """Third route, in time: 40 runs on drawn (periodic) roads, noise on the body, k and c by nonlinear least squares."""
    vehicle, rate, seconds, mass = one_mass(), 100.0, 30.0, 2500.0
    excitation = Excitation(roughness=64e-6, speed=10.0, duration_s=seconds, rate_hz=rate, band_hz=(0.5, 20.0), twist_share=0.0)
    result = identifiability(vehicle, list(vehicle.sensors.values()), excitation, ("body.mass",))
    rng = np.random.default_rng(21)
    count = round(seconds * rate)
    f = np.fft.rfftfreq(count, 1.0 / rate)
    inside = (f > 0.5) & (f < 20.0)
    psd = np.zeros(f.size)
    psd[inside] = 64e-6 * (f[inside] / 10.0 / 0.1) ** -2 / 10.0 * (2 * np.pi * f[inside]) ** 4  # of the base acceleration
    fits = []
    for _ in range(40):
        lines = np.sqrt(psd * rate * count / 4.0) * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size))
        base = np.fft.irfft(lines, count)

        def response(logs, base=base):
            k, c = np.exp(logs)
            strut = k + 2j * np.pi * f * c
            return np.fft.irfft(strut / (strut - mass * (2 * np.pi * f) ** 2) * np.fft.rfft(base), count)

        measured = response(np.log([3e5, 2e4])) + 0.02 * rng.standard_normal(count)
        start = np.log([3.3e5, 1.7e4])
        fits.append(optimize.least_squares(lambda z, m=measured, r=response: r(z) - m, start, diff_step=1e-4).x)
    # 40 runs: 11 %, each on a road of its own whose information scatters too
    np.testing.assert_allclose(result.relative_std, np.std(fits, axis=0), rtol=0.3)


def test_mass_with_known_stiffness_is_identifiable_and_k_alone_is_not():
    vehicle = one_mass()
    sensors = list(vehicle.sensors.values())
    anchored = identifiability(vehicle, sensors, Excitation(), ("spring.z.stiffness",))
    assert anchored.rank == 2
    assert dict(zip(anchored.names, anchored.relative_std))["body.mass"] < 0.01
    free = identifiability(vehicle, sensors, Excitation())
    assert free.rank == 2
    assert len(free.names) == 3
    assert free.null_directions == (
        "3 parameters scale together without changing any signal: every damping, every mass, every stiffness",
    )


TRAVEL = Sensor("travel", "displacement", "", "body", "spring", "z", noise_std=1e-4)
CELL = Sensor("cell", "force", "", "body", "spring", noise_std=50.0)
ROAD = Excitation(speed=10.0)


@pytest.mark.parametrize(
    ("more", "known", "rank", "mass"),
    [
        ((), {}, 2, math.inf),
        ((TRAVEL,), {}, 2, math.inf),  # a deflection is k/m again
        ((CELL,), {}, 3, 2.5e-4),
        ((CELL,), {"cell.gain": 0.01}, 3, 0.01),
        ((), {"spring.z.stiffness": 0.0}, 2, 3e-4),
        ((), {"spring.z.stiffness": 0.05}, 2, 0.05),
    ],
    ids=["accelerations", "deflection", "force", "force with 1 % of gain error", "k known", "k known to 5 %"],
)
def test_what_identifies_the_mass_and_how_well(more, known, rank, mass):
    """Table 4.5: 60 s of class C, 0.02 m/s^2. Its bounds (0.025 %, 0.03 %) are of a noisier axle signal: reached or better."""
    vehicle = one_mass()
    result = identifiability(vehicle, [*vehicle.sensors.values(), *more], ROAD, known)
    assert result.rank == rank
    found = dict(zip(result.names, result.relative_std))["body.mass"]
    if mass in (0.01, 0.05):
        assert found == pytest.approx(mass, rel=0.01)  # no better than what it leans on
    else:
        assert found == mass if math.isinf(mass) else 0.2 * mass < found <= mass


def test_a_known_added_mass_equals_the_combination_of_two_runs_by_hand():
    """Each run tells ln k/m and ln c/m with a covariance; two masses that differ by a known weight tell all three."""
    vehicle, weight = one_mass(), 200.0
    sensors = list(vehicle.sensors.values())
    runs = [sensitivities(vehicle, sensors, ROAD, w) for w in (None, AddedMass("body", weight))]
    found = judge(runs, [s.name for s in sensors], ())
    assert found.rank == 3
    total, share = np.zeros((3, 3)), 2500.0 / (2500.0 + weight)
    for mass, per_mass in ((2500.0, 1.0), (2500.0 + weight, share)):
        one = one_mass(m=mass)
        ratios = identifiability(one, list(one.sensors.values()), ROAD, ("body.mass",)).information
        jacobian = np.array([[1.0, 0.0, -per_mass], [0.0, 1.0, -per_mass]])
        total += jacobian.T @ ratios @ jacobian
    by_hand = np.sqrt(np.diag(np.linalg.inv(total)))
    np.testing.assert_allclose(found.relative_std, by_hand, rtol=1e-3)  # central differences of 1e-5
    assert found.relative_std[2] < 0.0038  # ride_models 4.5: 0.38 % with noise on the axle too


def test_several_bodies_lose_one_common_scale_only():
    """Gravity stiffness belongs to the mass that makes it: with one factor on all masses a signal must not change."""
    vehicle = load_vehicle(ROOT / "config" / "vehicles" / "half_car.yaml")
    sensors = [Sensor(b.name, "imu", "", b.name, position=b.cg, noise_std=0.02) for b in vehicle.bodies.values()]
    sensors += [
        Sensor(f"base_{m.name}", "accelerometer", "", m.base, m.name, noise_std=0.02)
        for m in vehicle.mounts.values() if m.base not in vehicle.bodies
    ]  # fmt: skip
    result = identifiability(vehicle, sensors, Excitation())
    assert (result.rank, len(result.names)) == (11, 12)
    assert "scale together" in result.null_directions[0]


def test_a_gyro_adds_to_what_an_accelerometer_tells(truck):
    sensors = [s for s in truck.sensors.values() if s.name == "cab_front_left" or s.body == "chassis"]
    without = identifiability(truck, sensors, Excitation(), KNOWN).relative_std
    imu = [dataclasses.replace(s, kind="imu", gyro_noise_std=0.002) if s.body == "cab" else s for s in sensors]
    with_gyro = identifiability(truck, imu, Excitation(), KNOWN).relative_std
    assert np.all(with_gyro <= without * (1 + 1e-9))
    assert np.min(with_gyro / without) < 0.8


def test_bad_plans_are_refused(truck):
    with pytest.raises(InputDataError, match="at least one sensor"):
        identifiability(truck, [], Excitation())
    with pytest.raises(InputDataError, match="unknown parameter"):
        identifiability(truck, accelerometers(truck, "cab"), Excitation(), ("cab.colour",))
    with pytest.raises(InputDataError, match="positive"):
        identifiability(truck, accelerometers(truck, "cab"), Excitation(speed=0.0))
