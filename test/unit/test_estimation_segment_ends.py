# Copyright 2026 ride_estimation contributors
"""Deformation near the ends of a segment, from its acceleration alone: as near to the truth as stated, nothing new inside."""

from __future__ import annotations

import numpy as np
import pytest

from ride_estimation.estimation.model.segment_ends import Ends, ends_of
from ride_estimation.estimation.model.spectral import Lines

DT, SECONDS, PATTERNS = 0.02, 20.0, 40
LINES = Lines.of(round(SECONDS / DT), DT)
#: standard deviation of the noise of an acceleration [m/s^2] and its unknown mean
NOISE, MEAN = 0.02, 0.3


def spectrum(frequency: np.ndarray) -> np.ndarray:
    """Return the power of a deformation, centimetres at 0.2 to 1.5 Hz, of the transforms of :class:`Lines` [m^2]."""
    return 0.01**2 / (1.0 + (frequency / 1.5) ** 8) / (1.0 + (0.2 / np.maximum(frequency, 1e-9)) ** 4)


@pytest.fixture(scope="module")
def drawn() -> tuple[np.ndarray, np.ndarray, Ends]:
    """Return true deformations, those by the transform, and what changes near the ends."""
    rng = np.random.default_rng(11)
    count = LINES.count
    long = 4 * count  # the part that is seen does not come back to its beginning
    frequency = np.fft.rfftfreq(long, DT)
    power = spectrum(frequency)
    power[frequency > LINES.frequency[-1]] = 0.0
    white = np.fft.rfft(rng.standard_normal((long, PATTERNS)), axis=0)
    z = np.fft.irfft(np.sqrt(power)[:, None] * white, long, axis=0)[count : 2 * count]
    laplace = 2j * np.pi * frequency
    accel = np.fft.irfft((laplace**2 * np.sqrt(power))[:, None] * white, long, axis=0)[count : 2 * count]
    seen = LINES.transform(accel + MEAN + NOISE * rng.standard_normal(z.shape))
    square = np.abs(LINES.laplace) ** 2
    true = np.tile((spectrum(LINES.frequency) * square**2)[:, None], PATTERNS)
    noise = np.full(true.shape, NOISE**2)
    smoothed = true / (true + noise) * seen
    value, rate = LINES.back(-smoothed / square[:, None]), LINES.back(smoothed / LINES.laplace[:, None])
    return z, value, ends_of(LINES, seen, true, noise, value, rate)


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def test_the_ends_are_nearer_to_the_truth_than_by_the_transform(drawn: tuple[np.ndarray, np.ndarray, Ends]) -> None:
    z, value, ends = drawn
    for side in (slice(0, 100), slice(-100, None)):  # two seconds
        assert rms((value + ends.value - z)[side]) < 0.5 * rms((value - z)[side])


def test_they_err_as_is_stated_at_both_ends(drawn: tuple[np.ndarray, np.ndarray, Ends]) -> None:
    z, value, ends = drawn
    error = value + ends.value - z
    inside = np.var(error[400:600])
    for side in (slice(0, 25), slice(25, 75), slice(-75, -25), slice(-25, None)):
        stated = np.sqrt(inside + np.mean(ends.variance[side]))
        # forty draws that hardly change within the part: 11 % standard deviation
        assert rms(error[side]) == pytest.approx(stated, rel=0.35), side


def test_the_rate_is_the_derivative_of_the_value(drawn: tuple[np.ndarray, np.ndarray, Ends]) -> None:
    _, value, ends = drawn
    straight = np.gradient(value + ends.value, DT, axis=0)
    own = LINES.back(LINES.laplace[:, None] * LINES.transform(value)) + ends.rate
    for side in (slice(1, 200), slice(-200, -1)):
        assert rms((straight - own)[side]) < 0.05 * rms(straight[side])


def test_nothing_changes_inside(drawn: tuple[np.ndarray, np.ndarray, Ends]) -> None:
    _, _, ends = drawn
    inside = slice(round(6.0 / DT), round((SECONDS - 6.0) / DT))
    for values in (ends.value, ends.rate, ends.variance):
        assert not np.any(values[inside]) and np.any(values[:50]) and np.any(values[-50:])


def test_a_segment_shorter_than_both_ends_reach_is_shared_between_them() -> None:
    lines = Lines.of(250, DT)  # five seconds
    power = np.abs(lines.laplace)[:, None] ** 4 * spectrum(lines.frequency)[:, None]
    seen = lines.transform(0.1 * np.random.default_rng(3).standard_normal((250, 1)))
    nothing = np.zeros((250, 1))
    found = ends_of(lines, seen, power, np.full(power.shape, NOISE**2), nothing, nothing)
    assert np.isfinite(found.value).all() and np.abs(found.value).max() < 0.1
    assert np.abs(found.value[124:126]).max() < 0.02 * np.abs(found.value).max()  # the middle is that of the transform
