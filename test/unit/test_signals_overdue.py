# Copyright 2026 ride_estimation contributors
"""A stream that stops is called silent 0.3 s after its last sample, before the time base stops waiting for it."""

from __future__ import annotations

import pytest
from faults import SECOND, START_NS, regular, where, without

from ride_estimation.signals.alignment import StampAligner, StreamSpec


@pytest.mark.parametrize(("after_s", "silent"), [(0.25, False), (0.35, True)])
def test_a_stream_is_silent_when_it_is_overdue(after_s: float, silent: bool) -> None:
    aligner = StampAligner([StreamSpec("a", 3), StreamSpec("b", 3)], 100.0)
    samples = regular(2, 100.0, 2.0 + after_s)
    for stream, stamp, values in without(samples, where(samples, 1, 2.0)):
        aligner.push(stream, stamp, values)
    health = aligner.health()
    assert health["b"].silent is silent
    assert not health["a"].silent
    assert health["b"].last_ns < START_NS + 2 * SECOND


def test_a_burst_of_200_ms_is_no_silence() -> None:
    aligner = StampAligner([StreamSpec("a", 3), StreamSpec("b", 3)], 100.0)
    held: list[tuple[int, int, tuple[float, ...]]] = []
    for n, sample in enumerate(regular(2, 100.0, 3.0)):
        if sample[0] == 1:
            held.append(sample)
        else:
            aligner.push(*sample)
        if n % 40 == 39:
            assert n == 39 or not aligner.health()["b"].silent  # the first packet has not arrived yet
            for late in held:
                aligner.push(*late)
            held.clear()
