# Copyright 2026 ride_estimation contributors
"""Frame deformation: noise does not pass, rigid motion is none of it, a saved state continues alike."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import linalg

from ride_estimation.estimation.kinematics.deformation_filter import FilterBank
from ride_estimation.estimation.kinematics.frame_deformation import FrameDeformation
from ride_estimation.frames import skew

DT = 0.002
ARMS = np.array([[0.8, 0.5, -0.5], [0.8, -0.5, -0.5], [-0.8, 0.5, -0.4], [-0.8, -0.5, -0.4]])
WRENCH = np.hstack([np.vstack([np.eye(3), skew(r)]) for r in ARMS])
STIFFNESS, DAMPING = np.full((4, 3), 1e5), np.full((4, 3), 1e3)
SIGMA = 0.01


def known_tilt(maps: np.ndarray) -> SimpleNamespace:
    """Brackets of which is known how they tilt."""
    return SimpleNamespace(maps=maps, spread=np.zeros((1, *maps.shape)))


def make() -> FrameDeformation:
    return FrameDeformation(WRENCH, np.full(4, SIGMA**2), known_tilt(np.zeros((4, 3, 12))), 9.81, ARMS)


def integrate(frame: FrameDeformation, acceleration: np.ndarray) -> np.ndarray:
    still, quiet = np.zeros((10, 4, 3)), np.zeros((10, 3))
    blocks = acceleration.reshape(-1, 10, 4, 3)
    return np.concatenate([frame.observe(b, still, still, quiet, quiet, STIFFNESS, DAMPING, DT)[0] for b in blocks])


def twist(hertz: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Return deflection and acceleration of 1 mm twist that grows from rest within 2 s."""
    time = DT * np.arange(round(seconds / DT))
    sign = np.sign(ARMS[:, 0] * ARMS[:, 1])
    deflection = np.zeros((len(time), 4, 3))
    part = np.clip(time / 2.0, 0.0, 1.0)
    envelope = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    deflection[:, :, 2] = 1e-3 * (envelope * np.sin(2 * np.pi * hertz * time))[:, None] * sign
    return deflection, np.gradient(np.gradient(deflection, DT, axis=0), DT, axis=0)


@pytest.mark.parametrize("seed", [1, 2])
def test_noise_alone_is_shrunk_to_a_rigid_frame(seed: int) -> None:
    noise = np.random.default_rng(seed).normal(0.0, SIGMA, (15000, 4, 3))
    estimate = integrate(make(), noise)[5000:]
    # integrated with a corner of 0.3 Hz the noise would be 0.1 mm; a rigid frame must show less than a fifth of it
    assert np.sqrt(np.mean(estimate**2)) < 2e-5


@pytest.mark.parametrize("hertz", [1.0, 3.0, 8.0])
def test_twist_of_a_millimetre_is_followed(hertz: float) -> None:
    """From 12 s on (a spectrum needs 8 s): within an eighth, and within what the filter says of itself by a factor of two.

    A second-order high-pass at 0.5 Hz, which the noise would ask for, leaves 70 % at 1 Hz, 24 % at 3 Hz and 9 % at 8 Hz.
    """
    deflection, acceleration = twist(hertz, 20.0)
    noise = np.random.default_rng(3).normal(0.0, SIGMA, acceleration.shape)
    frame = make()
    error = (integrate(frame, acceleration + noise) - deflection)[6000:]
    assert np.sqrt(np.mean(error[:, :, 2] ** 2)) < 0.125 * np.sqrt(np.mean(deflection[6000:, :, 2] ** 2))
    stated = np.sqrt(np.diag(frame.covariance()[0])[2::3].mean())
    assert np.sqrt(np.mean(error[:, :, 2] ** 2)) < 2.0 * stated


