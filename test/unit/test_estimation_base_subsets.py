# Copyright 2026 ride_estimation contributors
"""Two or three base sensors of four, or single axes: what they determine is estimated, the rest says so."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from worlds.adapters import START_NS, arrivals, believed_vehicle
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.roads import Road

from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.forces.base_fill import BaseFill
from ride_estimation.estimation.kinematics.bracket_tilt import BracketTilt
from ride_estimation.estimation.parameters.force_balance import unseen_acceleration, weighed_share
from ride_estimation.estimation.parameters.parameter_estimator import ParameterEstimator
from ride_estimation.estimation.pipeline import Pipeline

MOUNTS = ("front_left", "front_right", "rear_left", "rear_right")


@functools.cache
def world():
    rng = np.random.default_rng(8300)
    cab = random_vehicle(rng, "air")
    sensors = random_sensors(cab, rng)
    data = measure(drive(cab, Road.random(rng), 18.0, 8300, step=1e-3), sensors, 250.0, 8300, noise_share=0.01, anti_alias=0.0)
    return cab, data, believed_vehicle(data, seed=8300)


def vehicle_with(bases, axes="xyz"):
    vehicle = world()[2]
    sensors = {
        n: dataclasses.replace(s, axes=tuple(axes)) if n.startswith("chassis") else s for n, s in vehicle.sensors.items()
        if not n.startswith("chassis") or n.removeprefix("chassis_") in bases
    }  # fmt: skip
    return dataclasses.replace(vehicle, sensors=sensors)


def test_sideways_takes_all_bases():
    assert geometry_of(vehicle_with(MOUNTS)).base_observable.all()
    three = geometry_of(vehicle_with(MOUNTS[:3]))
    assert three.base_seen.all(axis=1).tolist() == [True, True, True, False]
    assert three.base_observable.tolist() == [[False, False, True]] * 3 + [[False] * 3]
    upright = geometry_of(vehicle_with(MOUNTS, "z"))
    assert upright.base_observable.tolist() == [[False, False, True]] * 4


def test_a_missing_base_moves_as_the_others_of_a_rigid_frame():
    fill = BaseFill(geometry_of(vehicle_with(MOUNTS[:3])))
    place = np.array([m.position for m in world()[2].mounts.values()])
    base = np.zeros((5, 4, 3))
    base[:, :3] = 9.81 * np.eye(3)[2] + (1.0 + 0.5 * place[:3, :1]) * np.eye(3)[2]
    found, there = fill.fill(base, np.tile([True, True, True, False], (5, 1)), 0.02)
    assert there.all()
    expected = 9.81 + 1.0 + 0.5 * place[3, 0]
    assert found[0, 3, 2] == pytest.approx(expected, abs=0.1)
    assert np.array_equal(found[:, :3], base[:, :3])


def test_axes_that_no_base_measures_are_not_made_up():
    fill = BaseFill(geometry_of(vehicle_with(MOUNTS, "z")))
    base = np.zeros((5, 4, 3))
    base[:, :, 2] = 9.81
    found, _ = fill.fill(base, np.ones((5, 4), dtype=bool), 0.02)
    assert np.array_equal(found, base)


def test_mounts_that_could_carry_the_body_alone_leave_no_scale():
    assert weighed_share(geometry_of(vehicle_with(MOUNTS))) == 1.0
    assert weighed_share(geometry_of(vehicle_with(MOUNTS[:3]))) > 0.4
    assert weighed_share(geometry_of(vehicle_with(MOUNTS[:2]))) > 0.4
    diagonal = vehicle_with(("front_left", "rear_right"))
    # the other two could carry the body, but no moment about the line through them: the inertia is the scale where it is stated
    assert weighed_share(geometry_of(diagonal)) > 0.4
    unstated = {n: dataclasses.replace(b, inertia_relative_std=None) for n, b in diagonal.bodies.items()}
    for poor in (dataclasses.replace(diagonal, bodies=unstated), vehicle_with(("front_left",))):
        geometry = geometry_of(poor)
        assert weighed_share(geometry) < 0.2
        estimator = ParameterEstimator(geometry, BracketTilt(geometry), PipelineSettings())
        assert not estimator.possible
        assert "could carry the body alone" in estimator.estimates()[0].reason


def test_nothing_is_learned_along_forces_of_unseen_mounts():
    three = geometry_of(vehicle_with(MOUNTS[:3]))
    unseen = unseen_acceleration(three)
    estimator = ParameterEstimator(three, BracketTilt(three), PipelineSettings())
    noise = 1e-4 * np.eye(6)
    response = estimator._model.response
    estimator._model.scale(estimator.theta)
    response.set_noise(noise, 4e-4, unseen)
    response.prepare(np.zeros((4, 3)), 1.0, 0.008)
    # an acceleration by such a force moves the simulated body as it moves the real one
    direction = unseen @ np.eye(6)[2]
    drive = (response.hold_old + response.hold_new) @ direction
    assert response.gain @ direction == pytest.approx(drive, abs=0.05 * np.abs(drive).max())
    weights = np.linalg.inv(noise + unseen)
    assert direction @ weights @ direction < 0.01 * direction @ np.linalg.inv(noise) @ direction
    assert np.array_equal(unseen_acceleration(geometry_of(vehicle_with(MOUNTS))), np.zeros((6, 6)))


def estimated(vehicle):
    cab, data, _ = world()
    pipeline, blocks = Pipeline(vehicle), []
    for stamp, name, values in arrivals(data):
        if name in vehicle.sensors:
            blocks += pipeline.observe(name, stamp, vehicle.sensors[name].only_measured(np.asarray(values)).tolist())
    blocks += pipeline.finish()
    stamps = np.concatenate([b.stamp_ns for b in blocks])
    force, std = (np.concatenate([getattr(b, n) for b in blocks]) for n in ("mount_force", "mount_force_std"))
    seconds = (stamps - START_NS) * 1e-9
    keep = (seconds > 10.0) & (seconds < data.time[-1] - 0.5)
    right = np.stack([np.interp(seconds[keep], data.time, data.truth["mount_force"][:, m, 2]) for m in range(4)], axis=1)
    return cab, pipeline, force[keep, :, 2], std[keep, :, 2], right


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bases", "axes", "learned", "largest"),
    [
        (MOUNTS[:3], "xyz", 6, 0.25), (MOUNTS[:2], "xyz", 4, 0.3), (MOUNTS, "z", 8, 0.2),
        (("front_left", "rear_right"), "xyz", 4, 0.4),
    ],
)  # fmt: skip
def test_vertical_forces_and_parameters_of_fewer_readings(bases, axes, learned, largest):
    cab, pipeline, force, std, right = estimated(vehicle_with(bases, axes))
    error = np.sqrt(np.mean((force - right) ** 2, axis=0)) / right.std(axis=0)
    assert error.max() < largest
    assert np.mean(np.abs(force - right) <= 2.0 * std) > 0.88
    valid = [e for e in pipeline.parameters() if e.status is Status.VALID and not e.name.endswith("mass")]
    assert all(e.name.split(".")[0] in bases and ".z." in e.name for e in valid)
    assert learned // 2 <= len(valid) <= learned
    for e in valid:
        mount, _, role = e.name.split(".")
        true = (cab.stiffness if role == "stiffness" else cab.damping)[MOUNTS.index(mount), 2]
        assert abs(e.value - true) <= 3.0 * e.std
