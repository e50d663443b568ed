# Copyright 2026 ride_estimation contributors
"""Mistakes of a recording: axes, signs, topics and units that the vehicle file has otherwise."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from test_diagnosis_load import SITTING, runs_of

from ride_estimation.diagnosis.answer.wiring import found_mistakes, named_mistakes, put_right, without_mistakes
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.signals.corrected_run import corrected_run
from ride_estimation.signals.recording import UniformRun

G = 9.80665
Change = Callable[[dict[str, np.ndarray]], None]


@pytest.fixture(scope="module")
def healthy():
    _, file, runs = runs_of(9241, 0.0, SITTING, transducers=False)
    return file, runs


def recorded(run: UniformRun, change: Change) -> UniformRun:
    data = {name: np.array(values) for name, values in run.data.items()}
    change(data)
    return dataclasses.replace(run, data=data)


def axes(name: str, order: list[int], factor=(1.0, 1.0, 1.0)) -> Change:
    """Reading i is ``factor[i]`` times true value ``order[i]``."""

    def change(data: dict[str, np.ndarray]) -> None:
        data[name] = data[name][:, order] * np.array(factor)

    return change


def exchanged(one: str, other: str) -> Change:
    def change(data: dict[str, np.ndarray]) -> None:
        data[one], data[other] = data[other], data[one]

    return change


#: change of the readings, and (cause, sensor, axis, size) of what it is called
CASES: dict[str, tuple[Change, list[tuple[str, str, str, float]]]] = {
    "cab z inverted": (axes("cab_front_left", [0, 1, 2], (1, 1, -1)), [("sensor_gain", "cab_front_left", "z", -2.0)]),
    "cab x inverted": (axes("cab_front_right", [0, 1, 2], (-1, 1, 1)), [("sensor_gain", "cab_front_right", "x", -2.0)]),
    "cab x and y exchanged": (axes("cab_rear_left", [1, 0, 2]), [("sensor_misalignment", "cab_rear_left", "yaw", 90.0)]),
    "cab axes one on": (axes("cab_rear_right", [1, 2, 0]), [("sensor_misalignment", "cab_rear_right", "", 120.0)]),
    "cab upside down": (
        axes("cab_front_left", [0, 1, 2], (1, -1, -1)), [("sensor_misalignment", "cab_front_left", "roll", 180.0)]
    ),
    "cab turned left": (axes("cab_rear_left", [1, 0, 2], (1, -1, 1)), [("sensor_misalignment", "cab_rear_left", "yaw", 90.0)]),
    "cab turned right": (axes("cab_rear_left", [1, 0, 2], (-1, 1, 1)), [("sensor_misalignment", "cab_rear_left", "yaw", -90.0)]),
    "cab in g": (axes("cab_rear_left", [0, 1, 2], (1 / G,) * 3), [("sensor_gain", "cab_rear_left", "", 1 / G - 1)]),
    "cab topics": (exchanged("cab_front_left", "cab_front_right"), [
        ("wrong_sensor_position", "cab_front_left", "y", -1.2), ("wrong_sensor_position", "cab_front_right", "y", 1.2),
    ]),
    "base z inverted": (axes("chassis_front_right", [0, 1, 2], (1, 1, -1)), [("sensor_gain", "chassis_front_right", "z", -2.0)]),
    "base y inverted": (axes("chassis_front_left", [0, 1, 2], (1, -1, 1)), [("sensor_gain", "chassis_front_left", "y", -2.0)]),
    "base in g": (axes("chassis_rear_left", [0, 1, 2], (1 / G,) * 3), [("sensor_gain", "chassis_rear_left", "", 1 / G - 1)]),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_a_mistake_is_found_named_and_put_right(healthy, case: str):
    file, runs = healthy
    change, wanted = CASES[case]
    wrong = [recorded(run, change) for run in runs]
    found, doubtful = found_mistakes(file, wrong)
    assert not doubtful
    named = named_mistakes(file, found)
    assert [(c.id, c.location, c.axis) for c in named] == [w[:3] for w in wanted]
    for cause, (*_, size) in zip(named, wanted):
        assert cause.parameters[0].value == pytest.approx(size, rel=0.1)
        assert cause.confidence > 0.8
    for run, once in zip(runs, wrong):
        again = put_right(once, found)
        for name in run.data:
            np.testing.assert_allclose(again.data[name], run.data[name], rtol=1e-12, atol=1e-12)


def test_a_turned_sensor_is_turned_in_the_extended_file(healthy):
    file, runs = healthy
    wrong = [recorded(run, CASES["cab turned left"][0]) for run in runs]
    extended, remarks = without_mistakes(file, found_mistakes(file, wrong)[0])
    assert found_mistakes(extended, wrong) == ((), ())
    assert len(remarks) == 1
    exchanged_file, _ = without_mistakes(file, found_mistakes(file, [recorded(r, CASES["cab topics"][0]) for r in runs])[0])
    topics = {s.name: s.topic for s in file.sensors.values()}
    assert exchanged_file.sensors["cab_front_left"].topic == topics["cab_front_right"]


@pytest.mark.parametrize("case", ["cab in g", "base in g"])
def test_a_sensor_in_g_has_its_gain_in_the_extended_file(healthy, case: str):
    file, runs = healthy
    name = CASES[case][1][0][1]
    wrong = [recorded(run, CASES[case][0]) for run in runs]
    extended, (remark,) = without_mistakes(file, found_mistakes(file, wrong)[0])
    right = corrected_run(wrong[0], {name: extended.sensors[name].correction})
    np.testing.assert_allclose(right.data[name], runs[0].data[name], rtol=1e-12, atol=1e-12)
    assert "in g" in remark and "cannot hold" not in remark


def test_limits_of_a_range_follow_the_axes(healthy):
    file, runs = healthy
    limits = {"cab_front_left": np.array([[-np.inf, -20.0, -np.inf], [np.inf, 20.0, 15.0]])}
    wrong = [dataclasses.replace(recorded(run, CASES["cab z inverted"][0]), clipped_at=limits) for run in runs]
    right = put_right(wrong[0], found_mistakes(file, wrong)[0])
    np.testing.assert_array_equal(right.clipped_at["cab_front_left"], [[-np.inf, -20.0, -15.0], [np.inf, 20.0, np.inf]])


@pytest.mark.parametrize("change", [
    axes("cab_front_left", [0, 1, 2], (1.0, 1.0, 1.3)), axes("chassis_front_left", [0, 1, 2], (0.7, 1.0, 1.0)), lambda data: None,
])  # fmt: skip
def test_a_smaller_fault_is_no_mistake(healthy, change: Change):
    file, runs = healthy
    assert found_mistakes(file, [recorded(run, change) for run in runs]) == ((), ())


@pytest.mark.parametrize("case", ["base y inverted", pytest.param("cab axes one on", marks=pytest.mark.slow)])
def test_the_answer_names_the_mistake_and_what_putting_it_right_gains(healthy, case: str):
    file, (run, other) = healthy
    change, ((cause, sensor, axis, _),) = CASES[case]
    answer = diagnose(file, recorded(run, change), [recorded(other, change)])
    assert answer.verdict == "explained"
    assert [(c.id, c.location, c.axis) for c in answer.causes] == [(cause, sensor, axis)]
    assert "really" in answer.sentence and "put right" in answer.sentence
    (judged,) = answer.gain.validation
    assert judged.extended < 1.1 * judged.noise_floor
    assert judged.baseline > 3.0 * judged.extended and judged.ci95[0] > 0.0
