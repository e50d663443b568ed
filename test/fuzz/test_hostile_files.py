# Copyright 2026 ride_estimation contributors
"""Damaged and hostile files: refused with an error of this package; never a crash, a hang, much memory, or foreign code."""

from __future__ import annotations

import contextlib
import io
import json
import pickle
import random
import re
import resource
import struct
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from fuzz.command_line import command_targets
from fuzz.mutate import mutated
from fuzz.recordings import START, VEHICLE, bench_files, mcap_files, packed, rechunked, ros1_files
from fuzz.targets import page_tags, read_run, targets
from ride_estimation.errors import ConfigurationError, InputDataError, RideEstimationError
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.bags import read_recording
from ride_estimation.io.bench_records import ReadOptions, read_bench_record
from ride_estimation.io.bounded import SPARE_BYTES, read_arrays, unpack
from ride_estimation.io.document import as_number, read_yaml
from ride_estimation.io.json_file import read_json
from ride_estimation.io.matlab_file import read_matlab
from ride_estimation.io.state_file import file_name, save_results
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.resources import shared_path

TARGETS = targets()
COMMANDS = command_targets()


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[bytes]]:
    return {name: t.seeds(tmp_path_factory.mktemp(name)) for name, t in TARGETS.items()}


@pytest.mark.parametrize("name", TARGETS)
def test_the_sound_files_are_accepted(name: str, seeds: dict[str, list[bytes]], tmp_path: Path) -> None:
    """Otherwise the damaged ones would only test the first check of a reader."""
    for data in seeds[name]:
        file = tmp_path / f"input{TARGETS[name].suffix}"
        file.write_bytes(data)
        TARGETS[name].consume(file, tmp_path)


@pytest.mark.parametrize("name", TARGETS)
def test_damaged_files_are_read_or_refused(name: str, seeds: dict[str, list[bytes]], tmp_path: Path) -> None:
    """Nothing but success or an error of this package; ``benchmarks/fuzz_files.py`` does the same a million times."""

    @settings(max_examples=15, deadline=None, derandomize=True, database=None, suppress_health_check=[HealthCheck.too_slow])
    @given(st.integers(0, 2**31), st.integers(0, len(seeds[name]) - 1))
    def check(number: int, which: int) -> None:
        data = mutated(seeds[name][which], seeds[name], TARGETS[name].words, random.Random(number))
        file = tmp_path / f"input{TARGETS[name].suffix}"
        file.write_bytes(data)
        with contextlib.suppress(RideEstimationError):
            TARGETS[name].consume(file, tmp_path)

    check()


@pytest.mark.parametrize("name", COMMANDS)
def test_commands_end_with_success_or_one_message(name: str, tmp_path: Path) -> None:
    target, rng = COMMANDS[name], random.Random(name)
    (tmp_path / "seeds").mkdir()
    (tmp_path / "work").mkdir()
    good = target.seeds(tmp_path / "seeds")
    file = tmp_path / f"input{target.suffix}"
    for data in [*good[:3], *(mutated(rng.choice(good), good, target.words, rng) for _ in range(5))]:
        file.write_bytes(data)
        with contextlib.suppress(RideEstimationError):
            target.consume(file, tmp_path / "work")


