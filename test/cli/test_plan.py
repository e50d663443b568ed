# Copyright 2026 ride_estimation contributors
"""End to end: ``ride-estimation plan``."""

from pathlib import Path

from ride_estimation.cli.main import main

VEHICLE = str(Path(__file__).parents[2] / "config" / "vehicles" / "truck_cab.yaml")


def test_plan_prints_bounds_and_additions(capsys):
    assert main(["plan", "--vehicle", VEHICLE]) == 0
    text = capsys.readouterr().out
    assert "rank 24 of 24" in text
    assert "load cell at" in text


def test_plan_without_an_anchor_says_what_scales_together(capsys):
    assert main(["plan", "--vehicle", VEHICLE, "--unknown-mass", "--rigid-frame"]) == 0
    assert "scale together" in capsys.readouterr().out


def test_bad_numbers_end_with_code_2(capsys):
    assert main(["plan", "--vehicle", VEHICLE, "--speed", "-3"]) == 2
    assert "must be positive" in capsys.readouterr().err
