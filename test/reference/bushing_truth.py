# Copyright 2026 ride_estimation contributors
"""A rubber bushing simulated sample by sample, and its test signals, written without the package (SI units)."""

from __future__ import annotations

import functools
import math

import numpy as np
from scipy.special import erfc

#: document 003 Table 3 in SI; modified Berg: ke1 ke3 k1 c1 k2 c2 f x2; Berg: ke k c f x2; KV: k c
TABLE_3 = {
    ("kelvin_voigt", "frequency"): (167.3e3, 0.167e3),
    ("kelvin_voigt", "time"): (127.7e3, 0.591e3),
    ("berg", "frequency"): (107.9e3, 32.2e3, 0.57e3, 206.8, 1.82e-3),
    ("berg", "time"): (120.2e3, 13.5e3, 4.06e3, 64.08, 0.498e-3),
    ("modified_berg", "frequency"): (120.6e3, -0.056e9, 10.341e3, 1.743e3, 26.429e3, 0.416e3, 106.4, 1.082e-3),
    ("modified_berg", "time"): (127.1e3, -0.116e9, 6.285e3, 1.555e3, 20.0e3, 0.159e3, 81.73, 0.766e-3),
}
TRUTH = np.array(TABLE_3["modified_berg", "time"])


def overlay_force(p, x, h):
    """Cubic spring, two Maxwell cells (trapezoidal rule), friction by turning points; one sample after the other."""
    ke1, ke3, k1, c1, k2, c2, f_max, x2 = (float(v) for v in p)
    a1, a2 = 0.5 * h * k1 / c1, 0.5 * h * k2 / c2
    d1, g1, d2, g2 = (1 - a1) / (1 + a1), k1 / (1 + a1), (1 - a2) / (1 + a2), k2 / (1 + a2)
    m1 = m2 = friction = anchor_force = 0.0
    anchor = before = float(x[0])
    direction = 0
    out = np.empty(len(x))
    for i, value in enumerate(x.tolist()):
        step = value - before
        m1, m2 = d1 * m1 + g1 * step, d2 * m2 + g2 * step
        new = 1 if step > 0 else -1 if step < 0 else direction
        if new != direction:
            anchor, anchor_force, direction = before, friction, new
        u = abs(value - anchor)
        s = direction * anchor_force / f_max
        friction = direction * f_max * (s + (1 - s) * u / (x2 * (1 - s) + u))
        out[i] = ke1 * value + ke3 * value**3 + m1 + m2 + friction
        before = value
    return out


def stepped_chirp(h=1e-3, duration=200.0):
    """Document 003 (28), (29), Table 2: half periods of constant frequency."""
    t = np.arange(round(duration / h) + 1) * h
    amplitude = 0.02 + 0.5 * 9.98 * erfc((t - 135.48) / 32.26)
    x = np.zeros(t.size)
    begin, sign = 0.0, 1.0
    while begin < duration:
        f = 39.985 / math.sinh(0.056 * 200.0) * math.sinh(0.056 * begin) + 0.015
        lo, hi = math.ceil(begin / h - 1e-9), min(t.size, math.ceil((begin + 0.5 / f) / h - 1e-9))
        x[lo:hi] = sign * amplitude[lo:hi] * np.sin(2 * np.pi * f * (t[lo:hi] - begin))
        begin, sign = begin + 0.5 / f, -sign
    return t, 1e-3 * x


def validation_signals(seed=5, h=1e-3):
    """V1 0.5-10 Hz 1 mm rms, V2 1-30 Hz 0.25 mm rms, V3 2 Hz pulse of 5 mm under a Hann window."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(20.0 / h)) * h
    f = np.fft.rfftfreq(t.size, h)
    found = {}
    for name, low, high, rms in (("V1", 0.5, 10.0, 1e-3), ("V2", 1.0, 30.0, 0.25e-3)):
        x = np.fft.irfft(((f >= low) & (f <= high)) * np.exp(2j * np.pi * rng.random(f.size)), t.size)
        x = x * rms / np.std(x)
        found[name] = (t, x * np.minimum(1.0, t / 0.5))
    pulse_t = np.arange(round(5.0 / h)) * h
    window = np.where(pulse_t < 3.0, 0.5 - 0.5 * np.cos(2 * np.pi * pulse_t / 3.0), 0.0)
    found["V3"] = (pulse_t, 5e-3 * window * np.sin(2 * np.pi * 2.0 * pulse_t))
    return found


def dma_plan():
    """35 tests: A = 0.02 mm 2^i, f = 0.04 Hz 10^(0.3 j), i + j <= 10 and even."""
    return [(2e-5 * 2**i, 0.04 * 10 ** (0.3 * j)) for i in range(10) for j in range(11) if i + j <= 10 and (i + j) % 2 == 0]


@functools.lru_cache(maxsize=64)
def _settled_loop(ke1, ke3, f_max, x2, amplitude, samples):
    """First harmonic of spring and friction over a simulated loop that has settled."""
    angle = np.arange(samples) * 2 * np.pi / samples
    cycles = int(np.clip(40 * x2 / amplitude, 20, 160))
    x = np.tile(amplitude * np.sin(angle), cycles)
    force = overlay_force((ke1, ke3, 0.0, 1.0, 0.0, 1.0, f_max, x2), x, 1.0)[-samples:]
    return complex(2.0 / samples * np.sum(force * np.exp(-1j * angle)) / (amplitude * -1j))


def brute_force_stiffness(p, amplitude, frequency, samples=1024):
    """First-harmonic complex stiffness: spring and friction from a settled simulated loop, Maxwell cells from the textbook."""
    ke1, ke3, k1, c1, k2, c2, f_max, x2 = (float(v) for v in p)
    w = 2 * np.pi * frequency
    first = _settled_loop(ke1, ke3, f_max, x2, float(amplitude), samples)
    return first + sum(k * 1j * w / (1j * w + k / c) for k, c in ((k1, c1), (k2, c2)))
