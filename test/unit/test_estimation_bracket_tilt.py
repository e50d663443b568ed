# Copyright 2026 ride_estimation contributors
"""Tilt of brackets: shares of a synthetic frame come back with honest doubt, a rig that only translates is noticed."""

from __future__ import annotations

import dataclasses
import json
import pathlib

import numpy as np
import pytest
from scipy import signal
from worlds.adapters import START_NS, arrivals, believed_vehicle
from worlds.cab import drive, measure, random_sensors, random_vehicle
from worlds.roads import Road

from ride_estimation.estimation.common.geometry import USUAL_SHARES, geometry_of
from ride_estimation.estimation.kinematics.bracket_tilt import _PRIOR_STD, BracketTilt
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.vehicle_file import load_vehicle

VEHICLE = pathlib.Path(__file__).parents[2] / "config/vehicles/truck_cab.yaml"
RATE, GRAVITY, NOISE = 200.0, 9.80665, 0.02
ALL = np.ones(100, dtype=bool)


def band(rng: np.random.Generator, size: int, low: float, high: float, rms: float) -> np.ndarray:
    """Band-limited angle and its second derivative, shape (2, size)."""
    f = np.fft.rfftfreq(size, 1.0 / RATE)
    spectrum = np.where((f > low) & (f < high), 1.0 / np.maximum(f, low) ** 2, 0.0) * np.exp(2j * np.pi * rng.random(f.size))
    angle = np.fft.irfft(spectrum, size)
    scale = rms / np.std(angle)
    return scale * np.stack([angle, np.fft.irfft(-((2 * np.pi * f) ** 2) * spectrum, size)])


def readings(shares: tuple[float, ...], seed: int, seconds: float = 60.0) -> tuple[np.ndarray, np.ndarray]:
    """Specific force of brackets and body (K, 4, 3): frame angles, twist, relative rotation, sideways motion, noise."""
    rng = np.random.default_rng(seed)
    size = round(seconds * RATE)
    place = np.array([m.position[:2] for m in load_vehicle(VEHICLE).mounts.values()])
    x, y = (place - place.mean(axis=0)).T
    (w, w2), (phi, phi2), (theta, theta2) = (band(rng, size, 0.3, 8.0, a)[:, :, None] for a in (0.003, 0.005, 0.004))
    (rel, rel2), (rel_p, rel_p2) = (band(rng, size, 0.5, 4.0, a)[:, :, None] for a in (0.003, 0.003))
    side, fore = (band(rng, size, 0.5, 20.0, 1e-3)[1][:, None] for _ in range(2))
    s_r, c_r, s_p, c_p, l_r, l_p = shares
    base, body = np.zeros((size, 4, 3)), np.zeros((size, 4, 3))
    base[:, :, 2] = GRAVITY + w2 * x * y + phi2 * y - theta2 * x
    body[:, :, 2] = GRAVITY + (phi2 - rel2) * y - (theta2 - rel_p2) * x
    base[:, :, 1] = side - 0.4 * phi2 + GRAVITY * ((1 - l_r) * phi + w * (s_r * x + c_r))
    base[:, :, 0] = fore + 0.4 * theta2 - GRAVITY * ((1 - l_p) * theta - w * (s_p * y + c_p))
    body[:, :, 1] = side - 0.4 * phi2 + GRAVITY * (phi - rel)
    body[:, :, 0] = fore + 0.4 * theta2 - GRAVITY * (theta - rel_p)
    return base + NOISE * rng.standard_normal(base.shape), body + rigid_noise(rng, size)


def rigid_noise(rng: np.random.Generator, size: int) -> np.ndarray:
    """What the noise of four accelerometers makes of the motion of a rigid body, at the mounts (K, 4, 3)."""
    place = np.array([m.position[:2] for m in load_vehicle(VEHICLE).mounts.values()])
    plane = np.column_stack([np.ones(4), place - place.mean(axis=0)])
    noise = NOISE * rng.standard_normal((size, 4, 3))
    whole = np.repeat(noise.mean(axis=1, keepdims=True), 4, axis=1)
    whole[:, :, 2] = noise[:, :, 2] @ (plane @ np.linalg.pinv(plane))
    return whole


