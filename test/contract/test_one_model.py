# Copyright 2026 ride_estimation contributors
"""The diagnosis and the estimator have the same model: responses and errors of sensors agree to rounding.

The estimator writes the motion in axes of the body, relative to the base, with the acceleration of the base as unknown; the
diagnosis in coordinates of the vehicle file, with the readings of the base as known. Both are derived on their own: each is the
oracle of the other.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

from ride_estimation.diagnosis.calibration.baseline import Adjustable, baseline_spectra, mean_table
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.model.response import respond
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.estimation.model.plant import Plant
from ride_estimation.estimation.model.segments import Model
from ride_estimation.estimation.model.spectral import Lines
from ride_estimation.frames import AXES
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Vehicle

_RATE, _COUNT = 125.0, 1500
#: motion so small that what is of second order in it is not seen
_SMALL = 1e-4
_STEP = 1e-5


def vehicle() -> Vehicle:
    """Return the truck cab: base sensors at their mounts, inertia along its axes, next to no noise.

    Levers from sensors to mounts turn with the twist as the mounts show it in one model, as the sensors show it in the other.
    """
    found = load_vehicle("truck_cab")
    sensors = {
        n: dataclasses.replace(s, noise_std=1e-9, position=found.mounts[s.mount].position if s.mount else s.position)
        for n, s in found.sensors.items() if s.kind != "displacement"
    }
    bodies = {n: dataclasses.replace(b, inertia=np.diag(np.diag(b.inertia))) for n, b in found.bodies.items()}
    return dataclasses.replace(found, sensors=sensors, bodies=bodies)


@functools.cache
def estimator() -> Plant:
    """Return the plant of the estimator."""
    return Plant(vehicle())


def transfer(theta: np.ndarray, lines: Lines) -> np.ndarray:
    """Return what the readings of the base say of those of the body at slow states, shape (F, body, base).

    Readings are late by their delays.
    """
    plant = estimator()
    model = Model.of(plant, theta)
    response, states = model.response(lines), plant.states
    of_inputs = model.rows[:, states.motion] @ response.drive + model.rows[:, states.drive]
    of_inputs = np.exp(-lines.laplace[:, None] * theta[plant.delay_of])[:, :, None] * of_inputs
    body = 3 * len(plant.geometry.body_sensors)
    return np.matmul(of_inputs[:, :body], np.linalg.inv(of_inputs[:, body:]))


def place(a: Adjustable) -> int:
    """Return where among the slow states of the estimator a number of the diagnosis is."""
    plant = estimator()
    slow, mounts = plant.slow, [m.name for m in plant.mounts]
    if a.kind in ("stiffness", "damping"):
        part = slow.log_stiffness if a.kind == "stiffness" else slow.log_damping
        return part.start + 3 * mounts.index(a.place) + AXES.index(a.axis)
    if a.kind == "cg":
        return slow.cg.start + AXES.index(a.axis)
    if a.kind == "inertia":
        entries = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        return int(np.r_[slow.log_inertia, slow.inertia_products][entries.index(a.axis)])
    return slow.sensors[a.place][a.kind].start + (AXES.index(a.axis) if a.axis else 0)


def test_readings_of_the_base_say_the_same_of_the_body_in_both_models():
    lines, plant = Lines.of(_COUNT, 1.0 / _RATE), estimator()
    of_estimator = transfer(plant.slow.mean, lines)
    tested = build_plant(vehicle(), {s.name: 3 for s in plant.sensors})
    assert [s.sensor for s in tested.outputs[::3]] == [s.name for s in plant.geometry.body_sensors]
    assert [s.sensor for s in tested.inputs[::3]] == [s.name for s in plant.base_sensors]
    stiffness, damping = (np.array([getattr(p, n) for p in tested.ports]) for n in ("stiffness", "damping"))
    of_diagnosis = respond(tested, stiffness, damping, 2.0 * np.pi * lines.frequency).output_from_input
    size = np.linalg.norm(of_diagnosis, axis=(1, 2))
    assert np.max(np.linalg.norm(of_estimator - of_diagnosis, axis=(1, 2)) / size) < 1e-8


@functools.cache
def view() -> RunView:
    """Return a run of small motion through the model of the diagnosis."""
    plant = estimator()
    rng = np.random.default_rng(2)
    data = {s.name: s.rotation.T @ [0.0, 0.0, plant.gravity] + rng.normal(size=(_COUNT, 3)) * _SMALL for s in plant.sensors}
    valid = {name: np.ones(_COUNT, dtype=bool) for name in data}
    tested = build_plant(vehicle(), dict.fromkeys(data, 3))
    state = ModelState(np.array([p.stiffness for p in tested.ports]), np.array([p.damping for p in tested.ports]))
    run = UniformRun("small", _RATE, 0, data, valid)
    seen = RunView(RunData(tested, measurement(tested, run), Settings()), state, sees_outputs=False)
    # every bracket moves on its own here, which a view takes for the noise of the base sensors
    seen.deflection_spectrum = seen.model.deflection_spectrum
    return seen


@functools.cache
def columns() -> list[tuple[Adjustable, np.ndarray]]:
    """Return what the diagnosis may adjust and what one unit of it adds to the readings of the body."""
    seen = view()
    prior = seen.state.stiffness, seen.state.damping
    return [(a, spectrum) for a, spectrum, _ in baseline_spectra(seen, mean_table(seen), prior)]


@pytest.mark.parametrize(
    ("kind", "count", "bound"),
    [
        ("stiffness", 12, 2e-3), ("damping", 12, 2e-3), ("gain", 24, 2e-3), ("misalignment", 24, 2e-3), ("position", 12, 2e-3),
        ("delay", 8, 2e-3), ("inertia", 6, 2e-3),
        # what the mounts carry at rest when the CG moves turns with their brackets in the model of the estimator only
        ("cg", 3, 3e-2),
    ],
)  # fmt: skip
def test_what_may_be_wrong_shows_alike_in_both_models(kind, count, bound):
    seen, plant = view(), estimator()
    inside = (seen.grid.frequency > seen.settings.band_hz[0]) & (seen.grid.frequency < seen.settings.band_hz[1])
    lines = Lines(_COUNT, 1.0 / _RATE, seen.grid.frequency[inside])
    base = seen.data.input_spectrum[inside][:, :, None]
    own = [(a, spectrum[inside]) for a, spectrum in columns() if a.kind == kind]
    assert len(own) == count
    for a, of_diagnosis in own:
        stepped = [plant.slow.mean.copy() for _ in range(2)]
        stepped[0][place(a)] += _STEP
        stepped[1][place(a)] -= _STEP
        slope = (transfer(stepped[0], lines) - transfer(stepped[1], lines)) / (2.0 * _STEP)
        of_estimator = np.matmul(slope, base)[:, :, 0]
        assert np.linalg.norm(of_diagnosis - of_estimator) < bound * np.linalg.norm(of_estimator), a.name


def test_a_good_installation_and_the_twist_of_brackets_are_one_statement():
    plant = estimator()
    for a, _ in columns():
        if a.kind in ("stiffness", "damping", "cg", "inertia", "gain", "misalignment", "position", "delay"):
            assert a.prior_std == pytest.approx(plant.slow.std[place(a)]), a.name
    shares = plant.slow.mean[plant.slow.tilt_shares][::2], plant.slow.std[plant.slow.tilt_shares][::2]
    of_diagnosis = [t for t in view().plant.tilts if t.kind == "twist"]
    assert len(of_diagnosis) == 8
    # four shares of their own tell as much of the one that the estimator has for them as its standard deviation does
    assert {(share, std) for share, std in zip(*shares)} == {(t.usual, t.usual_std / 2.0) for t in of_diagnosis}
