# Copyright 2026 ride_estimation contributors
"""Weightings against the tables of ISO 2631-1:1997 and the derived values against hand calculation."""

import csv
import math
import os
from pathlib import Path

import numpy as np
import pytest

from ride_estimation.assessment import ride_comfort as rc
from ride_estimation.errors import InputDataError

# ISO 2631-1:1997 Table 3, factor x 1000 at nominal third-octave centres [Hz] (Wd at 10 Hz is misprinted there and left out)
TABLE = {
    "Wk": {1.0: 482, 2.0: 531, 4.0: 967, 8.0: 1036, 16.0: 768, 31.5: 405, 63.0: 186, 80.0: 132},
    "Wd": {1.0: 1011, 2.0: 890, 4.0: 512, 8.0: 253, 16.0: 125, 31.5: 63.2, 63.0: 29.5},
}


@pytest.mark.parametrize("name", TABLE)
def test_analogue_weighting_matches_the_printed_table(name):
    for frequency, factor in TABLE[name].items():
        assert 1000 * rc.WEIGHTINGS[name].gain(frequency) == pytest.approx(factor, rel=0.01)  # rounding of centres and table


@pytest.mark.parametrize("name", sorted(rc.WEIGHTINGS))
def test_digital_weighting_follows_the_analogue_one_in_the_ride_band(name):
    rate = 1000.0
    for frequency in (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 31.5):
        t = np.arange(0, 20 + 20 / frequency, 1 / rate)
        w = rc.WeightedSignal(name, rate).feed(np.sin(2 * np.pi * frequency * t))
        tail = w[-int(round(8 / frequency) * rate) :]
        gain = math.sqrt(2 * np.mean(tail**2))
        exact = float(rc.WEIGHTINGS[name].gain(frequency))
        assert gain == pytest.approx(exact, rel=0.02)  # 0.17 dB, bilinear error at 31.5 of 1000 Hz is 0.1 dB


def test_chunks_equal_one_pass_to_the_last_bit():
    y = np.random.default_rng(1).standard_normal(5000)
    whole = rc.WeightedSignal("Wk", 500.0).feed(y)
    stream = rc.WeightedSignal("Wk", 500.0)
    assert np.array_equal(np.concatenate([stream.feed(part) for part in np.array_split(y, 37)]), whole)


def test_exposure_of_a_vertical_sine_by_hand():
    rate, amplitude, frequency = 1000.0, 1.0, 5.0
    t = np.arange(0, 60, 1 / rate)
    a = np.zeros((t.size, 3))
    a[:, 2] = amplitude * np.sin(2 * np.pi * frequency * t)
    result = rc.assess(a, rate, 4 * 3600.0, "seat")
    aw = amplitude / math.sqrt(2) * float(rc.WEIGHTINGS["Wk"].gain(frequency))
    assert result.axes[2].weighted_rms == pytest.approx(aw, rel=0.005)
    assert result.a8 == pytest.approx(aw / math.sqrt(2), rel=0.005)  # half of eight hours
    assert result.axes[2].vibration_dose == pytest.approx(aw * (1.5 * 60) ** 0.25, rel=0.01)  # rms quad of a sine is 1.5 aw^4
    assert result.minutes_to_action == pytest.approx(480 * (0.5 / aw) ** 2, rel=0.01)
    assert result.axes[2].crest_factor == pytest.approx(math.sqrt(2), rel=0.1)
    assert result.location == "seat"


def test_the_dominant_axis_carries_the_horizontal_factor():
    rate = 500.0
    t = np.arange(0, 30, 1 / rate)
    a = np.zeros((t.size, 3))
    a[:, 0] = np.sin(2 * np.pi * 1.0 * t)
    result = rc.assess(a, rate, rc.EXPOSURE_REFERENCE_S, "cab floor")
    assert result.a8 == pytest.approx(1.4 * result.axes[0].weighted_rms, rel=1e-12)
    assert result.vector_sum == pytest.approx(result.axes[0].weighted_rms, rel=1e-9)