def learned(base: np.ndarray, body: np.ndarray, block: int = 100) -> BracketTilt:
    """Feed readings in blocks."""
    tilt = BracketTilt(geometry_of(load_vehicle(VEHICLE)))
    for k in range(0, len(base), block):
        part = slice(k, k + block)
        tilt.observe(base[part], body[part], np.ones((len(base[part]), 4), dtype=bool), 1.0 / RATE)
    return tilt


@pytest.mark.parametrize(
    ("shares", "seed"),
    [((1.0, 0.0, 0.0, 0.0, 0.0, 0.0), 1), ((0.0, 0.1, 1.0, -0.1, 0.0, 0.0), 2), ((0.4, 0.0, 0.4, 0.0, 1.0, 1.0), 3)],
)
def test_shares_come_back_within_three_standard_deviations(shares, seed):
    tilt = learned(*readings(shares, seed))
    std = np.sqrt(np.diag(tilt.covariance))
    assert np.all(np.abs(tilt.shares - shares) < 3.0 * std)
    assert np.all(std < 0.5 * _PRIOR_STD), "the readings tell more than the prior"


def test_a_rig_that_only_translates_is_said_and_a_frame_that_tilts_is_not():
    assert "only translates" in learned(*readings((0.0, 0.0, 0.0, 0.0, 1.0, 1.0), 4)).notes()[0]
    assert learned(*readings((1.0, 0.0, 1.0, 0.0, 0.0, 0.0), 5)).notes() == []


def test_a_body_that_sways_as_its_frame_pitches_is_no_levelled_bracket():
    """A body that gravity drives along on its mounts, with a resonance at the upper end of the band."""
    base, body = readings((1.0, 0.0, 0.0, 0.0, 0.0, 0.0), 1, 120.0)
    x = np.array([m.position[0] for m in load_vehicle(VEHICLE).mounts.values()])
    x -= x.mean()
    pitch = np.fft.rfft(-(base[:, :, 2] - GRAVITY) @ x / np.sum(x**2))
    s, resonance = 2j * np.pi * np.fft.rfftfreq(len(base), 1.0 / RATE), 2.0 * np.pi * 1.5
    body[:, :, 0] += np.fft.irfft(GRAVITY * pitch / (s**2 + 0.2 * resonance * s + resonance**2), len(base))[:, None]
    # with a band of two poles only the share is 0.09
    assert abs(learned(base, body).shares[5]) < 0.03


def test_a_share_nearer_to_none_than_to_all_levels_no_bracket_however_often_it_is_seen():
    """What sensors and a drive that is played again and again leave in the share does not average out, its stated error does."""
    tilt = learned(*readings((1.0, 0.0, 1.0, 0.0, 0.4, 0.4), 9, 240.0))
    std = np.sqrt(np.diag(tilt.covariance))[4:]
    assert np.all(tilt.shares[4:] > 4.0 * std), "sure of it"
    assert not tilt.levelled.any()


def test_after_a_restart_the_rotation_of_a_translating_rig_starts_from_what_its_sensors_read_at_rest():
    level, body = readings((0.0, 0.0, 0.0, 0.0, 1.0, 1.0), 6)
    level[:, :, 2] += [0.1, -0.05, 0.0, 0.05]
    tilt = learned(level, body)
    found = [np.zeros((0, 3))]
    for k in range(0, len(level), 100):
        if k == len(level) // 2:
            tilt.restart()
        found.append(tilt.frame_turn(level[k : k + 100], ALL, 1.0 / RATE)[0])
    angle = np.abs(np.concatenate(found))
    half = len(level) // 2
    # the true rotation comes to 0.02; its rate at the restart is open. With the mean of the first moments 0.15
    assert angle[half:].max() < 0.06


