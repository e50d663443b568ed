# Copyright 2026 ride_estimation contributors
"""Sensor errors and faults do to a signal what they say."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ride_estimation.errors import ConfigurationError
from ride_estimation.sensors.measurement import FAULT_KINDS, Fault, SensorErrors, draw_unit, low_pass, measure, sample_times
from ride_estimation.sensors.sensor import Sensor

RATE = 1000.0
SENSOR = Sensor("a", "accelerometer", "/a", "cab", noise_std=0.02, full_scale=50.0)
CLEAN = SensorErrors(rate=200.0, noise_scale=0.0, anti_alias=0.0, synchronous=True)


def ideal(seconds=10.0):
    return exact(np.arange(int(seconds * RATE) + 1) / RATE)


def exact(t):
    w = 2 * np.pi * t
    return np.stack([np.sin(1.3 * w), 2.0 * np.cos(3.1 * w), 9.81 + 3.0 * np.sin(2.0 * w)], axis=1)


def recorded(errors=CLEAN, faults=(), seed=1, sensor=SENSOR):
    generator = np.random.default_rng(seed)
    unit = draw_unit(sensor, errors, generator)
    time = sample_times(10.0, errors, generator)
    channel = measure(sensor, ideal(), RATE, time, errors, unit, faults, generator, start_ns=1_000_000_000)
    return channel, (channel.stamp_ns - 1_000_000_000) * 1e-9, unit


def test_a_perfect_sensor_reads_the_signal_at_its_stamps():
    channel, t, _ = recorded()
    np.testing.assert_allclose(channel.values, exact(t), atol=1e-6)
    np.testing.assert_allclose(np.diff(t), 0.005, atol=1e-9)
    assert np.all(channel.arrival_ns > channel.stamp_ns)


def test_jitter_moves_samples_and_stamps_together():
    channel, t, _ = recorded(dataclasses.replace(CLEAN, jitter_std=5e-4, synchronous=False))
    assert np.std(np.diff(t)) == pytest.approx(5e-4 * np.sqrt(2.0), rel=0.1)  # s
    np.testing.assert_allclose(channel.values, exact(t), atol=1e-6)


def test_stamp_error_moves_only_the_stamps():
    channel, t, _ = recorded(dataclasses.replace(CLEAN, stamp_error_std=1e-3))
    error = channel.values - exact(t)
    slope = np.array([2 * np.pi * 1.3, 4 * np.pi * 3.1, 12 * np.pi]) / np.sqrt(2.0)
    np.testing.assert_allclose(error.std(axis=0), 1e-3 * slope, rtol=0.15)  # m/s^2: rate of change times 1 ms


def test_noise_bias_gain_and_rotation_are_those_drawn():
    errors = SensorErrors(rate=200.0, anti_alias=0.0, bias_std=0.3, gain_std=0.02, misalignment_std=0.05)
    channel, t, unit = recorded(errors)
    rest = channel.values - (unit.gain * exact(t) @ unit.rotation + unit.bias)
    np.testing.assert_allclose(rest.std(axis=0), 0.02, rtol=0.1)  # m/s^2, noise of the vehicle file
    assert np.abs(rest.mean(axis=0)).max() < 0.003
    np.testing.assert_allclose(unit.rotation @ unit.rotation.T, np.eye(3), atol=1e-12)


def test_quantisation_and_full_scale():
    channel, _, _ = recorded(dataclasses.replace(CLEAN, quantisation=0.1), sensor=dataclasses.replace(SENSOR, full_scale=11.0))
    np.testing.assert_allclose(channel.values, np.round(channel.values / 0.1) * 0.1, atol=1e-12)
    assert channel.values[:, 2].max() == pytest.approx(11.0)


def test_ac_coupling_takes_the_mean():
    channel, _, _ = recorded(sensor=dataclasses.replace(SENSOR, coupling="ac"))
    assert np.abs(channel.values.mean(axis=0)).max() < 0.02


def test_low_pass_has_no_delay_and_its_corner():
    t = np.arange(20000) / RATE
    wave = np.stack([np.sin(2 * np.pi * 5.0 * t), np.sin(2 * np.pi * 80.0 * t), np.sin(2 * np.pi * 240.0 * t)], axis=1)
    out = low_pass(wave, RATE, 80.0)
    middle = slice(2000, 18000)
    gain = np.sum(out[middle] * wave[middle], axis=0) / np.sum(wave[middle] ** 2, axis=0)
    np.testing.assert_allclose(gain, [1.0, np.sqrt(0.5), 3.0**-4], atol=2e-3)
    np.testing.assert_allclose(out[:, 0], wave[:, 0], atol=5e-3)


def test_dropped_samples_are_missing_at_the_stated_share():
    channel, _, _ = recorded(dataclasses.replace(CLEAN, drop_share=0.1))
    assert len(channel.stamp_ns) == pytest.approx(1800, abs=60)


def test_every_fault_acts_in_its_window_and_nowhere_else():
    healthy, t, _ = recorded()
    sizes = {"spikes": 30.0, "delay": 0.02, "gain": 1.2, "bias": 1.0, "noise": 0.5, "clipping": 8.0, "misalignment": 0.2}
    sizes["stamp_jump"] = 3.0
    for kind in FAULT_KINDS:
        channel, _, _ = recorded(faults=[Fault("a", kind, 4.0, 6.0, sizes.get(kind, 0.0))])
        inside = (t >= 4.0) & (t < 6.0)
        if kind == "gap":
            assert len(channel.stamp_ns) == np.count_nonzero(~inside)
        elif kind == "duplicates":
            assert len(channel.stamp_ns) == len(t) + np.count_nonzero(inside)
        else:
            same = np.all((channel.values == healthy.values), axis=1) & (channel.stamp_ns == healthy.stamp_ns)
            assert np.all(same[~inside]), kind
            share = np.mean(~same[inside])
            assert share > (0.005 if kind == "spikes" else 0.5), (kind, share)


def test_delay_fault_makes_values_late_behind_their_stamps():
    channel, t, _ = recorded(faults=[Fault("a", "delay", 2.0, 8.0, 0.03)])
    inside = (t >= 2.0) & (t < 8.0)
    np.testing.assert_allclose(channel.values[inside], exact(t[inside] - 0.03), atol=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SensorErrors(drop_share=1.0), "drop_share: 1; allowed: 0 to less than 1"),
        (lambda: SensorErrors(rate=0.0), "rate: 0 Hz; allowed: greater than zero"),
        (lambda: SensorErrors(jitter_std=float("nan")), "jitter_std: nan; allowed: 0 or more"),
        (lambda: Fault("a", "tired"), "kind: 'tired'; allowed: stuck"),
        (lambda: Fault("a", "gap", 5.0, 2.0), "allowed: from before to"),
    ],
)
def test_impossible_errors_and_faults_are_refused(make, message):
    with pytest.raises(ConfigurationError, match=message):
        make()
