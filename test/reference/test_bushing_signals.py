# Copyright 2026 ride_estimation contributors
"""Document 003: harmonic plan, sigmoid chirp and validation signals (items B11, B13, B15)."""

from __future__ import annotations

import numpy as np
import pytest

from ride_estimation.errors import ConfigurationError
from ride_estimation.excitation.programmes import (
    band_limited_random,
    dma_plan,
    harmonic_pulse,
    preconditioning,
    validation_signals,
)
from ride_estimation.excitation.sigmoid_chirp import SigmoidChirp


def test_harmonic_plan_has_35_tests_in_1453_seconds() -> None:
    plan = dma_plan()
    assert len(plan) == 35
    assert sum(test.duration_s for test in plan) == pytest.approx(1453.0, abs=0.5)
    assert max(test.peak_speed for test in plan) == pytest.approx(5.13e-3, abs=0.01e-3)
    assert {round(test.amplitude_m * 1e3, 6) for test in plan} <= {round(0.02 * 2**i, 6) for i in range(10)}
    assert len({round(test.frequency_hz, 9) for test in plan}) == 11
    first = preconditioning(plan)
    assert first.amplitude_m == pytest.approx(1.1 * 10.24e-3)
    t, x = plan[0].signal()
    assert t[-1] == pytest.approx(plan[0].duration_s)
    assert np.max(np.abs(x)) == pytest.approx(plan[0].amplitude_m, rel=1e-4)


def test_stepped_chirp_has_the_numbers_of_the_document() -> None:
    chirp = SigmoidChirp()
    starts, frequencies = chirp.half_cycles()
    assert len(starts) == 1430
    assert frequencies[-1] == pytest.approx(39.97, abs=0.005)
    assert float(chirp.amplitude(np.array(200.0))) == pytest.approx(0.0433e-3, abs=0.0001e-3)
    # the first two half cycles last 33.3 and 27.1 s
    assert np.diff(starts[:3]) == pytest.approx([33.3, 27.1], abs=0.05)
    t, x = chirp.signal(20_000.0)
    assert t.size == 4_000_001
    # 40.6 mm/s, within 0.1 mm/s
    assert np.max(np.abs(np.diff(x))) * 20_000.0 == pytest.approx(40.6e-3, abs=0.1e-3)


def test_chirp_constructions_differ_by_two_cycles_and_the_integral_is_smooth() -> None:
    chirp = SigmoidChirp()
    end = np.array([200.0])
    assert chirp.cycles(end, "stepped")[0] == pytest.approx(715.0, abs=0.1)
    assert chirp.cycles(end, "integral")[0] == pytest.approx(717.0, abs=0.1)
    t = np.linspace(0, 200, 200_001)
    frequency = np.gradient(chirp.cycles(t, "integral"), t)
    assert np.max(np.abs(frequency[1:-1] / chirp.frequency(t)[1:-1] - 1)) < 1e-5


def test_literal_formula_is_refused() -> None:
    # A sin(2 pi f(t) t) sweeps to f + t f' = 488 Hz
    chirp = SigmoidChirp()
    with pytest.raises(ConfigurationError, match="488 Hz"):
        chirp.signal(1000.0, "literal")
    slope = (float(chirp.frequency(np.array(200.0))) - float(chirp.frequency(np.array(199.999)))) / 1e-3
    assert 40.0 + 200.0 * slope == pytest.approx(488.0, abs=1.0)


@pytest.mark.parametrize("wrong", [{"duration_s": -1.0}, {"frequency_min": 50.0}, {"amplitude_min": np.nan}])
def test_chirp_refuses_wrong_settings(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigurationError):
        SigmoidChirp(**wrong)


def test_chirp_refuses_a_rate_that_aliases() -> None:
    with pytest.raises(ConfigurationError, match="twice the highest frequency"):
        SigmoidChirp().signal(60.0)


def test_validation_signals_are_in_their_bands() -> None:
    signals = validation_signals(seed=11)
    for name, low, high, rms in (("V1", 0.5, 10.0, 1e-3), ("V2", 1.0, 30.0, 0.25e-3)):
        t, x = signals[name]
        # fading removes up to a tenth at either end
        assert np.std(x) == pytest.approx(rms, rel=0.1)
        power = np.abs(np.fft.rfft(x)) ** 2
        f = np.fft.rfftfreq(x.size, t[1])
        assert np.sum(power[(f >= 0.9 * low) & (f <= 1.1 * high)]) > 0.999 * np.sum(power)
        assert x[0] == 0.0
    t, x = harmonic_pulse()
    assert 4.5e-3 < np.max(np.abs(x)) <= 5e-3
    assert x[0] == x[-1] == 0.0
    again = band_limited_random(1e-3, 0.5, 10.0, 60.0, 1000.0, 11)[1]
    assert np.array_equal(again, signals["V1"][1])
    with pytest.raises(ConfigurationError):
        band_limited_random(1e-3, 10.0, 5.0, 60.0, 1000.0, 1)
