# Copyright 2026 ride_estimation contributors
"""Intervals of innovations: what is considered is found by Gauss-Newton; what no model explains does not average away."""

from __future__ import annotations

import numpy as np
import pytest

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.parameters.base_gains import BaseGains
from ride_estimation.estimation.parameters.interval import Interval, IntervalMemory
from ride_estimation.estimation.parameters.parameter_filter import ParameterFilter
from ride_estimation.io.vehicle_file import load_vehicle

TRUE, OFFSET = np.array([0.03, -0.02, 0.01]), np.array([0.4, -0.2])
PRIOR = np.full(3, 0.2)


def memory(noise: float, offset: np.ndarray, missing: float = 0.0, hits: int = 0, seed: int = 1) -> IntervalMemory:
    """Thirty intervals of six channels, linearised at zero; ``missing`` of a cubed signal is in no model, ``hits`` are broken."""
    rng = np.random.default_rng(seed)
    found = IntervalMemory(3, len(offset))
    for n in range(30):
        gradient = rng.standard_normal((50, 6, 3 + len(offset)))
        innovation = gradient[:, :, :3] @ TRUE + gradient[:, :, 3:] @ offset + noise * rng.standard_normal((50, 6))
        innovation += missing * (gradient[:, :, 0] ** 3 - 3.0 * gradient[:, :, 0] * gradient[:, :, 1] ** 2)
        if n < hits:
            innovation += 20.0 * noise * rng.standard_normal((50, 6))
        interval = Interval(3, len(offset), 0.007)
        interval.add(innovation, gradient, np.zeros((50, 6)), np.eye(6) / noise, 0.5)
        found.add(interval, np.zeros(3))
    found.inflation = 1.0
    return found


def stds(own: IntervalMemory) -> np.ndarray:
    return own.standard_deviation(np.linalg.inv(own.total + np.diag(PRIOR**-2.0)), TRUE)


def test_what_is_considered_is_found_with_its_covariance():
    scores = []
    for seed in range(20):
        found, covariance = memory(0.5, OFFSET, seed=seed).estimate_considered(np.zeros(3), PRIOR, np.zeros(3), 2)
        scores.append((found - OFFSET) @ np.linalg.solve(covariance, found - OFFSET) / 2.0)
    # squared error over variance of two numbers; the stated one holds a margin of 1.2 squared
    assert 0.35 < np.mean(scores) < 1.3


def test_parameters_that_differ_from_themselves_leave_what_is_considered_open():
    own = memory(0.5, OFFSET)
    sure, doubtful = (own.estimate_considered(np.zeros(3), PRIOR, spread, 2)[1] for spread in (np.zeros(3), np.full(3, 5.0)))
    assert np.all(np.diag(doubtful) > 2.0 * np.diag(sure))


def test_what_no_model_explains_makes_parameters_as_uncertain_as_one_interval_leaves_them():
    plain, missed = stds(memory(0.05, np.zeros(2))), stds(memory(0.05, np.zeros(2), missing=0.05))
    # thirty intervals: five and a half times that of their mean, beside what the larger innovations scatter more
    assert np.all(missed > 4.0 * plain)
    values = [memory(0.05, np.zeros(2), missing=0.05, seed=seed) for seed in range(6)]
    steps = [np.linalg.solve(own.total, own.scores(np.zeros(3))[1].sum(axis=0)) - TRUE for own in values]
    assert np.all(np.abs(steps) < 2.0 * missed)


def test_a_few_broken_intervals_are_no_missing_law():
    # noise alone would make the scatter of the mean this much larger, and nothing more is added
    own = memory(0.5, np.zeros(2), hits=5)
    assert own._coherence(TRUE, np.zeros(2)) < 2.5
    assert memory(0.05, np.zeros(2), missing=0.05)._coherence(TRUE, np.zeros(2)) > 10.0


