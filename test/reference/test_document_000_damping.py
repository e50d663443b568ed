# Copyright 2026 ride_estimation contributors
"""Damping estimates of document 000 corrected (rows 0-13 to 0-16)."""

import dataclasses

import numpy as np
import pytest

from ride_estimation import metrics
from ride_estimation.errors import InputDataError
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
        ratio = np.abs(body_motion(K / s + damper)) / np.abs(body_motion(K / s + 1e-3))
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
        found, wanted = (np.array(dataclasses.astuple(band)) for band in (fit.band, BAND))
        assert np.all(np.abs(found / wanted - 1) < 0.005), found / wanted
        assert np.all(np.abs(found - wanted) < 4 * np.array(fit.std))
        assert 0.6 < fit.chi_square < 1.5 and fit.filter_identifiable


def test_a_run_without_the_filter_leaves_its_parameters_unidentified():
    """A plain Voigt mount: centre and quality of a filter that is not there have no value."""
    plain = npd.BandDamping(K, 900.0, 1e-9, 12.6, 0.5)
    rng = np.random.default_rng(3)
    std = 2e-3
    noise = std * (rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size))
    target = body_motion(plain.impedance(OMEGA)) + noise
    fit = npd.fit_band_damping(OMEGA, MASS, target, np.full(OMEGA.size, 1 / std), npd.BandDamping(K, 600.0, 150.0, 9.0, 0.8))
    assert not fit.filter_identifiable
    assert fit.plain == pytest.approx((K, 900.0), rel=0.01)
    assert fit.chi_square == pytest.approx(1.0, abs=0.2)


def test_damping_of_measured_accelerations_lies_in_its_interval():
    """Row 0-14 on noisy signals: coherent lines only, two in three inside one standard deviation of either part."""
    rate, n, rng = 100.0, 40_000, np.random.default_rng(8)
    base = rng.standard_normal(n)
    w = 2 * np.pi * np.fft.rfftfreq(n, 1 / rate)
    w[0] = 1.0
    ratio = BAND.impedance(w) / (BAND.impedance(w) + 1j * w * MASS)
    body = np.fft.irfft(ratio * np.fft.rfft(base), n) + 0.02 * rng.standard_normal(n)
    found = npd.measured_damping(body, base, rate, 2000, MASS, K)
    keep = (found.frequency_hz > 0.5) & (found.frequency_hz < 8.0)
    truth = BAND.impedance(2 * np.pi * found.frequency_hz) - K / (2j * np.pi * found.frequency_hz)
    off = (found.damping - truth)[keep] / found.std[keep]
    assert 0.5 < np.mean(np.abs(off.real) < 1.0) < 0.95
    assert np.mean(np.abs(off.real) < 3.0) > 0.95 and np.mean(np.abs(off.imag) < 3.0) > 0.95
    with pytest.raises(InputDataError, match="nowhere coherent"):
        npd.measured_damping(np.roll(rng.standard_normal(n), 9), base, rate, 400, MASS, K)


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
