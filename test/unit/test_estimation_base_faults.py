# Copyright 2026 ride_estimation contributors
"""Base sensors that are wrong from the start are named; frames, roads, bumps and biases are no fault."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from scipy import signal
from scipy.spatial.transform import Rotation
from worlds.adapters import believed_vehicle
from worlds.cab import CabRun, CabSensor, drive, measure, random_sensors, random_vehicle
from worlds.roads import Road

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.faults.base_faults import BaseFaults
from ride_estimation.estimation.faults.health import base_messages
from ride_estimation.estimation.faults.sensor_gate import GateVerdict
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.alignment import Block

RATE, BLOCK, LENGTH, GRAVITY = 100.0, 10, 14.0, 9.80665
VICTIM = "chassis_rear_left"


@functools.cache
def run(kind: str, seed: int) -> tuple[CabRun, tuple[CabSensor, ...]]:
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air")
    return drive(cab, Road.random(rng, kind), LENGTH, seed, step=1e-3), random_sensors(cab, rng)


def watched(
    kind: str, seed: int, victim: str = VICTIM, mix: list[int] | None = None, leaning_deg: float = 0.0, **changes: object
) -> BaseFaults:
    """Feed the base sensors of a whole run, one of them changed, its axes mixed: 2 is y, -1 is x inverted."""
    motion, sensors = run(kind, seed)
    wrong = tuple(dataclasses.replace(s, **changes) if s.name == victim else s for s in sensors)  # type: ignore[arg-type]
    data = measure(motion, wrong, RATE, seed, noise_share=0.01)
    if mix:
        data.data[victim] = data.data[victim][:, np.abs(mix) - 1] * np.sign(mix)
    base = [s for s in geometry_of(believed_vehicle(data, seed=seed)).base_sensors if s is not None]
    values = np.hstack([data.data[s.name] for s in base])
    watch = BaseFaults(base, range(len(base)), range(0, 3 * len(base), 3), GRAVITY)
    nothing = GateVerdict(np.ones((BLOCK, len(base)), dtype=bool), False, (), (), False, 1.0)
    lean = Rotation.from_euler("x", leaning_deg, degrees=True).as_matrix()
    for k in range(0, len(values) - BLOCK, BLOCK):
        block = Block(k * 10**7, 10**7, values[k : k + BLOCK], nothing.valid, "")
        force = lean @ np.asarray(data.truth["specific_force"])[k : k + BLOCK].mean(axis=0)
        verdict = watch.judged(block, nothing, force, 1.0 / RATE)
        assert verdict.valid.all() == (not watch.refused)
        watch.learn(1.0 / RATE)
    return watch


@pytest.mark.parametrize(
    ("mix", "changes", "words"),
    [
        ([-1, 2, 3], {}, "axes (x, y, z are its -x, y, z)"),
        ([2, 1, 3], {}, "axes (x, y, z are its y, x, z)"),
        # what the sensor calls x, y, z is y, -x, z of its place
        ([2, -1, 3], {}, "axes (x, y, z are its -y, x, z)"),
        (None, {"delay_s": 0.02}, "delay"),
        ([1, -2, 3], {}, "axes (x, y, z are its x, -y, z)"),
        (None, {"gain": np.array([2.5, 2.5, 1.0])}, "gain"),
    ],
    ids=["inverted x", "swapped x and y", "a quarter of a turn", "late", "inverted y", "gain in the plane"],
)
def test_gross_fault_from_the_start_is_left_out(mix: list[int] | None, changes: dict[str, object], words: str) -> None:
    watch = watched("any", 611, mix=mix, **changes)
    (message,) = watch.messages()
    assert message.startswith(f"{VICTIM} is not used")
    assert words in message
    assert not watch.suspicion


def test_gain_and_tilt_must_show_in_mean_and_motion() -> None:
    turned = np.eye(3) @ Rotation.from_euler("x", 3.0, degrees=True).as_matrix()
    assert (
        f"{VICTIM}: its mean and its motion both look misaligned by 3.0 deg"
        in watched("any", 611, true_rotation=turned).suspicion
    )
    assert f"{VICTIM}: its mean and its motion are both +10 % too large" in watched("any", 611, gain=1.1).suspicion


def test_a_mean_alone_is_reported_and_makes_nothing_suspect() -> None:
    # a bias as large as that of the tilt shows in the mean alone
    watch = watched("any", 611, bias=np.array([0.0, GRAVITY * np.sin(np.radians(3.0)), 0.0]))
    (message,) = watch.messages()
    assert message.startswith(f"{VICTIM} at the mount base: its mean looks misaligned by 3.0 deg, or is a bias of 0.5")
    assert not watch.suspicion
    assert not watch.refused


def test_a_tilted_body_is_no_error_of_its_base_sensors() -> None:
    assert not watched("any", 611, leaning_deg=3.0).messages()


@pytest.mark.parametrize("kind", ["any", "bumps", "cobbles"])
def test_no_road_is_a_fault(kind: str) -> None:
    assert not watched(kind, 612).messages()


def test_verdict_is_kept() -> None:
    watch = watched("any", 611, mix=[-1, 2, 3])
    again = watched("any", 611)
    assert not again.refused
    again.load(watch.save())
    assert again.messages() == watch.messages()
    assert again.save() == watch.save()


def test_two_bases_have_nothing_to_spare() -> None:
    motion, sensors = run("any", 611)
    base = geometry_of(believed_vehicle(measure(motion, sensors, RATE, 8), seed=8)).base_sensors
    few = [s for s in base if s is not None][:2]
    watch = BaseFaults(few, range(2), range(0, 6, 3), GRAVITY)
    assert not watch.possible
    assert watch.save() == {} and not watch.messages()


def test_base_sensors_at_the_wrong_mounts_are_named() -> None:
    motion, sensors = run("any", 611)
    right = geometry_of(believed_vehicle(measure(motion, sensors, RATE, 8), seed=8))
    assert base_messages(right) == []
    first, second, *rest = right.base_sensors
    messages = base_messages(dataclasses.replace(right, base_sensors=(second, first, *rest)))
    assert len(messages) == 2
    assert f"at the base of {right.mount_names[0]} by the vehicle file but stands at {right.mount_names[1]}" in messages[0]


def test_a_frame_that_twists_under_three_bases_is_no_fault_of_one() -> None:
    """Brackets above the axis a frame twists about move sideways: ``(0, -W x h, W x y)``, which no rigid motion of three has."""
    rng = np.random.default_rng(613)
    places = np.array([[0.8, 0.0, 0.5], [-0.6, 0.5, 0.5], [-0.6, -0.5, 0.5]])
    base = [Sensor(f"b{i}", "accelerometer", "", "frame", position=p) for i, p in enumerate(places)]
    low_pass = signal.butter(2, 6.0, fs=RATE, output="sos")
    count = round(2.0 * LENGTH * RATE)
    heave, roll, twist = (signal.sosfilt(low_pass, rng.normal(size=count)) for _ in range(3))
    nothing = GateVerdict(np.ones((BLOCK, 3), dtype=bool), False, (), (), False, 1.0)
    x, y, _ = places.T
    along_y = -roll[:, None] * 0.5 - 0.6 * twist[:, None] * x * 0.5
    up = GRAVITY + heave[:, None] + roll[:, None] * y + 0.6 * twist[:, None] * x * y
    values = np.stack([np.zeros_like(up), along_y, up], axis=2) + rng.normal(scale=0.02, size=(count, 3, 3))
    watch = BaseFaults(base, range(3), range(0, 9, 3), GRAVITY)
    for k in range(0, count - BLOCK, BLOCK):
        block = Block(k * 10**7, 10**7, values[k : k + BLOCK].reshape(BLOCK, 9), nothing.valid, "")
        watch.judged(block, nothing, np.array([0.0, 0.0, GRAVITY]), 1.0 / RATE)
        watch.learn(1.0 / RATE)
    assert not watch.messages()


def test_of_three_base_sensors_only_the_one_whose_mean_is_off_is_named() -> None:
    sensors = [s for s in load_vehicle("truck_cab").sensors.values() if s.body == "chassis"][:3]
    checked = BaseFaults(sensors, (0, 1, 2), (0, 3, 6), 9.80665)
    checked._mean[1, 2], checked._mean_time = 1.5, 20.0
    assert [text.split(":")[0] for text in checked.messages()] == [f"{sensors[1].name} at the mount base"]
