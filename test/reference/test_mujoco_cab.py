# Copyright 2026 ride_estimation contributors
"""Assembly and simulation of the six-degree-of-freedom cab against MuJoCo."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from ride_estimation.elements.registry import element_from_mapping
from ride_estimation.estimation.offline import run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.simulation.base_motion import BaseMotion
from ride_estimation.simulation.simulate import simulate
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.modes import linearise, undamped_modes

pytest.importorskip("mujoco")
import mujoco_cab as oracle

TRUCK_CAB = Path(__file__).parents[2] / "config" / "vehicles" / "truck_cab.yaml"
RATE = 1000.0
CUBIC = 2.0e7  # N/m^3: at 80 mm the cubic force is twice the linear one


@pytest.fixture(scope="module")
def assembly():
    return assemble(load_vehicle(TRUCK_CAB))


def rough_bases(scale, seconds=4.0, seed=0):
    noise = np.random.default_rng(seed).standard_normal((int(seconds * RATE), 4, 3))
    filtered = signal.sosfilt(signal.butter(2, [0.7, 20.0], "bandpass", fs=RATE, output="sos"), noise, axis=0)
    return scale * filtered * np.array([4.0, 4.0, 20.0])


def compare(assembly, acceleration, full_rotation, cubic=None):
    """Return the relative RMS difference of the six cab accelerations, ours in MuJoCo's axes."""
    model = oracle.cab_model(assembly.vehicle, assembly.static_force, 1.0 / RATE)
    base, rate, cab, rotation, theirs = oracle.drive(model, acceleration, cubic)
    still = np.zeros_like(base)
    used = assembly
    if cubic is not None:
        spring = {"kind": "cubic_spring", "stiffness_n_per_m": 0.0, "cubic_n_per_m3": CUBIC}
        used = assembly.with_elements({
            key: element_from_mapping({"kind": "sum", "elements": [element.to_mapping(), spring]})
            for key, element in zip(assembly.components, assembly.elements)
        })
    response = simulate(used, BaseMotion(RATE, base, rate, acceleration, still, still, still), full_rotation=full_rotation)
    ours = response.accelerations.copy()
    if full_rotation:
        ours[:, :3] = np.einsum("nij,nj->ni", response.rotation[:, 0], ours[:, :3])
        np.testing.assert_allclose(response.rotation[:, 0], rotation, atol=2e-5)  # rad
    np.testing.assert_allclose(response.coordinates[:, :3], cab, atol=0.005 * np.abs(cab).max())  # 0.5 % of the peak
    return np.linalg.norm(ours - theirs, axis=0) / np.linalg.norm(theirs, axis=0), response


def test_eigenfrequencies_agree_with_mujoco_within_a_tenth_of_a_percent(assembly):
    model = oracle.cab_model(assembly.vehicle, assembly.static_force, 1.0 / RATE)
    ours = [m.frequency_hz for m in undamped_modes(linearise(assembly))]
    # includes gravity, coupling through the CG height and the products of inertia
    np.testing.assert_allclose(ours, oracle.eigenfrequencies(model), rtol=1e-3)


@pytest.mark.parametrize("cubic", [None, np.full((4, 3), CUBIC)], ids=["linear mounts", "cubic mounts"])
def test_large_motion_with_full_rotation_agrees_with_mujoco_within_half_a_percent(assembly, cubic):
    difference, response = compare(assembly, rough_bases(1.0), True, cubic)
    assert np.abs(response.mount_array("deflection")).max() > 0.05  # m: the motion is large
    assert np.all(difference < 0.005), difference


def test_small_motion_with_small_rotations_agrees_with_mujoco_within_half_a_percent(assembly):
    difference, _ = compare(assembly, rough_bases(0.02), False)
    assert np.all(difference < 0.005), difference


def test_small_rotations_are_visibly_wrong_for_large_motion(assembly):
    model = oracle.cab_model(assembly.vehicle, assembly.static_force, 1.0 / RATE)
    acceleration = rough_bases(1.0)
    base, rate, _, _, theirs = oracle.drive(model, acceleration)
    still = np.zeros_like(base)
    response = simulate(assembly, BaseMotion(RATE, base, rate, acceleration, still, still, still))
    error = np.linalg.norm(response.accelerations - theirs, axis=0) / np.linalg.norm(theirs, axis=0)
    assert error.max() > 0.02  # the oracle would notice missing rotation terms


def test_estimated_motion_and_inertial_load_are_those_of_mujoco(assembly):
    """MuJoCo's own accelerometers in, acceleration of the CG and inertial load out, against MuJoCo's accelerations.

    The readings are exact. What is left of the accelerations is interpolation (9/384 (2 pi f h)^4 of a sine of 20 Hz at 500 Hz:
    0.01 %) and the tilt by which gravity is taken off: along x and y an error of the size the estimate states, along z of
    second order, g t^2 / 2 = 0.008 m/s^2 at a tilt of 0.04 rad, which the bases of this run reach, beside 1.6 m/s^2 of motion.
    Of the moments also the inertia, which is learned and whose uncertainty the load states.
    """
    vehicle = assembly.vehicle
    sensors = list(vehicle.sensors.values())
    model = oracle.cab_model(vehicle, assembly.static_force, 1.0 / RATE, sensors)
    readings = []
    _, _, _, rotation, theirs = oracle.drive(model, rough_bases(0.3, 8.0, seed=5), readings=readings)
    values, omega = np.array([r for r, _ in readings])[::2], np.array([w for _, w in readings])[::2]
    stamps = 10**9 + np.arange(len(values)) * 2_000_000
    channels = {s.name: Channel(s.name, stamps, values[:, 3 * i : 3 * i + 3], stamps) for i, s in enumerate(sensors)}
    run = run_offline(Recording("mujoco", channels), Pipeline(vehicle))
    ticks = np.round((run.stamp_ns - stamps[0]) / 2_000_000).astype(int)
    late = (run.time_s > 1.0) & run.valid
    linear = np.einsum("nji,nj->ni", rotation[::2], theirs[::2, :3])
    truth = np.hstack([linear, theirs[::2, 3:]])[ticks][late]
    cab = vehicle.bodies["cab"]
    momentum = omega @ cab.inertia
    moment = theirs[::2, 3:] @ cab.inertia + np.cross(omega, momentum)
    load = np.hstack([cab.mass.value * linear, moment])[ticks][late]
    for name, true, share in (("cg_accel", truth, 0.002), ("inertial_load", load, 0.03)):
        error = run.signals[name][late] - true
        relative = np.sqrt(np.mean(error**2, axis=0)) / np.sqrt(np.mean(true**2, axis=0))
        assert relative[2] < 0.01, relative
        assert np.all(relative[3:] < share), relative  # 3 % is the stated uncertainty of the inertia
        stated = np.mean(np.abs(error) <= 2.0 * run.signals[f"{name}_std"][late], axis=0)
        assert np.all(stated > 0.9), stated
