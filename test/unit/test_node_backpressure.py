# Copyright 2026 ride_estimation contributors
"""The load policy on a simulated single-server queue: delay stays bounded under overload, and nothing is dropped without it."""

from __future__ import annotations

import pytest

from ride_estimation.nodes.backpressure import DROP_S, THIN_S, Load

RATE, SENSORS = 100.0, 8


def serve(cost_s: float, seconds: float, *, playback: float = 1.0, step_at: float = 1e9, governed: bool = True):
    """Return (load, (arrival, delay) of the messages used, whether thinned at any time): messages wait for the server."""
    load, free, delays, thinned = Load(), 0.0, [], False
    due = [(k / RATE / playback, sensor, k / RATE) for k in range(round(seconds * RATE * playback)) for sensor in range(SENSORS)]
    for arrival, sensor, stamp in sorted(due):
        now = max(arrival, free)
        used = load.admit(f"/{sensor}", stamp - 60.0 * (arrival >= step_at), now) or not governed
        took = cost_s if used else 2e-6
        free = now + took
        load.handled(now, free)
        thinned |= load.thinned
        if used:
            delays.append((arrival, free - arrival))
    return load, delays, thinned


def test_overload_is_said_and_the_delay_stays_bounded() -> None:
    """Half again as much work as there is time: without the policy 20 s behind after 60 s."""
    cost = 1.5 / (RATE * SENSORS)
    load, delays, thinned = serve(cost, 60.0)
    assert thinned
    assert load.left_out > 0.2 * 60 * RATE * SENSORS
    assert max(d for _, d in delays) < DROP_S + 0.1
    assert load.worst_s < DROP_S + 0.1
    _, unlimited, _ = serve(cost, 60.0, governed=False)
    assert unlimited[-1][1] > 15.0


def test_a_short_stall_is_caught_up_without_losing_a_message() -> None:
    load, free = Load(), 0.0
    for k in range(2000):
        arrival = k / 200.0
        now = max(arrival, free)
        assert load.admit("/a", arrival, now)
        took = 0.4 if k == 1000 else 1e-3  # something else takes the machine for 0.4 s
        free = now + took
        load.handled(now, free)
    assert load.left_out == 0
    assert THIN_S < load.worst_s < DROP_S
    assert load.words() == ""


@pytest.mark.parametrize("playback", [0.25, 1.0, 4.0])
def test_a_machine_that_keeps_up_never_drops_at_any_playback_rate(playback: float) -> None:
    load, _, thinned = serve(0.3 / (RATE * SENSORS * playback), 20.0, playback=playback)
    assert load.left_out == 0
    assert not thinned
    assert load.words() == ""


def test_clocks_that_step_back_are_no_overload() -> None:
    load, _, thinned = serve(0.9 / (RATE * SENSORS), 20.0, step_at=10.0)
    assert load.left_out == 0
    assert not thinned


def test_what_happens_is_said() -> None:
    load = Load()
    load.admit("/a", 0.0, 0.0)
    load.handled(0.0, 0.3)
    load.admit("/a", 0.0, 0.3)
    load.handled(0.3, 1.2)
    assert "only every 10th estimate is published" in load.words()
    assert not load.admit("/a", 0.0, 1.2)
    assert "left out until it has caught up" in load.words()
