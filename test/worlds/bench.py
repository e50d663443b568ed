# Copyright 2026 ride_estimation contributors
"""Displacement-controlled bench record of one mount with foreign laws: deflection in, force out."""

from __future__ import annotations

import dataclasses

import numpy as np

from worlds.compiled import compiled
from worlds.laws import MEMORY, PARAMETERS, law_force


@compiled
def _record(h, x, v, k, c, codes, lawp):
    mem, trial = np.zeros((len(codes), MEMORY)), np.zeros((len(codes), MEMORY))
    out = np.empty(len(x))
    for i in range(len(x)):
        f = k * x[i] + c * v[i]
        for n in range(len(codes)):
            f += law_force(codes[n], lawp[n], mem[n], x[i], v[i], h if i > 0 else 0.0, trial[n])
        mem[:] = trial
        out[i] = f
    return out


@dataclasses.dataclass(frozen=True)
class BenchRecord:
    """Measured-like record: time [s], deflection [m], force [N] with noise; ``clean_force`` without."""

    time: np.ndarray
    deflection: np.ndarray
    force: np.ndarray
    clean_force: np.ndarray


def mount_force(
    time: np.ndarray,
    x: np.ndarray,
    v: np.ndarray,
    stiffness: float,
    damping: float,
    laws: tuple[tuple[int, tuple[float, ...]], ...] = (),
) -> np.ndarray:
    """Return the force of a mount over a deflection and its exact rate."""
    codes = np.array([code for code, _ in laws] or [0], np.int64)
    lawp = np.zeros((len(codes), PARAMETERS))
    for n, (_, parameters) in enumerate(laws):
        lawp[n, : len(parameters)] = parameters
    return _record(float(time[1] - time[0]), x, v, stiffness, damping, codes, lawp)


def sweep(
    amplitudes: tuple[float, ...], frequencies: tuple[float, ...], cycles: int = 4, step: float = 2.5e-4
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, deflection and rate of sine blocks with smooth ends, every amplitude at every frequency."""
    parts_x, parts_v = [np.zeros(round(0.2 / step))], [np.zeros(round(0.2 / step))]
    for amplitude in amplitudes:
        for f in frequencies:
            t = np.arange(round(cycles / f / step)) * step
            edge = np.clip(np.minimum(t, t[-1] - t) * f, 0.0, 1.0)
            window = 0.5 - 0.5 * np.cos(np.pi * edge)
            x = amplitude * window * np.sin(2 * np.pi * f * t)
            parts_x.append(x)
            parts_v.append(np.gradient(x, step))
    x, v = np.concatenate(parts_x), np.concatenate(parts_v)
    return np.arange(len(x)) * step, x, v


def random_motion(
    rms: float, duration: float, seed: int, low: float = 0.5, high: float = 20.0, step: float = 2.5e-4
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, deflection and rate of a band-limited random motion with falling displacement spectrum."""
    rng = np.random.default_rng(seed)
    n = round(duration / step)
    f = np.fft.rfftfreq(n, step)
    safe = np.maximum(f, f[1])
    shape = 1.0 / (1.0 + (safe / 3.0) ** 2) * (f >= low) * (f <= high)
    spectrum = shape * np.exp(2j * np.pi * rng.random(len(f)))
    x = np.fft.irfft(spectrum, n)
    scale = rms / x.std()
    return np.arange(n) * step, scale * x, scale * np.fft.irfft(spectrum * 2j * np.pi * f, n)


def bench_record(
    stiffness: float,
    damping: float,
    laws: tuple[tuple[int, tuple[float, ...]], ...],
    motion: tuple[np.ndarray, np.ndarray, np.ndarray],
    *,
    rate_hz: float = 1000.0,
    noise_share: float = 0.01,
    seed: int = 0,
) -> BenchRecord:
    """Return a bench record at a sample rate; noise as a share of the rms of force and (a tenth of it) of deflection."""
    time, x, v = motion
    force = mount_force(time, x, v, stiffness, damping, laws)
    every = slice(None, None, round(1.0 / (rate_hz * (time[1] - time[0]))))
    rng = np.random.default_rng(seed)
    t, x, clean = time[every], x[every], force[every]
    noisy = clean + rng.normal(0.0, noise_share * clean.std(), len(clean))
    return BenchRecord(t, x + rng.normal(0.0, 0.1 * noise_share * x.std(), len(x)), noisy, clean)
