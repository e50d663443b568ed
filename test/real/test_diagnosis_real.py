# Copyright 2026 ride_estimation contributors
"""Diagnosis of measured records: dry friction of a magnetorheological damper, refusal of a single IMU."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.cli.main import main
from ride_estimation.diagnosis.adapters.oscillator import diagnose_oscillator
from ride_estimation.io.bench_records import read_oscillator_record
from ride_estimation.io.vehicle_file import load_vehicle

SINGLE = Path(__file__).parents[2] / "config" / "vehicles" / "single_imu.yaml"
READING = [
    "--time", "Tout", "--displacement", "dist", "--force", "forc", "--displacement-unit", "mm", "--force-unit", "N",
    "--zero", "mean", "--no-report",
]  # fmt: skip
#: record, another record of the same voltage, friction published for the voltage [N]
DAMPER = [("ensaio5.1", "ensaio7.1", 50.2), ("ensaio5.2.2", "ensaio7.2.2", 209.7), ("ensaio.A.5", "ensaio.A.7", 562.1)]


@pytest.mark.parametrize(("name", "other", "published"), DAMPER)
def test_friction_of_the_damper_is_named_and_pays_on_another_stroke(real_data, tmp_path, name, other, published):
    folder = real_data("mr_damper_loops_labcontrol")
    arguments = ["diagnose", str(folder / f"{name}.mat"), "--validate", str(folder / f"{other}.mat"), *READING]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    document = json.loads((tmp_path / "diagnosis.json").read_text())
    first = document["causes"][0]
    assert (first["id"], first["location"], first["axis"]) == ("coulomb_friction", "mount", "z")
    level = next(p for p in first["parameters"] if p["name"] == "friction level")
    # the authors fit run by run with scatter of about 20 % between strokes
    assert level["value"] == pytest.approx(published, rel=0.25)
    gain = document["gain"]["validation"][0]
    assert gain["extended"] < 0.6 * gain["baseline"]
    # a damper of this kind is more than friction: what remains lies above the noise and is said
    assert gain["extended"] > gain["noise_floor"]


@pytest.mark.parametrize("bag", ["test1.bag", "test2.bag"])
def test_one_imu_without_base_motion_is_refused_with_the_reason(real_data, tmp_path, bag):
    run = real_data("ros1_bags_husky_jackal_robot_localization") / bag
    assert main(["diagnose", str(run), "--vehicle", str(SINGLE), "--out", str(tmp_path), "--no-report"]) == 0
    document = json.loads((tmp_path / "diagnosis.json").read_text())
    assert document["verdict"] == "insufficient_data"
    assert document["causes"] == []
    assert "base motion" in document["sentence"]


@pytest.mark.slow
def test_the_spring_of_the_silverbox_is_named_from_the_command_line(real_data, tmp_path):
    folder = real_data("silverbox_duffing_benchmark")
    rate = repr(1e7 / 2**14)  # Hz, a known fact of the benchmark
    arguments = ["diagnose", str(folder / "SNLS80mV.csv"), "--oscillator", "V1,V2", "--rate", rate]
    arguments += ["--validate", str(folder / "Schroeder80mV.csv"), "--out", str(tmp_path)]
    assert main(arguments) == 0
    document = json.loads((tmp_path / "diagnosis.json").read_text())
    assert (document["verdict"], [c["id"] for c in document["causes"]]) == ("explained", ["stiffness_nonlinearity"])
    by_name = {p["name"]: p for p in document["causes"][0]["parameters"]}
    # the benchmark's linear resonance is near 70 Hz
    assert by_name["natural frequency"]["value"] == pytest.approx(69.0, rel=0.03)
    assert by_name["cubic over linear rate"]["value"] > 10.0 * by_name["cubic over linear rate"]["std"] > 0.0
    assert all(v["extended"] < v["baseline"] / 20.0 for v in document["gain"]["validation"])
    assert load_vehicle(tmp_path / "vehicle_extended.yaml").name == "oscillator"
    assert "tiffness nonlinearity" in (tmp_path / "report.html").read_text()


@pytest.mark.slow
def test_the_spring_of_the_silverbox_is_named(real_data):
    folder = real_data("silverbox_duffing_benchmark")
    rate = 1e7 / 2**14  # Hz, a known fact of the benchmark
    record, other = (
        read_oscillator_record(folder / f"{name}.csv", "V1,V2", rate, "") for name in ("SNLS80mV", "Schroeder80mV")
    )
    answer = diagnose_oscillator(record, np.arange(record.u.size) >= 41200, [other])
    assert answer.verdict == "explained"
    assert [c.id for c in answer.causes] == ["stiffness_nonlinearity"]
    assert answer.causes[0].parameters[0].value > 0.0  # hardens
    for judged in answer.gain.validation:
        assert judged.extended < judged.baseline / 20.0
        assert 0.0 < judged.ci95[0] < judged.baseline - judged.extended < judged.ci95[1]
    assert answer.to_mapping()["causes"][0]["confidence"] > 0.9
