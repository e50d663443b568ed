# Copyright 2026 ride_estimation contributors
"""Undersampled, hum, one-sided, hardly a signal, out of line with its peers: each is named, and none on a signal that is well."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.quality import judge_sensors
from ride_estimation.signals.recording import Channel, Recording
from ride_estimation.signals.spectral_checks import hum_findings, undersampled_findings, unipolar_findings

RATE, SECONDS = 200.0, 40.0
GRAVITY = np.array([0.0, 0.0, 9.80665])
TIME = np.arange(round(RATE * SECONDS)) / RATE


def band(rng: np.random.Generator, high_hz: float, columns: int = 3) -> np.ndarray:  # type: ignore[type-arg]
    """Noise of unit size below a frequency."""
    spectrum = np.fft.rfft(rng.normal(size=(len(TIME), columns)), axis=0)
    spectrum[np.fft.rfftfreq(len(TIME), 1.0 / RATE) > high_hz] = 0.0
    values = np.fft.irfft(spectrum, len(TIME), axis=0)
    return np.asarray(values / values.std(axis=0))


@pytest.mark.parametrize("seed", range(4))
def test_a_signal_that_is_well_has_no_finding(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = band(rng, 60.0) + 0.1 * rng.normal(size=(len(TIME), 3))
    assert not undersampled_findings(values, RATE, 0.1) + hum_findings(values, RATE) + unipolar_findings(values)
    noise = 0.02 * rng.normal(size=(len(TIME), 3))
    assert not undersampled_findings(noise, RATE, 0.02) + hum_findings(noise, RATE)
    # an engine at idle beside the mains: 1000 1/min, third order, wandering by 0.3 %
    phase = 2.0 * np.pi * np.cumsum(50.0 + 0.15 * np.cumsum(rng.normal(size=len(TIME))) / np.sqrt(len(TIME))) / RATE
    assert not hum_findings(values + np.sin(phase)[:, None], RATE)
    steady = 2.0 * np.pi * 50.4 * TIME  # a governed engine: steady, but not the mains
    assert not hum_findings(values + np.sin(steady)[:, None], RATE)


@pytest.mark.parametrize("seed", range(4))
def test_a_signal_without_anti_alias_filter_is_named(seed: int) -> None:
    rng = np.random.default_rng(seed)
    (said,) = undersampled_findings(rng.normal(size=(len(TIME), 3)), RATE, 0.02)
    assert "above 80 Hz" in said and "undersampled" in said


@pytest.mark.parametrize(("mains", "stray"), [(50.0, 0.0), (50.0, 0.03), (60.0, -0.02)])
def test_hum_is_named(mains: float, stray: float) -> None:
    values = band(np.random.default_rng(1), 40.0)
    values[:, 1] += 0.4 * np.sin(2.0 * np.pi * (mains + stray) * TIME)
    (said,) = hum_findings(values, RATE)
    assert f"steady line at {mains:.0f}" in said.replace("49.9", "50.0").replace("59.9", "60.0") and "column 2" in said
    assert float(said.split(", ")[1].split()[0]) == pytest.approx(0.4 / np.sqrt(2.0), rel=0.25)


def test_a_rectified_signal_is_named() -> None:
    values = band(np.random.default_rng(2), 60.0)
    values[:, 2] = np.abs(values[:, 2])
    (said,) = unipolar_findings(values)
    assert "column 3 never goes below zero" in said
    assert not unipolar_findings(values + np.array([0.0, 9.81, 9.81]))  # gravity keeps an axis on one side


def test_one_of_several_that_is_far_off_is_named() -> None:
    vehicle = load_vehicle("truck_cab")
    rng = np.random.default_rng(3)
    stamps = 10**9 + np.round(TIME * 1e9).astype(np.int64)
    channels = {}
    for name in vehicle.sensors:
        values = band(rng, 60.0) * rng.uniform(0.6, 1.6) + 0.02 * rng.normal(size=(len(TIME), 3)) + GRAVITY
        channels[name] = Channel(name, stamps, values, stamps)
    well = judge_sensors(Recording("r", channels), vehicle.sensors, vehicle.gravity)
    assert not [finding for quality in well.values() for finding in quality.findings]
    assert all(29.0 < quality.signal_to_noise_db < 39.0 for quality in well.values())

    def changed(name: str, factor: float) -> str:
        c = channels[name]
        still = 0.02 * rng.normal(size=c.values.shape) if factor == 0.0 else factor * (c.values - GRAVITY)
        spoiled = {**channels, name: dataclasses.replace(c, values=still + GRAVITY)}
        judged = judge_sensors(Recording("r", spoiled), vehicle.sensors, vehicle.gravity)
        assert not [finding for other in judged if other != name for finding in judged[other].findings]
        return " ".join(judged[name].findings)

    assert "times louder than the median of the 4 accelerometers on cab" in changed("cab_front_left", 40.0)
    assert "times quieter than the median of the 4 accelerometers on chassis" in changed("chassis_rear_left", 0.02)
    assert "hardly a signal" in changed("cab_rear_right", 0.0)
