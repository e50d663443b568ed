# Copyright 2026 ride_estimation contributors
"""Small runs for the tests of the diagnosis: a quarter car integrated here, with the laws that hide causes in all worlds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from worlds.hiding import Site, law_of
from worlds.laws import MEMORY, PARAMETERS, law_force

from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

MASS, STIFFNESS, DAMPING = 400.0, 44e3, 2e3
GRAVITY = 9.80665
RATE_HZ, FINE = 100.0, 16
#: deflection of 4.3 mm and rate of 0.06 m/s, rms, of the run without a law
SITE = Site(STIFFNESS, DAMPING, MASS, 0.0043, 0.06, STIFFNESS * 0.0043)


def quarter_car(noise: float = 0.005) -> Vehicle:
    """Return what the engineer believes: stiffness 9 % low, damping 25 % high, and the noise of the sensors [m/s^2]."""
    body = Body("body_mass", Prior(MASS), np.zeros(3), np.eye(3), coordinates=("z",))
    element = KelvinVoigt(stiffness=40e3, damping=2.5e3)
    mount = Mount("strut", np.zeros(3), "body_mass", "axle", {"z": element})
    sensors = {
        "body": Sensor("body", "accelerometer", "/body", "body_mass", noise_std=noise),
        "base": Sensor("base", "accelerometer", "/base", "axle", mount="strut", noise_std=noise),
    }
    return Vehicle("quarter_car", {"body_mass": body}, {"strut": mount}, sensors)


def hiding_law(form: str, size: float) -> Callable[[float, float], float]:
    """Return a law for one run of :func:`quarter_car_run`: it remembers what it went through."""
    code, shape = law_of(form, SITE, size)
    parameters = np.array([*shape, *[0.0] * (PARAMETERS - len(shape))])
    memory, after = np.zeros((2, MEMORY))
    step = 1.0 / (RATE_HZ * FINE)

    def law(x: float, v: float) -> float:
        force = law_force(code, parameters, memory, x, v, step, after)
        memory[:] = after
        return float(force)

    return law


def bolt_in_a_hole(clearance: float, level: float) -> Callable[[float, float], float]:
    """Return a slider that gives way at a force [N] behind a clearance [m] and a contact that stiffens: friction behind play.

    For one run: it remembers where it slid to.
    """
    soft = 0.05 * SITE.deflection
    slid, last = 0.0, 1.0 - math.exp(-(2.5**1.5))

    def law(x: float, v: float) -> float:
        nonlocal slid
        most = 0.5 * clearance + 2.5 * soft
        slid = min(max(slid, x - most), x + most)
        depth = max(abs(x - slid) - 0.5 * clearance, 0.0) / soft
        return math.copysign(level * (1.0 - math.exp(-(depth**1.5))) / last, x - slid)

    return law


def bolt_in_a_guide(clearance: float, level: float) -> Callable[[float, float], float]:
    """Return a slider as that of :func:`bolt_in_a_hole` that a clearance [m] around rest keeps from what moves. For one run."""
    sliding = bolt_in_a_hole(0.0, level)
    return lambda x, v: sliding(x - min(max(x, -0.5 * clearance), 0.5 * clearance), v)


def relief_valve(knee: float, share: float) -> Callable[[float, float], float]:
    """Return what a valve that opens at a rate [m/s] takes away of a share of the damping beyond it."""
    return lambda x, v: -share * DAMPING * math.copysign(max(abs(v) - knee, 0.0), v)


def loose_damper(clearance: float) -> Callable[[float, float], float]:
    """Return what the damper lacks behind a clearance [m] and a joint 40 times as stiff as the damper at 1 Hz. For one run."""
    joint, step, piston = 40.0 * 2.0 * math.pi * DAMPING, 1.0 / (RATE_HZ * FINE), 0.0

    def law(x: float, v: float) -> float:
        nonlocal piston
        slack = x - piston
        force = joint * (slack - min(max(slack, -0.5 * clearance), 0.5 * clearance))
        piston += step * force / DAMPING
        return force - DAMPING * v

    return law


def load_taken_on(mass: float, at_s: float, over_s: float) -> Callable[[float, float], float]:
    """Return the force that makes the body heavier by a mass [kg] that comes on over some seconds. For one run."""
    step, now = 1.0 / (RATE_HZ * FINE), 0.0

    def law(x: float, v: float) -> float:
        nonlocal now
        now += step
        load = mass * min(max((now - at_s) / over_s, 0.0), 1.0)
        carried = STIFFNESS * x + DAMPING * v
        return MASS * (carried + load * GRAVITY) / (MASS + load) - carried

    return law


def iwan_chain(level: float, reach: float, count: int = 12) -> Callable[[float, float], float]:
    """Return parallel elements of one stiffness that slide at evenly spread forces, the last after a stroke [m] (Iwan 1966)."""
    limits = np.arange(1, count + 1) / np.arange(1, count + 1).sum() * level
    stiffness = limits[-1] / reach
    forces, before = np.zeros(count), 0.0

    def law(x: float, v: float) -> float:
        nonlocal before
        np.clip(forces + stiffness * (x - before), -limits, limits, out=forces)
        before = x
        return float(forces.sum())

    return law


def quarter_car_run(
    seed: int,
    seconds: float = 40.0,
    rate_hz: float = RATE_HZ,
    law: Callable[[float, float], float] | None = None,
    noise: float = 0.005,
    sag: float | None = None,
    roughness: float = 1.0,
) -> UniformRun:
    """Integrate ``m a = -k x - c v - law(x, v)`` over a random base with semi-implicit steps of 1/16 sample.

    ``roughness`` multiplies the base motion. With ``sag`` [m] a transducer ``travel`` reads the deflection plus that.
    """
    rng = np.random.default_rng(seed)
    n = int(seconds * rate_hz) * FINE
    f, spectrum = _rough(rng, n, 1.0 / (rate_hz * FINE))
    base = np.fft.irfft(spectrum, n)
    scale = 0.006 * roughness / np.std(base)
    w = 2j * np.pi * f
    u = scale * base
    du, ddu = (scale * np.fft.irfft(spectrum * w**p, n) for p in (1, 2))
    return ridden(f"quarter_car_{seed}", (u, du, ddu), rng, rate_hz, law, noise, sag)


def _rough(rng: np.random.Generator, n: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and spectrum of a random base motion of n samples, any size."""
    f = np.fft.rfftfreq(n, step)
    shape = np.where((f > 0.5) & (f < 20.0), 1.0 / np.maximum(f, 0.5) ** 1.5, 0.0)
    return f, shape * np.exp(2j * np.pi * rng.random(len(f)))


