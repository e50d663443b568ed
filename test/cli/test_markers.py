# Copyright 2026 ride_estimation contributors
"""Markers of a run: from a table, a text column, a bag topic; a part between two of them is the same part in seconds."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import ride_estimation as re
from ride_estimation.cli.main import build_parser, main
from ride_estimation.errors import InputDataError
from ride_estimation.io.run_events import Event, moment, run_events
from ride_estimation.resources import shared_path

STANDING = str(shared_path("bags", "standing"))


def stamps(run: re.api.runs.Run) -> np.ndarray:  # type: ignore[name-defined,type-arg]
    return run.recording.channels["cab_front_left"].stamp_ns


def test_a_table_of_markers_cuts_as_seconds_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    start = re.read_run(STANDING, "truck_cab").recording.start_ns
    for unit, factor, zero in (("s", 1.0, 0.0), ("ms", 1e3, 0.0), ("s", 1.0, start * 1e-9)):
        table = tmp_path / "events.csv"
        rows = "\n".join(f"{(zero + t) * factor:.6f},{name}" for t, name in ((2.0, "lap"), (5.0, "lap"), (8.0, "end")))
        table.write_text(f"time [{unit}],event\n{rows}\n")
        run = re.read_run(STANDING, "truck_cab", start_s="lap#2", end_s="end", events=table)
        assert np.array_equal(stamps(run), stamps(re.read_run(STANDING, "truck_cab", start_s=5.0, end_s=8.0)))
    assert main(["inspect", STANDING, "--events", str(table), "--from", "lap", "--to", "lap"]) == 0
    said = capsys.readouterr().out
    assert "(2 s to 5 s)" in said and "marker end at 8.000 s" in said  # a marker to end at counts after the begin
    assert main(["inspect", STANDING, "--events", str(table), "--from", "lap#3"]) == 2
    assert "no marker 'lap#3'; there are lap (2.000 s), lap (5.000 s), end (8.000 s)" in capsys.readouterr().err
    assert main(["inspect", STANDING, "--from", "lap"]) == 2
    assert "the run has no markers" in capsys.readouterr().err


def test_a_text_column_and_a_table_beside_the_file(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    assert main(["export-file", STANDING, "--vehicle", "truck_cab", "--to", "4", "--out", str(file)]) == 0
    head, *rows = file.read_text().splitlines()
    marks = {200: "gate", 201: "gate", 400: "gate", 600: "stop"}  # held for two rows: one marker
    file.write_text("\n".join([f"{head},Status", *(f"{row},{marks.get(i, '')}" for i, row in enumerate(rows))]))
    run = re.read_run(file, "truck_cab", start_s="gate#2", end_s="stop")
    assert len(stamps(run)) == 201
    (tmp_path / "run.events.csv").write_text("time_s,name\n1.5,beside\n")
    cut = re.read_run(file, "truck_cab", start_s="beside", end_s="stop")
    assert stamps(cut)[0] == pytest.approx(run.recording.start_ns - 0.5e9, abs=1e7)


def test_every_command_that_reads_a_run_takes_a_part_of_it() -> None:
    """Whoever takes a RUN or a FILE with --vehicle takes --from, --to and --events too; 'map' looks at names and levels only."""
    without = []
    for name, parser in commands().items():
        options = {word for action in parser._actions for word in action.option_strings}
        what = {str(action.metavar) for action in parser._actions if not action.option_strings}
        if "--vehicle" in options and what & {"RUN", "FILE", "FOLDER"} and not {"--from", "--to", "--events"} <= options:
            without.append(name)
    assert without == ["map"]


def commands() -> dict[str, argparse.ArgumentParser]:
    """Return the parser of every command."""
    (action,) = build_parser()._subparsers._group_actions  # type: ignore[union-attr]
    return dict(action.choices)  # type: ignore[arg-type]


def test_a_part_is_imported_between_markers(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    assert main(["export-file", STANDING, "--vehicle", "truck_cab", "--to", "4", "--out", str(file)]) == 0
    (tmp_path / "run.events.csv").write_text("time_s,name\n1.0,gate\n2.5,stop\n")
    whole, part = str(tmp_path / "whole"), str(tmp_path / "part")
    assert main(["import-file", str(file), "--vehicle", "truck_cab", "--out", whole]) == 0
    assert main(["import-file", str(file), "--vehicle", "truck_cab", "--from", "gate", "--to", "stop", "--out", part]) == 0
    again = re.read_run(whole, "truck_cab", start_s=1.0, end_s=2.5)
    assert np.array_equal(stamps(re.read_run(part, "truck_cab")), stamps(again)) and len(stamps(again)) > 100


def test_a_topic_of_texts(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    text = store.types["std_msgs/msg/String"]
    with Writer(tmp_path / "bag", version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/marker", text.__msgtype__, typestore=store)
        for seconds, name in ((3.0, "brake"), (7.0, "stand")):
            writer.write(connection, round((100.0 + seconds) * 1e9), store.serialize_cdr(text(name), text.__msgtype__))
    found = run_events(tmp_path / "bag", 100_000_000_000)
    assert [(event.name, event.time_s) for event in found] == [("brake", pytest.approx(3.0)), ("stand", pytest.approx(7.0))]


@pytest.mark.parametrize(
    ("text", "words"),
    [("a,b\n1,2\n", "column of time"), ("time_s,event\nsoon,lap\n", "row 2: 'soon' is not a time"), ("", "column of time")],
)
def test_bad_tables_are_refused(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "events.csv").write_text(text)
    with pytest.raises(InputDataError, match=words):
        run_events(tmp_path / "run.csv", 0, (), tmp_path / "events.csv")


def test_numbers_and_nothing_stay_as_they_are() -> None:
    assert moment(3.5, ()) == 3.5 and moment(None, ()) is None
    assert moment("a#b", [Event("a#b", 1.0)]) == 1.0
