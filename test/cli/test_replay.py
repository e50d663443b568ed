# Copyright 2026 ride_estimation contributors
"""The replay command end to end on a run of the independent world: files, shapes, determinism, every kind of bad input."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import faults
import numpy as np
import pytest
import yaml
from worlds.adapters import recording as as_recording
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.roads import Road
from worlds.vehicle_text import vehicle_yaml

from ride_estimation.cli.main import main
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.settings_file import load_settings
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.signals.recording import Channel, Recording

ROOT = Path(__file__).parents[2]
SECONDS = 12.0


@dataclasses.dataclass(frozen=True)
class Case:
    vehicle: Path
    bag: Path
    recording: Recording
    truth: dict[str, np.ndarray]
    out: Path
    printed: str


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """A random cab on a random road, replayed once."""
    folder = tmp_path_factory.mktemp("replay")
    rng = np.random.default_rng(11)
    cab = random_vehicle(rng, "rubber")
    data = measure(drive(cab, Road.random(rng), SECONDS, 11), random_sensors(cab, rng), 200.0, 11, noise_share=0.01)
    (folder / "vehicle.yaml").write_text(vehicle_yaml(cab, data.sensors, None, 11))
    recording = as_recording(data)
    write_bag(folder / "run", recording, load_vehicle(folder / "vehicle.yaml").sensors)
    arguments = ["replay", str(folder / "run"), "--vehicle", str(folder / "vehicle.yaml"), "--out", str(folder / "out")]
    assert main(arguments) == 0
    truth = {key: np.asarray(data.truth[key]) for key in ("cg_accel", "mount_force")}
    return Case(folder / "vehicle.yaml", folder / "run", recording, truth, folder / "out", "")


def replayed(case: Case, out: Path, run: Path | None = None, *extra: str) -> int:
    return main(["replay", str(run or case.bag), "--vehicle", str(case.vehicle), "--out", str(out), "--no-report", *extra])


def test_files_have_the_shapes_outsiders_rely_on(case: Case) -> None:
    with np.load(case.out / "signals.npz") as s:
        n, m = len(s["time_s"]), len(s["mount_names"])
        assert m == 4 and n >= 200 * SECONDS - 5
        shapes = {
            "cg_accel": (n, 6), "cg_accel_std": (n, 6), "inertial_load": (n, 6), "mount_force": (n, m, 3),
            "mount_force_std": (n, m, 3), "mount_deflection": (n, m, 3), "mount_force_smoothed": (n, m, 3),
            "mount_force_smoothed_std": (n, m, 3), "mount_deflection_smoothed": (n, m, 3),
        }  # fmt: skip
        for name, shape in shapes.items():
            assert s[name].shape == shape and np.isfinite(s[name]).all(), name
        assert np.allclose(np.diff(s["time_s"]), 0.005)
    result = json.loads((case.out / "result.json").read_text())
    inertia = result["inertia_kg_m2"]
    assert set(inertia) == {"ixx", "iyy", "izz"}
    for moment in inertia.values():  # what the moments were computed with, and how sure it is
        assert 0.0 < moment["std"] < 0.2 * moment["value"]
        assert abs(moment["value"] - moment["file"]) < 4 * moment["std"]
    assert set(result) >= {"schema", "software", "run", "vehicle", "parameters", "identifiability", "fit", "warnings"}
    assert result["run"]["path"] == "run" and len(result["run"]["checksum"]) == 64
    assert result["run"]["duration_s"] == pytest.approx(SECONDS, abs=0.05)
    assert set(result["run"]["channels"]) == set(case.recording.channels)
    assert all({"samples", "rate_hz", "gaps", "clipped"} <= set(c) for c in result["run"]["channels"].values())
    assert result["vehicle"]["checksum"] == load_vehicle(case.vehicle).checksum
    for p in result["parameters"] + result["parameters_smoothed"] + result["mass_properties"]:
        assert set(p) == {"name", "value", "std", "unit", "prior", "status", "reason"}


def test_smoothing_can_be_left_out_and_the_forces_are_then_those_of_the_node(case: Case, tmp_path: Path) -> None:
    assert replayed(case, tmp_path / "bare", None, "--no-smoothing") == 0
    bare, whole = (json.loads((place / "result.json").read_text()) for place in (tmp_path / "bare", case.out))
    assert whole["forces"]["smoothed"] and not bare["forces"]["smoothed"]
    assert "not asked for" in bare["forces"]["meaning"]["mount_force_smoothed"]
    assert bare["digest"] == whole["digest"] and bare["parameters_smoothed"] == bare["mass_properties"] == []
    with np.load(tmp_path / "bare" / "signals.npz") as live, np.load(case.out / "signals.npz") as both:
        smoothed = {"mount_force_smoothed", "mount_force_smoothed_std", "mount_deflection_smoothed"}
        before = {name.replace("smoothed", "hindsight") for name in smoothed}
        assert set(both) - set(live) == smoothed | before
        assert all(np.array_equal(both[name], both[name.replace("smoothed", "hindsight")]) for name in smoothed)
        assert all(np.array_equal(live[name], both[name]) for name in live)


def test_the_motion_is_that_of_the_world(case: Case) -> None:
    with np.load(case.out / "signals.npz") as s:
        found, n = s["cg_accel"], len(s["time_s"])
    truth = case.truth["cg_accel"][:n]
    moving = slice(n // 3, n - 5)
    # angular and vertical acceleration need no attitude; 10 % of their standard deviation is ten times the 1 % noise
    for column in (2, 3, 4, 5):
        error = np.sqrt(np.mean((found[moving, column] - truth[moving, column]) ** 2))
        assert error < 0.1 * np.std(truth[moving, column]), column


def test_the_report_is_one_offline_file_with_pictures(case: Case) -> None:
    text = (case.out / "report.html").read_text()
    assert "http://" not in text and "https://" not in text
    assert text.count('<figure class="chart">') >= 4 + 1 + 4 + 2
    order = ("most damaging load", "What is not known", "<nav>", ">Attachment forces</h2>", ">Data quality</h2>", "SHA-256")
    places = [text.index(words) for words in order]
    assert places == sorted(places)
    assert "smoothed forces" in text and "Dashed beside them" in text
    assert len(text) < 4_000_000


def test_twice_the_same_bytes(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert replayed(case, tmp_path / "again") == 0
    printed = capsys.readouterr().out
    for name in ("result.json", "signals.npz"):
        assert (tmp_path / "again" / name).read_bytes() == (case.out / name).read_bytes()
    digest = json.loads((case.out / "result.json").read_text())["digest"]
    assert f"digest {digest}" in printed


def test_settings_are_those_of_the_node(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plain = tmp_path / "plain.yaml"
    defaults = {k: 0.0 if v is None else v for k, v in dataclasses.asdict(PipelineSettings()).items()}
    plain.write_text(yaml.safe_dump({"/**": {"ros__parameters": {**defaults, "executor": "events"}}}))
    assert load_settings(plain) == PipelineSettings()
    assert replayed(case, tmp_path / "plain", None, "--settings", str(plain), "--no-smoothing") == 0
    digests = [json.loads((p / "result.json").read_text())["digest"] for p in (case.out, tmp_path / "plain")]
    assert digests[0] == digests[1]
    other = tmp_path / "other.yaml"
    other.write_text("/**:\n  ros__parameters:\n    rate_hz: 100.0\n    estimate_parameters: false\n    autostart: true\n")
    assert replayed(case, tmp_path / "other", None, "--settings", str(other), "--no-smoothing") == 0
    with np.load(tmp_path / "other" / "signals.npz") as s:
        assert np.allclose(np.diff(s["time_s"]), 0.01)
    for text, words in (
        ("a: 1\n", "ros__parameters"),
        ("/**:\n  ros__parameters:\n    block_ticks: 2.5\n    rate_hz: fast\n", "2 mistakes"),
        ("/**:\n  ros__parameters:\n    largest_ratio: 0.5\n", "largest_ratio"),
    ):
        other.write_text(text)
        assert words in refused(["replay", str(case.bag), "--vehicle", str(case.vehicle), "--out", str(tmp_path / "o"),
                                 "--settings", str(other)], capsys)  # fmt: skip


def test_bundled_vehicles_are_found_by_name(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # found and read: what is refused is the bag, which has other topics
    text = refused(["replay", str(case.bag), "--vehicle", "single_imu", "--out", str(tmp_path / "o")], capsys)
    assert "the run has no topic /imu/data" in text
    assert "no_such" in refused(["replay", str(case.bag), "--vehicle", "no_such", "--out", str(tmp_path / "o")], capsys)


def test_containers_do_not_matter(case: Case, tmp_path: Path) -> None:
    write_bag(tmp_path / "sql", case.recording, load_vehicle(case.vehicle).sensors, storage="sqlite3")
    assert replayed(case, tmp_path / "out", tmp_path / "sql", "--no-smoothing") == 0
    first, second = (json.loads((p / "result.json").read_text()) for p in (case.out, tmp_path / "out"))
    assert first["digest"] == second["digest"] and first["run"]["checksum"] != second["run"]["checksum"]


def change_vehicle(case: Case, path: Path, change: Callable[[dict[str, Any]], Any]) -> Path:
    document = yaml.safe_load(case.vehicle.read_text())
    change(document)
    path.write_text(yaml.safe_dump(document))
    return path


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    capsys.readouterr()
    assert main(arguments) == 2
    text = capsys.readouterr().err
    assert "Traceback" not in text
    return text


def test_bad_paths_and_files_are_refused_with_one_message(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ["--out", str(tmp_path / "o")]
    vehicle = ["--vehicle", str(case.vehicle)]
    (tmp_path / "empty.mcap").touch()
    data = (case.bag / "run.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) // 2])
    (tmp_path / "broken.yaml").write_text("schema: [")
    (tmp_path / "file").touch()
    assert "does not exist" in refused(["replay", str(tmp_path / "none"), *vehicle, *out], capsys)
    assert "is empty" in refused(["replay", str(tmp_path / "empty.mcap"), *vehicle, *out], capsys)
    assert "--salvage" in refused(["replay", str(tmp_path / "cut.mcap"), *vehicle, *out], capsys)
    assert "not valid YAML" in refused(["replay", str(case.bag), "--vehicle", str(tmp_path / "broken.yaml"), *out], capsys)
    assert "output folder" in refused(["replay", str(case.bag), *vehicle, "--out", str(tmp_path / "file")], capsys)
    assert "no such sensor" in refused(["replay", str(case.bag), *vehicle, *out, "--without", "nose"], capsys)


def test_a_truncated_bag_can_be_salvaged(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = (case.bag / "run.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: int(0.7 * len(data))])
    assert replayed(case, tmp_path / "o", tmp_path / "cut.mcap", "--salvage") == 0
    assert "truncated" in capsys.readouterr().out


def test_a_vehicle_file_with_mistakes_lists_all_of_them(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def spoil(d: dict[str, Any]) -> None:
        d["bodies"]["cab"]["mass_kg"] = -1.0
        d["gravity"] = 9.81

    vehicle = change_vehicle(case, tmp_path / "v.yaml", spoil)
    text = refused(["replay", str(case.bag), "--vehicle", str(vehicle), "--out", str(tmp_path / "o")], capsys)
    assert "2 mistakes" in text and "bodies.cab.mass_kg" in text and "gravity" in text


@pytest.mark.parametrize(
    ("keep", "words"), [(1, "determine 3 of 6"), (2, "determine 5 of 6"), (0, "no accelerometer")], ids=["one", "two", "none"]
)
def test_too_few_sensors_are_refused_with_what_is_missing(
    case: Case, keep: int, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cab = [n for n, s in load_vehicle(case.vehicle).sensors.items() if s.body == "cab"]
    dropped = [word for name in cab[keep:] for word in ("--without", name)]
    text = refused(["replay", str(case.bag), "--vehicle", str(case.vehicle), "--out", str(tmp_path / "o"), *dropped], capsys)
    assert words in text


def test_sensors_on_one_line_are_refused(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def in_line(d: dict[str, Any]) -> None:
        for i, sensor in enumerate(s for s in d["sensors"].values() if s["body"] == "cab"):
            sensor["position_m"] = [0.5 * i, 0.0, 0.2]

    vehicle = change_vehicle(case, tmp_path / "v.yaml", in_line)
    text = refused(["replay", str(case.bag), "--vehicle", str(vehicle), "--out", str(tmp_path / "o")], capsys)
    assert "determine 5 of 6" in text and "roll" in text


def test_a_sensor_that_never_speaks_is_refused_and_can_be_left_out(
    case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vehicle = load_vehicle(case.vehicle)
    silent = next(iter(vehicle.sensors))
    channels = {n: c for n, c in case.recording.channels.items() if n != silent}
    write_bag(tmp_path / "run", Recording("r", channels), vehicle.sensors)
    text = refused(["replay", str(tmp_path / "run"), "--vehicle", str(case.vehicle), "--out", str(tmp_path / "o")], capsys)
    assert f"{silent}: the run has no topic" in text and "topics in the run" in text
    assert replayed(case, tmp_path / "o", tmp_path / "run", "--without", silent, "--no-smoothing") == 0


def faulty(case: Case, folder: Path, sensor: str, change: Callable[[Channel], Channel]) -> Path:
    channels = {n: change(c) if sensor in (n, "all") else c for n, c in case.recording.channels.items()}
    write_bag(folder, Recording("r", channels), load_vehicle(case.vehicle).sensors)
    return folder


def put(channel: Channel, places: slice | np.ndarray, *, stamp: int | None = None, value: float | None = None) -> Channel:
    stamps, values = channel.stamp_ns.copy(), channel.values.copy()
    if stamp is not None:
        stamps[places] = stamp
    if value is not None:
        values[places, 1] = value
    return dataclasses.replace(channel, stamp_ns=stamps, values=values)


def jump(channel: Channel, seconds: float, after: int = 600) -> Channel:
    """Header stamps jump, the recorder's clock does not."""
    stamps = channel.stamp_ns.copy()
    stamps[after:] += round(seconds * faults.SECOND)
    return dataclasses.replace(channel, stamp_ns=stamps)


