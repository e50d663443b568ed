# Copyright 2026 ride_estimation contributors
"""Hints while driving: planted errors are named with place and size, clean data give none, at the rate the theory states."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.faults import hint_spectra
from ride_estimation.estimation.faults.hint_spectra import FALSE_ALARMS_PER_HOUR, SpectrumHints
from ride_estimation.estimation.faults.hints import sensor_hint
from ride_estimation.estimation.sensor_errors import sensor_faults
from ride_estimation.estimation.sensor_errors.sensor_faults import FaultTest
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.installation import USUAL
from ride_estimation.sensors.sensor import Sensor

RATE, NOISE = 200.0, 0.02
PLACES = {"fl": (0.8, 0.7, -0.3), "fr": (0.8, -0.7, -0.3), "rl": (-0.9, 0.6, 0.6), "rr": (-0.8, -0.6, -0.2)}
SENSORS = [Sensor(n, "accelerometer", f"/{n}", "cab", position=np.array(p), noise_std=NOISE) for n, p in PLACES.items()]
ROWS = np.vstack([np.hstack([np.eye(3), -np.cross(np.eye(3), p)]) for p in PLACES.values()])
WEIGHTS = np.linalg.pinv(ROWS)
CAB = geometry_of(load_vehicle("truck_cab"))


def coloured(rng, count, channels, low=1.0, high=20.0):
    """Return noise in a band, unit rms, shape (count, channels)."""
    f = np.fft.rfftfreq(count, 1.0 / RATE)
    inside = ((f > low) & (f < high))[:, None]
    out = np.fft.irfft(inside * np.fft.rfft(rng.standard_normal((count, channels)), axis=0), count, axis=0)
    return out / out.std(axis=0)


def readings(seed, seconds=60.0):
    """Return readings of the four sensors (N, 12) and the six accelerations; 0.6 m/s^2 and 0.5 rad/s^2 rms."""
    rng = np.random.default_rng(seed)
    motion = coloured(rng, round(seconds * RATE), 6) * np.array([0.6, 0.6, 0.6, 0.5, 0.5, 0.5])
    return motion @ ROWS.T + NOISE * rng.standard_normal((len(motion), 12)), motion


def run_sensors(measured, motion):
    """Return the hint of a run on its sensors, None without."""
    test = FaultTest(SENSORS, ROWS, np.array([s.position for s in SENSORS]), 0.0)
    test.set_variance(np.full(12, NOISE**2))
    test.observe(measured, measured @ WEIGHTS.T, np.zeros((len(motion), 3)), 1.0 / RATE)
    fault = test.judge()
    return None if fault is None else sensor_hint(fault)


def spoiled(cause, seed):
    """Return a run whose third sensor has an error, the size and the axis of it."""
    measured, motion = readings(seed)
    part = slice(6, 9)
    y = measured[:, part].copy()
    if cause == "sensor_delay":
        f = np.fft.rfftfreq(len(y), 1.0 / RATE)[:, None]
        measured[:, part] = np.fft.irfft(np.fft.rfft(y, axis=0) * np.exp(-2j * np.pi * f * 0.003), len(y), axis=0)
        return measured, motion, 0.003, ""
    if cause == "sensor_gain":
        measured[:, 7] = 1.05 * y[:, 1]
        return measured, motion, 0.05, "y"
    if cause == "sensor_misalignment":
        measured[:, part] = y - np.cross([0.0, 0.04, 0.0], y)
        return measured, motion, 0.04, "pitch"
    measured[:, part] = y + np.cross(motion[:, 3:], [0.08, 0.0, 0.0])
    return measured, motion, 0.08, "x"


@pytest.mark.parametrize("cause", ["sensor_delay", "sensor_gain", "sensor_misalignment", "wrong_sensor_position"])
def test_a_sensor_error_is_named_with_place_axis_and_size(cause):
    measured, motion, size, axis = spoiled(cause, 1331)
    hint = run_sensors(measured, motion)
    assert (hint.cause, hint.location, hint.axis) == (cause, "rl", axis)
    assert hint.strength == pytest.approx(size, rel=0.1)
    # the errors that sensors in good order may have are part of it
    tolerance = {"sensor_delay": "delay", "sensor_gain": "gain", "sensor_misalignment": "misalignment"}.get(cause, "position")
    assert getattr(USUAL, tolerance) < hint.std < 2.0 * getattr(USUAL, tolerance)


def test_good_sensors_give_no_hint_and_tolerances_are_none():
    for seed in range(1332, 1337):
        measured, motion = readings(seed, 50.0)
        assert run_sensors(measured, motion) is None
        rng = np.random.default_rng(seed)
        # gains 0.3 %, rotations 0.2 degrees: an installation in good order
        for i in range(4):
            y = measured[:, 3 * i : 3 * i + 3]
            measured[:, 3 * i : 3 * i + 3] = y * (1.0 + 0.003 * rng.standard_normal(3)) - np.cross(
                np.radians(0.2) * rng.standard_normal(3), y
            )
        assert run_sensors(measured, motion) is None


@pytest.mark.slow
def test_false_alarms_of_the_sensor_tests_keep_to_their_level(monkeypatch):
    # sensors whose errors are as large as their installation says, at a level of one in five runs
    monkeypatch.setattr(sensor_faults, "FALSE_ALARM", 0.2)
    alarms = 0
    for seed in range(1600, 1700):
        measured, motion = readings(seed, 30.0)
        rng = np.random.default_rng(seed)
        for i, kinds in enumerate(rng.standard_normal((4, 3, 3))):
            y = measured[:, 3 * i : 3 * i + 3]
            turned = y * (1.0 + USUAL.gain * kinds[0]) - np.cross(USUAL.misalignment * kinds[1], y)
            measured[:, 3 * i : 3 * i + 3] = turned + np.cross(motion[:, 3:], USUAL.position * kinds[2])
        alarms += run_sensors(measured, motion) is not None
    # Bonferroni bound 20 in 100, three binomial standard deviations above
    assert alarms <= 20 + 12


def run_spectra(missing, mounts):
    """Return the hints of force signals (N, 6)."""
    detector = SpectrumHints(CAB)
    for start in range(0, len(missing), 400):
        part = slice(start, start + 400)
        detector.observe(missing[part] + mounts[part], missing[part], 1.0 / RATE)
    return detector.hints()


def test_a_line_is_distinguished_from_broad_noise_and_from_a_line_of_the_road():
    rng = np.random.default_rng(1341)
    count = round(60.0 * RATE)
    mounts = 1000.0 * coloured(rng, count, 6)
    missing = 0.03 * mounts + 30.0 * coloured(rng, count, 6)
    t = np.arange(count) / RATE
    assert run_spectra(missing, mounts) == ()
    # a line that the road brings: the mounts carry it, the model misses the same share as elsewhere
    road = mounts + 400.0 * np.sin(2 * np.pi * 11.3 * t)[:, None]
    assert run_spectra(0.03 * road + missing - 0.03 * mounts, road) == ()
    # wanders by 0.1 Hz about 7.4 Hz
    phase = 2 * np.pi * (7.4 * t + 0.3 * np.sin(2 * np.pi * 0.05 * t))
    shaken = missing.copy()
    shaken[:, 2] += 40.0 * np.sin(phase)
    (hint,) = run_spectra(shaken, mounts)
    assert (hint.cause, hint.location, hint.axis) == ("harmonic_disturbance", "cab", "z")
    assert hint.strength == pytest.approx(7.4, abs=0.3)


def test_a_resonance_is_no_line():
    """Wheels on their tyres at 14 Hz, a tenth of critically damped, of which the model misses much."""
    rng = np.random.default_rng(1343)
    count = round(60.0 * RATE)
    mounts = 1000.0 * coloured(rng, count, 6)
    frequency = np.fft.rfftfreq(count, 1.0 / RATE)
    gain = 1.0 / (1.0 - (frequency / 14.0) ** 2 + 0.1j * frequency / 14.0)
    hop = np.fft.irfft(np.fft.rfft(rng.standard_normal((count, 6)), axis=0) * gain[:, None], count, axis=0)
    missing = 0.03 * mounts + 30.0 * coloured(rng, count, 6) + 20.0 * hop
    assert run_spectra(missing, mounts) == ()


def test_a_model_that_misses_a_third_is_said():
    rng = np.random.default_rng(1342)
    mounts = 1000.0 * coloured(rng, round(60.0 * RATE), 6)
    (hint,) = run_spectra(0.35 * mounts, mounts)
    assert (hint.cause, hint.location, hint.axis) == ("unexplained", "cab", "z")
    assert hint.strength == pytest.approx(0.35, rel=0.01)


@pytest.mark.slow
def test_false_alarms_of_lines_keep_to_their_level(monkeypatch):
    monkeypatch.setattr(hint_spectra, "_level", lambda tests: 0.2 / tests)
    monkeypatch.setattr(hint_spectra, "_LEAST_LINE", 0.0)
    count = round(60.0 * RATE)
    alarms = 0
    for seed in range(1500, 1600):
        rng = np.random.default_rng(seed)
        mounts = rng.standard_normal((count, 6))
        alarms += bool(run_spectra(0.1 * rng.standard_normal((count, 6)), mounts))
    # at most one in five by the F test of the missing force alone; the ratio must agree: three binomial standard deviations
    assert alarms <= 20 + 12


def fed(hints, share, usable=lambda k: True):
    """Return what is suspected after blocks of ten ticks of whose forces the model misses a share."""
    mounts = 100.0 * coloured(np.random.default_rng(1345), round(60.0 * RATE), 6)
    missing = share * mounts
    for k, start in enumerate(range(0, len(missing), 10)):
        part = slice(start, start + 10)
        if usable(k):
            hints.observe(mounts[part], missing[part], 1.0 / RATE)
        else:
            hints.interrupt()
    return hints.hints()


def test_a_gap_begins_anew():
    hints = SpectrumHints(CAB)
    assert fed(hints, 0.35, lambda k: k % 20 != 0) == ()  # never four seconds without a gap
    assert [h.location for h in fed(hints, 0.35)] == ["cab"]
    assert 0.0 < FALSE_ALARMS_PER_HOUR < 0.1
    hints.reset()
    assert hints.hints() == ()
    assert fed(SpectrumHints(dataclasses.replace(CAB, base_sensors=(None,) * len(CAB.mounts))), 0.35) == ()
