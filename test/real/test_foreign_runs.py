# Copyright 2026 ride_estimation contributors
"""Recorded vehicles that another program simulated, with the truth beside them: what ``diagnose`` says of some."""

from __future__ import annotations

import json

import pytest

from ride_estimation.cli.main import main

pytestmark = pytest.mark.slow


@pytest.fixture
def diagnosis(real_data, tmp_path):
    """Return a function: name of a run -> its diagnosis.json, the other road as validation."""
    folder = real_data("foreign_runs")

    def of(name):
        run = folder / name
        vehicle = ["--vehicle", str(run / "vehicle.yaml")] if (run / "vehicle.yaml").exists() else []
        arguments = ["diagnose", str(run / "run"), "--validate", str(run / "run2"), *vehicle, "--out", str(tmp_path)]
        assert main([*arguments, "--no-report"]) == 0
        return json.loads((tmp_path / "diagnosis.json").read_text())

    return of


@pytest.mark.parametrize("name", ["cab_04", "cab_05", "cab_24", "planar_15", "quarter_19", "bench_22"])
def test_no_cause_is_named_on_a_healthy_vehicle(diagnosis, name):
    answer = diagnosis(name)
    assert (answer["verdict"], answer["causes"]) == ("no_discrepancy", [])


@pytest.mark.parametrize(
    ("name", "cause", "location", "number", "value"),
    [
        ("cab_00", "sensor_misalignment", "cab_fr", "angle", -18.0),  # deg, far beyond a small rotation
        ("cab_02", "sensor_clipping", "cab_fl", "clipping level", 12.888),  # m/s^2, on the validation run alone
        ("cab_03", "coulomb_friction", "rear", "friction level rl", 464.1),  # N
        ("planar_16", "coulomb_friction", "seat_suspension", "friction level", 16.9),  # N
        ("cab_06", "mass_change", "cab", "added mass", 135.3),  # kg, by the travel of the mounts
        ("planar_17", "mass_change", "seat", "added mass", 11.09),  # kg, by the travel of the seat
        ("quarter_20", "mass_change", "body", "added mass", 274.3),  # kg
    ],
)
def test_the_hidden_effect_is_named_alone_with_its_place_and_size(diagnosis, name, cause, location, number, value):
    answer = diagnosis(name)
    assert answer["verdict"] == "explained"
    assert [(c["id"], c["location"]) for c in answer["causes"]] == [(cause, location)]
    stated = next(p for p in answer["causes"][0]["parameters"] if p["name"] == number)
    assert stated["value"] == pytest.approx(value, rel=0.15)


def test_a_load_is_named_beside_a_damper_that_pulls_one_way(diagnosis):
    causes = {c["id"]: c["location"] for c in diagnosis("cab_13")["causes"]}
    assert causes == {"damping_nonlinearity": "fl", "mass_change": "cab"}


def test_an_error_within_its_tolerance_is_no_third_cause(diagnosis):
    """A delay that was beyond tolerance when it was found shrank to 0.2 ms once the installation was calibrated anew."""
    causes = {c["id"]: c["location"] for c in diagnosis("cab_07")["causes"]}
    assert causes == {"coulomb_friction": "rear", "sensor_delay": "chassis_rr"}


def test_a_trial_model_that_runs_away_ends_no_diagnosis(diagnosis):
    assert diagnosis("planar_23")["causes"][0]["id"] == "bump_stop"


def test_the_law_of_the_bouc_wen_benchmark_is_found(real_data, tmp_path, capsys):
    folder = real_data("bouc_wen")
    arguments = ["diagnose", str(folder / "train.csv"), "--oscillator", "u,y", "--rate", "750", "--no-report"]
    assert main([*arguments, "--validate", str(folder / "test_multisine.csv"), "--out", str(tmp_path)]) == 0
    assert "Bouc-Wen" in capsys.readouterr().out
    answer = json.loads((tmp_path / "diagnosis.json").read_text())
    assert answer["causes"][0]["id"] == "coulomb_friction"
    assert answer["gain"]["validation"][0]["extended"] < 10 ** (-130 / 20) / 6.67e-4  # -130 dB re 1 m at 0.667 mm rms