def part(channel: Channel, keep: slice | np.ndarray) -> Channel:
    return Channel(channel.name, channel.stamp_ns[keep], channel.values[keep], channel.arrival_ns[keep])


FAULTS: dict[str, tuple[str, Callable[[Channel], Channel], str, int | None]] = {
    # sensor (one or all), fault, counter or words in the warnings, expected count
    "nan": ("one", lambda c: put(c, slice(300, 320), value=float("nan")), "not_finite", 20),
    "infinity": ("one", lambda c: put(c, slice(300, 310), value=float("inf")), "not_finite", 10),
    "stamp zero": ("one", lambda c: put(c, slice(300, 305), stamp=0), "stamp_not_positive", 5),
    "duplicates": ("one", lambda c: part(c, np.sort(np.r_[0 : len(c.stamp_ns), 100:1000:50])), "duplicate", 18),
    "stops": ("one", lambda c: part(c, slice(0, 500)), "has stopped", None),
    "stops, seen beforehand": ("one", lambda c: part(c, slice(0, 500)), "ends 9.5 s before the run", None),
    "starts late": ("one", lambda c: part(c, slice(500, None)), "begins 2.5 s after the run", None),
    "gap": ("one", lambda c: part(c, np.r_[0:500, 560 : len(c.stamp_ns)]), "1 gaps", None),
    "clock runs back": ("all", lambda c: jump(c, -1000.0), "clock_behind", None),
    "clock runs ahead": ("all", lambda c: jump(c, 1000.0), "clock_ahead", None),
}  # fmt: skip

