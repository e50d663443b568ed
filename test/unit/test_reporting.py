# Copyright 2026 ride_estimation contributors
"""Reports: what the pictures show against closed forms, units on every axis, nothing from outside becomes markup."""

from __future__ import annotations

import base64
import dataclasses
import doctest
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import PROGRAM, Browser
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from scipy import signal

from ride_estimation.assessment.run_assessment import RunAssessment, assess_run
from ride_estimation.diagnosis.answer.result import Calibration, Diagnosis, Evidence, NamedCause
from ride_estimation.diagnosis.hypotheses.hypothesis import Reported
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.estimation.common.estimate import Estimate, Status
from ride_estimation.estimation.offline import OfflineRun
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.reporting import numbers, replay_summary
from ride_estimation.reporting import replay_sections as sections
from ride_estimation.reporting.chart import chart_of
from ride_estimation.reporting.diagnosis_report import Truth, large_loop, leading_port, write_diagnosis_report
from ride_estimation.reporting.page import Digits, Page, png
from ride_estimation.reporting.pdf import _wrapped, write_pdf
from ride_estimation.reporting.replay_mounts import mount_curves, stiffness_by_amplitude
from ride_estimation.reporting.replay_spectra import motion_at, tick_rate, transmissibilities
from ride_estimation.reporting.side_signals import SideSignals, place_of

RATE, SECONDS = 200.0, 40.0
STIFFNESS, DAMPING = 5.0e4, 1.5e3
NASTY = "<script>alert('x')</script> & $\\frac{$"


def band_limited(rng: np.random.Generator, samples: int, corner: float) -> np.ndarray:
    return signal.sosfiltfilt(signal.butter(2, corner, fs=RATE, output="sos"), rng.normal(size=samples))


@pytest.fixture(scope="module")
def run() -> OfflineRun:
    """A made-up run: body follows its bases through a known filter, one mount with a known law."""
    rng = np.random.default_rng(1)
    n = round(RATE * SECONDS)
    x = 0.005 * band_limited(rng, n, 10.0)
    force = 3000.0 - (STIFFNESS * x + DAMPING * np.gradient(x, 1.0 / RATE))
    accel = np.zeros((n, 6))
    accel[:, 2] = signal.lfilter(*LAG, band_limited(np.random.default_rng(2), n, 40.0))
    signals: dict[str, Any] = {
        "cg_accel": accel, "angular_rate": np.zeros((n, 3)), "mount_force": np.zeros((n, 1, 3)),
        "mount_deflection": np.zeros((n, 1, 3)), "mount_force_std": np.full((n, 1, 3), 30.0),
    }  # fmt: skip
    signals["mount_force"][:, 0, 2], signals["mount_deflection"][:, 0, 2] = force, x
    stamps = 10**9 + np.round(np.arange(n) / RATE * 1e9).astype(np.int64)
    empty: Any = {}
    return OfflineRun(
        mount_names=(NASTY,), signals=signals, stamp_ns=stamps, valid=np.ones(n, dtype=bool), measured=empty, predicted=empty,
        parameters=(), history=empty, health=empty, identifiability=empty, digest="",
    )  # fmt: skip


LAG = signal.butter(1, 3.0, fs=RATE)


@pytest.fixture(scope="module")
def side(run: OfflineRun) -> SideSignals:
    base = np.zeros((len(run.stamp_ns), 3))
    base[:, 2] = band_limited(np.random.default_rng(2), len(base), 40.0)
    cell = run.signals["mount_force"][:, 0] * 0.9
    return SideSignals(
        {NASTY: base}, {NASTY: cell}, {place_of(NASTY, "cab"): base + np.array([0.0, 0.0, 9.81])}, {NASTY: np.zeros(3)},
        {(0, 2): KelvinVoigt(STIFFNESS, DAMPING)},
    )  # fmt: skip


@pytest.fixture(scope="module")
def assessment(run: OfflineRun, side: SideSignals) -> RunAssessment:
    return assess_run(
        run.mount_names, run.signals["mount_force"], run.signals["mount_force_std"], run.valid, tick_rate(run),
        side.accelerations, side.cells,
    )  # fmt: skip


def test_transmissibility_is_that_of_the_filter(run: OfflineRun, side: SideSignals) -> None:
    found = transmissibilities(run, side.offsets, side.base)[NASTY]
    band = (found.frequency_hz > 0.5) & (found.frequency_hz < 20.0)
    exact = signal.freqz(*LAG, worN=found.frequency_hz[band], fs=RATE)[1]
    # the blocks of 4 s leak a little where the filter bends
    assert np.max(np.abs(found.h1[band] / exact - 1.0)) < 0.03
    assert np.min(found.coherence[band]) > 0.99