def test_rates_below_400_hz_and_bad_shapes_are_refused():
    with pytest.raises(InputDataError, match="at least 400 Hz"):
        rc.WeightedSignal("Wk", 250.0)
    with pytest.raises(InputDataError, match="triaxial"):
        rc.assess(np.zeros((2000, 2)), 500.0, 3600.0, "seat")
    with pytest.raises(InputDataError, match="60 Hz"):
        rc.assess(np.zeros((2000, 3)), 50.0, 3600.0, "seat")
    with pytest.raises(InputDataError, match="one second"):
        rc.assess(np.zeros((100, 3)), 500.0, 3600.0, "seat")
    with pytest.raises(InputDataError, match="86400"):
        rc.assess(np.zeros((2000, 3)), 500.0, 1e6, "seat")
    with pytest.raises(InputDataError, match="not finite"):
        rc.assess(np.full((2000, 3), np.nan), 500.0, 3600.0, "seat")
    with pytest.raises(InputDataError, match="Wx"):
        rc.WeightedSignal("Wx", 500.0)


@pytest.mark.parametrize("rate", [150.0, 500.0])
@pytest.mark.parametrize("chunk", [1, 333])
def test_the_meter_gives_the_same_bits_in_chunks(rate, chunk):
    a = np.random.default_rng(2).standard_normal((700, 3)) + np.array([0.0, 0.3, 9.81])
    meter = rc.ComfortMeter(rate, "seat")
    for i in range(0, len(a), chunk):
        meter.feed(a[i : i + chunk])
    assert meter.exposure(3600.0) == rc.assess(a, rate, 3600.0, "seat")


@pytest.mark.parametrize("rate", [100.0, 200.0, 333.0])
def test_slow_records_are_interpolated(rate):
    t = np.arange(0, 60, 1 / rate)
    a = np.zeros((t.size, 3))
    a[:, 2] = 9.81 + np.sin(2 * np.pi * 0.3 * rate * t)
    a[:, 0] = np.sin(2 * np.pi * 2.0 * t)
    result = rc.assess(a, rate, 3600.0, "cab floor")
    # 0.12 dB of the bilinear transform at 80 Hz, as much for the ripple of the interpolation (60 dB) and the ends
    for axis, name, frequency in ((2, "Wk", 0.3 * rate), (0, "Wd", 2.0)):
        expected = float(rc.WEIGHTINGS[name].gain(frequency)) / math.sqrt(2)
        assert result.axes[axis].weighted_rms == pytest.approx(expected, rel=0.03)
    assert result.highest_hz == pytest.approx(0.4 * rate)


# 60 dB of image suppression leave 10 mm/s^2 of gravity at 500 Hz, the weighting hardly 1 % of that
@pytest.mark.parametrize(("rate", "bound"), [(1000.0, 1e-9), (500.0, 1e-3)])
def test_gravity_starts_no_transient(rate, bound):
    a = np.tile([0.0, 0.0, 9.81], (1500, 1))
    assert rc.assess(a, rate, 3600.0, "seat").axes[2].vibration_dose < bound


def test_notes_say_what_limits_the_numbers():
    rng = np.random.default_rng(0)
    a = rng.standard_normal((3000, 3))
    a[1500] *= 500.0
    floor = " ".join(rc.assess(a, 100.0, 3600.0, "cab floor").notes())
    assert "floor, not seat" in floor and "crest factor" in floor and "above 40 Hz" in floor and "30 s" in floor
    assert rc.assess(rng.standard_normal((90_000, 3)), 450.0, 3600.0, "driver seat").notes() == ()


def test_minutes_to_the_dose_values():
    rate = 500.0
    t = np.arange(0, 40, 1 / rate)
    a = np.zeros((t.size, 3))
    a[:, 2] = 2.0 * np.sin(2 * np.pi * 6.0 * t)
    result = rc.assess(a, rate, rc.EXPOSURE_REFERENCE_S, "seat")
    # VDV of that many minutes of the same vibration is the value itself
    for minutes, value in ((result.dose_minutes_to_action, 9.1), (result.dose_minutes_to_limit, 21.0)):
        assert result.dose * (60 * minutes / rc.EXPOSURE_REFERENCE_S) ** 0.25 == pytest.approx(value, rel=1e-9)
    assert result.dose == pytest.approx(result.axes[2].vibration_dose * (28800 / 40) ** 0.25, rel=1e-12)


