# Copyright 2026 ride_estimation contributors
"""Damping estimates of document 000 corrected (rows 0-13 to 0-16)."""

import numpy as np
import pytest

from ride_estimation import metrics
from ride_estimation.identification import nonparametric_damping as npd

OMEGA = 2 * np.pi * np.linspace(0.2, 20.0, 400)
MASS, K = 300.0, 47_000.0
BAND = npd.BandDamping(K, 400.0, 270.0, 12.6, 0.5)


def body_motion(impedance):
    return impedance / (impedance + 1j * OMEGA * MASS)  # unit base motion


@pytest.mark.parametrize("name", ["viscous", "band"])
def test_complex_damping_is_recovered_without_noise(name):
    s = 1j * OMEGA
    true = np.full(OMEGA.shape, 900.0 + 0j) if name == "viscous" else BAND.impedance(OMEGA) - K / s
    estimate = npd.damping_from_motion(OMEGA, MASS, K, body_motion(K / s + true), np.ones(OMEGA.shape))
    assert np.max(np.abs(estimate / true - 1)) < 1e-12


@pytest.mark.parametrize("extra", [0.0, 500.0])
def test_the_ratio_of_spectra_notches_at_the_bounce_mode_whatever_the_damper(extra):
    s = 1j * OMEGA
    dampers = [np.full(OMEGA.shape, 900.0 + extra), BAND.impedance(OMEGA) - K / s + extra]
    bounce = np.sqrt(K / MASS)
    for damper in dampers:
        ratio = npd.spectrum_ratio(body_motion(K / s + damper), body_motion(K / s + 1e-3))
        assert OMEGA[np.argmin(ratio)] == pytest.approx(bounce, rel=0.02)


def test_joint_fit_recovers_all_five_parameters():
    """Row 0-15: all within 0.5 % with noise of 0.02 m/s^2 against about 1 m/s^2 of signal, 3 seeds."""
    truth = body_motion(BAND.impedance(OMEGA))
    for seed in range(3):
        rng = np.random.default_rng(seed)
        std = 2e-4  # 0.02 / 1 over sqrt of about 10 000 averaged samples a line
        noise = std * (rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size))
        start = npd.BandDamping(1.2 * K, 600.0, 150.0, 9.0, 0.8)
        fit = npd.fit_band_damping(OMEGA, MASS, truth + noise, np.full(OMEGA.size, 1 / std), start)
        found = np.array([fit.stiffness, fit.damping, fit.gain, fit.omega_0, fit.quality])
        wanted = np.array([BAND.stiffness, BAND.damping, BAND.gain, BAND.omega_0, BAND.quality])
        assert np.all(np.abs(found / wanted - 1) < 0.005), found / wanted


def test_correlation_is_blind_to_gain_and_offset_and_r_squared_is_not():
    y = np.random.default_rng(1).standard_normal(20_000)
    assert metrics.pearson_r(y, 0.5 * y) == pytest.approx(1.0, abs=1e-12)
    assert metrics.r_squared(y, 0.5 * y) == pytest.approx(0.75, abs=1e-3)
    offset = y + 3.0 * np.std(y)
    assert metrics.pearson_r(y, offset) == pytest.approx(1.0, abs=1e-12)
    assert metrics.r_squared(y, offset) == pytest.approx(-8.0, abs=1e-9)
    assert metrics.variance_accounted_for(y, offset) == pytest.approx(1.0, abs=1e-12)


def test_band_filter_of_table_5_has_its_published_peak_and_half_power_points():
    f = np.linspace(0.2, 8.0, 200_001)
    band = npd.BandDamping(1e-9, 1e-9, 270.0, 12.6, 0.5).impedance(2 * np.pi * f)
    magnitude = np.abs(band)
    assert f[np.argmax(magnitude)] == pytest.approx(2.005, abs=1e-3)  # Hz: omega_0 is in rad/s, not 1/Hz
    assert magnitude.max() == pytest.approx(270.0, rel=1e-6)
    inside = f[magnitude >= 270.0 / np.sqrt(2)]
    assert inside[0] == pytest.approx(0.83, abs=0.005)
    assert inside[-1] == pytest.approx(4.84, abs=0.005)