def test_motion_of_a_point_of_a_turning_body(run: OfflineRun) -> None:
    n = len(run.stamp_ns)
    signals = {**run.signals, "cg_accel": np.tile([0, 0, 0, 0, 0, 2.0], (n, 1)), "angular_rate": np.tile([0, 0, 3.0], (n, 1))}
    moved = motion_at(dataclasses.replace(run, signals=signals), np.array([0.5, 0.0, 0.0]))
    assert np.allclose(moved, [-9.0 * 0.5, 2.0 * 0.5, 0.0])  # towards the centre and along the circle


def test_dynamic_stiffness_of_a_spring_and_damper_at_every_amplitude(run: OfflineRun) -> None:
    curves = mount_curves(run, 0, 2, KelvinVoigt(STIFFNESS, DAMPING), None)
    classes = stiffness_by_amplitude(curves.deflection, curves.estimated, run.valid, RATE)
    assert len(classes) == 3 and classes[0].amplitude < classes[-1].amplitude
    for one in classes:
        exact = STIFFNESS + 2j * np.pi * one.frequency_hz * DAMPING
        low = one.frequency_hz < 8.0
        assert low.sum() > 8
        # leakage of blocks of 2 s moves single lines a little, either way; central differences of the made-up rate fall short
        # by (w dt)^2 / 6, 1 % at 8 Hz
        assert np.sqrt(np.mean((one.stiffness[low] / np.abs(exact[low]) - 1.0) ** 2)) < 0.02
        assert np.sqrt(np.mean((one.loss_angle[low] - np.angle(exact[low])) ** 2)) < 0.02
    assert np.max(np.abs(curves.law - curves.estimated)) < 0.02 * np.ptp(curves.estimated)


def test_damage_against_a_load_cell(assessment: RunAssessment) -> None:
    vertical = next(d for d in assessment.damages if d.axis == "z")
    assert vertical.ratio == pytest.approx(0.9**-5.0, rel=1e-9)
    document = assessment.document()
    entry = next(e for e in document["durability"]["mounts"] if e["axis"] == "z")
    assert entry["ratio_to_measured"] == vertical.ratio and entry["damage_lower"] < entry["damage"] < entry["damage_upper"]
    assert next(d for d in assessment.damages if d.axis == "x").ratio is None  # no load, no ratio


def labelled(figure: Figure) -> list[str]:
    """Return the axes without a unit in brackets; inner ones may leave the shared label to the lowest."""
    missing = []
    for axes in figure.axes:
        names = [axes.get_ylabel()]
        sharing = axes.get_shared_x_axes().get_siblings(axes)
        if axes.get_position().y0 == min(other.get_position().y0 for other in sharing):
            names.append(axes.get_xlabel())
        if axes.get_label() == "<colorbar>":
            names = [axes.get_ylabel() or axes.get_xlabel()]
        missing += [f"{figure.axes.index(axes)}: {name!r}" for name in names if not re.search(r"\[[^\]]+\]", name)]
    return missing


@pytest.fixture(scope="module")
def page(run: OfflineRun, side: SideSignals, assessment: RunAssessment) -> Page:
    page = Page(f"Replay of {NASTY}")
    sections.spectra(page, run, side)
    sections.mounts(page, run, side)
    sections.durability(page, run, assessment)
    sections.comfort(page, assessment)
    step = {"model": NASTY, "nrmse": 0.1, "misfit_per_degree": None, "log_likelihood": 3.0}
    cause = {"id": NASTY, "location": NASTY, "axis": "z", "parameters": [{"name": NASTY, "value": 1.0, "std": None, "unit": "N"}]}
    sections.ladder(page, {"sentence": NASTY, "ladder": [step], "causes": [cause], "run": {"checksum": "x"}}, "y")
    page.warning(NASTY)
    page.table([NASTY], [[NASTY]])
    return page


def test_every_axis_of_every_picture_has_its_unit(page: Page) -> None:
    assert len(page.pictures) >= 7
    assert {p.caption: labelled(p.figure) for p in page.pictures if labelled(p.figure)} == {}


