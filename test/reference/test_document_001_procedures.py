# Copyright 2026 ride_estimation contributors
"""Bench procedures of document 001 (rows 1-5 to 1-9, 1-20) against closed forms."""

import math

import numpy as np
import pytest

from ride_estimation.diagnosis.answer.result import Calibration
from ride_estimation.errors import InputDataError
from ride_estimation.identification import free_decay, hysteresis_loop, static_tests
from ride_estimation.reporting.diagnosis_report import stiffness_words
from ride_estimation.signals import integration


def loop(frequency, force, amplitude=2e-3, cycles=3, per_cycle=2000):
    t = np.linspace(0, cycles / frequency, cycles * per_cycle + 1)
    w = 2 * np.pi * frequency
    x, v = amplitude * np.sin(w * t), amplitude * w * np.cos(w * t)
    return hysteresis_loop.analyse_loop(t, x, force(x, v), frequency)


def test_a_viscous_loop_gives_k_and_c_exactly():
    result = loop(2.0, lambda x, v: 1e5 * x + 800.0 * v)
    assert result.stiffness == pytest.approx(1e5, rel=1e-5)  # linear interpolation of 2000 samples a cycle
    assert result.damping == pytest.approx(800.0, rel=1e-5)
    assert result.loss_energy == pytest.approx(np.pi * 2 * np.pi * 2.0 * 800.0 * 4e-6, rel=1e-5)


def test_a_friction_loop_is_warned_of_with_the_factor_of_document_001():
    loops = [loop(f, lambda x, v: 1e5 * x + 50.0 * np.sign(v)) for f in (0.02, 4.5)]
    assert loops[0].damping / loops[1].damping == pytest.approx(225.0, rel=1e-3)
    warning = hysteresis_loop.viscous_check(loops)
    assert "omega^-1.00" in warning
    assert "225 times" in warning


def test_two_viscous_loops_are_not_warned_of():
    assert hysteresis_loop.viscous_check([loop(f, lambda x, v: 1e5 * x + 800.0 * v) for f in (0.02, 4.5)]) == ""


def ramps(rate, noise, cycles, k=3e5, c=2000.0, amplitude=3e-3):
    t = np.arange(cycles * rate + 1) / rate
    phase = (t + 0.13) % 1.0
    x, v = amplitude * (1 - 4 * np.abs(phase - 0.5)), 4 * amplitude * np.where(phase < 0.5, 1.0, -1.0)
    rng = np.random.default_rng(5)
    measured = x + noise * rng.standard_normal(t.size)
    return hysteresis_loop.analyse_loop(t, measured, k * x + c * v, 1.0)


@pytest.mark.parametrize(("rate", "noise", "cycles"), [(1000, 0.0, 1), (1000, 1e-5, 3), (5000, 1e-5, 3), (200, 1e-6, 10)])
def test_ramps_at_constant_speed_give_the_damping_of_the_damper(rate, noise, cycles):
    result = ramps(rate, noise, cycles)
    # corners between samples and 10 um of noise: 2 %; the formula for a sine would give 23 % more
    assert result.damping == pytest.approx(2000.0, rel=0.02)
    assert result.stiffness == pytest.approx(3e5, rel=2e-3)
    assert result.amplitude == pytest.approx(3e-3, rel=0.02)
    assert result.loss_energy == pytest.approx(4 * 2000.0 * 0.012 * 3e-3, rel=0.02)  # 4 c v X
    assert result.wave in {"ramps at 0.012 m/s", "ramps at 0.0119 m/s"}


def test_the_motion_of_a_loop_is_named():
    assert loop(2.0, lambda x, v: 1e5 * x + 800.0 * v).wave == "sine"
    t = np.linspace(0, 3, 6001)
    x = 1e-3 * (np.sin(2 * np.pi * t) + 0.3 * np.sin(4 * np.pi * t))
    v = 2e-3 * np.pi * (np.cos(2 * np.pi * t) + 0.6 * np.cos(4 * np.pi * t))
    mixed = hysteresis_loop.analyse_loop(t, x, 1e5 * x + 800.0 * v, 1.0)
    assert mixed.damping == pytest.approx(800.0, rel=1e-4)
    assert "no sine and no ramps" in mixed.wave


def test_a_wrong_test_frequency_is_refused():
    t = np.linspace(0, 5, 10_001)
    x = 1e-3 * np.sin(2 * np.pi * t)
    with pytest.raises(InputDataError, match="does not repeat with 1\\.3 Hz"):
        hysteresis_loop.analyse_loop(t, x, 1e5 * x, 1.3)


@pytest.mark.parametrize(
    ("n", "x"), [(10, np.linspace(0, 1, 10)), (400, np.zeros(400)), (400, np.full(400, np.nan))]
)
def test_unusable_loops_are_refused(n, x):
    with pytest.raises(InputDataError):
        hysteresis_loop.analyse_loop(np.arange(n) * 0.01, x, x, 1.0)


def test_axle_loads_balance_the_moments():
    front, rear = static_tests.axle_loads(80_000.0, 0.9, 2.2)
    assert front + rear == pytest.approx(80_000.0, rel=1e-14)
    assert front * 2.2 == pytest.approx(80_000.0 * 0.9, rel=1e-14)  # moments about the rear axle


def test_tyre_stiffness_comes_back_to_the_noise():
    rng = np.random.default_rng(1)
    rise = np.linspace(0, 0.05, 12)
    pull = (2 * 4.0e5 * rise) * 2.2 / 3.0
    load = static_tests.lifting_load(1.0, 3.0, 2.2) * pull + rng.normal(0, 100.0, rise.size)
    result = static_tests.tyre_stiffness_from_lift(load, rise)
    assert abs(result.stiffness - 4.0e5) < 4 * result.std
    assert result.std == pytest.approx(100.0 / (2 * 0.0545), rel=0.5)  # N/m; sigma / (2 sqrt(Sxx)), 12 points scatter


