# Copyright 2026 ride_estimation contributors
"""Time simulation against closed forms, an independent integrator and conservation laws."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.elements.registry import element_from_mapping
from ride_estimation.errors import ConfigurationError, InputDataError
from ride_estimation.frames import AXES, rotation_from_rpy
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.simulation.base_motion import BaseMotion, derivative
from ride_estimation.simulation.rotation import Payload, simulate_full_rotation
from ride_estimation.simulation.simulate import CompiledModel, simulate
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.modes import frequency_response, linearise
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

VEHICLES = Path(__file__).parents[2] / "config" / "vehicles"


@pytest.fixture(scope="module")
def cab():
    return assemble(load_vehicle(VEHICLES / "truck_cab.yaml"))


@pytest.fixture(scope="module")
def quarter():
    return assemble(load_vehicle(VEHICLES / "quarter_car.yaml"))


def sines(mounts, rate, seconds, scale=0.01, seed=1):
    """Return smooth base displacement (N, M, 3) that starts from rest."""
    generator = np.random.default_rng(seed)
    time = np.arange(int(seconds * rate)) / rate
    total = np.zeros((len(time), mounts, 3))
    for f in (0.7, 1.9, 4.3, 7.7):
        total += np.sin(2 * np.pi * f * time[:, None, None] + generator.uniform(0, 6.28, (mounts, 3))) / (1.0 + f)
    fade = np.clip(time / 1.0, 0.0, 1.0)[:, None, None]
    return scale * total * fade**3 * (10 - 15 * fade + 6 * fade**2)


def test_linear_response_equals_an_independent_integration(cab):
    base = BaseMotion.from_displacement(sines(4, 200.0, 2.5), 200.0)
    response = simulate(cab, base)
    model = linearise(cab)
    a, b = model.state_space()
    mount, axis = cab.component_index()

    def rate(t, state):
        u = [np.interp(t, base.time_s, base.displacement[:, m, i]) for m, i in zip(mount, axis)]
        v = [np.interp(t, base.time_s, base.velocity[:, m, i]) for m, i in zip(mount, axis)]
        return a @ state + b @ np.concatenate([u, v])

    solution = solve_ivp(rate, (0.0, base.time_s[-1]), np.zeros(12), t_eval=base.time_s, rtol=1e-6, atol=1e-9, max_step=0.01)
    error = np.linalg.norm(response.coordinates - solution.y[:6].T, axis=0) / np.linalg.norm(solution.y[:6], axis=1)
    assert np.all(error < 0.002), error  # the reference runs straight between the samples of the base


def test_steady_harmonic_response_equals_the_frequency_response(quarter):
    rate, f, amplitude = 500.0, 2.3, 0.004
    time = np.arange(int(12 * rate)) / rate
    displacement = np.zeros((len(time), 2, 3))
    displacement[:, 1, 2] = amplitude * np.sin(2 * np.pi * f * time)
    response = simulate(quarter, BaseMotion.from_displacement(displacement, rate))
    tail = time > 8.0
    carrier = np.stack([np.sin(2 * np.pi * f * time[tail]), np.cos(2 * np.pi * f * time[tail])], axis=1)
    fitted = np.linalg.lstsq(carrier, response.coordinates[tail], rcond=None)[0]
    found = (fitted[0] + 1j * fitted[1]) / amplitude
    expected = frequency_response(quarter, np.array([f]))[0][:, quarter.components.index(("tyre", "z"))]
    np.testing.assert_allclose(found, expected, rtol=2e-5)


def test_error_falls_sixteenfold_per_halved_step(quarter):
    # quintic start: smooth enough for order four; the base spline is exact where it is cubic in each sample
    displacement = np.zeros((41, 2, 3))
    time = np.arange(41) / 20.0
    displacement[:, 1, 2] = 0.05 * time**2
    velocity = np.zeros_like(displacement)
    velocity[:, 1, 2] = 0.1 * time
    still = np.zeros_like(displacement)
    base = BaseMotion(20.0, displacement, velocity, still, still, still, still)
    runs = [simulate(quarter, base, substeps=n).coordinates[-1] for n in (8, 16, 32, 256)]
    errors = [np.abs(r - runs[-1]).max() for r in runs[:-1]]
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.25)
    assert errors[1] / errors[2] == pytest.approx(16.0, rel=0.25)


def test_mount_forces_balance_the_inertia_of_the_body(cab):
    response = simulate(cab, BaseMotion.from_displacement(sines(4, 200.0, 3.0), 200.0))
    weight = 1200.0 * cab.vehicle.gravity
    net = response.mount_force().sum(axis=1) - np.array([0.0, 0.0, weight])
    load = response.inertial_load("cab")
    np.testing.assert_allclose(net, load[:, :3], atol=1e-6)  # N


def test_full_rotation_satisfies_equilibrium_of_forces_and_moments_exactly(cab):
    angle = 0.03 * np.ones((600, 4, 3)) * np.sin(np.arange(600) / 40.0)[:, None, None]
    base = BaseMotion.from_displacement(sines(4, 200.0, 3.0, scale=0.04), 200.0, angle - angle[0])
    response = simulate(cab, base, full_rotation=True)
    force, load = response.mount_force(), response.inertial_load("cab")
    weight = 1200.0 * cab.vehicle.gravity * response.rotation[:, 0, 2, :]
    places = np.array([m.position for m in cab.vehicle.mounts.values()])
    np.testing.assert_allclose(force.sum(axis=1) - weight, load[:, :3], atol=1e-8)  # N
    np.testing.assert_allclose(np.cross(places, force).sum(axis=1), load[:, 3:], atol=1e-8)  # N m
    # the virtual accelerometer at the CG reads the sum of the mount forces over the mass (gravity included)
    felt = response.accelerations[:, :3] + cab.vehicle.gravity * response.rotation[:, 0, 2, :]
    np.testing.assert_allclose(felt, force.sum(axis=1) / 1200.0, atol=1e-10)


@pytest.mark.parametrize("full_rotation", [False, True])
def test_a_body_beside_its_mount_stands_still_on_the_static_moment(full_rotation):
    """A seat whose CG is 50 mm from its only mount: 54 N m at rest in the rotational element."""
    place = np.array([0.0, 0.0, 0.3])
    laws = {a: KelvinVoigt(4e3, 100.0) for a in ("x", "y", "z", "roll", "pitch", "yaw")}
    mount = Mount("m", place - [0.05, 0.0, 0.2], "seat", "floor", laws)
    seat = Vehicle("seat", {"seat": Body("seat", Prior(110.0), place, np.diag([6.0, 7.0, 4.0]))}, {"m": mount}, {})
    assembly = assemble(seat)
    assert assembly.static_tension[4] == pytest.approx(110.0 * seat.gravity * 0.05)
    still = BaseMotion.from_displacement(np.zeros((200, 1, 3)), 200.0)
    assert np.abs(simulate(assembly, still, full_rotation=full_rotation).coordinates).max() < 1e-12  # m, rad


def test_full_rotation_tends_to_small_rotations_with_the_amplitude(cab):
    differences, readings = [], []
    for scale in (0.02, 0.002):
        base = BaseMotion.from_displacement(sines(4, 200.0, 3.0, scale=scale), 200.0)
        small, full = simulate(cab, base), simulate(cab, base, full_rotation=True)
        differences.append(np.linalg.norm(full.accelerations - small.accelerations) / np.linalg.norm(small.accelerations))
        readings.append(np.abs(full.specific_force("cab_front_left") - small.specific_force("cab_front_left")).max())
    # the difference is of second order: ten times smaller motion, a hundred times smaller difference
    assert differences[0] / differences[1] == pytest.approx(10.0, rel=0.2)
    assert readings[0] / readings[1] == pytest.approx(100.0, rel=0.3)


def test_free_body_keeps_energy_and_angular_momentum():
    still = KelvinVoigt(0.0, 0.0)
    body = Body("b", Prior(100.0), np.zeros(3), np.diag([10.0, 20.0, 27.0]) + 0.5)
    # one eccentric weak spring sets it spinning; afterwards it is compared over a time in which the spring does work
    law = {"x": KelvinVoigt(500.0, 0.0), "y": still, "z": KelvinVoigt(900.0, 0.0)}
    mount = Mount("m", np.array([0.3, 0.2, 0.1]), "b", "ground", law)
    assembly = assemble(Vehicle("free", {"b": body}, {"m": mount}, {}, gravity=0.0))
    base = BaseMotion.from_displacement(np.zeros((2001, 1, 3)), 200.0)
    push = np.zeros((2001, 6))
    push[:100] = [40.0, -10.0, 60.0, 25.0, 14.0, -11.0]
    response = simulate(assembly, base, load=push, substeps=4, full_rotation=True)
    v, w = response.rates[:, :3], response.rates[:, 3:]
    x = response.mount_array("deflection")[:, 0]
    kinetic = 50.0 * np.sum(v**2, 1) + 0.5 * np.einsum("ni,ij,nj->n", w, body.inertia, w)
    energy = kinetic + 250.0 * x[:, 0] ** 2 + 450.0 * x[:, 2] ** 2
    assert np.abs(response.coordinates[:, 3:]).max() > 1.0  # rad: large rotations
    np.testing.assert_allclose(energy[110:], energy[110], rtol=1e-6)


def test_linked_bodies_in_free_flight_keep_momentum_and_angular_momentum():
    bodies = {
        n: Body(n, Prior(m), np.array(p), np.diag(j)) for n, m, p, j in
        (("a", 80.0, [0.0, 0.0, 0.0], [9.0, 7.0, 8.0]), ("b", 50.0, [0.7, 0.1, 0.3], [4.0, 5.0, 6.0]))
    }
    law = {a: KelvinVoigt(3e4, 20.0) for a in "xyz"} | {a: KelvinVoigt(2e3, 5.0) for a in ("roll", "pitch", "yaw")}
    mounts = {"m": Mount("m", np.array([0.4, 0.0, 0.2]), "a", "b", law)}
    assembly = assemble(Vehicle("pair", bodies, mounts, {}, gravity=0.0))
    base = BaseMotion.from_displacement(np.zeros((801, 1, 3)), 200.0)
    push = np.zeros((801, 12))
    push[:20, :6] = [300.0, 50.0, -100.0, 60.0, 40.0, -30.0]
    response = simulate(assembly, base, load=push, substeps=20, full_rotation=True)
    momentum, angular = np.zeros((801, 3)), np.zeros((801, 3))
    for i, body in enumerate(bodies.values()):
        v, w = response.rates[:, 6 * i : 6 * i + 3], response.rates[:, 6 * i + 3 : 6 * i + 6]
        place = body.cg + response.coordinates[:, 6 * i : 6 * i + 3]
        spin = np.einsum("nij,nj->ni", response.rotation[:, i], w @ body.inertia.T)
        momentum += body.mass.value * v
        angular += body.mass.value * np.cross(place, v) + spin
    np.testing.assert_allclose(momentum[25:], np.tile(momentum[25], (776, 1)), atol=1e-9)
    # the couple of the rotational springs is equal and opposite, forces share one line of action
    np.testing.assert_allclose(angular[25:], np.tile(angular[25], (776, 1)), atol=1e-5 * np.abs(angular[25]).max())


@pytest.mark.parametrize(("slides", "aboard"), [(("z",), 0.0), (("x", "z"), 0.0), (("z",), 30.0)])
def test_a_guided_body_in_free_flight_keeps_momentum_and_energy_and_stays_on_its_guide(slides, aboard):
    arm = np.array([0.5, 0.2, 0.3])
    bodies = {
        "a": Body("a", Prior(80.0), np.zeros(3), np.diag([9.0, 7.0, 8.0])),
        "b": Body("b", Prior(50.0), arm, np.diag([1.0, 1.0, 1.0]), coordinates=slides),
    }
    mounts = {
        "m": Mount("m", arm - np.array([0.1, 0.0, 0.2]), "b", "a", {axis: KelvinVoigt(4e3, 0.0) for axis in slides}),
        "tie": Mount("tie", np.array([0.1, 0.2, 0.0]), "a", "ground", {"z": KelvinVoigt(0.0, 0.0)}),
    }
    assembly = assemble(Vehicle("pair", bodies, mounts, {}, gravity=0.0))
    base = BaseMotion.from_displacement(np.zeros((1201, 2, 3)), 200.0)
    push = np.zeros((1201, 12))
    push[:20, :6] = [300.0, 50.0, -100.0, 60.0, 90.0, -80.0]
    push[:20, 6:9] = [40.0, -20.0, 110.0]
    payloads = [Payload("b", aboard, arm + np.array([0.2, 0.3, -0.1]), begin=-1.0)] if aboard else []
    response = simulate_full_rotation(assembly, base, load=push, substeps=20, payloads=payloads)
    momentum, angular, energy = np.zeros((1201, 3)), np.zeros((1201, 3)), np.zeros(1201)
    turn = response.rotation[:, 0]
    for number, (name, body) in enumerate(bodies.items()):
        w, offset, mass = response.body_motion(name, "rates")[:, 3:], response.offset[0, number], response.mass[0, number]
        v = response.body_motion(name, "rates")[:, :3] + np.einsum("nij,nj->ni", turn, np.cross(w, offset))
        place = body.cg + response.body_motion(name, "coordinates")[:, :3] + turn @ offset
        inertia = body.inertia if name == "a" else np.zeros((3, 3))  # a point mass on its guide
        momentum += mass * v
        angular += mass * np.cross(place, v) + np.einsum("nij,nj->ni", turn, w @ inertia.T)
        energy += 0.5 * mass * np.sum(v**2, axis=1) + 0.5 * np.einsum("ni,ij,nj->n", w, inertia, w)
    energy += 0.5 * 4e3 * np.sum(response.mount_array("deflection")[:, 0] ** 2, axis=1)
    gap = np.diff([b.cg + response.body_motion(n, "coordinates")[:, :3] for n, b in bodies.items()], axis=0)[0]
    slid = np.einsum("nji,nj->ni", response.rotation[:, 0], gap) - arm
    assert np.abs(response.coordinates[:, 3:6]).max() > 1.0  # rad
    assert np.abs(slid[:, [AXES.index(a) for a in slides]]).max() > 0.02  # m
    held = [AXES.index(a) for a in AXES if a not in slides]
    np.testing.assert_allclose(slid[:, held], 0.0, atol=1e-9)
    pushed = np.zeros((1201, 3))
    for number, (name, body) in enumerate(bodies.items()):
        force, moment = push[:, 6 * number : 6 * number + 3], push[:, 6 * number + 3 : 6 * number + 6]
        pushed += np.cross(body.cg + response.body_motion(name, "coordinates")[:, :3], force)
        pushed += np.einsum("nij,nj->ni", turn, moment)
    # loads run straight between samples
    np.testing.assert_allclose(angular[25], (pushed.sum(axis=0) - 0.5 * pushed[0]) / 200.0, rtol=2e-3)
    np.testing.assert_allclose(momentum[25], 19.5 * (push[0, :3] + push[0, 6:9]) / 200.0, rtol=1e-3)
    for kept in (momentum, angular, energy):
        np.testing.assert_allclose(kept[25:], np.broadcast_to(kept[25], kept[25:].shape), atol=2e-6 * np.abs(kept[25]).max())


def test_payload_settles_by_its_weight_over_the_stiffness(cab):
    base = BaseMotion.from_displacement(np.zeros((6001, 4, 3)), 200.0)
    payload = Payload("cab", 240.0, np.array([0.1, 0.0, 0.0]), begin=1.0, duration=2.0)
    response = simulate_full_rotation(cab, base, payloads=[payload])
    total = response.mount_force()[-1].sum(axis=0)
    np.testing.assert_allclose(np.linalg.norm(total), 1440.0 * cab.vehicle.gravity, rtol=1e-5)
    stiffness = 2 * 5.2e4 + 2 * 4.2e4
    assert response.coordinates[-1, 2] == pytest.approx(-240.0 * cab.vehicle.gravity / stiffness, rel=0.05)
    np.testing.assert_allclose(response.offset[-1, 0], [0.1 * 240.0 / 1440.0, 0.0, 0.0], rtol=1e-9)
    assert np.abs(response.cg_motion("cab")[-1]).max() < 1e-3  # m/s^2: at rest again
    places = np.array([m.position for m in cab.vehicle.mounts.values()])
    moment = np.cross(places, response.mount_force()[-1]).sum(axis=0)
    weight = -1440.0 * cab.vehicle.gravity * response.rotation[-1, 0, 2, :]
    np.testing.assert_allclose(moment, -np.cross(response.offset[-1, 0], weight), atol=1.0)  # N m of 235
    # linear statics: the eccentric weight on the stiffness matrix; what is left is the payload's own geometric effect
    push = -240.0 * cab.vehicle.gravity * cab.point_map("cab", payload.position)[2]
    static = np.linalg.solve(linearise(cab).stiffness, push)
    np.testing.assert_allclose(response.coordinates[-1, [2, 4]], static[[2, 4]], rtol=0.06)  # m, rad


def test_compiled_model_runs_again_with_other_elements_as_a_fresh_vehicle_would(cab):
    base = BaseMotion.from_displacement(sines(4, 200.0, 3.0), 200.0)
    model = CompiledModel(cab, base, substeps=2)
    first = model.run_raw().qdd.copy()
    key = ("front_left", "z")
    softer = KelvinVoigt(4.0e4, 900.0)
    rubber = element_from_mapping({"kind": "sum", "elements": [
        softer.to_mapping(), {"kind": "maxwell", "stiffness_n_per_m": 2.0e4, "damping_n_s_per_m": 800.0},
        {"kind": "berg_friction", "friction_n": 60.0, "half_stroke_m": 0.0015},
    ]})
    for element in (softer, rubber):
        changed = model.run_raw({key: element}).qdd
        static = cab.static_force
        # without gravity's dependence on the static split the two routes are the same model
        fresh = dataclasses.replace(assemble(cab.vehicle), elements=tuple(
            element if c == key else e for c, e in zip(cab.components, cab.elements)))
        np.testing.assert_allclose(changed, CompiledModel(fresh, base, substeps=2).run_raw().qdd, rtol=1e-12, atol=1e-12)
        assert np.abs(changed - first).max() > 0.01  # m/s^2
        assert static is cab.static_force
    np.testing.assert_array_equal(model.run_raw().qdd, first)


def test_rising_damping_filter_energy_is_dissipated(quarter):
    base = BaseMotion.from_displacement(sines(2, 200.0, 6.0), 200.0)
    friction = element_from_mapping({"kind": "sum", "elements": [
        KelvinVoigt(3.0e5, 2.0e4).to_mapping(), {"kind": "berg_friction", "friction_n": 800.0, "half_stroke_m": 0.001}]})
    response = CompiledModel(quarter, base, substeps=8).run({("suspension", "z"): friction})
    i = quarter.components.index(("suspension", "z"))
    power = response.tension[:, i] * response.rate[:, i]
    spring = 3.0e5 * response.deflection[:, i] * response.rate[:, i]
    damper = 2.0e4 * response.rate[:, i] ** 2
    lost = np.cumsum(power - spring - damper) / 200.0
    assert lost[-1] > 0.5 * 800.0 * 0.5 * np.sum(np.abs(response.rate[:, i])) / 200.0 * 0.1  # J: friction takes energy
    assert lost[-1] < 800.0 * np.sum(np.abs(response.rate[:, i])) / 200.0


def test_base_acceleration_integrates_back_to_its_displacement():
    rate = 200.0
    displacement = sines(1, rate, 60.0)
    acceleration = derivative(derivative(displacement, rate), rate)
    plain = BaseMotion.from_acceleration(acceleration, rate)
    np.testing.assert_allclose(plain.displacement[:1000], displacement[:1000], atol=2e-4)  # m
    drifting = BaseMotion.from_acceleration(acceleration + 0.02, rate)
    assert np.abs(drifting.displacement).max() > 30.0  # m: an offset of 0.02 m/s^2 over 60 s
    filtered = BaseMotion.from_acceleration(acceleration + 0.02, rate, corner_hz=0.2)
    inner = slice(4000, 8000)  # two periods of the corner away from the ends
    error = np.sqrt(np.mean((filtered.displacement[inner] - displacement[inner]) ** 2))
    # the high-pass takes 0.7 % of the lowest line, 0.7 Hz
    assert error < 0.01 * np.sqrt(np.mean(displacement[inner] ** 2))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d[:, :3], "3 mounts; the vehicle has 4"),
        (lambda d: np.where(np.arange(len(d))[:, None, None] == 7, np.nan, d), "12 values are not finite"),
        (lambda d: d[:, :, :2], "allowed: \\(N >= 2, mounts, 3\\)"),
    ],
)
def test_wrong_base_motion_is_refused_with_what_is_allowed(cab, change, message):
    displacement = sines(4, 200.0, 0.2)
    changed = change(displacement)
    with pytest.raises(InputDataError, match=message):
        still = np.zeros_like(changed)
        simulate(cab, BaseMotion(200.0, changed, still, still, still, still, still))


def test_an_unknown_mount_axis_is_refused_with_the_allowed_ones(cab):
    model = CompiledModel(cab, BaseMotion.from_displacement(sines(4, 200.0, 0.2), 200.0))
    with pytest.raises(ConfigurationError, match=r"front_middle\.z: no such mount component; allowed: front_left\.x"):
        model.run({("front_middle", "z"): KelvinVoigt(1.0, 0.0)})


def test_an_unstable_step_is_reported_with_time_and_advice(cab):
    base = BaseMotion.from_displacement(sines(4, 10.0, 60.0), 10.0)
    with pytest.raises(InputDataError, match=r"not finite any more at t = \d+\.\d+ s; take more substeps"):
        simulate(cab, base, substeps=1)


def test_locked_coordinates_are_refused_for_full_rotation(quarter):
    with pytest.raises(ConfigurationError, match="full_rotation: body, axle have locked coordinates"):
        simulate(quarter, BaseMotion.from_displacement(np.zeros((10, 2, 3)), 100.0), full_rotation=True)


def turned_chassis(vehicle, angles, rate):
    """Return the base motion of a chassis that turns as one rigid body about the cab's CG; angles (N, 3)."""
    places = np.array([m.position for m in vehicle.mounts.values()])
    matrices = np.array([rotation_from_rpy(*a) for a in angles])
    displacement = np.einsum("nij,mj->nmi", matrices, places) - places
    return BaseMotion.from_displacement(displacement, rate, np.repeat(angles[:, None, :], len(places), axis=1))