#: faults like one of the others
ALIKE = ("infinity", "duplicates", "starts late", "clock runs ahead")


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] if n in ALIKE else []) for n in sorted(FAULTS)])
def test_bad_samples_are_counted_by_reason_and_nothing_becomes_nan(name: str, case: Case, tmp_path: Path) -> None:
    which, change, words, count = FAULTS[name]
    sensor = next(iter(case.recording.channels)) if which == "one" else "all"
    run = faulty(case, tmp_path / "run", sensor, change)
    assert replayed(case, tmp_path / "o", run) == 0
    result = json.loads((tmp_path / "o" / "result.json").read_text())
    with np.load(tmp_path / "o" / "signals.npz") as s:
        assert all(np.isfinite(s[key]).all() for key in s.files if s[key].dtype.kind == "f")
    if count is not None:
        assert result["run"]["channels"][sensor]["rejected"] == {words: count}
    assert any(words in w for w in result["warnings"]), result["warnings"]
    channels = result["run"]["channels"]
    assert all(c["used"] + sum(c["rejected"].values()) == c["samples"] for c in channels.values())
    if which == "all":
        assert sum(result["run"]["restarts"].values()) == 1


def test_exchanged_topics_are_named(case: Case, tmp_path: Path) -> None:
    shutil.copytree(case.bag, tmp_path / "run")

    def exchange(d: dict[str, Any]) -> None:
        a, b = [s for s in d["sensors"].values() if s["body"] == "cab"][:2]
        a["topic"], b["topic"] = b["topic"], a["topic"]

    vehicle = change_vehicle(case, tmp_path / "v.yaml", exchange)
    options = ["--vehicle", str(vehicle), "--out", str(tmp_path / "o"), "--no-report", "--no-smoothing"]
    assert main(["replay", str(case.bag), *options]) == 0
    warnings = json.loads((tmp_path / "o" / "result.json").read_text())["warnings"]
    a, b = [n for n, s in load_vehicle(vehicle).sensors.items() if s.body == "cab"][:2]
    assert any(f"exchanged topics of {a} and {b}" in w for w in warnings)


