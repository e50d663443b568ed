# Copyright 2026 ride_estimation contributors
"""What calibration puts into the plant itself, and what is refused because nobody measured it."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_runs import quarter_car, quarter_car_run

from ride_estimation.diagnosis.answer.gain import noticeable
from ride_estimation.diagnosis.calibration import linear_model
from ride_estimation.diagnosis.calibration.baseline import Adjustable
from ride_estimation.diagnosis.calibration.in_line import loss_without
from ride_estimation.diagnosis.calibration.linear_model import calibrate, put_right, rebalanced
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.model.body_trajectories import BodyMotion, Trajectories
from ride_estimation.diagnosis.model.kinematics import Brackets, transducer_correction
from ride_estimation.diagnosis.model.measurement import measurement
from ride_estimation.diagnosis.model.plant import build_plant
from ride_estimation.diagnosis.runs.run_data import RunData
from ride_estimation.errors import InputDataError
from ride_estimation.frames import rotation_from_rpy
from ride_estimation.io.vehicle_file import load_vehicle

CAB = Path(__file__).parents[2] / "config" / "vehicles" / "truck_cab.yaml"
TRANSDUCERS = CAB.with_name("truck_cab_transducers.yaml")


def plant_of(path: Path):
    vehicle = load_vehicle(path)
    return build_plant(vehicle, dict.fromkeys(vehicle.sensors, 3))


def test_base_readings_are_put_right_where_gain_and_rotation_are_known():
    plant = plant_of(CAB)
    true = np.random.default_rng(1).normal(size=(50, len(plant.inputs)))
    rows = [i for i, s in enumerate(plant.inputs) if s.sensor == "chassis_rear_left"]
    read = true.copy()
    # reading of a sensor turned by a small angle: its axes turn, so the vector turns back
    turned = true[:, rows] @ rotation_from_rpy(0.008, -0.004, 0.006)
    read[:, rows] = turned * (1.0 + np.array([0.0, 0.006, 0.0]))
    found = [
        (Adjustable("misalignment", "chassis_rear_left", a, 0.004), v) for a, v in (("x", 0.008), ("y", -0.004), ("z", 0.006))
    ]
    found.append((Adjustable("gain", "chassis_rear_left", "y", 0.003), 0.006))
    found.append((Adjustable("gain", "cab_rear_left", "y", 0.003), 0.05))  # no base sensor: not the plant's business
    right = put_right(plant, tuple(a for a, _ in found), np.array([v for _, v in found])).put_right(read)
    # second order of the angles, 6e-5 of a signal of 3
    assert np.max(np.abs(right - true)) < 3e-4
    assert np.max(np.abs(read - true)) > 1e-2


def test_errors_beyond_three_tolerances_stay_out_of_the_plant():
    plant = plant_of(CAB)
    step = (Adjustable("misalignment", "chassis_rear_left", "x", 0.004),)
    for _ in range(2):
        plant = put_right(plant, step, np.array([0.05]))
    assert plant.reading_errors == {("misalignment", "chassis_rear_left", "x"): pytest.approx(0.012)}


def test_a_rebalanced_plant_is_the_one_of_a_file_with_that_cg_and_inertia():
    plant = plant_of(CAB)
    steps = (Adjustable("cg", "cab", "z", 0.01), Adjustable("inertia", "cab", "ixy", 0.03))
    moved = rebalanced(plant, steps, np.array([-0.02, 0.01]), Settings())
    moved = rebalanced(moved, steps, np.array([-0.005, 0.0]), Settings())
    body = plant.vehicle.bodies["cab"]
    inertia = body.inertia.copy()
    inertia[0, 1] = inertia[1, 0] = inertia[0, 1] + 0.01 * np.sqrt(inertia[0, 0] * inertia[1, 1])
    other = dataclasses.replace(body, cg=body.cg + np.array([0.0, 0.0, -0.025]), inertia=inertia)
    expected = build_plant(
        dataclasses.replace(plant.vehicle, bodies={"cab": other}), dict.fromkeys(plant.vehicle.sensors, 3)
    )
    for name in ("mass", "port_map", "gravity_stiffness", "out_acceleration", "static_force"):
        assert np.allclose(getattr(moved, name), getattr(expected, name), rtol=1e-12, atol=1e-9), name
    assert moved.body_errors[("cg", "cab", "z")] == pytest.approx(-0.025)


@pytest.mark.parametrize(
    ("left", "answer"),
    [
        ([0.4], 0),  # explained at once
        ([1.1, 0.3, 0.02], 2),  # explained with CG and inertia to all orders: goes on from there
        ([1.1, 0.6], 0),  # a step that explains less than half: something else bends them
        ([8.0, 3.0, 1.0, 0.3, 0.02], 4),
        ([8.0, 3.0, 2.0], 0),
    ],
)
def test_cg_and_inertia_enter_a_model_that_misses_much_only_where_they_explain_it(monkeypatch, left, answer):
    steps = iter([SimpleNamespace(number=i, left=value) for i, value in enumerate(left)])
    monkeypatch.setattr(linear_model, "_gauss_newton", lambda *_: next(steps))
    monkeypatch.setattr(linear_model, "_excess", lambda found: found.left)
    monkeypatch.setattr(linear_model, "_at_full_weight", lambda data, start: None)
    assert calibrate(None).number == answer
    assert next(steps, None) is None


def test_a_model_that_explains_the_run_at_full_weight_is_settled_from_there(monkeypatch):
    first, trusted, settled = (SimpleNamespace(left=value) for value in (1.4, 0.04, 0.06))
    started = []
    monkeypatch.setattr(linear_model, "_excess", lambda found: found.left)
    monkeypatch.setattr(linear_model, "_at_full_weight", lambda data, start: trusted if start is first else None)
    take = lambda *given: started.append(given[3:]) or (settled if given[3:] else first)  # noqa: E731
    monkeypatch.setattr(linear_model, "_gauss_newton", take)
    assert calibrate(None) is settled
    assert started == [(), (trusted,)]


@pytest.mark.parametrize(
    ("left", "strain", "found"), [([1.1, 0.04], False, 1), ([1.1, 0.04], True, None), ([1.1] * 3, False, None)]
)
def test_steps_at_full_weight_have_to_explain_the_run_with_a_good_installation(monkeypatch, left, strain, found):
    steps = [SimpleNamespace(left=value, strained=strain, blocks=None, number=i) for i, value in enumerate(left)]
    made = iter(steps)
    regression = SimpleNamespace(grams=None, fit=lambda grams, blocks: None)
    for name, value in {
        "file_parameters": lambda plant: None, "_advanced": lambda start, settings, bodies: (None, None),
        "RunView": lambda data, state: None, "build_regression": lambda view, prior: (None, (), regression),
        "Calibrated": lambda *parts: next(made), "_excess": lambda calibrated: calibrated.left,
    }.items():  # fmt: skip
        monkeypatch.setattr(linear_model, name, value)
    data = SimpleNamespace(plant=None, settings=None, with_plant=lambda plant: data)
    answer = linear_model._at_full_weight(data, SimpleNamespace(left=1.4, blocks=None))
    assert answer is (None if found is None else steps[found])


def test_a_transducer_measures_along_an_axis_that_turns_with_its_base():
    plant = plant_of(TRANSDUCERS)
    still = np.zeros((1, len(plant.coordinates)))
    size = 3 * len(plant.mounts)
    deflection, bracket = np.zeros((1, size)), np.zeros((1, size))
    row = next(i for i, s in enumerate(plant.outputs) if s.kind == "displacement" and s.component == 2)
    mount = plant.mounts.index(plant.vehicle.sensors[plant.outputs[row].sensor].mount)
    deflection[0, 3 * mount : 3 * mount + 3] = 0.002, 0.003, 0.01
    bracket[0, 3 * mount] = 0.05
    bodies = Trajectories(plant, BodyMotion(still, still, still)).bodies
    beyond = transducer_correction(plant, bodies, deflection, Brackets(bracket, np.zeros_like(bracket)))
    assert beyond[0, row] == pytest.approx(0.01 * (np.cos(0.05) - 1.0) - 0.003 * np.sin(0.05), abs=1e-12)
    assert np.count_nonzero(beyond) <= 3


def test_base_motion_that_follows_from_no_sensor_is_refused_with_the_sensor_that_is_missing():
    vehicle = load_vehicle(CAB)
    spoke = [s for s in vehicle.sensors if not s.startswith("chassis_rear")]
    with pytest.raises(InputDataError, match=r"rear_left is not measured.*1\.65 m away.*cannot show the pitch"):
        build_plant(vehicle, dict.fromkeys(spoke, 3))
    spoke.append("chassis_rear_right")
    assert len(build_plant(vehicle, dict.fromkeys(spoke, 3)).ports) == 12


def test_a_stiffness_the_run_determines_is_missed_elsewhere_and_not_where_it_is():
    vehicle, run = quarter_car(), quarter_car_run(seed=3)
    plant = build_plant(vehicle, {"body": 3, "base": 3})
    found = calibrate(RunData(plant, measurement(plant, run), Settings()))
    blocks = np.arange(found.view.blocks.count)
    assert abs(loss_without(found.view, 0, 1.0, blocks)) < 3.0
    assert loss_without(found.view, 0, 1.3, blocks) > 100.0


@pytest.mark.parametrize(
    ("share", "node", "strained", "counts"),
    [
        (0.003, 1.0, (False, False), False), (0.005, 1.0, (False, False), True), (0.005, 2.0, (False, False), False),
        # a model that needs worse sensors than a good installation has: what it explains is no measure of the cause
        (0.003, 1.0, (True, False), True), (0.003, 1.0, (True, True), False),
    ],
)
def test_a_cause_must_explain_more_of_some_channel_than_a_right_model_misses(share, node, strained, counts):
    rng = np.random.default_rng(4)
    signal, noise = rng.normal(size=(2, 4000, 3))
    effect = share * rng.normal(size=4000)
    noise -= np.outer(effect, effect @ noise) / (effect @ effect)  # else the chance correlation decides
    left = 0.01 * noise
    before = left.copy()
    before[:, 1] += effect
    view = SimpleNamespace(
        data=SimpleNamespace(block_window=lambda blocks: np.ones(4000)),
        noise=SimpleNamespace(power_ratio=np.array([1.0, node, 1.0])),
    )
    base = SimpleNamespace(view=view, residual=lambda: before, measured=lambda: signal)
    extended = SimpleNamespace(residual=lambda: left, told=lambda blocks: blocks)
    work = SimpleNamespace(
        calibrated=SimpleNamespace(strained=strained[0]),
        selection=SimpleNamespace(accepted=SimpleNamespace(in_band=True, strained=strained[1])), settings=Settings(),
        splits=SimpleNamespace(judge=np.array([0])),
    )
    assert noticeable(work, base, extended) is counts
