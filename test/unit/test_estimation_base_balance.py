# Copyright 2026 ride_estimation contributors
"""The vertical balance of the body names the base sensor that is wrong, and neither a mount nor a healthy sensor."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.faults.base_balance import BaseBalance
from ride_estimation.estimation.forces.mount_law import MountLaw
from ride_estimation.io.vehicle_file import load_vehicle

DT = 0.01
SECONDS = 25.0
GEOMETRY = geometry_of(load_vehicle("truck_cab"))
TRAVEL = geometry_of(load_vehicle("truck_cab_transducers"))
LAW = MountLaw(GEOMETRY)
COUNT = len(GEOMETRY.mounts)


def ride(seed: int, stiffness: np.ndarray, damping: np.ndarray, creep: float = 0.0) -> tuple[np.ndarray, ...]:
    """Return load (K, 6), accelerations of the body at the mounts and of the bases, deflections and rates (K, M).

    Harmonic vertical motion of a frame that bends at its four bases by a third of its motion; the body answers to each line by
    its own linear equation. ``creep``: stiffness of a Maxwell element of 40 ms at the first mount over its own.
    """
    rng = np.random.default_rng(seed)
    a, time = GEOMETRY, np.arange(0.0, SECONDS, DT)
    arms = np.stack([np.ones(COUNT), a.arms[:, 1], -a.arms[:, 0]])
    inertia = np.zeros((3, 3))
    inertia[0, 0], inertia[1:, 1:] = a.body.mass.value, np.asarray(a.body.inertia)[:2, :2]
    load, body, base, deflection, rate = np.zeros((len(time), 6)), *(np.zeros((len(time), COUNT)) for _ in range(4))
    for frequency in rng.uniform(0.5, 8.0, 40):
        s = 2j * np.pi * frequency
        rigid, own = (rng.normal(size=(2, n)) for n in (3, COUNT))
        amplitude = 0.02 / frequency**2 * ((rigid[0] + 1j * rigid[1]) @ arms + 0.3 * (own[0] + 1j * own[1]))
        held = creep * stiffness * (np.arange(COUNT) == 0) * 0.04 * s / (1.0 + 0.04 * s)
        link = arms * (stiffness + damping * s + held)
        answer = np.linalg.solve(inertia * s**2 + link @ arms.T, link @ amplitude)
        line = np.exp(s * time)[:, None]
        bent = arms.T @ answer - amplitude
        answers = (s**2 * inertia @ answer, s**2 * arms.T @ answer, s**2 * amplitude, bent, s * bent)
        for out, value in zip((load[:, 2:5], body, base, deflection, rate), answers):
            np.add(out, (line * value).real, out=out)
    return load, body, base, deflection, rate


def balance_of(
    readings: np.ndarray, load: np.ndarray, body: np.ndarray, displaced: np.ndarray | None = None,
    given: BaseBalance | None = None,
) -> BaseBalance:  # fmt: skip
    """Return a balance that has seen a ride, block by block."""
    geometry = GEOMETRY if displaced is None else TRAVEL
    found = given or BaseBalance(geometry)
    horizontal, travel = np.zeros((10, COUNT, 2)), np.zeros((len(load), 0)) if displaced is None else displaced
    columns = np.zeros((len(load), COUNT, 3))
    columns[:, :, 2] = readings
    for k in range(0, len(load) - 9, 10):
        part = slice(k, k + 10)
        found.gather(load[part], horizontal, body[part], columns[part].reshape(10, -1), travel[part])
        found.learn(DT)
    return found


def noisy(base: np.ndarray, seed: int) -> np.ndarray:
    return base + 0.01 * base.std() * np.random.default_rng(seed).normal(size=base.shape)


@pytest.mark.parametrize("seed", range(3))
def test_a_mount_that_is_not_as_in_the_file_is_no_error_of_a_sensor(seed: int) -> None:
    rng = np.random.default_rng(seed)
    stiffness = LAW.stiffness[:, 2] * rng.uniform(0.6, 1.6, COUNT)
    load, body, base, _, _ = ride(seed, stiffness, LAW.damping[:, 2] * rng.uniform(0.5, 2.0, COUNT))
    found = balance_of(noisy(base, seed), load, body)
    assert not found.refused and found.exchanged is None and not found.unusual


def test_friction_in_one_mount_is_no_error_of_a_sensor() -> None:
    load, body, base, deflection, rate = ride(3, LAW.stiffness[:, 2], LAW.damping[:, 2])
    friction = -0.5 * np.std(LAW.stiffness[2, 2] * deflection[:, 2]) * np.tanh(rate[:, 2] / 0.01)
    load[:, 2:5] += friction[:, None] * np.array([1.0, GEOMETRY.arms[2, 1], -GEOMETRY.arms[2, 0]])
    found = balance_of(noisy(base, 3), load, body)
    assert not found.refused and found.exchanged is None


def test_rubber_resembles_a_delay_and_is_no_error_of_a_sensor() -> None:
    load, body, base, _, _ = ride(8, LAW.stiffness[:, 2], LAW.damping[:, 2], creep=1.0)
    found = balance_of(noisy(base, 8), load, body)
    assert not found.refused and found.exchanged is None


def test_a_small_error_that_comes_while_driving_is_named_within_seconds() -> None:
    load, body, base, _, _ = ride(10, LAW.stiffness[:, 2], LAW.damping[:, 2])
    base, begin = noisy(base, 10), 1800
    found = balance_of(base[:begin], load[:begin], body[:begin])
    assert not found.refused
    base[:, 3] *= 1.2
    balance_of(base[begin:], load[begin:], body[begin:], given=found)
    assert list(found.refused) == [3]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda x: 1.3 * x, "1.3 times"), (lambda x: -x, "inverted"), (lambda x: 0.6 * x, "0.6 times"),
        (lambda x: np.interp(np.arange(len(x)) - 2.0, np.arange(len(x)), x), "20 ms late"),
        (lambda x: x.std() * np.random.default_rng(1).normal(size=x.shape), "does not fit at all"),
    ],
)  # fmt: skip
def test_an_error_of_one_sensor_is_named(change: object, words: str) -> None:
    load, body, base, _, _ = ride(4, 1.2 * LAW.stiffness[:, 2], 0.8 * LAW.damping[:, 2])
    base = noisy(base, 4)
    base[:, 1] = change(base[:, 1])  # type: ignore[operator]
    found = balance_of(base, load, body)
    assert list(found.refused) == [1] and words in found.refused[1]
    assert "chassis_front_right is not used" in found.messages()[0]


def test_two_sensors_that_are_exchanged_are_found_as_such() -> None:
    load, body, base, _, _ = ride(5, LAW.stiffness[:, 2], LAW.damping[:, 2])
    found = balance_of(noisy(base, 5)[:, [0, 2, 1, 3]], load, body)
    assert found.exchanged == (1, 2) and not found.refused


def test_where_a_transducer_contradicts_a_base_sensor_the_transducer_decides() -> None:
    """The loads are that of a mount in which something else is, too: only relative motion measured directly tells."""
    load, body, base, deflection, rate = ride(6, LAW.stiffness[:, 2], LAW.damping[:, 2])
    friction = -0.5 * np.std(LAW.stiffness[1, 2] * deflection[:, 1]) * np.tanh(rate[:, 1] / 0.01)
    load[:, 2:5] += friction[:, None] * np.array([1.0, GEOMETRY.arms[1, 1], -GEOMETRY.arms[1, 0]])
    base = noisy(base, 6)
    assert not balance_of(base, load, body, deflection).refused
    base[:, 2] *= 1.3
    assert list(balance_of(base, load, body, deflection).refused) == [2]


def test_a_wrong_transducer_is_no_fault_of_a_base_sensor() -> None:
    load, body, base, deflection, _ = ride(9, LAW.stiffness[:, 2], LAW.damping[:, 2])
    deflection[:, 3] *= 1.5
    assert not balance_of(noisy(base, 9), load, body, deflection).refused


def test_a_sensor_is_used_again_when_it_is_well_and_a_state_keeps_it_out() -> None:
    load, body, base, _, _ = ride(7, LAW.stiffness[:, 2], LAW.damping[:, 2])
    wrong = noisy(base, 7)
    wrong[:, 0] *= 1.7
    found = balance_of(wrong, load, body)
    again = BaseBalance(GEOMETRY)
    again.load(json.loads(json.dumps(found.save())))
    assert found.refused and again.refused == found.refused
    assert not balance_of(noisy(base, 8), load, body, given=again).refused


def test_parameters_that_change_leave_open_for_a_while_whether_a_sensor_is_wrong() -> None:
    load, body, base, _, _ = ride(3, LAW.stiffness[:, 2], LAW.damping[:, 2])
    base, most = noisy(base, 3), slice(0, 300)
    found = balance_of(base[most], load[most], body[most])
    assert not found.inconsistent
    found.follow_changes(1)
    assert found.undecided and found.inconsistent
    found.follow_changes(1)
    balance_of(base[most], load[most], body[most], given=found)
    assert found.undecided
    balance_of(base[most], load[most], body[most], given=found)
    assert not found.undecided and not found.inconsistent
