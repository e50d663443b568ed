# Copyright 2026 ride_estimation contributors
"""The command ``export-model``: what it writes and what it refuses; the models themselves are run in test_exported_fmu.py."""

from __future__ import annotations

import csv
import json
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from ride_estimation.cli.arguments.export_model import FORMATS
from ride_estimation.cli.main import main

ELEMENT = {
    "kind": "kelvin_voigt", "damping_n_s_per_m": 800.0,
    "stiffness_n_per_m": {"value": 2.0e5, "std": 1.5e3, "range": [1.0e5, 3.0e5]},
    "seen_in_data": {
        "largest_deflection_mm": 4.0, "lowest_frequency_hz": 0.5, "highest_frequency_hz": 20.0, "lowest_preload_n": -50.0,
        "highest_preload_n": 1.2e3,
    },
}


@pytest.fixture
def element(tmp_path: Path) -> Path:
    folder = tmp_path / "bushing"
    folder.mkdir()
    file = folder / "element.yaml"
    file.write_text(yaml.safe_dump(ELEMENT))
    return file


def test_parameters_go_with_standard_deviation_and_range(element: Path, tmp_path: Path) -> None:
    plain = {"kind": "kelvin_voigt", "stiffness_n_per_m": 2.0e5, "damping_n_s_per_m": 800.0}
    found = {"element": plain, "model": "kelvin_voigt", "parameters": [{"name": "damping", "value": 800.0, "std": 9.0}]}
    element.with_name("identification.json").write_text(json.dumps(found))
    out = tmp_path / "bushing.fmu"
    assert main(["export-model", str(element), "--out", str(out), "--source-only"]) == 0
    with zipfile.ZipFile(out) as archive:
        names = set(archive.namelist())
        document = json.loads(archive.read("resources/parameters.json"))
        description = archive.read("modelDescription.xml").decode()
    assert {"sources/fmi3.c", "sources/model.h", "sources/kernels.h", "sources/data.h"} <= names
    assert not any(name.startswith("binaries") for name in names)
    stiffness = next(p for p in document["parameters"] if p["name"] == "stiffness")
    assert (stiffness["value"], stiffness["std"], stiffness["lower"], stiffness["upper"]) == (2.0e5, 1.5e3, 1.0e5, 3.0e5)
    assert document["origin"]["identification"]["parameters"] == found["parameters"]
    assert next(p for p in document["parameters"] if p["name"] == "damping")["std"] == 9.0
    assert "standard deviation 1500; range 100000 to 300000; seen in the data: up to 0.004 m, 0.5 to 20 Hz" in description
    assert stiffness["seen_in_data"] == {
        "largest_deflection": 0.004, "lowest_frequency": 0.5, "highest_frequency": 20.0, "lowest_preload": -50.0,
        "highest_preload": 1.2e3,
    }  # fmt: skip
    found = ElementTree.fromstring(description)
    (variable,) = (v for v in found.iter("Float64") if v.get("name") == "stiffness")
    assert (variable.get("start"), variable.get("min"), variable.get("max")) == ("200000.0", "100000.0", "300000.0")
    (annotation,) = variable.iter("Parameter")
    assert (annotation.get("std"), annotation.get("largest_deflection")) == ("1500.0", "0.004")


@pytest.mark.parametrize("form", ["modelica", "adams", "simscape", "table"])
def test_every_text_format_carries_what_is_known(
    form: str, element: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / f"bushing{FORMATS[form]}"
    assert main(["export-model", str(element), "--format", form, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "2 parameters, 1 with a standard deviation; what the data showed is known of 1 of 1 elements" in said
    text = out.read_text()
    for words in ("2000", "1500", "0.004 m, 0.5 to 20 Hz, preload -50 to 1200 N", "sha256"):
        assert words in text, words


def test_identified_parameters_of_a_sum_keep_deviation_and_correlation(tmp_path: Path) -> None:
    parts = [
        {"kind": "kelvin_voigt", "stiffness_n_per_m": 1.0e5, "damping_n_s_per_m": 0.0},
        {"kind": "maxwell", "stiffness_n_per_m": 2.0e4, "damping_n_s_per_m": 300.0},
    ]
    (tmp_path / "element.yaml").write_text(yaml.safe_dump({"kind": "sum", "elements": parts}))
    parameters = [
        {"name": "stiffness", "value": 1.0e5, "std": 800.0, "unit": "N/m"},
        {"name": "cell_1_stiffness", "value": 2.0e4, "std": 700.0, "unit": "N/m"},
        {"name": "cell_1_damping", "value": 300.0, "std": 20.0, "unit": "N s/m"},
    ]

    def width(correlation: float) -> float:
        table = [[1.0, correlation, 0.0], [correlation, 1.0, 0.0], [0.0, 0.0, 1.0]]
        document = {"element": {"kind": "sum", "elements": parts}, "parameters": parameters, "correlation": table}
        (tmp_path / "identification.json").write_text(json.dumps(document))
        out = tmp_path / "map.csv"
        words = ["--format", "table", "--frequencies", "200", "--amplitudes", "0.001", "--out", str(out)]
        assert main(["export-model", str(tmp_path / "element.yaml"), *words]) == 0
        (row,) = csv.DictReader(line for line in out.read_text().splitlines() if not line.startswith("#"))
        return float(row["stiffness_high"]) - float(row["stiffness_low"])

    # far above the corner of the cell both stiffnesses add
    expected = ((800**2 + 700**2 - 2 * 0.9 * 800 * 700) / (800**2 + 700**2)) ** 0.5
    assert width(-0.9) / width(0.0) == pytest.approx(expected, rel=0.05)


def test_the_same_model_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one.fmu", "two.fmu"):
        assert main(["export-model", "quarter_car", "--format", "fmi2", "--source-only", "--out", str(tmp_path / name)]) == 0
    assert (tmp_path / "one.fmu").read_bytes() == (tmp_path / "two.fmu").read_bytes()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["truck_cab", "--mount", "front_lef"], "no such mount; allowed: front_left"),
        (["truck_cab", "--rate", "0"], "allowed: more than 0 Hz"),
        (["truck_cab", "--frequencies", "3"], "only tables have them"),
        (["no_such_vehicle"], "no_such_vehicle"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_one_sentence(
    words: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export-model", *words, "--out", str(tmp_path / "x.fmu")]) == 2
    assert sentence in capsys.readouterr().err
    assert not (tmp_path / "x.fmu").exists()


def test_numbers_and_mounts_that_a_format_cannot_have_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export-model", "truck_cab", "--format", "adams", "--out", str(tmp_path / "x.bus")]) == 2
    assert "holds one mount: choose it with --mount; there are front_left" in capsys.readouterr().err
    words = ["--format", "table", "--amplitudes", "0", "--out", str(tmp_path / "x.csv")]
    assert main(["export-model", "truck_cab", *words]) == 2
    assert "allowed: more than 0" in capsys.readouterr().err


def test_another_ending_and_a_mount_of_an_element_are_refused(
    element: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export-model", str(element), "--out", str(tmp_path / "x.zip")]) == 2
    assert "as fmi3; allowed ending: .fmu" in capsys.readouterr().err
    assert main(["export-model", str(element), "--mount", "front", "--out", str(tmp_path / "x.fmu")]) == 2
    assert "one force element, not a vehicle" in capsys.readouterr().err
