# Copyright 2026 ride_estimation contributors
"""Stamps to a common time base: accuracy against known signals, and every timing fault with the count it must leave."""

from __future__ import annotations

from collections.abc import Sequence

import faults
import numpy as np
import pytest

from ride_estimation.errors import InputDataError
from ride_estimation.signals.alignment import Block, StampAligner, StreamSpec, align
from ride_estimation.signals.batch_feed import BatchFeed
from ride_estimation.signals.recording import Channel, Recording

#: Lagrange cubic on 500 Hz: 9/384 (2 pi f h)^4 is 2.2e-5 of a 14 Hz signal of amplitude 0.3; jitter widens intervals
CUBIC_TOLERANCE = 1e-4
#: a straight line beside a gap or at the ends: (2 pi f h)^2 / 8 of both sines, at up to three periods of width
LINEAR_TOLERANCE = 0.02


def specs(streams: int) -> list[StreamSpec]:
    return [StreamSpec(f"s{i}", 3) for i in range(streams)]


def pushed(samples: list[faults.Sample], streams: int = 3, **settings: object) -> tuple[StampAligner, list[Block]]:
    aligner = StampAligner(specs(streams), **settings)  # type: ignore[arg-type]
    blocks: list[Block] = []
    for index, stamp, values in samples:
        blocks.extend(aligner.push(index, stamp, values))
    blocks.extend(aligner.finish())
    return aligner, blocks


