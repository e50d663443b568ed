# Copyright 2026 ride_estimation contributors
"""Results are whole or refused: kills, full disks, mixed folders; names that are not text, links in circles, terminal escapes."""

from __future__ import annotations

import csv
import os
import resource
import shutil
import signal
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ride_estimation.cli.fleet import find_recordings, folder_name
from ride_estimation.cli.main import main
from ride_estimation.errors import InputDataError
from ride_estimation.io.atomic import replacing
from ride_estimation.io.bounded import read_arrays
from ride_estimation.io.json_file import read_json, write_json, written_last
from ride_estimation.io.result_files import read_result
from ride_estimation.io.results import RESULT_SCHEMA, write_signals
from ride_estimation.io.run_table import write_run_table
from ride_estimation.reporting.page import Page
from ride_estimation.text import printable, shortened, table_cell

LATIN = os.fsdecode(b"l\xe4ufer")
ESCAPES = "\x1b]0;owned\x07\x1b[2J\u202e"


def a_run(number: int, ticks: int = 2000) -> Any:
    """What ``write_signals`` takes of a run; every array knows the number."""
    wide = ("cg_accel", "cg_accel_std", "cg_specific_force", "inertial_load", "inertial_load_std")
    forces = ("mount_force", "mount_force_std", "mount_force_std_equilibrium", "mount_force_std_model", "mount_deflection")
    signals = {name: np.full((ticks, 6), float(number)) for name in wide}
    signals |= {name: np.full((ticks, 3), float(number)) for name in ("angular_rate", "tilt")}
    signals |= {name: np.full((ticks, 4, 3), float(number)) for name in forces}
    return types.SimpleNamespace(
        signals=signals, smoothed="none", time_s=np.arange(ticks) / 200.0, stamp_ns=np.arange(ticks) * 5_000_000,
        valid=np.ones(ticks, bool), mount_names=("a", "b", "c", "d"),
    )  # fmt: skip


def write(folder: Path, number: int) -> None:
    """Write results in the order in which ``replay`` does."""
    document: dict[str, Any] = {"schema": RESULT_SCHEMA, "number": number}
    with written_last(folder / "result.json", document):
        document["signals_sha256"] = write_signals(folder / "signals.npz", a_run(number))


def test_a_mixed_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number, name in enumerate(("one", "two")):
        (tmp_path / name).mkdir()
        write(tmp_path / name, number)
    export = ["export-file", str(tmp_path / "one"), "--out", str(tmp_path / "o.csv")]
    assert main(export) == 0
    shutil.copy(tmp_path / "two" / "signals.npz", tmp_path / "one" / "signals.npz")
    capsys.readouterr()
    assert main(export) == 2 and "not the file that result.json was written with" in capsys.readouterr().err
    assert main(["compare", str(tmp_path / "one"), str(tmp_path / "two"), "--out", str(tmp_path / "c")]) == 2
    assert "not the file" in capsys.readouterr().err
    (tmp_path / "one" / "result.json").unlink()
    assert main(export) == 2 and "did not finish" in capsys.readouterr().err


def test_results_of_versions_without_the_digest_are_read(tmp_path: Path) -> None:
    write(tmp_path, 3)
    document = read_json(tmp_path / "result.json")
    del document["signals_sha256"]
    write_json(tmp_path / "result.json", document)
    assert read_result(tmp_path)["number"] == 3


def die_at(step: int, folder: Path, number: int) -> None:
    """Write results and die (in a child) before or after the step-th change that reaches the disk."""
    count = 0

    def deadly(change: Callable[..., Any]) -> Callable[..., Any]:
        def counted(*arguments: Any, **options: Any) -> Any:
            nonlocal count
            for part in (None, change):
                done = part(*arguments, **options) if part else None
                count += 1
                if count == step:
                    os.kill(os.getpid(), signal.SIGKILL)
            return done

        return counted

    for name in ("fsync", "replace", "unlink", "mkdir", "close"):
        setattr(os, name, deadly(getattr(os, name)))
    write(folder, number)


def test_a_kill_at_any_step_leaves_one_run_or_a_refusal(tmp_path: Path) -> None:
    found = []
    for step in range(1, 200):
        write(tmp_path, 1)
        child = os.fork()
        if child == 0:
            die_at(step, tmp_path, 2)
            os._exit(0)
        _, status = os.waitpid(child, 0)
        try:
            result = read_result(tmp_path)
            assert np.all(read_arrays(tmp_path / "signals.npz")["cg_accel"] == result["number"])
            found.append(result["number"])
        except InputDataError:
            found.append(0)
        if status == 0:
            break
    assert status == 0 and found[0] == 1 and found[-1] == 2 and 0 in found
    assert found == sorted(found, key=(1, 0, 2).index), "the old run, then none, then the new one"


