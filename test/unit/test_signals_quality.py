# Copyright 2026 ride_estimation contributors
"""Data quality findings: each planted fault is found with its count, clean data are called fine."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable

import numpy as np
import pytest

from ride_estimation.frames import rotation_from_rpy
from ride_estimation.sensors.consistency import consistency_findings
from ride_estimation.sensors.layout import motion_rows
from ride_estimation.sensors.quality import judge_sensors
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.clipping import clipping_levels
from ride_estimation.signals.column_checks import derived_findings, drift_findings
from ride_estimation.signals.quality import gravity_findings, judge_channel, plausibility_findings
from ride_estimation.signals.recording import Channel, Recording

G = 9.80665
RATE = 200.0


def clean(seed: int = 0, seconds: float = 20.0) -> Channel:
    """Coloured motion of about 1 m/s^2 with noise and gravity on z."""
    rng = np.random.default_rng(seed)
    n = int(seconds * RATE)
    smooth = np.apply_along_axis(np.convolve, 0, rng.normal(size=(n + 20, 3)), np.ones(21) / 5.0, "valid")[:n]
    values = smooth + 0.02 * rng.normal(size=(n, 3)) + [0.0, 0.0, G]
    stamps = 1_700_000_000_000_000_000 + np.round(np.arange(n) / RATE * 1e9).astype(np.int64)
    return Channel("a", stamps, values, stamps)


@pytest.mark.parametrize("seed", range(5))
def test_clean_data_have_no_findings(seed: int) -> None:
    channel = clean(seed)
    quality = judge_channel(channel, 98.0)
    assert quality.findings == ()
    assert quality.rate_hz == pytest.approx(RATE) and quality.samples == 4000
    assert gravity_findings(quality.mean, G) == ()
    assert judge_channel(channel).findings == ()


def changed(**parts: np.ndarray) -> Channel:
    return dataclasses.replace(clean(), **parts)  # type: ignore[arg-type]


def test_gaps_duplicates_and_backward_stamps_are_counted() -> None:
    channel = clean()
    keep = np.ones(4000, bool)
    keep[1000:1010] = keep[2000:2040] = False
    gap = judge_channel(Channel("a", channel.stamp_ns[keep], channel.values[keep], channel.arrival_ns[keep]))
    assert gap.gaps == 2 and gap.longest_gap_s == pytest.approx(41 / RATE)
    twice = np.sort(np.concatenate([np.arange(4000), [5, 50, 500]]))
    duplicate = judge_channel(Channel("a", channel.stamp_ns[twice], channel.values[twice], channel.arrival_ns[twice]))
    assert duplicate.duplicates == 3 and duplicate.backwards == 0
    order = np.arange(4000)
    order[[100, 101]] = [101, 100]
    backwards = judge_channel(Channel("a", channel.stamp_ns[order], channel.values[order], channel.arrival_ns[order]))
    assert backwards.backwards == 1 and backwards.findings == ()  # two messages that overtook each other
    jumped = channel.stamp_ns.copy()
    jumped[2000:] -= 3_000_000_000
    jump = judge_channel(Channel("a", jumped, channel.values, channel.arrival_ns))
    assert any("backwards 1 times, the farthest by 3" in f for f in jump.findings)


def test_clipping_is_found_with_and_without_a_stated_range() -> None:
    values = clean().values.copy()
    limit = G + 1.0
    values[:, 2] = np.minimum(values[:, 2], limit)
    clipped = int(np.sum(values[:, 2] == limit))
    near = int(np.sum(values[:, 2] >= 0.999 * limit))  # full scale is met within 0.1 %, a gain error of the stated range
    assert 50 < clipped <= near
    assert judge_channel(changed(values=values), limit).clipped == near
    assert judge_channel(changed(values=values)).clipped == clipped


def test_a_limit_below_the_stated_range_is_found_from_single_samples_at_it() -> None:
    rng = np.random.default_rng(5)
    values = rng.normal(0.0, 1.0, (4000, 3))
    values[:, 1] = np.minimum(values[:, 1], 2.0)  # 90 samples, hardly two in a row
    values[:, 2] = np.round(values[:, 2], 1)  # a coarse converter, not cut
    levels = clipping_levels(values)
    assert levels[1, 1] == 2.0
    assert np.all(np.isinf(levels[:, [0, 2]])) and np.isinf(levels[0, 1])
    coarse = np.maximum(np.round(rng.normal(0.0, 1.0, (4000, 1)), 2), -1.8)
    assert clipping_levels(coarse)[0, 0] == -1.8
    assert judge_channel(changed(values=values), 50.0).clipped == int(np.sum(values[:, 1] == 2.0))
    held = np.repeat(rng.normal(0.0, 1.0, (1000, 1)), 4, axis=0)  # a driver that repeats every sample
    assert np.all(np.isinf(clipping_levels(held)))


@pytest.mark.parametrize("step", [0.0, 0.001, 0.02])
@pytest.mark.parametrize("share", [0.005, 0.03, 0.2])
def test_clipping_is_found_where_single_samples_meet_the_limit(step: float, share: float) -> None:
    """Whatever the resolution; no three in a row are needed."""
    values = np.random.default_rng(3).normal(size=(4000, 3)) * 2.0
    limit = float(np.quantile(values[:, 0], 1.0 - share))
    if step:
        values, limit = np.round(values / step) * step, np.round(limit / step) * step
    assert judge_channel(changed(values=values)).clipped == 0
    values[:, 0] = np.minimum(values[:, 0], limit)
    assert judge_channel(changed(values=values)).clipped == int(np.sum(values[:, 0] == limit))


def test_extreme_values_that_repeat_without_a_limit_are_not_clipped() -> None:
    time = np.arange(4000) / RATE
    sinusoid = np.round(9.0 * np.sin(2.0 * np.pi * 1.7 * time) / 0.05) * 0.05
    held = np.repeat(np.random.default_rng(4).normal(size=400), 10)  # ten times slower than it is sent
    speed = np.maximum(np.sin(0.3 * time), 0.0)  # stands still half of the time
    assert judge_channel(changed(values=np.column_stack([sinusoid, held, speed]))).clipped == 0


@pytest.mark.parametrize(
    ("kind", "rate", "values", "says"),
    [
        ("speed", 0.5, [[1.0], [2.0]], "0.5 Hz is outside 10 Hz to 20 kHz, where ride is measured: is the time in ms?"),
        ("speed", 125_000.0, [[1.0], [2.0]], "125 kHz is outside .* is the time in s instead of ms?"),
        ("displacement", 100.0, [[-3.0], [10.0]], "the travel is 13 m, .* look like mm"),
        ("force", 100.0, [[1.7e6], [0.0]], r"the force reaches 1.7e\+06 N, 619 times the weight .* N that were taken as kN"),
    ],
)
def test_what_cannot_be_is_said_with_the_unit_it_would_be_right_in(kind: str, rate: float, values: list, says: str) -> None:
    (found,) = plausibility_findings(kind, rate, np.array(values), 280.0 * G)
    assert re.search(says, found)
    assert plausibility_findings(kind, 100.0, 1e-4 * np.array(values), 280.0 * G) == ()


@pytest.mark.parametrize(("size", "name"), [(1.0, "g"), (1002.0, "milli-g"), (9807.0, "mm/s"), (32.2, "ft/s"), (386.0, "in/s")])
def test_the_unit_of_gravity_is_guessed(size: float, name: str) -> None:
    assert name in gravity_findings(np.array([0.0, 0.0, size]), G)[0]


def test_the_rate_is_that_of_the_run_and_not_of_most_steps() -> None:
    steps = np.where(np.arange(3999) % 10 < 7, 10_000_000, 11_000_000)
    stamps = 10**9 + np.concatenate([[0], np.cumsum(steps)])
    rate = judge_channel(Channel("a", stamps, clean().values, stamps)).rate_hz
    assert rate == pytest.approx(3999 / (stamps[-1] - stamps[0]) * 1e9, rel=1e-9) and rate < 98.0


def test_constant_columns_are_not_computed_from_each_other() -> None:
    """The mean of a hundred times 0.01 is not 0.01."""
    assert derived_findings(np.tile([0.01, 0.02, 0.07], (100, 1))) == []


def test_spikes_and_flat_lines_are_found() -> None:
    values = clean().values.copy()
    values[[500, 1500, 2500], 1] += 50.0
    assert judge_channel(changed(values=values)).spikes == 3
    values = clean().values.copy()
    values[1000:1400] = values[1000]
    quality = judge_channel(changed(values=values))
    assert quality.flat_s == pytest.approx(2.0, abs=0.01)
    assert any("flat line" in f for f in quality.findings)


def test_one_dead_axis_is_a_flat_line() -> None:
    values = clean().values.copy()
    values[:, 0] = 0.0
    assert judge_channel(changed(values=values)).flat_s == pytest.approx(20.0, abs=0.02)


def test_values_that_are_not_finite_and_zero_stamps_are_counted_and_left_out() -> None:
    channel = clean()
    values, stamps = channel.values.copy(), channel.stamp_ns.copy()
    values[10, 0] = np.nan
    values[20, 1] = np.inf
    stamps[30] = 0
    quality = judge_channel(Channel("a", stamps, values, channel.arrival_ns))
    assert quality.not_finite == 2
    assert np.isfinite(quality.mean).all() and np.isfinite(quality.std).all()
    assert any("stamps are zero" in f for f in quality.findings)
    assert quality.rate_hz == pytest.approx(RATE)


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_hardly_any_samples_are_no_crash(count: int) -> None:
    channel = clean()
    quality = judge_channel(Channel("a", channel.stamp_ns[:count], channel.values[:count], channel.arrival_ns[:count]))
    assert quality.samples == count and np.isfinite(quality.mean).all()


@pytest.mark.parametrize(
    ("mean", "words"),
    [
        ([0.0, 9.79, 0.1], "+y"),
        ([0.0, 0.0, -9.81], "-z"),
        ([-9.8, 0.3, 0.2], "-x"),
        ([0.0, 0.0, 1.0], "look like g"),
        ([12.0, 3.0, 1001.0], "milli-g"),
        ([0.0, 0.0, 0.05], "no gravity"),
        ([0.0, 0.0, 11.5], "instead of"),
        ([5.6, 5.6, 5.6], "points along"),
        ([3.0, 0.0, 9.3], "off the z axis"),
    ],
)
def test_gravity_shows_axes_and_units(mean: list[float], words: str) -> None:
    found = gravity_findings(np.array(mean), G)
    assert any(words in f for f in found), found


POSITIONS = {"fl": (0.8, 0.6, -0.3), "fr": (0.8, -0.6, -0.2), "rl": (-0.8, 0.6, -0.3), "rr": (-0.7, -0.6, 0.9)}


def rigid(seed: int = 0) -> tuple[Recording, list[Sensor]]:
    """Four sensors on one rigid body, the third turned, 0.02 m/s^2 noise."""
    rng = np.random.default_rng(seed)
    sensors = []
    for name, place in POSITIONS.items():
        turned = rotation_from_rpy(0.0, 0.0, 0.4 if name == "rl" else 0.0)
        sensors.append(Sensor(name, "accelerometer", f"/{name}", "cab", position=np.array(place), rotation=turned))
    base = clean(seed, 10.0)
    turn = np.apply_along_axis(np.convolve, 0, rng.normal(size=(len(base.values) + 20, 3)), np.ones(21) / 7.0, "valid")
    motion = np.hstack([base.values, turn[: len(base.values)]])
    signals = motion @ motion_rows(sensors, np.zeros(3)).T + 0.02 * rng.normal(size=(len(motion), 12))
    channels = {
        s.name: Channel(s.name, base.stamp_ns, signals[:, 3 * i : 3 * i + 3], base.stamp_ns) for i, s in enumerate(sensors)
    }
    return Recording("r", channels), sensors


def with_channel(recording: Recording, **changes: Callable[[Channel], Channel]) -> Recording:
    channels = {n: changes.get(n, lambda c: c)(c) for n, c in recording.channels.items()}
    return dataclasses.replace(recording, channels=channels)


@pytest.mark.parametrize("seed", range(5))
def test_consistent_sensors_raise_no_suspicion(seed: int) -> None:
    recording, sensors = rigid(seed)
    assert consistency_findings(recording, sensors, [], np.zeros(3)) == []


@pytest.mark.parametrize(("a", "b"), [("fl", "fr"), ("fl", "rr"), ("fr", "rl")])
def test_exchanged_topics_are_named(a: str, b: str) -> None:
    recording, sensors = rigid()
    swapped = with_channel(recording, **{a: lambda _: recording.channels[b], b: lambda _: recording.channels[a]})
    found = consistency_findings(swapped, sensors, [], np.zeros(3))
    assert len(found) == 1 and found[0].startswith(f"exchanged topics of {a} and {b}")


@pytest.mark.parametrize(
    ("turn", "words"), [((1, 0, 2, 1), "+y, +x, +z"), ((0, 1, 2, -1), "+x, +y, -z")], ids=["x and y exchanged", "z upside down"]
)
def test_wrong_axes_of_one_sensor_are_named(turn: tuple[int, int, int, int], words: str) -> None:
    recording, sensors = rigid()

    def wrong(channel: Channel) -> Channel:
        return dataclasses.replace(channel, values=channel.values[:, turn[:3]] * [1.0, 1.0, turn[3]])

    found = consistency_findings(with_channel(recording, fr=wrong), sensors, [], np.zeros(3))
    assert len(found) == 1 and f"axes of fr that are really {words}" in found[0]


def test_other_faults_are_not_called_an_exchange() -> None:
    recording, sensors = rigid()
    gain = with_channel(recording, fr=lambda c: dataclasses.replace(c, values=1.2 * c.values))
    late = with_channel(recording, fr=lambda c: dataclasses.replace(c, stamp_ns=c.stamp_ns + 20_000_000))
    assert consistency_findings(gain, sensors, [], np.zeros(3)) == []
    assert consistency_findings(late, sensors, [], np.zeros(3)) == []


def test_one_sensor_alone_cannot_contradict_anybody() -> None:
    recording, sensors = rigid()
    assert consistency_findings(recording, sensors[:1], [], np.zeros(3)) == []


def test_a_topic_recorded_under_two_names_is_noticed() -> None:
    recording, sensors = rigid()
    twin = with_channel(recording, fr=lambda _: recording.channels["fl"])
    by_name = {s.name: s for s in sensors}
    judged = judge_sensors(twin, by_name, G)
    assert any("same numbers as fl" in f for f in judged["fr"].findings)
    assert not any("same numbers" in f for q in judge_sensors(recording, by_name, G).values() for f in q.findings)


def test_every_finding_says_what_is_done_about_it() -> None:
    values = clean().values.copy()
    values[[500, 1500, 2500], 1] += 50.0
    values[1000:1400] = values[1000]
    values[10, 0] = np.nan
    for finding in judge_channel(changed(values=values)).findings:
        assert " -> " in finding, finding


def test_a_drift_is_found_and_slow_motion_is_none() -> None:
    """2.0 over the run on one column; a slow swing of the same size has no straight trend."""
    count = 4000
    ramp = np.linspace(-1.0, 1.0, count)
    rng = np.random.default_rng(5)
    values = np.column_stack([rng.normal(size=count), rng.normal(size=count) + ramp, np.sin(6.0 * np.pi * ramp)])
    found = drift_findings(values, np.arange(count) * 0.01)
    assert len(found) == 1
    assert "column 2 drifts by" in found[0]
    size = float(found[0].split("by ")[1].split(" ")[0])
    assert size == pytest.approx(2.0, abs=4.0 * np.sqrt(12.0 / count))  # standard deviation of a fitted slope, unit noise
    assert drift_findings(values[:1500], np.arange(1500) * 0.01) == []


def test_columns_that_are_computed_from_others_are_found() -> None:
    rng = np.random.default_rng(6)
    x, y = rng.normal(size=500).cumsum(), rng.normal(size=500)
    assert derived_findings(np.column_stack([x, y, rng.normal(size=500)])) == []
    assert any("column 2 is -2 times column 1" in f for f in derived_findings(np.column_stack([x, -2.0 * x + 3.0, y])))
    rate = np.column_stack([x, 100.0 * np.gradient(x), y])
    assert any("column 2 is the derivative of column 1" in f for f in derived_findings(rate))
    assert any("column 3 is the magnitude" in f for f in derived_findings(np.column_stack([x, y, np.hypot(x, y)])))


def test_inverted_twins_are_found() -> None:
    first = clean()
    second = Channel("b", first.stamp_ns, -first.values, first.arrival_ns)
    sensors = {n: Sensor(n, "accelerometer", f"/{n}", "cab") for n in ("a", "b")}
    judged = judge_sensors(Recording("r", {"a": first, "b": second}), sensors, G)
    assert any("opposite sign" in f for f in judged["b"].findings)
