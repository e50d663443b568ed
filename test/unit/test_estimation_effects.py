# Copyright 2026 ride_estimation contributors
"""Intervals of forces with an effect that the vehicle file does not know: they hold the truth and are not much wider than it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from effect_intervals import judge


@pytest.mark.slow
@pytest.mark.parametrize(("case", "seed"), [("base_gain", 9001), ("base_gain", 9103), ("body_misalignment", 9003)])
def test_a_wrong_sensor_widens_forces_by_what_it_may_do_to_them(case: str, seed: int):
    for _, middle, low, ratio in judge(case, seed).values():
        assert middle > 0.9 and low > 0.75 and ratio < 5.0


@pytest.mark.slow
def test_smoothed_forces_hold_a_load_that_transducers_show_once():
    figures = judge("load_with_travel", 9004)
    for path in ("live", "smoothed"):
        error, middle, low, _ = figures[f"{path} horizontal"]
        assert error < 0.3 and middle > 0.85 and low > 0.7
