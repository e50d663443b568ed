# Copyright 2026 ride_estimation contributors
"""Roads, obstacles, engine lines and driving against their defining equations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from ride_estimation.errors import ConfigurationError
from ride_estimation.excitation.driving import lane_change, speed_profile, travelled, wheelbase_delay
from ride_estimation.excitation.engine import crank_angle, order_lines
from ride_estimation.excitation.obstacles import belgian_pave, block, cosine_bump, rolled_envelope, wheel_over_block
from ride_estimation.excitation.road import CLASS_ROUGHNESS, Road, coherence, flat_road, iso_spectrum, random_road

BANDS = [(0.02, 0.06), (0.06, 0.3), (0.3, 1.0), (1.0, 2.83)]  # 1/m


@pytest.mark.parametrize(("roughness", "waviness"), [(CLASS_ROUGHNESS["A"], 2.0), (96e-6, 2.3), (140e-6, 2.5)])
def test_road_has_the_iso_spectrum_in_every_band(roughness, waviness):
    ratios = []
    for seed in range(4):
        road = random_road(8000.0, seed, roughness=roughness, waviness=waviness, spacing=0.1)
        for track in (road.left, road.right):
            n, spectrum = signal.welch(track, fs=10.0, nperseg=8192)
            ratios.append([np.mean(spectrum[s] / iso_spectrum(n[s], roughness, waviness)) for s in _inside(n)])
    np.testing.assert_allclose(np.mean(ratios, axis=0), 1.0, atol=0.06)  # 6 %: eight tracks of 8 km


def _inside(n):
    return [(n > a) & (n < b) for a, b in BANDS]


def test_tracks_are_coherent_for_long_waves_only():
    road = random_road(30000.0, 5, roughness=CLASS_ROUGHNESS["C"], spacing=0.1)
    n, cross = signal.csd(road.left, road.right, fs=10.0, nperseg=8192)
    _, own = signal.welch(road.left, fs=10.0, nperseg=8192)
    for s in _inside(n):
        assert np.mean(cross[s].real / own[s]) == pytest.approx(np.mean(coherence(n[s])), abs=0.05)
    equal = random_road(200.0, 5, roughness=1e-6, coherence_length=0.0)
    np.testing.assert_array_equal(equal.left, equal.right)


def test_classes_differ_by_a_factor_of_four_and_seeds_repeat():
    values = list(CLASS_ROUGHNESS.values())
    np.testing.assert_allclose(np.divide(values[1:], values[:-1]), 4.0)
    assert CLASS_ROUGHNESS["C"] == pytest.approx(256e-6)
    first, again, other = (random_road(50.0, seed, roughness=1e-5) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.left, again.left)
    assert np.abs(first.left - other.left).max() > 1e-4


def test_rear_axle_meets_the_road_one_wheelbase_later():
    road = random_road(200.0, 1, roughness=1e-5, start=-10.0)
    speed, wheelbase, rate = 12.5, 4.0, 1000.0
    time = np.arange(int(5 * rate)) / rate
    front, rear = road.heights(speed * time), road.heights(speed * time - wheelbase)
    delay = round(wheelbase_delay(wheelbase, speed) * rate)
    assert delay == 320
    np.testing.assert_allclose(rear[delay:], front[:-delay], atol=1e-12)


def test_leaving_the_road_is_refused_with_its_limits():
    with pytest.raises(ConfigurationError, match=r"covers 0\.0 to 20\.0 m"):
        flat_road(20.0).heights(np.array([5.0, 25.0]))


def test_tyre_patch_averages_short_waves_away_and_keeps_long_ones():
    s = np.arange(5000) * 0.02
    road = Road(0.02, np.sin(2 * np.pi * s / 0.26), np.sin(2 * np.pi * s / 20.0))
    smooth = road.smoothed(0.26)
    assert np.abs(smooth.left[50:-50]).max() < 0.02
    np.testing.assert_allclose(smooth.right[50:-50], road.right[50:-50], atol=2e-3)


def test_wheel_over_the_block_of_document_002_takes_half_a_second():
    speed = 5.0 / 3.6
    time = np.arange(0.0, 2.0, 1e-4)
    path = wheel_over_block(speed * time, 1.0, 0.1, 0.1, 0.5)
    raised = time[path > 1e-9]
    assert raised[-1] - raised[0] == pytest.approx(0.504, abs=0.001)  # s, document 002 with R = 0.5 m
    first_top = time[np.argmax(path >= 0.1 - 1e-12)]
    assert first_top - raised[0] == pytest.approx(0.216, abs=0.001)  # s of rise
    assert path.max() == pytest.approx(0.1, abs=1e-12)


def test_envelope_of_any_profile_equals_the_closed_form_over_a_block():
    s = np.arange(0.0, 3.0, 0.001)
    numeric = rolled_envelope(block(s, 1.0, 0.1, 0.1), 0.001, 0.5)
    np.testing.assert_allclose(numeric, wheel_over_block(s, 1.0, 0.1, 0.1, 0.5), atol=2e-3)  # m: grid of 1 mm on a steep flank


def test_a_block_higher_than_the_wheel_is_refused():
    with pytest.raises(ConfigurationError, match=r"height 0\.6 m; allowed: less than the wheel radius 0\.5 m"):
        wheel_over_block(np.zeros(3), 0.0, 0.1, 0.6, 0.5)


def test_bump_begins_and_ends_without_a_kink():
    s = np.arange(0.0, 3.0, 0.001)
    bump = cosine_bump(s, 1.0, 1.2, 0.08)
    assert bump.max() == pytest.approx(0.08, abs=1e-6)
    assert np.abs(np.diff(bump)).max() < 0.08 * np.pi / 1.2 * 0.001 * 1.01
    assert not np.any(bump[(s < 1.0) | (s > 2.2)])


def test_cobbles_have_the_asked_height_and_stone_length():
    s = np.arange(0.0, 400.0, 0.005)
    track = belgian_pave(s, 1, stone=0.13, height_std=0.008)
    tops = track - np.mean(track)
    assert np.std(tops) == pytest.approx(0.008, rel=0.15)  # m; the joints add a little
    changes = np.count_nonzero(np.diff(np.round(signal.medfilt(track, 5), 4)) != 0)
    assert changes > 400.0 / 0.13  # at least one change per stone


def test_order_lines_stand_at_multiples_of_the_engine_speed():
    time = np.arange(20000) / 1000.0
    angle = crank_angle(time, 10.0)  # 600 rpm
    line = order_lines(angle, {3.0: 0.5, 1.5: 0.1})
    frequency, power = signal.periodogram(line, fs=1000.0, window="flattop", scaling="spectrum")
    for f, amplitude in ((30.0, 0.5), (15.0, 0.1)):
        assert np.sqrt(2.0 * power[np.argmin(np.abs(frequency - f))]) == pytest.approx(amplitude, rel=0.01)
    swept = crank_angle(time, np.linspace(10.0, 20.0, len(time)))
    assert swept[-1] / (2.0 * np.pi) == pytest.approx(15.0 * time[-1], rel=1e-9)  # turns


def test_speed_profile_keeps_plateaus_and_distance():
    time = np.arange(0.0, 30.0, 0.01)
    speed = speed_profile(time, [(0.0, 0.0), (10.0, 0.0), (20.0, 15.0)])
    assert speed[0] == 0.0 and speed[-1] == pytest.approx(15.0)
    assert np.abs(np.diff(speed)).max() <= 15.0 / 10.0 * 0.01 * 1.001
    assert travelled(time, speed)[-1] == pytest.approx(15.0 * 10.0 / 2.0 + 15.0 * (time[-1] - 20.0), rel=1e-3)
    with pytest.raises(ConfigurationError, match="increasing times"):
        speed_profile(time, [(5.0, 1.0), (5.0, 2.0)])


def test_lane_change_ends_at_the_same_heading():
    time = np.arange(0.0, 10.0, 0.001)
    a = lane_change(time, 2.0, 4.0, 1.5)
    assert a.max() == pytest.approx(1.5, rel=1e-5)
    assert abs(np.sum(a) * 0.001) < 1e-9  # m/s of lateral speed left
