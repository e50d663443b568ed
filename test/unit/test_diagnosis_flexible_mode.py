# Copyright 2026 ride_estimation contributors
"""An elastic mode on its mounts: stiffer and more damped than free of them, and driven with that phase."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.causes.flexible_mode import _AROUND, _drive_weights, _modal, _resonance, compliant_peaks
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.model_run import ModelState
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.signals.recording import UniformRun

MOUNTED_HZ, MOUNTED_RATIO, PEAK_HZ = 14.0, 0.12, 12.5
WIDE, NARROW = _AROUND


@pytest.fixture(scope="module")
def view() -> RunView:
    """Return a short run of the cab whose residual is a mode with a pattern of its own, driven by the vertical mounts."""
    vehicle = load_vehicle("config/vehicles/truck_cab.yaml")
    rng = np.random.default_rng(1)
    count, rate = 1400, 100.0
    data = {name: np.array([0.0, 0.0, 9.80665]) + 0.5 * rng.normal(size=(count, 3)) for name in vehicle.sensors}
    valid = {name: np.ones(count, dtype=bool) for name in data}
    plant = build_plant(vehicle, dict.fromkeys(data, 3))
    state = ModelState(np.array([p.stiffness for p in plant.ports]), np.array([p.damping for p in plant.ports]))
    plain = RunView(RunData(plant, measurement(plant, UniformRun("run", rate, 0, data, valid)), Settings()), state)
    twist = np.array([(1.0 if i % 2 else -1.0) * (p.axis == "z") for i, p in enumerate(plant.ports)])
    modal = _modal(plain, MOUNTED_HZ, MOUNTED_RATIO) @ twist
    other = copy.copy(plain)
    loud = 10.0 * np.abs(plain.data.output_spectrum).max() / np.abs(modal).max()
    other.residual_spectrum = loud * modal[:, None] * np.linspace(-1.0, 1.0, len(plant.outputs))
    return other


def rows_of(view: RunView) -> list[int]:
    return [i for i, s in enumerate(view.plant.outputs) if view.plant.vehicle.sensors[s.sensor].body == "cab"]


def test_a_mode_is_driven_with_the_phase_that_its_mounts_give_it(view):
    frequency, ratio, weights = _resonance(view, rows_of(view), PEAK_HZ, WIDE)
    assert frequency == pytest.approx(MOUNTED_HZ, rel=0.03) and ratio == 0.1
    vertical = np.array([p.axis == "z" for p in view.plant.ports])
    assert np.abs(weights[~vertical]).max() < 0.1 * np.abs(weights[vertical]).min()
    near = np.abs(view.grid.frequency - PEAK_HZ) < WIDE * PEAK_HZ
    residual = view.residual_spectrum[near][:, rows_of(view)]
    target = np.vstack([residual.real, residual.imag])
    pattern = np.linspace(-1.0, 1.0, target.shape[1])
    assert _drive_weights(_modal(view, MOUNTED_HZ, MOUNTED_RATIO)[near], target, pattern)[1] < 1e-6
    assert _drive_weights(_modal(view, PEAK_HZ, 0.02)[near], target, pattern)[1] > 0.05


def test_a_mode_that_dampers_at_its_corners_hold_is_found_with_their_damping(view):
    held = copy.copy(view)
    twist = np.array([(1.0 if i % 2 else -1.0) * (p.axis == "z") for i, p in enumerate(view.plant.ports)])
    modal = _modal(view, MOUNTED_HZ, 0.35) @ twist
    held.residual_spectrum = modal[:, None] * np.linspace(-1.0, 1.0, len(view.plant.outputs))
    frequency, ratio, _ = _resonance(held, rows_of(view), PEAK_HZ, WIDE)
    assert frequency == pytest.approx(MOUNTED_HZ, rel=0.06) and ratio == 0.4


def test_a_light_mode_beside_a_louder_resonance_is_looked_at_alone(view):
    both = copy.copy(view)
    vertical = np.array([float(p.axis == "z") for p in view.plant.ports])
    twist = np.array([(1.0 if i % 2 else -1.0) * v for i, v in enumerate(vertical)])
    light, loud = _modal(view, MOUNTED_HZ, 0.05) @ twist, _modal(view, 10.5, 0.05) @ vertical
    patterns = np.linspace(-1.0, 1.0, len(view.plant.outputs)), np.cos(np.arange(len(view.plant.outputs)))
    size = np.linalg.norm(light) / np.linalg.norm(loud)
    both.residual_spectrum = light[:, None] * patterns[0] + 2.0 * size * loud[:, None] * patterns[1]
    found = [_resonance(both, rows_of(view), MOUNTED_HZ, around)[0] for around in (WIDE, NARROW)]
    assert found[1] == pytest.approx(MOUNTED_HZ, rel=0.03)
    assert abs(found[0] - MOUNTED_HZ) > 0.1 * MOUNTED_HZ  # the louder one takes all of the wide look


@pytest.mark.parametrize(("answered", "damped"), [(0.0, 0.0), (0.3, 0.3), (0.1, 0.4)])
def test_free_of_its_mounts_a_mode_is_slower_by_what_they_give_it(view, answered, damped):
    (hypothesis, *_) = library()["flexible_mode"].hypotheses(view)
    drive = _resonance(view, rows_of(view), compliant_peaks(view, rows_of(view))[0], WIDE)[2]
    stiffness, damping = view.state.stiffness @ drive**2, view.state.damping @ drive**2
    w = 2.0 * np.pi * MOUNTED_HZ
    # a structure has 2 % of its own, mounts give stiffness and damping in the ratio of theirs
    ratio = 0.02 + 0.5 * damped * w * damping / stiffness
    shape = {"frequency": MOUNTED_HZ, "damping": ratio}
    count = len(rows_of(view)) + 1
    coefficients = np.array([*np.ones(count - 1), -answered * w**2 / stiffness])
    fitted = Fitted(hypothesis, coefficients, np.zeros((count, count)), shape, {"frequency": 0.1, "damping": 0.01})
    stated = {p.name: p for p in library()["flexible_mode"].parameters(view, fitted)}
    assert stated["natural frequency"].value == MOUNTED_HZ
    assert stated["natural frequency"].std == pytest.approx(np.hypot(0.1, 0.005**0.5 * ratio * MOUNTED_HZ))
    free = stated["natural frequency free of the mounts"]
    assert free.value == pytest.approx(MOUNTED_HZ * np.sqrt(1.0 - 0.5 * (answered + damped)), rel=0.02)
    assert (free.std > 0.8) == (answered != damped)


def test_a_pattern_that_the_rigid_body_shows_alone_is_no_elastic_mode(view):
    (hypothesis, *_) = library()["flexible_mode"].hypotheses(view)
    rows = rows_of(view)
    rigid = view.plant.out_acceleration[rows] @ np.array([0.3, -0.2, 1.0, 0.4, 0.1, 0.2])
    twist = np.array([(-1.0) ** i for i in range(len(rows))])
    shape = {"frequency": MOUNTED_HZ, "damping": 0.05}
    size = np.linalg.norm(rigid) / np.linalg.norm(twist)
    for share, elastic in ((0.0, False), (0.02, False), (0.5, True)):
        assert hypothesis.plausible(np.array([*(rigid + share * size * twist), 0.0]), shape) is elastic


def test_a_sprung_mass_whose_resonance_lies_at_the_edge_of_the_band_is_none(view):
    vertical = next(h for h in library()["missing_degree_of_freedom"].hypotheses(view) if h.axis == "z")
    lower = next(s.lower for s in vertical.shapes if s.name == "frequency")
    assert lower == 2.0 * view.settings.band_hz[0]
    coefficients = np.array([30.0, 0.0, 0.0, 0.1, 0.1, 0.0])
    for frequency, possible in ((lower, False), (1.2 * lower, True)):
        assert vertical.meaningful(coefficients, {"frequency": frequency, "damping": 0.2, "included": 1.0}) is possible
