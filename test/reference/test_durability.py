# Copyright 2026 ride_estimation contributors
"""Rainflow damage against the ASTM E1049 example, a library that counts whole signals, and properties any counter must have."""

import numpy as np
import pytest
import rainflow as library
from scipy import signal

from ride_estimation.assessment import durability
from ride_estimation.assessment.rainflow import RainflowCounter, count_cycles, level_crossings, rainflow_matrix, range_pairs
from ride_estimation.errors import InputDataError

ASTM = [-2, 1, -3, 5, -1, 3, -4, 4, -2]


def table_of(ranges, counts):
    table = {}
    for r, c in zip(ranges, counts):
        table[round(float(r), 9)] = table.get(round(float(r), 9), 0.0) + float(c)
    return table


def test_astm_example():
    assert table_of(*durability.rainflow_ranges(ASTM)) == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}


@pytest.mark.parametrize("seed", range(40))
def test_counts_agree_with_the_library(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 80))
    y = rng.integers(-6, 7, n).astype(float) if seed % 2 else rng.normal(size=n)
    expected = [(r, c) for r, _, c, _, _ in library.extract_cycles(y) if r > 0.0]
    cycles = count_cycles(y)
    assert table_of(cycles.ranges, cycles.count) == table_of([r for r, _ in expected], [c for _, c in expected])
    assert np.array_equal(y[cycles.start_index], cycles.start) and np.array_equal(y[cycles.end_index], cycles.end)


@pytest.mark.parametrize("seed", range(5))
def test_largest_counted_range_is_the_span_of_the_signal(seed):
    y = np.random.default_rng(seed).integers(-50, 50, 300).astype(float)
    y[-1] = 200.0
    assert durability.rainflow_ranges(y)[0].max() == np.ptp(y)


@pytest.mark.parametrize("y", [[0, 1, -1, 50, -1, 2, -60], [4.0, -5.0], [1.0, 1.0, 3.0]])
def test_the_largest_cycle_is_not_lost_in_short_records(y):
    assert durability.rainflow_ranges(y)[0].max() == np.ptp(y)


@pytest.mark.parametrize("chunk", [1, 7, 1000])
def test_streaming_equals_one_pass_to_the_last_bit(chunk):
    rng = np.random.default_rng(chunk)
    y, s = 1000.0 + np.cumsum(rng.normal(size=3000)), rng.random(3000)
    meter, whole = durability.DamageMeter(200.0), durability.DamageMeter(200.0)
    whole.feed(y, s)
    for i in range(0, len(y), chunk):
        meter.feed(y[i : i + chunk], s[i : i + chunk])
        if i == 2 * chunk and i > 2:
            meter.damage()  # looking does not change the count
    for name in ("start", "end", "count", "start_index", "end_index"):
        assert np.array_equal(getattr(meter.cycles, name), getattr(whole.cycles, name)), name
    assert meter.damage(5.0) == whole.damage(5.0)


def test_damage_of_equal_cycles_and_ratio():
    y = np.tile([0.0, 2.0], 1000)
    assert durability.pseudo_damage(y, 3.0) == pytest.approx(999.5 * 8.0, rel=1e-3)  # the last half cycle
    assert durability.damage_ratio(y, 1.1 * y, 5.0) == pytest.approx(1.1**5, rel=1e-12)


def test_equivalent_amplitude_of_a_sine_of_one_hertz_is_its_amplitude():
    t = np.arange(0, 200, 1 / 500)
    found = durability.assess_load(7.0 * np.sin(2 * np.pi * t), 500.0, slope=4.0)
    assert found.equivalent_amplitude == pytest.approx(7.0, rel=2e-3)  # the half cycles at both ends
    assert found.largest_range == pytest.approx(14.0, rel=1e-4)


def test_damage_over_time_finds_the_second_that_did_it_and_adds_up():
    rng = np.random.default_rng(1)
    y = rng.standard_normal(6050)
    y[3000:4000] *= 4.0
    share = durability.damage_over_time(count_cycles(y), 100.0, len(y), 10.0)
    assert share.shape == (7,) and share.argmax() == 3
    assert share.sum() == pytest.approx(1.0, rel=1e-12)
    step = np.zeros(1000)
    step[250] = 5.0  # one bump: all of its damage within its second
    assert durability.damage_over_time(count_cycles(step), 100.0, 1000, 1.0)[2] >= 0.5


def test_matrix_and_range_pairs_hold_every_cycle():
    cycles = count_cycles(ASTM)
    matrix = rainflow_matrix(cycles, np.arange(-5.0, 6.0))
    assert matrix.sum() == cycles.count.sum() == 4.0
    assert matrix[4, 8] == 1.0  # the full cycle of the example runs from -1 to 3
    ranges, cumulated = range_pairs(cycles)
    assert ranges[0] == 9.0 and cumulated[-1] == 4.0 and np.all(np.diff(ranges) <= 0.0)


