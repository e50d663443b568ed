# Copyright 2026 ride_estimation contributors
"""Diagnosis from displacement transducers without base accelerometers.

The oracle needs no simulation: deflections are prescribed, laws written down here give the vertical forces, sideways forces are
drawn at random, and Newton's and Euler's equations in body axes give what every accelerometer reads.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy import signal

from ride_estimation.diagnosis.adapters.travel import diagnose_travel, needs_travel
from ride_estimation.diagnosis.answer.result import EXPLAINED, INSUFFICIENT, NO_DISCREPANCY
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.frames import rotation_from_rpy
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

RATE, SECONDS = 100.0, 40.0
MASS, CG = 950.0, np.array([0.1, 0.03, 0.8])
INERTIA = np.array([[520.0, -6.0, 21.0], [-6.0, 610.0, 4.0], [21.0, 4.0, 560.0]])
PLACES = {
    "bow": np.array([0.9, 0.0, 0.3]), "port": np.array([-0.7, 0.6, 0.3]), "starboard": np.array([-0.6, -0.65, 0.3]),
}  # fmt: skip
SENSORS = {
    "a": (np.array([0.8, 0.5, 0.4]), rotation_from_rpy(0.0, 0.0, 1.2)),
    "b": (np.array([0.7, -0.5, 1.6]), rotation_from_rpy(np.pi, 0.0, 0.0)),
    "c": (np.array([-0.8, 0.1, 0.5]), np.eye(3)),
    "d": (np.array([-0.2, -0.6, 1.2]), rotation_from_rpy(0.0, 0.5, 0.3)),
}
STIFFNESS, DAMPING = {"bow": 6.1e4, "port": 3.4e4, "starboard": 4.2e4}, {"bow": 1900.0, "port": 1100.0, "starboard": 1500.0}


def vehicle(**changes) -> Vehicle:
    """The model: stiffness and damping 15 to 20 % off the truth, within what it states."""
    mounts = {
        name: Mount(
            name, place, "pod", "hull",
            {
                "x": KelvinVoigt(4e5, 900.0), "y": KelvinVoigt(3e5, 900.0),
                "z": KelvinVoigt(1.18 * STIFFNESS[name], 0.85 * DAMPING[name]),
            },
            {("z", "stiffness"): Prior(1.18 * STIFFNESS[name], 0.3 * STIFFNESS[name])},
        )
        for name, place in PLACES.items()
    }  # fmt: skip
    sensors = {
        name: Sensor(name, "accelerometer", f"/{name}", "pod", position=place, rotation=turn)
        for name, (place, turn) in SENSORS.items()
    }
    sensors |= {
        f"pot_{name}": Sensor(f"pot_{name}", "displacement", "/pots", "", mount=name, axis="z", noise_std=5e-5) for name in PLACES
    }
    made = Vehicle("pod", {"pod": Body("pod", Prior(MASS, 5.0), CG, INERTIA)}, mounts, sensors)
    return dataclasses.replace(made, **changes)


def drive(seed: int, friction: float = 0.0, cg_up: float = 0.0) -> UniformRun:
    """Readings of a run, noise in them; ``friction`` [N] in the mount ``port``, the real CG ``cg_up`` [m] above the file's."""
    rng = np.random.default_rng(seed)
    fine, spare = 10, round(RATE)  # a second more at both ends, where filters begin
    count = round(RATE * SECONDS) + 2 * spare
    band = signal.butter(4, [0.7, 8.0], "bandpass", fs=RATE * fine, output="sos")

    def motion(rms: float) -> np.ndarray:
        x = signal.sosfilt(band, rng.standard_normal(count * fine))
        return rms * x / x.std()

    cg = CG + np.array([0.0, 0.0, cg_up])
    force, moment = np.zeros((count * fine, 3)), np.zeros((count * fine, 3))
    data = {}
    for name, place in PLACES.items():
        x = motion(0.006)
        v = np.gradient(x) * RATE * fine
        tension = STIFFNESS[name] * x + DAMPING[name] * v + (friction * np.tanh(v / 0.003) if name == "port" else 0.0)
        on_body = np.stack([motion(250.0), motion(300.0), -tension], axis=1)
        force += on_body
        moment += np.cross(place - cg, on_body)
        data[f"pot_{name}"] = signal.decimate(x[:, None], fine, axis=0, ftype="fir") + rng.normal(scale=5e-5, size=(count, 1))
    specific = force / MASS + np.array([0.0, 0.0, 9.80665])
    alpha = np.linalg.solve(INERTIA, moment.T).T
    for name, (place, turn) in SENSORS.items():
        reading = (specific + np.cross(alpha, place - cg)) @ turn
        data[name] = signal.decimate(reading, fine, axis=0, ftype="fir") + rng.normal(scale=0.02, size=(count, 3))
    data = {name: values[spare:-spare] for name, values in data.items()}
    count -= 2 * spare
    return UniformRun(f"run {seed}", RATE, 0, data, {name: np.ones(count, dtype=bool) for name in data})