def test_brackets_of_a_translating_rig_do_not_follow_the_rotation_of_the_frame():
    level, body = readings((0.0, 0.0, 0.0, 0.0, 1.0, 1.0), 6)
    tilting, _ = readings((0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 6)
    tilt = learned(level, body)
    tilt.restart()
    blocks = [tilt.frame_turn(level[k : k + 100], ALL, 1.0 / RATE) for k in range(0, len(level), 100)]
    angle, rate = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    # what tilting brackets would read of gravity: g phi in y, -g theta in x, the same at every bracket
    gravity = (tilting - level).mean(axis=1)
    expected = np.column_stack([gravity[:, 1], -gravity[:, 0], np.zeros(len(level))]) / GRAVITY
    late = slice(round(20 * RATE), None)
    # slower parts are drift of the integration, which no estimate of a deflection uses
    fast = signal.butter(4, 0.25, "highpass", fs=RATE, output="sos")
    left, whole = (np.std(signal.sosfiltfilt(fast, a, axis=0)[late, :2]) for a in (angle - expected, expected))
    # what is left: leak of the integration at 0.3 Hz (2 * 7.6 degrees), share off by its standard deviation
    assert left < 0.3 * whole
    slope = np.gradient(angle, 1.0 / RATE, axis=0)
    assert np.std((rate - slope)[late, :2]) < 0.02 * np.std(slope[late, :2])


def test_without_excitation_the_prior_stays_and_a_tilting_frame_is_left_alone():
    rng = np.random.default_rng(7)
    still = GRAVITY * np.array([0.0, 0.0, 1.0]) + NOISE * rng.standard_normal((12000, 4, 3))
    tilt = learned(still, GRAVITY * np.array([0.0, 0.0, 1.0]) + rigid_noise(rng, 12000))
    assert np.all(np.abs(tilt.shares[:4] - USUAL_SHARES) < 3.0 * np.sqrt(np.diag(tilt.covariance)[:4]))
    assert not tilt.levelled.any() and not np.any(tilt.frame_turn(still[:100], ALL, 1.0 / RATE))


def test_a_saved_state_continues_alike():
    base, body = readings((0.5, 0.0, 0.5, 0.0, 1.0, 1.0), 8, 40.0)
    whole, first = learned(base, body), learned(base[:4000], body[:4000])
    second = BracketTilt(geometry_of(load_vehicle(VEHICLE)))
    second.load(json.loads(json.dumps(first.save())))
    for k in range(4000, len(base), 100):
        second.observe(base[k : k + 100], body[k : k + 100], np.ones((100, 4), dtype=bool), 1.0 / RATE)
    assert np.array_equal(second.shares, whole.shares)


@pytest.mark.slow
@pytest.mark.parametrize(("follow", "seed"), [((0.0, 0.0), 1501), ((0.2, 0.9), 1502)])
def test_a_frame_in_an_independent_world_is_learned_and_its_forces_are_honest(follow, seed):
    rng = np.random.default_rng(seed)
    cab = random_vehicle(rng, "air")
    road = dataclasses.replace(Road.random(rng), follow=follow)
    data = measure(drive(cab, road, 40.0, seed), random_sensors(cab, rng), 200.0, seed, noise_share=0.01)
    pipeline = Pipeline(believed_vehicle(data, seed=seed))
    blocks = [out for stamp, name, values in arrivals(data) for out in pipeline.observe(name, stamp, values)]
    blocks += pipeline.finish()
    tilt = pipeline._tilting
    assert np.all(np.abs(tilt.shares[[0, 2]] - follow) < 3.5 * np.sqrt(np.diag(tilt.covariance)[[0, 2]]))
    stamp = np.concatenate([b.stamp_ns for b in blocks])
    row = np.round((stamp - START_NS) * 1e-9 * data.rate_hz).astype(int)
    good = (row > 20 * data.rate_hz) & (row < len(data.time))
    force, std = (np.concatenate([getattr(b, n) for b in blocks])[good] for n in ("mount_force", "mount_force_std"))
    inside = np.abs(force - data.truth["mount_force"][row[good]]) < 2.0 * std
    assert inside.mean(axis=(0, 1)).min() > 0.9