def test_stated_variance_is_the_error_of_a_random_twist() -> None:
    """Twist with a spectrum of its own: error over stated standard deviation is one within chi-square over 60 s (about 60 free
    values of a 1 Hz process: 0.8 to 1.2) and a factor for the spectrum being estimated from eight seconds.
    """
    rng = np.random.default_rng(12)
    frequency = np.fft.rfftfreq(40000, DT)
    shape = 1.0 / (1.0 + (1.2 / np.maximum(frequency, 1e-3)) ** 4) / (1.0 + (frequency / 20.0) ** 4)
    spectrum = shape * np.exp(2j * np.pi * rng.uniform(size=frequency.size))
    spectrum *= 0.3 / np.std(np.fft.irfft(spectrum))
    acceleration = np.fft.irfft(spectrum)
    value = np.fft.irfft(-spectrum / np.maximum(2 * np.pi * frequency, 1e-2) ** 2)
    sign = np.zeros((4, 3))
    sign[:, 2] = np.sign(ARMS[:, 0] * ARMS[:, 1])
    measured = acceleration[:, None, None] * sign + rng.normal(0.0, SIGMA, (40000, 4, 3))
    frame = make()
    blocks = measured.reshape(-1, 10, 4, 3)
    still, quiet, ratio = np.zeros((10, 4, 3)), np.zeros((10, 3)), []
    for n, block in enumerate(blocks):
        estimate = frame.observe(block, still, still, quiet, quiet, STIFFNESS, DAMPING, DT)[0]
        error = estimate - value[10 * n : 10 * n + 10, None, None] * sign
        ratio.append(np.mean(error[:, :, 2] ** 2) / np.diag(frame.covariance()[0])[2::3].mean())
    assert 0.6 < np.sqrt(np.mean(ratio[1000:])) < 1.4


def test_rigid_motion_is_no_deformation() -> None:
    motion = np.random.default_rng(4).normal(size=(1000, 6))
    estimate = integrate(make(), (motion @ WRENCH).reshape(-1, 4, 3))
    # exact but for rounding
    assert np.abs(estimate).max() < 1e-12


def test_finite_rotation_is_no_deformation() -> None:
    """A rigid roll of 0.1 rad at 1 Hz: the second-order strain comes back, its mean included."""
    time = DT * np.arange(5000)
    angle = 0.1 * np.sin(2 * np.pi * time)
    omega, alpha = 0.2 * np.pi * np.cos(2 * np.pi * time), -((2 * np.pi) ** 2) * angle
    # bracket as seen from the body: R^T r; mount minus bracket in body axes
    y, z = ARMS[:, 1], ARMS[:, 2]
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    zero = np.zeros((5000, 4))
    exact = np.stack([zero, y - (c * y + s * z), z - (c * z - s * y)], axis=-1)
    w, a = omega[:, None], alpha[:, None]
    accel_y = (s * a + c * w**2) * y - (c * a - s * w**2) * z
    accel_z = (s * a + c * w**2) * z + (c * a - s * w**2) * y
    acceleration = np.stack([zero, accel_y, accel_z], axis=-1)
    maps = np.zeros((4, 3, 12))
    maps[:, 0, 2::3] = y / np.sum(y**2)
    frame = FrameDeformation(WRENCH, np.full(4, SIGMA**2), known_tilt(maps), 0.0, ARMS)
    turn, rate = np.column_stack([angle, 0 * angle, 0 * angle]), np.column_stack([omega, 0 * omega, 0 * omega])
    turn, rate, quiet = np.repeat(turn[:, None], 4, axis=1), np.repeat(rate[:, None], 4, axis=1), np.zeros((10, 3))
    estimate = np.concatenate([
        frame.observe(acceleration[i : i + 10], turn[i : i + 10], rate[i : i + 10], quiet, quiet, STIFFNESS, DAMPING, DT)[0]
        for i in range(0, 5000, 10)
    ])
    wanted = (exact.reshape(-1, 12) @ frame.projector.T).reshape(-1, 4, 3)
    # a tenth of the strain: terms of third order and the constant taken as bias
    assert np.abs(estimate - wanted)[2500:].max() < 0.1 * np.abs(wanted).max()


def test_saved_state_continues_alike() -> None:
    _, acceleration = twist(2.0, 8.0)
    acceleration = acceleration + np.random.default_rng(5).normal(0.0, SIGMA, acceleration.shape)
    whole = make()
    expected = integrate(whole, acceleration)[2000:]
    first, second = make(), make()
    integrate(first, acceleration[:2000])
    second.load(json.loads(json.dumps(first.save())))
    assert np.array_equal(integrate(second, acceleration[2000:]), expected)


