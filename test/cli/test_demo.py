# Copyright 2026 ride_estimation contributors
"""The demonstration end to end, its numbers against an evaluation written down here."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import PROGRAM, Browser

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


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    if PROGRAM is None:
        pytest.skip("no browser is installed")
    started = Browser(tmp_path_factory.mktemp("profile"))
    yield started
    started.close()


CHART = "document.querySelector('figure.chart').chart"
PLACES = f"""(() => {{ const box = {CHART}.panels[0].box,
  view = document.querySelector('figure.chart .plot>svg').getBoundingClientRect();
  return [view.left + box[0], view.top + box[1], box[2], box[3]]; }})()"""
ZOOM = f"JSON.stringify([{CHART}.panels[0].x, {CHART}.reset.hidden])"


@pytest.mark.parametrize("name", ["report.html", "replay/report.html"])
def test_a_reader_sees_the_answer_and_can_read_off_the_plots(finished: Path, browser: Browser, name: str) -> None:
    browser.complaints.clear()
    browser.open(finished / name, 1280, 900)
    # the first screen holds the verdict, and of a replay the loads, modes, comfort and what is not known
    low = browser.run("Math.max(...[...document.querySelectorAll('.verdict, .side')].map(e => e.getBoundingClientRect().bottom))")
    assert 0 < low < 900
    if name.startswith("replay"):
        seen = browser.run("[...document.querySelectorAll('.side h3')].map(e => e.textContent).join()")
        assert all(words in seen for words in ("damaging force", "Modes", "comfort", "not known"))
    figures = browser.run("[document.querySelectorAll('figure.chart').length, document.querySelectorAll('.plot>svg').length]")
    assert figures[0] == figures[1] > 0
    assert browser.run("[...document.querySelectorAll('td, th')].filter(e => /^-0(\\.0*)?$/.test(e.textContent)).length") == 0
    # every link leads somewhere
    for target in browser.run("[...document.querySelectorAll('a')].map(e => e.getAttribute('href'))"):
        beside = (finished / name).parent / target
        assert browser.run(f"!!document.getElementById('{target[1:]}')") if target.startswith("#") else beside.is_file()
    # cursor
    browser.run("document.querySelector('figure.chart').scrollIntoView()")
    left, top, width, height = browser.run(PLACES)
    browser.mouse("mouseMoved", left + 0.5 * width, top + 0.5 * height)
    shown = "document.querySelector('figure.chart .readout').innerText"
    middle = browser.run(shown)
    browser.mouse("mouseMoved", left + 0.7 * width, top + 0.5 * height)
    assert re.search(r"time: [\d.]+ s", middle) and middle != browser.run(shown)
    # zoom by dragging, and back
    whole = json.loads(browser.run(ZOOM))
    browser.mouse("mousePressed", left + 0.25 * width, top + 0.5 * height)
    browser.mouse("mouseMoved", left + 0.75 * width, top + 0.5 * height)
    browser.mouse("mouseReleased", left + 0.75 * width, top + 0.5 * height)
    near = json.loads(browser.run(ZOOM))
    low, high = whole[0]
    assert near[0] == pytest.approx([low + 0.25 * (high - low), low + 0.75 * (high - low)], rel=0.02) and not near[1]
    browser.run(f"{CHART}.reset.click()")
    assert json.loads(browser.run(ZOOM)) == whole
    # export: as many rows as the longest curve has points, every column with its unit
    csv = browser.run(f"{CHART}.csv()").splitlines()
    assert len(csv) > 500 and all(re.search(r"\[.+\]", head) for head in csv[0].split('","'))
    # on a phone nothing but tables in their boxes is wider than the screen, and the first column of those stays
    browser.open(finished / name, 390, 844)
    assert browser.run("document.documentElement.scrollWidth") == 390
    still = "getComputedStyle(document.querySelector('.wide table:not(.fit) td')).position"
    assert browser.run(still) == "sticky"
    assert browser.complaints == []


def test_force_errors_are_those_of_the_files(finished: Path) -> None:
    truth_folder = shared_path("bags", "nominal")
    start = json.loads((truth_folder / "truth.json").read_text(encoding="utf-8"))["start_stamp_ns"]
    signals, true = np.load(finished / "replay" / "signals.npz"), np.load(truth_folder / "truth.npz")
    time = (signals["stamp_ns"] - start) * 1e-9
    late = (signals["time_s"] >= 10.0) & (time <= true["time_s"][-1])
    row = next(r for r in demo.Comparison.of(finished / "replay", truth_folder).force_rows() if r[:2] == ("rear_right", "z"))
    known = np.interp(time[late], true["time_s"], true["mount_force"][:, list(true["mount_names"]).index("rear_right"), 2])
    error, live = (signals[name][late, 3, 2] - known for name in ("mount_force_smoothed", "mount_force"))
    # both ways interpolate the 100 Hz truth linearly; they differ by the end samples only
    assert row[3] == pytest.approx(np.sqrt(np.mean(error**2)), rel=0.01)
    assert row[2] == pytest.approx(100 * np.sqrt(np.mean(error**2)) / np.std(known), rel=0.01)
    assert row[5] == pytest.approx(100 * np.sqrt(np.mean(live**2)) / np.std(known), rel=0.01)


def test_smoothed_horizontal_forces_are_nearer_than_live_ones_and_no_surer_than_they_are(finished: Path) -> None:
    """The frame twists and its brackets tilt with it: how far they do, and k of left and right mounts, has to be learned."""
    rows = [r for r in demo.Comparison.of(finished / "replay", shared_path("bags", "nominal")).force_rows() if r[1] != "z"]
    for axis, error in (("x", 17.0), ("y", 12.0)):
        found = [(float(str(r[2])), float(str(r[4])), float(str(r[5]))) for r in rows if r[1] == axis]
        assert all(smoothed < 0.7 * live and smoothed < error for smoothed, _, live in found)
        assert all(inside > 80.0 for _, inside, _ in found)


def test_true_parameters_are_those_the_run_was_made_with(finished: Path) -> None:
    rows = {row[0]: row for row in demo.Comparison.of(finished / "replay", shared_path("bags", "nominal")).parameter_rows()}
    # recipe.yaml: factor 1.18 on the vehicle file's 52000 N/m
    assert rows["front_left.z.stiffness"][1:3] == pytest.approx((52000.0, 61360.0))
    assert {"cab.mass", "rear_right.y.damping"} <= set(rows)


def test_parameters_of_the_whole_run_are_nearer_than_live_ones(finished: Path) -> None:
    rows = demo.Comparison.of(finished / "replay", shared_path("bags", "nominal")).parameter_rows()
    errors = np.array([row[5:7] for row in rows if str(row[0]).endswith(("x.stiffness", "y.stiffness"))], dtype=float)
    assert len(errors) == 8 and np.abs(errors[:, 0]).max() < 5.0
    assert np.abs(errors[:, 0]).mean() < 0.5 * np.abs(errors[:, 1]).mean()


def test_an_installed_package_makes_its_recordings_from_their_recipes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    installed = tmp_path / "share" / "bags" / "nominal"
    installed.mkdir(parents=True)
    recipe = (shared_path("bags", "nominal") / "recipe.yaml").read_text(encoding="utf-8")
    (installed / "recipe.yaml").write_text(recipe.replace("duration_s: 30.0", "duration_s: 2.0"), encoding="utf-8")
    vehicle = tmp_path / "share" / "config" / "vehicles" / "truck_cab.yaml"
    vehicle.parent.mkdir(parents=True)
    vehicle.write_bytes(shared_path("config", "vehicles", "truck_cab.yaml").read_bytes())
    monkeypatch.setattr(demo, "shared_path", (tmp_path / "share").joinpath)
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


def test_the_page_begins_with_the_hidden_effect_beside_its_truth() -> None:
    named = [("verdict", "explained", "", ""), ("friction at front_left z: level", "127.0 ± 9.0 N", "120 N", "95%")]
    gain = ("error on another road", "11.4 % to 1.5 %", "", "noise floor 1.0 %")
    assert demo.hidden_effect([*named, gain]) == (
        "Hidden effect of a second run: friction at front_left z: level: 127.0 ± 9.0 N (true: 120 N); "
        "error on another road 11.4 % to 1.5 %."
    )
    assert demo.hidden_effect([("verdict", "unexplained", "", "")]) == "Hidden effect of a second run: not named."
