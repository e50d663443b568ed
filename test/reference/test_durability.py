# Copyright 2026 ride_estimation contributors
"""Rainflow damage against the ASTM E1049 example and properties any counter must have."""

import numpy as np
import pytest

from ride_estimation.assessment import durability
from ride_estimation.errors import InputDataError

ASTM = [-2, 1, -3, 5, -1, 3, -4, 4, -2]


def test_astm_example():
    ranges, counts = durability.rainflow_ranges(ASTM)
    table = {}
    for r, c in zip(ranges, counts):
        table[float(r)] = table.get(float(r), 0.0) + float(c)
    assert table == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}


@pytest.mark.parametrize("seed", range(5))
def test_largest_counted_range_is_the_span_of_the_signal(seed):
    y = np.random.default_rng(seed).integers(-50, 50, 300).astype(float)
    y[-1] = 200.0
    assert durability.rainflow_ranges(y)[0].max() == np.ptp(y)


def test_damage_of_equal_cycles_and_ratio():
    y = np.tile([0.0, 2.0], 1000)
    assert durability.pseudo_damage(y, 3.0) == pytest.approx(999.5 * 8.0, rel=1e-3)  # the last half cycle
    assert durability.damage_ratio(y, 1.1 * y, 5.0) == pytest.approx(1.1**5, rel=1e-12)


def test_damage_against_time_finds_the_minute_that_did_it():
    rng = np.random.default_rng(1)
    y = rng.standard_normal(6000)
    y[3000:4000] *= 4.0
    share = durability.relative_damage_share(y, 100.0, 10.0)
    assert share.argmax() == 3
    assert share.sum() == pytest.approx(1.0, rel=1e-12)


def test_level_crossings_of_a_sine():
    t = np.linspace(0, 10, 10_001)
    counts = durability.level_crossings(np.sin(2 * np.pi * t - 0.1), [0.0, 0.5, 2.0])
    assert counts.tolist() == [10, 10, 0]


def test_unusable_input_is_refused():
    with pytest.raises(InputDataError):
        durability.pseudo_damage([1.0])
    with pytest.raises(InputDataError):
        durability.damage_ratio(np.ones(10), np.arange(10.0))
    with pytest.raises(InputDataError):
        durability.relative_damage_share(np.arange(10.0), 100.0, 10.0)