def test_a_new_time_base_knows_spectrum_and_biases_of_before() -> None:
    """Twist of 3 Hz: four to six seconds after a jump of the clocks within a tenth of it, and of what is stated by a factor of
    two; a filter that knows nothing needs eight seconds for its spectrum and longer for the biases.
    """
    deflection, acceleration = twist(3.0, 26.0)
    acceleration = acceleration + np.random.default_rng(3).normal(0.0, SIGMA, acceleration.shape)
    errors = []
    for start in (FrameDeformation.restart, FrameDeformation.reset):
        frame = make()
        integrate(frame, acceleration[:10000])
        start(frame)
        error = (integrate(frame, acceleration[10000:]) - deflection[10000:])[2000:, :, 2]
        errors.append(np.sqrt(np.mean(error**2)))
        if start is FrameDeformation.restart:
            assert errors[0] < 2.0 * np.sqrt(np.diag(frame.covariance()[0])[2::3].mean())
    assert errors[0] < 0.1 * np.sqrt(np.mean(deflection[12000:, :, 2] ** 2))
    assert errors[0] < 0.5 * errors[1]


@pytest.mark.parametrize("seconds", [2, 12])
def test_slow_error_of_the_acceleration_becomes_what_the_gain_says(seconds: int) -> None:
    """Before (2 s) and after the spectrum of the frame is known: a step held for five times the filter takes."""
    _, acceleration = twist(6.0, seconds + 2.0)
    before, after = np.split(acceleration, [round(seconds / DT)])
    step = np.zeros((4, 3))
    step[:, 2] = np.sign(ARMS[:, 0] * ARMS[:, 1])
    values = []
    for added in (0.0 * step, step):
        frame = make()
        integrate(frame, before)
        frame.learns = False
        values.append(integrate(frame, after + added)[round(1.0 / DT) :, :, 2])
    # the mean that stands for the bias follows meanwhile
    assert np.sqrt(np.mean((values[1] - values[0]) ** 2) / frame.static_gain[2]) == pytest.approx(1.0, abs=0.5)


@pytest.mark.parametrize("index", [0, 10, 333, 747])
def test_bank_knows_what_its_filters_do(index: int) -> None:
    """The transfer functions against the filter that runs, solved at every frequency; white noise against Lyapunov's equation."""
    frequencies, widths = np.geomspace(0.05, 60.0, 40), np.full(40, 0.1)
    bank = FilterBank(frequencies, widths, 25.0)
    transition, old, new = bank.discretised(index, 1e-6)
    # a tick far below every time constant (8 Hz): transition and input over the tick are the system itself within 1e-4
    system, drive = linalg.logm(transition) / 1e-6, (old + new) / 1e-6
    omega = 2.0 * np.pi * frequencies
    states = np.array([np.linalg.solve(1j * w * np.eye(4) - system, drive) for w in omega])
    missed, passed = np.abs(1.0 + omega**2 * states[:, 2]) ** 2, np.abs(omega**2 * states[:, 2]) ** 2
    for line in (0, 15, 30):
        signal, nothing = np.eye(40)[line], np.zeros(40)
        # long after the start
        assert bank.errors(signal, nothing, 0.0, 1e6)[0][index] == pytest.approx(missed[line] * 0.1 / omega[line] ** 4, rel=1e-3)
        assert bank.errors(nothing, signal, 0.0, 1e6)[0][index] == pytest.approx(passed[line] * 0.1 / omega[line] ** 4, rel=1e-3)
    # one-sided density 1 is a two-sided one of a half; the sum from 1e-3 to 3e3 of the corner leaves out less than a per cent
    spread = linalg.solve_continuous_lyapunov(system, -0.5 * np.outer(drive, drive))
    value, rate = (v[index] for v in bank.errors(np.zeros(40), np.zeros(40), 1.0, 1e6))
    assert value == pytest.approx(spread[2, 2], rel=1e-2)
    assert rate == pytest.approx(spread[3, 3], rel=1e-2)


def test_what_a_wrong_sensor_made_of_the_deformation_is_forgotten() -> None:
    """A bracket reads 5 m/s^2 too much for half a second, then is left out: the start anew is a tenth of its trace."""
    deflection, acceleration = (0.1 * part for part in twist(2.0, 18.0))
    begins, ends, judged = (round(t / DT) for t in (15.0, 15.5, 16.5))
    errors = []
    for anew in (False, True):
        frame = make()
        integrate(frame, acceleration[:begins])
        bias = frame.bias
        wrong = acceleration[begins:ends].copy()
        wrong[:, 0, 2] += 5.0
        integrate(frame, wrong)
        if anew:
            frame.undeform(bias)
        error = integrate(frame, acceleration[ends:]) - deflection[ends:]
        errors.append(float(np.abs(error[judged - ends :]).max()))
    assert errors[1] < 0.1 * errors[0]
