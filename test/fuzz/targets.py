# Copyright 2026 ride_estimation contributors
"""Every reader of files from outside as a fuzz target: good files to start from, and what is done with a bad one.

A target may succeed or raise an error of :mod:`ride_estimation.errors`; anything else is a finding.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import io
import json
import shutil
import zipfile
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from fuzz.measurements import MAP, measurement_formats, read, read_map
from fuzz.recordings import SENSORS, VEHICLE, bench_files, db3_files, mcap_files, ros1_files, small_recording
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.bags import iterate_messages, read_recording
from ride_estimation.io.bags_bench import read_bag_columns
from ride_estimation.io.bench_records import ReadOptions, read_bench_record, read_operating_points
from ride_estimation.io.bounded import read_arrays
from ride_estimation.io.playback import recorded_messages
from ride_estimation.io.result_files import read_replay
from ride_estimation.io.scenario_file import load_scenario
from ride_estimation.io.settings_file import load_settings
from ride_estimation.io.state_file import restore_state, save_state
from ride_estimation.io.tables import read_table
from ride_estimation.io.vehicle_file import load_vehicle, save_vehicle
from ride_estimation.reporting.page import Page
from ride_estimation.resources import shared_path
from ride_estimation.sensors.quality import judge_sensors
from ride_estimation.vehicles.vehicle import Vehicle


@dataclasses.dataclass(frozen=True)
class Target:
    """One reader.

    Attributes
    ----------
    suffix
        Of the file that is damaged.
    seeds
        Makes good files; the argument is an empty folder.
    consume
        ``consume(file, folder)`` reads the damaged ``file`` in the scratch ``folder``.
    words
        Pieces that mean something in the format.
    """

    suffix: str
    seeds: Callable[[Path], list[bytes]]
    consume: Callable[[Path, Path], None]
    words: Sequence[bytes] = ()


# -- recordings -----------------------------------------------------------------------------------------------------------


def read_run(path: Path, vehicle: Vehicle = VEHICLE) -> None:
    """Read a run in one of the ways the package can; its bytes choose which."""
    files = [path] if path.is_file() else sorted(path.iterdir())
    way = zlib.crc32(b"".join(f.read_bytes() for f in files)) % 6
    if way < 4:
        recording = read_recording(path, vehicle, salvage=way % 2 == 1)
        judge_sensors(recording, vehicle.sensors, 9.81)
    elif way == 4:
        for _ in iterate_messages(path, salvage=True):
            pass
    else:
        for _ in recorded_messages(path, [s.topic for s in vehicle.sensors.values()]):
            pass


def _run(file: Path, folder: Path) -> None:
    read_run(file)


def _ros1_run(file: Path, folder: Path) -> None:
    read_run(file, Vehicle("v", {}, {}, {"accel": SENSORS["accel"]}))


def _bench_bag(file: Path, folder: Path) -> None:
    read_bag_columns(file, "fl", "z")


def _metadata(folder: Path) -> list[bytes]:
    write_bag(folder / "run", small_recording(), SENSORS)
    plain = (folder / "run" / "metadata.yaml").read_bytes()
    return [plain]


def _metadata_run(file: Path, folder: Path) -> None:
    run = folder / "run"
    if not run.exists():
        write_bag(run, small_recording(), SENSORS)
    shutil.copyfile(file, run / "metadata.yaml")
    read_run(run)


# -- text files -----------------------------------------------------------------------------------------------------------

YAML_WORDS = (
    b"&a ",
    b"*a",
    b"[",
    b"]",
    b"{",
    b"}",
    b": ",
    b"- ",
    b"\n",
    b"\n  ",
    b"!!python/object/apply:os.system ",
    b"!!binary ",
    b"!!timestamp ",
    b"!!set ",
    b"!!omap ",
    b"!!int ",
    b".nan",
    b".inf",
    b"-.inf",
    b"1e999",
    b"~",
    b"null",
    b"yes",
    b"0x",
    b"1:1:1",
    b"2001-01-01 00:00:00 +99:99",
    b"<<: *a",
    b"? ",
    b"---\n",
    b"...\n",
    b"%YAML 9.9\n",
    b"\xef\xbb\xbf",
    b"\\ud800",
    b'"',
    b"'",
    b"9" * 5000,
    b"[" * 500,
    b"../../x",
    b"\x00",
    b"_kg",
    b"_mm",
    b"value",
    b"std",
    b"range",
)
CSV_WORDS = (
    b",",
    b";",
    b"\t",
    b"\n",
    b"\r",
    b'"',
    b'""',
    b"nan",
    b"inf",
    b"1e999",
    b"#",
    b"_mm",
    b"time_s",
    b"\x00",
    b"\xff",
    b'"' * 40,
)
JSON_WORDS = (
    b"null",
    b"NaN",
    b"Infinity",
    b"-Infinity",
    b"1e999",
    b"[",
    b"]",
    b"{",
    b"}",
    b'"',
    b",",
    b":",
    b"[" * 3000,
    b"9" * 5000,
    b"true",
    b'"\\ud800"',
    b"-1",
    b"0",
    b"1e308",
    b"[]",
    b"{}",
    b'"x"',
)


def files(*names: tuple[str, ...]) -> Callable[[Path], list[bytes]]:
    return lambda folder: [shared_path(*name).read_bytes() for name in names]


def _vehicle(file: Path, folder: Path) -> None:
    save_vehicle(load_vehicle(file), folder / "saved.yaml")


TABLE = b"rise_mm,force_n\n0.0,100.0\n1.0,105.5\n2.0,111.25\n"
RECORD = b"time_s,displacement_mm,force_kn\n" + b"".join(
    f"{0.01 * k:.2f},{5.0 * np.sin(0.3 * k):.4f},{0.5 * np.sin(0.3 * k) + 0.05 * np.cos(0.3 * k):.5f}\n".encode()
    for k in range(240)
)
HARMONIC = b"frequency_hz;amplitude_mm;stiffness_n_per_mm;loss_energy_j\n1.0;0.5;100.0;0.02\n2.0;0.5;110.0;0.025\n"


def _bench(file: Path, folder: Path) -> None:
    if read_operating_points(file) is None:
        read_bench_record(file, ReadOptions())


def _npz_seed(folder: Path) -> list[bytes]:
    t = np.arange(240) * 0.01
    found = []
    for save in (np.savez, np.savez_compressed):
        buffer = io.BytesIO()
        save(buffer, time_s=t, displacement_mm=5.0 * np.sin(30.0 * t), force_kn=0.5 * np.sin(30.0 * t))
        found.append(buffer.getvalue())
    return found


def _array_seed(folder: Path) -> list[bytes]:
    found = []
    for values in (np.sin(np.arange(240) * 0.3), np.arange(240, dtype=np.int32).reshape(2, 120)):
        buffer = io.BytesIO()
        np.save(buffer, values)
        found.append(buffer.getvalue())
    return found


def _array(file: Path, folder: Path) -> None:
    """Read a damaged array in a sound archive, which no checksum of the archive protects."""
    with zipfile.ZipFile(folder / "run.npz", "w") as archive:
        archive.writestr("force_kn.npy", file.read_bytes())
    forget(read_arrays(folder / "run.npz"))


def _mat_seed(folder: Path) -> list[bytes]:
    from scipy.io import savemat

    t = np.arange(240) * 0.01
    found = []
    for compressed in (False, True):
        buffer = io.BytesIO()
        columns = {"time_s": t, "displacement_mm": 5.0 * np.sin(30.0 * t), "force_kn": 0.5 * np.sin(30.0 * t)}
        savemat(buffer, columns, do_compression=compressed)
        found.append(buffer.getvalue())
    return found


# -- results and states ---------------------------------------------------------------------------------------------------

RESULT = {
    "schema": "ride_estimation/result/1",
    "warnings": ["w"],
    "digest": "d",
    "vehicle": {"name": "v", "checksum": "c"},
    "run": {"path": "p", "checksum": "c", "duration_s": 1.0, "channels": {}},
    "parameters": [
        {"name": "a.z.stiffness", "value": 1.0, "std": 0.1, "unit": "N/m", "prior": 1.0, "status": "valid", "reason": ""}
    ],
}


def _signals() -> bytes:
    buffer = io.BytesIO()
    n = 8
    np.savez(
        buffer,
        time_s=np.arange(n) * 0.1,
        valid=np.ones(n, bool),
        cg_accel=np.zeros((n, 6)),
        mount_force=np.zeros((n, 1, 3)),
        mount_names=np.array(["a"]),
    )
    return buffer.getvalue()


def _result_json(file: Path, folder: Path) -> None:
    shutil.copyfile(file, folder / "result.json")
    (folder / "signals.npz").write_bytes(_signals())
    read_replay(folder)


def _result_npz(file: Path, folder: Path) -> None:
    (folder / "result.json").write_text(json.dumps(RESULT), encoding="utf-8")
    shutil.copyfile(file, folder / "signals.npz")
    read_replay(folder)


def _state_vehicle() -> Vehicle:
    return load_vehicle(shared_path("config", "vehicles", "single_imu.yaml"))


def _state_seed(folder: Path) -> list[bytes]:
    save_state(folder / "state.json", Pipeline(_state_vehicle()))
    return [(folder / "state.json").read_bytes()]


def _state_reader() -> Callable[[Path, Path], None]:
    kept: list[Pipeline] = []

    def consume(file: Path, folder: Path) -> None:
        kept[:] = kept or [Pipeline(_state_vehicle())]
        data = file.read_bytes()
        if zlib.crc32(data) % 8:  # mostly with the checksum put right, so that what lies behind it is tested as well
            with contextlib.suppress(ValueError, RecursionError, AttributeError):
                document = json.loads(data)
                canonical = json.dumps(document.get("state"), sort_keys=True, separators=(",", ":"))
                document["sha256"] = hashlib.sha256(canonical.encode()).hexdigest()
                file.write_text(json.dumps(document), encoding="utf-8")
        restore_state(file, kept[0])
        for p in kept[0].parameters():
            assert np.isfinite(p.value) and np.isfinite(p.std), p

    return consume


def _page(file: Path, folder: Path) -> None:
    """Put what the file holds into every part of a report: it must stay text, so the tags are those of a harmless text."""
    tags = page_tags(file.read_bytes().decode("utf-8", "replace"), folder)
    assert tags == page_tags("harmless", folder), tags


def page_tags(text: str, folder: Path) -> list[tuple[str, tuple[str, ...]]]:
    """Return the tags, with the names of their attributes, of a report with ``text`` in every part; numbers have a class."""
    from html.parser import HTMLParser

    page = Page(text)
    page.heading(text)
    page.text(text)
    page.verdict(text)
    page.warning(text)
    page.table(["name", text], [[text, text], [text, 1.0]])  # without any heading a table has no head
    page.write(folder / "page.html")
    tags: list[tuple[str, tuple[str, ...]]] = []
    parser = HTMLParser()
    parser.handle_starttag = lambda tag, attrs: tags.append((tag, tuple(k for k, _ in attrs if k != "class")))  # type: ignore[method-assign]
    parser.feed((folder / "page.html").read_text(encoding="utf-8"))
    return tags


def targets() -> dict[str, Target]:
    """Return all targets by name."""
    state = [f'"{k}"'.encode() for k in ("theta", "covariance", "run_time", "motion", "parameters", "anchor", "schema")]
    return {
        "mcap": Target(".mcap", mcap_files, _run, (b"\x89MCAP0\r\n", b"zstd", b"lz4", b"\x06", b"\x05", b"/accel")),
        "db3": Target(".db3", db3_files, _run, (b"SQLite format 3\x00", b"/accel", b"sensor_msgs/msg/Imu", b"messages")),
        "ros1": Target(
            ".bag", ros1_files, _ros1_run, (b"#ROSBAG V2.0\n", b"op=\x05", b"compression=bz2", b"compression=lz4", b"size=")
        ),
        "metadata": Target(
            ".yaml", _metadata, _metadata_run, (*YAML_WORDS, b"../../../etc/passwd", b"message", b"file", b"zstd")
        ),
        "bench_bag": Target(".mcap", bench_files, _bench_bag, (b"/JointState", b"fl_z")),
        "vehicle": Target(
            ".yaml",
            files(("config", "vehicles", "single_imu.yaml"), ("config", "vehicles", "quarter_car.yaml")),
            _vehicle,
            YAML_WORDS,
        ),
        "settings": Target(
            ".yaml", files(("config", "nodes", "estimator.yaml")), lambda f, d: forget(load_settings(f)), YAML_WORDS
        ),
        "scenario": Target(
            ".yaml", files(("bags", "standing", "recipe.yaml")), lambda f, d: forget(load_scenario(f)), YAML_WORDS
        ),
        "map": Target(".yaml", lambda folder: [MAP.encode()], read_map, YAML_WORDS),
        **{name: Target(suffix, seeds, read, words) for name, (suffix, seeds, words) in measurement_formats().items()},
        "table": Target(".csv", lambda folder: [TABLE], lambda f, d: forget(read_table(f)), CSV_WORDS),
        "bench_csv": Target(".csv", lambda folder: [RECORD, HARMONIC], _bench, CSV_WORDS),
        "npz": Target(
            ".npz", _npz_seed, _bench, (b"PK\x03\x04", b"PK\x01\x02", b"'|O'", b"\x93NUMPY", b"(99999999999,)", b"'<f8'")
        ),
        "array": Target(
            ".npy", _array_seed, _array, (b"'|O'", b"(99999999999,)", b"'<U99999999'", b"True", b"\x93NUMPY\x03\x00")
        ),
        "mat": Target(".mat", _mat_seed, _bench, (b"\x0f\x00\x00\x00", b"\x0e\x00\x00\x00", b"MI", b"IM")),
        "result": Target(".json", lambda folder: [json.dumps(RESULT).encode()], _result_json, JSON_WORDS),
        "signals": Target(
            ".npz", lambda folder: [_signals()], _result_npz, (b"PK\x03\x04", b"'|O'", b"(99999999999,)", b"'<U9999999'")
        ),
        "state": Target(".json", _state_seed, _state_reader(), (*JSON_WORDS, *state)),
        "page": Target(
            ".txt",
            lambda folder: [b"front_left", b"<b>&amp;</b>"],
            _page,
            (b"<script>", b"</title>", b'"', b"'", b"&", b"-->", b"<!--", b"</style>", b"<![CDATA[", b"\x00"),
        ),
    }


def forget(_: object) -> None:
    """Forget a result."""
