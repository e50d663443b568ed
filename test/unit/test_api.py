# Copyright 2026 ride_estimation contributors
"""The Python interface: examples run as they stand, results are short to look at, and the commands say the same."""

from __future__ import annotations

import doctest
import importlib
import json
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ride_estimation
from ride_estimation.api.plots import ReplayPlots
from ride_estimation.api.replaying import Replay
from ride_estimation.cli.main import main
from ride_estimation.errors import ConfigurationError, InputDataError

ROOT = Path(__file__).parents[2]
STANDING = str(ROOT / "bags" / "standing")


@pytest.fixture(scope="module")
def found() -> Replay:
    result: Replay = ride_estimation.replay(ride_estimation.read_run(STANDING, "truck_cab", start_s=1.0, end_s=4.0))
    return result


@pytest.fixture
def pandas(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stand-in that keeps the columns, so that the tests need no pandas."""

    class DataFrame:
        def __init__(self, columns: dict[str, Any]) -> None:
            self.columns = columns
            assert len({len(values) for values in columns.values()}) == 1

        def set_index(self, name: str) -> DataFrame:
            assert name in self.columns
            return self

    module = types.ModuleType("pandas")
    module.DataFrame = DataFrame  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "pandas", module)


@pytest.mark.parametrize("name", ["runs", "replaying", "planning", "simulating"])
def test_examples_of_the_interface_run(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    done = doctest.testmod(importlib.import_module(f"ride_estimation.api.{name}"))
    assert done.attempted >= 2 and done.failed == 0


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = (
        "import sys, ride_estimation as re; assert 'numpy' not in sys.modules; assert 'replay' in dir(re); re.load_vehicle;"
        "sys.exit('numpy' not in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
    with pytest.raises(AttributeError, match="no attribute 'replai'"):
        _ = ride_estimation.replai  # type: ignore[attr-defined]


def test_every_result_is_short_to_look_at(found: Replay) -> None:
    plan = ride_estimation.plan("single_imu", unknown_mass=True, drives=False)
    for thing in (found, found.run, found.run.vehicle, plan):
        assert 20 < len(repr(thing)) < 300 and "array" not in repr(thing)
    for thing in (found, found.run, plan):
        text = thing._repr_html_()
        assert text.startswith("<p>") and text.count("<tr>") == text.count("</tr>") > 1 and len(text) < 20_000


@pytest.mark.usefixtures("pandas")
def test_tables_have_one_row_per_parameter_or_instant(found: Replay) -> None:
    parameters = found.to_dataframe().columns
    assert list(parameters["name"]) == [p.name for p in found.parameters]
    forces = found.to_dataframe("forces").columns
    np.testing.assert_array_equal(forces["rear_left.z"], found.result.force[:, 2, 2])
    np.testing.assert_array_equal(forces["rear_left.z.std"], found.result.force_std[:, 2, 2])
    assert set(found.to_dataframe("motion").columns) == {"time_s", "valid", "x", "y", "z", "roll", "pitch", "yaw"}
    assert "rear_left.z" in found.to_dataframe("deflections").columns
    sensor = found.run.to_dataframe("cab_front_left").columns
    assert 0.99 < sensor["time_s"].max() - sensor["time_s"].min() + 1e-6 < 3.01 and np.mean(sensor["z"]) > 9.0
    with pytest.raises(ConfigurationError, match="allowed: parameters"):
        found.to_dataframe("force")
    with pytest.raises(ConfigurationError, match="there are cab_front_left"):
        found.run.to_dataframe("cab")


def test_without_pandas_the_message_says_what_to_install(found: Replay, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ConfigurationError, match="pip install pandas"):
        found.to_dataframe()


def test_arrays_with_names_hold_what_the_result_holds(found: Replay, monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType("xarray")
    module.Dataset = lambda variables, coordinates: (variables, coordinates)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "xarray", module)
    variables, coordinates = found.to_xarray()
    assert coordinates["mount"][2] == "rear_left" and coordinates["axis"] == ["x", "y", "z"]
    for over, values in variables.values():
        assert values.shape == tuple(len(coordinates[name]) for name in over)
    np.testing.assert_array_equal(variables["force"][1][:, 2, 2], found.result.force[:, 2, 2])


def test_pictures_show_the_mount_that_was_asked_for(found: Replay, tmp_path: Path) -> None:
    for plot in (
        found.plot.forces("rear_left"),
        found.plot.measured("cab_front_left"),
        found.plot.motion(),
        found.plot.parameters("front_left.z.stiffness", "rear_left.z.stiffness"),
    ):
        assert plot._repr_svg_().count("<svg") == 1
    vertical = next(axes for axes in found.plot.forces("rear_left").figure.axes if axes.get_ylabel() == "z [kN]").lines[0]
    assert np.isin(np.asarray(vertical.get_ydata()), 1e-3 * found.result.force[:, 2, 2]).all()
    assert found.plot.motion().save(tmp_path / "motion.pdf").read_bytes().startswith(b"%PDF")
    for call, given in ((found.plot.forces, "left"), (found.plot.measured, "left"), (found.plot.parameters, "left")):
        with pytest.raises(ConfigurationError, match=r"no .* 'left'; there are"):
            call(given)


def test_pictures_without_a_name_show_what_matters_most(found: Replay) -> None:
    force = found.result.force[found.result.valid]
    most = int(np.argmax(force.std(axis=0).max(axis=-1)))
    vertical = next(axes for axes in found.plot.forces().figure.axes if axes.get_ylabel() == "z [kN]").lines[0]
    assert np.isin(np.asarray(vertical.get_ydata()), 1e-3 * found.result.force[:, most, 2]).all()
    vertical = [name for name in (p.name for p in found.parameters) if name.endswith(".z.stiffness")]
    drawn, asked = found.plot.parameters().figure, found.plot.parameters(*vertical).figure
    assert len(vertical) == 4 and len(drawn.axes[0].lines) == len(asked.axes[0].lines)
    assert found.plot.measured().figure.axes
    bare = types.SimpleNamespace(mount_names=(), force=found.result.force[:, :0], valid=found.result.valid)
    with pytest.raises(ConfigurationError, match="this result has no mount"):
        ReplayPlots(bare).forces()


def test_command_and_function_give_the_same(found: Replay, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["replay", STANDING, "--vehicle", "truck_cab", "--from", "1", "--to", "4", "--format", "none"]
    assert main([*command, "--out", str(tmp_path / "command")]) == 0
    assert found.result.digest in capsys.readouterr().out
    assert found.save(tmp_path / "function", formats=()) == ["result.json", "signals.npz"]
    for name in ("result.json", "signals.npz"):
        assert (tmp_path / "command" / name).read_bytes() == (tmp_path / "function" / name).read_bytes()
    assert "(1 s to 4 s)" in json.dumps(json.loads((tmp_path / "command" / "result.json").read_text(encoding="utf-8")))
    assert found.report(tmp_path / "page.html").stat().st_size > 10_000


def test_a_part_holds_the_samples_between_its_limits_and_nothing_else() -> None:
    whole = ride_estimation.read_run(STANDING, "truck_cab")
    part = ride_estimation.read_run(STANDING, "truck_cab", start_s=1.0, end_s=2.0)
    start = whole.recording.start_ns
    for name, channel in part.recording.channels.items():
        full = whole.recording.channels[name]
        inside = (full.stamp_ns - start >= 1_000_000_000) & (full.stamp_ns - start <= 2_000_000_000)
        np.testing.assert_array_equal(channel.values, full.values[inside])
        np.testing.assert_array_equal(channel.arrival_ns, full.arrival_ns[inside])
    later = ride_estimation.read_run(STANDING, "truck_cab", start_s=5.0)
    assert later.duration_s == pytest.approx(whole.duration_s - 5.0, abs=0.02)


@pytest.mark.parametrize(
    ("start", "end"), [(-1.0, 2.0), (3.0, 2.0), (2.0, 2.0), (900.0, None), (float("nan"), 2.0), (1.0, 1.0005)]
)
def test_parts_that_are_none_are_refused(start: float | None, end: float | None) -> None:
    with pytest.raises(InputDataError, match=r"part from|no sample of"):
        ride_estimation.read_run(STANDING, "truck_cab", start_s=start, end_s=end)


def test_a_bench_record_has_no_part_of_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["diagnose", "bench.csv", "--from", "1", "--out", str(tmp_path / "out")]) == 2
    assert "--from, --to: only for a run of a vehicle" in capsys.readouterr().err
