# Copyright 2026 ride_estimation contributors
"""The command ``export-model``: what it writes and what it refuses; the models themselves are run in test_exported_fmu.py."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pytest
import yaml

from ride_estimation.cli.main import main

ELEMENT = {
    "kind": "kelvin_voigt", "damping_n_s_per_m": 800.0,
    "stiffness_n_per_m": {"value": 2.0e5, "std": 1.5e3, "range": [1.0e5, 3.0e5]},
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
    assert "standard deviation 1500; range 100000 to 300000" in description


def test_the_same_model_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one.fmu", "two.fmu"):
        assert main(["export-model", "quarter_car", "--fmi", "2", "--source-only", "--out", str(tmp_path / name)]) == 0
    assert (tmp_path / "one.fmu").read_bytes() == (tmp_path / "two.fmu").read_bytes()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["truck_cab", "--mount", "front_lef"], "no such mount; allowed: front_left"),
        (["truck_cab", "--rate", "0"], "allowed: more than 0 Hz"),
        (["no_such_vehicle"], "no_such_vehicle"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_one_sentence(
    words: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export-model", *words, "--out", str(tmp_path / "x.fmu")]) == 2
    assert sentence in capsys.readouterr().err
    assert not (tmp_path / "x.fmu").exists()


def test_another_ending_and_a_mount_of_an_element_are_refused(
    element: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export-model", str(element), "--out", str(tmp_path / "x.zip")]) == 2
    assert "allowed ending: .fmu" in capsys.readouterr().err
    assert main(["export-model", str(element), "--mount", "front", "--out", str(tmp_path / "x.fmu")]) == 2
    assert "one force element, not a vehicle" in capsys.readouterr().err
