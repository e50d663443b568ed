# Copyright 2026 ride_estimation contributors
"""Document 001 against the product: planar cab and machine from energies, input order, locked joint, bump, literature laws."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ride_estimation.elements.berg import Berg
from ride_estimation.elements.berg_friction import BergFriction
from ride_estimation.elements.bump_stop import BumpStop
from ride_estimation.elements.cubic_spring import CubicSpring
from ride_estimation.elements.dahl import Dahl
from ride_estimation.elements.harmonic import loop_loss
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.maxwell import Maxwell
from ride_estimation.elements.maxwell_chain import MaxwellChain
from ride_estimation.elements.sum_of_elements import SumOfElements
from ride_estimation.errors import InputDataError
from ride_estimation.excitation.driving import wheelbase_delay
from ride_estimation.excitation.obstacles import cosine_bump
from ride_estimation.identification import static_tests
from ride_estimation.identification.voigt_limits import voigt_limits
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.signals.spectra import transfer_function
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.simulation.simulate import simulate
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.modes import frequency_response, linearise, modes, undamped_modes

VEHICLES = Path(__file__).parents[2] / "config" / "vehicles"


def load(name):
    return load_vehicle(VEHICLES / f"{name}.yaml")


def quadratic_form(vehicle, number):
    """Return K (number 0) or C (number 1) as the Hessian of the energy (dissipation), each rise written out point by point.

    Own kinematics of this test: a point of a body at x rises by ``z - (x - x_cg) pitch``.
    """
    order = [(b.name, c) for b in vehicle.bodies.values() for c in ("z", "pitch") if c in b.coordinates]

    def rise(name, x, q):
        if name not in vehicle.bodies:
            return 0.0
        pitch = q[order.index((name, "pitch"))] if (name, "pitch") in order else 0.0
        return q[order.index((name, "z"))] - (x - vehicle.bodies[name].cg[0]) * pitch

    def energy(q):
        total = 0.0
        for mount in vehicle.mounts.values():
            law, x = mount.elements["z"], mount.position[0]
            deflection = rise(mount.body, x, q) - rise(mount.base, x, q)
            total += 0.5 * (law.stiffness, law.damping)[number] * deflection**2
        return total

    unit = np.eye(len(order))
    return order, np.array([[energy(a + b) - energy(a) - energy(b) for b in unit] for a in unit])


@pytest.mark.parametrize("name", ["planar_cab_seat_set_b", "planar_machine_set_a", "planar_machine_set_b"])
def test_matrices_are_the_lagrange_equations_of_the_energies(name):
    vehicle = load(name)
    vehicle = dataclasses.replace(vehicle, gravity=0.0)
    model = linearise(assemble(vehicle))
    for number, ours in enumerate((model.stiffness, model.damping)):
        order, hessian = quadratic_form(vehicle, number)
        index = [model.assembly.coordinates.index(c) for c in order]
        np.testing.assert_allclose(ours[np.ix_(index, index)], hessian, rtol=1e-9, atol=1e-9 * np.abs(hessian).max())
        np.testing.assert_allclose(ours, ours.T, atol=1e-9 * np.abs(ours).max())


def test_misprints_of_the_machine_make_it_unstable():
    """R(6,1), S(6,3) as printed put a pole into the right half plane; the assembled machine has none there."""
    vehicle = load("planar_machine_set_b")
    model = linearise(assemble(vehicle))
    a, _ = model.state_space()
    assert np.linalg.eigvals(a).real.max() < 0.0
    names = model.assembly.coordinates
    row, n = len(names) + names.index(("cab", "z")), len(names)
    k = {m: vehicle.mounts[m].elements["z"] for m in ("front_mount", "rear_mount")}
    mass, inertia = vehicle.bodies["cab"].mass.value, vehicle.bodies["machine"].inertia[1, 1]
    g_d, e_g = 0.640 - vehicle.bodies["machine"].cg[0], 0.61066 + vehicle.bodies["machine"].cg[0]
    printed = a.copy()
    printed[row, names.index(("machine", "z"))] = 2 * k["rear_mount"].stiffness / mass
    printed[row, n + names.index(("cab", "z"))] = (
        -k["front_mount"].damping * g_d + k["rear_mount"].damping * e_g
    ) / inertia
    right, wrong = (np.sort(np.linalg.eigvals(m).real)[::-1] for m in (a, printed))
    assert wrong[0] > right[0] + 0.5  # 1/s: what damped the cab is gone
    heave = np.zeros(2 * n)
    heave[[n + i for i, (_, c) in enumerate(names) if c == "z"]] = 1.0
    assert abs(a[row] @ heave) < 1e-10
    assert abs(printed[row] @ heave) > 1.0  # m/s^2 per m/s of common heave


def test_both_input_orders_of_the_document_are_permutations_of_ours():
    """(3.24) orders inputs [q_f, q_r, qd_f, qd_r], (3.25) [q_f, qd_f, q_r, qd_r]: same response after permutation."""
    vehicle = load("planar_cab_seat_set_b")
    model = linearise(assemble(vehicle))
    _, b = model.state_space()
    count = len(model.assembly.components)
    front, rear = (model.assembly.components.index((m, "z")) for m in ("front_mount", "rear_mount"))
    grouped = b[:, [front, rear, count + front, count + rear]]
    interleaved = b[:, [front, count + front, rear, count + rear]]
    swap = np.eye(4)[:, [0, 2, 1, 3]]
    np.testing.assert_array_equal(grouped @ swap, interleaved)
    kf, kr = (vehicle.mounts[m].elements["z"] for m in ("front_mount", "rear_mount"))
    mass, inertia, x_f, x_r = 615.39, 557.46, 0.640, -0.61066
    cab = [3 + model.assembly.coordinates.index(("cab", c)) for c in ("z", "pitch")]
    by_hand = np.array([
        [kf.stiffness / mass, kf.damping / mass, kr.stiffness / mass, kr.damping / mass],
        [-x_f * kf.stiffness / inertia, -x_f * kf.damping / inertia, -x_r * kr.stiffness / inertia, -x_r * kr.damping / inertia],
    ])
    np.testing.assert_allclose(interleaved[cab], by_hand, rtol=1e-9)
    assert np.abs(grouped[cab] - by_hand).max() > 1.0  # the wrong order is not nearly right


def test_a_rear_joint_locked_fore_aft_gives_the_modes_of_the_multibody_model():
    """Row 1-4: no formula, the joint itself: a rod against fore-aft motion 0.676 m below the CG; 3.86 and 20.6 Hz."""
    free = dataclasses.replace(load("planar_cab_seat_set_b"), gravity=0.0)
    cab = dataclasses.replace(free.bodies["cab"], coordinates=("x", "z", "pitch"))
    rod = dataclasses.replace(
        free.mounts["rear_mount"], name="rod", position=np.array([-0.61066, 0.0, -0.676]), elements={"x": KelvinVoigt(1e10, 0.0)}
    )
    # the document has the seat go up and down only, also while the cab turns: at the height of the joint it does
    seat = dataclasses.replace(free.bodies["seat"], cg=np.array([-0.382, 0.0, -0.676]))
    locked = dataclasses.replace(free, bodies={**free.bodies, "cab": cab, "seat": seat}, mounts={**free.mounts, "rod": rod})
    found = sorted(m.frequency_hz for m in undamped_modes(linearise(assemble(locked))))[:3]
    assert found == pytest.approx([1.0, 3.86, 20.6], abs=0.05)  # Hz
    loose = sorted(m.frequency_hz for m in undamped_modes(linearise(assemble(free))))
    assert loose == pytest.approx([1.0, 4.5, 21.7], abs=0.03)


def test_lifting_and_axle_loads_balance_the_moments():
    """(3.4) to (3.7): forces and moments of the free body about any point vanish."""
    weight, b, wheelbase, lift, arm = 78_000.0, 0.95, 2.15, 9_000.0, 2.9
    front, rear = static_tests.axle_loads(weight, b, wheelbase)
    less = static_tests.lifting_load(lift, arm, wheelbase)
    for point in (-1.0, 0.0, 2.15, 5.0):
        at_rest = weight * (b - point) - front * (wheelbase - point) - rear * (0.0 - point)
        assert abs(at_rest) < 1e-8  # N m
        lifted_rear = rear - (lift - less)
        lifted = weight * (b - point) - (front - less) * (wheelbase - point) - lifted_rear * (0.0 - point) - lift * (arm - point)
        assert abs(lifted) < 1e-8
    with pytest.raises(InputDataError):
        static_tests.axle_loads(weight, 3.0, wheelbase)


def machine_over(height, rate, speed):
    vehicle = load("planar_machine_set_b")
    delay = round(wheelbase_delay(2.15, speed) * rate)
    displacement = np.zeros((len(height), len(vehicle.mounts), 3))
    for name, lag in (("front_tyre", 0), ("rear_tyre", delay)):
        displacement[lag:, list(vehicle.mounts).index(name), 2] = height[: len(height) - lag]
    return simulate(assemble(vehicle), BaseMotion.from_displacement(displacement, rate))


def test_after_a_bump_the_seat_rings_longer_than_it_was_pushed():
    """Row 1-17: bump at 10 km/h; most of the seat's energy comes after the rear axle has left it."""
    speed, rate = 10 / 3.6, 400.0
    t = np.arange(0.0, 12.0, 1 / rate)
    seat = machine_over(cosine_bump(speed * t, 2.0, 0.5, 0.06), rate, speed).body_motion("seat")[:, 2]
    front_on = (speed * t > 2.0) & (speed * t < 2.5)
    rear_on = (speed * t > 2.0 + 2.15) & (speed * t < 2.5 + 2.15)
    during = np.sum(seat[front_on | rear_on] ** 2)
    after = np.sum(seat[speed * t >= 2.5 + 2.15] ** 2)
    assert after > during


