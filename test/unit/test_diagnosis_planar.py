# Copyright 2026 ride_estimation contributors
"""Planar machine and cabs instrumented with displacement transducers, diagnosed end to end on independent plants."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from worlds import laws
from worlds.adapters import START_NS, vehicle_of_text
from worlds.cab import GRAVITY
from worlds.machine import Machine
from worlds.plane_scenario import machine_text
from worlds.quarter_car import road_height
from worlds.roads import Road

from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.errors import InputDataError
from ride_estimation.signals.recording import UniformRun

STEP, RATE = 1e-3, 200.0
MOUNTS = ("mount_front", "mount_rear")
#: accelerometers (body, x) of each layout; a layout with transducers has one at each mount
LAYOUTS = {
    "accelerometers": ({"cab_front": ("cab", 0.2), "cab_middle": ("cab", -0.5), "cab_rear": ("cab", -1.4)}, False),
    "transducers": ({}, True),
    "transducers and one accelerometer": ({"cab_middle": ("cab", -0.5)}, True),
}


def inputs(layout, law, seed, seconds=60.0):
    """Return vehicle and two runs; ``law`` is (mount index, law code, function of deflection and rate rms -> parameters)."""
    rng = np.random.default_rng([seed, 7])
    machine = Machine(seat_mass=1e-3, damping=(6e3, 8e3, 4e3, 4.5e3, 1e-2), stiffness=(7e5, 9e5, 4.5e5, 5e5, 1.0))
    roads = (Road(roughness=256e-6, speed=5.0), Road(roughness=400e-6, speed=4.0))
    heights = [road_height(road, seconds, STEP, seed * 3 + i) for i, road in enumerate(roads)]
    plain = machine.drive(*heights[0], STEP, roads[0].speed)
    accelerometers, transducers = LAYOUTS[layout]
    noise = 0.02 * float(plain.qdd[1500:, 2].std())
    shift = 0.01 * float(plain.deflection[1500:, 2].std())
    hidden = machine
    if law is not None:
        mount, code, size = law
        x, v = (float(s[1500:, 2 + mount].std()) for s in (plain.deflection, plain.rate))
        hidden = dataclasses.replace(machine, laws=((2 + mount, code, size(machine.stiffness[2 + mount], x, v)),))
    places = {**accelerometers, "chassis_front": ("chassis", machine.mount_x[0]), "chassis_rear": ("chassis", machine.mount_x[1])}
    every = slice(None, None, round(1.0 / (RATE * STEP)))
    runs = []
    for i, (height, rate) in enumerate(heights):
        run = hidden.drive(height, rate, STEP, roads[i].speed)
        data = {}
        for name, (body, x) in places.items():
            full = np.zeros((len(run.time), 3))
            full[:, 0] = -GRAVITY * np.sin(run.q[:, 3] if body == "cab" else run.q[:, 1])
            full[:, 2] = hidden.accelerometer(run, body, x)
            data[name] = full[every] + rng.normal(0.0, noise, full[every].shape)
        if transducers:
            for number, mount_name in enumerate(MOUNTS):
                x = run.deflection[every, 2 + number]
                data[f"travel_{mount_name}"] = (x + rng.normal(0.0, shift, x.shape))[:, None]
        valid = {name: np.ones(len(values), dtype=bool) for name, values in data.items()}
        runs.append(UniformRun(f"run_{i}", RATE, START_NS, data, valid))
    text = machine_text(machine, places, noise, rng)
    lines = [
        f"  travel_{m}: {{kind: displacement, topic: /mounts/displacement, mount: {m}, axis: z, noise_m: {shift:.6g}}}"
        for m in MOUNTS if transducers
    ]
    head, tail = text.split("force_references:")
    return vehicle_of_text(head + "".join(line + "\n" for line in lines) + "force_references:" + tail), runs


def bouc_wen(k, x, v):
    """Return a hysteresis of a third of the spring force at the rms deflection."""
    return (0.3 * k * x, 0.08 * x, 0.6, 1.5)


def softening(k, x, v):
    """Return a spring whose rate falls to the fourth part at its rms deflection."""
    return (0.8 * k, 0.7 * x)


CASES = [
    ("coulomb_friction", 1, laws.BOUC_WEN, bouc_wen),
    ("stiffness_nonlinearity", 0, laws.HYPERBOLIC, softening),
]


@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_clean_machine_shows_no_discrepancy(layout):
    vehicle, (run, other) = inputs(layout, None, 1311)
    answer = diagnose(vehicle, run, [other])
    assert (answer.verdict, answer.causes) == ("no_discrepancy", ())


@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(("cause", "mount", "code", "size"), CASES)
def test_a_law_is_found_at_its_mount_and_pays_on_the_other_road(layout, cause, mount, code, size):
    vehicle, (run, other) = inputs(layout, (mount, code, size), 1312 + mount)
    answer = diagnose(vehicle, run, [other])
    assert [(c.id, c.location, c.axis) for c in answer.causes] == [(cause, MOUNTS[mount], "z")]
    judged = answer.gain.validation[0]
    assert judged.extended < 0.6 * judged.baseline
    assert judged.ci95[0] > 0.0


def test_transducers_alone_make_a_plant_and_nothing_to_compare_is_refused():
    vehicle, (run, _) = inputs("transducers", None, 1315, seconds=3.0)
    plant = build_plant(vehicle, {name: values.shape[1] for name, values in run.data.items()})
    assert [s.kind for s in plant.outputs] == ["displacement", "displacement"]
    bases = {n: 3 for n in run.data if n.startswith("chassis")}
    with pytest.raises(InputDataError, match="displacement transducer"):
        build_plant(vehicle, bases)
    with pytest.raises(InputDataError, match="no base motion"):
        build_plant(vehicle, {n: 1 for n in run.data if n.startswith("travel")})