def test_nothing_from_outside_becomes_markup_and_nothing_is_loaded(page: Page, tmp_path: Path) -> None:
    page.write(tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text()
    # the numbers of every figure and the one script of the page, which nothing from outside ends or joins
    assert text.count("<script") == len(page.pictures) + 1 and "<script>alert" not in text and "&lt;script&gt;" in text
    assert not re.search(r"(src|href)=\"(?!data:|#)", text) and "default-src 'none'" in text
    assert 'name="viewport"' in text and "@media print" in text and len(text) < 4_000_000
    for part in ("Spectra", "hysteresis", "Durability", "Ride comfort", "floor, not seat", "Ladder", "another recording"):
        assert part in text


def test_the_report_as_pdf_and_as_pictures(page: Page, tmp_path: Path) -> None:
    short = Page(NASTY)
    short.blocks = [b for b in page.blocks if b not in page.pictures] + list(page.pictures[:1])
    write_pdf(short, tmp_path / "report.pdf")
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")
    files = short.write_png(tmp_path / "pictures")
    assert len(files) == 1 and all(f.read_bytes().startswith(b"\x89PNG") for f in files)
    assert all(re.fullmatch(r"\d\d_[a-z0-9_]+\.png", f.name) for f in files)


def decoded(stored: dict[str, Any]) -> np.ndarray:
    """Return an array of a chart as the script of the page reads it."""
    if stored["t"] == "u":
        return stored["a"] + stored["s"] * np.arange(stored["n"])
    raw = base64.b64decode(stored["b"])
    if stored["t"] == "f":
        return np.frombuffer(raw, "<f4").astype(float)
    codes = np.frombuffer(raw, "<i2").astype(float)
    return np.where(codes == -32768, np.nan, stored["a"] + (stored["z"] - stored["a"]) * (codes + 32767) / 65534)


def test_a_chart_holds_the_numbers_of_the_figure() -> None:
    figure = Figure()
    upper, lower = figure.subplots(2, 1, sharex=True)
    time = np.linspace(0.0, 10.0, 500)
    values = np.sin(time) * np.exp(time)
    values[100:110] = np.nan
    upper.plot(time, values, label="signal")
    upper.fill_between(time, -time, time**2, alpha=0.2)
    upper.axhline(1.0)
    lower.semilogy(time, np.exp(-3.0 * time))
    lower.bar([0.0, 1.0], [3.0, 4.0], width=1.0, align="edge")
    chart = chart_of(figure)
    first, second = chart["panels"]
    assert first["group"] == second["group"] and not first["x"]["numbers"] and second["x"]["numbers"] and second["y"]["log"]
    items = {item["k"]: item for item in first["items"]}
    assert items["level"]["v"] == 1.0
    arrays = [decoded(a) for a in chart["arrays"]]
    assert arrays[items["line"]["x"]] == pytest.approx(time)
    shown, span = arrays[items["line"]["y"]], np.nanmax(values) - np.nanmin(values)
    assert np.array_equal(np.isnan(shown), np.isnan(values)) and np.nanmax(np.abs(shown - values)) < 1e-5 * span
    assert arrays[items["band"]["lo"]] == pytest.approx(-time, abs=1e-3)
    assert arrays[items["band"]["hi"]] == pytest.approx(time**2, abs=2e-3)
    bars, curve = second["items"]
    assert bars["k"] == "bars" and list(arrays[bars["y"]]) == [3.0, 4.0]
    assert arrays[curve["y"]] == pytest.approx(np.exp(-3.0 * time), rel=1e-6)  # a logarithmic axis needs relative precision


def test_intervals_of_modes_are_those_of_many_drawn_vehicles() -> None:
    vehicle, rng = load_vehicle("truck_cab"), np.random.default_rng(4)
    estimates = []
    for mount in vehicle.mounts.values():
        for role, relative in (("stiffness", 0.04), ("damping", 0.08)):
            value = next(v for k, v in dataclasses.asdict(mount.elements["z"]).items() if k == role)
            std = relative * value
            estimates.append(Estimate(f"{mount.name}.z.{role}", value, std, "", value, Status.VALID, "", 0))
    found = replay_summary.found_modes(vehicle, estimates)
    drawn = []
    for _ in range(150):
        moved = [dataclasses.replace(e, value=e.value + e.std * rng.normal(), std=0.0) for e in estimates]
        drawn.append([(m.frequency_hz, m.damping_ratio) for m in replay_summary.found_modes(vehicle, moved)])
    spread = 1.96 * np.std(np.array(drawn), axis=0)
    assert sum(mode.frequency_hz < 3.0 for mode in found) == 3
    for mode, (frequency, damping) in zip(found, spread, strict=True):
        if mode.frequency_hz < 3.0:  # those that rest on the vertical values; 150 draws know a spread within 6 %
            assert mode.frequency_half == pytest.approx(frequency, rel=0.25)
            assert mode.damping_half == pytest.approx(damping, rel=0.25)


def test_a_load_that_is_not_known_is_not_called_the_most_damaging(run: OfflineRun, assessment: RunAssessment) -> None:
    assert "most damaging load" in replay_summary.verdict(run, {"warnings": ()}, assessment)
    unknown = [dataclasses.replace(d, estimated=dataclasses.replace(d.estimated, lower=0.0)) for d in assessment.damages]
    words = replay_summary.verdict(run, {"warnings": ()}, dataclasses.replace(assessment, damages=tuple(unknown)))
    assert "most damaging" not in words and "no attachment force is known well enough" in words.lower()


def test_names_of_parameters_in_few_words() -> None:
    assert doctest.testmod(replay_summary)[0] == 0


def friction_found() -> Diagnosis:
    """Return an answer that names a friction of 127 N at one of two mounts, with the numbers of its pictures."""
    time = np.arange(0.0, 6.0, 0.01)
    x = 0.01 * np.sin(2.0 * np.pi * time)
    linear = 5e4 * x
    friction = linear + 120.0 * np.sign(np.gradient(x))
    loops = {f"{m}.{a}": (x, linear, friction, friction) for m in ("left", "right") for a in "xz"}
    ones, table = np.ones(50), np.full((1, 3), 0.1)
    evidence = Evidence(
        np.linspace(0.1, 40.0, 50), ones, ones, ones, ("cab.z",), table, (), np.arange(5.0), np.ones((5, 2)), loops,
        {"cab.z": (time, x, x, x)},
    )
    cause = NamedCause(
        "coulomb_friction", "right", "z", (Reported("friction level", 127.0, 9.0, "N"),), 0.96, (), "a ramp", "", "Does it slide?"
    )
    return Diagnosis(
        "explained", "Friction 127 +- 9 N.", (cause,), None, {"words": "nothing"}, (), load_vehicle("truck_cab"),
        parameters=(Calibration("right.z.stiffness", 5.1e4, 300.0, "N/m", 5.2e4, "valid"),), evidence=evidence,
    )


def test_a_diagnosis_shows_the_loop_of_its_cause_and_the_truth_of_a_simulated_run(tmp_path: Path) -> None:
    answer = friction_found()
    evidence = answer.evidence
    assert evidence is not None
    assert leading_port(answer, evidence) == "right.z"
    figure = large_loop(evidence, "right.z")
    lacks = np.asarray(figure.axes[1].lines[0].get_ydata())
    assert np.allclose(np.abs(lacks[np.abs(lacks) > 1.0]), 120.0)  # the step a friction makes over the rate
    truth = Truth("dry friction of 120 N", {"right.z.friction level": 120.0, "right.z.stiffness": 5.2e4})
    for known in (truth, None):
        write_diagnosis_report(answer, "run", tmp_path / "report.html", known)
        text = (tmp_path / "report.html").read_text()
        places = [text.index(w) for w in ("Friction 127 ± 9 N.", "<h3>Coulomb friction at right z", "right.z: force over")]
        assert places == sorted(places)
        assert ("dry friction of 120 N" in text) == (known is not None) == ('<td class="number">120</td>' in text)
        assert '<td class="number">51.00</td><td class="number">0.30</td><td>N/mm</td>' in text


@pytest.mark.skipif(PROGRAM is None, reason="no browser is installed")
def test_the_page_of_a_diagnosis_is_read_on_screen_on_a_phone_and_in_print(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    write_diagnosis_report(friction_found(), "campaign/rough road/bag", path, Truth("dry friction of 120 N", {}))
    browser = Browser(tmp_path / "profile")
    try:
        browser.open(path, 1280, 900)
        # verdict, cause and truth are on the first screen, the loop that shows it begins there
        tops = "[...document.querySelectorAll('.verdict, .side, figure.chart')].map(e => e.getBoundingClientRect())"
        verdict, answer, loop = browser.run(f"{tops}.slice(0, 3).map(r => [r.top, r.bottom])")
        assert 0 < verdict[1] < answer[1] < loop[0] < 900
        assert "120 N" in browser.run("document.body.innerText") and "valid" in browser.run("document.body.innerText")
        charts = browser.run("[document.querySelectorAll('figure.chart').length, document.querySelectorAll('.plot>svg').length]")
        assert charts[0] == charts[1] > 3
        # a cursor over the loop reads both axes
        place = """(() => { const box = document.querySelector('figure.chart').chart.panels[0].box,
          view = document.querySelector('figure.chart .plot>svg').getBoundingClientRect();
          return [view.left + box[0] + box[2] / 2, view.top + box[1] + box[3] / 2]; })()"""
        browser.mouse("mouseMoved", *browser.run(place))
        assert re.search(r"deflection: [-\d.]+ mm", browser.run("document.querySelector('figure.chart .readout').innerText"))
        # every printed page has the name of the run and its number
        rules = browser.run("[...document.styleSheets].flatMap(s => [...s.cssRules]).map(r => r.cssText).join(' ')")
        assert "rough road" in rules and "counter(page)" in rules and browser.pdf().startswith(b"%PDF")
        browser.open(path, 390, 844)
        assert browser.run("document.documentElement.scrollWidth") == 390
        assert browser.complaints == []
    finally:
        browser.close()


def test_drawn_twice_a_picture_is_the_same(page: Page) -> None:
    picture = next(p for p in page.pictures if "Range pairs" in p.caption)  # logarithmic axis, ticks with powers of ten
    assert png(picture, 50) == png(picture, 50)


def test_only_a_seat_is_a_seat() -> None:
    assert "seat" in place_of("pad", "seat") and "seat" in place_of("driver_seat", "cab")
    assert place_of("front_left", "cab") == "cab at front_left"


def test_a_long_cell_of_a_document_is_continued_and_not_cut(tmp_path: Path) -> None:
    page = Page("title")
    words = " ".join(f"word{i}" for i in range(40))
    page.table(["name", "finding"], [["a", words], ["b", 2.0]])
    write_pdf(page, tmp_path / "report.pdf")
    assert (tmp_path / "report.pdf").stat().st_size > 1000
    assert sum(len(line[1].split()) for line in _wrapped(["a", words])) == 40
    assert all(len(line[1]) <= 48 for line in _wrapped(["a", words]))


def test_every_cell_of_a_table_is_in_the_document_and_nothing_leaves_the_sheet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sheets: list[Figure] = []
    kept = PdfPages.savefig
    monkeypatch.setattr(PdfPages, "savefig", lambda document, figure: (sheets.append(figure), kept(document, figure)))
    page = Page("A heading of words that goes on and on over more than one line of the sheet")
    sentence = "What moved more than it should was measured, whatever anybody might have wanted to say about the wheels. " * 3
    page.verdict(sentence)
    page.text(sentence)
    page.warning(sentence)
    page.table(["sensor", "rate [Hz]", "finding"], [["cab", 200.0, "fine"], ["base", Digits("99.8"), "two gaps"]])
    page.table(["", ""], [["software", "one two"]])
    write_pdf(page, tmp_path / "report.pdf")
    labels = [label for sheet in sheets for label in sheet.texts]
    text = " ".join(" ".join(label.get_text() for label in labels).split())
    for words in ("sensor rate [Hz] finding", "cab 200 fine", "base 99.8 two gaps", "software one two"):
        assert words in text
    for label in labels:
        box = label.get_window_extent()
        assert box.x1 <= label.figure.bbox.width - 0.5 * label.figure.dpi, label.get_text()


def test_numbers_have_the_digits_that_are_meant():
    failed, tried = doctest.testmod(numbers)
    assert failed == 0 and tried == 5
    for value in (0.99999, 9999.6, -123456.7, 2.5e-4, 0.0, 1e300):
        assert float(numbers.plain(value)) == pytest.approx(value, rel=5e-4)
    assert "e" not in numbers.plain(9.9e6) + numbers.plain(1.1e-4)
    for value, std in ((61291.0, 615.0), (-12.3456, 0.00098), (99.96, 0.0996), (5.0, 1e3), (1e9, 3e5)):
        shown, spread = map(float, numbers.with_std(value, std))
        assert abs(shown - value) <= 0.06 * std and spread == pytest.approx(std, rel=0.06)


def test_a_signal_of_zeros_and_a_name_of_escapes_can_be_drawn(tmp_path: Path) -> None:
    figure = Figure()
    axes = figure.subplots()
    axes.loglog([1.0, 2.0], [0.0, 0.0], label="\x1b\udcfc")
    axes.legend()
    page = Page("p")
    page.figure(figure, "zeros")
    page.write(tmp_path / "r.html")
    assert page.write_png(tmp_path / "pictures")[0].stat().st_size > 1000