def joined(blocks: list[Block]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time since the start [s], values, valid."""
    stamps = np.concatenate([b.stamps_ns for b in blocks])
    return (stamps - faults.START_NS) * 1e-9, np.vstack([b.values for b in blocks]), np.vstack([b.valid for b in blocks])


def worst(blocks: list[Block], stream: int, offset_s: float = 0.0, edge: int = 3) -> float:
    """Largest error of the valid ticks of a stream, those at either end, where only a straight line fits, left out."""
    time, values, valid = joined(blocks)
    error = np.abs(values[:, 3 * stream : 3 * stream + 3] - faults.truth(stream, time - offset_s)).max(axis=1)
    inner = np.ones(len(time), bool)
    inner[:edge] = inner[-edge:] = False
    return float(error[inner & valid[:, stream]].max())


def test_jittered_streams_with_phase_come_out_at_the_tick_and_complete() -> None:
    samples = faults.regular(3, 500.0, 4.0, seed=1, jitter_s=5e-5)
    aligner, blocks = pushed(samples)
    time, values, valid = joined(blocks)
    assert aligner.rate_hz == 500.0
    assert np.all(np.diff(np.concatenate([b.stamps_ns for b in blocks])) == 2_000_000)
    assert len(time) >= 1998 and valid[2:].all() and np.isfinite(values).all()
    assert max(worst(blocks, i) for i in range(3)) < CUBIC_TOLERANCE
    assert all(h.accepted == 2000 and not h.rejected and h.gaps == 0 for h in aligner.health().values())


def test_a_tick_on_a_stamp_gets_that_very_sample() -> None:
    samples = faults.regular(2, 500.0, 2.0, offsets_s=[0.0, 0.0])
    _, blocks = pushed(samples, 2)
    given = np.array([s[2] for s in samples if s[0] == 1])
    _, values, valid = joined(blocks)
    n = len(values)
    assert valid.all()
    assert np.array_equal(values[:, 3:6], given[:n])


def test_slow_stream_is_interpolated_and_fast_stream_averaged_without_shift() -> None:
    samples = faults.regular(3, [500.0, 100.0, 2000.0], 4.0)
    aligner, blocks = pushed(samples, 3, rate_hz=500.0)
    # 100 Hz cubic of a 14 Hz signal of 0.3: 9/384 (2 pi 14 / 100)^4 * 0.3 = 4e-3
    assert worst(blocks, 1, edge=12) < 6e-3
    # mean over one tick of 2 ms: (pi f h)^2 / 6 of the signal
    assert worst(blocks, 2) < 0.3 * (np.pi * 14.0 * 0.002) ** 2 / 6.0 + (np.pi * 3.0 * 0.002) ** 2 / 6.0 + 1e-4
    assert aligner.health()["s1"].rate_hz == pytest.approx(100.0, rel=1e-3)


def test_automatic_rate_is_that_of_the_fastest_reference_stream() -> None:
    fast_speed = [StreamSpec("imu", 3), StreamSpec("speed", 3, waited_for=False, reference=False)]
    aligner = StampAligner(fast_speed)
    for index, stamp, values in faults.regular(2, [104.36, 1000.0], 2.0, jitter_s=2e-5):
        aligner.push(index, stamp, values)
    assert aligner.rate_hz == pytest.approx(104.36, rel=2e-3)


def test_blocks_do_not_depend_on_how_streams_interleave() -> None:
    samples = faults.regular(3, 500.0, 3.0, seed=2, jitter_s=5e-5)
    rng = np.random.default_rng(5)
    late = rng.uniform(0.0, 0.003, len(samples))
    shuffled = [samples[i] for i in np.argsort([s[1] * 1e-9 + d for s, d in zip(samples, late)], kind="stable")]
    in_stream_order = all(
        np.all(np.diff([s[1] for s in shuffled if s[0] == k]) > 0) for k in range(3)
    )
    assert not in_stream_order  # the shuffle is strong enough to swap neighbours of a stream too
    _, blocks = pushed(samples)
    _, again = pushed(shuffled)
    assert [b.values.tobytes() for b in blocks] == [b.values.tobytes() for b in again]


def test_same_sequence_twice_gives_the_same_bytes() -> None:
    samples = faults.in_bursts(faults.regular(3, 500.0, 3.0, seed=3, jitter_s=1e-4), 1, 25)
    first, second = (pushed(samples)[1] for _ in range(2))
    assert b"".join(b.values.tobytes() + b.valid.tobytes() for b in first) == b"".join(
        b.values.tobytes() + b.valid.tobytes() for b in second
    )


def test_blocks_have_the_stated_number_of_ticks_and_come_soon() -> None:
    aligner = StampAligner(specs(2), 500.0, block_ticks=5)
    delays = []
    for index, stamp, values in faults.regular(2, 500.0, 3.0):
        for block in aligner.push(index, stamp, values):
            assert len(block.values) == 5
            if stamp - faults.START_NS > faults.SECOND:
                delays.append((stamp - int(block.stamps_ns[-1])) * 1e-9)
    # two samples at or after the last tick: at most two periods and the phase of the second stream
    assert max(delays) <= 0.0045


def test_duplicates_are_counted_and_change_nothing() -> None:
    samples = faults.regular(3, 500.0, 3.0)
    places = faults.where(samples, 1, 1.0, 2.0)[::10]
    aligner, blocks = pushed(faults.duplicated(samples, places))
    _, clean = pushed(samples)
    assert aligner.health()["s1"].rejected == {"duplicate": len(places)}
    assert [b.values.tobytes() for b in blocks] == [b.values.tobytes() for b in clean]


def test_swapped_neighbours_are_put_in_order() -> None:
    samples = faults.regular(3, 500.0, 3.0)
    places = faults.where(samples, 1, 1.0, 2.0)[::10]
    aligner, blocks = pushed(faults.swapped(samples, places))
    _, clean = pushed(samples)
    health = aligner.health()["s1"]
    assert health.reordered == len(places) and not health.rejected
    assert [b.values.tobytes() for b in blocks] == [b.values.tobytes() for b in clean]


@pytest.mark.parametrize("missing", [1, 2])
def test_a_few_missing_samples_are_bridged(missing: int) -> None:
    samples = faults.regular(3, 500.0, 3.0)
    places = faults.where(samples, 1, 1.0, 2.0)[5 : 5 + missing]
    aligner, blocks = pushed(faults.without(samples, places))
    _, _, valid = joined(blocks)
    assert valid[3:, 1].all() and aligner.health()["s1"].gaps == 0
    assert worst(blocks, 1) < LINEAR_TOLERANCE


def test_a_gap_is_not_valid_and_counted_and_the_others_go_on() -> None:
    samples = faults.regular(3, 500.0, 4.0)
    aligner, blocks = pushed(faults.without(samples, faults.where(samples, 1, 2.0, 2.3)))
    time, values, valid = joined(blocks)
    inside = (time > 2.0) & (time < 2.297)
    assert not valid[inside, 1].any() and valid[inside][:, [0, 2]].all()
    assert valid[(time > 0.1) & ((time < 1.995) | (time > 2.305)), 1].all()
    assert np.isfinite(values).all()
    health = aligner.health()["s1"]
    assert health.gaps == 1 and health.longest_gap_s == pytest.approx(0.302, abs=0.003)
    assert worst(blocks, 1) < LINEAR_TOLERANCE


def test_a_stream_that_stops_delays_the_others_once_and_resumes() -> None:
    samples = faults.regular(3, 500.0, 8.0)
    faulty = faults.without(samples, faults.where(samples, 1, 2.0, 6.0))
    aligner = StampAligner(specs(3), 500.0, block_ticks=5, max_wait_s=0.5)
    delays, blocks = [], []
    for index, stamp, values in faulty:
        for block in aligner.push(index, stamp, values):
            blocks.append(block)
            delays.append(((stamp - faults.START_NS) * 1e-9, (stamp - int(block.stamps_ns[-1])) * 1e-9))
    blocks.extend(aligner.finish())
    stopped = [d for t, d in delays if 3.0 < t < 6.0]
    assert max(d for _, d in delays) <= 0.53  # the longest wait and one block
    assert max(stopped) < 0.01  # no further waiting while it is silent
    time, _, valid = joined(blocks)
    assert valid[(time > 6.6) & (time < 7.9), 1].all()
    assert valid[(time > 0.1) & (time < 7.9), 0].all()
    assert aligner.health()["s1"].gaps == 1


def test_a_stream_that_never_speaks_is_silent_and_the_others_work() -> None:
    samples = faults.regular(3, 500.0, 3.0)
    aligner, blocks = pushed(faults.without(samples, faults.where(samples, 1, 0.0)))
    _, _, valid = joined(blocks)
    assert aligner.health()["s1"].accepted == 0 and aligner.health()["s1"].silent
    assert valid[3:, 0].all() and not valid[:, 1].any()


def test_bursts_with_right_stamps_lose_nothing() -> None:
    samples = faults.regular(3, 500.0, 4.0)
    aligner, blocks = pushed(faults.in_bursts(samples, 1, 50))
    _, clean = pushed(samples)
    assert not aligner.health()["s1"].rejected
    n = min(len(blocks), len(clean)) - 1
    assert n > 150
    assert [b.values.tobytes() for b in blocks[:n]] == [b.values.tobytes() for b in clean[:n]]


@pytest.mark.parametrize("way", ["pushed", "fed"])
@pytest.mark.parametrize("begin", [0.0, 1.5])
def test_streams_held_back_and_flushed_one_after_the_other_lose_nothing(begin: float, way: str) -> None:
    """Up to the latency budget, also at the very start; the ticks are those of a run that came in time."""
    samples = faults.regular(4, 100.0, 6.0)
    flushed = faults.held_back(samples, begin, begin + 2.0)
    assert flushed != samples
    aligner, blocks = pushed(flushed, 4) if way == "pushed" else fed(flushed, 4)
    _, clean = pushed(samples, 4)
    assert not aligner.restarts
    assert all(h.accepted == 600 and not h.rejected and not h.silent for h in aligner.health().values())
    assert [b.values.tobytes() for b in blocks] == [b.values.tobytes() for b in clean]
    assert [b.valid.tobytes() for b in blocks] == [b.valid.tobytes() for b in clean]


@pytest.mark.parametrize("way", ["pushed", "fed"])
@pytest.mark.parametrize("length", [3.4, 5.0])
def test_streams_held_back_for_longer_than_the_budget_lose_that_time_and_no_more(length: float, way: str) -> None:
    samples = faults.regular(4, 100.0, 10.0)
    flushed = faults.held_back(samples, 2.0, 2.0 + length)
    aligner, blocks = pushed(flushed, 4) if way == "pushed" else fed(flushed, 4)
    time, _, valid = joined(blocks)
    assert not aligner.restarts
    assert np.all(np.diff(time) > 0.0)
    assert valid[(time > 0.1) & (time < 1.9)].all()
    assert valid[(time > 2.2 + length) & (time < 9.9)].all()
    for health in aligner.health().values():
        assert health.accepted + sum(health.rejected.values()) == 1000
        assert sum(health.rejected.values()) <= 100 * (length + 0.1)


def test_samples_lost_while_streams_were_held_back_make_a_gap_and_no_clock_step() -> None:
    samples = faults.regular(4, 100.0, 6.0)
    held = faults.held_back(samples, 2.0, 4.0)
    rng = np.random.default_rng(1)
    kept = [s for s in held if not 2.0 <= (s[1] - faults.START_NS) * 1e-9 < 4.0 or rng.random() < 0.6]
    aligner, _ = pushed(kept, 4)
    assert not aligner.restarts
    assert not any(h.rejected for h in aligner.health().values())


def test_one_stream_left_of_several_waits_for_the_budget_once_and_goes_on() -> None:
    samples = [s for s in faults.regular(3, 100.0, 12.0) if s[0] == 0 or s[1] < faults.START_NS + 2 * 10**9]
    aligner = StampAligner(specs(3), 100.0, block_ticks=5, latency_budget_s=3.0)
    delays = []
    for index, stamp, values in samples:
        delays += [(stamp - int(block.stamps_ns[-1])) * 1e-9 for block in aligner.push(index, stamp, values)]
    assert 2.9 < max(delays) < 3.1
    assert max(delays[-100:]) < 0.1
    shifted = [(index, stamp - 10**9, values) for index, stamp, values in faults.regular(3, 100.0, 14.0) if index == 0]
    for index, stamp, values in shifted[1150:]:
        aligner.push(index, stamp, values)
    assert aligner.restarts == {"stamps jumped back": 1}, "the clock of the only one that speaks is followed"


@pytest.mark.parametrize(("value", "reason"), [(np.nan, "not_finite"), (np.inf, "not_finite"), (-np.inf, "not_finite")])
def test_values_that_are_not_finite_are_refused(value: float, reason: str) -> None:
    samples = faults.regular(3, 500.0, 3.0)
    places = faults.where(samples, 2, 1.0, 2.0)[::20]
    aligner, blocks = pushed(faults.changed(samples, places, faults.valued(value)))
    assert aligner.health()["s2"].rejected == {reason: len(places)}
    assert np.isfinite(joined(blocks)[1]).all()
    # mean over one tick of 2 ms: (pi f h)^2 / 6 of the signal
    assert worst(blocks, 2) < LINEAR_TOLERANCE


@pytest.mark.parametrize("stamp", [0, -5])
def test_a_stamp_of_zero_makes_no_step_of_decades(stamp: int) -> None:
    samples = faults.regular(3, 500.0, 3.0)
    places = faults.where(samples, 0, 0.0, 3.0)[::25]
    aligner, blocks = pushed(faults.changed(samples, places, faults.stamped(stamp)))
    assert aligner.health()["s0"].rejected == {"stamp_not_positive": len(places)}
    assert len(joined(blocks)[0]) <= 1500 and not aligner.restarts


def test_a_wrong_number_of_values_is_refused() -> None:
    aligner, _ = pushed([*faults.regular(1, 500.0, 1.0), (0, faults.START_NS + faults.SECOND, (1.0, 2.0))], 1)
    assert aligner.health()["s0"].rejected == {"wrong_length": 1}


def test_one_wild_stamp_in_the_future_is_refused_and_nothing_else_happens() -> None:
    samples = faults.regular(3, 500.0, 3.0)
    place = faults.where(samples, 1, 1.5)[:1]
    aligner, blocks = pushed(faults.changed(samples, place, faults.shifted(1000.0)))
    assert aligner.health()["s1"].rejected == {"clock_ahead": 1}
    assert not aligner.restarts and len(joined(blocks)[0]) >= 1495


@pytest.mark.parametrize(("skew", "reason"), [(3.0, "clock_ahead"), (-3.0, "clock_behind")])
def test_a_stream_with_another_clock_is_refused_sample_by_sample(skew: float, reason: str) -> None:
    samples = faults.regular(3, 500.0, 4.0)
    places = faults.where(samples, 1, 0.0)
    skewed = faults.changed(samples, places, faults.shifted(skew))
    aligner, blocks = pushed(skewed)
    health = aligner.health()["s1"]
    assert health.accepted + sum(health.rejected.values()) == 2000
    assert health.rejected[reason] > 1900
    time, _, valid = joined(blocks)
    assert valid[(time > 0.6) & (time < 3.9), 0].all() and valid[(time > 0.6) & (time < 3.9), 2].all()


@pytest.mark.parametrize(("jump", "words"), [(60.0, "stamps jumped ahead"), (-60.0, "stamps jumped back")])
def test_when_all_clocks_jump_the_time_base_begins_anew(jump: float, words: str) -> None:
    samples = faults.regular(3, 500.0, 6.0)
    aligner, blocks = pushed(faults.changed(samples, faults.where(samples, -1, 3.0), faults.shifted(jump)))
    assert dict(aligner.restarts) == {words: 1}
    again = next(i for i, b in enumerate(blocks) if i and b.restart)
    assert blocks[again].restart == words
    before, after = blocks[:again], blocks[again:]
    assert len(joined(before)[0]) >= 1490
    # every stream needs 0.1 s on the new clock before it is believed; those samples are counted
    assert len(joined(after)[0]) >= 1430
    lost = sum(sum(h.rejected.values()) for h in aligner.health().values())
    assert 100 <= lost <= 200
    assert worst(after, 0, offset_s=jump) < LINEAR_TOLERANCE


@pytest.mark.parametrize("jump", [50.0, -50.0])
def test_clocks_that_jump_before_the_rate_is_known_are_followed(jump: float) -> None:
    samples = faults.regular(3, 100.0, 3.0)
    aligner, _ = pushed(faults.changed(samples, faults.where(samples, -1, 0.2), faults.shifted(jump)))
    assert aligner.restarts.total() == 1
    assert all(health.accepted > 250 for health in aligner.health().values())


def test_a_bag_played_twice_restarts_once_per_loop() -> None:
    samples = faults.regular(3, 500.0, 3.0)
    aligner, blocks = pushed(samples * 3)
    assert aligner.restarts["stamps jumped back"] == 2
    assert len(joined(blocks)[0]) >= 3 * 1430


def test_long_run_with_drifting_clock_of_one_sensor_keeps_rate() -> None:
    samples = [
        (k, faults.START_NS + round((s - faults.START_NS) * (1.0015 if k == 1 else 1.0)), v)
        for k, s, v in faults.regular(2, 200.0, 20.0)
    ]
    aligner, blocks = pushed(sorted(samples, key=lambda s: s[1]), 2)
    assert not aligner.restarts and not aligner.health()["s1"].rejected
    assert joined(blocks)[2][5:-5].all()


def test_samples_that_a_restart_leaves_unused_are_counted() -> None:
    samples = faults.without(faults.regular(3, 100.0, 4.0), range(600, 900, 3))  # one stream is behind at the end
    aligner = StampAligner(specs(3), 100.0)
    ticks = 0
    for index, stamp, values in samples[:700]:
        ticks += sum(len(block.values) for block in aligner.push(index, stamp, values))
    ticks += sum(len(block.values) for block in aligner.restart("on demand"))
    found = aligner.health().values()
    assert sum(h.accepted + sum(h.rejected.values()) for h in found) == 700
    assert sum(h.rejected["restart"] for h in found if h.rejected) == 700 - sum(h.accepted for h in found) > 0
    assert max(h.accepted for h in found) <= ticks + 1


def test_restart_on_demand_keeps_counters() -> None:
    aligner = StampAligner(specs(1), 500.0)
    for index, stamp, values in faults.regular(1, 500.0, 2.0):
        aligner.push(index, stamp, values)
    left = aligner.restart("asked for")
    assert left and aligner.restarts["asked for"] == 1 and aligner.health()["s0"].accepted == 1000


def test_held_stream_gives_its_last_value() -> None:
    aligner = StampAligner([StreamSpec("a", 3), StreamSpec("speed", 1, waited_for=False, reference=False)], 500.0)
    blocks = []
    for k in range(1500):
        stamp = faults.START_NS + k * 2_000_000
        if k in (0, 500):
            aligner.push(1, stamp, (10.0 + k,))
        blocks.extend(aligner.push(0, stamp, (1.0, 2.0, 3.0)))
    time, values, valid = joined(blocks)
    assert valid[:, 1].all()
    assert set(np.unique(values[time > 1.1, 3])) == {510.0}


@pytest.mark.parametrize("wrong", [{"rate_hz": 0.0}, {"rate_hz": -5.0}, {"block_ticks": 0}, {"max_wait_s": float("nan")}])
def test_settings_are_checked(wrong: dict[str, float]) -> None:
    with pytest.raises(InputDataError, match=next(iter(wrong))):
        StampAligner(specs(1), **wrong)  # type: ignore[arg-type]
    with pytest.raises(InputDataError):
        StampAligner([StreamSpec("a", 3), StreamSpec("a", 3)])


def test_offline_alignment_is_the_online_one() -> None:
    samples = faults.regular(2, 250.0, 3.0, seed=4, jitter_s=1e-4)
    channels = {}
    for k in range(2):
        own = [(i, s) for i, s in enumerate(samples) if s[0] == k]
        channels[f"s{k}"] = Channel(
            f"s{k}", np.array([s[1] for _, s in own]), np.array([s[2] for _, s in own]), np.array([s[1] for _, s in own]),
            order=np.array([i for i, _ in own]),
        )
    run = align(Recording("r", channels), 250.0)
    _, blocks = pushed(samples, 2, rate_hz=250.0)
    _, values, valid = joined(blocks)
    assert run.rate_hz == 250.0 and run.start_ns == blocks[0].start_ns
    assert np.array_equal(run.data["s1"], values[:, 3:6]) and np.array_equal(run.valid["s0"], valid[:, 0])


def test_offline_alignment_of_nothing_is_an_error() -> None:
    one = Channel("a", np.array([faults.START_NS]), np.zeros((1, 3)), np.array([faults.START_NS]))
    with pytest.raises(InputDataError, match="less than two common samples"):
        align(Recording("r", {"a": one}))


def fed(samples: list[faults.Sample], streams: int) -> tuple[StampAligner, list[Block]]:
    """As :func:`pushed`, as one recording."""
    _, _, aligner, blocks = batched(samples, streams, 0)
    return aligner, [*blocks, *aligner.finish()]


def batched(
    samples: list[faults.Sample], streams: int, seed: int, delays: dict[int, tuple[int, float]] | None = None
) -> tuple[StampAligner, list[Block], StampAligner, list[Block]]:
    """Push samples one by one and as one recording; variances are stated by some messages only.

    After so many blocks a stream is found to be late: ``delays``, blocks -> stream and delay.
    """

    def take(aligner: StampAligner, kept: list[Block], blocks: Sequence[Block]) -> None:
        for block in blocks:
            kept.append(block)
            if len(kept) in (delays or {}):
                aligner.delay(*(delays or {})[len(kept)])

    rng = np.random.default_rng(seed)
    stated = [None if rng.random() < 0.3 else (rng.random(), 1.0, 2.0) for _ in samples]
    one = StampAligner(specs(streams))
    singly: list[Block] = []
    for (index, stamp, values), variance in zip(samples, stated):
        take(one, singly, one.push(index, stamp, values, variance))
    channels: list[Channel | None] = []
    for index in range(streams):
        places = [k for k, s in enumerate(samples) if s[0] == index]
        stamps = np.array([samples[k][1] for k in places], dtype=np.int64)
        variance = np.array([stated[k] or (np.nan,) * 3 for k in places]).reshape(-1, 3)
        values = np.array([samples[k][2] for k in places]).reshape(-1, 3)
        channels.append(Channel(f"s{index}", stamps, values, stamps, variance, order=np.array(places)) if places else None)
    many = StampAligner(specs(streams))
    feed, together = BatchFeed(many, channels), list[Block]()
    taken = 0
    while feed.more:
        blocks, count = feed.step()
        take(many, together, blocks)
        taken += count
    assert taken == len(samples)
    return one, singly, many, together


def damaged(seed: int) -> list[faults.Sample]:
    """Some seconds of three streams with faults of every kind at random places."""
    rng = np.random.default_rng(seed)
    rates = [500.0, float(rng.choice([500.0, 200.0, 1000.0])), 500.0]
    samples = faults.regular(3, rates, 3.0, seed, jitter_s=5e-5)
    kinds = rng.permutation(9)[: seed % 5]
    for kind in kinds:
        start = float(rng.uniform(0.6, 2.4))
        stream = int(rng.integers(3))
        places = faults.where(samples, stream, start, start + float(rng.choice([0.01, 0.1, 0.7])))
        if kind == 0:
            samples = faults.without(samples, places)
        elif kind == 1:
            samples = faults.duplicated(samples, places[::3])
        elif kind == 2:
            samples = faults.swapped(samples, places[:-2:4])
        elif kind == 3:
            samples = faults.changed(samples, places[::5], faults.valued(float("nan")))
        elif kind == 4:
            samples = faults.changed(samples, places[::7], faults.stamped(0))
        elif kind == 5:
            samples = faults.in_bursts(samples, stream, int(rng.integers(2, 40)))
        elif kind == 6:
            samples = faults.changed(samples, faults.where(samples, -1, start), faults.shifted(float(rng.choice([-100.0, 50.0]))))
        elif kind == 7:
            samples = faults.held_back(samples, start, start + float(rng.choice([0.4, 1.0, 2.0])))
        else:
            samples = faults.without(samples, faults.where(samples, stream, start))
    return samples


@pytest.mark.parametrize("seed", range(40))
def test_a_recording_fed_at_once_gives_the_bytes_of_its_samples_pushed_one_by_one(seed: int) -> None:
    one, singly, many, together = batched(damaged(seed), 3, seed)
    same_bytes(one, singly, many, together)


def same_bytes(one: StampAligner, singly: list[Block], many: StampAligner, together: list[Block]) -> None:
    """Compare two ways of feeding."""
    assert len(singly) == len(together)
    for a, b in zip(singly, together):
        assert (a.start_ns, a.step_ns, a.restart) == (b.start_ns, b.step_ns, b.restart)
        assert a.values.tobytes() == b.values.tobytes()
        assert a.valid.tobytes() == b.valid.tobytes()
    assert one.health() == many.health()
    assert one.restarts == many.restarts
    assert [one.variance(i) for i in range(3)] == [many.variance(i) for i in range(3)]
    for a, b in zip(one.finish(), many.finish()):
        assert a.values.tobytes() == b.values.tobytes()


@pytest.mark.parametrize("seed", range(40))
def test_a_delay_that_is_found_on_the_way_gives_the_same_bytes_too(seed: int) -> None:
    rng = np.random.default_rng(seed)
    delays = {int(n): (int(rng.integers(3)), float(rng.uniform(-0.01, 0.02))) for n in rng.integers(1, 140, 3)}
    same_bytes(*batched(damaged(seed), 3, seed, delays))


def test_readings_are_put_back_by_a_delay_from_the_next_block_on_and_none_is_lost() -> None:
    late = 0.008
    samples = [(i, t + round(late * 1e9) * (i == 1), v) for i, t, v in faults.regular(3, 500.0, 3.0)]
    samples.sort(key=lambda s: s[1])
    aligner, blocks = StampAligner(specs(3)), list[Block]()
    for n, (index, stamp, values) in enumerate(samples):
        if n == len(samples) // 2:
            before = len(blocks)
            aligner.delay(1, late)
        blocks.extend(aligner.push(index, stamp, values))
    assert np.all(np.diff(np.concatenate([b.stamps_ns for b in blocks])) == 2_000_000)
    assert all(b.valid.all() for b in blocks[1:])
    assert worst(blocks[: before - 1], 1) > 0.1
    assert max(worst(blocks[before:], i) for i in range(3)) < CUBIC_TOLERANCE
    assert aligner.health()["s1"].accepted == 1500
