# Copyright 2026 ride_estimation contributors
"""``map``: what a logger calls its channels leads to the right components, and nothing is guessed that the names do not say."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.cli.main import main
from ride_estimation.io.channel_guess import words_of
from ride_estimation.io.files.channel_map import load_channel_map
from ride_estimation.io.vehicle_file import load_vehicle

SENSORS = load_vehicle("truck_cab").sensors
SHORT = {"front_left": "FL", "front_right": "FR", "rear_left": "RL", "rear_right": "RR"}


def long_name(body: str, place: str, axis: str) -> str:
    return f"{body.title()} {place.replace('_', ' ')} acc {axis}"


def short_name(body: str, place: str, axis: str) -> str:
    return f"{'CAB' if body == 'cab' else 'FRM_BASE'}_{SHORT[place]}_A{axis.upper()}"


def glued_name(body: str, place: str, axis: str) -> str:
    return f"Acc{'Cabin' if body == 'cab' else 'Frame'}{SHORT[place]}{axis.upper()}"


def german_name(body: str, place: str, axis: str) -> str:
    front, left = place.split("_")
    where = f"{'vorne' if front == 'front' else 'hinten'}_{'links' if left == 'left' else 'rechts'}"
    return f"{'Kabine' if body == 'cab' else 'Rahmen'}_{where}_{axis}"


def write_table(path: Path, call: Callable[[str, str, str], str], unit: str, level: float, turned: str = "") -> dict[str, str]:
    """Write a logger file in an order of its own; return channel by component."""
    rng = np.random.default_rng(3)
    names, columns = {}, {}
    for sensor in reversed(list(SENSORS)):
        body, _, place = sensor.partition("_")
        for axis in "zyx":
            name = call(body, place, axis)
            names[f"{sensor}.{axis}"] = name
            sign = -1.0 if f"{sensor}.{axis}" == turned else 1.0
            columns[name + unit] = 0.05 * level * rng.normal(size=50) + (sign * level if axis == "z" else 0.0)
    columns["VehSpeed [km/h]"] = np.full(50, 60.0)
    rows = np.column_stack([np.arange(50) / 200.0, *columns.values()])
    np.savetxt(path, rows, delimiter=",", header=",".join(["time [s]", *columns]), comments="")
    return names


@pytest.mark.parametrize("call", [long_name, short_name, glued_name, german_name])
def test_names_of_loggers_are_understood(call: Callable[[str, str, str], str], tmp_path: Path) -> None:
    names = write_table(tmp_path / "run.csv", call, " [g]", 1.0, turned="cab_rear_left.z")
    out = tmp_path / "map.yaml"
    assert main(["map", str(tmp_path / "run.csv"), "--vehicle", "truck_cab", "--out", str(out)]) == 0
    sources = load_channel_map(out, SENSORS).sources
    assert {name: source.channel for name, source in sources.items()} == names
    assert [name for name, source in sources.items() if source.factor == -1.0] == ["cab_rear_left.z"]
    assert main(["import-file", str(tmp_path / "run.csv"), "--vehicle", "truck_cab", "--channels", str(out),
                 "--out", str(tmp_path / "bag")]) == 0  # fmt: skip


@pytest.mark.parametrize(("level", "unit"), [(1.0, "g"), (1000.0, "mg"), (9.81, "m/s^2")])
def test_gravity_says_the_unit_that_the_file_does_not(level: float, unit: str, tmp_path: Path) -> None:
    write_table(tmp_path / "run.csv", short_name, "", level)
    assert main(["map", str(tmp_path / "run.csv"), "--vehicle", "truck_cab", "--out", str(tmp_path / "map.yaml")]) == 0
    assert {source.unit for source in load_channel_map(tmp_path / "map.yaml", SENSORS).sources.values()} == {unit}


def test_what_names_do_not_say_is_not_guessed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "run.csv").write_text("time,CH1 [g],CH2 [g],CH3 [g],F1 [N]\n0,1,2,3,4\n1,1,2,3,4\n")
    assert main(["map", str(tmp_path / "run.csv"), "--vehicle", "truck_cab"]) == 2
    assert "no channel looks like" in capsys.readouterr().err
    # two channels that say the same, and a sensor of which two components are there
    names = ("cab FL x", "acc_cab_FL_x", "cab FR x", "cab FR y")
    (tmp_path / "run.csv").write_text(f"time,{','.join(f'{n} [g]' for n in names)}\n0,1,2,3,4\n1,1,2,3,4\n")
    assert main(["map", str(tmp_path / "run.csv"), "--vehicle", "truck_cab", "--out", str(tmp_path / "map.yaml")]) == 0
    capsys.readouterr()
    lines = (tmp_path / "map.yaml").read_text().splitlines()
    assert '  # cab_front_right.x: "cab FR x"  # name and unit [g]' in lines and "  # cab_front_right.z: ???" in lines
    assert not [line for line in lines[lines.index("channels:") + 1 :] if not line.lstrip().startswith("#")]
    assert '# not used: "acc_cab_FL_x" [g]' in lines
    (tmp_path / "there.yaml").touch()
    assert main(["map", str(tmp_path / "run.csv"), "--vehicle", "truck_cab", "--out", str(tmp_path / "there.yaml")]) == 2
    assert "not replaced" in capsys.readouterr().err


def test_a_map_of_names_that_say_nothing_is_there_to_be_filled_in(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "run.csv").write_text("time,CH1 [g],CH2 [g],CH3 [g]\n0,1,2,3\n1,1,2,3\n2,1,2,3\n")
    out = tmp_path / "map.yaml"
    assert main(["map", str(tmp_path / "run.csv"), "--vehicle", "truck_cab", "--out", str(out)]) == 0
    assert "no channel looks like one of a sensor: fill it in" in capsys.readouterr().out
    text = out.read_text()
    for number, axis in enumerate("xyz", start=1):
        assert f'# not used: "CH{number}" [g]\n' in text
        text = text.replace(f"# cab_front_left.{axis}: ???", f"cab_front_left.{axis}: CH{number}")
    out.write_text(text)
    sources = load_channel_map(out, SENSORS).sources
    wanted = {f"cab_front_left.{a}": f"CH{n}" for n, a in zip("123", "xyz")}
    assert {name: source.channel for name, source in sources.items()} == wanted


def test_inspect_shows_a_logger_file_with_the_same_guess(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_table(tmp_path / "run.csv", short_name, " [g]", 1.0)
    assert main(["inspect", str(tmp_path / "run.csv"), "--vehicle", "truck_cab"]) == 0
    said = capsys.readouterr().out
    assert "CAB_FL_AZ [g]: 50 samples, 200 Hz, 0 gaps; perhaps cab_front_left.z" in said and "VehSpeed [km/h]" in said


def test_words_of_names() -> None:
    assert words_of("AccCabFLZ") == {"acc", "cab", "front", "left", "z"}
    assert words_of("/chassis/rear_right/accel") == {"chassis", "rear", "right", "accel"}
