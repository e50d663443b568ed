# Copyright 2026 ride_estimation contributors
"""The command line as fuzz targets: arguments, and files through the commands that read them, in this process.

A command ends with 0, or with 2 and one message; everything else is a finding: another exit code, an exception, no message, a
character that a terminal would obey.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from fuzz.recordings import SENSORS
from fuzz.targets import CSV_WORDS, HARMONIC, JSON_WORDS, RECORD, RESULT, TABLE, YAML_WORDS, Target, files, forget
from ride_estimation.cli.main import main
from ride_estimation.errors import InputDataError
from ride_estimation.io.bag_writer import write_bag
from ride_estimation.io.files.channel_map import load_channel_map
from ride_estimation.io.files.formats import read_measurement_file
from ride_estimation.io.result_files import read_diagnosis
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.resources import shared_path
from ride_estimation.signals.recording import Channel, Recording

START = 1_700_000_000_000_000_000
IMU = shared_path("config", "vehicles", "single_imu.yaml")
CHANNELS = b"""schema: ride_estimation/channels/1
channels:
  cell.x: Fx
  cell.y: {channel: Fy, unit: kN, factor: -1.0}
  cell.z: Fz
time: {rate_hz: 500}
"""
LOGGER = (
    b"time [s],imu.x [m/s^2],imu.y [g],imu.z [m/s^2],imu.gyro_x [rad/s],imu.gyro_y [deg/s],imu.gyro_z [rad/s]\n"
) + b"".join(
    f"{0.005 * k:.3f},{0.1 * (k % 7):.2f},{0.01 * (k % 5):.3f},{9.8 + 0.1 * (k % 3):.2f},0.01,{0.1 * (k % 4):.2f},0\n".encode()
    for k in range(60)
)
#: lines are arguments; none of the commands here takes long on the files beside them
COMMANDS = (
    "--help", "--version", "plan --help", "plan --vehicle v.yaml --road D --speed 20 --duration 100 --rate 200",
    "replay none.mcap --vehicle v.yaml --out out --rate 100 --slope 4 --daily-hours 6 --format html pdf --no-smoothing",
    "export-file results --out out.csv",
    "export-file results --vehicle v.yaml --out out.csv", "compare results results --out out",
    "import-file logger.csv --vehicle v.yaml --out bag", "calibrate none --vehicle v.yaml",
    "procedure axle-loads --help", "procedure spectrum record.csv --column force --block 64",
    "compare-models none --vehicle v.yaml",
    "fleet nowhere --vehicle v.yaml --out out --workers 2 --table csv", "diagnose none --vehicle v.yaml --out out",
    "identify none.csv --out out", "completion --shell bash", "quarter-car none.csv --out out",
)  # fmt: skip
ARGUMENT_WORDS = (
    b"\n", b"\n--", b"--out\n", b"--vehicle\n",
    b"v.yaml", b"record.csv", b"results", b"none", b"-1", b"nan", b"inf", b"1e999", b"0",
    b"9" * 400, b"=", b"--rate=", b"--help", b"\xfc", b"\x1b[2J", b"\xe2\x80\xae", b"-", b"x" * 5000, b"'",
    b"plan", b"procedure\n",
)  # fmt: skip


def command(arguments: Sequence[str]) -> None:
    """Run a command and check how it ends.

    Raises
    ------
    InputDataError
        It refused its input as it should.
    AssertionError
        It did not.
    """
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code: object = main(list(arguments))
        except SystemExit as end:
            code = end.code
    said = err.getvalue()
    assert code in (0, 2), f"exit code {code}"
    assert code == 0 or said.strip(), "no message"
    assert "Traceback" not in said, "a traceback"
    odd = {c for c in out.getvalue() + said if ord(c) < 32 and c not in "\n\t\r"} | (set(said) & set("\u202e\x7f"))
    assert not odd, f"a terminal would obey {odd!r}"
    if code:
        raise InputDataError(said[-200:])


@contextlib.contextmanager
def _inside(folder: Path):  # type: ignore[no-untyped-def]
    """Work in a folder, with files that commands take in it; what the commands wrote is removed."""
    before, place = Path.cwd(), folder / "place"
    place.mkdir()
    os.chdir(place)
    try:
        shutil.copyfile(IMU, "v.yaml")
        Path("record.csv").write_bytes(RECORD)
        Path("logger.csv").write_bytes(LOGGER)
        _results(Path("results"))
        yield
    finally:
        os.chdir(before)
        shutil.rmtree(place, ignore_errors=True)


def _results(folder: Path) -> None:
    folder.mkdir()
    (folder / "result.json").write_text(json.dumps(RESULT), encoding="utf-8")
    (folder / "signals.npz").write_bytes(_exported(folder)[0])


def _exported(folder: Path) -> list[bytes]:
    buffer, n = io.BytesIO(), 8
    np.savez(
        buffer, time_s=np.arange(n) * 0.1, stamp_ns=np.arange(n), valid=np.ones(n, bool), cg_accel=np.zeros((n, 6)),
        mount_force=np.zeros((n, 1, 3)), mount_names=np.array(["a"]), tilt=np.zeros((n, 3)),
    )  # fmt: skip
    return [buffer.getvalue()]


def _arguments(file: Path, folder: Path) -> None:
    with _inside(folder):
        words = os.fsdecode(file.read_bytes().replace(b"\0", b"")).split("\n")
        # nothing is written outside the folder, and what takes minutes by right is left out
        given = [word.replace("..", "").lstrip("/").replace("=/", "=") for word in words[:40]]
        given = [word for word in given if word not in ("demo", "simulate")]
        if "plan" in given:
            given.insert(given.index("plan") + 1, "--bounds-only")  # its simulated drives take half a minute
        command(given)


def _with(*arguments: str) -> Callable[[Path, Path], None]:
    """Return the consumer that runs a command on the damaged file, which stands for ``FILE``."""

    def consume(file: Path, folder: Path) -> None:
        with _inside(folder):
            command([str(file) if word == "FILE" else word for word in arguments])

    return consume


def _export(file: Path, folder: Path) -> None:
    with _inside(folder):
        shutil.copyfile(file, "results/signals.npz")
        command(["export-file", "results", "--out", "out.csv"])


def _replay_seed(folder: Path) -> list[bytes]:
    vehicle = load_vehicle(IMU)
    stamps, rng = START + np.arange(100) * 5_000_000, np.random.default_rng(0)
    channels = {
        s.name: Channel(s.name, stamps, rng.normal(size=(100, s.channels)) + (np.arange(s.channels) == 2) * 9.81, stamps)
        for s in vehicle.sensors.values()
    }
    write_bag(folder / "run", Recording("r", channels), vehicle.sensors)
    return [next((folder / "run").glob("*.mcap")).read_bytes()]


def _diagnosis(file: Path, folder: Path) -> None:
    shutil.copyfile(file, folder / "diagnosis.json")
    read_diagnosis(folder)


def command_targets() -> dict[str, Target]:
    """Return the commands, and the readers that only commands use, by name."""
    arguments = [line.replace(" ", "\n").encode() for line in COMMANDS]
    found = {
        "arguments": Target(".txt", lambda folder: arguments, _arguments, ARGUMENT_WORDS),
        "plan": Target(
            ".yaml", files(("config", "vehicles", "single_imu.yaml")), _with("plan", "--vehicle", "FILE", "--bounds-only"),
            YAML_WORDS,
        ),
        "settings_option": Target(
            ".yaml", files(("config", "nodes", "estimator.yaml")),
            _with("replay", "none.mcap", "--vehicle", "v.yaml", "--settings", "FILE", "--out", "out"), YAML_WORDS,
        ),
        "import_file": Target(
            ".csv", lambda folder: [LOGGER], _with("import-file", "FILE", "--vehicle", "v.yaml", "--out", "bag"), CSV_WORDS
        ),
        "export_file": Target(".npz", _exported, _export, (b"PK\x03\x04", b"'|O'", b"(99999999999,)", b"'<U9999999'")),
        "replay": Target(
            ".mcap", _replay_seed, _with("replay", "FILE", "--vehicle", "v.yaml", "--out", "out", "--no-report", "--salvage"),
            (b"\x89MCAP0\r\n", b"zstd", b"\x06", b"\x05", b"\xff\xff\xff\xff\xff\xff\xef\x7f"),
        ),
        "spectrum": Target(
            ".csv", lambda folder: [RECORD, TABLE],
            _with("procedure", "spectrum", "FILE", "--column", "force", "--block", "64"), CSV_WORDS,
        ),
        "channels": Target(".yaml", lambda folder: [CHANNELS], lambda f, d: forget(load_channel_map(f, SENSORS)), YAML_WORDS),
        "logger": Target(
            ".csv", lambda folder: [LOGGER, HARMONIC], lambda f, d: forget(read_measurement_file(f)), CSV_WORDS
        ),
        "diagnosis": Target(
            ".json", lambda folder: [json.dumps({"schema": "ride_estimation/diagnosis/1", "a": [1.0]}).encode()], _diagnosis,
            JSON_WORDS,
        ),
    }  # fmt: skip
    return found
