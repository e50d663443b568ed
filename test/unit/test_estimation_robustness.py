# Copyright 2026 ride_estimation contributors
"""Sensors that fail during a run: the others carry on, the report names the culprit, nothing learned from it reads valid."""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import functools
import json

import numpy as np
import pytest
from worlds.adapters import START_NS, arrivals, believed_vehicle
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.roads import Road

from ride_estimation.estimation.common.estimate import Status
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.vehicle_file import load_vehicle

RATE = 250.0
FROM, TO = 10.0, 13.0


@functools.cache
def world(seed: int):
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air")
    run = drive(cab, Road.random(rng), 16.0, seed, step=1e-3)
    data = measure(run, random_sensors(cab, rng), RATE, seed, noise_share=0.01)
    return cab, data, believed_vehicle(data, seed=seed)


def broken(data, sensor, kind, seed=5):
    """Return the measurement with one sensor broken between FROM and TO."""
    values = data.data[sensor].copy()
    where = (data.time >= FROM) & (data.time < TO)
    first = int(np.flatnonzero(where)[0])
    if kind == "stuck":
        values[where] = values[first]
    elif kind == "zero":
        values[where] = 0.0
    elif kind == "spikes":
        rng = np.random.default_rng(seed)
        at = rng.choice(np.flatnonzero(where), 12, replace=False)
        values[at, 2] += 30.0 * rng.choice([-1.0, 1.0], 12)
    elif kind == "swapped":
        values[where] = values[where][:, [0, 2, 1]]
    elif kind == "late":
        values[where] = np.roll(values, round(0.02 * RATE), axis=0)[where]
    elif kind == "full scale":
        values[where] = np.clip(4.0 * values[where], -98.0, 98.0)
        values[first + 40 : first + 60] = 98.0
    return dataclasses.replace(data, data={**data.data, sensor: values})


def run(pipeline, data):
    blocks = []
    for stamp, name, values in arrivals(data):
        blocks += pipeline.observe(name, stamp, values.tolist())
    return blocks + list(pipeline.finish())


@functools.cache
def beginning(seed: int):
    """Return the estimator shortly before sensors break, what it gave until then, and how many samples that took."""
    pipeline, samples, blocks, count = Pipeline(world(seed)[2]), arrivals(world(seed)[1]), [], 0
    for end in np.arange(FROM - 1.0, FROM, 0.1):
        while samples[count][0] - START_NS < 1e9 * end:
            stamp, name, values = samples[count]
            blocks += pipeline.observe(name, stamp, values.tolist())
            count += 1
        # what is halfway learned cannot be copied
        with contextlib.suppress(TypeError):
            copy.deepcopy(pipeline)
            return pipeline, tuple(blocks), count
    raise AssertionError("no moment at which nothing is halfway learned")


def run_on(data, seed=1):
    """Return the estimator and its blocks after a run that is the clean one until sensors break."""
    begun, blocks, count = beginning(seed)
    pipeline, blocks = copy.deepcopy(begun), list(blocks)
    for stamp, name, values in arrivals(data)[count:]:
        blocks += pipeline.observe(name, stamp, values.tolist())
    return pipeline, blocks + list(pipeline.finish())


def joined(blocks, name):
    return np.concatenate([getattr(b, name) for b in blocks])


def force_errors(blocks, data):
    """Return the vertical force errors and their standard deviation from the fault on, shape (N, M)."""
    row = np.round((joined(blocks, "stamp_ns") - START_NS) * 1e-9 * RATE).astype(int)
    row = np.clip(row, 0, len(data.time) - 1)
    late = data.time[row] > FROM
    error = (joined(blocks, "mount_force") - data.truth["mount_force"][row])[late]
    return error, joined(blocks, "mount_force_std")[late]


@functools.cache
def clean(seed: int):
    pipeline = Pipeline(world(seed)[2])
    return pipeline, run(pipeline, world(seed)[1])


@pytest.mark.parametrize("seed", [pytest.param(0, marks=pytest.mark.slow), 1, 2])
def test_good_sensors_are_all_used(seed):
    """16 s of road: not one sensor refused, no doubt, nothing taken back."""
    pipeline, _ = clean(seed)
    text = " ".join(pipeline.health().messages)
    assert "not used" not in text
    assert "contradicted" not in text
    assert "rolled back" not in text


