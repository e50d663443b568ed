# Copyright 2026 ride_estimation contributors
"""Sensors installed as usual are no fault, and worse ones none either where the vehicle file states how they are installed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from worlds.adapters import arrivals, believed_vehicle
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.installation import installed
from worlds.roads import Road

from ride_estimation.estimation.common.geometry import channel_geometry
from ride_estimation.estimation.faults.rigid_check import RigidCheck
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.sensors.installation import USUAL, Installation, pooled
from ride_estimation.sensors.layout import motion_rows
from ride_estimation.sensors.sensor import Sensor

KINDS = ("bias", "gain", "misalignment", "position", "delay")


def findings(seed: int, scale: float, stated: Installation | None = None) -> list[str]:
    """Return what is said of sensors and hints after half a minute of road, errors ``scale`` times those of ``USUAL``."""
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air" if seed % 2 == 0 else "rubber")
    sensors = installed(random_sensors(cab, rng), seed, **{kind: scale * getattr(USUAL, kind) for kind in KINDS})
    follow = tuple(np.random.default_rng([seed, 1]).uniform(0.0, 1.0, 2))
    run = drive(cab, dataclasses.replace(Road.random(rng), follow=follow), 30.0, seed, step=1e-3)
    data = measure(run, sensors, 125.0, seed, noise_share=0.01)
    vehicle = believed_vehicle(data, seed=seed)
    own = {name: dataclasses.replace(s, installation=stated) for name, s in vehicle.sensors.items()}
    pipeline = Pipeline(dataclasses.replace(vehicle, sensors=own))
    for stamp, name, values in arrivals(data):
        pipeline.observe(name, stamp, values.tolist())
    pipeline.finish()
    return [*pipeline.health().messages, *(hint.words for hint in pipeline.hints())]


def test_sensors_installed_as_usual_are_no_fault():
    assert findings(6402, 1.0) == []


@pytest.mark.slow
def test_of_many_usual_installations_few_are_said_to_be_off():
    # with 13 errors of eight sensors one run in twenty has one of three and a half standard deviations
    said = [findings(seed, 1.0) for seed in range(6500, 6520)]
    assert sum(map(bool, said)) <= 2, said
    assert not [words for run in said for words in run if "harmonic" in words]


@pytest.mark.slow
def test_a_worse_installation_is_a_fault_unless_the_file_states_it():
    worse = Installation(**{name: 5.0 * value for name, value in dataclasses.asdict(USUAL).items()})
    unstated, stated = findings(6403, 5.0), findings(6403, 5.0, worse)
    assert [words for words in unstated if "misaligned" in words]
    assert not [words for words in stated if "misaligned" in words or "rigid body" in words or "looks like sensor" in words]


@pytest.mark.slow
def test_a_file_that_states_less_than_usual_makes_no_fault_of_what_is_usual():
    exact = Installation(**{name: 0.01 * value for name, value in dataclasses.asdict(USUAL).items()})
    assert findings(6405, 1.0, exact) == []


def test_installations_of_several_sensors_are_pooled_by_their_squares():
    one, other = Installation(gain=0.003), Installation(gain=0.004)
    assert pooled([one, other]).gain == pytest.approx(np.sqrt(0.5 * (0.003**2 + 0.004**2)))
    assert pooled([]) == USUAL
    assert one.at_least(other).gain == 0.004
    assert one.cross_sensitivity == pytest.approx(0.005)
    assert one.offset(9.80665) == pytest.approx(np.hypot(0.02, 0.0392266))


@pytest.mark.parametrize(("stated", "refused"), [(USUAL, ("rl",)), (Installation(gain=0.1, misalignment=0.05), ())])
def test_gross_errors_of_body_sensors_are_judged_by_what_the_file_states(stated, refused):
    places = {"fl": (0.8, 0.7, -0.3), "fr": (0.8, -0.7, -0.3), "rl": (-0.9, 0.6, 0.6), "rr": (-0.8, -0.6, -0.2)}
    sensors = [Sensor(n, "accelerometer", f"/{n}", "cab", position=np.array(p), installation=stated) for n, p in places.items()]
    directions, points = channel_geometry(sensors, np.zeros(3))
    check = RigidCheck(motion_rows(sensors, np.zeros(3)), directions, points, sensors, 9.81)
    motion = np.random.default_rng(3).standard_normal((100, 6))
    read = motion @ motion_rows(sensors, np.zeros(3)).T
    read[:, 6:9] += [2.0, 1.6, 2.4]
    found = check.judge(read, np.zeros(3), np.ones(4, dtype=bool), 1.0)
    assert tuple(sensors[s].name for s in found.lasting) == refused
