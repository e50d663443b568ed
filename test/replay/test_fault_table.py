# Copyright 2026 ride_estimation contributors
"""The table of faults is kept: every fault is named in time and for the right reason, and does no more harm than is allowed."""

from __future__ import annotations

import numpy as np
import pytest
from replay.fault_table import TABLE, run_fault

#: world of the tests; figures of others are printed by benchmarks/fault_table.py
SEED = 11
NAMES = {fault.name: fault for fault in TABLE}
#: the fast suite runs one row; what rejects single messages is tested in test/ros/test_bad_input.py
FAST = ("stuck value",)


def check(name: str) -> None:
    """A fault is named in time, nothing valid becomes wrong, and it does no more harm than is allowed."""
    fault = NAMES[name]
    outcome, found = run_fault(fault, SEED)
    assert outcome.not_finite == 0
    assert outcome.wrong_stds <= 5.0
    if fault.expected:
        assert outcome.to_flag_s <= fault.limit_s, f"said: {found.texts}"
    if not fault.constant:
        assert outcome.to_recover_s <= 5.0
        assert not found.now
    harm = outcome.force_ratio > 1.0 or outcome.inside < 0.9 or outcome.parameter > 0.01 or outcome.parameter_stds > 3.0
    assert not harm, outcome


def test_the_table_has_every_fault_once() -> None:
    assert len(NAMES) == len(TABLE) >= 25


@pytest.mark.slow
def test_harmless_changes_are_not_called_faults() -> None:
    """A sensor that hands its messages over in bursts with right stamps changes nothing but the delay: not one sentence."""
    outcome, found = run_fault(NAMES["200 ms late bursts, stamps right"], SEED)
    assert found.texts == ()
    assert np.isclose(outcome.parameter, 0.0, atol=1e-12)


@pytest.mark.parametrize("name", FAST)
def test_faults_are_named_in_time(name: str) -> None:
    check(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in NAMES if n not in FAST])
def test_every_fault_is_named_in_time(name: str) -> None:
    check(name)
