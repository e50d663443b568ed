# Copyright 2026 ride_estimation contributors
"""Measurement files in and out: round trips to the last digit the format holds, units converted, every bad input refused.

MDF4, TDMS, RPC III and Parquet need the extra ``files``; without it only CSV is tested.
"""

from __future__ import annotations

import datetime
import sys
from pathlib import Path

import numpy as np
import pytest
from fuzz.measurements import lvm_text

from ride_estimation.cli.main import main
from ride_estimation.errors import InputDataError
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.bags import iterate_messages, read_recording
from ride_estimation.io.files.channels import FileChannel, TimeSource, split_heading, table_channels, unit_factor
from ride_estimation.io.files.formats import read_measurement_file, write_measurement_file
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.resources import shared_path
from ride_estimation.signals.recording import Channel, Recording

VEHICLE = shared_path("config", "vehicles", "truck_cab_transducers.yaml")
RATE, SECONDS = 100.0, 2.0


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Sensors of a vehicle file, all sampled at the same instants."""
    sensors = load_vehicle(VEHICLE).sensors
    rng = np.random.default_rng(1)
    stamps = 5_000_000_000 + np.round(np.arange(0, SECONDS, 1 / RATE) * 1e9).astype(np.int64)
    return Recording("made", {
        name: Channel(name, stamps, rng.normal(size=(len(stamps), sensor.channels)), stamps) for name, sensor in sensors.items()
    })  # fmt: skip


@pytest.fixture(scope="module")
def bag(recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("files") / "bag"
    write_bag(folder, recording, load_vehicle(VEHICLE).sensors)
    return folder


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mf4"])
def test_export_and_import_give_the_recording_back(suffix: str, bag: Path, recording: Recording, tmp_path: Path) -> None:
    if suffix == ".parquet":
        pytest.importorskip("pyarrow")
    if suffix == ".mf4":
        pytest.importorskip("asammdf")
    file = tmp_path / f"run{suffix}"
    assert main(["export-file", str(bag), "--vehicle", str(VEHICLE), "--out", str(file)]) == 0
    assert main(["import-file", str(file), "--vehicle", str(VEHICLE), "--out", str(tmp_path / "again")]) == 0
    back = read_recording(tmp_path / "again", load_vehicle(VEHICLE))
    assert set(back.channels) == set(recording.channels)
    for name, channel in recording.channels.items():
        other = back.channels[name]
        n = len(other.stamp_ns)
        assert n >= RATE * SECONDS - (0 if suffix == ".mf4" else 3)
        # the time base of a table may begin a few samples late; interpolating at a sample gives the sample up to rounding
        shifts = range(len(channel.stamp_ns) - n + 1)
        assert any(np.allclose(other.values, channel.values[k : k + n], rtol=0.0, atol=1e-9) for k in shifts), name
        assert np.array_equal(np.diff(other.stamp_ns), np.diff(channel.stamp_ns)[: n - 1])
    if suffix == ".mf4":
        assert back.channels[name].stamp_ns[0] == recording.channels[name].stamp_ns[0]  # MDF knows when it was


def test_units_names_and_signs_come_from_the_map(tmp_path: Path) -> None:
    numbers = [f"{10 * i};0,5;0,{i};-9,81;12,5" for i in range(5)]
    rows = ["Zeit;AX;AY;AZ;Pot", "ms;g;g;m/s²;mm", *numbers]
    (tmp_path / "run.csv").write_text("# a comment\n" + "\n".join(rows))
    (tmp_path / "map.yaml").write_text(
        "schema: ride_estimation/channels/1\nchannels:\n  cab_front_left.x: AX\n  cab_front_left.y: {channel: AY, factor: -1.0}\n"
        "  cab_front_left.z: {channel: AZ, factor: -1.0}\n"
    )
    out = tmp_path / "bag"
    arguments = ["import-file", str(tmp_path / "run.csv"), "--vehicle", str(VEHICLE), "--out", str(out)]
    assert main([*arguments, "--channels", str(tmp_path / "map.yaml")]) == 0
    messages = [m.linear_acceleration for _, _, _, m in iterate_messages(out)]
    assert [m.x for m in messages] == pytest.approx([0.5 * 9.80665] * 5)
    assert [m.y for m in messages] == pytest.approx([-0.1 * i * 9.80665 for i in range(5)])
    assert [m.z for m in messages] == pytest.approx([9.81] * 5)


def test_tdms_and_rpc_files_of_their_own_libraries(tmp_path: Path) -> None:
    nptdms, rpc3 = pytest.importorskip("nptdms"), pytest.importorskip("rpc3")
    rng = np.random.default_rng(2)
    values = {name: rng.normal(size=400) for name in ("a", "b", "c")}
    begin = np.datetime64("2026-05-01T12:00:00", "us")
    properties = {"wf_increment": 0.005, "wf_start_time": begin, "wf_start_offset": 0.0, "unit_string": "g"}
    with nptdms.TdmsWriter(tmp_path / "run.tdms") as writer:
        writer.write_segment([nptdms.ChannelObject("daq", name, v, properties=properties) for name, v in values.items()])
    found = read_measurement_file(tmp_path / "run.tdms")
    assert found.start_ns == int(begin.astype("datetime64[ns]").astype(np.int64))
    rpc3.write(str(tmp_path / "run.rpc"), [rpc3.Channel(n, "g", 0.005, v) for n, v in values.items()], datatype=float)
    for file, tolerance in ((found, 0.0), (read_measurement_file(tmp_path / "run.rpc"), 1e-6)):
        assert [c.unit for c in file.channels] == ["g"] * 3
        for channel in file.channels:
            assert channel.time_s[1] == pytest.approx(0.005)
            # RPC III holds single precision
            assert np.max(np.abs(channel.values[:400] - values[channel.name])) <= tolerance * 5.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,a\n0,1\n1,2\n", "channel map"),
        ("a [g],b\n1,2\n3,4\n", "no time column"),
        ("time,a\n0,1\n0,2\n", "does not rise"),
        ("time,a\n0,1\n1\n", "row 3 has 1 cells"),
        ("time,a\n0,1\n1,x\n", "column a, row 3: 'x' is not a number"),
        ("time,cab_front_left.x [g],cab_front_left.y [g],cab_front_left.z [g]\n0,1,2,3\n1,2,off,4\n", "row 3: 'off' is not"),
        ("time,a,timestamp,b\n0,1,0,1\n1,1,2,1\n2,1,5,1\n", "two clocks in one table ('time', 'timestamp')"),
        ("time,a,timestamp,b\n0,1,0,1\n1,1,2,1\n2,1,4,1\n", "two clocks in one table ('time', 'timestamp')"),
        ("time,a\n0,1\n1,1\n,1\n,1\n", "the time 'time' has 2 values, other columns have 4"),
        ("time,a,time2,b\n0,1,0,1\n1,1,,1\n2,1,,1\n", "'time2' has no value in rows where a column beside it has"),
        ("a,time,b,time2,c\n1,0,1,0,1\n1,1,1,2,1\n1,2,1,,\n", "and a column before the first"),
        ("time,a\n", "two rows"),
        ("", "empty"),
        ("time,cab_front_left.x [N],cab_front_left.y [N],cab_front_left.z [N]\n0,1,2,3\n1,2,3,4\n", "unit 'N'"),
        ("time,cab_front_left.x,cab_front_left.y,cab_front_left.z\n0,1,2,3\n1,2,3,4\n", "no unit"),
    ],
)
def test_bad_files_are_refused(text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "run.csv").write_text(text)
    assert main(["import-file", str(tmp_path / "run.csv"), "--vehicle", str(VEHICLE), "--out", str(tmp_path / "bag")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "bag").exists()


def test_a_bad_map_is_refused_with_all_mistakes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "run.csv").write_text("time,a\n0,1\n1,2\n")
    (tmp_path / "map.yaml").write_text(
        "schema: ride_estimation/channels/1\nchannels:\n  nothing.x: a\n  cab_front_left.x: {channel: a, unit: N}\nodd: 1\n"
    )
    arguments = ["import-file", str(tmp_path / "run.csv"), "--vehicle", str(VEHICLE), "--out", str(tmp_path / "bag")]
    assert main([*arguments, "--channels", str(tmp_path / "map.yaml")]) == 2
    told = capsys.readouterr().err
    assert all(part in told for part in ("nothing.x", "'N'", "cab_front_left.y", "odd"))


def test_a_cut_mdf_file_is_refused_in_one_line(bag: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("asammdf")
    file = tmp_path / "run.mf4"
    assert main(["export-file", str(bag), "--vehicle", str(VEHICLE), "--out", str(file)]) == 0
    file.write_bytes(file.read_bytes()[:5000])
    assert main(["import-file", str(file), "--vehicle", str(VEHICLE), "--out", str(tmp_path / "again")]) == 2
    assert capfd.readouterr().err.splitlines()[1:] == []


@pytest.mark.parametrize(
    ("suffix", "module"), [(".mf4", "asammdf"), (".tdms", "nptdms"), (".rpc", "rpc3"), (".parquet", "pyarrow")]
)
def test_a_missing_extra_is_named_and_a_damaged_file_refused(
    suffix: str, module: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / f"run{suffix}"
    file.write_bytes(b"no such file was ever written by a logger" * 20)
    arguments = ["import-file", str(file), "--vehicle", str(VEHICLE), "--out", str(tmp_path / "bag")]
    assert main(arguments) == 2  # damaged, or the extra is not there
    assert str(file) in (told := capsys.readouterr().err) or "extra 'files'" in told
    monkeypatch.setitem(sys.modules, module, None)
    assert main(arguments) == 2
    assert "ride_estimation[files]" in capsys.readouterr().err


def test_headings_and_units() -> None:
    assert split_heading("force (kN)") == ("force", "kN") and split_heading("plain") == ("plain", "")
    assert unit_factor("m/s²") == ("m/s^2", 1.0) and unit_factor("furlong") is None
    assert unit_factor("[kN]") == ("N", 1000.0)


def test_a_missing_value_leaves_the_sample_out_and_is_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    head = "time [s],cab_front_left.x [m/s^2],cab_front_left.y [m/s^2],cab_front_left.z [m/s^2],odd [N]\n"
    (tmp_path / "run.csv").write_text(head + "0,1,2,3,0\n0.1,,2,3,0\n0.2,1,2,3,0\n")
    arguments = ["import-file", str(tmp_path / "run.csv"), "--vehicle", str(VEHICLE), "--out", str(tmp_path / "bag")]
    assert main(arguments) == 0
    told = capsys.readouterr().out
    assert "cab_front_left: no value in the file (1 samples)" in told and "channel odd: belongs to no sensor" in told
    assert "2 samples of 1 sensors" in told


def test_two_time_bases_are_no_table(tmp_path: Path) -> None:
    one = [FileChannel("a", "N", np.arange(3.0), np.zeros(3))]
    with pytest.raises(InputDataError, match="one time base"):
        write_measurement_file(tmp_path / "x.csv", [one, one], 0)
    with pytest.raises(InputDataError, match="allowed endings"):
        write_measurement_file(tmp_path / "x.xls", [one], 0)


ROWS = [[0.01 * i, 0.5, -0.25 * i, 9.81] for i in range(5)]


@pytest.mark.parametrize(
    ("separator", "comma", "encoding", "above", "end"),
    [
        (";", True, "cp1252", "", ";"),
        ("\t", True, "utf-16", "", ""),
        ("\t", False, "utf-8", "", ""),
        (",", False, "utf-8-sig", "Logger 7\nSerial; none\n\n", ""),
        (";", True, "utf-8", "Messung 12\nDatum: 1.5.2026\n", ""),
        (",", False, "utf-8", "Run 7,,,\nBackhoe,,,\n", ""),
    ],
)
def test_tables_as_loggers_write_them(
    separator: str, comma: bool, encoding: str, above: str, end: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def cells(values: list[str]) -> str:
        return separator.join(values) + end + "\n"

    names = ["time [s]", *(f"cab_front_left.{a} [m/s²]" for a in "xyz")]
    body = "".join(cells([f"{v:.4f}".replace(".", "," if comma else ".") for v in row]) for row in ROWS)
    file = tmp_path / "run.csv"
    file.write_bytes((above + cells(names) + body).encode(encoding))
    found = read_measurement_file(file)
    assert [(c.name, c.unit) for c in found.channels] == [(f"cab_front_left.{a}", "m/s²") for a in "xyz"]
    assert np.array_equal(np.stack([found.channels[0].time_s, *(c.values for c in found.channels)], axis=1), np.array(ROWS))
    # a broken cell is named by its line in the file, the lines above the header counted
    file.write_bytes((above + cells(names) + body.replace("9", "q", 1)).encode(encoding))
    assert f"row {above.count(chr(10)) + 2}: 'q" in read_measurement_file(file).unreadable["cab_front_left.z"]


COLUMNS = ",".join(f"cab_front_left.{a} [m/s^2]" for a in "xyz")


@pytest.mark.parametrize(
    ("heading", "unit", "scale", "places"),
    [
        ("Time_ms", "", 1e3, 3), ("time [us]", "", 1e6, 3), ("Timestamp_ns", "", 1e9, 0), ("t", "", 1.0, 6),
        ("Zeit (ms)", "", 1e3, 3),
        ("Clock", "ms", 1e3, 3), ("time", "us", 1e6, 3),
        # a resolution of 0.1 ms and of 1 ms at 800 Hz: every fifth stamp is repeated
        ("time [s]", "", 1.0, 4), ("Time_ms", "", 1e3, 0),
    ],
)  # fmt: skip
def test_the_unit_of_the_time_is_read_from_heading_name_or_map(
    heading: str, unit: str, scale: float, places: int, tmp_path: Path
) -> None:
    time = np.arange(400) / 800.0
    file = tmp_path / "run.csv"
    file.write_text(f"{heading},{COLUMNS}\n" + "".join(f"{t * scale:.{places}f},1,2,3\n" for t in time))
    found = read_measurement_file(file, TimeSource(heading if unit else "", unit)).channels[0].time_s
    assert np.max(np.abs(found - time)) <= max(0.6 * 10.0**-places / scale, 1e-12)
    assert np.all(np.diff(found) > 0.0)


def test_stamps_that_repeat_for_another_reason_than_rounding_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    file.write_text(f"time,{COLUMNS}\n" + "".join(f"{t},1,2,3\n" for t in (0.0, 0.1, 0.1, 0.2, 0.3, 2.0, 2.1)))
    with pytest.raises(InputDataError, match="does not rise at sample 2"):
        read_measurement_file(file)


def test_columns_of_text_units_with_gaps_and_a_second_clock_column_do_not_stop_an_import(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = "".join(f"{0.01 * k:.2f},{1000 + 10 * k},1000,-2,3,ok {k},{k % 2}\n" for k in range(50))
    head = "time,timestamp,cab_front_left.x,cab_front_left.y,cab_front_left.z,status,flag\ns,ms,mg,g,ft/s^2,,\n"
    (tmp_path / "run.csv").write_text(head + rows)
    arguments = ["import-file", str(tmp_path / "run.csv"), "--vehicle", str(VEHICLE), "--out", str(tmp_path / "bag")]
    assert main(arguments) == 0
    assert "column status: holds text (row 3: 'ok 0' is not a number)" in capsys.readouterr().out
    first = next(iter(iterate_messages(tmp_path / "bag")))[3].linear_acceleration
    assert (first.x, first.y, first.z) == pytest.approx((9.80665, -2 * 9.80665, 3 * 0.3048))


def test_two_clocks_side_by_side_are_each_the_time_of_the_columns_on_their_right(tmp_path: Path) -> None:
    rows = [f"{0.01 * k:.2f},{k}," + (f"{20 * k},{3 * k},ok" if k < 6 else ",,late") for k in range(11)]
    (tmp_path / "run.csv").write_text("Time,a,Time_ms,b,note\n" + "\n".join(rows) + "\n")
    file = read_measurement_file(tmp_path / "run.csv")
    first, second = file.channels
    assert (first.name, second.name) == ("a", "b") and file.events == ((0.0, "ok"), (0.06, "late"))
    assert first.time_s == pytest.approx(0.01 * np.arange(11)) and first.values.tolist() == list(range(11))
    assert second.time_s == pytest.approx(0.02 * np.arange(6)) and second.values.tolist() == [3 * k for k in range(6)]


@pytest.mark.parametrize(
    ("heading", "texts"),
    [
        ("DateTime", ["2026-03-12T23:59:59.990", "2026-03-13 00:00:00", "2026-03-13T00:00:00.010"]),
        ("Zeit", ["12.03.2026 23:59:59,990", "13.03.2026 00:00:00", "13.03.2026 00:00:00,010"]),
        ("Time [HH:MM:SS]", ["23:59:59.990", "0:00:00", "00:00:00.010"]),
    ],
)
def test_a_time_may_be_dates_or_times_of_day(heading: str, texts: list[str], tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(f"{heading};a\n" + "".join(f"{text};1\n" for text in texts))
    (channel,) = read_measurement_file(tmp_path / "run.csv").channels
    assert np.diff(channel.time_s) == pytest.approx([0.01, 0.01], abs=1e-6)
    if "2026" in texts[0]:
        assert channel.time_s[1] == datetime.datetime(2026, 3, 13, tzinfo=datetime.UTC).timestamp()


def test_a_reader_of_a_library_draws_no_bar_between_the_lines_of_a_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rpc3 = pytest.importorskip("rpc3")
    rpc3.write(str(tmp_path / "run.rsp.rpc"), [rpc3.Channel("a", "g", 0.005, np.arange(2048.0))], datatype=float)
    (tmp_path / "run.rsp.rpc").rename(tmp_path / "run.rsp")
    capsys.readouterr()
    assert main(["inspect", str(tmp_path / "run.rsp")]) == 0
    assert capsys.readouterr().err == ""


def test_units_of_test_rigs_abroad() -> None:
    assert unit_factor("kip") == ("N", pytest.approx(4448.2216)) and unit_factor("lbf") == ("N", pytest.approx(4.4482216))
    assert unit_factor("psi") == ("Pa", pytest.approx(6894.757)) and unit_factor("in") == ("m", 0.0254)
    assert unit_factor("mg") == ("m/s^2", pytest.approx(9.80665e-3))


def test_an_import_says_what_cannot_be(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = "".join(f"{2 * k},0.01,0.02,{1 + 0.01 * (k % 7)}\n" for k in range(100))
    (tmp_path / "run.csv").write_text(f"clock,{COLUMNS}\n{rows}")
    (tmp_path / "map.yaml").write_text(
        "schema: ride_estimation/channels/1\ntime: {channel: clock}\nchannels:\n"
        + "".join(f"  cab_front_left.{a}: cab_front_left.{a}\n" for a in "xyz")
    )
    arguments = ["import-file", str(tmp_path / "run.csv"), "--vehicle", str(VEHICLE), "--out", str(tmp_path / "bag")]
    assert main([*arguments, "--channels", str(tmp_path / "map.yaml")]) == 0
    told = capsys.readouterr().out
    assert "cab_front_left: 0.5 Hz is outside 10 Hz to 20 kHz, where ride is measured: is the time in ms?" in told
    assert "the values look like g, not m/s^2" in told


@pytest.mark.parametrize(
    ("text", "words"),
    [("{channel: clock, unit: hours}", "time.unit"), ("{rate_rpm: 500}", "rate_rpm"), ("{rate_hz: 0}", "rate_hz")],
)
def test_a_time_of_the_map_that_cannot_be_is_refused(
    text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "run.csv").write_text(f"clock,{COLUMNS}\n0,1,2,3\n1,2,3,4\n")
    (tmp_path / "map.yaml").write_text(f"schema: ride_estimation/channels/1\ntime: {text}\nchannels: {{cab_front_left.x: a}}\n")
    arguments = ["import-file", str(tmp_path / "run.csv"), "--vehicle", str(VEHICLE), "--out", str(tmp_path / "bag")]
    assert main([*arguments, "--channels", str(tmp_path / "map.yaml")]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("comma", [False, True])
@pytest.mark.parametrize("x_columns", ["One", "Multi", "No"])
def test_labview_measurement_files(x_columns: str, comma: bool, tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    columns = [(f"a{i}", "g", rng.normal(size=50)) for i in range(3)]
    (tmp_path / "run.lvm").write_text(lvm_text(columns, 0.002, x_columns, comma))
    found = read_measurement_file(tmp_path / "run.lvm").channels
    assert [(c.name, c.unit) for c in found] == [(name, unit) for name, unit, _ in columns]
    for channel, (_, _, values) in zip(found, columns, strict=True):
        assert np.array_equal(channel.values, values)
        assert np.allclose(channel.time_s, 0.002 * np.arange(50), rtol=0.0, atol=1e-9)


def test_a_labview_file_of_several_segments_or_with_text_is_refused(tmp_path: Path) -> None:
    text = lvm_text([("a", "g", np.arange(5.0))], 0.01, "One")
    for changed, words in (
        (text + text, "segments"), (text.replace("3.0", "x3", 1), "row 20: 'x3'"), (text[:100], "two headers")
    ):  # fmt: skip
        (tmp_path / "run.lvm").write_text(changed)
        with pytest.raises(InputDataError, match=words):
            read_measurement_file(tmp_path / "run.lvm")


def test_columns_of_different_length_are_damage(tmp_path: Path) -> None:
    with pytest.raises(InputDataError, match="differ in length"):
        table_channels(tmp_path / "run", [("time", "s"), ("a", "g")], [np.arange(3.0), np.zeros(2)], TimeSource())