@pytest.mark.parametrize(
    ("sensor", "kind", "word"),
    [
        ("cab_front_right", "stuck", "stuck"),
        ("chassis_rear_left", "stuck", "stuck"),
        ("cab_rear_left", "spikes", "jumps"),
        ("chassis_front_left", "spikes", "jumps"),
        ("chassis_front_right", "swapped", "mean"),
        ("cab_front_left", "swapped", "rigid body"),
        ("chassis_rear_right", "zero", "mean"),
        ("cab_rear_right", "zero", "rigid body"),
        ("cab_front_left", "full scale", "full scale"),
    ],
)
def test_a_broken_sensor_is_left_out_and_named(sensor, kind, word):
    """Forces stay finite and within 3 times the largest error of the same run without the fault plus 5 std; the rest is used."""
    cab, data, _ = world(1)
    pipeline, blocks = run_on(broken(data, sensor, kind))
    for name in ("cg_accel", "mount_force", "mount_force_std", "mount_deflection", "inertial_load"):
        assert np.isfinite(joined(blocks, name)).all(), name
    error, std = force_errors(blocks, data)
    usual, _ = force_errors(clean(1)[1], data)
    assert np.all(np.abs(error) < 3.0 * np.abs(usual).max(axis=0) + 5.0 * std)
    assert std.max() < cab.mass * 9.81
    said = [m for m in pipeline.health().messages if m.startswith(f"{sensor} was not used")]
    assert said
    if kind not in ("zero", "full scale"):
        assert word in said[0]
    others = [m for m in pipeline.health().messages if "was not used" in m and not m.startswith(sensor)]
    assert not others
    for e in pipeline.parameters()[1:]:
        mount, axis, what = e.name.split(".")
        table = cab.stiffness if what == "stiffness" else cab.damping
        true = table[cab.mount_names.index(mount), "xyz".index(axis)]
        if e.status is Status.VALID:
            assert abs(e.value - true) < 4.0 * e.std + 0.02 * true, e.name


def test_the_deflection_over_a_lost_base_sensor_is_as_uncertain_as_it_is_wrong():
    """The other bases stand for the missing one for five seconds; what the frame twists meanwhile is not seen."""
    _, data, vehicle = world(2)
    pipeline, blocks = Pipeline(vehicle), []
    for stamp, name, values in arrivals(data):
        if name != "chassis_front_left" or not 9.0 <= (stamp - START_NS) * 1e-9 < 14.0:
            blocks += pipeline.observe(name, stamp, values.tolist())
    time = (np.concatenate([b.stamp_ns for b in blocks]) - START_NS) * 1e-9
    error = np.concatenate([b.mount_deflection[:, 0, 2] for b in blocks])
    error -= data.truth["deflection"][np.round(time * RATE).astype(int), 0, 2]
    std = np.concatenate([np.broadcast_to(b.mount_deflection_std[..., 0, 2], len(b.stamp_ns)) for b in blocks])
    lost = (time > 9.3) & (time < 13.9)
    score = (error[lost] - error[time < 9.0].mean()) / std[lost]
    assert np.mean(np.abs(score) <= 2.0) >= 0.9
    assert np.sqrt(np.mean(score**2)) > 0.5


def test_a_sensor_that_recovers_is_used_again():
    """Stuck from 10 s to 13 s: used again at the end; refused for 3 s and at most 1 s more."""
    data = world(1)[1]
    pipeline, _ = run_on(broken(data, "cab_front_right", "stuck"))
    health = pipeline.health()
    assert not any("(now)" in m for m in health.messages)
    lost = next(m for m in health.messages if m.startswith("cab_front_right was not used"))
    ticks = int(lost.split(": ")[1].split(" ")[0])
    assert 2.8 * RATE < ticks < 4.0 * RATE


def test_a_body_sensor_that_runs_late_stops_learning():
    """20 ms late from 10 s on: nothing learned meanwhile, and it is said."""
    data = world(1)[1]
    pipeline, _ = run_on(broken(data, "cab_rear_right", "late"))
    text = " ".join(pipeline.health().messages)
    assert "contradicted each other" in text or "cab_rear_right was not used" in text
    assert "rolled back" in text


def test_a_base_sensor_that_runs_late_for_a_while_is_named():
    """20 ms late from 10 s to 13 s: nothing else knows its vertical motion, the other bases know its horizontal one."""
    data = world(1)[1]
    pipeline, _ = run_on(broken(data, "chassis_rear_right", "late"))
    said = [m for m in pipeline.health().messages if "was not used" in m]
    assert len(said) == 1
    assert said[0].startswith("chassis_rear_right was not used: ")
    assert "other sensors at the mount bases" in said[0]


