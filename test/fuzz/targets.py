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
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.typesys import Stores, get_typestore

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
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.vehicles.vehicle import Vehicle

START = 1_700_000_000_123_456_789
STORE = get_typestore(Stores.ROS2_JAZZY)
SENSORS = {
    s.name: s
    for s in (
        Sensor("accel", "accelerometer", "/accel", "cab", noise_std=0.02),
        Sensor("imu", "imu", "/imu", "cab", noise_std=0.03, gyro_noise_std=0.001),
        Sensor("fl_z", "displacement", "/mounts/displacement", "cab", mount="fl", axis="z", element="fl_z"),
        Sensor("cell", "force", "/mounts/fl/force_measured", "cab", mount="fl"),
    )
}
VEHICLE = Vehicle("v", {}, {}, SENSORS)


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


def _recording(count: int = 20) -> Recording:
    rng = np.random.default_rng(0)
    channels = {}
    for sensor in SENSORS.values():
        stamps = START + np.arange(count) * 2_000_000
        variance = np.full((count, sensor.channels), 4e-4) if sensor.kind == "imu" else None
        values = rng.normal(size=(count, sensor.channels))
        channels[sensor.name] = Channel(sensor.name, stamps, values, stamps + 300_000, variance)
    return Recording("r", channels)


def _imu(stamp: int, store: object = STORE) -> object:
    t = store.types  # type: ignore[attr-defined]
    extra = {} if store is STORE else {"seq": 0}
    header = t["std_msgs/msg/Header"](
        stamp=t["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="f", **extra
    )
    vector, covariance = t["geometry_msgs/msg/Vector3"], np.array([0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01])
    return t["sensor_msgs/msg/Imu"](
        header=header,
        orientation=t["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=np.array([-1.0] + [0.0] * 8),
        angular_velocity=vector(x=0.1, y=0.2, z=0.3),
        angular_velocity_covariance=covariance,
        linear_acceleration=vector(x=1.0, y=2.0, z=9.8),
        linear_acceleration_covariance=covariance,
    )


def _mcap(folder: Path) -> list[bytes]:
    """Return a file as this package writes it, and two with compressed chunks."""
    write_bag(folder / "plain", _recording(), SENSORS)
    found = [(folder / "plain" / "plain.mcap").read_bytes()]
    for name in ("zstd", "lz4"):
        found.append(rechunked(found[0], name))
    return found


def rechunked(data: bytes, compression: str) -> bytes:
    """Return an MCAP file whose records lie in one compressed chunk, without summary (MCAP specification, record 0x06)."""
    from ride_estimation.io import mcap_records

    magic = data[:8]
    header_end = 8 + 9 + struct.unpack_from("<Q", data, 9)[0]
    records, at = [], header_end
    while True:
        code, length = struct.unpack_from("<BQ", data, at)
        if code in (0x0F, 0x02):
            break
        if code in (0x03, 0x04, 0x05):
            records.append(data[at : at + 9 + length])
        elif code == 0x06:
            body = data[at + 9 : at + 9 + length]
            (words,) = struct.unpack_from("<I", body, 28)
            records.append(mcap_records.unpacked(body) if words else body[40:])
        at += 9 + length
    raw = b"".join(records)
    packed = _packed(raw, compression)
    name = compression.encode()
    chunk = struct.pack("<QQQII", START, START, len(raw), 0, len(name)) + name + struct.pack("<Q", len(packed)) + packed
    end = b"\x0f" + struct.pack("<QI", 4, 0) + b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0)
    return data[:header_end] + b"\x06" + struct.pack("<Q", len(chunk)) + chunk + end + magic


def _packed(raw: bytes, compression: str) -> bytes:
    if compression == "lz4":
        import lz4.frame

        return bytes(lz4.frame.compress(raw))
    from ride_estimation.io.bounded import zstd_module

    return bytes(zstd_module().compress(raw))


def _bench_bags(folder: Path) -> list[bytes]:
    write_bag(folder / "plain", _recording(), SENSORS, message_types={"cell": "geometry_msgs/msg/WrenchStamped"})
    plain = (folder / "plain" / "plain.mcap").read_bytes()
    return [plain, rechunked(plain, "zstd"), rechunked(plain, "lz4")]


def _db3(folder: Path) -> list[bytes]:
    write_bag(folder / "sql", _recording(), SENSORS, storage="sqlite3")
    return [(folder / "sql" / "sql.db3").read_bytes()]


def _ros1(folder: Path) -> list[bytes]:
    store = get_typestore(Stores.ROS1_NOETIC)
    found = []
    for name, compression in (("plain", None), ("lz4", Ros1Writer.CompressionFormat.LZ4)):
        with contextlib.ExitStack() as stack:
            writer = Ros1Writer(folder / f"{name}.bag")
            if compression is not None:
                writer.set_compression(compression)
            stack.enter_context(writer)
            connection = writer.add_connection("/accel", "sensor_msgs/msg/Imu", typestore=store)
            for k in range(10):
                stamp = START + k * 2_000_000
                writer.write(connection, stamp, store.serialize_ros1(_imu(stamp, store), connection.msgtype))
        found.append((folder / f"{name}.bag").read_bytes())
    return found


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
    write_bag(folder / "run", _recording(), SENSORS)
    plain = (folder / "run" / "metadata.yaml").read_bytes()
    return [plain]


def _metadata_run(file: Path, folder: Path) -> None:
    run = folder / "run"
    if not run.exists():
        write_bag(run, _recording(), SENSORS)
    shutil.copyfile(file, run / "metadata.yaml")
    read_run(run)


# -- text files -----------------------------------------------------------------------------------------------------------

_YAML_WORDS = (
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
_CSV_WORDS = (
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
_JSON_WORDS = (
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


def _files(*names: tuple[str, ...]) -> Callable[[Path], list[bytes]]:
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
    _ignore(read_arrays(folder / "run.npz"))


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

_RESULT = {
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
    (folder / "result.json").write_text(json.dumps(_RESULT), encoding="utf-8")
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
    """Return the tags, with the names of their attributes, of a report with ``text`` in every part."""
    from html.parser import HTMLParser

    page = Page(text)
    page.heading(text)
    page.text(text)
    page.verdict(text)
    page.warning(text)
    page.table([text], [[text], [1.0]])
    page.write(folder / "page.html")
    tags: list[tuple[str, tuple[str, ...]]] = []
    parser = HTMLParser()
    parser.handle_starttag = lambda tag, attrs: tags.append((tag, tuple(k for k, _ in attrs)))  # type: ignore[method-assign]
    parser.feed((folder / "page.html").read_text(encoding="utf-8"))
    return tags


def targets() -> dict[str, Target]:
    """Return all targets by name."""
    state = [f'"{k}"'.encode() for k in ("theta", "covariance", "run_time", "motion", "parameters", "anchor", "schema")]
    return {
        "mcap": Target(".mcap", _mcap, _run, (b"\x89MCAP0\r\n", b"zstd", b"lz4", b"\x06", b"\x05", b"/accel")),
        "db3": Target(".db3", _db3, _run, (b"SQLite format 3\x00", b"/accel", b"sensor_msgs/msg/Imu", b"messages")),
        "ros1": Target(
            ".bag", _ros1, _ros1_run, (b"#ROSBAG V2.0\n", b"op=\x05", b"compression=bz2", b"compression=lz4", b"size=")
        ),
        "metadata": Target(
            ".yaml", _metadata, _metadata_run, (*_YAML_WORDS, b"../../../etc/passwd", b"message", b"file", b"zstd")
        ),
        "bench_bag": Target(".mcap", _bench_bags, _bench_bag, (b"/JointState", b"fl_z")),
        "vehicle": Target(
            ".yaml",
            _files(("config", "vehicles", "single_imu.yaml"), ("config", "vehicles", "quarter_car.yaml")),
            _vehicle,
            _YAML_WORDS,
        ),
        "settings": Target(
            ".yaml", _files(("config", "nodes", "estimator.yaml")), lambda f, d: _ignore(load_settings(f)), _YAML_WORDS
        ),
        "scenario": Target(
            ".yaml", _files(("bags", "standing", "recipe.yaml")), lambda f, d: _ignore(load_scenario(f)), _YAML_WORDS
        ),
        "table": Target(".csv", lambda folder: [TABLE], lambda f, d: _ignore(read_table(f)), _CSV_WORDS),
        "bench_csv": Target(".csv", lambda folder: [RECORD, HARMONIC], _bench, _CSV_WORDS),
        "npz": Target(
            ".npz", _npz_seed, _bench, (b"PK\x03\x04", b"PK\x01\x02", b"'|O'", b"\x93NUMPY", b"(99999999999,)", b"'<f8'")
        ),
        "array": Target(
            ".npy", _array_seed, _array, (b"'|O'", b"(99999999999,)", b"'<U99999999'", b"True", b"\x93NUMPY\x03\x00")
        ),
        "mat": Target(".mat", _mat_seed, _bench, (b"\x0f\x00\x00\x00", b"\x0e\x00\x00\x00", b"MI", b"IM")),
        "result": Target(".json", lambda folder: [json.dumps(_RESULT).encode()], _result_json, _JSON_WORDS),
        "signals": Target(
            ".npz", lambda folder: [_signals()], _result_npz, (b"PK\x03\x04", b"'|O'", b"(99999999999,)", b"'<U9999999'")
        ),
        "state": Target(".json", _state_seed, _state_reader(), (*_JSON_WORDS, *state)),
        "page": Target(
            ".txt",
            lambda folder: [b"front_left", b"<b>&amp;</b>"],
            _page,
            (b"<script>", b"</title>", b'"', b"'", b"&", b"-->", b"<!--", b"</style>", b"<![CDATA[", b"\x00"),
        ),
    }


def _ignore(_: object) -> None:
    """Forget a result."""
