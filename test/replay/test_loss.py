# Copyright 2026 ride_estimation contributors
"""Losses, stalls and returns of sensors at random: forces stay bounded, intervals honest, and accuracy comes back."""

from __future__ import annotations

import numpy as np
import pytest
from replay.loss_run import LAYOUTS, Verdict, course, sequences, undisturbed

#: largest force over the largest true one: what a peak and its uncertainty explain
LARGEST = 3.0
#: error that may stay, over that without disturbance, and share of the size of the forces that no driver of a report would see
WORSE, UNSEEN = 1.5, 0.02
#: share of sequences after which the slow deformation of the frame may take longer than the calm
LATE = 0.1
#: share of the truth inside two standard deviations
COVERAGE = 0.9


def verdicts(name: str, seed: int, seconds: float, count: int) -> list[Verdict]:
    given = course(name, seed, seconds)
    return list(sequences(given, seed, count, undisturbed(given)))


def check(found: list[Verdict]) -> None:
    assert all(v.finite for v in found)
    inside, ticks = sum(v.inside for v in found), sum(v.ticks for v in found)
    assert np.all(inside >= COVERAGE * ticks), inside / ticks
    assert max(v.largest for v in found) < LARGEST
    late = [v for v in found if np.any(v.error > WORSE * v.allowed + UNSEEN)]
    assert len(late) <= LATE * len(found), [(v.kind, v.error, v.allowed) for v in late]


@pytest.mark.slow
@pytest.mark.parametrize("name", LAYOUTS)
def test_forces_stay_bounded_honest_and_recover_on_every_layout(name):
    check(verdicts(name, 3 + list(LAYOUTS).index(name), 60.0, 25))