def test_an_offset_that_is_found_is_not_missing_in_the_model():
    own = memory(0.05, OFFSET)
    assert own._coherence(TRUE, np.zeros(2)) > 20.0
    assert own._coherence(TRUE, OFFSET) == pytest.approx(1.0, abs=1.5)
    again = IntervalMemory(3, 2)
    again.load(own.snapshot())
    for one, other in zip(again.estimate_considered(TRUE, PRIOR, PRIOR, 2), own.estimate_considered(TRUE, PRIOR, PRIOR, 2)):
        np.testing.assert_array_equal(one, other)


def learned(missing: float, seed: int) -> ParameterFilter:
    """A filter that starts at the file's values and takes thirty intervals; what is missing in the model moves parameters too."""
    rng = np.random.default_rng(seed)
    own = ParameterFilter(np.zeros(3), PRIOR, np.full(3, -1.0), np.full(3, 1.0), 1.0, np.zeros((3, 0)), 0)
    for _ in range(30):
        gradient, centre = rng.standard_normal((50, 6, 3)), own.theta.copy()
        innovation = gradient @ (TRUE - centre) + 0.5 * rng.standard_normal((50, 6)) + missing * gradient[:, :, 0] ** 3
        interval = Interval(3, 0, 0.007)
        interval.add(innovation, gradient, np.zeros((50, 6)), np.eye(6) / 0.5, 0.5)
        own.learn(interval, centre)
    return own


def test_a_filter_is_as_sure_as_its_intervals_agree_and_no_surer_than_the_model_is_whole():
    scores = [(own.theta - TRUE) / own.std for own in (learned(0.0, seed) for seed in range(20))]
    # the stated deviation holds a margin of 1.2 and Student's factor
    assert 0.3 < np.mean(np.square(scores)) < 1.2
    # a cubed signal is in every interval: their mean is no better than one of them, root of thirty times what noise leaves
    wrong = np.array([learned(0.3, seed).std / learned(0.0, seed).std for seed in range(5)])
    assert np.all(wrong > 4.0)


def test_one_considered_quantity_is_estimated_beside_the_others_with_its_standard_deviation():
    alone, scores = np.array([0.0, 0.3]), []
    for seed in range(40):
        found, std, explained = memory(0.5, alone, seed=seed).judge_considered(np.zeros(3), PRIOR, 0, 10)
        assert np.argmax(explained) == 1
        scores.append((found - alone) / std)
    # ten intervals: a variance about as wide as that of Student with ten degrees of freedom
    assert np.mean(np.array(scores)[:, 1] ** 2) == pytest.approx(1.0, abs=0.5)
    still = memory(0.5, alone)
    still._cross = [cross * (1.0, 0.0) for cross in still._cross]
    still._considered_parts = [(own * np.diag((1.0, 0.0)), g * (1.0, 0.0)) for own, g in still._considered_parts]
    assert [float(part[1]) for part in still.judge_considered(np.zeros(3), PRIOR, 0, 10)][::2] == [0.0, 0.0]
    after = memory(0.5, alone).judge_considered(np.zeros(3), PRIOR, 1, 10)
    assert [len(part) for part in after] == [1, 1, 1]


def test_a_base_sensor_that_reads_too_much_is_named_until_it_does_no_longer():
    gains = BaseGains(geometry_of(load_vehicle("truck_cab")), True)
    wrong, less, right = (np.where(np.arange(len(gains.places)) == 3, gain, 0.0) for gain in (0.3, 0.05, 0.0))
    for gain, suspects in ((less, set()), (wrong, {1}), (less, {1}), (right, set())):
        gains.judge(memory(0.05, gain), np.zeros(3), PRIOR, 0, np.full(len(gains.places), 1e4))
        assert set(gains.suspects) == suspects
        # an error of the force at that mount, as large as the gain and no larger
        std = np.sqrt(gains.force_variance) / 100.0
        assert std[1, 1] == pytest.approx(gain[3] if suspects else 0.0, rel=0.2) and std[1, 1] == std.max()
        assert all(words.startswith("chassis_front_right reads 1.") and " along y" in words for words in gains.suspects.values())
    assert "chassis_front_right" not in str(gains.suspects)