def test_what_a_faulty_base_sensor_taught_about_the_tilt_is_taken_back():
    """Zero from 10 s on: afterwards the sums are exactly those of a moment before the fault, and stay so."""
    _, data, vehicle = world(1)
    pipeline = Pipeline(vehicle)
    before: list[list[list[float]]] = []
    for stamp, name, values in arrivals(broken(data, "chassis_rear_left", "zero")):
        now = (stamp - START_NS) * 1e-9
        if now > 11.0:
            break
        pipeline.observe(name, stamp, values.tolist())
        if name == "chassis_rear_left" and now < FROM:
            before.append(pipeline._tilting.save()["moments"])
    after = pipeline._tilting.save()
    assert after["time"] > 1.0
    assert after["moments"] in before


def test_a_refused_sensor_is_still_refused_after_a_restart():
    """State saved while a sensor is stuck: the next pipeline leaves it out from the first tick and knows how long it was out."""
    _, data, vehicle = world(1)
    sensor = "cab_front_right"
    bad = broken(data, sensor, "stuck")
    first = Pipeline(vehicle)
    for stamp, name, values in arrivals(bad):
        if stamp - START_NS < 11e9:
            first.observe(name, stamp, values.tolist())
    lost = first.health().sensors[sensor].refused
    again = Pipeline(vehicle)
    again.load_state(json.loads(json.dumps(first.save_state())))
    assert again.health().sensors[sensor].refused == lost
    for stamp, name, values in arrivals(bad):
        if 11.2e9 < stamp - START_NS < 12.2e9:
            again.observe(name, stamp + int(60e9), values.tolist())
    ticks = again.health().ticks
    assert ticks > 0.8 * RATE
    assert sum(again.health().sensors[sensor].refused.values()) - sum(lost.values()) == ticks


@pytest.mark.parametrize(("leaning", "refused"), [("all", ()), ("one", ("chassis_front_left",))])
def test_a_body_that_rolls_in_a_bend_is_no_fault_of_a_base_sensor(leaning, refused):
    """Two m/s^2 sideways, twelve degrees, between the body and all its bases is a lean; of one base alone it is its fault."""
    vehicle = load_vehicle("truck_cab")
    pipeline = Pipeline(vehicle)
    for n in range(round(5.0 * RATE)):
        for sensor in vehicle.sensors.values():
            turned = sensor.body == "chassis" if leaning == "all" else sensor.name == "chassis_front_left"
            there = np.array([0.0, 2.0 if turned and n > 2.0 * RATE else 0.0, 9.81 + 0.01 * np.sin(0.7 * n)])
            pipeline.observe(sensor.name, START_NS + round(n * 1e9 / RATE), (sensor.rotation.T @ there).tolist())
    pipeline.finish()
    assert tuple(n for n, s in pipeline.health().sensors.items() if s.refused) == refused


def test_a_body_that_pitches_hard_on_soft_mounts_is_no_fault_of_a_sensor():
    """Nine rad/s^2 at 1.2 Hz: the slow mean at a bracket 1.1 m away still swings by 1.6 m/s^2 about that of the body."""
    vehicle = load_vehicle("truck_cab")
    centre = np.asarray(vehicle.bodies["cab"].cg)
    pipeline = Pipeline(vehicle)
    for n in range(round(6.0 * RATE)):
        grown, phase = min(n / RATE, 1.0), 2.0 * np.pi * 1.2 * n / RATE
        pitch, rate = 9.0 * grown * np.sin(phase), 9.0 / (2.0 * np.pi * 1.2) * grown * np.cos(phase)
        for sensor in vehicle.sensors.values():
            arm = (np.asarray(sensor.position) - centre) * (sensor.body == "cab")
            there = np.cross([0.0, pitch, 0.0], arm) - rate**2 * arm * [1.0, 0.0, 1.0] + [0.0, 0.0, 9.81 + 0.01 * np.sin(0.7 * n)]
            pipeline.observe(sensor.name, START_NS + round(n * 1e9 / RATE), (sensor.rotation.T @ there).tolist())
    pipeline.finish()
    assert not [n for n, s in pipeline.health().sensors.items() if s.refused]