@pytest.mark.slow
@pytest.mark.parametrize(("change", "words", "size", "unit"), [
    ({"position_m": [0.75, 0.55, -0.35]}, "by its position", 50.0, "mm"),
    ({"rotation_deg": [0.0, 2.0, 0.0]}, "by its misalignment", 2.0, "deg"),
])  # fmt: skip
def test_a_sensor_beside_its_place_or_turned_is_named_with_the_size_of_the_error(
    change: dict[str, Any], words: str, size: float, unit: str, tmp_path: Path
) -> None:
    """Bundled run, vehicle file 50 mm or 2 degrees wrong at one sensor; the size within three stated standard deviations."""
    document = yaml.safe_load((ROOT / "config" / "vehicles" / "truck_cab.yaml").read_text(encoding="utf-8"))
    document["sensors"]["cab_front_left"].update(change)
    (tmp_path / "v.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
    arguments = ["replay", str(ROOT / "bags" / "rough_with_bumps"), "--vehicle", str(tmp_path / "v.yaml"), "--no-report"]
    assert main([*arguments, "--out", str(tmp_path / "o")]) == 0
    (warning,) = [w for w in json.loads((tmp_path / "o" / "result.json").read_text())["warnings"] if "rigid body" in w]
    assert "cab_front_left" in warning and words in warning
    found = re.search(rf"([\d.]+) \+- ([\d.]+) {unit}", warning)
    assert found is not None, warning
    assert abs(float(found[1]) - size) <= 3.0 * float(found[2]) < 0.5 * size


def test_no_report_of_an_earlier_call_stands_beside_new_results(case: Case, tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    for name in ("report.html", "report.pdf", "pictures/01_old.png", "mine.html"):
        (tmp_path / name).write_text("old")
    assert replayed(case, tmp_path, None, "--no-smoothing") == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mine.html", "result.json", "signals.npz"]


@pytest.mark.parametrize(("samples", "code"), [(1, 2), (20, 0)])
def test_a_run_of_a_moment_is_refused_or_reported(case: Case, tmp_path: Path, samples: int, code: int) -> None:
    def first(channel: Channel) -> Channel:
        return Channel(channel.name, channel.stamp_ns[:samples], channel.values[:samples], channel.arrival_ns[:samples])

    short = dataclasses.replace(case.recording, channels={name: first(c) for name, c in case.recording.channels.items()})
    write_bag(tmp_path / "run", short, load_vehicle(case.vehicle).sensors)
    arguments = ["replay", str(tmp_path / "run"), "--vehicle", str(case.vehicle), "--out", str(tmp_path / "o")]
    assert main(arguments) == code
    assert (tmp_path / "o" / "report.html").is_file() == (code == 0)