def test_a_full_disk_names_the_file_and_leaves_nothing_that_reads_as_results(tmp_path: Path) -> None:
    """The limit on the size of a file stands for the disk: both end in an error in the middle of writing."""
    write(tmp_path, 1)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
    try:
        with pytest.raises(OSError) as caught:
            write(tmp_path, 2)
        with pytest.raises(InputDataError, match=r"t\.csv"):
            main_raises(tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert caught.value.filename == str(tmp_path / "signals.npz")
    with pytest.raises(InputDataError, match="did not finish"):
        read_result(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["signals.npz"]


def main_raises(folder: Path) -> None:
    from ride_estimation.io.files.channels import FileChannel
    from ride_estimation.io.files.formats import write_measurement_file

    time_s = np.arange(5000) / 200.0
    write_measurement_file(folder / "t.csv", [[FileChannel("a", "m", time_s, time_s)]], 0)


def test_a_folder_is_replaced_as_a_whole(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="stop"), replacing(tmp_path / "bag") as new:
        new.mkdir()
        (new / "part").write_text("x")
        raise ValueError("stop")
    assert not list(tmp_path.iterdir())
    with replacing(tmp_path / "bag") as new:
        new.mkdir()
        (new / "part").write_text("x")
    assert [p.name for p in tmp_path.rglob("*")] == ["bag", "part"]


def test_names_that_are_not_text_go_through_tables_pages_and_folders(tmp_path: Path) -> None:
    page = Page(LATIN + ESCAPES)
    page.text(LATIN + ESCAPES)
    page.table(["run"], [[LATIN]])
    page.write(tmp_path / LATIN)
    text = (tmp_path / LATIN).read_text(encoding="utf-8")
    assert text.count("l\\xe4ufer") == 4 and not set(text) & set(ESCAPES[0] + "\x07\u202e")
    write_run_table(tmp_path / "t.csv", ["run", "=x"], [{"run": LATIN, "=x": "=cmd|' /C calc'!A0"}, {"run": "-5", "=x": -5.0}])
    with (tmp_path / "t.csv").open(encoding="utf-8", newline="") as stream:
        assert list(csv.reader(stream)) == [["run", "'=x"], ["l\\xe4ufer", "'=cmd|' /C calc'!A0"], ["-5", "-5.0"]]
    assert folder_name(LATIN) != folder_name(os.fsdecode(b"l\xf6ufer"))


def test_links_in_circles_end_and_a_recording_counts_once(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "run.mcap").write_text("x")
    for name in ("a", "b"):
        (tmp_path / name).symlink_to(tmp_path)
        (tmp_path / "deep" / name).symlink_to(tmp_path)
    (tmp_path / "same.mcap").symlink_to(tmp_path / "deep" / "run.mcap")
    (tmp_path / "gone.mcap").symlink_to(tmp_path / "nothing")
    assert sorted(find_recordings(tmp_path)) == ["gone.mcap", "same.mcap"]


def test_a_terminal_is_shown_text_from_outside_and_does_not_obey_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "v.yaml").write_text(f'"k{ESCAPES.encode("unicode_escape").decode()}": 1\n')
    assert main(["plan", "--vehicle", str(tmp_path / "v.yaml")]) == 2
    assert main(["replay", ESCAPES + LATIN, "--vehicle", "truck_cab", "--out", str(tmp_path / "o")]) == 2
    assert main(["compare", ESCAPES, "--out", str(tmp_path / "o")]) == 2
    with pytest.raises(SystemExit):
        main([ESCAPES])
    told = capsys.readouterr().err
    assert told.count("\\x1b]0;owned\\x07\\x1b[2J\\u202e") >= 4 and "l\\xe4ufer" in told
    assert not set(told) & set("\x1b\x07\u202e")


def test_text_is_kept_where_it_is_harmless() -> None:
    assert printable("Hütte, 日本, a\tb\nc") == "Hütte, 日本, a\tb\nc"
    assert printable("Hütte", "ascii") == "H\\xfctte" and printable("a\r\x9b\u2066") == "a\\x0d\\x9b\\u2066"
    assert shortened("abc") == "abc" and len(shortened("x" * 10_000, 100)) <= 100 and "10000" in shortened("x" * 10_000, 100)
    assert [table_cell(v) for v in ("+a", "-1e5", "@x", "\tx", 3, -2.5, None, "ok")] == [
        "'+a", "-1e5", "'@x", "'\tx", 3, -2.5, "", "ok",
    ]  # fmt: skip
