# Copyright 2026 ride_estimation contributors
"""A fault of one sensor, on the body or at a base, is named in time on other layouts too, and what is called valid holds."""

from __future__ import annotations

import pytest
from replay.fault_table import run_fault
from replay.layout_faults import LARGEST_ERROR, LAYOUT_TABLE, LEAST_INSIDE

#: world of the tests; figures of others are printed by benchmarks/fault_table.py
SEED = 12
NAMES = {fault.name: fault for fault in LAYOUT_TABLE}


def test_the_table_has_every_fault_once() -> None:
    assert len(NAMES) == len(LAYOUT_TABLE) >= 90


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_fault_is_named_in_time_and_nothing_valid_is_wrong(name: str) -> None:
    fault = NAMES[name]
    outcome, found = run_fault(fault, SEED)
    assert outcome.not_finite == 0
    assert outcome.wrong_stds <= LARGEST_ERROR
    assert outcome.to_flag_s <= fault.limit_s, f"said: {found.texts}"
    assert not outcome.inside < LEAST_INSIDE