def test_level_crossings_of_a_sine():
    t = np.linspace(0, 10, 10_001)
    counts = level_crossings(np.sin(2 * np.pi * t - 0.1), [0.0, 0.5, 2.0])
    assert counts.tolist() == [10, 10, 0]


@pytest.mark.parametrize("kind", ["factor", "slow", "white"])
def test_interval_holds_the_true_damage(kind):
    """Errors of the stated size: one common factor is what the interval is made for, others must lie well inside."""
    rng = np.random.default_rng(5)
    sos = signal.butter(2, 10.0, fs=200.0, output="sos")
    draws, inside = 60, 0
    for _ in range(draws):
        true = 1000.0 + signal.sosfilt(sos, rng.normal(0.0, 3000.0, 6000))
        std = 0.08 * np.std(true)
        if kind == "factor":
            estimate = true + 0.08 * rng.normal() * (true - true.mean())
        elif kind == "slow":
            noise = signal.sosfilt(signal.butter(2, 0.5, fs=200.0, output="sos"), rng.normal(size=6000))
            estimate = true + std * noise / np.std(noise)
        else:
            estimate = true + std * rng.normal(size=6000)
        found = durability.assess_load(estimate, 200.0, np.full(6000, std))
        assert 0.06 < found.relative_std < 0.11  # the factor scales what it is measured against, by up to three std
        inside += found.lower <= durability.pseudo_damage(true) <= found.upper
    # 95 % of 60 draws: fewer than 52 happen once in 200 cases
    assert inside >= 52


def test_the_first_seconds_of_a_run_do_not_spoil_what_is_known_of_the_rest():
    """Cycles of equal size, known to 20 % in the first sixth of the run and to 2 % afterwards."""
    t = np.arange(12_000) / 200.0
    y, s = 500.0 * np.sin(2.0 * np.pi * t), np.where(t < 10.0, 0.2, 0.02)
    found = durability.assess_load(y, 200.0, s * np.abs(y))
    for bound, sign in ((found.lower, -2.0), (found.upper, 2.0)):
        by_hand = np.mean((1.0 + sign * s) ** 5) * found.value
        # the two cycles that begin in one part and end in the other, of sixty
        assert bound == pytest.approx(by_hand, rel=0.03)


def test_the_uncertain_weight_moves_no_range():
    rng = np.random.default_rng(4)
    y = 3000.0 + rng.normal(0.0, 400.0, 4000)
    # 2 % of the mass are 60 N of offset and 2 % of the dynamic part; 20 N more come from elsewhere
    std = np.full(4000, np.sqrt(60.0**2 + (0.02 * 400.0) ** 2 + 20.0**2))
    found = durability.assess_load(y, 200.0, std, mass_relative_std=0.02)
    assert found.relative_std == pytest.approx(np.hypot(0.02, 20.0 / 400.0), rel=0.03)
    assert durability.assess_load(y, 200.0, std).relative_std > 3.0 * 0.05
    # what the mass alone leaves is never taken off
    small = durability.assess_load(y, 200.0, np.full(4000, 10.0), mass_relative_std=0.02)
    assert small.relative_std == pytest.approx(0.02, rel=0.03)


def test_a_load_known_worse_than_half_its_size_has_no_lower_bound():
    y = np.random.default_rng(3).normal(size=2000)
    found = durability.assess_load(y, 100.0, np.full(2000, 0.6))
    assert found.lower == 0.0 and not found.known and found.upper > found.value


def test_unusable_input_is_refused():
    with pytest.raises(InputDataError, match="two samples"):
        durability.pseudo_damage([1.0])
    with pytest.raises(InputDataError, match="not finite"):
        RainflowCounter().feed([1.0, np.nan])
    with pytest.raises(InputDataError, match="no damage"):
        durability.damage_ratio(np.ones(10), np.arange(10.0))
    with pytest.raises(InputDataError, match="slope"):
        durability.pseudo_damage([1.0, 2.0], 0.5)
    with pytest.raises(InputDataError, match="blocks"):
        durability.damage_over_time(count_cycles(np.arange(10.0)), 100.0, 10, 10.0)
    with pytest.raises(InputDataError, match="standard deviation"):
        durability.assess_load(np.arange(10.0), 100.0, np.ones(3))
    with pytest.raises(InputDataError, match="rising"):
        rainflow_matrix(count_cycles(ASTM), [1.0, 1.0])
