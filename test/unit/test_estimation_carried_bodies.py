# Copyright 2026 ride_estimation contributors
"""Bodies the estimated body carries: reaction against closed forms, point masses and the vehicle simulation; what is left out."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.forces.carried_bodies import CarriedBodies
from ride_estimation.estimation.motion.loads import InertialLoads
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.frames import COORDINATES
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.simulation.simulate import simulate
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.vehicle import Body, Mount, Prior

TRUCK = load_vehicle(Path(__file__).parents[2] / "config" / "vehicles" / "truck_cab.yaml")
RATE, GRAVITY = 200.0, TRUCK.gravity
PLACE = TRUCK.bodies["cab"].cg + np.array([-0.3, 0.45, 0.1])
SEAT = Body("seat", Prior(110.0), PLACE, np.diag([6.0, 7.0, 4.0]), coordinates=("z",))
SPRING = Mount("suspension", PLACE - np.array([0.05, 0.0, 0.3]), "seat", "cab", {"z": KelvinVoigt(4375.0, 400.0)})


def truck_with(*bodies, mounts=()):
    more = {b.name: b for b in bodies}
    return dataclasses.replace(
        TRUCK, bodies={**TRUCK.bodies, **more}, mounts={**TRUCK.mounts, **{m.name: m for m in mounts}}, force_references=()
    )


def carried(vehicle, **settings):
    return CarriedBodies(geometry_of(vehicle), PipelineSettings(**settings))


def random_motion(seconds=6.0, seed=3):
    rng = np.random.default_rng(seed)
    sos = signal.butter(2, [0.5, 12.0], "bandpass", fs=RATE, output="sos")
    scale = np.array([0.6, 0.8, 1.5, 1.2, 1.0, 0.5, 0.2, 0.15, 0.1])
    noise = 4.0 * scale * signal.sosfilt(sos, rng.standard_normal((int(seconds * RATE), 9)), axis=0)
    noise[0] = 0.0  # from rest
    noise[:, 2] += GRAVITY
    return noise[:, :6], noise[:, 6:]


def reaction(bodies, motion, rate, block=10):
    still = np.zeros((block, 6))
    parts = [
        bodies.added_to(still[: len(motion[i : i + block])], motion[i : i + block], rate[i : i + block], 1.0, 1.0 / RATE)
        for i in range(0, len(motion), block)
    ]
    return np.concatenate(parts)


def test_the_seat_moves_like_one_degree_of_freedom_as_uncertain_as_the_file():
    """Acceleration of the seat by ``scipy.signal.lsim``; a spring twice as uncertain doubles the standard deviation."""
    motion, rate = random_motion()
    arm = PLACE - TRUCK.bodies["cab"].cg
    at_seat = motion[:, 2] + motion[:, 3] * arm[1] - motion[:, 4] * arm[0] + np.cross(rate, np.cross(rate, arm))[:, 2]
    m, k, c = 110.0, 4375.0, 400.0
    passed = signal.lsim(([c, k], [m, c, k]), at_seat - GRAVITY, np.arange(len(motion)) / RATE)[1] + GRAVITY
    spread = {}
    for std in (1e-4, 2e-4):
        spring = dataclasses.replace(SPRING, priors={("z", "stiffness"): Prior(k, std * k), ("z", "damping"): Prior(c, 1e-9)})
        moved, spread[std] = carried(truck_with(SEAT, mounts=[spring])).motions(motion, rate, 1.0 / RATE)["seat"]
        np.testing.assert_allclose(moved[:, 2], passed, atol=1e-6 * GRAVITY)
    np.testing.assert_allclose(spread[2e-4][:, 2], 2.0 * spread[1e-4][:, 2], atol=2e-3 * spread[2e-4][:, 2].max())
    step = 1e-3
    moved = [
        signal.lsim(([c, f * k], [m, c, f * k]), at_seat - GRAVITY, np.arange(len(motion)) / RATE)[1] for f in (1.0 + step, 1.0)
    ]
    change = np.abs(moved[0] - moved[1])
    np.testing.assert_allclose(spread[1e-4][:, 2] * 10.0, change, atol=0.01 * change.max())
    assert carried(TRUCK).motions(motion, rate, 1.0 / RATE) == {}


def test_a_seat_on_its_spring_answers_like_one_degree_of_freedom():
    """Force on the cab by ``scipy.signal.lsim`` of ``(c s + k) / (m s^2 + c s + k)`` on the acceleration below the seat."""
    motion, rate = random_motion()
    arm = PLACE - TRUCK.bodies["cab"].cg
    at_seat = motion[:, 2] + motion[:, 3] * arm[1] - motion[:, 4] * arm[0]
    spin = np.cross(rate, np.cross(rate, arm))[:, 2]
    m, k, c = 110.0, 4375.0, 400.0
    passed = signal.lsim(([c, k], [m, c, k]), at_seat + spin - GRAVITY, np.arange(len(motion)) / RATE)[1]
    found = reaction(carried(truck_with(SEAT, mounts=[SPRING])), motion, rate)
    np.testing.assert_allclose(found[:, 2], m * (passed + GRAVITY), atol=1e-6 * m * GRAVITY)
    # it cannot turn: its own inertia, which a file need not state, takes no part
    heavy = dataclasses.replace(SEAT, inertia=100.0 * SEAT.inertia)
    np.testing.assert_array_equal(reaction(carried(truck_with(heavy, mounts=[SPRING])), motion, rate), found)
    # sideways the seat is a mass fastened to the cab
    side = motion[:, 1] + motion[:, 5] * arm[0] - motion[:, 3] * arm[2] + np.cross(rate, np.cross(rate, arm))[:, 1]
    np.testing.assert_allclose(found[:, 1], m * side, atol=1e-9 * m * GRAVITY)


def test_a_stiffly_held_body_is_a_heap_of_point_masses():
    """Six points on the axes of a body have its mass and inertia; every spring 1e9 N/m; all six components of the wrench."""
    mass, inertia = 80.0, np.array([9.0, 11.0, 8.0])
    half = np.sqrt(0.5 * (inertia.sum() / 2.0 - inertia) / (mass / 6.0))
    box = Body("box", Prior(mass), PLACE, np.diag(inertia))
    stiff = Mount("bolts", PLACE, "box", "cab", {a: KelvinVoigt(1e9, 1e6) for a in ("x", "y", "z", "roll", "pitch", "yaw")})
    motion, rate = random_motion()
    arm, wanted = PLACE - TRUCK.bodies["cab"].cg, np.zeros((len(motion), 6))
    for axis in range(3):
        for sign in (-1.0, 1.0):
            r = arm + sign * half[axis] * np.eye(3)[axis]
            force = mass / 6.0 * (motion[:, :3] + np.cross(motion[:, 3:], r) + np.cross(rate, np.cross(rate, r)))
            wanted += np.hstack([force, np.cross(r, force)])
    found = reaction(carried(truck_with(box, mounts=[stiff])), motion, rate)[200:]
    np.testing.assert_allclose(found, wanted[200:], atol=2e-4 * np.abs(wanted).max())  # yields: (2 pi 12)^2 m / k = 5e-4


def test_mounts_carry_what_the_vehicle_simulation_says():
    """Cab and a seat free in all six coordinates on four rough bases, finite rotations: wrench of the mounts, cab axes."""
    spring = dataclasses.replace(SPRING, elements={
        "x": KelvinVoigt(9e3, 300.0), "y": KelvinVoigt(2e4, 400.0), "z": KelvinVoigt(4375.0, 400.0),
        "roll": KelvinVoigt(4e3, 90.0), "pitch": KelvinVoigt(3e3, 90.0), "yaw": KelvinVoigt(5e3, 90.0),
    })  # fmt: skip
    vehicle = truck_with(dataclasses.replace(SEAT, coordinates=COORDINATES), mounts=[spring])
    cab = vehicle.bodies["cab"]
    probe = Sensor("probe", "accelerometer", "", "cab", position=cab.cg)
    sos = signal.butter(2, [0.5, 8.0], "bandpass", fs=RATE, output="sos")
    noise = signal.sosfilt(sos, np.random.default_rng(8).standard_normal((1600, 5, 3)), axis=0)
    noise[:, 4] = 0.0
    fade = np.minimum(np.arange(1600) / 200.0, 1.0)[:, None, None] ** 3
    world = dataclasses.replace(vehicle, sensors={**vehicle.sensors, "probe": probe})
    base = BaseMotion.from_displacement(5e-3 * fade * noise * [0.3, 0.3, 1.0], RATE)
    response = simulate(assemble(world), base, full_rotation=True)
    motion = np.hstack([response.specific_force("probe"), response.body_motion("cab")[:, 3:]])
    rate = response.body_motion("cab", "rates")[:, 3:]
    load = InertialLoads.of(cab).load(motion, rate)
    found = carried(vehicle).added_to(load, motion, rate, 1.0, 1.0 / RATE)
    arms = np.array([m.position for m in TRUCK.mounts.values()]) - cab.cg
    force = response.mount_force()[:, :4]
    wanted = np.hstack([force.sum(axis=1), np.cross(arms, force).sum(axis=1)])
    seat = np.std((load - wanted)[400:], axis=0)
    # 1 % of what the seat does: relative rotations are small here, Coriolis terms left out
    assert np.all(np.std((found - wanted)[400:], axis=0) < 0.01 * seat), np.std((found - wanted)[400:], axis=0) / seat
    assert np.all(seat > 0.01 * np.std(wanted[400:], axis=0))
    np.testing.assert_allclose(np.mean((found - wanted)[400:], axis=0), 0.0, atol=0.1)  # N, N m: the weight of the seat is in


def test_blocks_of_any_length_give_the_same_bytes_and_a_saved_state_goes_on():
    motion, rate = random_motion(2.0)
    vehicle = truck_with(SEAT, mounts=[SPRING])
    one, ten = (reaction(carried(vehicle), motion, rate, block) for block in (1, 10))
    np.testing.assert_array_equal(one, ten)
    first, second = carried(vehicle), carried(vehicle)
    reaction(first, motion[:200], rate[:200])
    second.load(first.save())
    np.testing.assert_array_equal(reaction(first, motion[200:], rate[200:]), reaction(second, motion[200:], rate[200:]))


def test_the_stated_covariance_is_that_of_the_numbers_of_the_file():
    """Seats drawn from the stated 20 % of mass, stiffness, damping: scatter of their reactions against the covariance."""
    motion, rate = random_motion(12.0)
    relative, drawn = 0.2, []
    known = dataclasses.replace(SPRING, priors={
        ("z", n): Prior(v, relative * v) for n, v in (("stiffness", 4375.0), ("damping", 400.0))
    })
    body = dataclasses.replace(SEAT, mass=Prior(110.0, relative * 110.0))
    stated = carried(truck_with(body, mounts=[known]))
    middle = reaction(stated, motion, rate)
    rng = np.random.default_rng(2)
    for _ in range(30):
        m, k, c = np.array([110.0, 4375.0, 400.0]) * np.exp(relative * rng.standard_normal(3))
        spring = dataclasses.replace(SPRING, elements={"z": KelvinVoigt(k, c)})
        seat = dataclasses.replace(SEAT, mass=Prior(m))
        drawn.append(reaction(carried(truck_with(seat, mounts=[spring])), motion, rate, 600)[1000:] - middle[1000:])
    # of the moving part: a seat that is heavier at rest is in the standard deviation of the mass
    scatter = np.sqrt(np.mean(np.var(np.array(drawn), axis=1), axis=0))
    std = np.sqrt(np.diag(stated.covariance))
    assert geometry_of(truck_with(body, mounts=[known])).carried_mass_std == pytest.approx(22.0)
    # 30 draws: 13 % scatter; the covariance looks back over the last seconds only and is of first order
    np.testing.assert_allclose(std[2:5], scatter[2:5], rtol=0.35)


def test_the_mounts_of_a_standing_truck_carry_cab_and_seat_with_their_moments():
    vehicle = truck_with(SEAT, mounts=[SPRING])
    total = geometry_of(vehicle)
    arm = PLACE - TRUCK.bodies["cab"].cg
    assert total.file_mass == pytest.approx(TRUCK.bodies["cab"].mass.value + 110.0)
    np.testing.assert_allclose(
        total.weight, GRAVITY * np.array([0.0, 0.0, total.file_mass, 110.0 * arm[1], -110.0 * arm[0], 0.0]), atol=1e-9
    )
    static = Pipeline(vehicle)._forces.static_force
    np.testing.assert_allclose(np.hstack([
        static.sum(axis=0), np.cross(total.arms, static).sum(axis=0)
    ]), total.weight, atol=1e-6 * total.weight[2])
    assert total.ignored == ()


def test_bodies_that_are_not_only_carried_or_not_held_are_left_out_and_named():
    engine = Body("engine", Prior(300.0), PLACE, np.eye(3), coordinates=("z",))
    both = [
        Mount("left", PLACE, "engine", "cab", {"z": KelvinVoigt(1e5, 100.0)}),
        Mount("right", PLACE, "engine", "chassis", {"z": KelvinVoigt(1e5, 100.0)}),
    ]
    loose = dataclasses.replace(SEAT, coordinates=("x", "z"))
    cases = (
        (truck_with(engine, mounts=both), "engine is fastened to cab and to chassis"),
        (truck_with(loose, mounts=[SPRING]), "seat on cab does not stand by the vehicle file"),
    )
    for vehicle, words in cases:
        found = geometry_of(vehicle)
        assert found.carried is None
        assert words in found.ignored[0]
        assert any(words in m for m in Pipeline(vehicle).health().messages)
    assert geometry_of(TRUCK).carried is None
    assert geometry_of(TRUCK).ignored == ()


def test_a_driver_on_a_seat_hangs_on_the_cab_through_it():
    driver = Body("driver", Prior(75.0), PLACE + np.array([0.0, 0.0, 0.4]), np.diag([5.0, 5.0, 2.0]), coordinates=("z",))
    cushion = Mount("cushion", PLACE, "driver", "seat", {"z": KelvinVoigt(6e4, 900.0)})
    # the base of a mount may be written as its body: what hangs on what is the same
    turned = dataclasses.replace(SPRING, body="cab", base="seat")
    vehicle = truck_with(dataclasses.replace(SEAT, mass=Prior(35.0)), driver, mounts=[turned, cushion])
    motion, rate = random_motion()
    found = reaction(carried(vehicle), motion, rate)
    assert geometry_of(vehicle).file_mass == pytest.approx(TRUCK.bodies["cab"].mass.value + 110.0)
    # transmissibility of two masses in series by hand at one frequency, from a pure heave
    omega = 2.0 * np.pi * 2.0
    t = np.arange(6000) / RATE
    heave = np.zeros((len(t), 6))
    heave[:, 2] = GRAVITY + np.sin(omega * t)
    force = reaction(carried(vehicle), heave, np.zeros((len(t), 3)), 600)[4000:, 2] - 110.0 * GRAVITY
    s = 1j * omega
    lower, upper = 4375.0 + s * 400.0, 6e4 + s * 900.0
    dynamic = np.array([[35.0 * s * s + lower + upper, -upper], [-upper, 75.0 * s * s + upper]])
    moved = np.linalg.solve(dynamic, np.array([lower, 0.0]))
    wanted = abs(np.array([35.0, 75.0]) @ moved)
    assert np.std(force) * np.sqrt(2.0) == pytest.approx(wanted, rel=2e-3)
    assert np.all(np.isfinite(found))
