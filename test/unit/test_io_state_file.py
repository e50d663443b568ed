# Copyright 2026 ride_estimation contributors
"""Saved states: whole or not at all whenever the process dies, and used only for the vehicle and version they are of."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import random
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import ride_estimation
from ride_estimation.errors import InputDataError
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.atomic import replacing, write_atomically
from ride_estimation.io.packed_arrays import pack, unpack
from ride_estimation.io.state_file import Snapshot, fingerprint, load_state, restore_state, save_results, save_state
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.resources import shared_path
from ride_estimation.vehicles.data_range import DataRange
from ride_estimation.vehicles.vehicle import Vehicle


def vehicle() -> Vehicle:
    return load_vehicle(shared_path("config", "vehicles", "single_imu.yaml"))


def resealed(document: dict[str, Any]) -> dict[str, Any]:
    """Put the checksum right, as a hostile hand would."""
    canonical = json.dumps(document["state"], sort_keys=True, separators=(",", ":"))
    return {**document, "sha256": hashlib.sha256(canonical.encode()).hexdigest()}


def first_number(value: Any, change: Callable[[float], Any]) -> Any:
    """Return a copy with its first number changed."""
    if isinstance(value, dict):
        key = next(iter(value))
        return {**value, key: first_number(value[key], change)}
    if isinstance(value, list):
        return [first_number(value[0], change), *value[1:]]
    return change(value)


def test_a_saved_state_is_taken_up_whole(tmp_path: Path) -> None:
    first = Pipeline(vehicle())
    sensor = next(iter(vehicle().sensors))
    for k in range(600):
        first.observe(sensor, 10**15 + k * 5_000_000, [0.1, 0.2, 9.8 + 0.1 * (k % 7), 0.0, 0.0, 0.0])
    save_state(tmp_path / "deep" / "s.json", first)
    second = Pipeline(vehicle())
    restore_state(tmp_path / "deep" / "s.json", second)
    assert json.dumps(second.save_state()) == json.dumps(first.save_state())
    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["s.json"]


def test_a_state_with_every_number_written_out_is_still_taken_up(tmp_path: Path) -> None:
    """As version 1 of the file was."""
    first = Pipeline(vehicle())
    document = load_state(save_state(tmp_path / "s.json", first))
    old = resealed({**document, "schema": "ride_estimation/saved_state/1"})
    (tmp_path / "old.json").write_text(json.dumps(old, indent=1), encoding="utf-8")
    second = Pipeline(vehicle())
    restore_state(tmp_path / "old.json", second)
    assert json.dumps(second.save_state()) == json.dumps(first.save_state())


def test_a_snapshot_stays_what_it_was_while_the_estimator_goes_on(tmp_path: Path) -> None:
    pipeline = Pipeline(vehicle())
    sensor = next(iter(vehicle().sensors))
    for k in range(600):
        if k == 300:
            snapshot = Snapshot.of(pipeline)
            then = json.dumps(snapshot.state)
        pipeline.observe(sensor, 10**15 + k * 5_000_000, [0.1, 0.2, 9.8 + 0.1 * (k % 7), 0.0, 0.0, 0.0])
    assert json.dumps(pipeline.save_state()) != then
    assert json.dumps(load_state(snapshot.write(tmp_path / "s.json"))["state"]) == then


@pytest.mark.parametrize(
    "value", [0.1, [1.5] * 3, [[0.1, -2e300, 5e-324]] * 40, [[1.0] * 70, [2.0]], ["a"] * 80, [1] * 80, [None] * 80]
)
def test_packed_lists_come_back_as_they_were(value: Any) -> None:
    packed = json.loads(json.dumps(pack({"a": value})))
    assert json.dumps(unpack(packed)) == json.dumps({"a": value})


@pytest.mark.parametrize(
    ("data", "shape"), [("AAAA", [1]), ("A", [1]), ("é", [1]), (3, [1]), ("", [0]), ("", []), ("", [10**9, 10**9]), ("", [True])]
)
def test_packed_numbers_that_are_none_are_refused(data: Any, shape: Any) -> None:
    with pytest.raises(InputDataError, match="packed numbers"):
        unpack({"a": [{"float64_base64": data, "shape": shape}]})


def test_killed_while_saving_the_file_is_the_old_or_the_new_one(tmp_path: Path) -> None:
    """25 writers that save without pause are killed at random moments; what is there always loads."""
    path, rng = tmp_path / "s.json", random.Random(1)
    pipeline = Pipeline(vehicle())
    save_state(path, pipeline)
    for _ in range(25):
        writer = os.fork()
        if writer == 0:
            while True:
                save_state(path, pipeline)
        time.sleep(rng.uniform(0.0, 0.03))
        os.kill(writer, signal.SIGKILL)
        os.waitpid(writer, 0)
        restore_state(path, Pipeline(vehicle()))


def test_a_save_that_fails_leaves_the_old_file_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "s.json"
    write_atomically(path, "old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_atomically(path, "new")
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["s.json"]


def test_what_killed_writers_left_is_removed_and_what_living_ones_write_is_not(tmp_path: Path) -> None:
    path = tmp_path / "s.json"
    writers = []
    for _ in range(2):
        ready, tell = os.pipe()
        if (writer := os.fork()) == 0:
            with replacing(path) as new:
                new.write_text(str(os.getpid()))
                os.write(tell, b"x")
                time.sleep(60.0)
        os.read(ready, 1)
        writers.append(writer)
    assert len(list(tmp_path.iterdir())) == 2, "neither takes the other's for a leftover"
    os.kill(writers[0], signal.SIGKILL)
    os.waitpid(writers[0], 0)
    write_atomically(path, "whole")
    try:
        left = [p for p in tmp_path.iterdir() if p != path]
        assert len(left) == 1 and (left[0] / "s.json").read_text() == str(writers[1])
    finally:
        os.kill(writers[1], signal.SIGKILL)
        os.waitpid(writers[1], 0)
    write_atomically(path, "whole")
    assert [p.name for p in tmp_path.iterdir()] == ["s.json"]


CHANGES: dict[str, tuple[Callable[[dict[str, Any]], dict[str, Any]], str]] = {
    "one digit": (lambda d: {**d, "state": {**d["state"], "run_time": d["state"]["run_time"] + 1.0}}, "checksum"),
    "other version": (lambda d: {**d, "software": "99.0.0"}, "version '99.0.0'"),
    "other vehicle": (lambda d: {**d, "vehicle": {"name": "other", "fingerprint": "0"}}, "of the vehicle 'other'"),
    "part missing": (
        lambda d: resealed({**d, "state": {k: v for k, v in d["state"].items() if k != "anchor"}}), "form of a state",
    ),
    "foreign part": (lambda d: resealed({**d, "state": {**d["state"], "more": 1}}), "other entries"),
    "text for a number": (lambda d: resealed({**d, "state": {**d["state"], "run_time": "soon"}}), "form of a state"),
    "huge parameter": (
        lambda d: resealed({
            **d, "state": {**d["state"], "parameters": {**d["state"]["parameters"], "theta": first_number(
                d["state"]["parameters"]["theta"], lambda v: v + 50.0)}}}), "would be|number",
    ),
    "no schema": (lambda d: {"state": d["state"]}, "not a saved state"),
}  # fmt: skip


@pytest.mark.parametrize("what", CHANGES)
def test_a_state_that_is_not_right_is_refused_and_changes_nothing(what: str, tmp_path: Path) -> None:
    change, says = CHANGES[what]
    path = save_state(tmp_path / "s.json", Pipeline(vehicle()))
    path.write_text(json.dumps(change(json.loads(path.read_text()))), encoding="utf-8")
    pipeline = Pipeline(vehicle())
    before = json.dumps(pipeline.save_state())
    with pytest.raises(InputDataError, match=says):
        restore_state(path, pipeline)
    assert json.dumps(pipeline.save_state()) == before


def test_a_changed_vehicle_is_another_one_and_a_comment_is_no_change(tmp_path: Path) -> None:
    own = vehicle()
    path = save_state(tmp_path / "s.json", Pipeline(own))
    body = next(iter(own.bodies.values()))
    heavier = dataclasses.replace(body, mass=dataclasses.replace(body.mass, value=1.1 * body.mass.value))
    with pytest.raises(InputDataError, match="has changed since"):
        restore_state(path, Pipeline(dataclasses.replace(own, bodies={**own.bodies, body.name: heavier})))
    described = dataclasses.replace(own, description="with a comment", checksum="another")
    assert fingerprint(described) == fingerprint(own)
    restore_state(path, Pipeline(described))


def test_identified_vehicle_file_and_state_carry_the_version(tmp_path: Path) -> None:
    vehicle_file, state_file = save_results(tmp_path, Pipeline(vehicle()))
    assert load_vehicle(vehicle_file).name == vehicle().name
    assert load_state(state_file)["software"] == ride_estimation.__version__


def test_identified_vehicle_file_says_what_the_data_showed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pipeline = Pipeline(vehicle())
    (mount, axis), *_ = pipeline.seen()
    monkeypatch.setattr(pipeline, "seen", lambda: {(mount, axis): DataRange(0.003, (0.5, 18.0)), (mount, "y"): None})
    found = load_vehicle(save_results(tmp_path, pipeline)[0]).mounts[mount].seen
    assert found == {axis: DataRange(0.003, (0.5, 18.0))}