def test_peaks_of_the_tyre_to_seat_function_are_modes():
    """Row 1-17: H1 from a simulated rough road, its peak at the mode the eigenvalues name and equal to the exact function."""
    rate, speed = 200.0, 1e6  # both axles together: one input
    rng = np.random.default_rng(4)
    n = 40_000
    frequency = np.fft.rfftfreq(n, 1 / rate)
    spectrum = np.where((frequency > 0.3) & (frequency < 15.0), 1 / np.maximum(frequency, 0.3), 0.0)
    height = np.fft.irfft(spectrum * np.exp(2j * np.pi * rng.random(len(frequency))) * n / 2) * 2e-4
    response = machine_over(height, rate, speed)
    seat = response.body_motion("seat", "coordinates")[:, 2]
    h1 = transfer_function(height[2000:], seat[2000:], rate, 4096)
    band = (h1.frequency_hz > 0.5) & (h1.frequency_hz < 3.0)
    top = h1.frequency_hz[band][np.argmax(np.abs(h1.h1[band]))]
    assembly = response.assembly
    tyres = np.array([m in ("front_tyre", "rear_tyre") for m, _ in assembly.components], dtype=float)
    seat_row = assembly.coordinates.index(("seat", "z"))
    exact = np.abs(frequency_response(assembly, h1.frequency_hz[band])[:, seat_row] @ tyres)
    assert top == pytest.approx(h1.frequency_hz[band][np.argmax(exact)], abs=2 * rate / 4096)
    # inside the half-power band of a mode, here 0.22 Hz wide
    assert any(abs(m.frequency_hz - top) < m.damping_ratio * m.frequency_hz < 0.2 for m in modes(linearise(assembly)))