@pytest.mark.parametrize("zeta", [0.01, 0.057, 0.2])
def test_free_decay_gives_the_damping_ratio(zeta):
    w, rate = 2 * np.pi * 1.7, 500.0
    t = np.arange(0, 12, 1 / rate)
    y = np.exp(-zeta * w * t) * np.cos(w * math.sqrt(1 - zeta**2) * t)
    result = free_decay.analyse_decay(y, rate)
    assert result.damping_ratio == pytest.approx(zeta, abs=1e-3)
    assert result.frequency_hz == pytest.approx(1.7 * math.sqrt(1 - zeta**2), rel=2e-3)


def test_a_linear_decay_of_friction_shows_in_the_spread():
    rate = 500.0
    t = np.arange(0, 6, 1 / rate)
    y = np.maximum(1 - t / 6.5, 0) * np.cos(2 * np.pi * 1.7 * t)
    assert free_decay.analyse_decay(y, rate).spread > 0.2


def test_drop_test_damping_needs_the_inertia_about_the_pivot():
    pivot_inertia, arm, static_load = 9_000.0, 2.2, 15_500.0
    right = free_decay.damping_constant(0.06, 8e5, free_decay.effective_mass(pivot_inertia, arm))
    printed = free_decay.damping_constant(0.06, 8e5, static_load / 9.80665)
    ratio = (static_load / 9.80665) / (pivot_inertia / arm**2)
    assert printed / right == pytest.approx(math.sqrt(ratio), rel=1e-12)


def test_drift_of_a_bias_and_what_a_high_pass_leaves_of_the_noise():
    """Row 1-11 with 60 s at 100 Hz: 0.01 m/s^2 of bias (0.06 deg of tilt) is 0.6 m/s and 18 m; 0.3 Hz leaves 0.23 or 0.47 mm.

    White noise of density S integrated twice behind a Butterworth filter of second order: ``S / (2 pi)^4`` times the integral of
    ``|H|^2 / f^4``, which is ``pi / (2 sqrt 2) / corner^3`` passed once, a quarter of it forwards and backwards.
    """
    rate, count = 100.0, 6000
    bias = np.full(count, 0.01)
    v = integration.integrate(bias, rate)
    assert v[-1] == pytest.approx(0.6, rel=1e-3)
    assert integration.integrate(v, rate)[-1] == pytest.approx(18.0, rel=1e-3)
    assert math.degrees(math.asin(0.01 / 9.80665)) == pytest.approx(0.058, abs=1e-3)
    noise = 0.02 * np.random.default_rng(3).standard_normal((20, count))
    once = 2 * 0.02**2 / rate / (2 * np.pi) ** 4 * np.pi / (2 * np.sqrt(2)) / 0.3**3
    for zero_phase, square, printed in ((False, once, 0.47e-3), (True, once / 4, 0.23e-3)):
        assert np.sqrt(square) == pytest.approx(printed, rel=0.03)  # m
        drifting = (integration.integrate(integration.integrate(a, rate), rate) for a in noise)
        left = [np.var(integration.high_pass(x, rate, 0.3, zero_phase)[1000:-1000]) for x in drifting]
        assert np.sqrt(np.mean(left)) == pytest.approx(printed, rel=0.1)  # 20 runs of 40 s below 1 Hz: 4 % scatter
    # the product filters after either integration and leaves less
    left = [np.std(integration.acceleration_to_displacement(a, rate, 0.3)[1000:-1000]) for a in noise]
    assert 0.1e-3 < np.mean(left) < 0.2e-3  # m


def test_a_causal_high_pass_turns_the_phase_and_the_zero_phase_one_does_not():
    """Row 1-11: second order at 0.3 Hz is 12 deg at 2 Hz, twice it (acceleration to displacement) 24 deg."""
    rate = 200.0
    t = np.arange(0, 40, 1 / rate)
    wave = np.sin(2 * np.pi * 2.0 * t)
    inner = slice(2000, 6000)
    lag = []
    for zero_phase in (False, True):
        filtered = wave
        for _ in range(1 if zero_phase else 2):
            filtered = integration.high_pass(filtered, rate, 0.3, zero_phase)
        lag.append(np.degrees(np.angle(np.sum(filtered[inner] * np.exp(-2j * np.pi * 2.0 * t[inner])) * 1j)))
    assert lag[0] == pytest.approx(24.0, abs=1.0)
    assert lag[1] == pytest.approx(0.0, abs=0.1)


def test_the_report_line_says_by_which_factor_stiffness_over_mass_is_off():
    assert "1.86 times" in static_tests.stiffness_ratio(1.1, 1.5)


def test_the_diagnosis_report_names_stiffnesses_that_are_off_and_no_others():
    """Row 1-20 in the report of a diagnosis: 1.5 Hz measured, 1.1 Hz by the file; what is within three deviations is silent."""
    measured = 1e5 * (1.5 / 1.1) ** 2
    words = stiffness_words([
        Calibration("front.z.stiffness", measured, 500.0, "N/m", 1e5, "valid"),
        Calibration("rear.z.stiffness", 1.1e5, 4e3, "N/m", 1e5, "valid"),
        Calibration("front.z.damping", 2e3, 10.0, "N s/m", 1e3, "valid"),
    ])  # fmt: skip
    assert len(words) == 1
    assert "front.z.stiffness: k/m is 1.86 times" in words[0]
    assert "times 1.36)" in words[0]