def test_a_cab_without_weight_follows_a_chassis_that_turns_far():
    vehicle = dataclasses.replace(load_vehicle(VEHICLES / "truck_cab.yaml"), gravity=0.0)
    share = np.clip(np.arange(4000) / 1000.0, 0.0, 1.0)
    share = share**3 * (10 - 15 * share + 6 * share**2)
    final = np.array([0.5, -0.4, 1.1])  # rad
    response = simulate(assemble(vehicle), turned_chassis(vehicle, share[:, None] * final, 200.0), full_rotation=True)
    assert np.abs(response.mount_array("deflection")).max() > 1e-3  # m on the way
    np.testing.assert_allclose(response.mount_array("deflection")[-1], 0.0, atol=1e-8)  # m, at rest relative to the chassis
    np.testing.assert_allclose(response.rotation[-1, 0], rotation_from_rpy(*final), atol=1e-8)
    np.testing.assert_allclose(response.rate[-1], 0.0, atol=1e-7)


def test_rates_of_deflection_are_the_derivative_of_the_deflection_when_brackets_turn(cab):
    time = np.arange(2000) / 1000.0
    angles = np.stack([0.3 * np.sin(3 * time), 0.2 * np.sin(4 * time), 0.5 * np.sin(2 * time)], axis=1) * (time**2 / 4)[:, None]
    response = simulate(cab, turned_chassis(cab.vehicle, angles, 1000.0), full_rotation=True)
    numeric = np.gradient(response.deflection, 1e-3, axis=0)[5:-5]
    np.testing.assert_allclose(response.rate[5:-5], numeric, atol=2e-3 * np.abs(numeric).max())  # m/s