# -------------------------------------------------------------------------------------- literature laws of chapter 2, row 1-23


def test_zener_and_generalised_maxwell_have_their_loss_angle():
    zener = SumOfElements((KelvinVoigt(1e5, 0.0), Maxwell(5e4, 1e3)))
    chain = SumOfElements((KelvinVoigt(1e5, 0.0), MaxwellChain(0.0, (5e4, 3e4), (1e3, 60.0))))
    for omega in (0.5, 7.0, 60.0, 900.0):
        cells = [k * 1j * omega * c / (k + 1j * omega * c) for k, c in ((5e4, 1e3), (3e4, 60.0))]
        assert np.angle(zener.dynamic_stiffness(omega, 1e-3)) == pytest.approx(np.angle(1e5 + cells[0]), rel=1e-9)
        assert np.angle(chain.dynamic_stiffness(omega, 1e-3)) == pytest.approx(np.angle(1e5 + sum(cells)), rel=1e-9)


def test_friction_beside_a_maxwell_cell_is_the_berg_model():
    parts = SumOfElements((KelvinVoigt(1e5, 0.0), Maxwell(5e4, 1e3), BergFriction(60.0, 2.5e-4)))
    berg = Berg(stiffness=1e5, cell_stiffness=5e4, cell_damping=1e3, friction=60.0, half_stroke=2.5e-4)
    for omega, amplitude in ((3.0, 1e-4), (40.0, 2e-3)):
        assert parts.dynamic_stiffness(omega, amplitude) == pytest.approx(berg.dynamic_stiffness(omega, amplitude), rel=1e-12)