def test_a_right_model_is_called_right_and_calibrated() -> None:
    """Sideways forces at random and a CG 25 mm above its place: neither is taken for a fault of a vertical law."""
    run = drive(1, cg_up=0.025)
    assert needs_travel(vehicle(), run)
    found = diagnose_travel(vehicle(), run)
    assert found.verdict == NO_DISCREPANCY, found.sentence
    values = {p.name: p for p in found.parameters}
    for name, place in PLACES.items():
        # four of the stated deviations, or the 0.4 % that count as right, whichever is more
        k = values[f"{name}.z.stiffness"]
        assert abs(k.value - STIFFNESS[name]) < max(4.0 * k.std, 0.004 * STIFFNESS[name])
        assert found.extended.mounts[name].elements["z"].stiffness == pytest.approx(k.value)
        assert found.extended.mounts[name].elements["x"].stiffness == 4e5
        assert found.extended.mounts[name].position == pytest.approx(place)
    assert found.extended.bodies["pod"].mass.value == MASS
    assert any("above its place" in words for words in found.remarks)


def test_friction_is_named_at_its_mount_and_pays_on_another_run() -> None:
    found = diagnose_travel(vehicle(), drive(2, friction=60.0), [drive(3, friction=60.0)])
    assert found.verdict == EXPLAINED, found.sentence
    assert (found.causes[0].id, found.causes[0].location, found.causes[0].axis) == ("coulomb_friction", "port", "z")
    level = found.causes[0].parameters[0]
    assert level.unit == "N" and abs(level.value - 60.0) < max(4.0 * level.std, 6.0)
    assert found.gain is not None and found.gain.validation[0].extended < 0.6 * found.gain.validation[0].baseline


def without(run: UniformRun, *names: str) -> UniformRun:
    return dataclasses.replace(run, data={k: v for k, v in run.data.items() if k not in names})


def test_what_the_deflections_do_not_close_is_refused_with_what_to_add() -> None:
    run = drive(4)
    plain = vehicle()
    for missing, words in (
        (("pot_port",), ("port", "vertical displacement transducer there")),
        (("a", "b", "d"), ("do not show", "add an accelerometer")),
        (("a", "b", "c", "d"), ("one body has both", "add them")),
    ):
        found = diagnose_travel(plain, without(run, *missing))
        assert found.verdict == INSUFFICIENT
        assert all(w in found.sentence for w in (*words, "accelerometers at the mount bases")), found.sentence
    seat = Mount("seat_z", CG, "seat", "pod", {"z": KelvinVoigt(1e4, 300.0)})
    carried = vehicle(
        mounts={**plain.mounts, "seat_z": seat}, bodies={**plain.bodies, "seat": Body("seat", Prior(90.0), CG, np.eye(3))}
    )
    assert "seat on pod reacts" in diagnose_travel(carried, run).sentence
    # the chain for base accelerometers says what else would do
    assert "transducer at every mount" in diagnose(plain, run).sentence
    assert not needs_travel(plain, without(run, *(f"pot_{name}" for name in PLACES)))


def test_too_few_base_accelerometers_leave_the_transducers_in_charge() -> None:
    run, plain = drive(5), vehicle()
    rows = run.data["a"] * 0.1
    for bases, wanted in ((("bow",), True), (tuple(PLACES), False)):
        sensors = {f"base_{m}": Sensor(f"base_{m}", "accelerometer", f"/{m}", "hull", mount=m, position=PLACES[m]) for m in bases}
        more = dataclasses.replace(
            run, data={**run.data, **dict.fromkeys(sensors, rows)}, valid={**run.valid, **dict.fromkeys(sensors, run.valid["a"])}
        )
        assert needs_travel(vehicle(sensors={**plain.sensors, **sensors}), more) is wanted
