# Copyright 2026 ride_estimation contributors
"""The fire truck of document 002 as an independent world: quarter car over a 10 x 10 cm block, adaptive integrator."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

MS, MU, RATE, SPEED, RADIUS = 2500.0, 310.0, 400.0, 5 / 3.6, 0.5  # kg, kg, Hz, m/s, m
KS, KT, CS, CT = 300e3, 1e6, 20e3, 500.0  # N/m, N/m, N s/m, N s/m
TIME = np.arange(0, 3.0, 1 / RATE)


def hub_path(time):
    """Rigid wheel over a 10 x 10 cm block, written from the circle: own formula of this test."""
    s = SPEED * time - 0.8
    run_up = np.sqrt(RADIUS**2 - (RADIUS - 0.1) ** 2)
    rise = np.where((s > -run_up) & (s < 0), np.sqrt(np.maximum(RADIUS**2 - s**2, 0)) - (RADIUS - 0.1), 0.0)
    top = np.where((s >= 0) & (s <= 0.1), 0.1, 0.0)
    fall = np.where((s > 0.1) & (s < 0.1 + run_up), np.sqrt(np.maximum(RADIUS**2 - (s - 0.1) ** 2, 0)) - (RADIUS - 0.1), 0.0)
    return rise + top + fall


def truth(road, body_force=None, noise=0.02, seed=0):
    """Accelerations of body and axle by an adaptive integrator with the road splined between samples."""
    grid_rate = np.gradient(road(TIME), TIME)

    def rhs(t, y):
        u, ud = road(np.array(t)).item(), np.interp(t, TIME, grid_rate)
        spring = KS * (y[0] - y[1]) + CS * (y[2] - y[3])
        tyre = KT * (y[1] - u) + CT * (y[3] - ud)
        push = body_force(t) if body_force else 0.0
        return [y[2], y[3], (-spring + push) / MS, (spring - tyre) / MU]

    solution = solve_ivp(rhs, (0, TIME[-1]), np.zeros(4), t_eval=TIME, max_step=1 / RATE, rtol=1e-8, atol=1e-10)
    derivative = np.array([rhs(t, y)[2:] for t, y in zip(TIME, solution.y.T)])
    return derivative + noise * np.random.default_rng(seed).standard_normal(derivative.shape)