def test_bouc_wen_without_its_second_slope_is_dahl_friction():
    """Bouc-Wen ``z' = A v - beta |v| z - gamma v |z|`` with n = 1, gamma = 0 is ``dahl``: loop area of an ODE against it."""
    slope, limit, amplitude, omega = 2e5, 80.0, 1.5e-3, 5.0

    def rhs(t, z):
        v = amplitude * omega * np.cos(omega * t)
        return slope * v - slope / limit * abs(v) * z

    cycles = 4
    t = np.linspace(0.0, cycles * 2 * np.pi / omega, cycles * 4096 + 1)
    z = solve_ivp(rhs, (0, t[-1]), [0.0], t_eval=t, rtol=1e-9, atol=1e-9, max_step=t[1] * 8).y[0]
    last = slice(-4097, -1)
    area = loop_loss(amplitude * np.sin(omega * t[last]), z[last])
    assert Dahl(limit, slope).loss_energy(omega, amplitude) == pytest.approx(area, rel=1e-4)


def test_cushion_and_end_stop_stiffen_as_written():
    cushion, stop = CubicSpring(1e4, 5e7), BumpStop.example()
    assert cushion.force(cushion.initial(), 0.02, 0.0) == pytest.approx(1e4 * 0.02 + 5e7 * 0.02**3)
    x, force = amplitude_loop(cushion, 0.02)
    assert loop_loss(x, force) == pytest.approx(0.0, abs=1e-9 * np.abs(force).max() * 0.02)
    grid = np.linspace(-0.3, 0.3, 2001)
    forces = np.array([stop.force(stop.initial(), float(g), 0.0) for g in grid])
    assert np.all(np.diff(forces) >= -1e-9)  # never softer than free
    assert np.any(forces == 0.0) and np.any(forces != 0.0)


def amplitude_loop(law, amplitude):
    x = amplitude * np.sin(2 * np.pi * np.arange(1024) / 1024)
    return x, np.array([law.force(law.initial(), float(value), 0.0) for value in x])


# --------------------------------------------------------------------------------- one damping value for all peaks, row 0-19


def rubber_seat(viscous):
    vehicle = dataclasses.replace(load("planar_cab_seat_set_b"), gravity=0.0)
    changes = {}
    for mount in vehicle.mounts.values():
        k = mount.elements["z"].stiffness
        rubber = SumOfElements((KelvinVoigt(k, 0.0), Maxwell(0.3 * k, 0.3 * k * 0.03)))
        changes[(mount.name, "z")] = KelvinVoigt(k, k * 0.002) if viscous else rubber
    return vehicle.replace_elements(changes)


def test_one_voigt_damper_cannot_serve_three_peaks():
    """Tuned at the seat's peak it is right there and wrong by tens of percent at bounce and pitch; viscous mounts: nowhere."""
    rows = voigt_limits(rubber_seat(False), 1.0)
    assert len(rows) == 3
    assert [row.frequency_hz for row in rows] == pytest.approx([1.1, 4.8, 24.0], rel=0.15)
    assert abs(rows[0].error_percent) < 5.0
    assert all(abs(row.error_percent) > 20.0 for row in rows[1:])
    assert all(abs(row.error_percent) < 1e-6 for row in voigt_limits(rubber_seat(True), 1.0))
    with pytest.raises(InputDataError, match="must be positive"):
        voigt_limits(rubber_seat(True), 0.0)
