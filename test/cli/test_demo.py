# Copyright 2026 ride_estimation contributors
"""The demonstration end to end, its numbers against an evaluation written down here."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.assessment.truth import at_times, score
from ride_estimation.cli import demo
from ride_estimation.cli.main import main
from ride_estimation.errors import InputDataError, RideEstimationError
from ride_estimation.resources import shared_path


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("demo")
    assert main(["demo", "--out", str(out), "--no-diagnosis"]) == 0
    return out


def test_report_is_one_offline_page_with_picture(finished: Path) -> None:
    page = (finished / "report.html").read_text(encoding="utf-8")
    assert '<figure class="chart">' in page
    # base64 has no colon, so this cannot be met by chance
    assert "http:" not in page
    assert "https:" not in page
    assert "front_left.z.stiffness" in page
    assert (finished / "replay" / "report.html").is_file()


def test_force_errors_are_those_of_the_files(finished: Path) -> None:
    truth_folder = shared_path("bags", "nominal")
    start = json.loads((truth_folder / "truth.json").read_text(encoding="utf-8"))["start_stamp_ns"]
    signals, true = np.load(finished / "replay" / "signals.npz"), np.load(truth_folder / "truth.npz")
    time = (signals["stamp_ns"] - start) * 1e-9
    late = (signals["time_s"] >= 10.0) & (time <= true["time_s"][-1])
    row = next(r for r in demo.Comparison.of(finished / "replay", truth_folder).force_rows() if r[:2] == ("rear_right", "z"))
    known = np.interp(time[late], true["time_s"], true["mount_force"][:, list(true["mount_names"]).index("rear_right"), 2])
    error, live = (signals[name][late, 3, 2] - known for name in ("mount_force_hindsight", "mount_force"))
    # both ways interpolate the 100 Hz truth linearly; they differ by the end samples only
    assert row[3] == pytest.approx(np.sqrt(np.mean(error**2)), rel=0.01)
    assert row[2] == pytest.approx(100 * np.sqrt(np.mean(error**2)) / np.std(known), rel=0.01)
    assert row[5] == pytest.approx(100 * np.sqrt(np.mean(live**2)) / np.std(known), rel=0.01)


def test_true_parameters_are_those_the_run_was_made_with(finished: Path) -> None:
    rows = {row[0]: row for row in demo.Comparison.of(finished / "replay", shared_path("bags", "nominal")).parameter_rows()}
    # recipe.yaml: factor 1.18 on the vehicle file's 52000 N/m
    assert rows["front_left.z.stiffness"][1:3] == pytest.approx((52000.0, 61360.0))
    assert {"cab.mass", "rear_right.y.damping"} <= set(rows)


def test_an_installed_package_makes_its_recordings_from_their_recipes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    installed = tmp_path / "share" / "bags" / "nominal"
    installed.mkdir(parents=True)
    recipe = (shared_path("bags", "nominal") / "recipe.yaml").read_text(encoding="utf-8").replace("duration_s: 30.0", "duration_s: 2.0")
    (installed / "recipe.yaml").write_text(recipe, encoding="utf-8")
    vehicle = tmp_path / "share" / "config" / "vehicles" / "truck_cab.yaml"
    vehicle.parent.mkdir(parents=True)
    vehicle.write_bytes(shared_path("config", "vehicles", "truck_cab.yaml").read_bytes())
    monkeypatch.setattr(demo, "shared_path", lambda *parts: (tmp_path / "share").joinpath(*parts))
    made = demo.recorded("nominal", tmp_path / "out")
    assert json.loads((made / "truth.json").read_text(encoding="utf-8"))["start_stamp_ns"] > 0
    assert list((made / "bag").glob("*.mcap"))
    stamp = (made / "truth.json").stat().st_mtime_ns
    assert demo.recorded("nominal", tmp_path / "out") == made and (made / "truth.json").stat().st_mtime_ns == stamp


def test_step_that_fails_ends_the_demonstration(tmp_path: Path) -> None:
    with pytest.raises(RideEstimationError, match="exit code 2"):
        demo.quietly(["replay", str(tmp_path / "none"), "--vehicle", str(tmp_path / "none.yaml"), "--out", str(tmp_path / "out")])


def test_table_aligns_numbers() -> None:
    assert demo.text_table(("name", "value"), [("a", 1.0), ("bcd", 123456.0)]).splitlines() == [
        "name   value", "------------", "a          1", "bcd   123460",
    ]  # fmt: skip


def test_score_of_known_errors() -> None:
    truth = np.array([0.0, 2.0, 0.0, 2.0])  # standard deviation 1
    found = score(truth, truth + np.array([0.1, -0.1, 0.1, -0.5]), np.full(4, 0.1))
    assert found.rms_error == pytest.approx(np.sqrt((3 * 0.01 + 0.25) / 4))
    assert found.nrmse == pytest.approx(found.rms_error)
    assert found.coverage == 0.75


def test_signals_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InputDataError, match="cannot be compared"):
        score(np.zeros(3), np.zeros(4))


def test_interpolation_keeps_nanoseconds() -> None:
    start = 1_700_000_000_000_000_000
    values = at_times([start + 500], [start, start + 1000], [[[0.0, 1.0]], [[1.0, 3.0]]])
    assert values == pytest.approx(np.array([[[0.5, 2.0]]]))