def test_a_tilted_bracket_tilts_its_accelerometer(cab):
    angles = np.zeros((50, 3))
    angles[:, 0] = 0.1  # rad of roll, standing
    base = turned_chassis(cab.vehicle, angles, 200.0)
    g = cab.vehicle.gravity
    for full in (False, True):
        reading = simulate(cab, base, full_rotation=full).specific_force("chassis_rear_left")[0]
        exact = [0.0, g * np.sin(0.1), g * np.cos(0.1)]
        np.testing.assert_allclose(reading, exact, atol=1e-9)  # m/s^2


def test_accelerometers_read_the_second_derivative_of_their_place_and_gravity(cab):
    base = BaseMotion.from_displacement(sines(4, 1000.0, 3.0, scale=0.05), 1000.0)
    response = simulate(cab, base, full_rotation=True)
    for name in ("cab_front_left", "cab_rear_right"):
        arm = cab.vehicle.sensors[name].position
        place = response.coordinates[:, :3] + response.rotation[:, 0] @ arm
        acceleration = derivative(derivative(place, 1000.0), 1000.0) + np.array([0.0, 0.0, cab.vehicle.gravity])
        expected = np.einsum("nji,nj->ni", response.rotation[:, 0], acceleration)[10:-10]
        omega = np.abs(response.rates[:, 3:]).max()
        assert omega**2 * np.linalg.norm(arm) > 0.1  # m/s^2: centripetal terms matter in this run
        np.testing.assert_allclose(response.specific_force(name)[10:-10], expected, atol=2e-3)  # m/s^2