# phonometry 3.3.0 (MIT), an independent implementation of ISO 8041-1 in the frequency domain; it needs Python 3.13, so its
# numbers are kept here
FREQUENCIES = [0.5, 1, 2, 4, 6.3, 8, 12.5, 16, 31.5, 63, 80]
PHONOMETRY = {
    "Wk": [0.418246, 0.482473, 0.531411, 0.967181, 1.05438, 1.03637, 0.902309, 0.768699, 0.404751, 0.186082, 0.132372],
    "Wd": [0.852821, 1.01102, 0.890243, 0.511912, 0.323121, 0.253125, 0.160896, 0.125408, 0.0632423, 0.029514, 0.0210599],
    "Wc": [0.843053, 0.990991, 1.01172, 1.02382, 0.974277, 0.890934, 0.646615, 0.51177, 0.255974, 0.118465, 0.084424],
    "We": [0.862381, 0.879765, 0.511529, 0.253118, 0.159623, 0.125446, 0.080111, 0.0625375, 0.0315985, 0.0147543, 0.0105288],
    "Wj": [0.41705, 0.4844, 0.48191, 0.628088, 0.946256, 1.017, 1.02624, 1.01835, 1.00057, 0.930777, 0.84301],
}
# a_w, VDV, MTVV and crest factor of three sines with a shock, faded in and out
PHONOMETRY_SIGNAL = {
    "Wk": (0.36815472215658673, 2.0815896951266986, 1.1877868976930295, 13.407723212517372),
    "Wd": (0.4294520391585774, 1.4787302115870196, 0.9503266642148405, 4.5082036761088915),
}


@pytest.mark.parametrize("name", sorted(PHONOMETRY))
def test_weightings_agree_with_an_independent_implementation(name):
    assert rc.WEIGHTINGS[name].gain(FREQUENCIES) == pytest.approx(PHONOMETRY[name], rel=1e-5)  # six digits were kept


# the bilinear transform at 17 Hz of 1 kHz; interpolation from 200 Hz has a ripple of 0.1 %
@pytest.mark.parametrize(("step", "tolerance"), [(1, 2e-4), (5, 1e-3)])
def test_values_of_a_signal_agree_with_an_independent_implementation(step, tolerance):
    t = np.arange(0, 40, 1e-3)
    y = np.sin(2 * np.pi * 1.7 * t) + 0.5 * np.sin(2 * np.pi * 6.3 * t) + 0.3 * np.sin(2 * np.pi * 17 * t)
    y = (y + 6 * np.exp(-(((t - 20) / 0.05) ** 2)) * np.sin(2 * np.pi * 5 * (t - 20))) * np.sin(np.pi * t / 40) ** 2
    axes = rc.assess(np.column_stack([y, y, y])[::step], 1000.0 / step, 3600.0, "seat").axes
    for axis, name in ((axes[2], "Wk"), (axes[0], "Wd")):
        found = (axis.weighted_rms, axis.vibration_dose, axis.maximum_transient, axis.crest_factor)
        assert found == pytest.approx(PHONOMETRY_SIGNAL[name], rel=tolerance)


def test_weightings_agree_with_a_public_table_where_it_is_present():
    root = Path(os.environ.get("RIDE_ESTIMATION_REAL_DATA", Path(__file__).parents[2].parent / "shared" / "data"))
    path = root / "iso2631_weighting_tables" / "iso-2631-filter-01.csv"
    if not path.is_file():
        pytest.skip("public weighting table not present (RIDE_ESTIMATION_REAL_DATA)")
    compared = 0
    with path.open(newline="") as stream:
        for row in csv.DictReader(stream):
            frequency = float(row["frequency_hz"])
            exact = 10 ** (round(10 * math.log10(frequency)) / 10)
            for column, name in (("vertical_acceleration_z", "Wk"), ("translational_acceleration_xy", "Wd")):
                value = float(row[column])
                misprint = name == "Wd" and round(frequency) in (2, 10)
                if 0.5 <= frequency <= 100 and value > 0 and not misprint:
                    assert 1000 * rc.WEIGHTINGS[name].gain(exact) == pytest.approx(value, rel=0.02)
                    compared += 1
    assert compared > 40
