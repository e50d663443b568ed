# Copyright 2026 ride_estimation contributors
"""Assembly against matrices derived by hand (documents 000, 001, 002) and against physics."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.diagnosis.model.plant import gravity_stiffness_of, static_forces
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.errors import ConfigurationError
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.modes import frequency_response, linearise, modes, undamped_modes
from ride_estimation.vehicles.two_axle_truck import TruckData, two_axle_truck
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

VEHICLES = Path(__file__).parents[2] / "config" / "vehicles"


def load(name):
    return load_vehicle(VEHICLES / f"{name}.yaml")


def element(vehicle, mount):
    return vehicle.mounts[mount].elements["z"]


def test_quarter_car_has_the_matrices_of_document_002_with_the_tyre_damper_corrected():
    model = linearise(assemble(load("quarter_car")))
    ks, kt, cs, ct = 3.0e5, 1.0e6, 2.0e4, 500.0
    np.testing.assert_allclose(model.mass, np.diag([2500.0, 310.0]))
    np.testing.assert_allclose(model.stiffness, [[ks, -ks], [-ks, ks + kt]], rtol=1e-12)
    # printed eq. (3) feeds the tyre damper with the body speed: entry [1, 0] would be -cs + ct, not symmetric
    np.testing.assert_allclose(model.damping, [[cs, -cs], [-cs, cs + ct]], rtol=1e-12)


def test_quarter_car_total_inertia_force_is_the_tyre_force():
    assembly = assemble(load("quarter_car"))
    tyre = assembly.components.index(("tyre", "z"))
    tension = np.array([123.0, -45.0])
    force = -assembly.deflection_map.T @ tension
    assert force.sum() == pytest.approx(-tension[tyre], abs=1e-9)  # N


def test_body_velocity_alone_gives_no_tyre_force():
    """Row 2-1: as printed the tyre damper would see the body; force of every element at a velocity of the body of 1 m/s."""
    assembly = assemble(load("quarter_car"))
    rate = assembly.deflection_map @ np.array([1.0 if body == "body" else 0.0 for body, _ in assembly.coordinates])
    tension = dict(zip(assembly.components, (e.force(e.initial(), 0.0, float(v)) for e, v in zip(assembly.elements, rate))))
    assert tension[("tyre", "z")] == 0.0
    assert tension[("suspension", "z")] == pytest.approx(2.0e4)  # N


def test_quarter_car_modes_are_those_of_the_literature_set():
    found = modes(linearise(assemble(load("quarter_car"))))
    assert [m.label for m in found] == ["body bounce", "axle bounce"]
    # ride_models section 2.3: 1.59 Hz damping 0.25, 9.9 Hz damping 0.56
    np.testing.assert_allclose([m.frequency_hz for m in found], [1.59, 9.9], rtol=0.01)
    np.testing.assert_allclose([m.damping_ratio for m in found], [0.25, 0.56], atol=0.01)


def planar_matrix(vehicle, number):
    """Return K (number=0) or C (number=1) of document 001 eq. (3.24) written out by hand."""
    kf, kr, ks = (
        (e.stiffness, e.damping)[number] for e in (element(vehicle, m) for m in ("front_mount", "rear_mount", "seat_suspension"))
    )
    b, length_minus_b, b_minus_a = 0.640, 0.61066, -0.382
    return np.array([
        [kf + kr + ks, -b * kf + length_minus_b * kr - ks * b_minus_a, -ks],
        [
            kr * length_minus_b - kf * b - ks * b_minus_a,
            kr * length_minus_b**2 + kf * b**2 + ks * b_minus_a**2,
            ks * b_minus_a,
        ],
        [-ks, ks * b_minus_a, ks],
    ])


@pytest.mark.parametrize("name", ["planar_cab_seat_set_a", "planar_cab_seat_set_b"])
def test_planar_cab_with_seat_has_the_matrices_of_document_001(name):
    vehicle = load(name)
    model = linearise(assemble(vehicle))
    assert model.assembly.coordinates == (("cab", "z"), ("cab", "pitch"), ("seat", "z"))
    np.testing.assert_allclose(model.stiffness, planar_matrix(vehicle, 0), rtol=1e-10, atol=1e-6)
    np.testing.assert_allclose(model.damping, planar_matrix(vehicle, 1), rtol=1e-10, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "stated"), [("planar_cab_seat_set_a", [1.0, 4.508, 21.7]), ("planar_cab_seat_set_b", [1.0, 4.5, 21.7])]
)
def test_both_assumed_sets_reach_the_modes_document_001_states(name, stated):
    """Row 1-19; stiffness of the sets is given to three figures, 0.05 % of a frequency. The document states 1.0, 4.5, 21.7 Hz."""
    found = [m.frequency_hz for m in undamped_modes(linearise(assemble(load(name))))]
    np.testing.assert_allclose(found, stated, rtol=5e-4)


def machine_state_matrix(vehicle, misprints=False):
    """Return the cab bounce row of the 10-state matrix of document 001 (3.44), as printed or corrected.

    States y3 y3' th3 th3' y1 y1' th1 th1' y2 y2'; the row is the cab's vertical acceleration.
    """
    kf, kr, ks = (element(vehicle, m).stiffness for m in ("front_mount", "rear_mount", "seat_suspension"))
    cf, cr, cs = (element(vehicle, m).damping for m in ("front_mount", "rear_mount", "seat_suspension"))
    mass = vehicle.bodies["cab"].mass.value
    inertia = vehicle.bodies["machine"].inertia[1, 1]
    centre = vehicle.bodies["machine"].cg[0]
    b, l_b, b_a = 0.640, 0.61066, -0.382
    g_d, e_g = 0.640 - centre, 0.61066 + centre
    row = np.array([
        kf + kr, cf + cr, -kf * g_d + kr * e_g, -cf * g_d + cr * e_g, -kf - kr - ks, -cf - cr - cs,
        kf * b - kr * l_b + ks * b_a, cf * b - cr * l_b + cs * b_a, ks, cs,
    ]) / mass
    if misprints:
        row[0] = (kr + kr) / mass  # R(6,1) as printed
        row[5] = (-cf * g_d + cr * e_g) / inertia  # S(6,3) as printed
    return row


@pytest.mark.parametrize("name", ["planar_machine_set_a", "planar_machine_set_b"])
def test_planar_machine_has_the_corrected_cab_row_of_document_001(name):
    vehicle = load(name)
    model = linearise(assemble(vehicle))
    a, _ = model.state_space()
    order = [("machine", "z"), ("machine", "pitch"), ("cab", "z"), ("cab", "pitch"), ("seat", "z")]
    index = [model.assembly.coordinates.index(c) for c in order]
    columns = [i for k in index for i in (k, 5 + k)]
    ours = a[5 + model.assembly.coordinates.index(("cab", "z")), columns]
    np.testing.assert_allclose(ours, machine_state_matrix(vehicle), rtol=1e-9, atol=1e-9)


def test_equal_heave_of_all_bodies_gives_no_cab_acceleration():
    vehicle = load("planar_machine_set_b")
    model = linearise(assemble(vehicle))
    heave = np.array([1.0 if c == "z" else 0.0 for _, c in model.assembly.coordinates])
    cab = [i for i, (b, _) in enumerate(model.assembly.coordinates) if b in ("cab", "seat")]
    for matrix in (model.stiffness, model.damping):
        acceleration = np.linalg.solve(model.mass, matrix @ heave)
        assert np.abs(acceleration[cab]).max() < 1e-12  # m/s^2 per m and per m/s
    # and the misprinted row does not pass the same test
    state = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    assert abs(machine_state_matrix(vehicle, misprints=True) @ state) > 1.0  # m/s^2 per m/s
    assert abs(machine_state_matrix(vehicle) @ state) < 1e-12


def symmetric_cab(height, gravity=0.0):
    """Return a cab on four equal corner mounts at z = -height."""
    mounts = {}
    for i, (x, y) in enumerate([(0.8, 0.5), (0.8, -0.5), (-0.8, 0.5), (-0.8, -0.5)]):
        axes = {"x": KelvinVoigt(4e5, 0.0), "y": KelvinVoigt(3e5, 0.0), "z": KelvinVoigt(5e4, 0.0)}
        mounts[f"m{i}"] = Mount(f"m{i}", np.array([x, y, -height]), "cab", "chassis", axes)
    body = Body("cab", Prior(1200.0), np.zeros(3), np.diag([730.0, 540.0, 810.0]))
    return Vehicle("cab", {"cab": body}, mounts, {}, gravity=gravity)


def test_level_symmetric_mounts_follow_the_closed_forms_of_document_000():
    found = {m.label: m.frequency_hz for m in undamped_modes(linearise(assemble(symmetric_cab(0.0))))}
    two_pi = 2.0 * np.pi
    expected = {
        "fore-aft": np.sqrt(4 * 4e5 / 1200.0) / two_pi,
        "lateral": np.sqrt(4 * 3e5 / 1200.0) / two_pi,
        "bounce": np.sqrt(4 * 5e4 / 1200.0) / two_pi,
        "roll": np.sqrt(4 * 5e4 * 0.5**2 / 730.0) / two_pi,
        "pitch": np.sqrt(4 * 5e4 * 0.8**2 / 540.0) / two_pi,
        # eq. (11) corrected: it repeats pitch in print
        "yaw": np.sqrt(4 * (4e5 * 0.5**2 + 3e5 * 0.8**2) / 810.0) / two_pi,
    }
    for label, value in expected.items():
        assert found[label] == pytest.approx(value, rel=1e-9), label


def test_gravity_lowers_roll_and_pitch_stiffness_by_weight_times_height():
    h, g = 0.7, 9.80665
    with_gravity = linearise(assemble(symmetric_cab(h, g))).stiffness
    without = linearise(assemble(symmetric_cab(h))).stiffness
    change = with_gravity - without
    expected = np.zeros((6, 6))
    expected[3, 3] = expected[4, 4] = -1200.0 * g * h  # N m/rad
    np.testing.assert_allclose(change, expected, atol=1e-6)


@pytest.mark.parametrize("name", ["truck_cab", "quarter_car", "planar_machine_set_b"])
def test_static_loads_carry_the_weight_without_moment(name):
    assembly = assemble(load(name))
    vehicle = assembly.vehicle
    for body in vehicle.bodies.values():
        force, moment = np.zeros(3), np.zeros(3)
        for f, mount in zip(assembly.static_force, vehicle.mounts.values()):
            sign = 1.0 if mount.body == body.name else -1.0 if mount.base == body.name else 0.0
            force += sign * f
            moment += sign * np.cross(mount.position - body.cg, f)
        assert force[2] == pytest.approx(body.mass.value * vehicle.gravity, rel=1e-9)  # N
        if "pitch" in body.coordinates:
            assert abs(moment[1]) < 1e-6  # N m


def test_matrices_of_a_truck_of_many_bodies_are_symmetric_and_its_modes_damped():
    model = linearise(assemble(two_axle_truck(TruckData())))
    scale = np.abs(model.stiffness).max()
    # gravity included: the geometric stiffness of a chain of bodies must come from a potential
    np.testing.assert_allclose(model.stiffness, model.stiffness.T, atol=1e-9 * scale)
    assert all(m.damping_ratio > 0.0 for m in modes(model))


def test_energy_shares_sum_to_one_and_name_the_mode():
    for mode in modes(linearise(assemble(load("truck_cab")))):
        assert sum(mode.energy_share.values()) == pytest.approx(1.0, abs=1e-9)
    labels = [m.label for m in modes(linearise(assemble(load("truck_cab"))))]
    assert sorted(labels) == sorted(["bounce", "pitch", "roll", "fore-aft", "lateral", "yaw"])


def test_frequency_response_equals_the_state_space():
    assembly = assemble(load("truck_cab"))
    a, b = linearise(assembly).state_space()
    frequency = np.array([0.5, 2.05, 17.0])
    response = frequency_response(assembly, frequency)
    c = len(assembly.components)
    for number, f in enumerate(frequency):
        s = 2j * np.pi * f
        state = np.linalg.solve(s * np.eye(12) - a, b[:, :c] + s * b[:, c:])
        np.testing.assert_allclose(response[number], state[:6], rtol=1e-8, atol=1e-12)


def test_a_body_without_vertical_mount_is_refused_by_name():
    vehicle = symmetric_cab(0.3, 9.81)
    mounts = {
        n: dataclasses.replace(m, elements={k: v for k, v in m.elements.items() if k != "z"}) for n, m in vehicle.mounts.items()
    }
    with pytest.raises(ConfigurationError, match="nothing holds cab against the weight"):
        assemble(dataclasses.replace(vehicle, mounts=mounts))


def test_a_mount_on_an_unknown_body_is_refused_with_the_allowed_names():
    vehicle = symmetric_cab(0.3)
    wrong = dataclasses.replace(vehicle.mounts["m0"], body="cabin")
    with pytest.raises(ConfigurationError, match=r"mounts\.m0\.body: 'cabin'; allowed: cab"):
        assemble(dataclasses.replace(vehicle, mounts={**vehicle.mounts, "m0": wrong}))


def test_a_truck_with_its_axles_exchanged_is_refused():
    with pytest.raises(ConfigurationError, match="rear_axle_x"):
        TruckData(front_axle_x=-4.0, rear_axle_x=0.0)


def test_a_rear_joint_locked_fore_and_aft_adds_the_mass_at_its_height_to_the_pitch_inertia():
    # the multibody model of document 001 has no fore-aft freedom at the rear joint, 0.676 m below the CG:
    # pitch inertia 557 becomes 839 kg m^2 and its modes 3.86 / 20.6 Hz, not those of the analytic model (4.5 / 21.7 Hz)
    vehicle = load("planar_cab_seat_set_b")
    cab = dataclasses.replace(vehicle.bodies["cab"], coordinates=("x", "z", "pitch"))
    mounts = dict(vehicle.mounts)
    for name in ("front_mount", "rear_mount"):
        low = np.array([mounts[name].position[0], 0.0, -0.676])
        mounts[name] = dataclasses.replace(mounts[name], position=low)
    rear = mounts["rear_mount"]
    mounts["rear_mount"] = dataclasses.replace(rear, elements={**rear.elements, "x": KelvinVoigt(1e10, 0.0)})
    # the document has the seat go up and down only, also while the cab turns: at the height of the joint it does
    seat = dataclasses.replace(vehicle.bodies["seat"], cg=np.array([-0.382, 0.0, -0.676]))
    locked = dataclasses.replace(vehicle, bodies={**vehicle.bodies, "cab": cab, "seat": seat}, mounts=mounts, gravity=0.0)
    found = [m.frequency_hz for m in undamped_modes(linearise(assemble(locked)))]
    np.testing.assert_allclose(found[1:3], [3.86, 20.6], rtol=0.01)  # Hz

    inertia = vehicle.bodies["cab"].inertia.copy()
    inertia[1, 1] += vehicle.bodies["cab"].mass.value * 0.676**2
    assert inertia[1, 1] == pytest.approx(839.0, abs=1.0)  # kg m^2
    heavier = dataclasses.replace(vehicle.bodies["cab"], inertia=inertia)
    rotating = dataclasses.replace(vehicle, bodies={**vehicle.bodies, "cab": heavier})
    same = [m.frequency_hz for m in undamped_modes(linearise(assemble(rotating)))]
    np.testing.assert_allclose(found[1:3], same[1:3], rtol=1e-3)


def test_a_seat_that_only_moves_up_and_down_goes_sideways_and_turns_with_its_cab():
    vehicle = symmetric_cab(0.3)
    carrier = vehicle.bodies["cab"]
    place = carrier.cg + np.array([0.2, -0.3, 0.4])
    body = Body("seat", Prior(90.0), place, np.eye(3), coordinates=("z",))
    guide = Mount("seat_mount", place, "seat", "cab", {"z": KelvinVoigt(9e3, 400.0)})
    seated = assemble(dataclasses.replace(
        vehicle, bodies={**vehicle.bodies, "seat": body}, mounts={**vehicle.mounts, "seat_mount": guide}
    ))
    bare = assemble(vehicle)
    index = [seated.coordinates.index(c) for c in bare.coordinates]
    added = seated.mass_matrix[np.ix_(index, index)] - bare.mass_matrix
    sideways = np.zeros((3, 6))  # a point mass 0.4 m above and 0.3 m beside the CG, free along z
    sideways[0, [0, 4, 5]] = 1.0, 0.4, 0.3
    sideways[1, [1, 3, 5]] = 1.0, -0.4, 0.2
    np.testing.assert_allclose(added, 90.0 * sideways.T @ sideways, atol=1e-9)
    np.testing.assert_allclose(seated.mass_matrix[-1], [0.0] * 6 + [90.0], atol=1e-9)


def test_the_weight_of_a_seat_acts_at_its_cg_when_the_cab_turns_in_the_diagnosis_too():
    vehicle = load("truck_cab")
    place = np.array([-0.2, 0.3, 0.4])
    guide = Mount("seat_mount", place - [0.0, 0.0, 0.3], "seat", "cab", {"z": KelvinVoigt(9e3, 400.0)})
    seated = dataclasses.replace(
        vehicle, bodies={**vehicle.bodies, "seat": Body("seat", Prior(90.0), place, np.eye(3), coordinates=("z",))},
        mounts={**vehicle.mounts, "seat_mount": guide},
    )  # fmt: skip
    found = []
    for one in (vehicle, seated):
        coordinates, mounts = assemble(one).coordinates, tuple(one.mounts)
        matrix = gravity_stiffness_of(one, mounts, static_forces(one, mounts, tuple(one.bodies)), coordinates)
        found.append([matrix[i, i] for i, c in enumerate(coordinates) if c in (("cab", "roll"), ("cab", "pitch"))])
    # its weight rests on the mounts of the cab, 0.45 m below the CG, and pulls at its own, 0.4 m above
    np.testing.assert_allclose(np.subtract(found[1], found[0]), 90.0 * vehicle.gravity * (-0.45 - 0.4), rtol=1e-9)