@settings(max_examples=20, deadline=None, derandomize=True, database=None)
@given(st.text())
def test_a_report_shows_any_text_and_obeys_none(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    folder = tmp_path_factory.getbasetemp()
    assert page_tags(text, folder) == page_tags("harmless", folder)


@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(st.text() | st.sampled_from(["..", "../../x", "/etc/passwd", "a/b", "a\\b", "~", "-rf", "x" * 999, "\0", "CON", ". ."]))
def test_a_name_from_outside_is_a_file_name_and_no_path(text: str) -> None:
    name = file_name(text)
    assert name and len(name.encode()) <= 4 * 100
    assert Path(name).name == name and name not in (".", "..")
    assert not set(name) & set("/\\\0")


def test_results_of_a_vehicle_with_a_hostile_name_stay_in_their_folder(tmp_path: Path) -> None:
    text = shared_path("config", "vehicles", "single_imu.yaml").read_text(encoding="utf-8")
    own = next(line for line in text.splitlines() if line.startswith("name:"))
    (tmp_path / "v.yaml").write_text(text.replace(own, 'name: "../../escaped/\\0name"'), encoding="utf-8")
    inside = tmp_path / "out" / "deep"
    with contextlib.suppress(ConfigurationError):
        for file in save_results(inside, Pipeline(load_vehicle(tmp_path / "v.yaml"))):
            assert file.resolve().parent == inside.resolve()
    assert sorted(p.name for p in tmp_path.iterdir()) in (["v.yaml"], ["out", "v.yaml"])


# -- code in data ---------------------------------------------------------------------------------------------------------


class Bomb:
    """Leaves a file where it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return Path.touch, (self.path,)


def test_pickled_objects_are_refused_and_not_executed(tmp_path: Path) -> None:
    trace = tmp_path / "executed"
    np.savez(
        tmp_path / "run.npz", time_s=np.array([Bomb(trace)], dtype=object), displacement_mm=np.zeros(300), force_n=np.zeros(300)
    )
    (tmp_path / "bare.npz").write_bytes(pickle.dumps(Bomb(trace)))
    for name in ("run.npz", "bare.npz"):
        with pytest.raises(InputDataError):
            read_bench_record(tmp_path / name, ReadOptions())
    assert not trace.exists()


def test_python_objects_in_yaml_are_refused_and_not_executed(tmp_path: Path) -> None:
    trace = tmp_path / "executed"
    (tmp_path / "v.yaml").write_text(
        f"schema: !!python/object/apply:pathlib.Path.touch [!!python/object/apply:pathlib.Path ['{trace}']]\n"
    )
    with pytest.raises(ConfigurationError, match="not valid YAML"):
        load_vehicle(tmp_path / "v.yaml")
    assert not trace.exists()


# -- memory and time ------------------------------------------------------------------------------------------------------


def peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def test_an_integer_beyond_every_float_is_no_number() -> None:
    assert as_number(10**400) is None and as_number("1e400") is None
    assert as_number("4e5") == 4e5


def test_aliases_of_aliases_are_counted_before_they_are_walked(tmp_path: Path) -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 12)]  # 10^12 values
    (tmp_path / "v.yaml").write_text("\n".join(lines))
    with pytest.raises(ConfigurationError, match="aliases are written out"):
        read_yaml(tmp_path / "v.yaml")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a: &a [*a]", "stands in"),
        # the scanner of PyYAML 6.0.4 looks a thousand levels ahead and refuses them before the first one is counted here
        ("[" * 5000, "(levels deep|nesting depth) in line 1"),
        ("[" * 50_000 + "]" * 50_000, "levels deep|nesting depth"),  # the C parser before it overflows its stack from here on
        ("a:\n - " + "{b: " * 3000, "levels deep in line 2"),
        ("- " * 100_000, "levels deep"),
        ("a: !!int '1" + ":59" * 100_000 + "'", "not an integer"),
        ("a: !!float '1" + ":59" * 100_000 + ".'", "not a decimal number"),
        ("a: " + "x" * (5 << 20), "more than the"),
    ],
)
def test_endless_and_deep_yaml_is_refused_at_once(text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "v.yaml").write_text(text)
    began = time.process_time()
    with pytest.raises(ConfigurationError, match=says) as caught:
        read_yaml(tmp_path / "v.yaml")
    assert time.process_time() - began < 1.0
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize("value", ["0x" + "F" * 6000, "1" + ":59" * 300_000, "9" * 1_000_000, "'" + "x" * 1_000_000 + "'"])
@pytest.mark.parametrize("key", ["gravity_m_per_s2", "schema", "bodies", "sensors", "other"])
def test_a_long_value_is_a_short_message(key: str, value: str, tmp_path: Path) -> None:
    (tmp_path / "v.yaml").write_text(f"name: n\n{key}: {value}\n")
    began = time.process_time()
    with pytest.raises(ConfigurationError) as caught:
        load_vehicle(tmp_path / "v.yaml")
    assert time.process_time() - began < 1.0
    assert len(str(caught.value)) < 5000 and "(line 2)" in str(caught.value)


def test_many_unknown_keys_are_counted_and_not_listed(tmp_path: Path) -> None:
    (tmp_path / "v.yaml").write_text("\n".join(f"key{i}{'y' * 200}: 1" for i in range(10_000)))
    began = time.process_time()
    with pytest.raises(ConfigurationError, match="9980 more unknown keys") as caught:
        load_vehicle(tmp_path / "v.yaml")
    assert time.process_time() - began < 2.0 and len(str(caught.value)) < 10_000


def test_numbers_are_read_as_they_are_written(tmp_path: Path) -> None:
    numbers = "{a: 010, b: 1e3, c: -.5, d: 0x10, e: '12:30', f: 2026-11-22, g: .inf, h: +7, i: 1.0, j: 12:30:15,"
    numbers += " k: 1700000000123456789}"
    (tmp_path / "v.yaml").write_text(numbers)
    found = read_yaml(tmp_path / "v.yaml")
    assert found == {
        "a": 10, "b": 1000.0, "c": -0.5, "d": "0x10", "e": "12:30", "f": "2026-11-22", "g": float("inf"), "h": 7, "i": 1.0,
        "j": "12:30:15", "k": 1_700_000_000_123_456_789,
    }  # fmt: skip
    assert type(found["a"]) is int and type(found["i"]) is float


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no file without end")
def test_a_file_without_end_is_not_read_to_its_end() -> None:
    before = peak()
    with pytest.raises(ConfigurationError, match="more than the"):
        read_yaml(Path("/dev/zero"))
    with pytest.raises(InputDataError, match="more than the"):
        read_json(Path("/dev/zero"))
    assert peak() - before < 300 << 20


def test_deep_json_is_refused(tmp_path: Path) -> None:
    (tmp_path / "r.json").write_text('{"a": ' + "[" * 200_000)
    with pytest.raises(InputDataError, match="not a JSON file"):
        read_json(tmp_path / "r.json")


def bomb(data: bytes, compression: str) -> bytes:
    """Return an MCAP file with one chunk of zeros that is far larger than the limit allows."""
    zeros = b"".join(packed(bytes(1 << 24), compression) for _ in range((SPARE_BYTES >> 24) + 8))
    name = compression.encode()
    chunk = struct.pack("<QQQII", START, START, 1 << 10, 0, len(name)) + name + struct.pack("<Q", len(zeros)) + zeros
    end = b"\x0f" + struct.pack("<QI", 4, 0) + b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0) + data[:8]
    start = 17 + struct.unpack_from("<Q", data, 9)[0]
    return data[:start] + b"\x06" + struct.pack("<Q", len(chunk)) + chunk + end


def test_a_recording_that_unpacks_without_end_is_refused(tmp_path: Path) -> None:
    """The chunk claims 1 KiB and holds 192 MiB of zeros in 30 KiB; the limit for a file of that size is about 70 MiB."""
    file = tmp_path / "run.mcap"
    (tmp_path / "seed").mkdir()
    file.write_bytes(bomb(mcap_files(tmp_path / "seed")[0], "zstd"))
    before = peak()
    with pytest.raises(InputDataError, match="unpacks to more than"):
        read_run(file)
    assert peak() - before < 3 * SPARE_BYTES


def test_compressed_bytes_are_counted_while_they_are_unpacked() -> None:
    for compression in ("zstd", "lz4"):
        assert unpack(packed(b"abc" * 1000, compression), compression, 3000) == b"abc" * 1000
        with pytest.raises(ValueError, match="more than 2999 bytes"):
            unpack(packed(b"abc" * 1000, compression), compression, 2999)


def test_an_archive_that_claims_more_than_it_has_is_refused(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"shape": (10**12,), "fortran_order": False, "descr": "<f8"})
    with zipfile.ZipFile(tmp_path / "claims.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("time_s.npy", buffer.getvalue())
    with zipfile.ZipFile(tmp_path / "zeros.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("time_s.npy", bytes(SPARE_BYTES + (SPARE_BYTES >> 1)))
    with pytest.raises(InputDataError, match="claims"):
        read_arrays(tmp_path / "claims.npz")
    with pytest.raises(InputDataError, match="more than the"):
        read_arrays(tmp_path / "zeros.npz")


# -- single findings ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("compressed", [False, True])
def test_matlab_columns_are_those_scipy_wrote(compressed: bool, tmp_path: Path) -> None:
    """Doubles, singles, integers and what MATLAB stores in fewer bytes; texts and complex numbers are no columns."""
    rng = np.random.default_rng(4)
    written = {
        "a": rng.normal(size=(50, 1)), "b": rng.normal(size=(1, 7)).astype(np.float32), "u": np.array([[250]], dtype=np.uint8),
        "c": np.arange(12, dtype=np.int16).reshape(3, 4), "long_name_of_a_column": np.array([[1.0, 2.0, 3.0]]),
    }  # fmt: skip
    savemat(tmp_path / "m.mat", {**written, "text": "abc", "z": np.array([[1j]]), "cell": np.array([[1, "x"]], dtype=object)},
            do_compression=compressed)  # fmt: skip
    found = read_matlab(tmp_path / "m.mat")
    assert set(found) == set(written)
    for name, values in written.items():
        assert np.array_equal(found[name], values), name


def test_a_receive_time_no_clock_shows_is_damage(tmp_path: Path) -> None:
    data = bytearray(rechunked(mcap_files(tmp_path)[0], ""))
    first = re.search(rb"\x05.{8}.{2}.{4}" + re.escape(struct.pack("<Q", START + 300_000)), bytes(data), re.DOTALL)
    assert first is not None
    data[first.end() - 8 : first.end()] = b"\xff" * 8
    (tmp_path / "run.mcap").write_bytes(bytes(data))
    with pytest.raises(InputDataError, match="no clock shows"):
        read_recording(tmp_path / "run.mcap", VEHICLE)


def test_bench_bags_and_ros1_bags_without_their_end_are_refused(tmp_path: Path) -> None:
    for name, data in (("bench.mcap", bench_files(tmp_path)[1]), ("one.bag", ros1_files(tmp_path)[1])):
        (tmp_path / name).write_bytes(data[: len(data) // 2])
        with pytest.raises(InputDataError):
            if name == "one.bag":
                read_run(tmp_path / name, VEHICLE)
            else:
                read_bench_record(tmp_path / name, ReadOptions(mount="fl", axis="z"))


def test_results_of_another_form_are_named(tmp_path: Path) -> None:
    file = tmp_path / "input.json"
    file.write_text(json.dumps({"schema": "ride_estimation/result/1", "run": 3}))
    with pytest.raises(InputDataError, match="run is missing or of another type"):
        TARGETS["result"].consume(file, tmp_path)
