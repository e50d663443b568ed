# Copyright 2026 ride_estimation contributors
"""Scenes of a working day against the targets of the estimator; the full table is printed by benchmarks/estimator_scenes.py."""

from __future__ import annotations

import importlib.util
import pathlib
import sys

import numpy as np
import pytest

from ride_estimation.estimation.parameters.parameter_change import common_change, moved, steady_scatter
from ride_estimation.estimation.parameters.periodic_excitation import PeriodicExcitation

ROOT = pathlib.Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def scenes():
    """Return the benchmark that makes the scenes."""
    spec = importlib.util.spec_from_file_location("estimator_scenes", ROOT / "benchmarks" / "estimator_scenes.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    before = list(sys.path)
    # data classes look their module up; the benchmark puts folders on the path
    sys.modules["estimator_scenes"] = module
    spec.loader.exec_module(module)
    yield module
    sys.path[:] = before
    del sys.modules["estimator_scenes"]


@pytest.mark.slow
def test_a_load_without_a_scale_reference_is_followed_named_and_suspect(scenes):
    """A fifth of the mass comes on: k/m within 3 % after 15 s, a sentence, forces within the widened intervals."""
    figures = {}
    said = scenes.payload(3531, None, 0.0, False, figures)
    assert max(figures["stiffness vertical"]) < 0.03
    assert figures["not_identifiable"] == [1.0]
    assert "together" in said
    assert np.mean(figures["force vertical inside"]) > 0.92


@pytest.mark.slow
def test_a_load_cell_follows_a_load(scenes):
    """The mass is within 3 % of the loaded one 15 s after the load."""
    figures = {}
    scenes.payload(3532, "load_cell", 0.0, False, figures)
    assert max(figures["mass"]) < 0.03
    assert figures["mass inside"] == [1.0]


@pytest.mark.slow
def test_an_idling_engine_teaches_nothing(scenes):
    """No parameter moves by more than 0.5 % in two minutes of a line of 0.3 m/s^2; the drive that follows is known at once."""
    figures = {}
    scenes.idle(3500, (650 / 60, 0.3), 2.0, figures)
    assert max(figures["moved"]) < 0.005
    assert np.mean(figures["force vertical"]) < 0.04


@pytest.mark.slow
def test_warming_mounts_are_followed(scenes):
    """A fifth of all stiffness is lost in a minute: the truth lies within two standard deviations, the end within 3 %."""
    figures = {}
    scenes.warm(3533, False, figures)
    assert np.percentile(figures["stiffness vertical"], 95) < 0.03
    assert np.mean(figures["parameters inside during"]) > 0.92


@pytest.mark.slow
def test_a_run_that_starts_in_motion(scenes):
    """The first sample is on a rough road: vertical stiffness within 1 % ten seconds later."""
    figures = {}
    road = scenes.Road.random(np.random.default_rng([3534, 12]), "rough")
    scenes.drive_once(3534, figures, road=road, duration=16.0, cut_s=8.0)
    assert np.median(figures["stiffness vertical"]) < 0.01
    assert np.mean(figures["force vertical inside"]) > 0.92


@pytest.mark.slow
def test_forces_over_potholes(scenes):
    """Holes of 4 to 9 cm on one side or both: vertical forces within their intervals as often as stated."""
    figures = {}
    scenes.drive_once(3540, figures, road=scenes.obstacles("potholes", 3540), duration=20.0)
    assert np.mean(figures["force vertical inside"]) > 0.92


@pytest.mark.slow
def test_forces_in_bends(scenes):
    """Lateral accelerations of 1.5 to 4 m/s^2 for seconds, the vehicle turning: horizontal forces within their intervals."""
    inside = []
    for seed in (3501, 3502):
        figures = {}
        scenes.drive_once(seed, figures, road=scenes.lasting("bend", seed), duration=25.0)
        inside.append(np.mean(figures["force horizontal inside"]))
    assert min(inside) > 0.92


def test_a_line_repeats_itself_and_a_road_does_not():
    """A sine that no sample rate divides, in noise a tenth its size; random motion of a weakly damped body."""
    rng = np.random.default_rng(3535)
    time = np.arange(2000) / 200.0
    line = np.sin(2 * np.pi * 10.83 * time)[:, None] * [0.1, 0.0, 1.0] + rng.normal(0.0, 0.05, (2000, 3))
    road = np.zeros((2000, 3))
    for n in range(2, 2000):
        # 2 Hz, a tenth of critical damping
        road[n] = 1.983564 * road[n - 1] - 0.987513 * road[n - 2] + rng.normal(size=3)
    for signal, expected in ((line, True), (road, False)):
        repetition = PeriodicExcitation()
        found = [repetition.observe(signal[n : n + 50], 0.005) for n in range(0, 2000, 50)]
        assert not any(found[:20])
        assert all(found[24:]) if expected else not any(found)


def test_a_drift_is_no_scatter_and_shows_as_a_change():
    """Forty intervals of information 100 about one parameter that moves by 0.5 from the 30th on; noise of one gradient std 10."""
    rng = np.random.default_rng(3536)
    still = rng.normal(0.0, 10.0, (40, 1))
    moving = still + 100.0 * np.where(np.arange(40) < 30, 0.0, 0.5)[:, None]
    slow = still + 1.25 * np.arange(40)[:, None]
    # forty intervals of variance 100 each, known to sqrt(2 / 18); a slope d adds 4 d^2 to each, 250 in all, its mean square 33000
    assert steady_scatter(still)[0, 0] == pytest.approx(4000.0, rel=0.7)
    assert steady_scatter(slow)[0, 0] == pytest.approx(steady_scatter(still)[0, 0] + 250.0, rel=0.2)
    information, p = np.full((40, 1, 1), 100.0), np.array([[1e-4]])
    assert moved(information, still, p, np.zeros((1, 0)))[0] == pytest.approx(0.0)
    step, added = moved(information, moving, p, np.zeros((1, 0)))
    assert step[0] == pytest.approx(0.5, abs=0.15)
    assert added[0, 0] > 0.0


def test_common_change_and_what_it_leaves():
    old, std = np.zeros(4), np.full(4, 0.01)
    mean, error, share = common_change(old, std, np.full(4, -0.18), std)
    assert (mean, error, share) == pytest.approx((-0.18, 0.01 / np.sqrt(2.0), 1.0))
    assert common_change(old, std, np.array([-0.18, 0.0, 0.0, 0.0]), std)[2] == pytest.approx(0.25)
