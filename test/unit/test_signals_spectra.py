# Copyright 2026 ride_estimation contributors
"""Spectra state their true resolution (rows 1-11, 1-15, 1-16, 1-17 of document 001)."""

import numpy as np
import pytest

from ride_estimation.errors import InputDataError
from ride_estimation.signals import integration, spectra


def noise(seed: int, n: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(n)


def test_parseval_holds_for_white_noise():
    y = noise(1, 200_000)
    s = spectra.welch_spectrum(y, 100.0, 1024)
    total = np.sum(s.density) * s.resolution_hz
    assert total == pytest.approx(np.var(y), rel=0.01)  # 1 %: statistical scatter of 390 averages


def test_resolution_bandwidth_and_averages_are_the_true_ones():
    s = spectra.welch_spectrum(noise(2, 4096), 100.0, 1024)
    assert s.resolution_hz == pytest.approx(0.09765625, abs=1e-12)
    assert s.bandwidth_hz == pytest.approx(0.146484375, abs=1e-12)
    assert s.averages == 7
    assert "0.09766 Hz" in s.describe()


@pytest.mark.parametrize(("block", "true"), [(4096, "0.02441"), (1024, "0.09766")])
def test_the_resolution_document_001_claims_is_refused(block, true):
    with pytest.raises(InputDataError, match=true):
        spectra.welch_spectrum(noise(3, 8192), 100.0, block, claimed_resolution_hz=0.2)


def test_a_true_claim_is_accepted():
    assert spectra.welch_spectrum(noise(3, 8192), 204.8, 1024, claimed_resolution_hz=0.2).averages == 15


def test_a_peak_at_an_input_line_that_is_no_mode_is_labelled_input():
    rate, n = 100.0, 60_000
    t = np.arange(n) / rate
    excitation = noise(4, n) + 2.0 * np.sin(2 * np.pi * 1.6 * t)
    # resonator at 4.5 Hz, 5 % damping, by its exact impulse response
    w, z = 2 * np.pi * 4.5, 0.05
    wd = w * np.sqrt(1 - z * z)
    h = np.exp(-z * w * t[:2000]) * np.sin(wd * t[:2000]) * w / rate
    output = np.convolve(excitation, h)[:n]
    peaks = spectra.label_peaks(
        spectra.welch_spectrum(output, rate, 2048), spectra.welch_spectrum(excitation, rate, 2048), [4.5]
    )
    labels = {round(p.frequency_hz, 1): p.label for p in peaks}
    assert labels[1.6] == "input"
    assert "mode" in [p.label for p in peaks if abs(p.frequency_hz - 4.5) < 0.3]


def test_transfer_function_of_a_gain_with_delay_has_its_phase_and_full_coherence():
    x = noise(5, 40_000)
    y = 2.0 * np.roll(x, 1)
    h = spectra.transfer_function(x, y, 100.0, 512)
    k = np.searchsorted(h.frequency_hz, 10.0)
    assert abs(h.h1[k]) == pytest.approx(2.0, rel=0.01)
    assert np.angle(h.h1[k]) == pytest.approx(-2 * np.pi * h.frequency_hz[k] * 0.01, abs=0.02)  # rad
    assert h.coherence[k] > 0.99


def test_spectrum_correlation_does_not_distinguish_two_unrelated_roads():
    """Document 000 validates with this score: it says 0.9 where the signals share nothing."""
    colour = np.exp(-np.arange(200) / 20.0)
    a, b = (np.convolve(noise(s, 20_000), colour)[:20_000] for s in (6, 7))
    assert spectra.spectrum_correlation(a, b, 200.0, 512) > 0.95
    assert abs(np.corrcoef(a, b)[0, 1]) < 0.1


@pytest.mark.parametrize("values", [[np.nan] * 64, [1.0] * 4])
def test_bad_signals_are_refused(values):
    with pytest.raises(InputDataError):
        spectra.welch_spectrum(values, 100.0, 16)


def test_drift_of_integrated_noise_is_the_stated_one():
    sigma, rate, duration, runs = 0.02, 100.0, 60.0, 400
    rng = np.random.default_rng(8)
    a = sigma * rng.standard_normal((int(rate * duration), runs))
    v = integration.integrate(a, rate)
    d = integration.integrate(v, rate)
    assert np.std(v[-1]) == pytest.approx(integration.velocity_drift(sigma, rate, duration), rel=0.12)  # 3 sd of 400 runs
    assert np.std(d[-1]) == pytest.approx(integration.displacement_drift(sigma, rate, duration), rel=0.12)
    assert integration.velocity_drift(sigma, rate, duration) == pytest.approx(0.0155, abs=5e-5)  # m/s, ride_models 4.9
    assert integration.displacement_drift(sigma, rate, duration) == pytest.approx(0.537, abs=5e-4)  # m


def test_velocity_of_a_sine_comes_back_with_bias_removed():
    rate = 200.0
    t = np.arange(0, 60, 1 / rate)
    v_true = 0.1 * np.sin(2 * np.pi * 2.0 * t)
    a = np.gradient(v_true, t) + 0.05
    v = integration.acceleration_to_velocity(a, rate, 0.3)
    inner = slice(2000, -2000)
    assert np.max(np.abs(v[inner] - v_true[inner])) < 2e-3  # m/s; the high-pass takes 0.05 % at 2 Hz, the rest is its start


def test_displacement_of_a_sine_comes_back():
    rate = 200.0
    t = np.arange(0, 60, 1 / rate)
    x_true = 0.01 * np.sin(2 * np.pi * 2.0 * t)
    a = -((2 * np.pi * 2.0) ** 2) * x_true + 0.01
    x = integration.acceleration_to_displacement(a, rate, 0.3)
    inner = slice(3000, -3000)
    assert np.max(np.abs(x[inner] - x_true[inner])) < 3e-4  # m, 3 % of the amplitude
