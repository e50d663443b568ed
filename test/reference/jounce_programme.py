# Copyright 2026 ride_estimation contributors
"""A synthetic jounce bumper and its bench programme, written without the package.

The bumper: exponential static curve, Dahl friction whose height grows with travel (integrated in time with small steps, not
by branches), five relaxation springs behind contact points with a soft-plus entry (the package uses a parabola), integrated
by the trapezoidal rule at four times the record's rate. Travel and force are positive in compression, m and N.
"""

from __future__ import annotations

import math

import numpy as np

REFERENCE = 0.075
FINE = 4
CONTACTS = np.array([0.0, 0.018, 0.033, 0.047, 0.058])
STIFFNESS = np.array([5e3, 9e3, 16e3, 36e3, 80e3])
RATES = np.array([9.0, 16.0, 28.0, 45.0, 70.0])
ENTRY = 0.8e-3


def static_force(u):
    """9 kN at the reference travel."""
    return np.where(u > 0.0, 2.2e4 * u + 14.5 * np.expm1(np.maximum(u, 0.0) / 0.012), 0.0)


def height(u):
    """Hysteresis height: not similar to the static curve."""
    s = np.clip(u / REFERENCE, 0.0, None)
    return 1800.0 * (0.25 * s + 0.75 * s**3)


def bumper_force(t, u):
    """Return the force over a finely sampled travel, step by step."""
    h = t[1] - t[0]
    v = np.gradient(u, h)
    share = height(u) / 1800.0
    slope = 1.2e5 + share**0.8 * (6.0e5 - 1.2e5)
    depth = ENTRY * np.logaddexp(0.0, (u[:, None] - CONTACTS) / ENTRY)
    friction = 0.0
    out = np.empty(u.size)
    a, b = (1.0 - 0.5 * h * RATES) / (1.0 + 0.5 * h * RATES), 1.0 / (1.0 + 0.5 * h * RATES)
    away = CONTACTS - 4.0 * ENTRY
    state = np.empty(u.size)
    steps = np.diff(u, prepend=u[0])
    for k in range(u.size):
        d = steps[k]
        friction += (
            slope[k] * d * (1.0 - friction / 900.0 * (1.0 if d > 0 else -1.0))
            if abs(d) * slope[k] < 450.0
            else (math.copysign(900.0, d) - friction) * (1.0 - math.exp(-slope[k] * abs(d) / 900.0))
        )
        state[k] = friction
    for i in range(5):
        m = 0.0
        column = depth[:, i].tolist()
        free = (u < away[i]).tolist()
        before = column[0]
        force = np.empty(u.size)
        ai, bi = float(a[i]), float(b[i])
        for k, value in enumerate(column):
            m = 0.0 if free[k] else ai * m + bi * (value - before)
            before = value
            force[k] = m if m > 0.0 else 0.0
        memory_force = STIFFNESS[i] * force
        out = memory_force if i == 0 else out + memory_force
    out = out + static_force(u) + state * height(u) / 1800.0
    return np.where(u > 0.0, out, 0.0), v


def _smooth(x, samples):
    kernel = np.hanning(samples + 2)[1:-1]
    kernel /= kernel.sum()
    return np.convolve(np.pad(x, samples, mode="edge"), kernel, mode="same")[samples:-samples]


def _path(targets, speeds, dwell, h):
    parts = [np.full(round(0.3 / h), -0.002)]
    for target, speed in zip(targets, speeds):
        n = max(2, round((target + 0.002) / speed / h))
        up = np.linspace(-0.002, target, n)
        parts += [up, up[::-1], np.full(round(dwell / h), -0.002)]
    return np.concatenate(parts)


def programme(seed, rate_hz=1000.0):
    """Return name -> (time, travel, clean force) of the five excitations."""
    rng = np.random.default_rng(seed)
    h = 1.0 / (rate_hz * FINE)
    paths = {
        "static_ramps": _smooth(_path([0.030, 0.045, 0.060, 0.068, 0.075], [0.010] * 5, 1.0, h), 80),
        "dynamic_ramps": _smooth(_path([0.066] * 6, [0.05, 0.1, 0.25, 0.5, 1.0, 2.0], 1.0, h), 24),
    }
    sweep = [np.full(round(0.3 / h), -0.002)]
    for amplitude in np.linspace(0.012, 0.068, 8):
        n = round(0.2 / h)
        sweep += [-0.002 + (amplitude + 0.002) * np.sin(np.pi * np.arange(n) / n), np.full(round(1.0 / h), -0.002)]
    paths["amplitude_sweep"] = _smooth(np.concatenate(sweep), 24)
    for name, level, bump, band in (("road_a", 0.018, 0.0, (1.0, 14.0)), ("road_b", 0.012, 0.052, (0.8, 10.0))):
        n = round(25.0 / h)
        f = np.fft.rfftfreq(n, h)
        shape = np.where((f > band[0]) & (f < band[1]), 1.0 / np.maximum(f, 0.1) ** 0.7, 0.0)
        noise = np.fft.irfft(shape * np.exp(2j * np.pi * rng.random(f.size)), n)
        noise *= level / np.std(noise)
        t = np.arange(n) * h
        wave = bump * np.exp(-(((t - 12.0) / 0.6) ** 2)) * np.sin(2 * np.pi * 1.2 * (t - 11.8))
        paths[name] = np.clip(noise + wave + 0.006, -0.08, 0.0745)
        paths[name] = _smooth(paths[name], 40)
    found = {}
    for name, path in paths.items():
        t = np.arange(path.size) * h
        force, _ = bumper_force(t, path)
        found[name] = (t[::FINE], path[::FINE], force[::FINE])
    return found


def measured(seed, force_noise=14.0, travel_noise=2e-6):
    """Return name -> (time, travel, force, clean force) with sensor noise; 14 N is a mean noise floor of 1.7 %."""
    rng = np.random.default_rng(seed + 1000)
    return {
        name: (t, u + travel_noise * rng.standard_normal(u.size), f + force_noise * rng.standard_normal(f.size), f)
        for name, (t, u, f) in programme(seed).items()
    }