def rough_patches(
    seed: int, middles_s: Sequence[float], width_s: float, seconds: float = 60.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a smooth base motion, 2.5 times as large at some places of a width, with its two derivatives, for :func:`ridden`."""
    rng = np.random.default_rng(seed)
    n, step = int(seconds * RATE_HZ) * FINE, 1.0 / (RATE_HZ * FINE)
    base = np.fft.irfft(_rough(rng, n, step)[1], n)
    time, envelope = np.arange(n) * step, np.ones(n)
    for middle in middles_s:
        phase = np.clip(2.0 * np.pi * (time - middle) / width_s, -np.pi, np.pi)
        envelope += 0.75 * (1.0 + np.cos(phase))
    u = 0.003 * base / np.std(base) * envelope
    du = np.gradient(u, step)
    return u, du, np.gradient(du, step)


def ridden(
    name: str, base: tuple[np.ndarray, np.ndarray, np.ndarray], rng: np.random.Generator, rate_hz: float = RATE_HZ,
    law: Callable[[float, float], float] | None = None, noise: float = 0.005, sag: float | None = None,
) -> UniformRun:
    """Integrate the quarter car over a base given with its two derivatives in steps of 1/16 sample."""
    u, du, ddu = base
    fine, n = FINE, len(u)
    count, step = n // fine, 1.0 / (rate_hz * fine)
    z, v = u[0], du[0]
    acceleration, deflection = np.empty(n), np.empty(n)
    for i in range(n):
        x, rate = z - u[i], v - du[i]
        force = STIFFNESS * x + DAMPING * rate + (law(x, rate) if law is not None else 0.0)
        acceleration[i], deflection[i] = -force / MASS, x
        v += step * acceleration[i]
        z += step * v
    zero = np.zeros(count)
    data = {}
    for sensor, values in (("body", acceleration), ("base", ddu)):
        clean = np.stack([zero, zero, values[::fine] + GRAVITY], axis=1)
        data[sensor] = clean + noise * rng.standard_normal(clean.shape)
    if sag is not None:
        data["travel"] = (deflection[::fine] + sag + 1e-4 * rng.standard_normal(count))[:, None]
    valid = {sensor: np.ones(count, dtype=bool) for sensor in data}
    return UniformRun(name, rate_hz, 0, data, valid)
