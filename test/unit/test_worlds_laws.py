# Copyright 2026 ride_estimation contributors
"""The foreign laws against closed forms: loop areas, dynamic stiffness, passivity."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import trapezoid
from worlds import laws
from worlds.bench import bench_record, mount_force, random_motion, sweep

STEP = 2e-4


def _cycle(amplitude: float, frequency: float, cycles: int = 6) -> tuple[np.ndarray, np.ndarray, np.ndarray, slice]:
    t = np.arange(round(cycles / frequency / STEP) + 1) * STEP
    w = 2 * np.pi * frequency
    last = slice(len(t) - 1 - round(1.0 / frequency / STEP), None)
    return t, amplitude * np.sin(w * t), amplitude * w * np.cos(w * t), last


def _loss(law: int, parameters: tuple[float, ...], amplitude: float, frequency: float) -> float:
    t, x, v, last = _cycle(amplitude, frequency)
    return float(trapezoid((mount_force(t, x, v, 0.0, 0.0, ((law, parameters),)) * v)[last], t[last]))


FRICTION = {
    "lugre": (laws.LUGRE, (1e7, 0.0, 100.0, 100.0, 0.01)),
    "bouc_wen": (laws.BOUC_WEN, (100.0, 5e-5, 0.5, 1.0)),
    "stribeck": (laws.STRIBECK, (100.0, 100.0, 0.01, 1e-4)),
    "jenkins_chain": (laws.JENKINS, (100.0 / 5e-5, 100.0, 8, 4.0)),
}


@pytest.mark.parametrize("form", sorted(FRICTION))
def test_friction_loses_four_force_amplitudes_per_cycle_at_any_frequency(form: str) -> None:
    law, parameters = FRICTION[form]
    for frequency in (0.5, 5.0):
        loss = _loss(law, parameters, 0.02, frequency)
        assert loss == pytest.approx(4 * 100.0 * 0.02, rel=0.02)  # J; the elastic part of the slip costs below 2 %


@pytest.mark.parametrize("form", ["two", "ten"])
def test_maxwell_cells_have_their_dynamic_stiffness(form: str) -> None:
    n, exponent = {"two": (2, 0.0), "ten": (10, 0.4)}[form]
    tau = 0.005 * 200.0 ** (np.arange(n) / (n - 1.0))
    share = tau**-exponent
    share /= share.sum()
    amplitude, frequency = 0.01, 2.0
    t, x, v, last = _cycle(amplitude, frequency, 12)
    force = mount_force(t, x, v, 0.0, 0.0, ((laws.MANY_CELLS, (1e5, 0.005, 1.0, n, exponent)),))
    w = 2 * np.pi * frequency
    expected = 1e5 * np.sum(share * 1j * w * tau / (1.0 + 1j * w * tau))
    phasor = 2j * frequency * trapezoid((force * np.exp(-1j * w * t))[last], t[last]) / amplitude
    # slow cells (1 s) still carry 0.2 % of their start after 6 s
    assert abs(phasor - expected) < 0.005 * abs(expected)


@pytest.mark.parametrize(
    ("law", "parameters", "x", "expected"),
    [
        (laws.HYPERBOLIC, (1e5, 0.01), 0.02, -1e5 * 0.02 * 2.0 / 3.0),
        (laws.CONTOURED, (1e5, 0.01, 0.3), 0.02, 1e5 * (0.01 * (np.sin(2.3) - np.sin(0.3)) - 0.02)),
        (laws.OFFSET_SQUARE, (1e5, 0.01, 0.005), 0.02, 1e5 * (0.015**2 + 0.005**2) / 0.01),
        (laws.HOLLOW, (1e5, 0.01, 0.005), -0.02, -1e5 * 0.015**3 / 0.01**2),
        (laws.HOLLOW, (1e5, 0.01, 0.005), 0.02, 0.0),
        (laws.FOAM, (50.0, 0.015, 0.005, 0.005, 0.4, 0.1, 1.0), 0.02, 50.0 * (2.0 - np.exp(-1.0))),
        (laws.FOAM, (50.0, 0.015, 0.005, 0.005, 0.4, 0.1, -1.0), 0.02, 0.0),
        (laws.SOFT_PLAY, (1e5, 0.0, 0.005, 0.001, 0.0), 0.02, -1e5 * 0.006),
    ],
)
def test_static_laws_have_their_formula(law: int, parameters: tuple[float, ...], x: float, expected: float) -> None:
    force = mount_force(np.array([0.0, 1.0]), np.array([x, x]), np.zeros(2), 0.0, 0.0, ((law, parameters),))[-1]
    assert force == pytest.approx(expected, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("law", sorted(laws.NAMES))
def test_laws_are_silent_at_rest(law: str) -> None:
    parameters = {
        "lugre": (1e6, 0.0, 100.0, 120.0, 0.01), "bouc_wen": (100.0, 1e-3, 0.5, 1.2), "stribeck": (100.0, 120.0, 0.01, 1e-3),
        "jenkins_chain": (1e5, 100.0, 8, 10.0), "hyperbolic": (1e5, 0.01), "contoured": (1e5, 0.01, 0.3),
        "offset_square": (1e5, 0.01, 0.005), "hollow": (1e5, 0.01, 0.002), "blow_off": (1e3, 0.1, 0.03, 0.02),
        "relief": (1e3, 0.1, 0.02), "orifice": (1e3, 0.1, 0.02), "foam": (50.0, 0.01, 0.005, 0.005, 0.4, 0.1, 0.0),
        "soft_play": (1e5, 1e3, 0.002, 1e-4, 0.01), "many_cells": (1e5, 0.01, 1.0, 6, 0.3), "levelling": (500.0, 1e5, 0.3),
        "inerter": (50.0, 1e6, 1e3),
    }[law]  # fmt: skip
    t = np.arange(200) * STEP
    assert np.allclose(mount_force(t, np.zeros(200), np.zeros(200), 0.0, 0.0, ((laws.NAMES[law], parameters),)), 0.0, atol=1e-9)


def test_inerter_resists_acceleration() -> None:
    amplitude, frequency = 0.01, 2.0
    t, x, v, last = _cycle(amplitude, frequency)
    force = mount_force(t, x, v, 0.0, 0.0, ((laws.INERTER, (50.0, 4e6, 1e4)),))
    w = 2 * np.pi * frequency
    phasor = 2j * frequency * trapezoid((force * np.exp(-1j * w * t))[last], t[last]) / amplitude
    assert phasor.real == pytest.approx(-50.0 * w**2, rel=0.02)


def test_lossy_bumper_takes_energy_and_gives_none() -> None:
    assert _loss(laws.FOAM, (50.0, 0.005, 0.005, 0.005, 0.4, 0.1, 0.0), 0.02, 2.0) > 0.1  # J


def test_bench_record_has_the_stated_noise() -> None:
    record = bench_record(1e5, 1e3, (), random_motion(0.003, 20.0, 1), noise_share=0.02, seed=3)
    assert np.std(record.force - record.clean_force) == pytest.approx(0.02 * record.clean_force.std(), rel=0.03)
    t, x, v = sweep((0.001, 0.004), (1.0, 5.0))
    assert np.abs(x).max() == pytest.approx(0.004, rel=1e-3) and len(t) == len(v)
